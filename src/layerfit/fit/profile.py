"""Intervals that do not take errors as Gaussian: how the cost rises as one parameter is moved and all others are fitted again.

A sigma is the curvature at the minimum. Where that says too little, of a coat so deep that its base is hardly seen or of parameters that images
hardly tell apart, the profile of the cost says how far a value can go (Venzon and Moolgavkar 1988).
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from ..stack import Stack
from .parameters import Free
from .starts import SIGHT
from .uncertainty import BLIND

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

Refit = Callable[[np.ndarray, int], tuple[np.ndarray, float]]
"""From a vector, with one of its entries held as it is: where the others go, and the cost there."""


@dataclasses.dataclass(frozen=True)
class Profile:
    """The cost along one parameter, in the coordinate of the fit."""

    slot: int
    at: np.ndarray
    """(points,) where it was held, ascending."""
    rise: np.ndarray
    """(points,) of the cost, over the rise that ends the interval: 1 there."""

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
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    unit = np.sum(vectors[slot] ** 2 / np.maximum(values, BLIND)) / scale[slot] ** 2
    return float(covariance[slot, slot] / unit)


def along(
    refit: Refit, u: np.ndarray, cost: float, slot: int, first: float, limit: float, bounds: tuple[float, float]
) -> Profile:
    """The profile of one entry of the vector from its minimum to both sides, in growing steps from `first` on."""
    found = [(float(u[slot]), 0.0)]
    for bound, step in zip(bounds, (-first, first), strict=True):
        found += _side(refit, u, cost, slot, step, limit, bound)
    at, rise = np.array(sorted(found)).T
    return Profile(slot, at, rise)


def _side(
    refit: Refit, u: np.ndarray, cost: float, slot: int, step: float, limit: float, bound: float
) -> list[tuple[float, float]]:
    here, inside, found = u, (float(u[slot]), 0.0), []
    low, high = sorted((float(u[slot]), bound))

    def look(value: float) -> tuple[float, float]:
        nonlocal here
        there, reached = refit(_held(here, slot, value), slot)
        if reached - cost >= limit:  # an end is one if it is so from the minimum, too: from here the others may be far out
            there, reached = min((there, reached), refit(_held(u, slot, value), slot), key=lambda end: end[1])
        if reached - cost < limit:
            here = there
        found.append((value, (reached - cost) / limit))
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


def deep(free: tuple[Free, ...], stack: Stack) -> list[int]:
    """Entries of the vector that are optical depths so large that the base may not be seen."""
    layers = (*stack.layers, stack.base)
    slots = []
    for f in free:
        if (
            f.layer is not None
            and f.field in ABSORBING
            and (depth := getattr(layers[f.layer], "optical_depth", None)) is not None
        ):
            depths = np.broadcast_to(np.asarray(depth, float), 3)
            slots += [slot for slot, value in zip(f.slots, depths, strict=True) if value >= DEEP]
    return slots


def lower_limit(
    refit: Refit, u: np.ndarray, cost: float, slot: int, first: float, limit: float, bounds: tuple[float, float]
) -> Profile | None:
    """The lower side of a profile, where an opaque coat cannot be told from this one; None where the images tell them apart."""
    rise = (refit(_held(u, slot, bounds[1]), slot)[1] - cost) / limit
    if rise >= 1.0:
        return None
    found = [(float(u[slot]), 0.0), *_side(refit, u, cost, slot, -first, limit, bounds[0])]
    if u[slot] < bounds[1]:
        found.append((bounds[1], rise))
    at, rises = np.array(sorted(found)).T
    return Profile(slot, at, rises)
