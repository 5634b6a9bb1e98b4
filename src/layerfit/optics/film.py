"""A thin film on a boundary: interference between what its two sides reflect (Born and Wolf 1999, 1.6 and 14.4).

Indices are relative to the medium above; `c` is the cosine there. The film is lossless and its `thickness` is in wavelengths of
the medium above: d n / lambda. What lies below the film is a dielectric (k = 0) or a metal eta + i k.

Airy's formula (r12 + r23 e^2id) / (1 + r12 r23 e^2id) is taken in the form of the characteristic matrix (Abeles 1950), multiplied out.
Only cos d and sin d / q enter, which are analytic in q^2: it is as good where total reflection begins in the film, and at no thickness
it is the boundary without a film.

Three channels are not three wavelengths: those alias from some 500 nm of path on. A film's reflectance is integrated over the spectrum
once a material, at a few angles, and `bake` makes it Schlick's formula with a polynomial for the reflectance at the normal.
"""

import math
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, safe_sqrt, where
from .._types import Colour, Number, Scalar
from .spectra import WAVELENGTHS_NM, daylight_weights

TERMS = 10
"""Of the polynomial: its error in the reflectance is 1e-3, root mean square over metals, films and thicknesses (`tools/measure_film.py`)."""

NODES = 2 * TERMS
"""Angles at which the spectrum is integrated."""

GRAZING = 0.06
"""sqrt(c) below which the polynomial is held: nothing happens there, and it would ask for more digits than float32 has."""

OPEN = 0.3
"""Cosine from which on the reflectance has the digits, and not what is left of 1."""

SERIES = 10
"""Terms of cos and sin for phases below 1, exact to the last digit of float64."""


class Waves(NamedTuple):
    """One polarisation at the top of the film: |r|^2 is `back` / `all`, and what passes `through` / `all`."""

    back: Colour
    through: Colour
    all: Colour


def film_reflectance(c: Scalar, film_eta: Colour, eta: Colour, k: Colour, thickness: Colour) -> Colour:
    """Reflectance of a boundary with a film on it, at one wavelength, unpolarised."""
    s, p = _polarisations(c, film_eta, eta, k, thickness)
    return 0.5 * (s.back / s.all + p.back / p.all)


def film_transmittance(c: Scalar, film_eta: Colour, eta: Colour, k: Colour, thickness: Colour) -> Colour:
    """1 - film_reflectance, with its own digits where the reflectance is near 1 (grazing): what the medium below takes in."""
    s, p = _polarisations(c, film_eta, eta, k, thickness)
    return 0.5 * (s.through / s.all + p.through / p.all)


def _polarisations(c: Scalar, film_eta: Colour, eta: Colour, k: Colour, thickness: Colour) -> tuple[Waves, Waves]:
    """Tangential fields E and H at the top of the film for a wave of amplitude 1 (s) or q (p) below it, as (real, imaginary) pairs.

    x = q2^2 and q = a + i b, squared cosines times indices in the film and below. C is cos d, S is sin d / q2.
    """
    film2 = film_eta * film_eta
    eta2, eta2_i = (eta - k) * (eta + k), 2.0 * eta * k
    # index^2 - sin^2 as (index - 1) (index + 1) + c^2, which does not cancel where indices match.
    a, b = _root((eta - 1.0) * (eta + 1.0) - k * k + c * c, eta * k)
    x = (film_eta - 1.0) * (film_eta + 1.0) + c * c
    C, S, faded = _standing(x, thickness)
    xS = x * S
    s = _waves((c * (C + b * S), -c * (a * S)), (a * C, b * C - xS), c * a * faded)
    p = _waves(
        (a * C + eta2_i / film2 * xS, b * C - eta2 / film2 * xS),
        (c * (eta2 * C + film2 * b * S), c * (eta2_i * C - film2 * a * S)),
        c * (eta2 * a + eta2_i * b) * faded,
    )
    return s, p


def _waves(E: tuple[Colour, Colour], H: tuple[Colour, Colour], flux: Colour) -> Waves:
    """From both fields, weighted by the medium above. The flux Re(E H*) is the same at both sides of a lossless film."""
    back = (E[0] - H[0]) ** 2 + (E[1] - H[1]) ** 2
    total = (E[0] + H[0]) ** 2 + (E[1] + H[1]) ** 2
    return Waves(back, 4.0 * flux, jnp.maximum(total, 1e-30))


def _root(p: Colour, h: Colour) -> tuple[Colour, Colour]:
    """a + i b, a and b >= 0, whose square is p + 2 i h; h >= 0."""
    q = jnp.sqrt(jnp.maximum(p * p + 4.0 * h * h, 1e-36))
    larger = jnp.sqrt(0.5 * (q + jnp.abs(p)))
    smaller = h / larger
    return where(p < 0.0, smaller, larger), where(p < 0.0, larger, smaller)


def _standing(x: Colour, thickness: Colour) -> tuple[Colour, Colour, Colour]:
    """cos d and sin d / sqrt(x) for the phase d = 2 pi thickness sqrt(x); and by what the square of both was multiplied.

    Where x < 0 light fades in the film: cosh and sinh, times exp(-|d|), which leaves every ratio as it is and never overflows.
    """
    k = 2.0 * math.pi * thickness
    z = k * k * x
    thin = jnp.abs(z) < 1.0
    root = jnp.sqrt(where(thin, 1.0, jnp.abs(x)))
    turns = where(thin, 0.0, thickness * root)
    phase = 2.0 * math.pi * (turns - jnp.floor(turns))  # of many turns, float32 would lose the last one's digits
    fading = jnp.exp(-4.0 * math.pi * turns)
    fades = x < 0.0
    C = where(fades, 0.5 + 0.5 * fading, jnp.cos(phase))
    S = where(fades, 0.5 - 0.5 * fading, jnp.sin(phase)) / root
    near = where(thin, z, 0.0)
    C = where(thin, _series(near, 0), C)
    S = where(thin, k * _series(near, 1), S)
    return C, S, where(fades & ~thin, fading, 1.0)


def _series(z: Colour, odd: int) -> Colour:
    """cos(sqrt(z)), or sin(sqrt(z)) / sqrt(z) with `odd` = 1, and the same of hyperbolic ones for z < 0."""
    total: Any = 0.0
    for j in reversed(range(SERIES)):
        total = total * z + (-1.0) ** j / math.factorial(2 * j + odd)
    return total


@jax.jit
def bake(film_eta: Number, eta: Number, k: Number, film_nm: Number) -> tuple[Colour, ...]:
    """f0 for which Schlick's formula is a film's reflectance in daylight: `TERMS` Chebyshev coefficients in `chebyshev_argument(c)`.

    `film_nm` is the thickness times the index of the medium above. Coefficients are colours of (3,). By way of f0 both the
    reflectance of a film that hardly reflects and the transmittance at grazing angles keep their digits.
    """
    film_eta, eta, k, film_nm = map(jnp.asarray, (film_eta, eta, k, film_nm))
    cosines, fit = (jnp.asarray(x, film_nm.dtype) for x in _fit())
    weights, wavelengths = (jnp.asarray(x, film_nm.dtype) for x in (daylight_weights(), WAVELENGTHS_NM))

    def light(of_wave: Any, c: Scalar) -> Colour:
        values = jax.vmap(lambda wavelength: of_wave(c, film_eta, eta, k, film_nm / wavelength))(wavelengths)
        return jnp.sum(weights * values.reshape(len(wavelengths), *(-1,) * (weights.ndim - 1)), 0)

    def open_f0(c: Scalar) -> Colour:
        return (light(film_reflectance, c) - (1.0 - c) ** 5) / schlick_complement(c)

    def grazing_f0(c: Scalar) -> Colour:
        return 1.0 - light(film_transmittance, c) / schlick_complement(c)

    count = int(np.sum(_fit()[0] > OPEN))
    values = jnp.concatenate([jax.vmap(open_f0)(cosines[:count]), jax.vmap(grazing_f0)(cosines[count:])])
    # In full: a GPU's fast product has three digits.
    return tuple(jnp.matmul(fit, values, precision="highest"))


def schlick_complement(c: Any) -> Any:
    """1 - (1 - c)^5, with its own digits where c is small."""
    return c * (5.0 - c * (10.0 - c * (10.0 - c * (5.0 - c))))


@chunk
def chebyshev_argument(c: Scalar) -> Scalar:
    """sqrt(c) as -1 to 1, from where a film's polynomial begins."""
    return jnp.maximum((2.0 * safe_sqrt(c) - (1.0 + GRAZING)) / (1.0 - GRAZING), -1.0)


@cache
def _fit() -> tuple[np.ndarray, np.ndarray]:
    """Cosines (NODES,), falling, and the matrix (TERMS, NODES) from f0 there to the coefficients.

    Least squares with the weight sqrt(1 - (1 - c)^5): without the root, which makes them of the reflectance itself, they would magnify the
    rounding of float32 at grazing angles.
    """
    s = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    cosines = (0.5 * ((1.0 - GRAZING) * s + 1.0 + GRAZING)) ** 2
    weight = np.sqrt(schlick_complement(cosines))
    return cosines, np.linalg.pinv(weight[:, None] * np.polynomial.chebyshev.chebvander(s, TERMS - 1)) * weight
