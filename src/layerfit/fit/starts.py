"""Where a fit starts from, and which minima its starts lead to.

Many points spread over the ranges are taken some steps on the fewest pixels, and the best few are starts beside the given one. All starts are
taken a few steps. Those that have come to one place are one minimum; the best of those places are followed to their ends.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from .parameters import Parametrisation

SCREENED = 8
"""Points that are looked at for each start that is taken. Films need them: of 60 fits from anywhere 53 found theirs without, 55 with four, 60
with eight. More starts of fewer steps, halved in between, found fewer in the same time."""

LOOK_STEPS = 5
"""Steps of each before it is judged. A point alone is judged by its colours, which are soon right, and not by its order of interference: of 100
fits of a film 11 came to a wrong one when points were judged where they lay, 2 after three steps, none after five."""

COARSE_STEPS = 12
FINE_STEPS = 60

FOLLOWED = 3
"""Places that are followed to their ends: the best after the coarse steps is seldom not the best in the end, and never yet the fourth."""

SAME = 0.05
"""Part of the cost that the way between two points may cost, by their curvatures, for them to be one minimum."""

LEVEL = 1e-6
"""The same for images without misfit, as a part of the brightness: a thousandth of the image, root of sums of squares."""

SIGHT = 1.25
"""Cost over that of the best up to which another minimum is worth knowing: what a form gets wrong can turn the two round."""


@dataclasses.dataclass(frozen=True)
class Minimum:
    """Where starts led."""

    starts: tuple[int, ...]
    """Starts that came there, the nearest first; 0 is the given one."""
    vector: np.ndarray
    cost: float
    gram: np.ndarray
    """J^T J there."""
    ended: bool = False
    """Whether it was followed to its end."""
    over: float = 1.0
    """Cost over that of the best minimum, with the same weights."""


Descend = Callable[[Sequence[Minimum], str], Iterable[Minimum]]
"""Follow points side by side, in a stage of that name: "coarse" for a few steps, "polish" to the end."""


def space_filling(free: Parametrisation, count: int, seed: int) -> list[np.ndarray]:
    """Starts spread evenly over the middle of the bounds (R sequence, Roberts 2018); channels of a colour move together, and so does what each
    reference has for itself. What is of the scene starts as that says. Another seed has points of its own, up to a million of them."""
    places = {(f.layer, f.field): None for f in free.free}
    d = len(places)
    g = 2.0
    for _ in range(64):
        g = (1.0 + g) ** (1.0 / (d + 1))
    lower, upper = free.bounds()
    points = []
    for k in range(count):
        x = (0.5 + (k + 1 + seed % 2**20 * count) * g ** -np.arange(1, d + 1)) % 1.0
        u = np.empty(free.size)
        at = dict(zip(places, x, strict=True))
        for f in free.free:
            for slot in f.slots:
                low, high = _plausible(f.spec.scale, lower[slot], upper[slot])
                u[slot] = f.to_steps(f.told) if f.of_scene else low + at[f.layer, f.field] * (high - low)
        points.append(u)
    return points


def _plausible(scale: str, lower: float, upper: float) -> tuple[float, float]:
    """The middle of a range, where materials are: the rest is reached from there."""
    width = upper - lower
    return (lower + 0.4 * width, upper - 0.05 * width) if scale == "log" else (lower + 0.1 * width, lower + 0.6 * width)


def search(points: Sequence[np.ndarray], descend: Descend, level: float, progress: Callable[[float], None]) -> list[Minimum]:
    """Minima that the points lead to, best first; `level` is the cost below which no two images are told apart."""
    found = []
    for minimum in descend([Minimum((k,), point, np.inf, np.eye(len(point))) for k, point in enumerate(points)], "coarse"):
        found.append(minimum)
        progress(len(found) / len(points))
    places = distinct(found, level)
    ends = [dataclasses.replace(end, ended=True) for end in descend(places[:FOLLOWED], "polish")]
    return ranked(distinct([*ends, *places[FOLLOWED:]], level), level)


def distinct(found: Sequence[Minimum], level: float) -> list[Minimum]:
    """One of each minimum, best first, with the starts of all that came there."""
    kept: list[Minimum] = []
    for minimum in sorted(found, key=lambda m: m.cost):
        for k, better in enumerate(kept):
            if same(better, minimum, level):
                kept[k] = dataclasses.replace(better, starts=(*better.starts, *minimum.starts))
                break
        else:
            kept.append(minimum)
    return kept


def same(better: Minimum, other: Minimum, level: float) -> bool:
    """Whether two points lie in one valley, by the mean of their curvatures."""
    away = other.vector - better.vector
    return bool(0.25 * away @ (better.gram + other.gram) @ away <= SAME * better.cost + level)


def ranked(minima: Sequence[Minimum], level: float) -> list[Minimum]:
    """The minima with their costs over that of the first."""
    best = minima[0].cost + level
    return [dataclasses.replace(m, over=(m.cost + level) / best) for m in minima]


def in_sight(minima: Sequence[Minimum]) -> list[Minimum]:
    """The best minimum, and those that come near it."""
    return [m for m in minima if m.ended and m.over <= SIGHT]
