"""The precise form: the closed form nearest to the random walk, for one isotropic GGX coat over a diffuse or a metal base.

What the coat's rough top does to light is not computed but read, from tables that the random walk made (`tables`): the energy that
passes, the median direction of the refracted light, its spread, and the distribution of its path. Each is a function of one cosine;
`prepare` looks the material up and bakes the functions as polynomials, so that evaluation, in JAX and in the shader, is closed form.
The base then answers with one lobe for light that met it once and one for all that met it more often. Reciprocal by construction:
light that comes and light that leaves are treated alike.

The constants below were fitted to the random walk, on grids of random materials; the terms for several bounces are a fit, no physics.
"""

import dataclasses
from typing import Any, Literal

import jax.numpy as jnp

from .._chunk import chunk, member, safe_power, safe_sqrt, struct
from .._types import Colour, Number, Scalar, Vec3
from ..layers import Coat
from ..optics.interface import facet_cosine, rough_transmittance
from ..optics.microfacet import half_cosine
from ..surfaces.microfacet import Conductor
from .curves import Interface, bake, curve, diffuse_return, grazing, presence

BAKED = ("alpha", "eta")
"""Fields of the coat that a shader holds as constants, through the curves that they give."""

P = 1.4037
"""Widths add as powers."""
WIDTH = 1.1159
"""Width of a GGX lobe with the spread of the tables, over that spread."""
CONDENSE = 0.72041
"""Share of the tilt of the facets that the base does not ask for, which the two crossings take."""
RISE = 0.32949
"""Growth of the first lobe with the coat's roughness."""
RATIO, TAIL = 0.45118, 1.1602
"""How a lobe that was widened differs from GGX: less peaked, with a longer tail."""
DIRECT = (0.25768, 0.3041, 1.2079)
"""Part of the path's spread that counts for absorption, by the share of the base in the lobe's width: d + c w^e."""
DIRECT_PATH = (0.61718, -0.35382, 0.97817)
"""The same for the projected area."""


@dataclasses.dataclass(frozen=True)
class Bounces:
    """Constants of light that met the base more than once: fitted."""

    n: float = 1.2706
    c: float = 5.4277
    g: float = 0.50358
    l: float = 1.1633
    ca: float = 0.86615
    cb: float = 0.015659
    nb: float = 3.5728
    sp: float = 0.77853
    gl: float = 1.0398
    sa: float = 1.3495
    q1: float = 0.18469


BOUNCES = Bounces()


@dataclasses.dataclass(frozen=True)
class Precise:
    """The precise form. `interface` is what happens at the coat's rough top.

    `single`: light meets one facet, as in most renderers; a rough coat loses energy. `multi`: as many as it takes.
    """

    interface: Literal["single", "multi"] = "single"


def refuses(layers: tuple[Any, ...], base: Any) -> str | None:
    """Why a material is not of this form, or None."""
    if len(layers) != 1:
        return "it is for one coat" if layers else "there is no coat"
    coat = layers[0]
    if coat.alpha is None or coat.distribution != "ggx":
        return f"{coat.name} is not isotropic GGX"
    if coat.fresnel != "exact":
        return f"{coat.name} has the reflectance of {coat.fresnel}, and the tables were made with the exact one"
    if coat.tau_s is not None:
        return f"{coat.name} scatters light"
    if filmed := next((layer.name for layer in (coat, base) if getattr(layer, "has_film", False)), None):
        return f"{filmed} has a thin film, and the tables were made without"
    if not base.lobes:
        return None
    if not isinstance(base, Conductor):
        return f"{base.name} is neither diffuse alone (lambert, oren_nayar, kubelka_munk) nor a conductor, the bases that it was made for"
    if base.alpha is None or base.distribution != "ggx":
        return f"{base.name} is not isotropic GGX"
    return None


@struct
class Prepared:
    """Coat and base with relative indices, the baked interface, and what returns to the base."""

    coat: Coat
    interface: Interface
    base: Any
    returned: Colour
    """Part of diffuse light that returns from the coat."""


@struct
class Crossing:
    """One direction below the interface."""

    w: Vec3 = member("median direction")
    T: Scalar = member("energy that passes")
    a: Scalar = member("spread, as a width")
    path: Scalar = member("mean path, in thicknesses")
    theta: Scalar = member("scale of the path's distribution")
    R: Scalar = member("energy that the interface reflects back down")


def prepare(coats: tuple[Coat, ...], base: Any, options: Precise) -> Prepared:
    """Look up what the interface does and bake it. Raises ValueError for a material that is not of this form."""
    if reason := refuses(coats, base):
        raise ValueError(f"the precise form is not for this material: {reason}")
    coat = coats[0]
    interface, below = bake(coat.eta, coat.alpha, options.interface)
    coat = coat.below(jnp.ones_like(coat.eta))
    return Prepared(coat, interface, base.below(coat.eta), diffuse_return(below, coat.tau))


def evaluate(prepared: Prepared, wi: Vec3, wo: Vec3, options: Precise) -> Colour:
    """BRDF [1/sr] of unit directions above the surface; 0 where either is below it."""
    lit = (wi[2] > 0.0) & (wo[2] > 0.0)
    up = jnp.array([0.0, 0.0, 1.0], wi.dtype)
    wi = jnp.where(lit, wi, up)
    wo = jnp.where(lit, wo, up)
    coat = prepared.coat
    i = pass_interface(prepared.interface, coat.eta, coat.alpha, wi)
    o = pass_interface(prepared.interface, coat.eta, coat.alpha, wo)
    f = coat.evaluate(wi, wo) + below(i, o, coat, prepared.base, prepared.returned)
    return jnp.where(lit, f, 0.0)


def below(i: Crossing, o: Crossing, coat: Coat, base: Any, returned: Colour) -> Colour:
    """Light from below the coat [1/sr]; `base` and `coat` with relative indices."""
    throughput = i.T * o.T / (coat.eta * coat.eta)
    if not isinstance(base, Conductor):
        A = 1.0 if coat.tau is None else absorbed(i.path, i.theta, coat.tau) * absorbed(o.path, o.theta, coat.tau)
        return throughput * A * base.evaluate(i.w, o.w) / jnp.maximum(1.0 - base.albedo * returned, 1e-6)
    share = base_share(i, o, base.alpha)
    yi, yo = lean(i, i, o, base.alpha), lean(o, i, o, base.alpha)
    A: Any = 1.0
    U: Any = 1.0
    for y, x in ((yi, i), (yo, o)):
        if coat.tau is not None:
            part = direct(share, *DIRECT)
            A = A * absorbed(between(y, x, part), part * x.theta, coat.tau)
        part = direct(share, *DIRECT_PATH)
        path = between(y, x, part)
        U = U * (path if coat.tau is None else projected(path, part * x.theta, coat.tau))
    F = base.reflectance(half_cosine(yi, yo))
    # Where the indices match there is no interface, and nothing of what it does.
    rise = 1.0 + RISE * presence(coat.eta) * coat.alpha * coat.alpha * share
    first = rise * lobe(i, o, yi, yo, base.alpha, base.alpha)
    again = _again(i, o, yi, yo, coat, base, A, returned)
    return throughput * F * A * U * (first + F * again[0]) + throughput * F * F * A * again[1]


def _again(
    i: Crossing, o: Crossing, yi: Vec3, yo: Vec3, coat: Coat, base: Conductor, A: Colour, returned: Colour
) -> tuple[Colour, Colour]:
    """Light that met the base more than once: a wider lobe, and a diffuse part."""
    b = BOUNCES
    alpha2 = base.alpha * base.alpha
    wide = wider(base.alpha, coat.alpha)
    power, narrow = safe_power(wide, b.n), safe_power(base.alpha, b.nb)
    diffuse, broad = power / (power + b.c), narrow / (narrow + b.cb)
    kept = base.f0 * (1.0 - b.l * alpha2 / (1.0 + alpha2)) * returned * (1.0 + b.q1 * coat.alpha)
    series = 1.0 / (1.0 - jnp.minimum(kept, 0.97))
    R = 0.5 * (i.R + o.R)
    scattered = (1.0 + b.sa * coat.alpha) * (1.0 - diffuse) * ((1.0 - broad) * b.sp * R * A + broad * b.gl * returned)
    lobe_again = series * scattered * lobe(i, o, yi, yo, wide, base.alpha)
    return lobe_again, series * diffuse * b.g * returned / jnp.pi


@chunk
def wider(alpha: Scalar, coat_alpha: Scalar) -> Scalar:
    """Width of the lobe of light that met a base of width alpha twice, and the coat in between."""
    return safe_power(2.0 * safe_power(alpha, P) + BOUNCES.ca * safe_power(coat_alpha, P), 1.0 / P)


@chunk
def pass_interface(interface: Interface, eta: Scalar, alpha: Scalar, w: Vec3) -> Crossing:
    """Follow one direction through the coat's rough top."""
    s = grazing(w[2])
    T = rough_transmittance(facet_cosine(w, interface.tilt), eta, interface.gain)
    T = jnp.clip(T + curve(interface.passed, interface.passed_high, s), 0.0, 1.0)
    bend = curve(interface.bend, interface.bend_high, s) / eta
    sine = safe_sqrt(w[0] * w[0] + w[1] * w[1])
    bend = jnp.minimum(bend, 0.9998 / jnp.maximum(sine, 1e-6))
    sine = sine * bend
    z = safe_sqrt((1.0 - sine) * (1.0 + sine))
    a = WIDTH * jnp.maximum(curve(interface.spread, interface.spread_high, s), 0.0) * alpha
    path = jnp.maximum(curve(interface.path, interface.path_high, s), 1.0) / z
    theta = jnp.maximum(curve(interface.theta, interface.theta_high, s), 1e-4)
    R = jnp.clip(curve(interface.returned, interface.returned_high, s), 0.0, 1.0)
    return Crossing(jnp.stack([w[0] * bend, w[1] * bend, z]), T, a, path, theta, R)


@chunk
def absorbed(path: Scalar, theta: Scalar, tau: Colour) -> Colour:
    """Mean of exp(-tau u) over paths u = 1 + Gamma of mean `path` and scale theta."""
    scale = jnp.maximum(theta, 1e-6)
    return jnp.exp(-(tau + jnp.maximum(path - 1.0, 1e-9) * (jnp.log1p(scale * tau) / scale)))


@chunk
def projected(path: Scalar, theta: Scalar, tau: Colour) -> Colour:
    """Mean of u among the paths that are left: sum of u exp(-tau u) over that of exp(-tau u)."""
    return 1.0 + jnp.maximum(path - 1.0, 1e-9) / (1.0 + jnp.maximum(theta, 1e-6) * tau)


@chunk
def between(y: Vec3, x: Crossing, part: Scalar) -> Scalar:
    """Mean path of light that the base sends on: between that of one direction and that of all that cross."""
    straight = 1.0 / y[2]
    return straight + part * (x.path - straight)


@chunk
def base_share(i: Crossing, o: Crossing, alpha: Scalar) -> Scalar:
    """Part of a lobe's width, as a power, that is due to the base."""
    base = safe_power(alpha * (i.w[2] + o.w[2]), P)
    return base / (base + safe_power(i.a, P) + safe_power(o.a, P))


@chunk
def lean(x: Crossing, i: Crossing, o: Crossing, alpha: Scalar) -> Vec3:
    """The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone."""
    own = safe_power(x.a, P)
    total = safe_power(alpha * (i.w[2] + o.w[2]), P) + safe_power(i.a, P) + safe_power(o.a, P)
    turn = CONDENSE * own / total
    y0 = x.w[0] - turn * (i.w[0] + o.w[0])
    y1 = x.w[1] - turn * (i.w[1] + o.w[1])
    sine = safe_sqrt(y0 * y0 + y1 * y1)
    held = jnp.minimum(1.0, 0.9998 / jnp.maximum(sine, 1e-6))
    sine = jnp.minimum(sine, 0.9998)
    return jnp.stack([y0 * held, y1 * held, safe_sqrt((1.0 - sine) * (1.0 + sine))])


@chunk
def direct(share: Scalar, d: Number, c: Number, e: Number) -> Scalar:
    """Part of the path's spread that counts, by the base's share of the width."""
    return jnp.clip(d + c * jnp.power(jnp.maximum(share, 1e-30), e), 0.0, 1.5)


@chunk
def lobe(i: Crossing, o: Crossing, yi: Vec3, yo: Vec3, alpha: Scalar, masked: Scalar) -> Scalar:
    """D G / 4 of a base of width alpha, seen through the interface twice; `masked` is the width that shadows itself.

    Without an interface, and times the projected areas, it is D V of GGX.
    """
    M = yi[2] + yo[2]
    M2 = M * M
    spread = safe_power(i.a, P) + safe_power(o.a, P)
    width2 = safe_power(safe_power(alpha * M, P) + spread, 2.0 / P)
    own2 = alpha * alpha * M2 + TAIL * (i.a * i.a + o.a * o.a)
    r = jnp.clip(1.0 + RATIO * (width2 / own2 - 1.0), 0.6, 4.0)
    log_r = jnp.log(r)
    b = 2.0 - log_r * (1.993 + log_r * (0.197 + 0.051 * log_r))
    X0, X1 = i.w[0] + o.w[0], i.w[1] + o.w[1]
    v = (X0 * X0 + X1 * X1) / width2
    Y0, Y1 = yi[0] + yo[0], yi[1] + yo[1]
    tilt = 1.0 + (Y0 * Y0 + Y1 * Y1) / M2
    G = 1.0 / (1.0 + smith_lambda(yi, masked) + smith_lambda(yo, masked))
    return M2 * tilt * tilt * (0.25 * G) / (jnp.pi * width2 * (1.0 + v * (b + r * v)))


@chunk
def smith_lambda(w: Vec3, alpha: Scalar) -> Scalar:
    """Lambda of the GGX distribution (Heitz 2014, eq. 72)."""
    tan2 = (w[0] * w[0] + w[1] * w[1]) / (w[2] * w[2])
    x = alpha * alpha * tan2
    return 0.5 * x / (1.0 + jnp.sqrt(1.0 + x))
