"""Formulas of one boundary against 50-digit values, and at the edges where they are easily lost."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from helpers import FLOOR, REL, cases, close
from layerfit._chunk import safe_power
from layerfit.optics.fresnel import (
    conductor_f0,
    dielectric_f0,
    fresnel_conductor,
    fresnel_dielectric,
    fresnel_schlick,
    transmittance_dielectric,
)
from layerfit.optics.interface import slope_spread, steer
from layerfit.optics.lazanyi import Lazanyi, fit_lazanyi, fresnel_lazanyi
from layerfit.optics.medium import cosine_below, refract_about_facet, refract_about_normal
from layerfit.optics.microfacet import density, half_cosine, half_vector, visibility

DTYPES = [np.float64, np.float32]


def held(fn, inputs, wanted, dtype, rel=None):
    """float64 against the digits; float32 against float64 at inputs rounded to float32."""
    rounded = [np.asarray(x, dtype) for x in inputs]
    value = float(fn(*map(jnp.asarray, rounded)))
    if dtype == np.float32:
        wanted = float(fn(*(jnp.asarray(x, np.float64) for x in rounded)))
    assert close(value, wanted, rel or REL[dtype], FLOOR[dtype]), (inputs, value, wanted)


@pytest.mark.parametrize("dtype", DTYPES)
def test_fresnel_dielectric_has_its_digits(oracle, dtype):
    for case in cases(oracle)["fresnel_dielectric"]:
        held(fresnel_dielectric, (case["in"]["c"], case["in"]["eta"]), float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_fresnel_conductor_has_its_digits(oracle, dtype):
    for case in cases(oracle)["fresnel_conductor"]:
        i = case["in"]
        held(fresnel_conductor, (i["c"], i["n"], i["k"]), float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_schlick_has_its_digits(oracle, dtype):
    for case in cases(oracle)["fresnel_schlick"]:
        held(fresnel_schlick, (case["in"]["c"], case["in"]["f0"]), float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_lazanyi_has_its_digits(oracle, dtype):
    def F(c, n, k, a, alpha):
        return fresnel_lazanyi(c, conductor_f0(n, k), a, alpha)

    for case in cases(oracle)["fresnel_lazanyi"]:
        held(F, [case["in"][k] for k in ("c", "n", "k", "a", "al")], float(case["out"]), dtype)


def largest_error(fit, eta, k):
    c = jnp.asarray(np.cos(np.linspace(0.0, 0.5 * np.pi, 500)))
    f0 = conductor_f0(jnp.asarray(eta), jnp.asarray(k))
    by_fit = jax.vmap(lambda c: fresnel_lazanyi(c, f0, fit.a, fit.alpha))(c)
    return np.max(np.abs(by_fit - jax.vmap(lambda c: fresnel_conductor(c, jnp.asarray(eta), jnp.asarray(k)))(c)), 0)


def test_lazanyi_is_fitted_to_each_metal():
    """Aluminium, of which Schlick's formula is far off, and copper: the error is the one that is told, and far smaller."""
    for eta, k, better in (([1.34, 0.97, 0.62], [7.47, 6.4, 5.3], 0.085), ([0.201, 0.924, 1.102], [3.913, 2.453, 2.142], 0.5)):
        fit = fit_lazanyi(eta, k)
        error = largest_error(fit, eta, k)
        np.testing.assert_allclose(error, fit.error, rtol=0.02)
        schlick = largest_error(Lazanyi(jnp.zeros(3), fit.alpha, fit.error), eta, k)
        assert np.all(error < better * schlick)


def test_lazanyi_is_never_worse_than_schlick():
    rng = np.random.default_rng(0)
    eta, k = np.exp(rng.uniform(np.log(0.05), np.log(5.0), 60)), rng.uniform(0.0, 9.0, 60)
    for n, absorbs in zip(eta, k, strict=True):
        fit = fit_lazanyi(n, absorbs)
        plain = largest_error(Lazanyi(jnp.zeros(()), fit.alpha, fit.error), n, absorbs)
        assert float(fit.error) <= plain * 1.001 + 1e-4


def test_the_fit_follows_the_index():
    """A fit of a metal's index has derivatives through the constants."""
    a = lambda n: fit_lazanyi(jnp.asarray(n, float), 3.9).a  # noqa: E731
    slope = jax.grad(a)(0.2)
    difference = (a(0.2002) - a(0.1998)) / 0.0004
    assert float(slope) == pytest.approx(float(difference), rel=1e-3)


@pytest.mark.parametrize("dtype", DTYPES)
def test_vcavity_masking_has_its_digits(oracle, dtype):
    def G(wi, wo):
        return 4.0 * wi[2] * wo[2] * visibility("vcavity", "ggx", wi, wo, jnp.ones((), wi.dtype))

    for case in cases(oracle)["G_vcavity"]:
        held(G, (case["in"]["wi"], case["in"]["wo"]), float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_smith_masking_has_its_digits(oracle, dtype):
    for case in cases(oracle)["G2_corr"]:
        i = case["in"]

        def G(wi, wo, ax, ay, ndf=i["ndf"]):
            return 4.0 * wi[2] * wo[2] * visibility("smith", ndf, wi, wo, (ax, ay))

        held(G, (i["wi"], i["wo"], i["ax"], i["ay"]), float(case["out"]), dtype)


def test_transmittance_is_what_is_not_reflected():
    c = jnp.linspace(0.0, 1.0, 200)
    for eta in (0.6, 0.9999, 1.0, 1.0001, 1.33, 3.0):
        both = jax.vmap(
            lambda c, eta=eta: fresnel_dielectric(c, jnp.asarray(eta)) + transmittance_dielectric(c, jnp.asarray(eta))
        )(c)
        # At c = 0 and index 1 nothing is reflected by definition: a boundary that is not there.
        np.testing.assert_allclose(both, 1.0, atol=1e-13)


def test_transmittance_keeps_its_digits_at_grazing_angles():
    c = np.float32(1e-6)
    exact = float(transmittance_dielectric(jnp.asarray(float(c)), jnp.asarray(float(np.float32(1.5)))))
    value = float(transmittance_dielectric(jnp.asarray(c), jnp.asarray(np.float32(1.5))))
    assert value == pytest.approx(exact, rel=1e-6)


def test_fresnel_is_reversible():
    mu = jnp.linspace(0.05, 1.0, 50)
    below = jnp.sqrt(1.0 - (1.0 - mu**2) / 1.5**2)
    there = jax.vmap(lambda c: fresnel_dielectric(c, jnp.asarray(1.5)))(mu)
    back = jax.vmap(lambda c: fresnel_dielectric(c, jnp.asarray(1.0 / 1.5)))(below)
    np.testing.assert_allclose(there, back, rtol=1e-12)


def test_normal_incidence_forms_agree_with_the_full_ones():
    one = jnp.asarray(1.0)
    eta, k = jnp.asarray(0.2), jnp.asarray(3.9)
    assert float(fresnel_dielectric(one, jnp.asarray(1.7))) == pytest.approx(float(dielectric_f0(jnp.asarray(1.7))), rel=1e-12)
    assert float(fresnel_conductor(one, eta, k)) == pytest.approx(float(conductor_f0(eta, k)), rel=1e-12)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0, (0.1, 0.4)])
def test_facets_cover_the_plane(distribution, alpha):
    """The integral of D(h) h.z over the hemisphere is 1."""
    width = tuple(map(jnp.asarray, alpha)) if isinstance(alpha, tuple) else jnp.asarray(alpha)

    def integrand(u, phi):
        # h by its slope t = tan(theta) = s u / (1 - u): narrow and wide lobes alike fill the square.
        s = np.mean(alpha)
        t = s * u / (1.0 - u)
        z = 1.0 / jnp.sqrt(1.0 + t * t)
        h = jnp.stack([t * z * jnp.cos(phi), t * z * jnp.sin(phi), z])
        return density(distribution, h, width) * z * (t * z**3) * s / (1.0 - u) ** 2

    u, wu = np.polynomial.legendre.leggauss(400)
    phi, wphi = (np.arange(128) + 0.5) / 128 * 2 * np.pi, 2 * np.pi / 128
    values = jax.vmap(lambda u: jax.vmap(lambda p: integrand(u, p))(jnp.asarray(phi)))(jnp.asarray(0.5 * (u + 1.0)))
    assert float(np.sum(np.asarray(values) * (0.5 * wu)[:, None]) * wphi) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
def test_masking_conserves_projected_area(distribution):
    """The facets that a direction sees cover as much of its view as the plane does (Heitz 2014, eq. 14)."""
    alpha, w = 0.4, np.array([np.sin(1.2), 0.0, np.cos(1.2)])

    def seen(theta, phi):
        h = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
        return float(density(distribution, jnp.asarray(h), jnp.asarray(alpha))) * max(h @ w, 0.0) * np.sin(theta)

    grid = np.linspace(0.0, np.pi / 2 - 1e-6, 61)
    phi = (np.arange(24) + 0.5) / 24 * 2 * np.pi
    rows = [np.mean([seen(t, p) for p in phi]) * 2 * np.pi for t in grid]
    area = integrate.simpson(rows, x=grid)
    V = float(visibility("smith_separable", distribution, jnp.asarray(w), jnp.asarray([0.0, 0.0, 1.0]), jnp.asarray(alpha)))
    G1 = V * 4.0 * w[2]  # the other direction is the normal, which nothing hides
    assert G1 * area == pytest.approx(w[2], rel=2e-3)


@pytest.mark.parametrize("dtype", DTYPES)
def test_half_vectors_at_the_edges(dtype):
    """Retro, opposite at grazing, and normal incidence: unit length, no NaN, right cosine."""
    grazing = np.array([np.sqrt(1 - 1e-12), 0.0, 1e-6], dtype)
    opposite = np.array([-grazing[0], 0.0, 1e-6], dtype)
    up = np.array([0.0, 0.0, 1.0], dtype)
    for wi, wo in [(up, up), (grazing, grazing), (grazing, opposite)]:
        h, c = np.asarray(half_vector(wi, wo)), float(half_cosine(wi, wo))
        assert np.linalg.norm(h) == pytest.approx(1.0, abs=1e-6)
        assert c == pytest.approx(float(np.dot(wi.astype(float), h.astype(float))), abs=1e-6)
    jacobian = jax.jacfwd(lambda w: half_vector(w, jnp.asarray(opposite)))(jnp.asarray(grazing))
    assert np.all(np.isfinite(jacobian))


def test_refraction_follows_snell():
    for theta in (0.0, 0.4, 1.1, 1.55):
        w = jnp.array([np.sin(theta), 0.0, np.cos(theta)])
        below = refract_about_normal(w, jnp.asarray(1.5))
        assert float(below[0]) * 1.5 == pytest.approx(np.sin(theta), abs=1e-15)
        assert float(jnp.linalg.norm(below)) == pytest.approx(1.0, abs=1e-15)


def test_total_reflection_leaves_no_direction():
    w = jnp.array([0.9, 0.0, np.sqrt(1 - 0.81)])
    assert float(refract_about_normal(w, jnp.asarray(0.7))[2]) == 0.0
    gradient = jax.grad(lambda eta: refract_about_normal(w, eta)[2])(jnp.asarray(0.7))
    assert np.isfinite(gradient)


def test_refraction_about_a_facet_keeps_the_half_vector():
    wi, wo = jnp.array([0.5, 0.1, np.sqrt(0.74)]), jnp.array([-0.2, 0.4, np.sqrt(0.8)])
    h, c = half_vector(wi, wo), half_cosine(wi, wo)
    c_below = cosine_below(c, jnp.asarray(1.5))
    below = [refract_about_facet(w, h, c, c_below, jnp.asarray(1.5)) for w in (wi, wo)]
    np.testing.assert_allclose(half_vector(*below), h, atol=1e-14)
    assert float(half_cosine(*below)) == pytest.approx(float(c_below), rel=1e-14)
    np.testing.assert_allclose(np.linalg.norm(below, axis=1), 1.0, rtol=1e-14)


def test_steering_lengthens_the_path_and_keeps_the_azimuth():
    w = jnp.array([0.3, 0.4, np.sqrt(0.75)])
    steered = steer(w, jnp.asarray(0.2))
    assert float(1.0 / steered[2]) == pytest.approx(float(1.0 / w[2]) + 0.2, rel=1e-14)
    assert float(jnp.linalg.norm(steered)) == pytest.approx(1.0, abs=1e-14)
    assert float(steered[0] / steered[1]) == pytest.approx(0.75, rel=1e-14)


def test_steering_near_the_normal_is_exact_in_single_precision():
    w64 = np.array([1e-3, 0.0, np.sqrt(1 - 1e-6)])
    exact = np.asarray(steer(jnp.asarray(w64), jnp.asarray(1e-5)))
    single = np.asarray(steer(jnp.asarray(w64, np.float32), jnp.asarray(1e-5, np.float32)))
    np.testing.assert_allclose(single[0], exact[0], rtol=1e-6)


def test_a_boundary_that_is_not_there_spreads_nothing():
    for c in (0.0, 0.3, 1.0):
        assert float(slope_spread(jnp.asarray(c), jnp.asarray(1.0))) == 0.0


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("c", [0.0, 1e-6, 0.5, 1.0])
@pytest.mark.parametrize("eta", [0.5, 0.999999, 1.0, 1.000001, 1.5, 10.0])
def test_fresnel_and_its_derivatives_are_finite(dtype, c, eta):
    for fn in (fresnel_dielectric, transmittance_dielectric):
        value, slopes = jax.value_and_grad(fn, (0, 1))(jnp.asarray(c, dtype), jnp.asarray(eta, dtype))
        assert 0.0 <= float(value) <= 1.0 + 1e-6
        assert np.all(np.isfinite(slopes))


@pytest.mark.parametrize("exponent", [1.34, 0.5, 3.16])
def test_powers_of_float32_are_those_of_float64(exponent):
    """Made of an exponential and a logarithm, whose errors grow with the logarithm."""
    x = np.geomspace(1e-20, 30.0, 4000).astype(np.float32)
    narrow, slopes = jax.jvp(jax.jit(lambda x: safe_power(x, exponent)), (x,), (np.ones_like(x),))
    wide = x.astype(float) ** exponent
    seen = wide > 1e-30
    log = np.abs(exponent * np.log(x.astype(float)))
    assert narrow.dtype == np.float32
    assert np.all(np.abs(narrow / wide - 1.0)[seen] < (1.2e-7 * (2.0 + log))[seen])
    np.testing.assert_allclose(slopes[seen], (exponent * wide / x)[seen], rtol=2e-5)
    np.testing.assert_array_equal(jax.vmap(lambda x: safe_power(x, exponent))(x), safe_power(x, exponent))
    np.testing.assert_allclose(safe_power(x.astype(float), exponent), wide, rtol=1e-14)
    np.testing.assert_array_equal(safe_power(jnp.array([0.0, -1.0]), exponent) < 1e-14, True)
