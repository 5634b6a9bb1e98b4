"""How far a layer has grown at a place of the surface."""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, member, struct
from .._types import Scalar, Vec2
from ..layers.growing import Growing
from ..optics.growth import coverage, exposed_part, grown, partly_grown
from ..optics.noise import fbm

# Standard deviation of fbm, measured on 10^6 places; its mean is one half, by symmetry.
FIELD_SPREAD = 0.139

MEAN_SKY = 0.5
"""What a surface of no known place sees: the mean over all directions that it may face."""


@struct
class Growth:
    """Where a layer has grown, and since when."""

    theta: Scalar = member("value of the field up to which the surface is covered")
    age: Scalar = member("age, in onset times")
    steepness: Scalar = member("exponent of the age")
    softness: Scalar | None = member("width of the edge, in the unit of the field")
    cells: Scalar = member("cells of the coarsest noise in a unit of texture")
    seed: Scalar = member("which noise: a whole number")
    exposure: Any = member("part of the growth that needs the open sky")


def growth_of(layer: Growing) -> Growth:
    """What is computed once of a layer that grows."""
    age = layer.years / layer.onset_years
    theta = coverage(age, jnp.ones_like(age), layer.steepness)
    return Growth(theta, age, layer.steepness, layer.softness, layer.cells, layer.seed, layer.exposure)


def aged_at(growth: Growth, sky: Scalar | float) -> Growth:
    """The growth of a place that sees so much of the sky."""
    return growth if growth.exposure is None else aged_under(growth, jnp.asarray(sky, growth.age.dtype))


@chunk
def aged_under(growth: Growth, sky: Scalar) -> Growth:
    """Growth where so much of the sky is seen: its age is what is felt there."""
    age = growth.age * exposed_part(sky, growth.exposure)
    theta = coverage(age, jnp.ones_like(age), growth.steepness)
    return dataclasses.replace(growth, theta=theta, age=age)


@chunk
def field_at(uv: Vec2, growth: Growth) -> Scalar:
    """The field of a layer that grows, at a place of the surface: early where it is small."""
    return fbm(uv * growth.cells, growth.seed.astype(jnp.uint32))


@struct
class Cover:
    """How much of a place a layer covers."""

    covered: Scalar = member("part that is covered")
    bare: Scalar = member("part that is not: 1 - covered, without the cancellation")


@chunk
def cover_at(g: Scalar, growth: Growth) -> Cover:
    """How much of a place is covered, where the field is g."""
    if growth.softness is None:
        covered = grown(growth.theta, g)
        return Cover(covered, 1.0 - covered)
    return Cover(partly_grown(growth.theta, g, growth.softness), partly_grown(g, growth.theta, growth.softness))


def mean_cover(growth: Growth) -> tuple[Cover, Scalar]:
    """How much of the whole surface is covered, and the mean of the field where it is.

    The field is nearly normal. The mean of a soft step over a normal spread is a softer step (MacKay 1992, eq. 11), and by Stein's
    identity the field below the step is lower than its mean by the variance times the slope of the logarithm of that.
    """
    edge = 0.0 if growth.softness is None else growth.softness
    softness = jnp.sqrt(edge * edge + math.pi / 8.0 * FIELD_SPREAD**2)
    cover = cover_at(jnp.full_like(growth.theta, 0.5), dataclasses.replace(growth, softness=softness))
    return cover, 0.5 - FIELD_SPREAD**2 * cover.bare / softness
