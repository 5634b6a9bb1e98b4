"""What the numbers of a coat over a base are called by other programs: roughness, tints, anisotropy."""

import math
from typing import Any

import numpy as np

from ..documents import is_number
from ..errors import InputError
from .engine import NARROWEST, WIDEST, Engine


def roughness(alpha: Any) -> float:
    """An artist's roughness of a GGX width."""
    return digits(math.sqrt(float(alpha)))


def width(roughness: float) -> float:
    """The GGX width of an artist's roughness."""
    return clipped(min(max(roughness, 0.0), 1.0) ** 2)


def clipped(alpha: Any) -> float:
    """A GGX width that an engine takes: the nearest, for a program whose lobes may be narrower or wider."""
    return min(max(float(alpha), NARROWEST), WIDEST)


def widths(engine: Engine) -> tuple[float, float] | None:
    """The greater and the smaller width of a base with a grain; None for one without."""
    if engine.alpha_x is None:
        return None
    x, y = float(engine.alpha_x), float(engine.alpha_y)
    return max(x, y), min(x, y)


def strength(pair: tuple[float, float]) -> float:
    """The anisotropy of glTF and Babylon.js: the greater width is mix(smaller, 1, strength^2)."""
    return digits(math.sqrt((pair[0] - pair[1]) / max(1.0 - pair[1], 1e-6)))


def across(engine: Engine) -> bool:
    """Whether the greater width lies across the tangent."""
    return engine.alpha_x is not None and float(engine.alpha_y) > float(engine.alpha_x)


def tint(engine: Engine, ways: float) -> list[float] | None:
    """What is left of light at normal incidence after so many ways through the coat; None for a clear one."""
    return None if engine.coat_tau is None else color(np.exp(-ways * np.asarray(engine.coat_tau, float)))


def depth(tint: Any, ways: float) -> np.ndarray:
    """The inverse: optical depth (3,), one way."""
    return -np.log(np.clip(np.asarray(tint, float), 1e-6, 1.0)) / ways


def film(nm: float, eta: float) -> dict[str, float]:
    """A film on a metal, as thick and as dense as an engine takes it."""
    return {"film_nm": float(np.clip(nm, 0.0, 2000.0)), "film_eta": float(np.clip(eta, 1.0, 3.0))}


def metallic(engine: Engine) -> float:
    """Part of the base that is metal."""
    return digits(engine.metallic) if engine.base == "mixed" else float(engine.base == "metal")


def base_of(metallic: float, has_lobe: bool) -> str:
    """The kind of a base by its part of metal, and by whether its dielectric part has a lobe."""
    if metallic >= 1.0:
        return "metal"
    if metallic > 0.0:
        return "mixed"
    return "glossy" if has_lobe else "diffuse"


def color(value: Any) -> list[float]:
    """Three numbers in [0, 1]."""
    return [digits(v) for v in np.clip(np.broadcast_to(np.asarray(value, float), 3), 0.0, 1.0)]


def checked(value: Any, default: Any, where: str) -> Any:
    """A value that is read, of the kind of its default: three numbers for a colour, else one. Raises `InputError` for another."""
    if isinstance(default, list) and isinstance(value, list) and len(value) == 3 and all(map(is_number, value)):
        return value
    if isinstance(default, float) and is_number(value):
        return value
    raise InputError(f"{where} = {value!r}: should be {'three numbers' if isinstance(default, list) else 'a finite number'}")


def digits(value: Any) -> float:
    """A number with the digits that float32 holds and people read."""
    return float(f"{float(value):.6g}")
