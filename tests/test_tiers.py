"""Other ways to print one material: their errors are true, their shaders are their own JAX functions, and they are as short as promised."""

import dataclasses
import functools

import jax
import numpy as np
import pytest

from helpers import COPPER, STACKS, needs_tools
from layerfit._directions import random_pairs, random_places
from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.render import brdf, brdf_values, predict
from layerfit.shader.choose import choose_tier
from layerfit.shader.cost import instructions
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs, shade_samples
from layerfit.stability.models import structures
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Flakes, Lambert, OrenNayar
from layerfit.tiers.compact import refuses
from layerfit.tiers.polynomial import Curve, Polynomial
from layerfit.tiers.tier import TIERS, WALK, make_tier
from layerfit.walk import walked
from test_export import DISTANT, INTENSITY, IRRADIANCE, POINT, agree, by_jax, drawn, with_lights

LACQUER = Coat(alpha=0.1, eta=1.5, tau=[0.05, 0.2, 0.6])
METAL, PAPER = Conductor(alpha=0.2, **COPPER), Lambert(albedo=[0.5, 0.3, 0.1])
MATERIALS = {
    "corrected, metal": (Stack((LACQUER,), METAL, Corrected()), 1e-4),
    "precise, metal": (Stack((LACQUER,), METAL, Precise()), 1e-4),
    "corrected, diffuse": (Stack((LACQUER,), PAPER, Corrected()), 1e-4),
    "precise, diffuse": (Stack((LACQUER,), PAPER, Precise()), 1e-3),
    "faithful, metal": (Stack((LACQUER,), METAL, Faithful()), 1e-4),
    "faithful, diffuse": (Stack((LACQUER,), PAPER, Faithful()), 1e-4),
    "faithful, clear and grey": (Stack((Coat(alpha=0.2, eta=1.4),), Conductor(alpha=0.3, eta=0.2, k=3.5), Faithful()), 1e-4),
    "corrected, clear and grey": (Stack((Coat(alpha=0.2, eta=1.4),), Conductor(alpha=0.3, eta=0.2, k=3.5), Corrected()), 1e-4),
    "corrected, grooves": (Stack((LACQUER,), OrenNayar(albedo=[0.5, 0.3, 0.1], sigma=0.4), Corrected()), 1e-3),
    "precise, grooves": (Stack((LACQUER,), OrenNayar(albedo=[0.5, 0.3, 0.1], sigma=0.4), Precise()), 1e-3),
    "precise, short grooves": (
        Stack((LACQUER,), OrenNayar(albedo=0.4, sigma=0.6, form="qualitative"), Precise()),
        1e-3,
    ),
    "bare, film": (Stack((), Conductor(alpha=0.2, film_nm=300.0, film_eta=2.4, **COPPER)), 1e-3),
    "corrected, flakes": (
        Stack((LACQUER,), Flakes(alpha=0.1, sigma=0.2, coverage=0.6, albedo=[0.1, 0.2, 0.3], **COPPER), Corrected()),
        1e-3,
    ),
    "corrected, Beckmann": (Stack((LACQUER,), Conductor(alpha=0.2, distribution="beckmann", **COPPER), Corrected()), 1e-3),
    "corrected, two coats": (Stack((Coat(name="clear", alpha=0.05, eta=1.4), LACQUER), METAL, Corrected()), 1e-3),
    "corrected, film": (
        Stack((dataclasses.replace(LACQUER, film_nm=150.0, film_eta=2.1),), PAPER, Corrected()),
        1e-3,
    ),
    "precise, clear and grey": (Stack((Coat(alpha=0.2, eta=1.4),), Conductor(alpha=0.3, eta=0.2, k=3.5), Precise()), 1e-3),
}

INSTRUCTIONS = {
    "faithful, metal": 106,
    "faithful, diffuse": 90,
    "corrected, metal": 206,
    "corrected, diffuse": 100,
    "precise, metal": 330,
    "precise, diffuse": 112,
    "corrected, grooves": 190,
    "precise, grooves": 200,
    "precise, short grooves": 155,
    "corrected, film": 100,
    "bare, film": 80,
    "corrected, flakes": 355,
    "corrected, Beckmann": 250,
    "corrected, two coats": 330,
}
"""At most, of the whole fragment shader with one light, after spirv-opt -O; Phong has 27."""

ROUNDING = 2e-5
"""Of float32, in which tiers are evaluated here; their own errors are of float64."""


@functools.cache
def made(name):
    """The compact tier of one of the materials."""
    stack, asked = MATERIALS[name]
    return make_tier(stack, "compact", asked)


@pytest.mark.parametrize("name", ["corrected, metal", "precise, diffuse", "precise, grooves", "corrected, flakes"])
def test_the_error_that_is_stated_is_true(name):
    stack, asked = MATERIALS[name]
    wi, wo = random_pairs(8192, seed=7)
    place = random_places(8192, seed=7) if stack.reads else None
    double = jax.tree.map(lambda a: a.astype(float), (wi, wo, place))
    exact = np.asarray(brdf(stack.astype(np.float64), *double))
    values = predict(made(name).stack, wi[:, None], wo, np.ones((len(wi), 1, 3), np.float32), place)
    error = np.abs(values - exact) / np.maximum(np.abs(exact), 1e-4 / np.pi)
    assert error.max() <= 1.2 * made(name).error + ROUNDING
    assert made(name).error <= asked


@pytest.mark.parametrize("name", MATERIALS)
def test_the_shader_is_the_jax_function(gl, name):
    shader = print_material(made(name).stack, "test")
    parity = check_pairs(shader, 16384)
    assert parity.passed, parity
    assert f"within {made(name).error:.1e}" in shader.text()


@pytest.mark.parametrize("name", MATERIALS)
def test_below_the_surface_there_is_nothing(gl, name):
    shader = print_material(made(name).stack, "test")
    wi, wo = random_pairs(3000, seed=8)
    wi[1000:, 2] *= -1.0  # the light below, and both
    wo[:2000, 2] *= -1.0  # the viewer below, and both
    place = random_places(3000, seed=8) if shader.stack.reads else None
    values = shade_samples(shader, wi[:, None], wo, np.ones((3000, 1, 3), np.float32), place)
    assert np.all(values == 0.0)


def test_the_exported_shader_draws_it_without_a_frame(gl):
    stack = made("corrected, metal").stack
    text = print_material(stack, "test").text()
    assert "mat3" not in text
    lights = [(DISTANT, IRRADIANCE), (POINT, INTENSITY)]
    agree(drawn(with_lights(text, 2), lights), by_jax(stack, lights))


@needs_tools
@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_how_many_instructions(name):
    assert 2 * 27 < instructions(print_material(made(name).stack, "test")).total <= INSTRUCTIONS[name]


@pytest.fixture(scope="module")
def paper():
    """Tables of the faithful form, as few entries as take 2e-3."""
    return make_tier(MATERIALS["faithful, metal"][0], "tables", 2e-3)


def test_tables_are_as_small_as_the_error_allows(paper):
    stack = MATERIALS["faithful, metal"][0]
    assert paper.table_bytes == 4 * 5 * 64
    assert 1e-4 < paper.error <= 2e-3
    finer = make_tier(stack, "tables", entries=128)
    assert finer.table_bytes == 2 * paper.table_bytes
    # Linear interpolation: half as far apart, four times as near.
    assert finer.error == pytest.approx(paper.error / 4.0, rel=0.3)
    assert make_tier(stack, "tables").table_bytes == 4 * 5 * 256


def test_the_shader_of_tables(gl, paper):
    shader = print_material(paper.stack, "test")
    parity = check_pairs(shader, 16384)
    assert parity.passed, parity
    assert "const vec4 lf_row1[64] = vec4[64](" in shader.text("essl300")
    assert "Tables of 64 entries, 1.3 kB" in shader.text()
    stack, (wi, wo) = MATERIALS["faithful, metal"][0], random_pairs(8192, seed=7)
    exact = brdf_values(stack, wi, wo)
    error = np.abs(brdf_values(paper.stack, wi, wo) - exact) / np.maximum(np.abs(exact), 1e-4 / np.pi)
    assert 0.3 * paper.error < error.max() <= 1.2 * paper.error


def test_tables_that_there_are_not():
    with pytest.raises(InputError, match="is diffuse"):
        make_tier(MATERIALS["faithful, diffuse"][0], "tables")
    with pytest.raises(InputError, match="stays at"):
        make_tier(MATERIALS["corrected, metal"][0], "tables", 1e-3)
    with pytest.raises(InputError, match="2 to 4096"):
        make_tier(MATERIALS["faithful, metal"][0], "tables", entries=1)


def test_degrees_are_as_low_as_the_error_allows():
    stack, asked = MATERIALS["corrected, metal"]
    coarse = make_tier(stack, "compact", 30.0 * asked)
    curves = lambda tier: jax.tree.leaves(tier.stack.base, is_leaf=lambda x: isinstance(x, Polynomial))  # noqa: E731
    degrees = lambda tier: [curve.degree for curve in curves(tier) if isinstance(curve, Polynomial)]  # noqa: E731
    fine, rough = degrees(made("corrected, metal")), degrees(coarse)
    assert len(rough) == len(fine) == 6
    assert sum(rough) < sum(fine) - 3
    assert made("corrected, metal").error < coarse.error <= 30.0 * asked


@pytest.mark.parametrize(
    ("stack", "said"),
    [
        (STACKS["corrected, anisotropic"], "not isotropic GGX"),
        (
            Stack((LACQUER, dataclasses.replace(LACQUER, name="b"), dataclasses.replace(LACQUER, name="c")), METAL),
            "more than two",
        ),
        (
            Stack((LACQUER, dataclasses.replace(LACQUER, name="b")), METAL, Precise()),
            "made for the corrected form, not the precise",
        ),
        (Stack((), PAPER), "no coat"),
        (Stack((LACQUER,), METAL, Faithful(refract_at="n")), "the faithful form as published"),
        (Stack((LACQUER,), OrenNayar(), Faithful()), "not the same from all sides"),
        (Stack((LACQUER,), PAPER, Precise()), "its error stays at"),
    ],
)
def test_what_has_no_compact_tier_says_why(stack, said):
    with pytest.raises(InputError, match=said):
        make_tier(stack)


def test_short_fresnel_formulas_and_the_faithful_form():
    stack = MATERIALS["corrected, metal"][0]
    errors = {name: make_tier(stack, name).error for name in TIERS if name != "compact"}
    assert errors["exact"] == 0.0
    assert 1e-3 < errors["lazanyi"] < errors["schlick"] < errors["faithful"]
    with pytest.raises(InputError, match="would not differ"):
        make_tier(MATERIALS["precise, diffuse"][0], "schlick")
    with pytest.raises(InputError, match="is asked for"):
        make_tier(stack, "faithful", 1e-2)
    with pytest.raises(InputError, match="should be one of exact"):
        make_tier(stack, "compct")  # pyright: ignore[reportArgumentType]


def test_the_random_walk_is_a_tier_to_evaluate():
    """A bare surface is its own truth, and a coated one is what the nearest form says, but for noise."""
    paper = Lambert(albedo=[0.5, 0.3, 0.1])
    wi, wo = random_pairs(600, seed=3)
    bare = walked(Stack((), paper), "bare")(wi, wo)
    np.testing.assert_allclose(bare.mean, np.broadcast_to(np.array([0.5, 0.3, 0.1]) / np.pi, bare.mean.shape), rtol=1e-6)
    assert not np.any(bare.se)
    lacquered = walked(MATERIALS["precise, diffuse"][0], "lacquered", 20000)(wi[:40], wo[:40])
    exact = brdf_values(MATERIALS["precise, diffuse"][0], wi[:40], wo[:40])
    assert np.all(lacquered.se > 0.0)
    assert np.median(np.abs(lacquered.mean - exact) / exact) < 0.02
    with pytest.raises(InputError, match="too many for one command"):
        walked(MATERIALS["precise, diffuse"][0], "lacquered", 10**9)(wi, wo)
    with pytest.raises(InputError, match="no shader does the random walk: layerfit render and eval take --tier walk"):
        make_tier(MATERIALS["precise, diffuse"][0], WALK)  # pyright: ignore[reportArgumentType]


@needs_tools
def test_the_cheapest_that_is_near_enough():
    stack = MATERIALS["corrected, diffuse"][0]
    assert choose_tier(stack, "test", max_error=1e-4).tier.name == "compact"
    assert choose_tier(stack, "test", max_error=1e-9).tier.name == "exact"
    assert choose_tier(stack, "test", max_cost=4.0).tier.name == "compact"
    assert choose_tier(stack, "test", max_cost=40.0).tier.name == "exact"
    with pytest.raises(InputError, match="no tier costs 1 times Phong or less"):
        choose_tier(stack, "test", max_cost=1.0)


def test_a_polynomial_of_its_own_degree_is_found_again():
    x = np.linspace(0.2, 1.7, 50)
    p = Curve(x, np.stack([1.0 - 2.0 * x + x**3, 0.5 * x**2], -1)).fit(3)
    assert p.degree == 3
    np.testing.assert_allclose(np.asarray(p(0.7)), [1.0 - 1.4 + 0.343, 0.245], rtol=1e-12)
    assert dataclasses.astuple(Curve(x, x).fit(1, 4))[4:] == (None,) * 7


@pytest.mark.parametrize("name", structures())
def test_every_structure_is_refused_in_words_or_not_at_all(name):
    reason = refuses(structures()[name])
    assert reason is None or " " in reason
