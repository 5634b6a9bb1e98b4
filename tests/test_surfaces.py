"""The classic reflectance models: 50-digit values, what they are below a coat, and what a fit finds of them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import (
    APPROXIMATE,
    BELOW_COATS,
    COPPER,
    FLOOR,
    LAFORTUNE,
    REL,
    STACKS,
    WOOD,
    brdf,
    brdf_rows,
    cases,
    close,
    hemisphere,
    varnish,
    with_slope,
)
from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.layers import Coat
from layerfit.optics.microfacet import half_vector
from layerfit.preset import preset_of, stack_of
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import BASES, Blinn, CookTorrance, Lafortune, Phong, TorranceSparrow

DTYPES = [np.float64, np.float32]

OF_CASE = {
    "phong": lambda i: Phong(kd=i["kd"], ks=i["ks"], exponent=i["s"]),
    "blinn": lambda i: Blinn(kd=i["kd"], ks=i["ks"], exponent=i["s"]),
    "lafortune": lambda i: Lafortune(kd=i["kd"], **dict(zip(("ks", "cx", "cy", "cz", "exponent"), i["lobes"][0], strict=True))),
    "torrance_sparrow": lambda i: TorranceSparrow(ks=1.0, kappa=i["c_slope"], eta=i["n"], k=i["k"]),
    "cook_torrance": lambda i: CookTorrance(alpha=i["m"], eta=i["n"], k=i["k"]),
}
"""The surface of a case, by the name of its formula."""


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", OF_CASE)
def test_surfaces_have_their_digits(oracle, name, dtype):
    """float64 against the digits, float32 against float64 at the same rounded numbers."""
    for case in cases(oracle)[name]:
        stack = Stack((), OF_CASE[name](case["in"])).astype(dtype)
        inputs = stack, *(jnp.asarray(case["in"][w], dtype) for w in ("wi", "wo"))
        wanted = float(case["out"])
        if dtype == np.float32:
            wanted = float(brdf(*jax.tree.map(lambda x: x.astype(np.float64), inputs)))
        assert close(float(brdf(*inputs)), wanted, REL[dtype], FLOOR[dtype]), case["in"]


def rows(stack, seed=0, count=256):
    """BRDF (n, 3) on random pairs."""
    return np.asarray(brdf_rows(stack.astype(np.float64), hemisphere(count, seed), hemisphere(count, seed + 1)))


@pytest.mark.parametrize("surface", [Phong(ks=0.3, exponent=20.0), Blinn(ks=0.3, exponent=60.0)], ids=["phong", "blinn"])
def test_the_published_lobe_is_the_normalised_one_over_the_cosine(surface):
    published = dataclasses.replace(surface, kd=0.2, scaling="faithful")
    NoL = hemisphere(256, 0)[:, 2:]
    peak = surface.peak(surface.exponent)
    np.testing.assert_allclose(rows(Stack((), published)), 0.2 + rows(Stack((), surface)) / (peak * NoL), rtol=1e-12)


def test_published_cook_torrance_has_pi_for_4():
    ours = CookTorrance(alpha=0.3, **COPPER)
    published = dataclasses.replace(ours, scaling="faithful")
    np.testing.assert_allclose(rows(Stack((), published)), 4.0 / np.pi * rows(Stack((), ours)), rtol=1e-12)


def test_phong_is_a_lafortune_lobe():
    phong = Phong(kd=0.3, ks=0.4, exponent=30.0)
    lobe = Lafortune(kd=0.3, ks=0.4 * 32.0 / (2.0 * np.pi), exponent=30.0)
    for layers in ((), (varnish(),)):  # a coat widens them alike
        np.testing.assert_allclose(rows(Stack(layers, phong)), rows(Stack(layers, lobe)), rtol=2e-9)


def test_torrance_sparrow_is_near_cook_torrance_for_narrow_lobes():
    """exp(-(kappa delta)^2) and Beckmann's density have the same peak and curvature."""
    kappa = 40.0
    ours = Stack((), CookTorrance(alpha=1.0 / kappa, **COPPER))
    theirs = Stack((), TorranceSparrow(kappa=kappa, ks=kappa**2 / np.pi, **COPPER))
    wi = hemisphere(128, 3)
    wo = wi * [-1.0, -1.0, 1.0]  # the mirror direction
    np.testing.assert_allclose(*(np.asarray(brdf_rows(s.astype(np.float64), wi, wo)) for s in (ours, theirs)), rtol=1e-9)


LOBES = {
    "phong": Phong(exponent=80.0),
    "blinn": Blinn(exponent=300.0),
    "lafortune": dataclasses.replace(LAFORTUNE, kd=None),
    "torrance_sparrow": TorranceSparrow(kappa=12.0, **COPPER),
    "cook_torrance": CookTorrance(alpha=0.08, **COPPER),
}


@pytest.mark.parametrize("name", LOBES)
def test_a_widened_lobe_keeps_its_light(name):
    """But for masking and what goes below the horizon."""
    (lobe,) = jax.tree.map(jnp.asarray, LOBES[name]).lobes
    u, v = (np.arange(4096) + 0.5) / 4096, (np.arange(4096) * 0.618033988749895) % 1.0
    sine, phi = u, 2.0 * np.pi * v
    wo = jnp.asarray(np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1.0 - sine * sine)], -1))
    wi = jnp.array([0.0, 0.0, 1.0])

    def light(width):
        def one(o):
            return lobe.shape(wi, o, half_vector(wi, o), width)

        return float(jnp.mean(jax.vmap(one)(wo) * 2.0 * u)) * np.pi

    narrow = light(None)
    assert narrow > 0.0
    assert light(jnp.asarray(1.6 * lobe.width)) == pytest.approx(narrow, rel=0.05)
    assert light(jnp.asarray(lobe.width)) == pytest.approx(narrow, rel=1e-9)


@pytest.mark.parametrize("name", BELOW_COATS)
def test_below_a_coat_they_print_and_are_reciprocal(gl, name):
    stack = BELOW_COATS[name]
    parity = check_pairs(print_material(stack, "test"), 16384)
    assert parity.passed, parity
    if "faithful" not in name:
        wi, wo = hemisphere(256, 1), hemisphere(256, 2)
        there, back = brdf_rows(stack.astype(np.float64), wi, wo), brdf_rows(stack.astype(np.float64), wo, wi)
        np.testing.assert_allclose(there, back, rtol=1e-10)


@pytest.mark.parametrize("base", [Phong(kd=0.3), Blinn(kd=0.3), LAFORTUNE, TorranceSparrow(kd=0.3), CookTorrance(kd=0.3)])
@pytest.mark.parametrize("form", [None, Faithful()], ids=["corrected", "faithful"])
def test_a_coat_that_is_not_there_changes_nothing(form, base):
    coat = Coat(alpha=1e-3, eta=1.0)
    coated = Stack((coat,), base) if form is None else Stack((coat,), base, form)
    np.testing.assert_allclose(rows(coated), rows(Stack((), base)), rtol=1e-9)


def albedo(stack, theta, count=8192):
    """What leaves of light from one direction."""
    u, v = (np.arange(count) + 0.5) / count, 2.0 * np.pi * ((np.arange(count) * 0.618033988749895) % 1.0)
    wo = np.stack([np.sqrt(u) * np.cos(v), np.sqrt(u) * np.sin(v), np.sqrt(1.0 - u)], -1)
    wi = np.broadcast_to([np.sin(theta), 0.0, np.cos(theta)], wo.shape)
    return float(np.mean(brdf_rows(stack.astype(np.float64), wi, wo)) * np.pi)


@pytest.mark.parametrize("kd", [0.2, 0.5, 0.8])
def test_a_white_base_of_two_parts_below_a_clear_coat_sends_all_light_back(kd):
    """Light goes to and fro between both parts. `edge` counts light of a lobe that leaves the escape cone; a mirror has none."""
    mirror = CookTorrance(kd=kd, ks=1.0 - kd, alpha=0.1, eta=0.02, k=15.0)  # facets that reflect all but .04 % of the light
    stack = Stack((Coat(alpha=0.02, eta=1.5),), mirror, Corrected(edge=False))
    assert albedo(stack, 0.3) == pytest.approx(1.0, abs=3e-3)


def test_a_published_base_that_gives_more_than_it_gets_is_white_at_most():
    """kd = 1 is an albedo of pi: the series over bounces would not end."""
    bright = Stack((varnish(tau=None),), Phong(kd=1.0, ks=1.0, scaling="faithful"))
    assert np.all(rows(bright) < 10.0)


@pytest.mark.parametrize("base", [LAFORTUNE, Phong(kd=WOOD), CookTorrance()], ids=["lafortune", "phong", "cook_torrance"])
def test_the_precise_form_refuses_them_and_says_why(base):
    kind = next(name for name, cls in BASES.items() if cls is type(base))
    document = {"model": "precise", "layers": [{"type": "coat"}], "base": {"type": kind}}
    with pytest.raises(InputError, match=r"base is neither diffuse alone .* nor a conductor"):
        stack_of(document, "here")
    del document["model"]
    assert "Corrected" in type(stack_of(document, "here").form).__name__


@pytest.mark.parametrize("name", [n for n in STACKS if n.split(",")[0] in BASES])
def test_presets_hold_them(name):
    stack = STACKS[name]
    document = preset_of(stack, "a")
    again = stack_of({"base": document["base"]}, "here")
    assert preset_of(again, "a") == document


def test_a_lobe_that_is_not_whole_is_refused():
    with pytest.raises(InputError, match="come together; cz_2 is missing"):
        stack_of({"base": {"type": "lafortune", "ks_2": 0.3, "cx_2": -1.0, "exponent_2": 5.0}}, "here")
    with pytest.raises(InputError, match="cy_3 belongs to ks_3"):
        stack_of({"base": {"type": "lafortune", "cy_3": 0.3}}, "here")


@pytest.mark.parametrize("name", APPROXIMATE)
def test_an_approximate_reflectance_prints_and_is_near_the_exact_one(gl, name):
    stack = APPROXIMATE[name]
    shader = print_material(stack, "test")
    parity = check_pairs(shader, 16384)
    assert parity.passed, parity
    *layers, base = (
        dataclasses.replace(x, fresnel="exact") if hasattr(x, "fresnel") else x for x in (*stack.layers, stack.base)
    )
    exact = rows(dataclasses.replace(stack, layers=tuple(layers), base=base))
    assert 0.0 < np.median(np.abs(rows(stack) - exact) / (exact + 1e-3)) < 0.06


@pytest.mark.parametrize("fresnel", ["schlick", "lazanyi"])
@pytest.mark.parametrize("dtype", DTYPES)
def test_approximations_have_derivatives_where_indices_match(fresnel, dtype):
    """And a coat of index 1 is no coat."""
    coat = Stack((Coat(alpha=0.1, eta=1.0, fresnel=fresnel),), Phong(kd=0.3)).astype(dtype)
    wi, wo = (jnp.asarray(w, dtype) for w in hemisphere(2, 5))
    value, slope = with_slope(lambda s: brdf(s, wi, wo), coat)
    assert np.all(np.isfinite(slope))
    np.testing.assert_allclose(value, brdf(Stack((), coat.base), wi, wo), rtol=1e-4)


def test_what_is_fitted_once_cannot_be_a_uniform():
    with pytest.raises(InputError, match=r'base\.fresnel = "lazanyi" is fitted to the index once a material'):
        print_material(APPROXIMATE["conductor, Lazanyi"], "test", uniforms=True)


def test_a_shader_says_how_near_its_reflectance_is():
    assert (
        "// base: reflectance after Lazanyi and Szirmay-Kalos 2005, within 0.006 of"
        in print_material(APPROXIMATE["conductor, Lazanyi"], "test").text()
    )


def test_derived_numbers_are_no_keys_of_a_preset():
    with pytest.raises(InputError, match="lazanyi_a"):
        stack_of({"base": {"type": "conductor", "lazanyi_a": 0.3}}, "here")


def test_the_tables_of_the_precise_form_are_of_the_exact_reflectance():
    document = {"model": "precise", "layers": [{"type": "coat", "fresnel": "schlick"}], "base": {"type": "lambert"}}
    with pytest.raises(InputError, match="coat has the reflectance of schlick"):
        stack_of(document, "here")
