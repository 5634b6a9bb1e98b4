"""Formulas where they are stiff: values and derivatives against 50 digits, in both precisions, and limits that physics says.

The digits are of the traced formula itself (`layerfit.stability.digits`), at the numbers as they are rounded to the precision that is tried:
they show rounding and wrong guards. That the formulas are the right ones is for the values of the oracle to say, in the tests of each.
"""

import ast
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, QUICKLY, STACKS, brdf, brdf_rows, direction
from layerfit.forms.corrected import Corrected, edge_reflection, trapped_light
from layerfit.forms.curves import absorbed
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.optics.fresnel import fresnel_conductor, fresnel_dielectric, transmittance_dielectric
from layerfit.optics.growth import coverage, onset, partly_grown, tarnish_thickness
from layerfit.optics.interface import drift, drift_scale, facet_tilt, second_facet, slope_spread, spread_lengthening, steer
from layerfit.optics.medium import cosine_below, refract_about_facet, refract_about_normal, transmittance
from layerfit.optics.microfacet import (
    beckmann_d,
    beckmann_projection,
    ggx_d,
    ggx_projection,
    half_cosine,
    half_vector,
    v_cavity,
    visibility,
)
from layerfit.optics.scattering import (
    henyey_greenstein,
    kubelka_munk,
    kubelka_munk_over,
    mean_transmittance,
    once_back,
    once_through,
)
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert
from layerfit.surfaces.cosine import cosine_power
from layerfit.surfaces.diffuse import oren_nayar_full, oren_nayar_qualitative
from layerfit.surfaces.grooves import torrance_sparrow_d

mpmath = pytest.importorskip("mpmath")
from layerfit.stability.digits import DIGITS, in_digits, reals  # noqa: E402

DTYPES = [np.float64, np.float32]
SLOPE = {np.float64: 1e-7, np.float32: 1e-3}
FLOOR = {np.float64: 1e-13, np.float32: 1e-6}
USUAL = (1e-5, 1e-12)
"""Relative tolerance of a value in float32 and float64, where a row says no other."""
PAGE = Path(__file__).parents[1] / "docs" / "stability.md"


def _refracted(i, o, n):
    """Cosine to the surface below a facet halfway between two directions."""
    c = half_cosine(i, o)
    return refract_about_facet(i, half_vector(i, o), c, cosine_below(c, n), n)[2]


def vec(x, y, z):
    return jnp.stack([x, y, z])


def tilted(x, y):
    """A unit half vector by its slopes."""
    z = 1.0 / jnp.sqrt(1.0 + x * x + y * y)
    return vec(x * z, y * z, z)


def pair(fn):
    """A formula of two directions, by six numbers and others."""
    return lambda a, b, c, d, e, f, *rest: fn(vec(a, b, c), vec(d, e, f), *rest)


GRAZING = (0.9999995, 0.0, 1e-3)
OPPOSITE = (-0.9999995, 0.0, 1e-3)
SLANT = (0.48, 0.36, 0.8)
NEAR = (0.479, 0.36, 0.8)
UP = (0.0, 0.0, 1.0)

CASES = {
    "half_cosine": (pair(half_cosine), [(*GRAZING, *OPPOSITE), (*SLANT, *NEAR), (*SLANT, *UP)], (2e-6, 1e-14)),
    "half_vector": (pair(lambda i, o: half_vector(i, o)[2]), [(*GRAZING, *OPPOSITE), (*SLANT, *NEAR)], (2e-6, 1e-14)),
    "ggx_d": (
        lambda x, y, a: ggx_d(tilted(x, y), a),
        [(1e-4, 2e-4, 1e-3), (0.0, 1e-3, 1e-3), (3.0, 1.0, 1e-3), (0.3, 0.4, 0.02), (0.3, 0.4, 1.0)],
        (1e-4, 1e-12),
    ),
    "beckmann_d": (
        lambda x, y, a: beckmann_d(tilted(x, y), a),
        [(30.0, 0.0, 0.9), (2e-3, 1e-3, 1e-3), (1.0, 0.5, 0.3)],
        (1e-5, 1e-12),
    ),
    "visibility": (
        pair(lambda i, o, a: visibility("smith", "ggx", i, o, a)),
        [(*GRAZING, *OPPOSITE, 0.1), (*GRAZING, *UP, 1e-3), (*SLANT, *UP, 1.0)],
        USUAL,
    ),
    "ggx_projection": (
        lambda x, z, a: ggx_projection(vec(x, jnp.zeros_like(x), z), a),
        [(1.0, 1e-6, 0.2), (1.0, 0.0, 1e-3)],
        USUAL,
    ),
    "beckmann_projection": (
        lambda x, z, a: beckmann_projection(vec(x, jnp.zeros_like(x), z), a),
        [(1e-3, 1.0, 0.1), (1.0, 1e-5, 0.1), (0.6, 0.8, 0.05)],
        (1e-4, 1e-10),
    ),
    "fresnel_dielectric": (
        fresnel_dielectric,
        [(0.3, 1.0001), (1e-3, 1.0001), (0.8, 1.000001), (1e-6, 1.5), (0.05, 3.0), (0.75, 0.7), (0.715, 0.7), (0.5, 0.7)],
        (2e-4, 1e-8),
    ),
    "transmittance_dielectric": (
        transmittance_dielectric,
        [(1e-6, 1.5), (0.715, 0.7), (0.3, 1.0001), (0.02, 3.0)],
        (2e-4, 1e-8),
    ),
    "fresnel_conductor": (
        fresnel_conductor,
        [(0.3, 0.2, 3.9), (1e-4, 0.05, 9.0), (0.9, 1.2, 1e-4), (0.2, 1.5, 0.0), (1e-3, 1.001, 1e-3)],
        (1e-4, 1e-10),
    ),
    "refract": (
        lambda x, z, n: refract_about_normal(vec(x, jnp.zeros_like(x), z), n)[2],
        [(0.0, 1.0, 1.5), (1.0, 1e-4, 1.0001)],
        USUAL,
    ),
    "refract_facet": (
        pair(lambda i, o, n: _refracted(i, o, n)),
        [(*UP, *SLANT, 1.5), (*SLANT, *NEAR, 1.0)],
        USUAL,
    ),
    "steer": (
        lambda x, z, more: steer(vec(x, jnp.zeros_like(x), z), more)[0],
        [(1e-3, 0.9999995, 1e-5), (0.6, 0.8, 0.3)],
        USUAL,
    ),
    "transmittance": (transmittance, [(0.0, 2.0), (1e-7, 3.0), (50.0, 2.0), (0.3, 2.4)], (1e-6, 1e-14)),
    "mean_transmittance": (mean_transmittance, [(0.0,), (1e-7,), (9.9e-3,), (1.01e-2,), (0.5,), (80.0,)], (1e-6, 1e-14)),
    "absorbed": (absorbed, [(1.2, 0.1, 0.0), (1.2, 1e-4, 3.0), (2.5, 0.6, 50.0)], USUAL),
    "slope_spread": (slope_spread, [(0.5, 1.0001), (1e-3, 1.5), (1.0, 3.0)], USUAL),
    "drift": (
        lambda x, z, n, a: drift(vec(x, jnp.zeros_like(x), z), drift_scale(n, a), a),
        [(1e-4, 1.0, 1.5, 0.2), (1.0, 1e-4, 1.5, 1e-3), (0.8, 0.6, 3.0, 1.0)],
        USUAL,
    ),
    "facet_tilt": (facet_tilt, [(1e-3,), (0.3,), (1.0,)], USUAL),
    "second_facet": (second_facet, [(1e-3,), (0.3,), (1.0,)], USUAL),
    "spread_lengthening": (spread_lengthening, [(1.0001, 0.3), (3.0, 1e-3)], USUAL),
    "henyey_greenstein": (
        henyey_greenstein,
        [(1e-5, 0.95), (2.0, -0.95), (0.7, 0.0), (0.7, 1e-6), (1.999, 0.9)],
        (1e-4, 1e-11),
    ),
    "once_back": (once_back, [(0.1, 0.0, 1e-7, 1.0, 2.0), (0.1, 0.5, 50.0, 1e4, 1e4), (0.1, 0.5, 0.3, 1.5, 1.1)], USUAL),
    "once_through": (
        once_through,
        [(0.1, 0.5, 0.7, 1.3, 1.3000001), (0.1, 0.5, 1e-6, 3.0, 1.0), (0.1, 0.5, 30.0, 9.0, 1.0)],
        USUAL,
    ),
    "kubelka_munk": (
        lambda K, S: kubelka_munk(K, S).R,
        [(0.0, 0.3), (1e-6, 0.5), (0.0, 1e-9), (2.0, 0.0), (0.0499, 0.95), (0.0501, 0.95), (60.0, 90.0), (1e-4, 999.0)],
        (1e-5, 1e-12),
    ),
    "kubelka_munk_over": (
        lambda K, S, Rg: kubelka_munk_over(kubelka_munk(K, S), Rg),
        [(0.0, 9.0, 0.99), (3.0, 1e-3, 1.0)],
        USUAL,
    ),
    "oren_nayar": (
        pair(oren_nayar_full),
        [(*UP, 0.6, 0.0, 0.8, 0.5, 0.4), (*GRAZING, *SLANT, 0.5, 1.2), (*SLANT, 0.3, -0.39, 0.87, 1.0, 0.3)],
        USUAL,
    ),
    "oren_nayar_short": (pair(oren_nayar_qualitative), [(*GRAZING, *SLANT, 0.5, 1.2), (*UP, *SLANT, 0.5, 0.0)], USUAL),
    "v_cavity": (pair(v_cavity), [(*GRAZING, *SLANT), (*SLANT, *UP), (0.6, 0.0, 0.8, -0.8, 0.0, 0.6)], USUAL),
    "cosine_power": (cosine_power, [(1e-7, 1e4), (3e-4, 1e4), (0.5, 1.0), (0.99, 30.0), (1.2, 5.0)], (1e-4, 1e-11)),
    "torrance_sparrow_d": (
        lambda x, y, k: torrance_sparrow_d(tilted(x, y), k),
        [(1e-4, 0.0, 1e3), (2.0, 3.0, 0.5)],
        (1e-4, 1e-11),
    ),
    "edge_reflection": (edge_reflection, [(0.9999999, 1e-3, 1.5, 1e-3), (0.2, 0.9, 1.5, 0.3), (0.5, 0.8, 1.0001, 1e-3)], USUAL),
    "trapped_light": (
        lambda a, n, tau: trapped_light(Conductor(alpha=a, eta=0.2, k=3.9), tau, n),
        [(1e-3, 1.5, 0.3), (0.4, 1.001, 0.3), (0.9, 3.0, 0.0)],
        USUAL,
    ),
    "coverage": (coverage, [(1e-3, 10.0, 4.0), (9.0, 10.0, 1.5), (100.0, 10.0, 0.3), (1e4, 0.01, 6.0)], USUAL),
    "partly_grown": (partly_grown, [(0.5, 0.5001, 1e-3), (0.2, 0.7, 0.1), (0.9, 0.1, 0.05)], USUAL),
    "onset": (onset, [(1e-6, 10.0, 1.5), (0.5, 10.0, 4.0), (0.999, 10.0, 0.5)], USUAL),
    "tarnish_thickness": (tarnish_thickness, [(9.0, 10.0, 0.5, 1e-3), (10.001, 10.0, 0.5, 1e-3), (1e3, 10.0, 0.5, 0.1)], USUAL),
}
"""By name: the formula, numbers at which it is stiff, and the tolerance of its value in float32 and float64."""

WIDE = 1e-20


def compiled(fn):
    both = lambda *x: (fn(*x), jax.jacfwd(fn, tuple(range(len(x))))(*x))  # noqa: E731
    return jax.jit(both, compiler_options=QUICKLY)


@pytest.mark.parametrize("name", CASES)
def test_values_and_derivatives_have_their_digits(name):
    fn, rows, tolerance = CASES[name]
    exact = in_digits(fn, *map(np.float64, rows[0]))
    both = compiled(fn)
    for dtype in DTYPES:
        rel = tolerance[DTYPES.index(dtype) - 1]
        for row in rows:
            rounded = [np.asarray(x, dtype) for x in row]
            value, slopes = both(*map(jnp.asarray, rounded))
            assert value.dtype == dtype
            with mpmath.workdps(DIGITS):
                at = [reals(x) for x in rounded]
                wanted = exact(*at)
                differences = [difference(exact, at, k, wanted) for k in range(len(at))]
            assert abs(float(value) - float(wanted)) <= max(rel * abs(float(wanted)), FLOOR[dtype]), (row, value, wanted)
            for k, (slope, sides) in enumerate(zip(slopes, differences, strict=True)):
                held(float(slope), sides, float(wanted), float(at[k]), dtype, (name, row, k))


def difference(exact, at, k, here):
    """Slopes to both sides, in 50 digits."""
    sides = []
    for sign in (1, -1):
        h = sign * WIDE * max(abs(float(at[k])), 1e-3)
        moved = [np.asarray(x + mpmath.mpf(h), object) if j == k else x for j, x in enumerate(at)]
        sides.append(float((exact(*moved) - here) / mpmath.mpf(h)))
    return sides


def held(slope, sides, value, at, dtype, what):
    """As steep as one of the sides, or between: 0 on the edge of what a guard leaves out, a half where two are equal."""
    assert np.isfinite(slope), what
    # Where the slope passes through 0 its terms do not: they are as large as the value over the number.
    slack = SLOPE[dtype] * max(*map(abs, sides), 1e-2 * abs(value) / min(abs(at) or 1.0, 1.0)) + 1e2 * FLOOR[dtype]
    low, high = min(0.0, *sides) if sides[0] != pytest.approx(sides[1], rel=1e-6) else min(sides), max(sides)
    assert low - slack <= slope <= high + slack, (what, slope, sides)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", ["conductor", "oren_nayar", "faithful over lambert"])
def test_below_the_surface_there_is_nothing_and_no_derivative(name, dtype):
    stack = STACKS[name].astype(dtype)
    up, down = (jnp.asarray(direction(theta), dtype) for theta in (40.0, 130.0))
    both = jax.jit(jax.value_and_grad(lambda *x: jnp.sum(brdf(*x)), (0, 1, 2)))
    for wi, wo in ((up, down), (down, up), (down, down)):
        f, slopes = both(stack, wi, wo)
        assert float(f) == 0.0
        assert all(np.all(np.asarray(leaf) == 0.0) for leaf in jax.tree.leaves(slopes))


def test_the_slope_at_matching_indices_is_that_beside_them():
    """The larger of two equal numbers has half of its slope in either."""
    up = jnp.array([[0.0, 0.0, 1.0]])
    at = lambda eta: brdf_rows(Stack((Coat(alpha=0.1, eta=eta, tau=0.3),), Lambert(albedo=0.5), Corrected()), up, up)[0, 0]  # noqa: E731
    beside = (at(jnp.asarray(1.0 + 1e-6)) - at(jnp.asarray(1.0))) / 1e-6
    assert float(jax.jit(jax.grad(at))(jnp.asarray(1.0))) == pytest.approx(float(beside), rel=1e-3)


@pytest.mark.parametrize("form", [None, Faithful(), Corrected(), Precise("single"), Precise("multi")])
def test_nothing_jumps_where_total_reflection_begins(form):
    """Below an index of .5 without extinction: from 30 degrees on all is reflected. Beside that the rest goes as a root."""
    base = Conductor(alpha=0.2, eta=0.5, k=0.0)
    stack = Stack((), base) if form is None else Stack((Coat(alpha=0.1, eta=1.5, tau=0.3),), base, form)
    steps = np.array([1e-13, 1e-9, 1e-5])
    theta = np.radians(30.0) + np.concatenate([-steps, steps])
    wi = np.stack([np.sin(theta), np.zeros(6), np.cos(theta)], -1)
    f = np.asarray(brdf_rows(stack, wi, wi * np.array([-1.0, 1.0, 1.0])))[:, 0]
    across = np.abs(f[3:] - f[:3]) / f[:3]
    assert np.all(across < 20.0 * np.sqrt(steps + 1e-12)), across  # the floor of no extinction


def test_narrower_than_the_range_is_still_finite_in_single_precision():
    """A tenth of the least width that a material has."""
    stack = Stack((), Conductor(alpha=1e-4, **COPPER)).astype(np.float32)
    w = np.asarray([direction(t) for t in (0.0, 30.0, 60.0)], np.float32)
    mirrored = w * np.array([-1.0, -1.0, 1.0], np.float32)
    assert np.all(np.isfinite(brdf_rows(stack, w, mirrored)))


def test_every_row_of_the_page_names_tests_that_are_there():
    rows = re.findall(r"^\| (\d+) \|.*\| (.+?) \|$", PAGE.read_text(), re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, 39))
    folder = Path(__file__).parent
    functions = {file.stem: _functions(file) for file in folder.glob("test_*.py")}
    for number, cell in rows:
        named = re.findall(r"`(\w+)(?:::(\w+))?`", cell)
        assert named, number
        for name, within in named:
            known = name in CASES or (name in functions and (not within or any(within in f for f in functions[name])))
            assert known, (number, name, within)


def _functions(file):
    return [node.name for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.FunctionDef)]
