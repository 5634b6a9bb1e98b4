"""The thin film that glTF and three.js draw on a metal: two orders of interference in three channels (Belcour and Barla 2017, as
KHR_materials_iridescence has it). Ours integrates Airy's formula over the spectrum (`optics.film`)."""

import math
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._chunk import clip, safe_sqrt
from .._types import Colour, Number, Scalar
from ..optics.fresnel import dielectric_f0

_PLACE = (1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6)
_VARIANCE = (4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9)
"""Of Gaussians of wave number that stand for X, Y, Z, and for the second maximum of X (their supplement, code listing)."""

_HEIGHT = tuple(
    height * math.sqrt(2.0 * math.pi * variance) / 1.0685e-7
    for height, variance in zip((5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14), _VARIANCE, strict=True)
)
"""Over that of white."""

_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""XYZ to linear Rec.709."""


def to_rgb(dtype: Any) -> tuple[Colour, Colour, Colour]:
    """What X, Y and Z add to the channels of linear Rec.709: three colours, so that a channel may be had on its own."""
    x, y, z = (jnp.asarray(column, dtype) for column in _TO_RGB.T)
    return x, y, z


def filmed_reflectance(
    c: Scalar, film_nm: Number, film_eta: Number, f0: Colour, rgb: tuple[Colour, ...], schlick: Callable[[Any, Any], Any]
) -> Colour:
    """Reflectance at the cosine `c` of a film in air on a medium that reflects `f0` at the normal: a clear one, whatever it is.

    `rgb` is what `to_rgb` gives; `schlick(c, f0)` is Schlick's formula as the program writes it. Where a channel of `f0` is below what the film alone
    would reflect and another is not, the program mixes their phases; here each keeps its own.
    """
    eta: Any = film_eta
    cosine = safe_sqrt(1.0 - (1.0 - c * c) / (eta * eta))
    top = schlick(c, dielectric_f0(eta))
    root = safe_sqrt(clip(f0, 0.0, 0.9999))
    below = (1.0 + root) / (1.0 - root)  # the index that reflects f0 in air
    bottom = schlick(cosine, ((below - eta) / (below + eta)) ** 2)
    both = clip(top * bottom, 1e-5, 0.9999)
    series = (1.0 - top) ** 2 * bottom / (1.0 - both)
    total: Any = top + series
    turned = jnp.sign(eta - below)  # by pi where what is below is denser than the film
    term: Any = series - (1.0 - top)
    for order in (1, 2):
        term = term * safe_sqrt(both) * turned
        total = total + 2.0 * term * _seen(order * 2.0 * eta * film_nm * cosine, rgb)
    return jnp.maximum(total, 0.0)


def _seen(way_nm: Any, rgb: tuple[Colour, ...]) -> Colour:
    """What an eye makes of cos(2 pi way / wavelength) over the spectrum."""
    phase = 2.0e-9 * jnp.pi * way_nm
    waves = [
        height * jnp.cos(place * phase) * jnp.exp(-variance * phase * phase)
        for height, place, variance in zip(_HEIGHT, _PLACE, _VARIANCE, strict=True)
    ]
    return rgb[0] * (waves[0] + waves[3]) + rgb[1] * waves[1] + rgb[2] * waves[2]
