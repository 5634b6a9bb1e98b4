"""Values of a scene file: each reader takes what stands there and where, and raises `InputError` that says so where it is no such value."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..documents import is_number, nearest
from ..errors import InputError
from .scene import Vector

LARGEST = 1e15
"""Number in a scene: beyond it, squares of lengths and light leave float32."""


def need(table: Mapping[str, Any], key: str, where: str) -> Any:
    """What stands at a key that has to be there."""
    if key not in table:
        raise InputError(f"{where}: {key} is missing")
    return table[key]


def text(value: Any, where: str) -> str:
    """Text that is not empty."""
    if not isinstance(value, str) or not value:
        raise InputError(f"{where} = {value!r}: should be text")
    return value


def number(value: Any, where: str) -> float:
    """A finite number."""
    if not is_number(value) or abs(value) > LARGEST:
        raise InputError(f"{where} = {value!r}: should be a finite number, at most {LARGEST:g}")
    return float(value)


def positive(value: Any, where: str) -> float:
    """A number above 0."""
    if number(value, where) <= 0.0:
        raise InputError(f"{where} = {value!r}: should be above 0")
    return float(value)


def vector(value: Any, where: str) -> Vector:
    """Three numbers."""
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(f"{where} = {value!r}: should be a list of three numbers")
    x, y, z = (number(v, where) for v in value)
    return (x, y, z)


def direction(value: Any, where: str) -> Vector:
    """Three numbers, made a unit vector."""
    to = np.array(vector(value, where))
    length = float(np.linalg.norm(to))
    if length == 0.0:
        raise InputError(f"{where} = {value!r}: a direction is not zero")
    x, y, z = (to / length).tolist()
    return (x, y, z)


def rgb(value: Any, where: str) -> Vector:
    """Light of three channels, or one number for all; not negative."""
    light = vector([value] * 3 if isinstance(value, (int, float)) else value, where)
    if min(light) < 0.0:
        raise InputError(f"{where} = {value!r}: light is not negative")
    return light


def layout(value: Any, where: str) -> str:
    """How the pixels of an environment map lie: there is one way."""
    if value != "lat-long, Y up":
        raise InputError(
            f'{where} = {value!r}: should be "lat-long, Y up" (u = atan2(d.x, -d.z) / 2 pi mod 1, v = acos(d.y) / pi)'
        )
    return value


def one_of(*known: str) -> Callable[[Any, str], str]:
    """A reader of one of the words that are known."""

    def read(value: Any, where: str) -> str:
        if value not in known:
            raise InputError(f"{where} = {value!r}: should be one of {', '.join(known)}{nearest(str(value), known)}")
        return value

    return read
