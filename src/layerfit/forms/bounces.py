"""Light that goes to and fro between a rough coat and a metal: how much of it leaves, and where to.

The base sends light up about its mirror direction, as wide as its facets make it; the coat's top lets a part out and reflects the
rest: all of it, past the edge of total reflection. From cosine to cosine this is a Markov chain, summed once per material. It knows
no azimuths, so it gives energies, and no constant of it is fitted. Shapes are added: what the coat reflected once, inside the edge,
leaves as one wider lobe; the rest leaves as the chain says, apart from the cosine of arrival (as in Kulla and Conty 2017, "Revisiting
physically based shading at Imageworks").
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._chunk import chunk, member, safe_divide, safe_sqrt, struct, where
from .._types import Colour, Scalar
from ..layers import Coat
from ..optics.fresnel import fresnel_dielectric
from ..optics.microfacet import ggx_lambda
from ..surfaces.microfacet import Conductor
from .curves import (
    CELLS,
    Nodes,
    absorbed,
    blurred,
    diffuse_return,
    hemispherical,
    passed,
    polynomial,
    presence,
)

RINGS, SPOKES = 8, 4
"""Facets that stand for all that light from one direction meets: Gauss over its cone, even over half a turn."""

AGAIN = 0.4
"""Part of the coat's width that the lobe of light has which met the base twice: fitted to the random walk."""


@struct
class Curve:
    """An energy as a polynomial in `grazing`, for each colour."""

    c0: Colour = member("coefficients of the powers of the curves' argument")
    c1: Colour = member("")
    c2: Colour = member("")
    c3: Colour = member("")
    c4: Colour = member("")
    c5: Colour = member("")


@chunk
def wider(alpha: Scalar, coat_alpha: Scalar) -> Scalar:
    """Width of the lobe of light that met a base of width alpha twice, and the coat in between."""
    return blurred(blurred(alpha, alpha), AGAIN * coat_alpha)


@chunk
def amount(curve: Curve, s: Scalar) -> Colour:
    """The polynomial at s; an energy is never below 0."""
    return jnp.maximum(curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * (curve.c4 + s * curve.c5)))), 0.0)


def bounces(nodes: Nodes, alpha: Scalar, coat: Coat, base: Conductor | Coat) -> tuple[Curve, Curve]:
    """Weight of a wider lobe, as a factor of light and of view, and fourth root of the rest, over the cosine above; for each colour.

    `alpha` is the width of the coat's GGX facets; `coat` and `base` have relative indices.
    """
    if all(jnp.ndim(value) == 0 for value in jax.tree.leaves((base, coat.tau))):
        return _bounces(nodes, alpha, coat.eta, base, coat.tau)
    colours = jax.tree.map(lambda value: 0 if jnp.ndim(value) else None, (base, coat.tau))
    return jax.vmap(lambda base, tau: _bounces(nodes, alpha, coat.eta, base, tau), in_axes=colours)(base, coat.tau)


def _bounces(nodes: Nodes, alpha: Scalar, eta: Scalar, base: Conductor | Coat, tau: Scalar | None) -> tuple[Curve, Curve]:
    edge = safe_sqrt((eta - 1.0) * (eta + 1.0)) / eta
    cells = cells_of(edge)
    aside = 0.5 * nodes.spread / nodes.z
    first, wide = (blurred(width, aside) for width in (base.alpha, wider(base.alpha, alpha)))
    n, m = len(cells), len(cells) + len(nodes.z)
    own = jnp.broadcast_to(base.alpha, m + len(nodes.z))
    top = jnp.broadcast_to(jnp.maximum(alpha * presence(eta), 1e-3), cells.shape)

    # All at once, for the compiler's sake: light between base and top; light from above; that light in one wider lobe; the top from below.
    begins = jnp.concatenate([cells, nodes.z, nodes.z, cells])
    c, z, weight = facets(begins, jnp.concatenate([own[:n], first, wide, top]))
    into = _into(z, edge)
    up, down = slice(0, -n), slice(-n, None)

    # In sight as facets of the base are, which loses nothing but light that is sent into others; the lobe as it is evaluated.
    weight = weight / _hidden(begins, z, jnp.concatenate([own, top]))
    sight = 1.0 + _lambda(begins[up], jnp.concatenate([own[:m], wide]))
    energy = weight[up] * sight[:, None] * _reflected(base, c[up])
    back = into[up] @ nodes.R
    once = 1.0 if tau is None else jnp.exp(-safe_divide(tau, z[up]))
    out = energy * once * (into[up] @ _exits(nodes, cells, eta))
    leaves = jnp.sum(out, -1)
    returns = energy * once * once * back
    inside = returns * safe_sqrt(jnp.minimum((1.0 - back) / (1.0 - nodes.R[-1]), 1.0))

    share = weight[down] * jax.vmap(jax.vmap(lambda c: fresnel_dielectric(c, 1.0 / eta)))(c[down])
    share = share / jnp.maximum(jnp.sum(share, -1, keepdims=True), 1e-12)
    turn = jnp.einsum("ns,nsk->nk", share, into[down])

    chain = jnp.einsum("ns,nsk->nk", returns[:m], into[:m]) @ turn
    total = sum_of_powers(chain[:n], leaves[:n])
    lobe = jnp.einsum("ns,nsk->nk", inside[n:m], into[n:m]) @ (turn @ leaves[:n])
    rest = jnp.maximum(chain[n:] @ total - lobe, 0.0)
    kept = 1.0 if tau is None else jax.vmap(lambda path, theta: absorbed(path, theta, tau))(nodes.path, nodes.theta)
    norm = hemispherical(nodes.T * kept * rest) / (eta * eta)
    factor = _factors(lobe / jnp.maximum(base.f0 * leaves[m:], 1e-9), nodes, z[m:-n], out[m:])
    # Once more the root: over a smooth base the rest falls a hundredfold from grazing to normal light, too far for a polynomial.
    root = safe_sqrt(rest / jnp.sqrt(jnp.maximum(norm, 1e-12)))
    return Curve(*polynomial(factor)), Curve(*polynomial(root))


def _exits(nodes: Nodes, cells: Float[Array, " k"], eta: Scalar) -> Float[Array, " k"]:
    """Energy that leaves of light from below at the cosines of the cells: what is not reflected, less what facets that are met once lose.

    They hide the more, the lower light grazes, as 1 / z; and in all as much as makes out of diffuse light come what comes in, over eta^2.
    """
    comes, not_reflected = hemispherical(nodes.T) / (eta * eta), 1.0 - diffuse_return(nodes, None)
    if nodes.turn is None:  # several interfaces: what is absorbed between them is lost at all angles alike
        return (1.0 - nodes.R) * (comes / not_reflected)
    return jnp.maximum(1.0 - nodes.R - 0.5 * (not_reflected - comes) / cells, 0.0)


def _factors(
    weight: Float[Array, " m"], nodes: Nodes, z: Float[Array, "m s"], leaves: Float[Array, "m s"]
) -> Float[Array, " m"]:
    """The weight of a lobe as the product of one factor a direction, which over all views is that weight for each light of the nodes.

    `leaves` is the energy of the lobe that leaves from cosines z below.
    """
    share = leaves / jnp.maximum(jnp.sum(leaves, -1, keepdims=True), 1e-9)
    whole, beyond = jnp.sum(share, -1), jnp.einsum("ms,msk->mk", share, passed(z, nodes.z))
    factor = safe_sqrt(weight)
    for _ in range(3):
        mean = whole * factor[0] + beyond @ jnp.diff(factor)  # over all views, with straight lines between the nodes
        factor = safe_sqrt(weight * safe_divide(factor, mean))
    return factor


def cells_of(edge: Scalar) -> Float[Array, " k"]:
    """Cosines from 0 to the edge of total reflection and from there to 1, even in each."""
    k = np.arange(2 * CELLS + 1) / CELLS
    outside = jnp.asarray(np.minimum(k, 1.0), edge.dtype)
    inside = jnp.asarray(np.maximum(k - 1.0, 0.0), edge.dtype)
    return jnp.maximum(outside * edge + inside * (1.0 - edge), 1e-3)


# Functions under `jax.jit` stay calls, whose results are computed once. Inlined, XLA does them again in every loop that reads them: their
# derivatives took two fifths longer to run, and a fifth longer to compile.
@jax.jit
def _into(z: Float[Array, "n s"], edge: Scalar) -> Float[Array, "n s k"]:
    """How light at cosines z is shared among the two cells next to it: linear weights, on a last axis."""
    place = where(z < edge, safe_divide(z, edge), 1.0 + (z - edge) / (1.0 - edge))
    return jnp.maximum(1.0 - jnp.abs(CELLS * place[..., None] - jnp.asarray(np.arange(2 * CELLS + 1), z.dtype)), 0.0)


@jax.custom_jvp
def sum_of_powers(M: Float[Array, "k k"], x: Float[Array, " k"]) -> Float[Array, " k"]:
    """x + M x + M^2 x + ... of 64 terms: light has left or is absorbed long before."""
    for _ in range(6):
        x = x + M @ x
        M = M @ M
    return x


@sum_of_powers.defjvp
def _(primals: Any, tangents: Any) -> Any:
    (M, _), (dM, dx) = primals, tangents
    total = sum_of_powers(*primals)
    # y = x + M y, derived: the powers of M are those of the sum itself.
    return total, sum_of_powers(M, dx + dM @ total)


@jax.jit
def facets(
    z: Float[Array, " n"], alpha: Float[Array, " n"]
) -> tuple[Float[Array, "n s"], Float[Array, "n s"], Float[Array, "n s"]]:
    """Facets in sight of a direction: cosine to it, cosine of the reflected light, and weight.

    Visible GGX normals by spherical caps (Dupuy and Benyoub 2023), at the nodes of a quadrature; light sent down weighs nothing.
    """
    u, du = np.polynomial.legendre.leggauss(RINGS)
    phi = (np.arange(SPOKES) + 0.5) * np.pi / SPOKES
    ring = jnp.asarray(np.repeat(0.5 * (u + 1.0), SPOKES), z.dtype)
    weight = jnp.asarray(np.repeat(0.5 * du / SPOKES, SPOKES), z.dtype)
    cos_phi = jnp.asarray(np.tile(np.cos(phi), RINGS), z.dtype)
    z, alpha = z[:, None], alpha[:, None]
    s2, alpha2 = (1.0 - z) * (1.0 + z), alpha * alpha
    # Facets that are `alpha` times as wide as those of a sphere: the direction to it is a unit vector there, and so is that to its cap.
    stretched = 1.0 / jnp.sqrt(alpha2 * s2 + z * z)
    wx, wz = alpha * safe_sqrt(s2) * stretched, z * stretched
    cap = (1.0 - ring) * (1.0 + wz) - wz
    met = 1.0 + cap * wz + safe_sqrt((1.0 - cap) * (1.0 + cap)) * cos_phi * wx  # of their sum with the direction
    hz = cap + wz
    length2 = 2.0 * alpha2 * met + (1.0 - alpha2) * hz * hz
    across = met / stretched
    c = across / jnp.sqrt(length2)
    out = 2.0 * across * hz / length2 - z
    above = out > 1e-3
    return c, where(above, out, 1.0), where(above, weight, 0.0)


@jax.jit
def _hidden(z: Float[Array, " n"], out: Float[Array, "n s"], alpha: Float[Array, " n"]) -> Float[Array, "n s"]:
    """1 + Lambda of a direction + Lambda of where its light goes."""
    return 1.0 + _lambda(z, alpha)[:, None] + _lambda(out, alpha[:, None])


@jax.jit
def _reflected(base: Conductor | Coat, c: Float[Array, "n s"]) -> Float[Array, "n s"]:
    return jax.vmap(jax.vmap(base.reflectance))(c)


def _lambda(z: Any, alpha: Any) -> Any:
    """Lambda of the GGX distribution, by the cosine."""
    return ggx_lambda(alpha * alpha * ((1.0 - z) * (1.0 + z) / (z * z)))
