"""Random numbers that depend on where they are used alone: which lane, which path, which event."""

import jax
import jax.numpy as jnp

from .._types import Scalar

Bits = jax.Array


@jax.jit
def uniforms(lane: Bits, path: Bits, event: Bits, seed: Bits) -> tuple[Scalar, ...]:
    """Eight numbers in (0, 1), float32, for four counters: two rounds of pcg4d (Jarzynski and Olano 2020, listing 4)."""
    # Doubled, so that the two rounds differ in one counter and no two events share one.
    event = event * jnp.uint32(2)
    bits = _pcg4d(lane, path, event, seed) + _pcg4d(lane, path, event + jnp.uint32(1), seed)
    return tuple(_unit(x) for x in bits)


# Roots of x^9 = x + 1, to the powers -1 to -8, in units of 2^-32: the golden ratio of eight dimensions (Roberts 2018).
_STEPS = tuple(round(1.085070245491451**-k * 2**32) for k in range(1, 9))


def even_uniforms(index: Bits, seed: Bits) -> tuple[Scalar, ...]:
    """Eight numbers in (0, 1), float32, that over consecutive indices fill their cube more evenly than random ones."""
    zero = jnp.zeros_like(seed)
    offsets = _pcg4d(seed, zero, zero, zero) + _pcg4d(seed, zero, zero, zero + jnp.uint32(1))
    return tuple(_unit(offset + index * jnp.uint32(step)) for offset, step in zip(offsets, _STEPS, strict=True))


def _pcg4d(*counters: Bits) -> tuple[Bits, ...]:
    x, y, z, w = (v * jnp.uint32(1664525) + jnp.uint32(1013904223) for v in counters)
    x, y, z, w = _stir(x, y, z, w)
    x, y, z, w = (v ^ (v >> jnp.uint32(16)) for v in (x, y, z, w))
    return _stir(x, y, z, w)


@jax.jit
def _stir(x: Bits, y: Bits, z: Bits, w: Bits) -> tuple[Bits, ...]:
    x = x + y * w
    y = y + z * x
    z = z + x * y
    w = w + y * z
    return x, y, z, w


def _unit(bits: Bits) -> Scalar:
    # The upper 23 bits as a mantissa, half a step off both ends: neither 0 nor 1 ever comes, so that log(u) and log(1 - u) are finite.
    mantissa = (bits >> jnp.uint32(9)) | jnp.uint32(0x3F800000)
    return jax.lax.bitcast_convert_type(mantissa, jnp.float32) - jnp.float32(1.0 - 2.0**-24)
