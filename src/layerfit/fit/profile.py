"""Intervals that do not take errors as Gaussian: how the cost rises as one parameter is moved and all others are fitted again.

A sigma is the curvature at the minimum. Where that says too little, of a coat so deep that its base is hardly seen or of parameters that images
hardly tell apart, the profile of the cost says how far a value can go (Venzon and Moolgavkar 1988).
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ..stack import Stack
from .parameters import Free
from .starts import SIGHT, Minimum
from .uncertainty import BLIND, WEAK_SIGMA

CHI2_95 = {1: 3.841, 3: 7.815}
"""Rise of chi^2 within which the true values of so many parameters lie 95 times of 100 (Wilks 1938)."""

DEEP = 1.0
"""Optical depth from which on it is asked whether the base is seen at all."""

ABSORBING = ("tau", "absorption_per_mm")
"""Fields whose upper end is an opaque coat."""

POINTS = 24
"""Fits on one side of a profile at most, before its end is passed."""

CLOSER = 2
"""Fits that close in on an end at most."""

NEAR = 0.01
"""Part of the rise within which they are there."""

Refit = Callable[[np.ndarray, int], Minimum]
"""From a vector, with one of its entries held as it is: where the others go."""

Rise = Callable[[Minimum], float]
"""How much worse a point is than the minimum, over what ends an interval."""


@dataclasses.dataclass(frozen=True)
class Profile:
    """The cost along one parameter, in the coordinate of the fit."""

    slot: int
    at: np.ndarray
    """(points,) where it was held, ascending."""
    rise: np.ndarray
    """(points,) of the cost, over the rise that ends the interval: 1 there."""
    integrated: bool = False
    """Whether the other parameters are integrated over their ranges, not fitted again."""

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """Lower and upper end; None where the cost does not rise enough before the bound."""
        middle = int(np.argmin(self.rise))
        return self._end(middle, 0, -1), self._end(middle, len(self.at) - 1, 1)

    def _end(self, middle: int, last: int, step: int) -> float | None:
        points = list(zip(self.at.tolist(), self.rise.tolist(), strict=True))
        for k in range(middle, last, step):
            if points[k + step][1] >= 1.0:
                return _crossing(points[k], points[k + step])
        return None


def threshold(scatter: float, misfit: float, form: float = 0.0, together: int = 1) -> float:
    """Rise of the cost that ends an interval: of noise, and of what the form gets wrong, which can turn round minima in sight of each other.

    `scatter` is the variance of a weighted residual, `misfit` half the sum of squares that no noise explains, `form` half that of what the form is
    known to get wrong, where a random walk has told: materials whose images differ by less are one to this fit. `together` is the number of
    parameters that are asked about at once.
    """
    return 0.5 * CHI2_95[together] * scatter + (SIGHT - 1.0) * misfit + form


def scatter(gram: np.ndarray, covariance: np.ndarray, slot: int) -> float:
    """Variance of the weighted residuals that one parameter is seen by: its own over what unit variance would give it. 0 of one
    that is not seen."""
    if not np.isfinite(covariance[slot, slot]):
        return 0.0
    seen = np.flatnonzero(np.isfinite(np.diag(covariance)))  # what has no effect is not in the covariance of the others
    at = np.ix_(seen, seen)
    scale = np.sqrt(np.diag(gram)[seen])
    values, vectors = np.linalg.eigh(gram[at] / np.outer(scale, scale))
    unit = vectors**2 @ (1.0 / np.maximum(values, BLIND)) / scale**2
    return float(covariance[slot, slot] / unit[np.searchsorted(seen, slot)])


def along(refit: Refit, best: Minimum, slot: int, first: float, limit: float, bounds: tuple[float, float]) -> Profile:
    """The profile of one entry of the vector from its minimum to both sides, in growing steps from `first` on."""

    def rise(there: Minimum) -> float:
        return (there.cost - best.cost) / limit

    found = [(float(best.vector[slot]), 0.0)]
    for bound, step in zip(bounds, (-first, first), strict=True):
        found += _side(refit, best, slot, step, rise, bound)
    return _profile(slot, found)


def _profile(slot: int, found: Sequence[tuple[float, float]], integrated: bool = False) -> Profile:
    at, rise = np.array(sorted(found)).T
    return Profile(slot, at, rise, integrated)


def _side(refit: Refit, start: Minimum, slot: int, step: float, rise: Rise, bound: float) -> list[tuple[float, float]]:
    here, inside, found = start.vector, (float(start.vector[slot]), rise(start)), []
    low, high = sorted((inside[0], bound))

    def look(value: float) -> tuple[float, float]:
        nonlocal here
        there = refit(_held(here, slot, value), slot)
        if rise(there) >= 1.0:  # an end is one if it is so from the start, too: from here the others may be far out
            there = min(there, refit(_held(start.vector, slot, value), slot), key=rise)
        if rise(there) < 1.0:
            here = there.vector
        found.append((value, rise(there)))
        return found[-1]

    while len(found) < POINTS and inside[0] != bound:
        last = look(float(np.clip(inside[0] + step, low, high)))
        if last[1] >= 1.0:
            for _ in range(CLOSER):
                middle = look(_crossing(inside, last))
                if abs(middle[1] - 1.0) < NEAR:
                    break
                inside, last = (inside, middle) if middle[1] >= 1.0 else (middle, last)
            break
        inside = last
        step *= 1.5 if last[1] < 0.25 else 1.0  # where the cost hardly rises, the end is far
    return found


def _crossing(inside: tuple[float, float], outside: tuple[float, float]) -> float:
    """Where the rise is 1 between two points: a parabola has a straight root."""
    low, high = (np.sqrt(max(rise, 0.0)) for _, rise in (inside, outside))
    return float(inside[0] + (1.0 - low) / (high - low) * (outside[0] - inside[0]))


def _held(u: np.ndarray, slot: int, value: float) -> np.ndarray:
    return np.where(np.arange(len(u)) == slot, value, u)


def deep(free: tuple[Free, ...], stacks: Sequence[Stack], sigma: np.ndarray) -> list[int]:
    """Entries of the vector that are optical depths so large, or known so badly, that the base may not be seen; `stacks` are the
    material in each reference."""
    slots = []
    for f in free:
        layers = (*stacks[f.reference or 0].layers, stacks[f.reference or 0].base)
        if (
            f.layer is not None
            and f.field in ABSORBING
            and (depth := getattr(layers[f.layer], "optical_depth", None)) is not None
        ):
            depths = np.broadcast_to(np.asarray(depth, float), 3)
            slots += [
                slot for slot, value in zip(f.slots, depths, strict=True) if value >= DEEP or not sigma[slot] < WEAK_SIGMA
            ]
    return slots


def lower_limit(
    refit: Refit, best: Minimum, slot: int, first: float, limit: float, bounds: tuple[float, float], widths: np.ndarray
) -> Profile | None:
    """The lower side of a profile, where an opaque coat cannot be told from this one; None where the images tell them apart.

    It may have no end: over a base that is black enough, any coat looks opaque. But that base is one of many that an opaque coat hides. So
    then the likelihood is integrated over the other parameters, each as likely everywhere in its range, of these `widths` (Berger, Liseo and
    Wolpert 1999), by Laplace's method (Tierney and Kadane 1986).
    """
    lower, upper = bounds
    opaque = refit(_held(best.vector, slot, upper), slot)
    others = np.delete(np.arange(len(widths)), slot)
    chi2 = 0.5 * CHI2_95[1]

    def dearer(there: Minimum) -> float:
        return (there.cost - best.cost) / limit

    def confined(there: Minimum) -> float:
        """Logarithm of their ranges over what is left of them to the others."""
        known = there.gram[np.ix_(others, others)] * np.outer(widths[others], widths[others]) / 12.0
        return 0.5 * float(np.linalg.slogdet(np.eye(len(others)) + known * chi2 / limit)[1])

    def rarer(there: Minimum) -> float:
        return dearer(there) + (confined(there) - confined(opaque)) / chi2

    def down(rise: Rise) -> Profile:
        start = best if rise(best) < 1.0 else opaque  # the limit may lie above what was fitted
        found = {float(m.vector[slot]): rise(m) for m in (best, opaque)}
        return _profile(slot, [*found.items(), *_side(refit, start, slot, -first, rise, lower)], rise is rarer)

    if dearer(opaque) >= 1.0:
        return None
    profile = down(dearer)
    return profile if profile.interval[0] is not None else down(rarer)
