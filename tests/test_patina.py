"""Patina: noise over a surface, growth in time, and the material that comes of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import FLOOR, REL, cases, close
from layerfit.optics.growth import coverage, grown, onset, partly_grown, tarnish_thickness
from layerfit.optics.noise import fbm, value_noise

DTYPES = [np.float64, np.float32]


def mask_of(g, t, t0, p, width):
    return partly_grown(coverage(t, t0, p), g, width)


def thickness_of(g, t, t0, p, h_rate, tau_s):
    return tarnish_thickness(t, onset(g, t0, p), h_rate, tau_s)


def field_of(x, y, seed):
    return fbm(jnp.stack([x, y]), seed)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize(
    ("name", "formula"), [("fbm", field_of), ("patina_mask", mask_of), ("patina_thickness", thickness_of)], ids=lambda v: str(v)
)
def test_growth_has_its_digits(oracle, name, formula, dtype):
    rows = cases(oracle)[name]
    columns = {key: np.array([r["in"][key] for r in rows]) for key in rows[0]["in"]}
    seed = lambda v: v.dtype.kind == "i"  # noqa: E731
    at = lambda kind: {k: v.astype(np.uint32) if seed(v) else v.astype(dtype).astype(kind) for k, v in columns.items()}  # noqa: E731
    each = jax.vmap(lambda inputs: formula(**inputs))
    wanted = [float(r["out"]) for r in rows] if dtype == np.float64 else each(at(np.float64)).tolist()
    values = each(at(dtype))
    assert values.dtype == dtype
    for value, want in zip(values.tolist(), wanted, strict=True):
        assert close(value, want, REL[dtype], FLOOR[dtype]), (value, want)


def test_noise_is_smooth_and_has_no_edge_between_cells():
    p = np.stack([np.linspace(-3.0, 3.0, 2001), np.full(2001, -1.3)], -1)
    values = np.asarray(jax.vmap(value_noise, (0, None))(p, jnp.uint32(7)))
    assert np.all((values > 0.0) & (values < 1.0))
    assert np.max(np.abs(np.diff(values))) < 2.0 * 0.003
    assert np.max(np.abs(np.diff(values, 2))) < 10.0 * 0.003**2
    assert np.std(values) > 0.1


def test_a_soft_edge_becomes_a_hard_one():
    g = jnp.linspace(0.02, 0.98, 49)
    theta = coverage(jnp.float64(12.0), jnp.float64(10.0), jnp.float64(1.5))
    hard, soft = jax.vmap(grown, (None, 0))(theta, g), jax.vmap(partly_grown, (None, 0, None))(theta, g, 1e-3)
    np.testing.assert_allclose(soft, hard, atol=1e-3)
    assert 0.0 < float(jnp.mean(hard)) < 1.0


def test_a_place_is_reached_when_the_coverage_says_so():
    g = jnp.linspace(0.02, 0.98, 25)
    begun = jax.vmap(onset, (0, None, None))(g, 10.0, 2.2)
    np.testing.assert_allclose(jax.vmap(coverage, (0, None, None))(begun, 10.0, 2.2), g, rtol=1e-12)


def test_tarnish_grows_with_the_root_of_time_after_its_onset():
    thick = [float(tarnish_thickness(jnp.float64(t), 5.0, 0.4, 1e-3)) for t in (0.0, 4.0, 9.0, 21.0)]
    np.testing.assert_allclose(thick, [0.0, 0.0, 0.8, 1.6], atol=1e-9)


@pytest.mark.parametrize("dtype", DTYPES)
def test_growth_is_finite_at_its_edges(dtype):
    """No time at all, a field of 0 or 1, a sharp onset, and ages of ten thousand years."""
    rows = np.array([(g, t) for g in (0.0, 1e-8, 0.5, 1.0) for t in (0.0, 1e-3, 10.0, 1e4)], dtype)

    def both(g, t, t0, p, softness, blur):
        return jnp.stack([mask_of(g, t, t0, p, softness), thickness_of(g, t, t0, p, dtype(0.5), blur)])

    for p in (0.3, 4.0):
        inputs = (rows[:, 0], rows[:, 1], *(jnp.full(len(rows), v, dtype) for v in (10.0, p, 1e-3, 1e-3)))
        values = jax.vmap(both)(*inputs)
        slopes = jax.vmap(jax.jacfwd(both, argnums=tuple(range(6))))(*inputs)
        assert np.all(np.isfinite(values))
        assert np.all(np.asarray(values) >= 0.0)
        assert all(np.all(np.isfinite(s)) for s in slopes)
