"""Scattering media: two fluxes and single scattering against 50-digit values, and what must hold for any of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from helpers import FLOOR, QUICKLY, REL, cases, close, hemisphere
from layerfit.optics.fresnel import transmittance_dielectric
from layerfit.optics.medium import refract_about_normal
from layerfit.optics.scattering import (
    TwoFlux,
    henyey_greenstein,
    kubelka_munk,
    kubelka_munk_infinite,
    kubelka_munk_over,
    saunderson,
    scattered_back,
    scattered_through,
    stacked,
)

DTYPES = [np.float64, np.float32]


def layer(K, S, x):
    return kubelka_munk(K * x, S * x)


def over(K, S, x, Rg):
    return kubelka_munk_over(layer(K, S, x), Rg)


def phase(cosang, g):
    return henyey_greenstein(1.0 - cosang, g)


def reflect(wi, wo, albedo, tau, g):
    s = wi + wo
    return scattered_back(henyey_greenstein(0.5 * jnp.sum(s * s), g), albedo, tau, wi[2], wo[2])


def transmit(wi, wt, albedo, tau, g):
    s = wi + wt
    return scattered_through(henyey_greenstein(0.5 * jnp.sum(s * s), g), albedo, tau, wi[2], -wt[2])


def coated(wi, wo, eta, albedo, tau, g):
    T = transmittance_dielectric(wi[2], eta) * transmittance_dielectric(wo[2], eta)
    return T / (eta * eta) * reflect(refract_about_normal(wi, eta), refract_about_normal(wo, eta), albedo, tau, g)


VALUES = {
    "km_layer": layer,
    "km_over": over,
    "km_rinf": kubelka_munk_infinite,
    "hg": phase,
    "hk_slab_reflect": reflect,
    "hk_slab_transmit": transmit,
    "hk_coated": coated,
}
# A peak of the phase function has the inverse cube of the digits of 1 - |g|.
LOOSER = {"hg": 10.0, "hk_slab_reflect": 10.0, "hk_slab_transmit": 10.0, "hk_coated": 10.0}


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", VALUES)
def test_values_have_their_digits(oracle, name, dtype):
    fn = VALUES[name]
    for case in cases(oracle)[name]:
        rounded = [np.asarray(x, dtype) for x in case["in"].values()]
        values = jax.tree.leaves(fn(*map(jnp.asarray, rounded)))
        wanted = [float(x) for x in (case["out"] if isinstance(case["out"], list) else [case["out"]])]
        if dtype == np.float32:
            wanted = [float(x) for x in jax.tree.leaves(fn(*(jnp.asarray(x, np.float64) for x in rounded)))]
        for value, exact in zip(values, wanted, strict=True):
            assert value.dtype == dtype
            assert close(float(value), exact, REL[dtype] * LOOSER.get(name, 1.0), FLOOR[dtype]), (case, value)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", VALUES)
def test_derivatives_are_finite_at_the_edges(oracle, name, dtype):
    """On every case, which are random and extreme, and with coefficients of zero."""
    fn = VALUES[name]
    every = tuple(range(len(cases(oracle)[name][0]["in"])))
    slope = jax.jit(jax.jacfwd(lambda *args: jax.tree.leaves(fn(*args)), every), compiler_options=QUICKLY)
    rows = [list(case["in"].values()) for case in cases(oracle)[name]]
    if name.startswith("km"):
        rows += [[0.0, 0.0, *rows[0][2:]], [0.0, 1.0, *rows[0][2:]], [1.0, 0.0, *rows[0][2:]], [1e-30, 50.0, *rows[0][2:]]]
    for row in rows:
        leaves = jax.tree.leaves(slope(*(jnp.asarray(x, dtype) for x in row)))
        assert all(np.all(np.isfinite(leaf)) for leaf in leaves), row


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize(("Kx", "Sx"), [(0.0, 0.3), (0.02, 0.7), (0.0499, 0.95), (0.0501, 0.95), (3.0, 2.0), (40.0, 60.0)])
def test_a_layer_has_the_derivatives_of_its_formula(Kx, Sx, dtype):
    """Against a central difference in 50 digits."""
    mpmath = pytest.importorskip("mpmath")
    mpmath.mp.dps = 50

    def R(K, S):
        z = mpmath.sqrt(K * (K + 2 * S))
        sinh = mpmath.sinh(z) / z if z else mpmath.mpf(1)
        return S * sinh / ((K + S) * sinh + mpmath.cosh(z))

    step = mpmath.mpf(10) ** -15
    Kx, Sx = (float(np.asarray(x, dtype)) for x in (Kx, Sx))
    wanted = [(R(Kx + step, Sx) - R(abs(Kx - step), Sx)) / (2 * step), (R(Kx, Sx + step) - R(Kx, Sx - step)) / (2 * step)]
    if Kx == 0.0:
        wanted[0] = (R(step, Sx) - R(mpmath.mpf(0), Sx)) / step
    slopes = jax.grad(lambda *a: kubelka_munk(*a).R, (0, 1))(jnp.asarray(Kx, dtype), jnp.asarray(Sx, dtype))
    for slope, exact in zip(slopes, wanted, strict=True):
        assert close(float(slope), float(exact), 1e-3 if dtype == np.float32 else 1e-7, 1e-5 if dtype == np.float32 else 1e-9)


def test_two_fluxes_of_a_layer_are_those_of_its_halves():
    Kx, Sx = jnp.asarray(0.6), jnp.asarray([0.0, 0.9, 4.0])
    half, whole = kubelka_munk(0.5 * Kx, 0.5 * Sx), kubelka_munk(Kx, Sx)
    both = stacked(half, half)
    np.testing.assert_allclose(both.R, whole.R, rtol=1e-13)
    np.testing.assert_allclose(both.T, whole.T, rtol=1e-13)
    np.testing.assert_allclose(kubelka_munk_over(half, both.R), stacked(half, both).R, rtol=1e-14)


def test_a_layer_without_absorption_loses_nothing():
    for Sx in (0.0, 1e-3, 1.0, 1e3):
        layer = kubelka_munk(jnp.asarray(0.0), jnp.asarray(Sx))
        assert float(layer.R + layer.T) == pytest.approx(1.0, abs=1e-14)
        assert float(layer.R) == pytest.approx(Sx / (1.0 + Sx), rel=1e-13)


def test_a_thick_layer_hides_what_is_below():
    thick = kubelka_munk(jnp.asarray(30.0), jnp.asarray(100.0))
    infinite = kubelka_munk_infinite(jnp.asarray(0.3), jnp.asarray(1.0))
    assert float(kubelka_munk_over(thick, jnp.asarray(0.9))) == pytest.approx(float(infinite), rel=1e-12)
    assert float((1.0 - infinite) ** 2 / (2.0 * infinite)) == pytest.approx(0.3, rel=1e-12)


def test_a_boundary_over_white_loses_nothing():
    one = jnp.asarray(1.0)
    assert float(saunderson(one, jnp.asarray(0.04), jnp.asarray(0.6))) == pytest.approx(1.0, abs=1e-14)
    assert float(saunderson(0.0 * one, jnp.asarray(0.04), jnp.asarray(0.6))) == pytest.approx(0.04, abs=1e-14)
    # Without absorption in it, the boundary is a layer like any other.
    R = jnp.asarray(0.4)
    both = stacked(TwoFlux(jnp.asarray(0.1), jnp.asarray(0.9)), TwoFlux(R, 1.0 - R))
    assert float(both.R) == pytest.approx(float(saunderson(R, jnp.asarray(0.1), jnp.asarray(0.1))), rel=1e-14)


@pytest.mark.parametrize("g", [-0.9, -0.3, 0.0, 0.5, 0.95])
def test_a_phase_function_is_a_density_of_mean_cosine_g(g):
    p = lambda c: float(henyey_greenstein(jnp.asarray(1.0 - c), jnp.asarray(g)))  # noqa: E731
    peak = [1.0 - 2e-3, -1.0 + 2e-3]
    total = integrate.quad(lambda c: 2.0 * np.pi * p(c), -1.0, 1.0, points=peak)[0]
    mean = integrate.quad(lambda c: 2.0 * np.pi * c * p(c), -1.0, 1.0, points=peak)[0]
    assert total == pytest.approx(1.0, rel=1e-6)
    assert mean == pytest.approx(g, abs=1e-6)


@pytest.mark.parametrize("g", [-0.4, 0.0, 0.7])
def test_a_thin_slab_scatters_what_it_takes_out_of_a_beam(g):
    """Reflected and transmitted together, to first order in the depth."""
    count, tau = 65536, 1e-4
    u, v = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.618033988749895) % 1.0
    s = np.sqrt(1.0 - u * u)
    up = np.stack([s * np.cos(2.0 * np.pi * v), s * np.sin(2.0 * np.pi * v), u], -1)
    wi = np.array([0.6, 0.0, 0.8])
    args = jnp.asarray(0.5), jnp.asarray(tau), jnp.asarray(g)
    f = jax.vmap(
        lambda w: reflect(jnp.asarray(wi), w, *args) + transmit(jnp.asarray(wi), w * jnp.array([1.0, 1.0, -1.0]), *args)
    )
    leaves = 2.0 * np.pi * float(np.mean(np.asarray(f(jnp.asarray(up))) * u))
    assert leaves == pytest.approx(0.5 * tau / wi[2], rel=5e-3)


def test_single_scattering_is_reciprocal():
    wi, wo = (jnp.asarray(hemisphere(64, seed)) for seed in (1, 2))
    f = jax.vmap(lambda a, b: reflect(a, b, jnp.asarray(0.7), jnp.asarray(0.8), jnp.asarray(0.6)))
    np.testing.assert_allclose(f(wi, wo), f(wo, wi), rtol=1e-12)
