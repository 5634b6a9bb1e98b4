"""Patina: noise over a surface, growth in time, and the material that comes of them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import (
    COPPER,
    FLOOR,
    REL,
    brdf_rows,
    cases,
    close,
    coat_of,
    compiles,
    every_text,
    hemisphere,
    printed,
    sphere_view,
    surface_of,
)
from layerfit._compiled import Compiled
from layerfit._place import Place
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.result import parameters, unidentified
from layerfit.forms import patina
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.growth import Cover, aged_at, cover_at
from layerfit.forms.precise import Precise
from layerfit.layers import Coat, Patina
from layerfit.materials.patina import copper_patina
from layerfit.optics.growth import coverage, grown, onset, partly_grown, tarnish_thickness
from layerfit.optics.noise import fbm, value_noise
from layerfit.preset import preset_of, read_preset, stack_of
from layerfit.render import brdf, predict
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack, at, evaluate
from layerfit.surfaces import Conductor, Lambert
from layerfit.truth import compare

DTYPES = [np.float64, np.float32]


def mask_of(g, t, t0, p, width):
    return partly_grown(coverage(t, t0, p), g, width)


def thickness_of(g, t, t0, p, h_rate, tau_s):
    return tarnish_thickness(t, onset(g, t0, p), h_rate, tau_s)


def field_of(x, y, seed):
    return fbm(jnp.stack([x, y]), seed)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize(
    ("name", "formula"),
    [("fbm", field_of), ("patina_mask", mask_of), ("patina_thickness", thickness_of)],
    ids=["fbm", "mask", "thickness"],
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


METAL = Conductor(alpha=0.2, **COPPER)
CRUST = {"absorbed": [0.8, 0.2, 0.4], "scattered": [0.5, 1.0, 0.8]}
SCATTERS = {"albedo": [0.3, 0.6, 0.5], "depth": 0.8, "g": 0.2}
PATINAS = {
    "all": Stack((Patina(softness=0.05, tau=[0.5, 1.0, 2.0], weight=0.6, **SCATTERS, **CRUST),), METAL),
    "film with a hard edge": Stack((Patina(absorption_per_mm=[300.0, 900.0, 2000.0], thickness_um=1.0),), METAL),
    "crust": Stack((Patina(softness=0.1, eta=1.7, **CRUST),), METAL),
    "trapped light": Stack((Patina(softness=0.1, tau=0.3),), METAL, Corrected(trapped=True)),
    "as published": Stack((Patina(softness=0.1, tau=0.3, mixing="added", **SCATTERS, **CRUST),), METAL),
    "faithful": Stack((Patina(softness=0.1, tau=0.3, masking="vcavity", mixing="added", **SCATTERS),), METAL, Faithful()),
    "exposed": Stack((Patina(softness=0.05, exposure=0.7, tau=[0.5, 1.0, 2.0], **CRUST),), METAL),
    "exposed, with a hard edge": Stack((Patina(exposure=1.0, tau=0.3),), METAL),
}


@pytest.fixture(scope="module")
def rows():
    """Pairs of directions at places of the surface."""
    uv = np.random.default_rng(0).uniform(-2.0, 2.0, (256, 2))
    return hemisphere(256, 1), hemisphere(256, 2), Place(uv, sky=np.linspace(0.0, 1.0, 256))


@pytest.mark.parametrize("mixing", ["medium", "added"])
def test_without_g_light_is_scattered_to_all_sides_alike(mixing, rows):
    even, given = (Stack((Patina(softness=0.1, albedo=0.5, depth=0.8, g=g, mixing=mixing),), METAL) for g in (None, 0.0))
    np.testing.assert_allclose(brdf(even, *rows), brdf(given, *rows), rtol=1e-5)


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_patina_has_its_digits(oracle, dtype):
    for case in cases(oracle)["patina_brdf"]:
        i = case["in"]
        film = coat_of(i["coat"])
        same = ("alpha", "alpha_x", "alpha_y", "eta", "tau", "distribution", "masking")
        scattering = {"albedo": i["albedo"], "depth": i["tau_s"], "g": i["g"]}
        crust = {"absorbed": i["K"] * i["x"], "scattered": i["S"] * i["x"]}
        layer = Patina(**{field: getattr(film, field) for field in same}, **scattering, **crust, mixing="added")
        covered = np.float32(i["m"]) if dtype == np.float32 else i["m"]
        stack = Stack((layer,), surface_of(i["base"]), Corrected(trapped=True)).astype(dtype)
        value = float(_at_spot(stack, covered, i["wi"], i["wo"], dtype))
        wanted, rel = float(case["out"]), 10.0 * REL[dtype]
        if dtype == np.float32:
            wi, wo = (np.asarray(i[w], np.float32) for w in ("wi", "wo"))
            wanted = float(_at_spot(jax.tree.map(lambda x: x.astype(np.float64), stack), covered, wi, wo, np.float64))
            rel = 2e-2 if min(wi[2], wo[2]) < 1e-3 else rel
        assert close(value, wanted, rel, FLOOR[dtype]), (value, wanted, i)


def _at_spot(stack, covered, wi, wo, dtype):
    cover = Cover(jnp.asarray(covered, dtype), jnp.asarray(1.0 - float(covered), dtype))
    spot = patina.Spot(cover, jnp.ones((), dtype))
    prepared = dataclasses.replace(stack.prepare(), spot=spot)
    return evaluate(stack.form, prepared, jnp.asarray(wi, dtype), jnp.asarray(wo, dtype))


@pytest.mark.parametrize("name", PATINAS)
def test_parity_of_a_patina(gl, name):
    parity = check_pairs(printed(PATINAS[name]), 16384)
    assert parity.passed, parity


@pytest.mark.parametrize("name", PATINAS)
def test_a_patina_validates(name, tmp_path):
    compiles(tmp_path, every_text(PATINAS[name]))


def test_what_a_patina_does_without_is_not_in_its_text():
    text = print_material(PATINAS["crust"], "crust").text()
    assert "vec3 lf_evaluate(FreeDirection wi, FreeDirection wo, vec2 uv) {" in text
    assert "henyey" not in text
    assert "tau" not in text
    assert "kubelka" in text
    assert "kubelka" not in print_material(PATINAS["film with a hard edge"], "film").text()


@pytest.mark.parametrize("name", PATINAS)
def test_a_patina_is_reciprocal_and_dark_below_the_surface(name, rows):
    wi, wo, place = rows
    stack = PATINAS[name].astype(np.float64)
    there = np.asarray(brdf(stack, wi, wo, place))
    np.testing.assert_allclose(there, brdf(stack, wo, wi, place), rtol=1e-11)
    assert np.all(there > 0.0)
    assert np.all(np.asarray(brdf(stack, wi * np.array([1.0, 1.0, -1.0]), wo, place)) == 0.0)


def test_what_has_not_begun_is_bare_metal(rows):
    wi, wo, place = rows
    new = Stack((dataclasses.replace(PATINAS["film with a hard edge"].layers[0], years=0.0),), METAL).astype(np.float64)
    np.testing.assert_allclose(brdf(new, wi, wo, place), brdf(Stack((), METAL).astype(np.float64), wi, wo), rtol=1e-14)


def test_what_is_covered_for_long_is_film_and_crust_alone(rows):
    """One onset time after it began the film is the coat that its fields describe."""
    wi, wo, place = rows
    layer = Patina(years=1e4, onset_years=1.0, blur=1e-3, tau=[0.002, 0.004, 0.008])
    old = Stack((layer,), METAL).astype(np.float64)
    coat = Coat(alpha=0.3, eta=2.7, tau=np.sqrt(1e4 - 1.0) * np.array([0.002, 0.004, 0.008]))
    np.testing.assert_allclose(brdf(old, wi, wo, place), brdf_rows(Stack((coat,), METAL).astype(np.float64), wi, wo), rtol=2e-4)


@pytest.mark.parametrize("g", [None, 0.6])
def test_a_film_that_scatters_is_a_coat_that_does(g, rows):
    """But for the fewer nodes of its quadrature, which is of every place."""
    wi, wo, place = rows
    thin = Patina(years=1e4, onset_years=1.0, blur=1e-3, tau=0.002, albedo=[0.3, 0.6, 0.9], depth=0.02, g=g)
    h, albedo = np.sqrt(1e4 - 1.0), np.array([0.3, 0.6, 0.9])
    coat = Coat(alpha=0.3, eta=2.7, tau=h * (0.002 + (1.0 - albedo) * 0.02), tau_s=h * albedo * 0.02, g=g)
    values, wanted = (
        brdf(Stack((layer,), METAL).astype(np.float64), wi, wo, place) for layer, place in ((thin, place), (coat, None))
    )
    np.testing.assert_allclose(values, wanted, rtol=2e-3)


def test_the_mean_over_the_surface_is_near_the_mean_of_its_places():
    many = 4096
    wi, wo = (np.repeat(hemisphere(8, seed), many, 0) for seed in (1, 2))
    place = Place(np.random.default_rng(1).uniform(-50.0, 50.0, (8 * many, 2)))
    for years in (5.0, 8.0, 20.0):
        stack = Stack((dataclasses.replace(PATINAS["all"].layers[0], years=years),), METAL)
        pixels = lambda where, stack=stack: predict(stack, wi[:, None], wo, np.ones_like(wi)[:, None], where)  # noqa: E731
        np.testing.assert_allclose(pixels(None)[::many], pixels(place).reshape(8, many, 3).mean(1), rtol=0.06)


EXPOSED = ["exposed", "exposed, with a hard edge"]


def changed(stack, **fields):
    """The same patina but for some fields, in float64."""
    return dataclasses.replace(stack, layers=(dataclasses.replace(stack.layers[0], **fields),)).astype(np.float64)


@pytest.mark.parametrize("name", EXPOSED)
def test_a_place_ages_by_what_it_sees_of_the_sky(name, rows):
    """In the open like one that is not told of the sky; elsewhere, and in the mean, like a younger one."""
    wi, wo, place = rows
    exposure, years = PATINAS[name].layers[0].exposure, PATINAS[name].layers[0].years
    stack = changed(PATINAS[name])
    for sky in (1.0, 0.3, None):
        younger = changed(stack, exposure=None, years=years * (1.0 - exposure * (1.0 - (0.5 if sky is None else sky))))
        there = None if sky is None else Place(place.uv, sky=np.full(len(wi), sky))
        np.testing.assert_allclose(brdf(stack, wi, wo, there), brdf(younger, wi, wo, there), rtol=1e-12)


def test_more_of_the_sky_more_patina():
    growth = changed(PATINAS["exposed"]).prepare().growth
    g = jnp.float64(0.5)
    shares = [float(cover_at(g, aged_at(growth, sky)).covered) for sky in (0.0, 0.5, 1.0)]
    assert shares[0] < 0.2 < shares[1] < shares[2]
    assert shares[2] > 0.9


def test_what_never_sees_the_sky_stays_bare(rows):
    """Where all growth needs it."""
    wi, wo, place = rows
    stack = changed(PATINAS["exposed, with a hard edge"])
    shut = Place(place.uv, sky=np.zeros(len(wi)))
    np.testing.assert_allclose(brdf(stack, wi, wo, shut), brdf(Stack((), METAL).astype(np.float64), wi, wo), rtol=1e-14)


def test_a_place_that_does_not_tell_of_the_sky_is_refused(rows):
    wi, wo, place = rows
    with pytest.raises(InputError, match="reads uv, sky of a place of the surface, and of this one there is no sky"):
        brdf(PATINAS["exposed"], wi, wo, Place(place.uv))
    assert PATINAS["all"].reads == ("uv",)
    assert "sky" not in print_material(PATINAS["all"], "all").text()


def test_derivatives_of_exposure_agree_with_differences(rows):
    wi, wo, uv, sky = (jnp.asarray(x[:16]) for x in (rows[0], rows[1], rows[2].uv, rows[2].sky))
    stack = changed(PATINAS["exposed"])

    def value(exposure, sky):
        there = dataclasses.replace(stack.layers[0], exposure=exposure)
        return brdf(dataclasses.replace(stack, layers=(there,)), wi, wo, Place(uv, sky=sky))

    both = Compiled(lambda point, step: jax.jvp(value, point, step))
    point, h = (stack.layers[0].exposure, sky), 1e-6
    for step in ((jnp.ones_like(point[0]), jnp.zeros_like(sky)), (jnp.zeros_like(point[0]), jnp.ones_like(sky))):
        moved = [both(tuple(x + s * h * d for x, d in zip(point, step, strict=True)), step)[0] for s in (1.0, -1.0)]
        slope = np.asarray(both(point, step)[1])
        assert np.all(np.isfinite(slope))
        assert np.max(np.abs(slope)) > 1e-3
        np.testing.assert_allclose(slope, (moved[0] - moved[1]) / (2.0 * h), rtol=1e-5, atol=1e-8)


def _rows(stack, wi, wo, uv):
    prepared = stack.prepare()
    return jax.vmap(lambda i, o, p: evaluate(stack.form, at(prepared, Place(p)), i, o))(wi, wo, uv)


# One executable for all that asks for the derivatives of one material.
_values_and_slopes = Compiled(lambda inputs, tangents: jax.jvp(_rows, inputs, tangents))


def _along(stack, **tangent):
    """A step in some fields of the layer."""
    still = jax.tree.map(jnp.zeros_like, stack)
    tangent = {field: jnp.full_like(getattr(stack.layers[0], field), value) for field, value in tangent.items()}
    return dataclasses.replace(still, layers=(dataclasses.replace(still.layers[0], **tangent),))


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_patina_has_finite_derivatives_at_its_edges(dtype):
    edges = np.array([[0.0, 0.0, 1.0], [np.sqrt(1 - 1e-8), 0.0, 1e-4], [-np.sqrt(1 - 1e-8), 0.0, 1e-4]], dtype)
    wi, wo = np.tile(np.repeat(edges, 3, 0), (2, 1))[:16], np.tile(edges, (6, 1))[:16]
    uv = np.linspace(-1.0, 1.0, 32, dtype=dtype).reshape(16, 2)
    for years in (0.0, 1e-3, 20.0, 1e4):
        stack = Stack((dataclasses.replace(PATINAS["all"].layers[0], years=years),), METAL).astype(dtype)
        inputs = (stack, wi, wo, uv)
        values, slopes = _values_and_slopes(inputs, jax.tree.map(jnp.ones_like, inputs))
        assert np.all(np.isfinite(values))
        assert np.all(np.isfinite(slopes))


def test_derivatives_of_a_patina_agree_with_differences(rows):
    wi, wo, uv = rows[0][:16], rows[1][:16], rows[2].uv[:16]
    stack = PATINAS["all"].astype(np.float64)
    still = [jnp.zeros_like(x) for x in (wi, wo, uv)]
    for field in ("years", "onset_years", "steepness", "softness", "blur", "cells", "depth", "weight"):
        step = _along(stack, **{field: 1.0})
        value = lambda h, step=step: _values_and_slopes(  # noqa: E731
            (jax.tree.map(lambda x, d: x + h * d, stack, step), wi, wo, uv), (step, *still)
        )
        h = 1e-6 * float(getattr(stack.layers[0], field))
        difference = (value(h)[0] - value(-h)[0]) / (2.0 * h)
        np.testing.assert_allclose(value(0.0)[1], difference, rtol=1e-5, atol=1e-8)


def test_a_patina_is_written_and_read():
    stack = PATINAS["all"]
    document = preset_of(stack, "all")
    keys = {key: document[key] for key in ("model", "layers", "base")}
    np.testing.assert_array_equal(stack_of(keys, "preset").layers[0].scattered, [0.5, 1.0, 0.8])
    assert stack_of({key: keys[key] for key in ("layers", "base")}, "preset").form == Corrected()
    assert document["left_out"] == ["patina: anisotropy", "base: anisotropy"]
    assert "patina: crust" in preset_of(PATINAS["film with a hard edge"], "film")["left_out"]


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"layers": [{"type": "patina", "albedo": 0.5}], "base": {"type": "conductor"}}, "come together; depth is missing"),
        ({"layers": [{"type": "patina", "g": 0.5}], "base": {"type": "conductor"}}, "g belongs to albedo"),
        (
            {
                "model": "faithful",
                "layers": [{"type": "patina", "albedo": 0.5, "depth": 0.3}],
                "base": {"type": "conductor"},
            },
            'patina scatters light in its film, which this form does not know: give it mixing = "added"',
        ),
        ({"layers": [{"type": "patina"}], "base": {"type": "lambert"}}, "alone over a conductor; here its base is Lambert"),
        ({"layers": [{"type": "coat"}, {"type": "patina"}], "base": {"type": "conductor"}}, "one of several layers"),
        ({"model": "precise", "layers": [{"type": "patina"}], "base": {"type": "conductor"}}, "it changes in time"),
    ],
)
def test_a_patina_that_cannot_be_is_refused(document, message):
    with pytest.raises(InputError, match=message):
        stack_of(document, "scene")


@pytest.mark.parametrize("stack", [Stack((Patina(),), Lambert()), Stack((Patina(),), METAL, Precise())], ids=["base", "form"])
def test_a_patina_that_cannot_be_is_refused_in_python(stack):
    with pytest.raises(InputError, match="patina"):
        stack.astype(np.float32).prepare()


def test_the_shipped_patina_is_that_of_the_function():
    shipped, made = read_preset("patinated_copper"), copper_patina()
    for a, b in zip(jax.tree.leaves(shipped), jax.tree.leaves(made), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)


@pytest.mark.parametrize("years", [10.0, 100.0])
def test_the_shipped_patina_sends_back_no_more_than_it_gets_at_any_place(years):
    stack = copper_patina(years=years, softness=None).astype(np.float32)
    wo = hemisphere(8192, 3)
    for theta in (0.2, 1.2):
        wi = np.broadcast_to([np.sin(theta), 0.0, np.cos(theta)], wo.shape)
        for uv in ([0.1, 0.2], [0.6, 0.9]):
            values = predict(stack, wi[:, None], wo, np.ones((8192, 1, 3)), Place(np.broadcast_to(uv, (8192, 2))))
            albedo = 0.98 * 2.0 * np.pi * np.mean(values * wo[:, 2:], 0)
            assert np.all(albedo < 1.0), albedo


TRUTH = Stack((Patina(years=9.0, softness=0.08, tau=[0.3, 0.6, 1.2], **CRUST),), METAL)


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """A sphere of the patina."""
    return sphere_view(TRUTH, tmp_path_factory.mktemp("patina"), 40)


@pytest.fixture(scope="module")
def fitted(sphere):
    """Age, edge and crust from a younger start, where the onset is asked for too."""
    young = dataclasses.replace(TRUTH.layers[0], years=5.0, softness=0.2, scattered=[0.8, 0.8, 0.8])
    free = [f"patina.{field}" for field in ("years", "onset_years", "softness", "scattered")]
    return fit([sphere], dataclasses.replace(TRUTH, layers=(young,)), free=free, starts=1)


def test_the_age_of_a_patina_is_found(fitted):
    assert fitted.converged
    rows = parameters(fitted)
    assert rows["patina.years"]["value"] == pytest.approx(9.0, rel=2e-3)
    assert rows["patina.softness"]["value"] == pytest.approx(0.08, rel=5e-3)
    np.testing.assert_allclose(rows["patina.scattered"]["value"], CRUST["scattered"], rtol=0.02)


def test_age_and_onset_are_said_to_be_one(fitted):
    assert "patina.onset_years" not in parameters(fitted)
    (row,) = unidentified(fitted)
    assert row["why"] == "age and onset enter only as their ratio; patina.onset_years was held at its start"
    assert row["direction"] == {"patina.years": 1.0, "patina.onset_years": 1.0}


def test_a_patina_has_no_walk():
    with pytest.raises(InputError, match="changes in time"):
        compare(PATINAS["all"], "all")
