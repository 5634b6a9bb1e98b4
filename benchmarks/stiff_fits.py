"""Fits that are stiff: how often, and in how many steps, the solver of the fit and two peers come to the minimum of the same residuals.

    python benchmarks/stiff_fits.py [--only NAME] [--trials 20] [--side 20]

Images of a sphere under one light, drawn by the model: two parameters that are nearly one, values on their bounds, widths of .02 from far away,
absorption of 1e-4 to 50 in one coat, noise, half floats, and highlights that are clipped. Every trial starts at a material drawn evenly
between the bounds, in the coordinates of the fit. Residuals are weighted as a fit weighs them, in float64, and the same for all three, as is their
exact Jacobian. The peers are `scipy.optimize.least_squares` (trf, with the bounds, x_scale "jac") and `optimistix.LevenbergMarquardt`, which knows
of no bounds: its residuals are those of the nearest point inside. Each ends by its own rule, at most after 400 steps. A trial has converged
where its cost is within 1 % of the lowest that any of them found, or of an image that is a thousandth off.
"""

import argparse
import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from fit_speed import COPPER, pixels
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from layerfit.fit.parameters import parametrise
from layerfit.fit.residuals import initial
from layerfit.fit.solve import LONGEST, SOLVER, columns, dense, descend, normal_equations, products, tangents
from layerfit.forms.corrected import Corrected
from layerfit.layers import Coat
from layerfit.stack import Stack, evaluate
from layerfit.surfaces import Conductor, Lambert

MOST_STEPS = 400
NEAR, OFF = 0.01, 1e-3


@dataclasses.dataclass(frozen=True)
class Case:
    """A true material, what is fitted of it, and what becomes of its image."""

    truth: Stack
    free: tuple[str, ...]
    spoil: Callable[[np.ndarray], np.ndarray] = lambda image: image


def _noisy(image: np.ndarray) -> np.ndarray:
    return image + np.random.default_rng(7).normal(size=image.shape) * np.hypot(0.03 * image, 0.01)


METAL = ("coat.alpha", "coat.eta", "coat.tau", "base.alpha")
PAINT = ("coat.alpha", "coat.eta", "coat.tau", "base.albedo")


def _metal(tau: Any = (0.08, 0.25, 0.7), coat: float = 0.12, base: float = 0.2, eta: float = 1.5) -> Stack:
    return Stack((Coat(alpha=coat, eta=eta, tau=np.array(tau)),), Conductor(alpha=base, **COPPER), Corrected())


def _paint(tau: Any = (0.08, 0.25, 0.7), albedo: Any = (0.5, 0.3, 0.1)) -> Stack:
    return Stack((Coat(alpha=0.1, eta=1.5, tau=np.array(tau)),), Lambert(albedo=np.array(albedo)), Corrected())


CASES = {
    "albedo and absorption are nearly one": Case(_paint(), PAINT),
    "on bounds: no absorption, white": Case(_paint((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)), PAINT),
    "on bounds: no boundary, width 1": Case(_metal(coat=1.0, eta=1.0), METAL),
    "widths of .02": Case(_metal(coat=0.02, base=0.02), METAL),
    "absorption from 1e-4 to 50": Case(_metal((1e-4, 0.5, 50.0)), METAL),
    "noisy": Case(_metal(), METAL, _noisy),
    "half floats": Case(_metal(coat=0.05), METAL, lambda image: image.astype(np.float16).astype(float)),
    "clipped": Case(_metal(base=0.1), METAL, lambda image: np.minimum(image, 1.0)),
}


class Problem:
    """The residuals of a case, in the coordinates of the fit."""

    def __init__(self, case: Case, side: int) -> None:
        samples = pixels(side)
        self.wi, self.wo, self.weight = (jnp.asarray(a, float) for a in (samples.wi[:, 0], samples.wo, samples.weight[:, 0]))
        start, self.free = parametrise(case.truth, case.free, (), "truth")
        self.start = start.astype(np.float64)
        self.bounds = self.free.bounds()
        self.slots = tuple(f.slots for f in self.free.free)
        image = np.asarray(self._image(self.start.prepare()).T)
        self.target = jnp.asarray(case.spoil(image))
        bright = np.quantile(self.target, 0.98, axis=0)
        self.inverse_sigma = 1.0 / np.hypot(0.05 * self.target, 0.02 * bright)
        self.level = 0.5 * OFF**2 * float(np.sum((self.target * self.inverse_sigma) ** 2))
        self._columns = jax.jit(self.columns)
        self._rows = jax.jit(lambda u: self.residual(self.material(self.free.fields(u))).T.ravel())
        self._ours = jax.jit(lambda u, state: descend(SOLVER, self.normal, u, state, self.bounds, LONGEST, ()))
        self._peer = jax.jit(self.optimistix_fit)

    def _image(self, prepared: Any) -> Any:
        one = lambda i, o: jnp.broadcast_to(evaluate(self.start.form, prepared, i, o), (3,))  # noqa: E731
        return (jax.vmap(one)(self.wi, self.wo) * self.weight).T

    def material(self, fields: list[Any]) -> Any:
        return self.free.put(self.start, fields).prepare()

    def residual(self, prepared: Any) -> Any:
        return (self._image(prepared) - self.target.T) * self.inverse_sigma.T

    def columns(self, u: Any) -> Any:
        return columns(self.residual, *tangents(self.material, self.free.fields(u)))

    def normal(self, u: Any, kept: Any) -> Any:
        return normal_equations(products(self.columns(u)), self.slots), kept

    def layerfit(self, u: np.ndarray) -> tuple[float, int]:
        state, steps = initial(u), 0
        while steps < MOST_STEPS and not bool(state.done):
            u, state, losses, _ = self._ours(u, state)
            steps += int(np.sum(~np.isnan(losses)))
        return float(state.loss), steps

    def scipy(self, u: np.ndarray) -> tuple[float, int]:
        jacobian = lambda u: dense(np.asarray(self._columns(u)), self.slots)[0].reshape(-1, len(u))  # noqa: E731
        inside = np.clip(u, *(end + sign * 1e-9 for end, sign in zip(self.bounds, (1.0, -1.0), strict=True)))
        found = least_squares(
            lambda u: np.asarray(self._rows(u)), inside, jacobian, self.bounds, x_scale="jac", max_nfev=MOST_STEPS
        )
        return float(found.cost), int(found.nfev)

    def optimistix_fit(self, u: Any) -> Any:
        rows = lambda u, _: self.residual(self.material(self.free.fields(jnp.clip(u, *self.bounds)))).ravel()  # noqa: E731
        solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
        found = optx.least_squares(rows, solver, u, max_steps=MOST_STEPS, throw=False)
        return 0.5 * jnp.sum(rows(found.value, None) ** 2), found.stats["num_steps"]

    def optimistix(self, u: np.ndarray) -> tuple[float, int]:
        cost, steps = self._peer(jnp.asarray(u))
        return float(cost), int(steps)

    def anywhere(self, seed: int) -> np.ndarray:
        return np.random.default_rng(seed).uniform(*self.bounds)


SOLVERS = ("layerfit", "scipy", "optimistix")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", default="", help="part of the names to run")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--side", type=int, default=20)
    asked = parser.parse_args()
    table = Table("case", *(f"{name}: converged, steps (median of those)" for name in SOLVERS))
    with jax.enable_x64(True):
        for name, case in CASES.items():
            if asked.only not in name:
                continue
            problem = Problem(case, asked.side)
            found = {s: [getattr(problem, s)(problem.anywhere(seed)) for seed in range(asked.trials)] for s in SOLVERS}
            costs = {s: np.nan_to_num([cost for cost, _ in rows], nan=np.inf) for s, rows in found.items()}
            best = min(float(c.min()) for c in costs.values())
            cells = []
            for s in SOLVERS:
                there = costs[s] <= (1.0 + NEAR) * best + problem.level
                steps = np.array([n for _, n in found[s]])[there]
                cells.append(f"{int(there.sum())} of {asked.trials}, {np.median(steps) if len(steps) else np.nan:.0f}")
            table.add_row(name, *cells)
            print(name, *cells, f"least cost {best:.4g}", sep=" | ", flush=True)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
