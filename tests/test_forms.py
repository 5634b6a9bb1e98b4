"""Layered forms: 50-digit values, a random walk through the layers, and physics that holds for every material."""

import dataclasses
import functools
import itertools
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import (
    COPPER,
    FLOOR,
    REL,
    STACKS,
    brdf,
    brdf_rows,
    cases,
    close,
    direction,
    hemisphere,
    stack_of,
    surface_of,
    varnish,
)
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.layers import Coat
from layerfit.optics.fresnel import fresnel_dielectric, rarer_cosine
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert, OrenNayar
from layerfit.surfaces.diffuse import oren_nayar_full, oren_nayar_qualitative

DTYPES = [np.float64, np.float32]
ROWS = 256  # one size everywhere: what is compiled for one test serves the next
HALVES = slice(ROWS), slice(ROWS, None)

# Directions whose cosine rounds to 1 in float64 have lost their sine; near total reflection a cosine is the root of a difference.
ILL_CONDITIONED = 5e-9


def value_at(stack, wi, wo, dtype):
    return float(brdf(stack.astype(dtype), jnp.asarray(wi, dtype), jnp.asarray(wo, dtype)))


def held(stack, wi, wo, wanted, dtype):
    if dtype == np.float64:
        value = value_at(stack, wi, wo, dtype)
        grazing = min(wi[2], wo[2]) < 1e-3
        assert close(value, wanted, ILL_CONDITIONED if grazing else REL[dtype], FLOOR[dtype]), (value, wanted)
        return
    single = stack.astype(np.float32)
    wi, wo = (np.asarray(w, np.float32).astype(float) for w in (wi, wo))
    wanted = value_at(jax.tree.map(lambda x: x.astype(np.float64), single), wi, wo, np.float64)
    # In float32 a grazing cosine of 1e-4 out of a medium of index 1.0001 has one digit left.
    rel = 2e-2 if min(wi[2], wo[2]) < 1e-3 else REL[dtype]
    assert close(value_at(single, wi, wo, np.float32), wanted, rel, FLOOR[dtype]), wanted


@pytest.mark.parametrize("dtype", DTYPES)
def test_surfaces_have_their_digits(oracle, dtype):
    for case in cases(oracle)["brdf"]:
        i = case["in"]
        held(Stack((), surface_of(i["b"])), i["wi"], i["wo"], float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_faithful_has_its_digits(oracle, dtype):
    for case in cases(oracle)["ww_faithful"]:
        i = case["in"]
        form = Faithful(refract_at=i.get("refract_at", "h"), fresnel_at=i.get("fresnel_at", "h"))
        held(stack_of(i["layers"], form), i["wi"], i["wo"], float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_corrected_has_its_digits(oracle, dtype):
    for case in cases(oracle)["lw_corrected"]:
        i = case["in"]
        held(stack_of(i["layers"], Corrected(trapped=True)), i["wi"], i["wo"], float(case["out"]), dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_oren_nayar_has_its_digits(oracle, dtype):
    for case in cases(oracle)["oren_nayar"]:
        i = case["in"]
        chosen = oren_nayar_qualitative if i.get("qualitative") else oren_nayar_full
        inputs = [np.asarray(i[k], dtype) for k in ("wi", "wo", "rho", "sigma")]
        value, wanted = float(chosen(*map(jnp.asarray, inputs))), float(case["out"])
        if dtype == np.float32:
            wanted = float(chosen(*(jnp.asarray(x, np.float64) for x in inputs)))
        lost = max(i["wi"][2], i["wo"][2]) == 1.0
        assert close(value, wanted, ILL_CONDITIONED if lost and dtype == np.float64 else REL[dtype], FLOOR[dtype]), i


@functools.cache
def walk_errors(oracle, form):
    """Relative error of the light from below the coat, by row of the walk: (interface, kind, error)."""
    rows = json.loads((oracle / "walk_truth.json").read_text())["rows"]
    below = jax.vmap(_below)
    out = []
    for kind in ("lambert", "conductor"):
        chosen = [r for r in rows if r["base"]["kind"] == kind]
        column = lambda *path: np.array([_at(r, path) for r in chosen])  # noqa: E731, B023
        coat = Coat(alpha=column("coat", "a"), eta=column("coat", "ior"), tau=column("coat", "tau"))
        base = (
            Lambert(albedo=column("base", "rho"))
            if kind == "lambert"
            else Conductor(alpha=column("base", "a"), eta=column("base", "n"), k=column("base", "k"))
        )
        wi, wo, truth = column("wi"), column("wos"), column("f_sub")
        wi, wo = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (wi, wo))
        value = np.asarray(below(Stack((coat,), base, form), wi, wo))
        error = np.sum(np.abs(value - truth) * wo[..., 2], 1) / np.sum(truth * wo[..., 2], 1)
        out += [(r["interface"], kind, e) for r, e in zip(chosen, error, strict=True)]
    return out


def _at(row, path):
    for key in path:
        row = row[key]
    return row


def _below(stack, wi, wo):
    top = stack.layers[0].below(jnp.ones(()))
    return jax.vmap(lambda o: brdf(stack, wi, o) - top.evaluate(wi, o))(wo)


def median(errors, interface, kind):
    return float(np.median([e for i, k, e in errors if (i, k) == (interface, kind)]))


def p90(errors, interface, kind):
    return float(np.quantile([e for i, k, e in errors if (i, k) == (interface, kind)], 0.9))


def test_corrected_is_as_near_to_the_walk_as_its_table_says(oracle):
    errors = walk_errors(oracle, Corrected(trapped=True))
    assert median(errors, "multi", "lambert") <= 0.03
    assert p90(errors, "multi", "lambert") <= 0.15
    assert median(errors, "multi", "conductor") <= 0.10
    assert p90(errors, "multi", "conductor") <= 0.30
    assert median(errors, "single", "lambert") <= 0.13
    assert median(errors, "single", "conductor") <= 0.11


def test_faithful_is_as_far_from_the_walk_as_its_table_says(oracle):
    at_h, at_n = walk_errors(oracle, Faithful()), walk_errors(oracle, Faithful("n", "n"))
    assert 0.5 < median(at_h, "multi", "lambert") < 0.9
    assert 0.6 < median(at_h, "multi", "conductor") < 2.6
    assert median(at_n, "multi", "lambert") > median(at_h, "multi", "lambert")


def test_each_correction_earns_its_place(oracle):
    """Taking one out of the form takes it farther from the walk."""
    full = walk_errors(oracle, Corrected(trapped=True))
    for part in ({"rough_interface": False}, {"broaden": False}, {"orders": 0}):
        worse = walk_errors(oracle, Corrected(**{"trapped": True} | part))
        assert median(worse, "multi", "conductor") > median(full, "multi", "conductor"), part


@jax.jit
def along(inputs, tangents):
    """Values of `brdf_rows`, and their derivatives in one direction: a third less to compile than those of all leaves side by side.

    Everything that is asked of all `STACKS` is asked of this one function, of `ROWS` rows: compiling it is what takes the time.
    """
    return jax.jvp(brdf_rows, inputs, tangents)


def rows_of(stack, wi, wo):
    """BRDF (ROWS, 3) of directions (ROWS, 3)."""
    inputs = stack, jnp.asarray(wi), jnp.asarray(wo)
    return along(inputs, jax.tree.map(np.zeros_like, inputs))[0]


def columns(*inputs):
    """Values of `brdf_rows`, and their derivatives along each leaf of its arguments, leaf by leaf."""
    leaves, structure = jax.tree.flatten(inputs)
    steps = [[np.full_like(x, j == k) for j, x in enumerate(leaves)] for k in range(len(leaves))]
    found = [along(inputs, jax.tree.unflatten(structure, step)) for step in steps]
    return found[0][0], np.stack([slopes for _, slopes in found])


PRECISE = [name for name in STACKS if name.startswith("precise")]


@pytest.mark.parametrize("name", PRECISE)
def test_float32_is_enough(name):
    wi, wo = hemisphere(2 * ROWS, 5), hemisphere(2 * ROWS, 6)
    wide, narrow = (
        np.concatenate([rows_of(STACKS[name].astype(dtype), wi[some].astype(dtype), wo[some].astype(dtype)) for some in HALVES])
        for dtype in DTYPES
    )
    assert narrow.dtype == np.float32
    np.testing.assert_allclose(narrow, wide, rtol=2e-3, atol=1e-5)
    assert np.median(np.abs(narrow / wide - 1.0)) < 3e-6


NOT_RECIPROCAL = {"faithful at the normal", "phong, faithful"}


@pytest.mark.parametrize("name", STACKS)
def test_reciprocity(name):
    stack = STACKS[name].astype(np.float64)
    wi, wo = hemisphere(ROWS, 1), hemisphere(ROWS, 2)
    there, back = rows_of(stack, wi, wo), rows_of(stack, wo, wi)
    if name in NOT_RECIPROCAL:
        # t contains T21 alone; the published lobe is over NoL.
        assert float(jnp.max(jnp.abs(there - back) / (there + 1e-6))) > 0.1
    else:
        np.testing.assert_allclose(there, back, rtol=1e-11)


EDGES = np.array([direction(t, p) for t, p in [(0, 0), (89.99, 0), (89.99, 180), (89.99, 90), (45, 0), (45, 180), (140, 0)]])


@pytest.mark.parametrize("name", STACKS)
@pytest.mark.parametrize("dtype", DTYPES)
def test_values_and_derivatives(name, dtype):
    """At the edges finite, below the surface 0, and in between those of differences: one test, for it compiles once."""
    stack = STACKS[name].astype(dtype)
    between = ROWS - len(EDGES) ** 2
    wi = np.concatenate([np.repeat(EDGES, len(EDGES), 0), np.repeat([direction(35.0)], between, 0)])
    wo = np.concatenate([np.tile(EDGES, (len(EDGES), 1)), np.repeat([direction(50.0, 150.0)], between, 0)])
    wi, wo = jnp.asarray(wi, dtype), jnp.asarray(wo, dtype)
    values, slopes = columns(stack, wi, wo)
    assert np.all(np.isfinite(values))
    assert np.all(np.asarray(values) >= 0.0)
    assert np.all(np.isfinite(slopes))
    below = (wi[:, 2] < 0.0) | (wo[:, 2] < 0.0)
    assert np.all(np.asarray(values)[below] == 0.0)
    assert np.all(np.asarray(slopes)[:, below] == 0.0)
    if dtype == np.float64:
        leaves, structure = jax.tree.flatten(stack)
        for k, leaf in enumerate(leaves):
            h = 1e-6 * float(jnp.max(jnp.abs(leaf))) + 1e-9
            moved = [jax.tree.unflatten(structure, [x + s * h * (j == k) for j, x in enumerate(leaves)]) for s in (1.0, -1.0)]
            plus, minus = (rows_of(s, wi, wo)[-1] for s in moved)
            np.testing.assert_allclose(slopes[k, -1], (plus - minus) / (2.0 * h), rtol=2e-5, atol=1e-8)


@pytest.mark.parametrize("form", [Corrected(), Corrected(trapped=True), Faithful(), Faithful("n", "n")], ids=str)
@pytest.mark.parametrize(
    "base",
    [Conductor(alpha=0.3, **COPPER), Lambert(albedo=0.7), OrenNayar(albedo=0.7, sigma=0.3)],
    ids=lambda b: type(b).__name__,
)
def test_a_coat_that_is_not_there_changes_nothing(form, base):
    """Index 1 and no absorption: the base alone, whatever the coat's width."""
    wi, wo = hemisphere(ROWS, 3), hemisphere(ROWS, 4)
    bare = brdf_rows(Stack((), base).astype(np.float64), wi, wo)
    for tau in (None, 0.0):
        coated = Stack((Coat(alpha=0.01, eta=1.0, tau=tau),), base, form).astype(np.float64)
        rel = 1e-12 if isinstance(form, Faithful) or not isinstance(base, Conductor) else 5e-3
        np.testing.assert_allclose(brdf_rows(coated, wi, wo), bare, rtol=rel)


def test_a_coat_that_is_not_there_leaves_a_conductor_bit_close_but_for_its_second_bounce():
    """The series over bounces has nothing to add where the interface reflects nothing back."""
    wi, wo = hemisphere(ROWS, 3), hemisphere(ROWS, 4)
    base = Conductor(alpha=0.3, **COPPER)
    coated = Stack((Coat(alpha=0.4, eta=1.0, tau=None),), base, Corrected(trapped=True)).astype(np.float64)
    bare = brdf_rows(Stack((), base).astype(np.float64), wi, wo)
    prepared = coated.prepare()
    assert float(prepared.interfaces[0].drift) == 0.0
    assert float(prepared.interfaces[0].lengthening) == 0.0
    np.testing.assert_allclose(
        brdf_rows(dataclasses.replace(coated, form=Corrected(rough_interface=False)), wi, wo), bare, rtol=1e-12
    )


def furnace(stack, wi, count=8192):
    """Albedo: what leaves of light from one direction, by quadrature over the hemisphere."""
    u = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.618033988749895) % 1.0
    z, phi = np.sqrt(1.0 - u[0]), 2.0 * np.pi * u[1]
    wo = np.stack([np.sqrt(u[0]) * np.cos(phi), np.sqrt(u[0]) * np.sin(phi), z], -1)
    wi = np.broadcast_to(wi, (ROWS, 3))
    return np.pi * np.mean([rows_of(stack, wi, some).mean(0) for some in wo.reshape(-1, ROWS, 3)], 0)


@pytest.mark.parametrize("theta", [0.0, 40.0, 70.0])
@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.6])
def test_a_white_base_below_a_clear_coat_sends_all_light_back(theta, alpha):
    stack = Stack((Coat(alpha=alpha, eta=1.5),), Lambert(albedo=1.0)).astype(np.float64)
    albedo = furnace(stack, direction(theta))
    # The single-scattering top lobe misses light as it gets rough and grazing.
    assert np.all(albedo == pytest.approx(1.0, abs=0.02 + 0.06 * alpha * (theta / 70.0)))


@pytest.mark.parametrize("theta", [10.0, 70.0])
@pytest.mark.parametrize("name", [n for n in STACKS if "faithful" not in n and "narrow" not in n and "V-cavity" not in n])
def test_no_material_sends_back_more_than_it_gets(name, theta):
    assert np.all(furnace(STACKS[name].astype(np.float64), direction(theta)) < 1.02)


def test_a_thicker_coat_is_darker():
    wi, wo = hemisphere(ROWS, 6), hemisphere(ROWS, 7)
    values = [
        brdf_rows(Stack((varnish(tau=t),), Conductor(alpha=0.2, **COPPER)).astype(np.float64), wi, wo)
        for t in (0.0, 0.1, 1.0, 10.0)
    ]
    for thin, thick in itertools.pairwise(values):
        assert np.all(np.asarray(thick) <= np.asarray(thin))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize(("outer", "inner"), [(1.5, 3.0), (1.5, 1.3), (3.0, 1.0), (1.0, 1.5)])
def test_smooth_coats_return_what_a_sum_over_all_directions_does(outer, inner, dtype):
    """By Fresnel's formula alone. Total reflection begins to air and to the outer coat, each at an angle of its own."""
    albedo, count = 0.8, 200_000
    over_cosines = jax.vmap(fresnel_dielectric, (0, None))
    coats = Coat(alpha=1e-3, eta=outer), Coat(name="inner", alpha=1e-3, eta=inner)
    stack = Stack(coats, Lambert(albedo=albedo), Corrected(rough_interface=False)).astype(dtype)
    cosine = (np.arange(count) + 0.5) / count
    p2 = (inner * inner) * (1.0 - cosine * cosine)
    above = np.sqrt(np.maximum(1.0 - p2 / (outer * outer), 0.0))
    F = [over_cosines(jnp.asarray(c), n) for c, n in ((above, 1.0 / outer), (cosine, outer / inner))]
    upper, lower = (np.where(p2 < n * n, f, 1.0) for n, f in zip((1.0, outer), F, strict=True))
    escapes = (1.0 - upper) * (1.0 - lower) / np.maximum(1.0 - upper * lower, 1e-12)
    wanted = 1.0 / (1.0 - albedo * (1.0 - np.mean(2.0 * cosine * escapes)))
    assert float(stack.prepare().returned) == pytest.approx(wanted, rel=1e-6)


def test_light_that_grazes_below_a_denser_coat_has_its_digits():
    """At the edge of total reflection a cosine in the denser medium has none left."""
    coats = Coat(alpha=1e-3, eta=3.0, tau=0.0), Coat(name="inner", alpha=1.0, eta=1.0, tau=0.0)
    stack = Stack(coats, Conductor(alpha=1e-3, eta=10.0, k=15.0), Corrected()).astype(np.float32)
    wi, wo = (np.float32(direction(theta, 20.0)) for theta in (70.0, 89.99))
    double = jax.tree.map(lambda x: np.asarray(x, float), (stack, wi, wo))
    assert value_at(stack, wi, wo, np.float32) == pytest.approx(value_at(*double, np.float64), rel=1e-5)


@pytest.mark.parametrize("more", [{}, {"fresnel": "schlick"}, {"fresnel": "lazanyi"}, {"film_nm": 300.0, "film_eta": 2.1}])
@pytest.mark.parametrize("above", [1.0, 2.0])
def test_what_passes_is_the_same_by_either_cosine(more, above):
    coat = jax.tree.map(jnp.float64, Coat(alpha=0.1, eta=1.5, **more)).below(jnp.float64(above))
    for c in np.linspace(0.05, 1.0, 9):
        np.testing.assert_allclose(coat.passes(rarer_cosine(c, coat.eta)), coat.transmittance(c), rtol=1e-12, atol=1e-15)


def test_equal_widths_are_isotropic():
    wi, wo = hemisphere(ROWS, 12), hemisphere(ROWS, 13)
    for distribution in ("ggx", "beckmann"):
        kind = {"distribution": distribution}
        one = Stack((varnish(**kind),), Conductor(alpha=0.2, **COPPER, **kind)).astype(np.float64)
        two = Stack(
            (varnish(alpha=None, alpha_x=0.1, alpha_y=0.1, **kind),),
            Conductor(alpha=None, alpha_x=0.2, alpha_y=0.2, **COPPER, **kind),
        ).astype(np.float64)
        np.testing.assert_allclose(brdf_rows(two, wi, wo), brdf_rows(one, wi, wo), rtol=1e-13)


def test_a_layer_can_be_taken_off():
    stack = STACKS["corrected, three layers"]
    assert [layer.name for layer in stack.without("coat").layers] == ["primer"]
    with pytest.raises(KeyError, match="varnish"):
        stack.without("varnish")
