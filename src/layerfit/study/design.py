"""Which points a study tries: what is varied, over which values, and the designs that choose among them."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import qmc

from ..documents import check_keys, is_number, nearest
from ..errors import InputError

DESIGNS = ("grid", "latin", "sobol")
MOST_POINTS = 100_000
"""Of a study: each takes a fit."""


@dataclasses.dataclass(frozen=True)
class Factor:
    """What is varied: over levels, or between two ends."""

    name: str
    levels: tuple[Any, ...] = ()
    ends: tuple[float, float] | None = None
    log: bool = False

    def at(self, x: float) -> Any:
        """The value at a part of the range, 0 to 1."""
        if self.ends is None:
            return self.levels[min(int(x * len(self.levels)), len(self.levels) - 1)]
        low, high = np.log(self.ends) if self.log else self.ends
        value = low + x * (high - low)
        return float(np.exp(value) if self.log else value)


def factor_of(name: str, said: Any, where: str) -> Factor:
    """A factor as a study file says it: a list of values, or a table of `from`, `to`, `steps` and `scale`. Raises `InputError`."""
    if isinstance(said, list) and said:
        return Factor(name, tuple(tuple(v) if isinstance(v, list) else v for v in said))
    if not isinstance(said, Mapping):
        raise InputError(
            f"{where} = {said!r}: should be a list of values, or a table such as {{ from = 0.1, to = 1.0, steps = 5 }}"
        )
    check_keys(said, ("from", "to", "steps", "scale"), where)
    ends, scale, steps = (said.get("from"), said.get("to")), said.get("scale", "linear"), said.get("steps", 0)
    low, high = (float(end) if end is not None and is_number(end) else np.nan for end in ends)
    if not low < high or (scale == "log" and low <= 0.0):
        raise InputError(
            f"{where}: from = {ends[0]!r}, to = {ends[1]!r}: should be two numbers, the second larger, above 0 where the scale is log"
        )
    if scale not in ("linear", "log"):
        raise InputError(f"{where}.scale = {scale!r}: should be linear or log{nearest(str(scale), ('linear', 'log'))}")
    if not isinstance(steps, int) or isinstance(steps, bool) or not 0 <= steps <= MOST_POINTS or steps == 1:
        raise InputError(f"{where}.steps = {steps!r}: should be a whole number from 2")
    between = Factor(name, (), (low, high), scale == "log")
    return dataclasses.replace(between, levels=tuple(between.at(x) for x in np.linspace(0.0, 1.0, steps))) if steps else between


def designed(factors: Sequence[Factor], design: str, points: int | None, seed: int, where: str) -> list[dict[str, Any]]:
    """The points of a design, each a value for every factor.

    "grid": all combinations of levels, the last factor the fastest. "latin": a Latin hypercube (McKay, Beckman and Conover 1979) of so many
    `points`; "sobol": a scrambled Sobol' sequence (Owen 1998), a power of two of them. Both by scipy.stats.qmc, and reproduced by their `seed`.
    Raises `InputError` for a grid over a factor without levels, and for numbers of points that a design cannot have.
    """
    if design not in DESIGNS:
        raise InputError(f"{where}.design = {design!r}: should be one of {', '.join(DESIGNS)}{nearest(design, DESIGNS)}")
    if design == "grid":
        if endless := [factor.name for factor in factors if not factor.levels]:
            raise InputError(f'{where}: a grid needs levels of {endless[0]!r}: give a list, or steps, or design = "sobol"')
        count = int(np.prod([len(factor.levels) for factor in factors]))
        _check_count(count, f"{where}: the grid")
        return [
            dict(zip([f.name for f in factors], values, strict=True))
            for values in itertools.product(*(f.levels for f in factors))
        ]
    _check_count(points, f"{where}.points")
    assert points is not None
    if design == "sobol" and points & (points - 1):
        raise InputError(
            f"{where}.points = {points}: a Sobol' sequence is balanced at powers of two; give {2 ** points.bit_length()}"
        )
    kind: Any = qmc.LatinHypercube if design == "latin" else qmc.Sobol  # their stubs do not know all names of the seed
    sampler = kind(len(factors), seed=seed)
    return [{f.name: f.at(x) for f, x in zip(factors, row, strict=True)} for row in sampler.random(points)]


def _check_count(count: Any, where: str) -> None:
    if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MOST_POINTS:
        raise InputError(f"{where} = {count!r}: should be 1 to {MOST_POINTS} points")
