"""The thin film that glTF and three.js draw on a metal: two orders of interference in three channels (Belcour and Barla 2017, as
KHR_materials_iridescence has it). Ours integrates Airy's formula over the spectrum (`optics.film`)."""

import math
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._chunk import clip, safe_sqrt
from .._types import Colour, Number, Scalar
from ..optics.fresnel import dielectric_f0, fresnel_hoffman

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
    turned = jnp.sign(eta - below)  # by pi where what is below is denser than the film
    return jnp.maximum(_airy(top, bottom, both, (turned, 0.0), 2.0 * eta * film_nm * cosine, 2, rgb), 0.0)


def filmed_metal(c: Scalar, film_nm: Number, film_eta: Number, f0: Colour, f82: Colour, rgb: tuple[Colour, ...]) -> Colour:
    """The same on a metal that reflects `f0` at the normal and `f82` at 82 degrees, as Cycles has it: both polarisations, and three orders.

    Index and extinction, which turn the phase of light, are taken from the two as if they were those of Gulbrandsen 2014.
    """
    eta: Any = film_eta
    r = jnp.minimum(f0, 0.999)
    root = safe_sqrt(r)
    n = (1.0 + root) / (1.0 - root) * (1.0 - f82) + (1.0 - r) / (1.0 + r) * f82
    k = safe_sqrt((r * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - r))
    cosine = safe_sqrt(1.0 - (1.0 - c * c) / (eta * eta))
    bottom = clip(fresnel_hoffman(cosine, ((n - eta) ** 2 + k * k) / ((n + eta) ** 2 + k * k), f82), 0.0, 1.0)
    total: Any = 0.0
    for top, phase in zip(_top(c, cosine, eta), _phases(cosine, eta, n, k), strict=True):
        sign = -jnp.sign(top)
        both = clip(top * top * bottom, 1e-12, 0.9999)
        phasor = (sign * phase[0], sign * phase[1])
        total = total + 0.5 * _airy(top * top, bottom, both, phasor, 2.0 * eta * film_nm * cosine, 3, rgb)
    return clip(total, 0.0, 1.0)


def _top(c: Scalar, cosine: Any, eta: Any) -> tuple[Any, Any]:
    """Amplitudes that the film's upper side reflects, across (s) and along (p) the plane of incidence."""
    return (c - eta * cosine) / (c + eta * cosine), (eta * c - cosine) / (eta * c + cosine)


def _phases(c: Scalar, eta: Any, n: Any, k: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Cosine and sine of what light is turned by below the film, s and p (Born and Wolf 1999, 14.4.1)."""
    t = n * n - k * k - eta * eta * (1.0 - c * c)
    size = safe_sqrt(t * t + (2.0 * n * k) ** 2)
    u, v = safe_sqrt(0.5 * (size + t)), safe_sqrt(0.5 * (size - t))
    s = (eta * c) ** 2 - size, 2.0 * eta * c * v
    p = ((n * n + k * k) * c) ** 2 - eta * eta * size, 2.0 * eta * c * ((n * n - k * k) * v - 2.0 * n * k * u)
    return _unit(*s), _unit(*p)


def _unit(x: Any, y: Any) -> tuple[Any, Any]:
    length = jnp.maximum(safe_sqrt(x * x + y * y), 1e-12)
    return x / length, y / length


def _airy(top: Any, bottom: Any, both: Any, phasor: tuple[Any, Any], way_nm: Any, orders: int, rgb: tuple[Colour, ...]) -> Any:
    """What light between two sides of a film comes to: their reflectances, the product of these, and the phase by which both turn it together."""
    series = (1.0 - top) ** 2 * bottom / (1.0 - both)
    total: Any = top + series
    term: Any = series - (1.0 - top)
    x, y = phasor
    for order in range(1, orders + 1):
        term = term * safe_sqrt(both)
        total = total + 2.0 * term * _seen(order * way_nm, (x, y), rgb)
        x, y = x * phasor[0] - y * phasor[1], x * phasor[1] + y * phasor[0]
    return total


def _seen(way_nm: Any, phasor: tuple[Any, Any], rgb: tuple[Colour, ...]) -> Colour:
    """What an eye makes of cos(2 pi way / wavelength - phase) over the spectrum."""
    phase = 2.0e-9 * jnp.pi * way_nm
    waves = [
        height * (phasor[0] * jnp.cos(place * phase) + phasor[1] * jnp.sin(place * phase)) * jnp.exp(-variance * phase * phase)
        for height, place, variance in zip(_HEIGHT, _PLACE, _VARIANCE, strict=True)
    ]
    return rgb[0] * (waves[0] + waves[3]) + rgb[1] * waves[1] + rgb[2] * waves[2]
