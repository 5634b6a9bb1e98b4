"""A fit of six parameters against scipy's, on the same pixels: `least_squares` (trf, 2-point) over the same model in NumPy.

    python benchmarks/fit_speed.py [--side 128] [--runs 5]

Both fit the same image of 128 x 128 pixels from the same start, one after the other, run by run, in one process, compiled and warm.
Prints what each found and the ratio of the times; a ratio of seconds alone would reward a fit that stops early, so both are run to
the same minimum and the remaining cost is shown beside the time.
"""

import argparse
import time
from typing import Any

import jax
import numpy as np
from numpy_model import brdf
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from layerfit.capture.geometry import frames, sphere_surface
from layerfit.capture.samples import Samples
from layerfit.capture.scene import Camera, Sphere
from layerfit.fit.blocks import arrange, weighted
from layerfit.fit.parameters import parametrise
from layerfit.fit.residuals import NEAR, SEARCHED, Residuals, initial
from layerfit.forms.corrected import Corrected
from layerfit.layers import Coat
from layerfit.render import predict
from layerfit.stack import Stack
from layerfit.surfaces import Conductor

COPPER = {"eta": np.array([0.201, 0.924, 1.102]), "k": np.array([3.913, 2.453, 2.142])}
SEPARABLE: Any = {"masking": "smith_separable"}
TRUTH = Stack(
    (Coat(alpha=0.12, eta=1.5, tau=[0.08, 0.25, 0.7], **SEPARABLE),), Conductor(alpha=0.2, **COPPER, **SEPARABLE), Corrected()
)
START = Stack(
    (Coat(alpha=0.3, eta=1.35, tau=[0.3, 0.3, 0.3], **SEPARABLE),), Conductor(alpha=0.4, **COPPER, **SEPARABLE), Corrected()
)
NAMES = ("coat.alpha", "coat.eta", "coat.tau", "base.alpha")
REST_S = 0.2
"""Before each run: the threads of the other's linear algebra look for work a while longer, on the cores of the next."""

CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
TO_LIGHT = np.array([0.46175709, 0.55410852, 0.69263564])


def pixels(side: int) -> Samples:
    """The lit pixels of a sphere of the true material, with 1 % of noise."""
    surface = sphere_surface(Sphere(), CAMERA, side, side)
    usable = surface.covered & (surface.normal @ TO_LIGHT > 0.1)
    index = np.flatnonzero(usable)
    normal, position = surface.normal.reshape(-1, 3)[index], surface.position.reshape(-1, 3)[index]
    to_local = frames(normal, None)
    to_eye = np.array(CAMERA.position) - position
    to_eye /= np.linalg.norm(to_eye, axis=-1, keepdims=True)
    wo = np.einsum("nij,nj->ni", to_local, to_eye)
    keep = wo[:, 2] > 0.1
    wi = np.einsum("nij,j->ni", to_local, TO_LIGHT)[keep]
    weight = np.repeat(np.pi * wi[:, None, 2:], 3, -1)
    narrow = [np.asarray(a, np.float32) for a in (wi[:, None], wo[keep], weight)]
    target = predict(TRUTH, *narrow) * (1.0 + 0.01 * np.random.default_rng(0).normal(size=(len(wi), 3)))
    return Samples(narrow[0], narrow[1], narrow[2], target.astype(np.float32), None, index[keep], (side, side))


class Ours:
    def __init__(self, samples: Samples, inverse_sigma: np.ndarray) -> None:
        start, self.free = parametrise(START, NAMES, (), "start")
        blocks, layout = arrange([samples], 0)
        blocks = weighted(blocks, layout, [inverse_sigma])
        self.residuals = Residuals(start.astype(np.float32), self.free, None, blocks, len(layout.pixel))

    def fit(self) -> tuple[np.ndarray, float, int]:
        # As every fit does: to a minimum of a sample of the pixels first, then of all.
        u, steps, state = self.free.pack(self.residuals.start), 0, None
        for count, trust, gain in ((2, 1.0, SEARCHED), (None, NEAR, None)):
            u, state, losses = self.residuals.steps(u, initial(u, trust, gain), self.free.bounds(), count)
            steps += int(np.sum(~np.isnan(losses)))
        return np.concatenate([np.atleast_1d(v) for v in self.free.values(np.asarray(u)).values()]), float(state.loss), steps


class Scipy:
    def __init__(self, samples: Samples, inverse_sigma: np.ndarray) -> None:
        wi, wo, weight, target = (
            np.asarray(a, float) for a in (samples.wi[:, 0], samples.wo, samples.weight[:, 0], samples.target)
        )

        def residual(x: np.ndarray) -> np.ndarray:
            f = brdf(wi, wo, x[0], x[1], x[2:5], x[5], COPPER["eta"], COPPER["k"])
            return ((f * weight - target) * inverse_sigma).ravel()

        self.residual = residual

    def fit(self) -> tuple[np.ndarray, float, int]:
        found = least_squares(
            self.residual,
            [0.3, 1.35, 0.3, 0.3, 0.3, 0.4],
            bounds=([1e-3, 1.0, 0.0, 0.0, 0.0, 1e-3], [1.0, 3.0, 50.0, 50.0, 50.0, 1.0]),
            method="trf",
            jac="2-point",
            x_scale="jac",
        )
        return found.x, float(found.cost), found.nfev


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=128)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    with jax.enable_x64(True):
        samples = pixels(arguments.side)
        bright = np.quantile(samples.target, 0.98, axis=0)
        inverse_sigma = (1.0 / np.hypot(0.05 * samples.target, 0.02 * bright)).astype(np.float32)
        fits = {"layerfit": Ours(samples, inverse_sigma), "scipy trf, 2-point, NumPy": Scipy(samples, inverse_sigma)}
        found = {name: peer.fit() for name, peer in fits.items()}
        seconds: dict[str, list[float]] = {name: [] for name in fits}
        for _ in range(arguments.runs):
            for name, peer in fits.items():
                time.sleep(REST_S)
                start = time.perf_counter()
                peer.fit()
                seconds[name].append(time.perf_counter() - start)
    table = Table("fit", "coat.alpha, eta, tau, base.alpha", "cost", "steps", "time over layerfit's (median of runs)")
    ours = np.array(seconds["layerfit"])
    for name, (values, cost, steps) in found.items():
        ratio = np.median(np.array(seconds[name]) / ours)
        table.add_row(name, " ".join(f"{v:.4f}" for v in values), f"{cost:.3f}", str(steps), f"{ratio:.1f}")
    console = Console(width=140)
    console.print(f"{len(samples.index)} pixels of {arguments.side} x {arguments.side}, truth .12 1.5 .08 .25 .7 .2")
    console.print(table)


if __name__ == "__main__":
    main()
