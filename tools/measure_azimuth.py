"""How well the precise form keeps the azimuth of light that goes to and fro below a coat, against the random walk.

    python tools/measure_azimuth.py [--paths 10000] [--seed 1] [--interface single]

Over a bright metal that absorbs little such light is most of what is seen off the mirror direction. For each width of the metal: light
from below the coat, form over walk, of views by their azimuth to the mirror direction. Views evenly spread over the hemisphere, weighted by
their cosine; two coats, clear and slightly absorbing, and two directions of light together.
"""

import argparse
import itertools

import jax
import numpy as np

from layerfit.forms import one_coat, precise
from layerfit.layers import Coat
from layerfit.stack import Stack
from layerfit.surfaces import Conductor
from layerfit.walk import walk_rows

BASES = 0.1, 0.2, 0.45
COATS = 0.06, 0.12
TAUS = 0.0, 0.1
LIGHTS_DEG = 30.0, 60.0
METAL = {"eta": 0.2, "k": 3.9}
SECTORS = {"ahead": (0.0, 45.0), "aside": (45.0, 135.0), "back": (135.0, 180.0)}
"""Degrees of azimuth from the mirror direction."""
COSINES, AZIMUTHS = 6, 12


def views() -> tuple[np.ndarray, np.ndarray]:
    """Directions (n, 3) on one side of the plane of incidence, and their azimuths from the mirror direction, degrees."""
    cosine, azimuth = np.meshgrid((np.arange(COSINES) + 0.5) / COSINES, (np.arange(AZIMUTHS) + 0.5) * 180.0 / AZIMUTHS)
    sine, phi = np.sqrt(1.0 - cosine**2), np.radians(180.0 - azimuth)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], -1).reshape(-1, 3), azimuth.ravel()


def measure(paths: int, seed: int, interface: precise.Kind) -> None:
    wo, azimuth = views()
    cases = list(itertools.product(BASES, COATS, TAUS, np.radians(LIGHTS_DEG)))
    base, coat, tau, theta = np.array(cases).T
    rows = lambda x: np.repeat(x, len(wo))  # noqa: E731
    wi = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], -1).repeat(len(wo), 0)
    all_wo = np.tile(wo, (len(cases), 1))
    full = lambda value: np.full(len(wi), value)  # noqa: E731
    top = Coat(alpha=rows(coat), eta=full(1.5), tau=rows(tau), masking="smith_separable")
    metal = Conductor(alpha=rows(base), **{key: full(value) for key, value in METAL.items()})
    truth = walk_rows(Stack((top,), metal), wi, all_wo, paths=paths, seed=seed, interface=interface)
    form = np.asarray(below(interface)(top, metal, wi, all_wo))
    shape = len(BASES), -1, len(wo)
    light, noise, found = (x.reshape(shape) * wo[:, 2] for x in (truth.mean.mean(-1), truth.se.mean(-1), form.astype(float)))
    print("base   " + "  ".join(f"{name:>13}" for name in SECTORS))
    for k, alpha in enumerate(BASES):
        ratios = []
        for low, high in SECTORS.values():
            chosen = (azimuth >= low) & (azimuth < high)
            total = light[k][:, chosen].sum()
            error = np.sqrt((noise[k][:, chosen] ** 2).sum()) / total
            ratios.append(f"{found[k][:, chosen].sum() / total:5.3f} +- {error:4.3f}")
        print(f"{alpha:5.2f}  " + "  ".join(ratios))


def below(interface: precise.Kind):
    """Light from below the coat by the precise form, of rows."""
    options = precise.Precise(interface)

    def one(coat, base, wi, wo):
        p = precise.prepare((coat,), base, options)
        return one_coat.below(one_coat.cross(p, wi), one_coat.cross(p, wo), p)

    as_rows = jax.jit(jax.vmap(one))
    return lambda *arguments: as_rows(*jax.tree.map(lambda x: np.asarray(x, np.float32), arguments))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--paths", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--interface", choices=("single", "multi"), default="single")
    arguments = parser.parse_args()
    measure(arguments.paths, arguments.seed, arguments.interface)


if __name__ == "__main__":
    main()
