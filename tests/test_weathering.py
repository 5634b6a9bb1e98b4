"""Weathered metal: the operators of its history, and the light of what they leave."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, compiles, direction, every_text, hemisphere
from layerfit._compiled import Compiled
from layerfit._place import Place
from layerfit.errors import InputError
from layerfit.forms import weathering
from layerfit.forms.weathering import coat, erode, polish
from layerfit.layers import Coat, Deposit, Erosion, Overgrowth, Polish
from layerfit.optics.scattering import kubelka_munk_infinite
from layerfit.preset import preset_of, stack_of
from layerfit.render import brdf
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert

METAL = Conductor(alpha=0.2, **COPPER)
TARNISH = Deposit("tarnish", thickness_um=6.0, K_per_mm=[30.0, 60.0, 120.0], S_per_mm=10.0, alpha=0.3, eta=1.8)
VERDIGRIS = Overgrowth("verdigris", softness=0.05, K_per_mm=[20.0, 2.0, 6.0], S_per_mm=[40.0, 60.0, 50.0])
HISTORIES = {
    "all steps": Stack((Polish(height_um=8.0, strength=0.6), Erosion(amount_um=4.0), VERDIGRIS, TARNISH), METAL),
    "one deposit": Stack((Deposit(),), METAL),
    "exposed": Stack((dataclasses.replace(VERDIGRIS, exposure=0.8),), METAL),
}


def lying(*rows):
    """A stack of (pigment, thickness, alpha)."""
    return tuple(weathering.Lying(p, jnp.float64(t), jnp.float64(a)) for p, t, a in rows)


def pigment(alpha=0.4):
    stack = Stack((Deposit(alpha=alpha),), METAL).astype(np.float64)
    return stack.prepare().steps[0]


def thicknesses(stack):
    return [float(x.thickness) for x in stack]


def test_a_coat_thickens_its_like_and_covers_others():
    a, b = pigment(), pigment()
    stack = coat(coat(coat((), a, 2.0), a, 3.0), b, 1.0)
    assert thicknesses(stack) == [5.0, 1.0]
    assert thicknesses(coat(stack, a, 4.0)) == [5.0, 1.0, 4.0]


def test_erosion_goes_from_the_top_down_and_ends_at_the_metal():
    stack = lying((pigment(), 5.0, 0.4), (pigment(), 2.0, 0.4))
    assert [thicknesses(erode(stack, x)) for x in (0.0, 1.5, 3.0, 9.0)] == [[5.0, 2.0], [5.0, 0.5], [4.0, 0.0], [0.0, 0.0]]


def test_polish_levels_what_lies_open_alone():
    hidden = polish(lying((pigment(), 30.0, 0.4), (pigment(), 20.0, 0.4)), 8.0, 0.5)
    np.testing.assert_allclose(thicknesses(hidden), [30.0, 8.0], rtol=1e-12)
    np.testing.assert_allclose([float(x.alpha) for x in hidden], [0.4, 0.2], rtol=1e-12)
    open_ = polish(lying((pigment(), 30.0, 0.4), (pigment(), 0.0, 0.4)), 8.0, 0.5)
    np.testing.assert_allclose(thicknesses(open_), [8.0, 0.0], rtol=1e-12)
    assert thicknesses(polish(lying((pigment(), 5.0, 0.4)), 8.0, 0.5)) == [5.0]


def values(stack, place=None):
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    return np.asarray(brdf(stack.astype(np.float64), wi, wo, place))


def test_what_has_come_off_again_leaves_the_metal():
    stack = Stack((Erosion(amount_um=50.0), TARNISH), METAL)
    np.testing.assert_allclose(values(stack), values(Stack((), METAL)), rtol=1e-12)


def test_a_thick_deposit_hides_the_metal():
    """Then it is a body of Kubelka and Munk's infinite albedo below its boundary, whose light returns in a series."""
    thick = dataclasses.replace(TARNISH, thickness_um=5e3)
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    R = kubelka_munk_infinite(jnp.asarray(TARNISH.K_per_mm), jnp.asarray(10.0))
    coated = Stack((Coat(alpha=0.3, eta=1.8),), Lambert(albedo=R), _smooth()).astype(np.float64)
    top = lambda stack: np.asarray(jax.vmap(stack.layers[0].evaluate)(wi, wo))[:, None]  # noqa: E731
    np.testing.assert_allclose(values(Stack((thick,), METAL)) - top(coated), values(coated) - top(coated), rtol=1e-9)


def _smooth():
    from layerfit.forms.corrected import Corrected

    return Corrected(rough_interface=False)


def test_more_is_more_of_the_same():
    """A deposit in two halves is the deposit."""
    half = dataclasses.replace(TARNISH, thickness_um=3.0)
    twice = Stack((dataclasses.replace(half, name="second"), half), METAL)
    np.testing.assert_allclose(values(twice), values(Stack((TARNISH,), METAL)), rtol=1e-12)


@pytest.mark.parametrize("name", HISTORIES)
def test_a_history_is_reciprocal_and_keeps_its_energy(name):
    stack = HISTORIES[name].astype(np.float64)
    u, v = (np.arange(4096) + 0.5) / 4096, (np.arange(4096) * 0.618033988749895) % 1.0
    x, y = np.sqrt(u) * np.cos(2.0 * np.pi * v), np.sqrt(u) * np.sin(2.0 * np.pi * v)
    wo, place = np.stack([x, y, np.sqrt(1.0 - u)], -1), Place(np.full((4096, 2), 0.3), sky=np.full(4096, 0.6))
    for theta in (5.0, 70.0):
        wi = np.broadcast_to(direction(theta), wo.shape)
        there = np.asarray(brdf(stack, wi, wo, place))
        np.testing.assert_allclose(there, brdf(stack, wo, wi, place), rtol=1e-11)
        assert np.all(np.pi * there.mean(0) < 1.0)


@pytest.mark.parametrize("name", HISTORIES)
def test_parity_of_a_history(gl, name):
    shader = print_material(HISTORIES[name], "test")
    parity = check_pairs(shader, 16384)
    assert parity.passed, parity
    assert ("vec2 uv" in shader.functions) == (name != "one deposit")
    assert ("float sky" in shader.functions) == (name == "exposed")
    assert "form" not in shader.text().partition("\n//\n")[0]


@pytest.mark.parametrize("name", HISTORIES)
def test_a_history_validates(name, tmp_path):
    compiles(tmp_path, every_text(HISTORIES[name]))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_history_has_finite_derivatives_at_its_edges(dtype):
    """Nothing on the metal, all of it worn, no scattering, grazing light."""
    stack = HISTORIES["all steps"]
    edges = np.array([[0.0, 0.0, 1.0], [np.sqrt(1 - 1e-8), 0.0, 1e-4], [-np.sqrt(1 - 1e-8), 0.0, 1e-4]], dtype)
    wi, wo, uv = np.repeat(edges, 3, 0), np.tile(edges, (3, 1)), np.linspace(-1.0, 1.0, 18, dtype=dtype).reshape(9, 2)
    slopes_of = Compiled(lambda stack, step: jax.jvp(lambda s: brdf(s, wi, wo, Place(uv)), (stack,), (step,)))
    for years, eroded, scatter in [(0.0, 4.0, 10.0), (20.0, 1e3, 10.0), (20.0, 0.0, 0.0), (1e4, 4.0, 0.0)]:
        layers = (
            stack.layers[0],
            dataclasses.replace(stack.layers[1], amount_um=eroded),
            dataclasses.replace(stack.layers[2], years=years),
            dataclasses.replace(stack.layers[3], S_per_mm=scatter),
        )
        inputs = dataclasses.replace(stack, layers=layers).astype(dtype)
        found, slopes = slopes_of(inputs, jax.tree.map(jnp.ones_like, inputs))
        assert np.all(np.isfinite(found))
        assert np.all(np.isfinite(slopes))


def test_what_sees_less_of_the_sky_is_younger():
    exposed = HISTORIES["exposed"]
    younger = dataclasses.replace(VERDIGRIS, years=VERDIGRIS.years * (1.0 - 0.8 * 0.75))
    uv = np.random.default_rng(0).uniform(-1.0, 1.0, (64, 2))
    there = values(exposed, Place(uv, sky=np.full(64, 0.25)))
    np.testing.assert_allclose(there, values(Stack((younger,), METAL), Place(uv)), rtol=1e-12)


def test_a_history_is_written_and_read():
    document = preset_of(HISTORIES["all steps"], "all")
    assert [layer["type"] for layer in document["layers"]] == ["polish", "erosion", "overgrowth", "deposit"]
    assert document["left_out"] == ["base: anisotropy"]
    again = stack_of({key: document[key] for key in ("model", "layers", "base")}, "preset")
    np.testing.assert_array_equal(again.layers[3].K_per_mm, [30.0, 60.0, 120.0])


@pytest.mark.parametrize(
    ("layers", "base", "message"),
    [
        (["coat", "deposit"], "conductor", "coat lies among steps"),
        (["erosion"], "conductor", "no deposit or overgrowth"),
        (["deposit"], "lambert", "here the base is Lambert"),
    ],
)
def test_what_is_no_history_is_refused(layers, base, message):
    with pytest.raises(InputError, match=message):
        stack_of({"layers": [{"type": kind} for kind in layers], "base": {"type": base}}, "scene")
