"""Whether sigmas are true: fits of the model's own images under noise that is drawn anew, and how far they end from what made the image.

    python benchmarks/sigma_coverage.py [MODEL ...] [--fits 100] [--noise 0.02] [--exponent 0.7] [--output pulls.csv]

The pull of a value is (found - true) / sigma. Gaussian errors of true sigmas leave 68.3 % of pulls within 1 and 95.4 % within 2, with mean 0 and
standard deviation 1. One row a parameter, the channels of a colour together, and one for all of a model. Behind the shares stand the 95 % limits of
that many fits: a row in twenty lies outside of them by chance. Noise is Gaussian, of standard error `noise` w (f / w)^exponent for
the radiance f and its 98th percentile w, known to the fit as a file's would be; the fit's own law has the exponent .7.
"""

import argparse
import csv
import dataclasses
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom, norm

import layerfit as lf
from layerfit._place import narrowed
from layerfit.capture.exr import write_exr
from layerfit.capture.geometry import sphere_surface
from layerfit.capture.reference import load_reference
from layerfit.capture.scene import Camera, Directional, Light, Reference, Sphere
from layerfit.fit.parameters import parametrise

SIDE = 30
"""Pixels along the image of a sphere, of which some 400 are lit and seen."""

NEAR = 0.02
"""Spread of the starts about the truth, in the coordinates of the fit: it is sigmas that are tried here, not the search."""

CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
SUN = Directional((0.46175709, 0.55410852, 0.69263564), (np.pi, np.pi, np.pi))
BEHIND = Directional((-0.36, 0.48, -0.8), (np.pi, np.pi, np.pi))
"""Light that grazes the sphere: it tells where a medium scatters to."""

COPPER: dict[str, Any] = {"eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}
TITANIUM: dict[str, Any] = {"eta": [2.741, 2.542, 2.267], "k": [3.814, 3.435, 3.039]}
WOOD = [0.5, 0.28, 0.13]
VARNISH = lf.Coat(alpha=0.12, eta=1.5, tau=[0.08, 0.25, 0.7])
METAL = lf.Conductor(alpha=0.25, **COPPER)
DUST = lf.Deposit(thickness_um=20.0, K_per_mm=[20.0, 8.0, 4.0], S_per_mm=50.0, alpha=0.3)
CRUST: dict[str, Any] = {"absorbed": [2.2, 0.28, 0.45], "scattered": 0.7}


@dataclasses.dataclass(frozen=True)
class Case:
    """A material, the parameters that are fitted (those that a fit frees, if not named), and the light."""

    stack: lf.Stack
    free: tuple[str, ...] | None = None
    lights: tuple[Light, ...] = (SUN,)


def bare(base: Any, *free: str) -> Case:
    """A base alone."""
    return Case(lf.Stack((), base), tuple(f"base.{field}" for field in free) or None)


def coated(base: Any, *free: str, coat: lf.Coat = VARNISH, form: Any = None) -> Case:
    """A base below a coat."""
    return Case(lf.Stack((coat,), base, lf.Corrected() if form is None else form), free or None)


MODELS: dict[str, Case] = {
    "conductor": bare(METAL, "alpha", "k"),
    "conductor, anisotropic Beckmann": bare(
        lf.Conductor(alpha=None, alpha_x=0.2, alpha_y=0.4, distribution="beckmann", **COPPER)
    ),
    "conductor with a film": bare(lf.Conductor(alpha=0.3, film_nm=57.0, film_eta=2.4, **TITANIUM)),
    "dielectric": bare(lf.Dielectric(alpha=0.3, eta=1.5)),
    "lambert": bare(lf.Lambert(albedo=WOOD)),
    "oren_nayar": bare(lf.OrenNayar(albedo=WOOD, sigma=0.4)),
    "phong": bare(lf.Phong(kd=WOOD, ks=0.3, exponent=20.0)),
    "blinn": bare(lf.Blinn(kd=WOOD, ks=0.2, exponent=60.0)),
    "lafortune": bare(lf.Lafortune(kd=WOOD, ks=1.2, cx=-0.97, exponent=12.0)),
    "torrance_sparrow": bare(lf.TorranceSparrow(kd=0.1, ks=9.0, kappa=5.0, **COPPER)),
    "cook_torrance": bare(lf.CookTorrance(kd=0.1, ks=0.7, alpha=0.3, **COPPER)),
    "kubelka_munk": bare(lf.KubelkaMunk(kx=[0.1, 0.4, 0.9], sx=1.2, substrate=0.3)),
    "car_paint": bare(lf.CarPaint(kd=0.1, ks=[0.3, 0.2, 0.1], alpha=0.5, ks_2=0.2, f0_2=0.5, alpha_2=0.15)),
    "flakes": bare(lf.Flakes(alpha=0.2, coverage=0.6, albedo=[0.02, 0.05, 0.3], **COPPER)),
    "faithful over conductor": coated(METAL, form=lf.Faithful()),
    "faithful over lambert": coated(lf.Lambert(albedo=WOOD), form=lf.Faithful()),
    "corrected over conductor": coated(METAL),
    "corrected over lambert": coated(lf.Lambert(albedo=WOOD)),
    "corrected over cook_torrance": coated(
        lf.CookTorrance(kd=0.1, ks=0.7, alpha=0.3, **COPPER),
        *("coat.alpha", "coat.eta", "base.kd", "base.ks", "base.alpha"),  # absorption and ks are seen by their product
    ),
    "corrected, a film on the coat": coated(
        lf.Lambert(albedo=WOOD), coat=lf.Coat(alpha=0.2, eta=1.5, film_nm=120.0, film_eta=2.0)
    ),
    "corrected, two coats": Case(
        lf.Stack((VARNISH, lf.Coat(name="primer", alpha=0.3, eta=1.8, tau=0.3)), METAL),
        ("coat.alpha", "coat.eta", "coat.tau", "primer.eta", "base.alpha"),  # absorption of two coats is seen as a sum
    ),
    "corrected, a coat that scatters": Case(
        lf.Stack((lf.Coat(alpha=0.15, tau=[0.05, 0.15, 0.4], tau_s=[0.5, 0.8, 1.2], g=0.5),), lf.Lambert(albedo=0.2)),
        ("coat.alpha", "coat.eta", "coat.tau", "coat.tau_s"),
        (SUN, BEHIND),
    ),
    "precise over conductor": coated(METAL, form=lf.Precise()),
    "precise over oren_nayar": coated(lf.OrenNayar(albedo=WOOD, sigma=0.25), form=lf.Precise()),
    "patina": Case(
        lf.Stack((lf.Patina(years=9.0, softness=0.1, cells=4.0, tau=[0.3, 0.6, 1.2], **CRUST),), METAL),
        ("patina.years", "patina.softness", "patina.alpha", "patina.tau", "base.alpha"),
    ),
    "overgrowth": Case(
        lf.Stack((lf.Overgrowth(years=9.0, softness=0.1, cells=4.0, K_per_mm=[20.0, 2.0, 6.0], S_per_mm=50.0),), METAL),
        ("overgrowth.years", "overgrowth.softness", "overgrowth.K_per_mm", "overgrowth.alpha", "base.alpha"),
    ),
    "deposit": Case(lf.Stack((DUST,), METAL), ("deposit.K_per_mm", "deposit.alpha", "deposit.eta")),
    "erosion": Case(lf.Stack((lf.Erosion(amount_um=8.0), DUST), METAL), ("erosion.amount_um", "deposit.alpha", "deposit.eta")),
    "polish": Case(
        lf.Stack((lf.Polish(height_um=12.0, strength=0.4), DUST), METAL),
        ("polish.strength", "deposit.K_per_mm", "deposit.eta"),  # strength and alpha are seen by one width
    ),
}

HARD = {
    "two coats, all free": Case(MODELS["corrected, two coats"].stack),
    "a coat that scatters, g free": dataclasses.replace(MODELS["corrected, a coat that scatters"], free=None),
    "absorption over cook_torrance": Case(MODELS["corrected over cook_torrance"].stack),
}
"""Parameters that one image tells apart so badly that errors are no longer Gaussian: run by name alone."""


def view_of(case: Case, folder: Path) -> lf.View:
    """A view of a sphere of the material, without noise."""
    path = folder / "sphere.exr"
    if not path.exists():
        covered = sphere_surface(Sphere(), CAMERA, SIDE, SIDE).covered
        write_exr(path, dict.fromkeys("RGB", np.where(covered, 0.5, 0.0)) | {"A": covered.astype(float)})
    view = load_reference(Reference(path, CAMERA, case.lights, Sphere(), {}, None, {}), 0.1)
    wi, wo, weight, place = view.samples().arrays
    target = lf.predict(case.stack, wi, wo, weight, narrowed(place, case.stack.needs))  # as it is fitted: flakes by their mean
    return dataclasses.replace(view, target=target.astype(float))


def noisy(view: lf.View, noise: float, exponent: float, seed: int) -> lf.View:
    """The same view with noise, and its standard error in the file."""
    white = np.quantile(view.target, 0.98)
    error = noise * white * (np.maximum(view.target, 0.0) / white) ** exponent
    target = view.target + error * np.random.default_rng(seed).normal(size=error.shape)
    return dataclasses.replace(view, target=target, noise=error)


def pulls(case: Case, folder: Path, fits: int, noise: float = 0.02, exponent: float = 0.7) -> dict[str, np.ndarray]:
    """Pulls of every parameter, (fits, channels) by name; NaN for a value at its bound, which has no sigma."""
    clean = view_of(case, folder)
    stack, free = parametrise(case.stack, case.free, (), "coverage")
    at = free.pack(stack)
    true = free.values(at)
    found: dict[str, list[np.ndarray]] = {name: [] for name in true}
    for seed in range(fits):
        near = np.clip(at + NEAR * np.random.default_rng([seed, 1]).normal(size=at.size), *free.bounds())
        result = lf.fit(
            [noisy(clean, noise, exponent, seed)],
            free.put(stack, free.fields(near), np),
            free=[field.name for field in free.free],
            starts=1,
        )
        rows = lf.parameters(result)
        for name in true:
            value, sigma = (np.atleast_1d(np.asarray(rows[name][key], float)) for key in ("value", "sigma"))
            found[name].append((value - true[name]) / sigma)
    return {name: np.array(rows) for name, rows in found.items()}


def shares(values: np.ndarray) -> tuple[float, float]:
    """Parts of some pulls that are within 1 and within 2."""
    return float(np.mean(np.abs(values) <= 1.0)), float(np.mean(np.abs(values) <= 2.0))


def limits(count: int, level: float = 0.95) -> list[tuple[float, float]]:
    """Between which those parts lie, of so many true and independent sigmas, by chance."""
    expected = [float(norm.cdf(k) - norm.cdf(-k)) for k in (1.0, 2.0)]
    return [tuple(float(k) / count for k in binom.interval(level, count, p)) for p in expected]


def row(values: np.ndarray) -> dict[str, Any]:
    """What is said of some pulls; limits are those of the fits, since channels of one fit need not be independent."""
    known = values[np.isfinite(values)]
    (low_1, high_1), (low_2, high_2) = limits(len(values))
    within_1, within_2 = shares(known)
    return {
        "pulls": known.size,
        "within_1": within_1,
        "limits_1": f"{low_1:.2f}-{high_1:.2f}",
        "within_2": within_2,
        "limits_2": f"{low_2:.2f}-{high_2:.2f}",
        "mean": float(known.mean()),
        "sd": float(known.std()),
        "without_sigma": values.size - known.size,
    }


def rows(model: str, found: dict[str, np.ndarray]) -> Iterator[dict[str, Any]]:
    """A row a parameter, and one for all."""
    for name, values in found.items():
        yield {"model": model, "parameter": name, **row(values)}
    if len(found) > 1:
        yield {"model": model, "parameter": "all", **row(np.concatenate(list(found.values()), 1))}


def show(record: dict[str, Any]) -> None:
    """A row of the table in docs/results.md."""
    cells = (f"{value:.3f}" if isinstance(value, float) else str(value) for value in record.values())
    print(f"| {' | '.join(cells)} |", flush=True)


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("models", nargs="*", help=f"left out: all of {', '.join(MODELS)}")
    parser.add_argument("--fits", type=int, default=100)
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--exponent", type=float, default=0.7)
    parser.add_argument("--output", type=Path, help="write the rows as CSV too")
    asked = parser.parse_args(words)
    cases = MODELS | HARD
    if unknown := set(asked.models) - set(cases):
        parser.error(f"unknown model {', '.join(sorted(unknown))}; there are: {'; '.join(cases)}")
    table: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for model in asked.models or MODELS:
            for record in rows(model, pulls(cases[model], Path(folder), asked.fits, asked.noise, asked.exponent)):
                table.append(record)
                show(record)
    if asked.output:
        with asked.output.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(table[0]))
            writer.writeheader()
            writer.writerows(table)


if __name__ == "__main__":
    main()
