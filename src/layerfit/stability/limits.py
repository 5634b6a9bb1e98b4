"""What physics says between neighbouring materials: no jump where a part of a model comes in, and brighter or darker one way."""

from typing import Any

import numpy as np

from ..surfaces.pigment import BRIGHTENS, DARKENS
from .grid import CLOSE, Grid
from .measure import FLOOR

JUMP = 1e-2
"""Largest step of a value, over itself, in float64, between the end of a range, or equal indices, and 1e-12 of it away: a root, whose slope is
infinite there, makes 1e-6 of it and a lobe of the least width some hundred times that; a branch that does not meet its neighbour, more."""

DARKER = {"tau", "absorption_per_mm", "K_per_mm", *DARKENS}
BRIGHTER = {"albedo", "kd", "S_per_mm", *BRIGHTENS}
"""Parameters along which light can only be lost, or gained."""
SLACK = 1e-9
"""Rounding of float64, over the value."""


def breaks(tried: Grid, values: np.ndarray) -> list[dict[str, Any]]:
    """Every parameter along whose line a value jumps, or turns where it may not: largest first.

    `values` (m, d[, 3]) are of float64 at numbers that were not rounded to float32, which would make one of neighbours.
    """
    found = []
    for key, rows in tried.lines.items():
        f = values[rows].reshape(len(rows), -1)
        size = np.maximum(np.abs(f).max(0), FLOOR)
        step = np.diff(f, axis=0) / size
        near = np.flatnonzero(_near(tried, key, rows))
        jump = np.abs(step[near])
        if jump.max() > JUMP:
            found.append(_told("jump", key, tried, rows, jump.max(1), near))
        field = key.rpartition(".")[2]
        wrong = step if field in DARKER else -step if field in BRIGHTER else np.zeros_like(step)
        if wrong.max() > SLACK:
            found.append(_told("not monotone", key, tried, rows, wrong.max(1), range(len(rows) - 1)))
    return sorted(found, key=lambda told: -told["size"])


def _near(tried: Grid, key: str, rows: np.ndarray) -> np.ndarray:
    """Which neighbours along a line are as good as one (n - 1,): the end of a range and what is beside it, or two equal indices."""
    (k,) = (j for j, f in enumerate(tried.free) if f.name == key)
    f, values = tried.free[k], tried.values[rows, k]
    spec, close = f.spec, 2.0 * CLOSE[0]
    in_steps = np.diff(f.to_steps(values)) < close * float(f.to_steps(spec.upper) - f.to_steps(spec.lower))
    return in_steps | (np.diff(values) < close * (spec.upper - spec.lower))


def _told(kind: str, key: str, tried: Grid, rows: np.ndarray, sizes: np.ndarray, starts: Any) -> dict[str, Any]:
    k = int(np.argmax(sizes))
    row = int(rows[starts[k]])
    return {"kind": kind, "parameter": key, "size": float(sizes[k]), "from": tried.inputs(row), "to": tried.inputs(row + 1)}
