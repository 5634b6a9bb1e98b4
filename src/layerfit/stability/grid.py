"""Where a structure is tried: corners of its ranges, lines through them, and the directions at which formulas break."""

import dataclasses
import itertools
import math
from typing import Any

import jax
import numpy as np

from ..fit.parameters import Free, known_parameters
from ..stack import Stack

POLAR_DEG = (0.0, 0.001, 20.0, 45.0, 70.0, 85.0, 89.0, 89.9, 89.99)
"""Of the light: at the normal and beside it, where angles lose their azimuth, to grazing, which is also where light is refracted at the
edge of total reflection."""
NEAR_DEG = 0.3
"""Beside the mirror direction: on the flank of a narrow lobe."""

LINE = 7
"""Values evenly along the scale of a parameter, ends included, for its line through the defaults."""
CLOSE = (1e-12, 1e-6, 1e-3)
"""Steps from each end into the range, in parts of it, and about an index that is that of another layer: what breaks at equal indices or
without absorption breaks beside it too. The first is below the squared cosine of a grazing direction, by which an index is near 1 there."""


@dataclasses.dataclass(frozen=True)
class Grid:
    """Materials of one structure: values (m, n) of its n parameters, and which rows are a line along which parameter."""

    free: tuple[Free, ...]
    values: np.ndarray
    lines: dict[str, np.ndarray]
    """Rows along each parameter, by its name, ascending."""
    default: int
    """The row of the material that the structure is given with."""

    def stack(self, template: Stack, dtype: Any, rounded: bool = True) -> Stack:
        """All materials as one, every number an array (m,), rounded to float32 in every precision."""
        values = self.values.astype(np.float32) if rounded else self.values
        columns = list(values.T.astype(dtype))
        return jax.tree.unflatten(jax.tree.structure(template), columns)

    def material(self, template: Stack, row: int) -> Stack:
        """One of them, in float32."""
        return jax.tree.unflatten(jax.tree.structure(template), list(self.values[row].astype(np.float32)))

    def inputs(self, row: int) -> dict[str, float]:
        """Parameters of one material, as they were rounded."""
        return {f.name: float(np.float32(value)) for f, value in zip(self.free, self.values[row], strict=True)}


def parameters(stack: Stack) -> tuple[Free, ...]:
    """Every number of a material, in the order of its leaves."""
    return tuple(Free(name, *told, (slot,)) for slot, (name, told) in enumerate(known_parameters(stack).items()))


def grid(stack: Stack, corners: int, seed: int = 0) -> Grid:
    """Corners of all ranges (as many of them as asked for, drawn at random where there are more), and lines through the defaults."""
    free = parameters(stack)
    start = np.array([float(leaf) for leaf in jax.tree.leaves(stack)])
    rows = [_corners(free, corners, seed)]
    lines, count = {}, len(rows[0])
    for k, f in enumerate(free):
        along = _line(f, [start[j] for j, g in enumerate(free) if g.field == f.field == "eta" and j != k])
        rows.append(np.repeat(start[None], len(along), 0))
        rows[-1][:, k] = along
        lines[f.name] = count + np.arange(len(along))
        count += len(along)
    return Grid(free, np.concatenate([*rows, start[None]]), lines, count)


def _corners(free: tuple[Free, ...], most: int, seed: int) -> np.ndarray:
    ends = np.array([(f.spec.lower, f.spec.upper) for f in free])
    n = len(free)
    if 2**n <= most:
        sides = np.array(list(itertools.product((0, 1), repeat=n)))
    else:
        drawn = np.random.default_rng((seed, n)).integers(0, 2, (most - 2, n))
        sides = np.concatenate([np.zeros((1, n), int), np.ones((1, n), int), drawn])
    return ends[np.arange(n), sides]


def _line(f: Free, meets: list[float]) -> np.ndarray:
    """From end to end, evenly in the coordinate of a fit, and close to the ends and to the values of other layers that it meets."""
    low, high = (float(f.to_steps(end)) for end in (f.spec.lower, f.spec.upper))
    parts = np.unique([*np.linspace(0.0, 1.0, LINE), *CLOSE, *(1.0 - step for step in CLOSE)])
    inner = [float(f.from_steps(low + part * (high - low), np)) for part in parts]
    span = f.spec.upper - f.spec.lower
    inner += [value + side * step * span for value in meets for side in (-1.0, 1.0) for step in (0.0, *CLOSE)]
    return np.unique(np.clip(inner, f.spec.lower, f.spec.upper))


def directions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of unit directions (d, 3) and (d, 3), and the place (d,) of the light's angle in `POLAR_DEG`.

    For every light: views at the normal, along the light (retro), at its mirror direction and beside it, aside, at another angle, and
    grazing on the far side, on the near side and aside.
    """
    wi, wo, place = [], [], []
    for k, theta in enumerate(POLAR_DEG):
        aside = min(theta + NEAR_DEG, 89.99)
        far = ((0.0, 0.0), (theta, 0.0), (theta, 180.0), (aside, 180.0), (theta, 90.0), (35.0, 150.0))
        for view in (*far, (89.99, 180.0), (89.99, 0.0), (89.99, 75.0)):
            wi.append(_direction(theta, 0.0))
            wo.append(_direction(*view))
            place.append(k)
    return np.array(wi), np.array(wo), np.array(place)


def _direction(theta_deg: float, phi_deg: float) -> np.ndarray:
    # Turned by an odd angle, so that no component is 0 by chance; exact zeros are at the normal.
    theta, phi = math.radians(theta_deg), math.radians(phi_deg + 20.0)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])
