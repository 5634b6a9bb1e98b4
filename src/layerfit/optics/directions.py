"""Directions: the part along the surface first, the cosine to its normal last.

In the frame of the surface the part along it has two numbers. What turns about the normal without a change needs no frame: there, the
part along the surface may be given in any space, by three numbers. Formulas here hold for both, so that they print with or without one.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import dot, where
from .._types import Direction, Flag, FreeDirection, Scalar


def along(w: Direction) -> jax.Array:
    """The part along the surface."""
    return w.along if isinstance(w, FreeDirection) else w[:-1]


def sine2(w: Direction) -> Scalar:
    """Squared sine to the normal."""
    part = along(w)
    return dot(part, part)


def product(a: Direction, b: Direction) -> Scalar:
    """Dot product of two directions, or of sums of directions."""
    if isinstance(a, FreeDirection) and isinstance(b, FreeDirection):
        return dot(a.along, b.along) + a.cosine * b.cosine
    return dot(a, b)


def numbers(w: Direction) -> jax.Array:
    """All numbers of a direction as one array, the cosine last."""
    return jnp.append(w.along, w.cosine) if isinstance(w, FreeDirection) else w


def direction(part: jax.Array, cosine: Scalar) -> Direction:
    """A direction of its part along the surface and its cosine."""
    return FreeDirection(part, cosine) if len(part) == 3 else jnp.concatenate([part, cosine[None]])


LEAST_COSINE = 1e-7
"""Of a direction above the surface: a unit vector in float32 does not tell on which side of 0 a smaller one is."""


def cosine(w: Direction | Scalar) -> Scalar:
    """The cosine to the normal of a direction, or what is one."""
    return w[-1] if isinstance(w, FreeDirection) or w.ndim else w


def both_above(wi: Direction | Scalar, wo: Direction | Scalar) -> Flag:
    """Whether both directions, or their cosines, are above the surface."""
    return jnp.minimum(cosine(wi), cosine(wo)) > LEAST_COSINE


@jax.jit
def above(lit: Flag, w: Any) -> Any:
    """A direction, or its cosine, where it is `lit`, else the normal: a guard of derivatives, for values that are then not used.

    In a shader it is the direction itself, and what comes of one below the surface is not chosen.
    """
    if isinstance(w, FreeDirection):
        return FreeDirection(where(lit, w.along, 0.0), where(lit, w.cosine, 1.0))
    return where(lit, w, jnp.asarray(np.eye(len(w))[-1] if w.ndim else 1.0, w.dtype))
