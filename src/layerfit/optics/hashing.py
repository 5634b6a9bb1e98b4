"""Random numbers that are the same everywhere: a hash of whole numbers, to the bit the same in JAX and in a shader.

What is scattered over a surface (flakes, noise) depends on its place alone, not on time, image size or device. Arithmetic is that of
unsigned 32-bit words, which wraps around by definition. There is no derivative.
"""

import jax.numpy as jnp

from .._chunk import chunk
from .._types import Scalar, UInt, UVec3, Vec2


@chunk
def pcg3d(v: UVec3) -> UVec3:
    """Three hashed words of three words (Jarzynski and Olano 2020, listing 5)."""
    v = v * jnp.uint32(1664525) + jnp.uint32(1013904223)
    x = v[0] + v[1] * v[2]
    y = v[1] + v[2] * x
    z = v[2] + x * y
    x = x ^ (x >> jnp.uint32(16))
    y = y ^ (y >> jnp.uint32(16))
    z = z ^ (z >> jnp.uint32(16))
    x = x + y * z
    y = y + z * x
    z = z + x * y
    return jnp.stack([x, y, z])


@chunk
def hash_cell(cell: Vec2, seed: UInt) -> UVec3:
    """Three hashed words of the cell of a grid, whose corner is at whole numbers below 2^23, negative ones included."""
    i = cell.astype(jnp.int32).astype(jnp.uint32)  # by way of int: a negative float has no unsigned value
    return pcg3d(jnp.stack([i[0], i[1], seed]))


def unit(bits: UInt, like: Scalar) -> Scalar:
    """A number in (0, 1) of 24 of the bits, in the precision of `like`; neither 0 nor 1 ever comes, so that its logarithm is finite."""
    u = ((bits >> jnp.uint32(8)).astype(like.dtype) + 0.5) * 2.0**-24
    # In float32 the half is rounded away above 2^23, and the largest number would come out as 1.
    return jnp.minimum(u, 1.0 - float(jnp.finfo(like.dtype).epsneg))
