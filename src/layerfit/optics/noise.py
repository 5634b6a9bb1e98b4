"""Noise over a surface: a smooth field of random values, the same in JAX and in a shader.

Values stand at the corners of a grid, hashed from their place; between them the field is smooth. It depends on a seed and a place alone.
"""

import jax.numpy as jnp

from .._chunk import chunk
from .._types import Scalar, UInt, Vec2
from .hashing import hash_cell, unit

OCTAVES = 4
"""Layers of detail in `fbm`, each half as strong and half as large as the one before."""


@chunk
def corner_value(corner: Vec2, seed: UInt) -> Scalar:
    """The random number in (0, 1) of one corner of the grid."""
    return unit(hash_cell(corner, seed)[0], corner[0])


@chunk
def value_noise(p: Vec2, seed: UInt) -> Scalar:
    """Value noise in (0, 1) with cells of size 1 and a quintic fade, which has two continuous derivatives (Perlin 2002)."""
    cell = jnp.floor(p)
    f = p - cell
    fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0)
    right = jnp.array([1.0, 0.0], p.dtype)
    above = jnp.array([0.0, 1.0], p.dtype)
    a = corner_value(cell, seed)
    b = corner_value(cell + right, seed)
    c = corner_value(cell + above, seed)
    d = corner_value(cell + right + above, seed)
    lower = a + (b - a) * fade[0]
    upper = c + (d - c) * fade[0]
    return lower + (upper - lower) * fade[1]


@chunk
def fbm(p: Vec2, seed: UInt) -> Scalar:
    """Fractal sum of value noise in (0, 1): gain 1/2, lacunarity 2 (Musgrave, Kolb and Mace 1989)."""
    total = value_noise(p, seed)
    for octave in range(1, OCTAVES):
        frequency = 2.0**octave
        total = total + value_noise(p * frequency, seed + jnp.uint32(octave)) / frequency
    return total / (2.0 - 2.0 ** (1 - OCTAVES))
