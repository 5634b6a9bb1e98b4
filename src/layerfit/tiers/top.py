"""What an isotropic coat reflects at its own top, from cosines alone.

An isotropic BRDF depends on three numbers: the cosines NoL and NoV, and how far the light's and the viewer's directions are from
mirroring each other, lean2 = |t_l + t_v|^2 with t the part of a direction along the surface. With these no frame is needed, and
nothing cancels: of s = l + v, |s|^2 = lean2 + (NoL + NoV)^2, and lean2 / |s|^2 is the squared sine of the half vector.
"""

import math
from dataclasses import fields, replace

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, divide, member, struct
from .._types import Scalar
from ..layers import Coat
from ..surfaces.base import Lobe
from ..surfaces.film import Baked
from .polynomial import MOST, Curve
from .surface import NODES, half_root


@chunk
def hidden_cosine(NoW: Scalar, alpha2: Scalar) -> Scalar:
    """NoW (1 + 2 Lambda) of GGX facets of squared width alpha2 (Heitz 2014, eq. 72, multiplied out)."""
    return jnp.sqrt(alpha2 + (1.0 - alpha2) * (NoW * NoW))


@struct
class Facet:
    """What `fresnel_dielectric` is made of."""

    reflected: Scalar = member("twice the reflectance, over (delta / product)^2")
    product: Scalar = member("(c + g)^2 (eta^2 c + g)^2")
    cg: Scalar = member("product of the cosine and of that below, times eta")


@chunk
def facet_of(eta: Scalar, c2: Scalar) -> Facet:
    """Of the squared cosine c2, by one root: g^2 = eta^2 - 1 + c^2, and c g is all that is asked for beside the squares."""
    g2 = (eta - 1.0) * (eta + 1.0) + c2
    cg = jnp.sqrt(c2 * g2)
    eta2 = eta * eta
    across = c2 + g2 + 2.0 * cg
    along = (eta2 * eta2) * c2 + g2 + (2.0 * eta2) * cg
    # 2 F = (delta / across)^2 + (delta k / along)^2
    rp = ((eta2 + 1.0) * c2 - 1.0) * across
    return Facet(along * along + rp * rp, across * along, cg)


@chunk
def coat_lobe(coat: Coat, NoL: Scalar, NoV: Scalar, hidden_l: Scalar, hidden_v: Scalar, lean2: Scalar) -> Scalar:
    """F D V of the coat's top: `fresnel_dielectric`, `ggx_d` and `v_smith`, multiplied out over one denominator."""
    M = NoL + NoV
    M2 = M * M
    s2 = lean2 + M2
    quarter = 0.25 * s2
    facet = facet_of(coat.eta, quarter)
    ratio = ((coat.eta - 1.0) * (coat.eta + 1.0) * 0.5 / math.sqrt(math.pi) * coat.alpha) * s2
    ratio = divide(ratio, (lean2 + (coat.alpha * coat.alpha) * M2) * facet.product)
    return facet.reflected * (ratio * ratio) / (NoV * hidden_l + NoL * hidden_v)


@chunk
def coat_shape(coat: Coat, NoL: Scalar, NoV: Scalar, hidden_l: Scalar, hidden_v: Scalar, lean2: Scalar) -> Scalar:
    """D V of the coat's top: `ggx_d` and `v_smith`."""
    M = NoL + NoV
    M2 = M * M
    ratio = divide(coat.alpha * (lean2 + M2), lean2 + (coat.alpha * coat.alpha) * M2)
    V = (0.5 / math.pi) / (NoV * hidden_l + NoL * hidden_v)
    return ratio * ratio * V


def filmed(lobe: Lobe) -> bool:
    """Whether there is a film on its facets."""
    return bool(getattr(lobe, "has_film", False))


def reflectance_curve(lobe: Lobe, c: np.ndarray, most: int = MOST) -> Curve:
    """What its facets reflect at half cosines c, of four times their squares; with a film by `half_root`, and of any degree."""
    F = np.asarray(jax.vmap(lobe.reflectance)(jnp.asarray(c)))
    if filmed(lobe):
        return Curve(np.asarray(half_root(4.0 * c**2)), F)
    return Curve(4.0 * c**2, F, 1.0 / F, most)


EXPONENTIAL = 1e-5
"""Relative error above which a polynomial does not stand for an exponential."""


def left_curve(x: np.ndarray, depth: np.ndarray) -> Curve | None:
    """What absorption leaves, exp(-depth) (n,) or (n, 3), of what the depth comes of; None where the exponential itself is shorter."""
    left = np.exp(-depth)
    curve = Curve(x, left, 1.0 / left, 6)
    return curve if curve.possible and curve.off(curve.most) < EXPONENTIAL else None


def half_cosines() -> np.ndarray:
    """Half cosines (n,) from 0 to 1, closer at grazing."""
    return np.linspace(0.0, 1.0, NODES) ** 2


def without_film(coat: Coat) -> Coat:
    """The coat without what is baked of its film, for which a polynomial stands."""
    return replace(coat, **{field.name: None for field in fields(Baked)})
