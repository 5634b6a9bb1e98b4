"""Values and derivatives of some cases of a structure in 50 digits, and how far float32 and float64 are from them.

Derivatives are differences of values, a step of 1e-20 apart and into the range of the parameter: they know nothing of the rules of
differentiation, so that a guard that is wrong, or one that differs from the formula at its edge, is seen.
"""

import dataclasses
from typing import Any

import jax
import numpy as np

from ..stack import Stack, evaluate
from .digits import DIGITS, in_digits, numbers, reals
from .grid import Grid
from .measure import FLOOR, SLOPE_FLOOR, Values, fit_scale, turn

STEP = 1e-20
"""Of a difference, over the value or the range: its own error is as small, of a number of 50 digits 30 are left."""
DRAWN = 5
"""Pairs of a material that are drawn, beside its worst."""
BENT = 1e-3
"""Where a step to the other side, or four times as far from the end of a range, gives a slope that differs by more than this part, there is
no derivative: a kink (the least of two, a clip) or a root at its 0."""
CLOSE = 1e-6
"""A value is at the end of its range within the rounding of float32."""
SAME = 1e-7
"""Slopes of float64 that are within this part of the difference are not looked at again."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One material at one pair of directions: values (channels,), and slopes (n + 2, channels) in the coordinate of a fit."""

    row: int
    pair: int
    f: np.ndarray
    slopes: np.ndarray
    """NaN where there is no derivative."""


class Exact:
    """A structure in 50 digits."""

    def __init__(self, stack: Stack, tried: Grid, pairs: tuple[np.ndarray, np.ndarray]) -> None:
        self.tried, self.pairs = tried, [np.asarray(w, float) for w in pairs]
        with jax.enable_x64(True):
            self.turns = [np.asarray(turn(jax.numpy.asarray(w))) for w in self.pairs]
        self.template = stack
        one = tried.material(stack, 0)
        self.prepare = in_digits(lambda material: material.prepare(), one)
        with jax.enable_x64(True):
            prepared = jax.eval_shape(lambda material: material.prepare(), jax.tree.map(np.float64, one))
        self.evaluate = in_digits(
            lambda prepared, wi, wo: jax.numpy.atleast_1d(evaluate(stack.form, prepared, wi, wo)),
            prepared,
            *(w[0] for w in self.pairs),
        )

    def cases(self, row: int, places: list[int], known: np.ndarray) -> list[Case]:
        """One material at some pairs; `known` (n + 2, pairs, channels) are its slopes in float64, which are looked at again where they differ."""
        with numbers().workdps(DIGITS):
            scale = fit_scale(self.tried)[:, row]
            material = [reals(x) for x in self.tried.values[row].astype(np.float32)]
            base = self._values(material, places)
            slopes = self._slopes(material, places, base)
            differs = np.abs(slopes - known) > SAME * np.maximum(np.abs(slopes), FLOOR)
            if differs.any():
                again = self._slopes(material, places, base, np.asarray(differs.any((1, 2))))
                bent = differs & (np.abs(again - slopes) > BENT * np.maximum(np.abs(slopes), FLOOR))
                slopes = np.where(bent, np.nan, slopes)
            slopes[: len(scale)] *= scale[:, None, None]
            return [Case(row, place, base[k].astype(float), slopes[:, k]) for k, place in enumerate(places)]

    def _values(self, material: list[Any], places: list[int], turned: tuple[Any, Any] = (0, 0)) -> np.ndarray:
        prepared = self.prepare(jax.tree.unflatten(jax.tree.structure(self.template), material))
        at = lambda side, k: reals(self.pairs[side][k]) + turned[side] * reals(self.turns[side][k])  # noqa: E731
        return np.stack([self.evaluate(prepared, at(0, k), at(1, k)) for k in places])

    def _slopes(self, material: list[Any], places: list[int], base: np.ndarray, again: np.ndarray | None = None) -> np.ndarray:
        """(n + 2, pairs, channels); with `again` those alone, by another step, and 0 else."""
        mpf, n = numbers().mpf, len(material)
        found = np.zeros((n + 2, *base.shape))
        for k in range(n + 2) if again is None else np.flatnonzero(again).tolist():
            if k < n:
                h = self._step(k, material[k], again is not None)
                moved = self._values([np.asarray(x + h, object) if j == k else x for j, x in enumerate(material)], places)
            else:
                h = mpf(STEP if again is None else -STEP)
                moved = self._values(material, places, (h, mpf(0)) if k == n else (mpf(0), h))
            found[k] = ((moved - base) / h).astype(float)
        return found

    def _step(self, k: int, value: Any, other: bool) -> Any:
        """A step towards the middle of the range; the `other` is four times as far from an end, and to the other side elsewhere."""
        low, high, x = self.tried.free[k].spec.lower, self.tried.free[k].spec.upper, float(value)
        h = numbers().mpf(STEP * (abs(x) + 1e-3 * (high - low)))
        at_end = min(x - low, high - x) < CLOSE * (high - low)
        inwards = h if x - low <= high - x else -h
        return inwards * (4 if at_end else -1) if other else inwards


def in_exact(
    stack: Stack,
    tried: Grid,
    pairs: tuple[np.ndarray, np.ndarray],
    rows: list[int],
    worst: np.ndarray,
    double: Values,
    seed: int,
) -> list[Case]:
    """The materials `rows`, each at its `worst` pairs (k, m) and at some that are drawn."""
    rng = np.random.default_rng((seed, 1))
    exact, cases = Exact(stack, tried, pairs), []
    for row in rows:
        places = sorted({*worst[:, row].tolist(), *rng.integers(0, len(pairs[0]), DRAWN).tolist()})
        known = double.slopes[:, row][:, places]
        cases += exact.cases(row, places, known.reshape(*known.shape[:2], -1))
    return cases


def judged(
    cases: list[Case], values: Values, tried: Grid, limits: tuple[float, float, float], moved: np.ndarray, pairs: Any
) -> dict[str, Any]:
    """How far a precision is from the cases; `limits` are a value's, relative and absolute, and a slope's. With the worst, to reproduce.

    `moved` (m, d[, 3]) is by how much the rounding of the inputs moves values.
    """
    names = [*(f.name for f in tried.free), "turn of wi", "turn of wo"]
    error, absolute, slope = compared(cases, values, fit_scale(tried))
    beyond = slope > limits[2]
    of_inputs = np.array([moved[case.row, case.pair].max() for case in cases])
    at, (k, j) = int(np.argmax(error)), np.unravel_index(np.argmax(slope), slope.shape)
    return {
        "value_max": float(error[at]),
        "value_beyond": int(np.sum((error > limits[0]) & (absolute > np.maximum(limits[1], of_inputs)))),
        "slope_max": float(slope[k, j]),
        "slope_beyond": int(np.sum(beyond)),
        "worst_value": _told(cases[at], tried, pairs) | {"exact": cases[at].f.tolist()},
        "worst_slope": _told(cases[j], tried, pairs) | {"along": names[k], "exact": cases[j].slopes[k].tolist()},
    }


def _told(case: Case, tried: Grid, pairs: Any) -> dict[str, Any]:
    directions = {key: [float(x) for x in w[case.pair]] for key, w in zip(("wi", "wo"), pairs, strict=True)}
    return {"parameters": tried.inputs(case.row)} | directions


def compared(cases: list[Case], values: Values, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of values (cases,), over the larger of the number and its floor and absolute, and of slopes (n + 2, cases)."""
    rows, pairs = ([getattr(case, key) for case in cases] for key in ("row", "pair"))
    f, slopes = np.stack([case.f for case in cases]), np.stack([case.slopes for case in cases], 1)
    a, b = values.f[rows, pairs].reshape(f.shape), values.slopes[:, rows, pairs].reshape(slopes.shape).astype(float)
    b[: len(scale)] *= scale[:, rows][..., None]
    off = np.where(np.isfinite(a), np.abs(a - f), np.inf)
    slope = np.abs(b - slopes) / np.maximum(np.abs(slopes), SLOPE_FLOOR * np.abs(f) + FLOOR)
    slope = np.where(np.isnan(slopes), 0.0, np.where(np.isfinite(b), slope, np.inf))
    return (off / np.maximum(np.abs(f), FLOOR)).max(-1), off.max(-1), slope.max(-1)
