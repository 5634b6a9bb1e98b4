"""What a material does without costs nothing and changes nothing: one with the part at nothing against one that never had it."""

import dataclasses
from typing import NamedTuple

import jax
import numpy as np
import pytest

from helpers import COPPER, STACKS, brdf_rows, hemisphere, needs_tools, varnish
from layerfit.fit.parameters import free_by_default, parametrise
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.shader.cost import instructions, tools
from layerfit.shader.export import print_material
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Dielectric, Flakes, Lambert, OrenNayar

METAL = Conductor(alpha=0.2, **COPPER)
WOOD = Lambert(albedo=[0.5, 0.28, 0.13])
CLEAR = varnish(tau=None)


class Without(NamedTuple):
    """A material with a part at nothing, one that lacks the part, and how far apart their values may be, relative."""

    full: Stack
    less: Stack
    rel: float = 1e-13


def _grey(value: float) -> list[float]:
    return [value, value, value]


LEFT_OUT = {
    "absorption": Without(Stack((varnish(tau=_grey(0.0)),), METAL), Stack((CLEAR,), METAL)),
    "absorption, precise": Without(
        Stack((varnish(tau=_grey(0.0)),), METAL, Precise()), Stack((CLEAR,), METAL, Precise()), 1e-12
    ),
    "absorption, diffuse": Without(Stack((varnish(tau=_grey(0.0)),), WOOD), Stack((CLEAR,), WOOD)),
    "scattering": Without(Stack((varnish(tau_s=0.0, g=0.5),), METAL), Stack((varnish(),), METAL), 1e-6),
    "coat, faithful": Without(Stack((Coat(alpha=0.01, eta=1.0, tau=0.0),), METAL, Faithful()), Stack((), METAL), 1e-12),
    "coat, diffuse": Without(Stack((Coat(alpha=0.01, eta=1.0, tau=0.0),), WOOD), Stack((), WOOD), 1e-12),
    "anisotropy": Without(
        Stack(
            (varnish(alpha=None, alpha_x=0.1, alpha_y=0.1),), dataclasses.replace(METAL, alpha=None, alpha_x=0.2, alpha_y=0.2)
        ),
        Stack((varnish(),), METAL),
    ),
    "colour of the absorption": Without(Stack((varnish(tau=_grey(0.3)),), WOOD), Stack((varnish(tau=0.3),), WOOD)),
    "colour of a base": Without(Stack((varnish(),), Lambert(albedo=_grey(0.4))), Stack((varnish(),), Lambert(albedo=0.4))),
    "roughness of a diffuse base": Without(Stack((), OrenNayar(albedo=0.4, sigma=0.0)), Stack((), Lambert(albedo=0.4))),
    "black base": Without(Stack((varnish(),), Lambert(albedo=0.0)), Stack((), Dielectric(alpha=0.1, eta=1.5)), 1e-12),
    "base under an opaque coat": Without(
        Stack((varnish(tau=_grey(40.0)),), WOOD), Stack((), Dielectric(alpha=0.1, eta=1.5)), 1e-12
    ),
    "flakes": Without(
        Stack((), Flakes(coverage=0.0, albedo=[0.02, 0.05, 0.3], **COPPER)), Stack((), Lambert(albedo=[0.02, 0.05, 0.3])), 1e-12
    ),
    "bounces": Without(
        Stack((Coat(alpha=0.2, eta=1.0, tau=0.3),), METAL, Corrected(orders=2, rough_interface=False)),
        Stack((Coat(alpha=0.2, eta=1.0, tau=0.3),), METAL, Corrected(orders=0, rough_interface=False)),
        1e-12,
    ),
    "thickness of its own": Without(
        Stack((varnish(tau=None, absorption_per_mm=[1.0, 4.0, 12.0], thickness_um=50.0),), WOOD),
        Stack((varnish(tau=[0.05, 0.2, 0.6]),), WOOD),
    ),
}


@pytest.mark.parametrize("name", LEFT_OUT)
def test_the_values_are_the_same_to_the_last_bits(name):
    full, less, rel = LEFT_OUT[name]
    wi, wo = hemisphere(64, 10), hemisphere(64, 11)
    values = brdf_rows(less.astype(np.float64), wi, wo)
    np.testing.assert_allclose(brdf_rows(full.astype(np.float64), wi, wo), values, rtol=rel, atol=1e-15)


@needs_tools
@pytest.mark.parametrize("name", LEFT_OUT)
def test_the_shader_is_shorter(name):
    """Fewer instructions and lines; without a colour as many, of scalars."""
    with_part, without = (print_material(stack, "m", "uniforms") for stack in LEFT_OUT[name][:2])
    assert without.functions.count("\n") <= with_part.functions.count("\n")
    if name == "thickness of its own":  # with a distance that is known, absorption and thickness are one number
        assert without.functions == with_part.functions
    elif name.startswith("colour"):
        assert sum(map(np.size, without.uniforms.values())) < sum(map(np.size, with_part.uniforms.values()))
    else:
        assert instructions(without).total < instructions(with_part).total


@pytest.mark.parametrize("name", [name for name in LEFT_OUT if name != "bounces"])
def test_a_fit_has_fewer_columns(name):
    """A field that is not there has no derivative to take."""
    sizes = [len(jax.tree.leaves(stack)) for stack in LEFT_OUT[name][:2]]
    columns = [parametrise(stack, free_by_default(stack), (), "test")[1].size for stack in LEFT_OUT[name][:2]]
    assert columns[1] <= columns[0]
    colours = name.startswith("colour")
    assert sizes[1] < sizes[0] or colours


COUNTED_BY = "glslang 11:12.0.0, SPIRV-Tools v2023.1"
"""Other versions of these tools optimise otherwise."""

INSTRUCTIONS = {
    "lambert": 23,
    "conductor": 75,
    "dielectric": 65,
    "corrected over lambert": 131,
    "corrected over conductor": 299,
    "corrected, clear coat": 289,
    "corrected, anisotropic": 368,
    "corrected, three layers": 504,
    "precise over lambert": 197,
    "precise over conductor": 414,
    "faithful over conductor": 129,
    "flakes": 277,
    "corrected over flakes": 762,
}
"""Of shaders under one light, after spirv-opt -O: the same on every machine, so that a longer shader does not go unseen."""


@needs_tools
@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_instructions(name):
    if tools() != COUNTED_BY:
        pytest.skip(f"instructions are known for {COUNTED_BY}; here is {tools()}")
    assert instructions(print_material(STACKS[name], "m")).total == INSTRUCTIONS[name]


@needs_tools
@pytest.mark.parametrize("form", [Corrected(), Faithful()], ids=lambda form: type(form).__name__)
def test_cost_grows_linearly_with_layers_and_lights(form):
    """Each further coat adds about, and each further light exactly, what the one before it added."""

    def count(coats: int, lights: int = 1) -> int:
        layers = tuple(
            Coat(name=f"coat{k}", alpha=0.05 + 0.03 * k, eta=1.3 + 0.1 * k, tau=[0.1, 0.2, 0.3]) for k in range(coats)
        )
        return instructions(print_material(Stack(layers, METAL, form), "m"), lights).total

    added = np.diff([count(k) for k in range(1, 7)])
    assert np.ptp(added) <= 0.08 * added.mean(), "the optimiser shares a little more here and there"
    by_lights = [count(1, lights) for lights in (1, 2, 4, 8)]
    light = by_lights[1] - by_lights[0]
    assert [n - by_lights[0] for n in by_lights] == [0, light, 3 * light, 7 * light]
    assert light < by_lights[0]
