"""Measure how near the forms are to the random walk where the base is not one of those that their constants were fitted to.

    python tools/measure_bases.py [--paths 20000] [--interface single]

Car paints and the classic lobes below a clear coat, in the corrected and the faithful form; and a patina where it covers, one onset time old:
its film, and its film with light that is scattered once, against a walk through one medium that does both. Printed for each angle
of the light: the sum of |f - walk| cos over that of walk cos, of light from below the top boundary, mean of the channels, and the
noise of the walk in it.
"""

import argparse
import dataclasses
import math
from typing import Any

import jax
import numpy as np

from layerfit.forms.faithful import Faithful
from layerfit.forms.growth import Cover
from layerfit.forms.patina import Spot
from layerfit.layers import Coat, Patina
from layerfit.preset import read_preset
from layerfit.stack import Stack, evaluate
from layerfit.surfaces import Blinn, CookTorrance, Lafortune, Phong, TorranceSparrow
from layerfit.truth import Fan, below, noise, relative_error
from layerfit.walk import Haze, top_lobe, walk

INCIDENCE_DEG = 0.0, 20.0, 40.0, 60.0, 75.0
CLEAR = Coat(alpha=0.05, eta=1.5)
WOOD = [0.5, 0.28, 0.13]
COPPER: dict[str, Any] = {"eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}


def paint(name: str) -> Any:
    """A published paint without its last lobe, which is that of its clear coat."""
    base = read_preset(f"car_paint_{name}").base
    last = "_3" if base.ks_3 is not None else "_2"
    return dataclasses.replace(base, **{f"{field}{last}": None for field in ("ks", "f0", "alpha")})


BASES = {
    "car paint, Polaris silver": paint("polaris_silver"),
    "car paint, BMW 339": paint("bmw_339"),
    "car paint, Opel titanium": paint("opel_titan"),
    "car paint, blue": paint("blue"),
    "Phong": Phong(kd=WOOD, ks=0.3, exponent=40.0),
    "Blinn": Blinn(kd=WOOD, ks=0.2, exponent=100.0),
    "Lafortune": Lafortune(kd=WOOD, ks=[1.5, 1.2, 0.9], cx=-0.98, cz=0.97, exponent=30.0),
    "Torrance-Sparrow": TorranceSparrow(ks=12.0, kappa=7.0, kd=0.1, **COPPER),
    "Cook-Torrance": CookTorrance(alpha=0.25, ks=0.6, kd=[0.1, 0.05, 0.02], **COPPER),
}

FILM: dict[str, Any] = {"alpha": 0.3, "eta": 2.7, "tau": [0.05, 0.3, 0.8]}
ONCE: dict[str, Any] = {"depth": 0.3, "g": 0.0}
PATINAS = {
    "patina, film": Patina(**FILM),
    "patina, film and scattering, albedo .2": Patina(**FILM, **ONCE, albedo=0.2),
    "patina, film and scattering, albedo .6": Patina(**FILM, **ONCE, albedo=0.6),
    "patina, the same, light scattered once added": Patina(**FILM, **ONCE, albedo=0.6, mixing="added"),
    "patina, film and scattering forwards": Patina(**FILM, depth=1.0, g=0.6, albedo=0.9),
}


def fan(incidence_deg: float) -> Fan:
    """Light and 61 views: an even spiral over the hemisphere, to 80 degrees, and a rosette about the mirror direction."""
    theta = math.radians(incidence_deg)
    z = 1.0 - (1.0 - math.cos(math.radians(80.0))) * (np.arange(48) + 0.5) / 48
    phi = np.arange(48) * math.pi * (3.0 - math.sqrt(5.0))
    even = np.stack([np.sqrt(1.0 - z * z) * np.cos(phi), np.sqrt(1.0 - z * z) * np.sin(phi), z], -1)
    mirror = np.array([-math.sin(theta), 0.0, math.cos(theta)])
    along = np.array([math.cos(theta), 0.0, math.sin(theta)])
    rings = [(r, psi) for r in (0.07, 0.18, 0.35) for psi in np.radians([0.0, 90.0, 180.0, 270.0])]
    near = [
        math.cos(r) * mirror + math.sin(r) * (math.cos(psi) * along + math.sin(psi) * np.array([0.0, 1.0, 0.0]))
        for r, psi in rings
    ]
    wo = np.vstack([even, mirror, near])
    wo = wo[wo[:, 2] > math.cos(math.radians(85.0))]
    return Fan(
        incidence_deg, np.array([math.sin(theta), 0.0, math.cos(theta)]), wo, np.degrees(np.arctan2(-wo[:, 0], wo[:, 2]))
    )


def patina_below(stack: Stack, coated: Stack, at: Fan) -> np.ndarray:
    """Light (n, 3) from below the top boundary of a patina that covers all and is as thick as its fields say."""
    with jax.enable_x64(True):
        wide = stack.astype(np.float64)
        one = np.ones(())
        prepared = dataclasses.replace(wide.prepare(), spot=Spot(Cover(one, 0.0 * one), one))
        f = jax.jit(jax.vmap(lambda wo: evaluate(wide.form, prepared, at.wi, wo)))(at.wo)
        return np.asarray(f) - top_lobe(coated, at.wi, at.wo)


def medium(patina: Patina) -> tuple[Coat, dict[str, Haze]]:
    """Film and scattering of a patina as the walk knows them."""
    coat = dataclasses.replace(patina, mixing="medium").film
    if coat.tau_s is None:
        return coat, {}
    return dataclasses.replace(coat, tau_s=None, g=None), {patina.name: Haze(coat.tau_s, coat.g)}


def report(name: str, errors: list[float]) -> None:
    print(f"{name:<52}" + "".join(f"{error:8.3f}" for error in errors))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paths", type=int, default=20_000)
    parser.add_argument("--interface", choices=("single", "multi"), default="single")
    given = parser.parse_args()
    fans = [fan(angle) for angle in INCIDENCE_DEG]
    options: dict[str, Any] = {"paths": given.paths, "interface": given.interface}
    print(f"{'':<52}" + "".join(f"{angle:8.0f}" for angle in INCIDENCE_DEG))
    for name, base in BASES.items():
        stack = Stack((CLEAR,), base)
        truths = [walk(stack, at.wi, at.wo, **options) for at in fans]
        for form in (stack.form, Faithful()):
            values = below(dataclasses.replace(stack, form=form), fans)
            errors = [float(np.nanmean(relative_error(*row))) for row in zip(values, truths, fans, strict=True)]
            report(f"{name}, {type(form).__name__.lower()}", errors)
        report(f"{name}, noise", [float(np.nanmean(noise(*row))) for row in zip(truths, fans, strict=True)])
    metal = read_preset("patinated_copper").base
    for name, patina in PATINAS.items():
        coat, haze = medium(patina)
        coated = Stack((coat,), metal)
        truths = [walk(coated, at.wi, at.wo, haze=haze, **options) for at in fans]
        values = [patina_below(Stack((patina,), metal), coated, at) for at in fans]
        report(name, [float(np.nanmean(relative_error(*row))) for row in zip(values, truths, fans, strict=True)])
        report(f"{name}, noise", [float(np.nanmean(noise(*row))) for row in zip(truths, fans, strict=True)])


if __name__ == "__main__":
    main()
