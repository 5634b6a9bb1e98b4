"""Costs of shaders: instructions are counted the same every time, times are taken beside Phong, and what is at fault is said."""

import numpy as np
import pytest

from helpers import STACKS, needs_tools
from layerfit.errors import InputError, MachineError
from layerfit.shader import cost
from layerfit.shader.cost import cost_text, instructions, phong, times, tools
from layerfit.shader.export import print_material

PHONG, PHONG_LIGHT = 27, 18
"""Instructions of the hand-written shader under one light, and for each one more."""


@needs_tools
@pytest.mark.parametrize("lights", [1, 2, 8])
def test_phong_by_instructions(lights):
    found = instructions(phong(), lights)
    assert found.total == PHONG + PHONG_LIGHT * (lights - 1)
    assert sum(found.kinds.values()) == found.total
    assert found.kinds["Pow"] == lights


@needs_tools
def test_what_lights_share_is_counted_once():
    shader = print_material(STACKS["corrected over lambert"], "m")
    one, two, three = (instructions(shader, lights).total for lights in (1, 2, 3))
    assert one < two < three
    assert two - one < one, "the view is normalised again for every light"
    assert three - two == two - one


@needs_tools
def test_the_tools_have_names():
    assert "SPIRV-Tools v" in tools()


def test_tools_that_are_absent(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MachineError, match=r"glslangValidator was not found.*apt-get install"):
        instructions(phong())


@needs_tools
def test_a_shader_that_is_not_one():
    shader = phong()
    broken = type(shader)(shader.name, shader.stack, "not a shader", {})
    with pytest.raises(MachineError, match="glslangValidator does not take the shader"):
        instructions(broken)


@pytest.mark.parametrize("lights", [0, 9])
def test_lights_that_are_not_measured(lights):
    with pytest.raises(InputError, match=f"{lights} lights"):
        cost_text(phong(), lights)


@pytest.mark.parametrize("name", ["corrected, anisotropic", "flakes", "corrected over conductor"])
def test_times_are_relative_to_phong(gl, name, monkeypatch):
    """On a small target, and for all that a material may read. How long one takes is for a benchmark to say, not for a test."""
    monkeypatch.setattr(cost, "LEAST_MS", 1.0)
    monkeypatch.setattr(cost, "SIDE", 128)
    found = times({"phong": phong(), name: print_material(STACKS[name], "m")}, lights=2, rounds=5)
    assert all(np.all(np.isfinite(t.ratios)) and t.ratios.shape == (5,) and t.milliseconds > 0.0 for t in found.values())
    low, high = found[name].spread
    assert low <= found[name].median <= high
    assert found[name].renderer
