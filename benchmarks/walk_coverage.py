"""Whether sigmas are true where the form is not: fits of images of the random walk, under noise as a path tracer makes it.

    python benchmarks/walk_coverage.py [--fits 200] [--noise 0.2] [--only NAME]

The image is what light does between the layers, not what the form draws. A pixel is the mean of a random number of contributions of random, very
unequal size, so that its noise is skewed, with fireflies, and alike in its channels; its standard error is estimated from the same contributions,
and is too small where a firefly is missing. Two pulls are counted: (value - true) / sigma, whose sigma holds the whole error of the form, and
that of the corrected value over noise and the error of the correction, which should scatter like Gaussian errors.
"""

import argparse
import dataclasses
import tempfile
from pathlib import Path

import numpy as np
from sigma_coverage import MODELS, NEAR, Case, view_of

import layerfit as lf
from layerfit import walk
from layerfit.fit import discrepancy
from layerfit.fit.parameters import parametrise

PATHS = 40_000
"""Of the walk, for each pixel: its noise is a tenth of what an image has, at most."""

SPREAD = 1.0
"""Standard deviation of the logarithm of a contribution. The largest of a pixel's is then as large as all others about once in an image."""

CASES = ("precise over conductor", "corrected over conductor", "precise over oren_nayar")


def walked(case: Case, view: lf.View) -> lf.View:
    """The same view, drawn by the random walk."""
    samples = view.samples()
    wi, wo = samples.wi[:, 0], samples.wo
    how = walk.interface_of(case.stack)
    below = walk.walk(case.stack, wi, wo, paths=PATHS, interface=how).mean
    top = np.concatenate([walk.top_lobe(case.stack, i, o[None]) for i, o in zip(wi, wo, strict=True)])
    return dataclasses.replace(view, target=(top + below) * samples.weight[:, 0])


def traced(view: lf.View, noise: float, seed: int) -> lf.View:
    """The same view as a path tracer sees it; `noise` is the relative standard error of a pixel at white, growing as f^-.3 in the dark."""
    rng = np.random.default_rng(seed)
    bright = view.target.mean(-1)
    relative = noise * (np.maximum(bright, 1e-9) / np.quantile(bright, 0.98)) ** -0.3
    mean, square = np.exp(0.5 * SPREAD**2), np.exp(2.0 * SPREAD**2)
    expected = np.clip(square / mean**2 / relative**2, 4.0, 1e5)  # of contributions, for this standard error
    sums = np.array([_sums(rng, rng.poisson(n)) for n in expected]) / (expected * mean)[:, None] ** (1, 2)
    target = view.target * sums[:, :1]
    return dataclasses.replace(view, target=target, noise=view.target * np.sqrt(sums[:, 1:]))


def _sums(rng: np.random.Generator, count: int) -> tuple[float, float]:
    """Sum of so many contributions, and of their squares: the variance of a Poisson process."""
    sizes = np.exp(SPREAD * rng.normal(size=count))
    return float(sizes.sum()), float((sizes**2).sum())


def pulls(case: Case, folder: Path, fits: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Pulls of the values, and of the corrected values, (fits, parameters); NaN where there is no sigma."""
    clean = walked(case, view_of(case, folder))
    stack, free = parametrise(case.stack, case.free, (), "coverage")
    at = free.pack(stack)
    found = []
    for seed in range(fits):
        near = np.clip(at + NEAR * np.random.default_rng([seed, 1]).normal(size=at.size), *free.bounds())
        start = free.put(stack, free.fields(near), np)
        result = lf.fit([traced(clean, noise, seed)], start, free=[f.name for f in free.free], starts=1, model_error=True)
        rows = lf.parameters(result).values()
        value, sigma, corrected = (
            np.concatenate([np.atleast_1d(np.array(row[key], float)) for row in rows])
            for key in ("value", "sigma", "corrected")
        )
        true = np.concatenate([np.atleast_1d(v) for v in free.values(at).values()])
        off = result.discrepancy
        scatter = np.hypot(result.uncertainty.sigma, 0.0 if off is None else off.error) * free.slopes(result.vector)
        found.append(((value - true) / sigma, (corrected - true) / np.where(np.isfinite(sigma), scatter, np.nan)))
    return np.array([v for v, _ in found]), np.array([c for _, c in found])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--fits", type=int, default=200)
    parser.add_argument("--noise", type=float, default=0.2)
    parser.add_argument("--only", default="", help="part of the names to run")
    asked = parser.parse_args()
    discrepancy.PLACES = (0.0,)  # the images are drawn at the centres of their pixels
    lf.use_compilation_cache()
    for name in (case for case in CASES if asked.only in case):
        with tempfile.TemporaryDirectory() as folder:
            both = pulls(MODELS[name], Path(folder), asked.fits, asked.noise)
        for what, found in zip(("value", "corrected"), both, strict=True):
            known = np.abs(found[np.isfinite(found)])
            shares = " | ".join(f"{np.mean(known <= k):.3f}" for k in (1, 2, 3))
            print(f"| {name} | {what} | {known.size} | {shares} | {found.size - known.size} |", flush=True)


if __name__ == "__main__":
    main()
