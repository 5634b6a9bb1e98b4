"""What a scene does not need goes, what it needs stays, and what was done is said."""

import inspect
import json
import re

import numpy as np
import pytest

from commands import SCENE, layerfit, snapshot, write_reference
from helpers import COPPER, STACKS, needs_tools, varnish
from layerfit.preset import read_preset, write_preset
from layerfit.render import brdf
from layerfit.stack import Stack
from layerfit.study.removals import removals
from layerfit.surfaces import CarPaint, Conductor, Lambert

pytestmark = needs_tools

METAL = {"type": "conductor", "name": "base", "alpha": 0.3, "eta": [1.0, 1.0, 1.0], "k": [4.0, 2.5, 2.0]}
"""A metal without a grain, whose index is the same in all channels, and whose extinction is not."""

TRUTH = {"schema": "layerfit/preset", "version": 1, "name": "truth", "layers": [], "base": METAL}


@pytest.fixture(scope="module")
def ran(tmp_path_factory, gl):
    """A metal said in more words than it needs, in a scene of the metal."""
    folder = tmp_path_factory.mktemp("scene")
    scene = write_reference(folder, TRUTH)
    metal = Conductor(alpha=None, alpha_x=0.33, alpha_y=0.29, eta=[1.0, 1.0, 1.0], k=[4.0, 2.5, 2.0])
    write_preset(folder / "wordy.json", Stack((), metal), "wordy")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("layerfit.shader.cost.LEAST_MS", 0.1)
        patch.setattr("layerfit.shader.cost.SIDE", 64)
        yield (
            folder / "out",
            layerfit("specialise", folder / "wordy.json", scene, "--tolerance", "0.5%", "-o", folder / "out", "--json"),
        )


def test_what_is_not_needed_goes(ran):
    _, command = ran
    assert command.code == 0, command.err
    document = json.loads(command.out)
    rows = {row["what"]: row for row in document["tried"]}
    assert rows["base: anisotropy"]["removed"]
    assert rows["base: colour of eta"]["removed"]
    assert not rows["base: colour of k"]["removed"]
    assert rows["base: colour of k"]["growth"] > 0.005
    assert document["error"]["specialised"] < document["error"]["whole"], "the rest is fitted again"
    assert document["instructions"]["specialised"] < document["instructions"]["whole"]
    assert document["parity"]["passed"]


def test_what_is_left_is_written(ran):
    folder, command = ran
    assert set(snapshot(folder)) == {"preset.json", "material.frag", "specialise.json", "specialise.html"}
    assert json.loads((folder / "specialise.json").read_text(), parse_constant=pytest.fail) == json.loads(command.out)
    left = read_preset(folder / "preset.json")
    assert (left.base.alpha_x, np.shape(left.base.eta)) == (None, ())
    assert float(left.base.alpha) == pytest.approx(METAL["alpha"], rel=0.02)
    record = json.loads((folder / "preset.json").read_text())["fit"]["specialised"]
    assert {row["what"] for row in record["removed"]} >= {"base: anisotropy", "base: colour of eta"}
    assert "v_tangent" not in (folder / "material.frag").read_text()
    assert not re.search(r'(src|href)="(?!data:)', (folder / "specialise.html").read_text()), "it would fetch something"


@pytest.mark.parametrize("words", ['also = ["light.ambient"]', 'each = ["base.alpha"]', 'also = ["coat.thickness_scale"]'])
@pytest.mark.parametrize("command", ["specialise", "tradeoff"])
def test_what_a_scene_asks_beyond_the_material_is_refused_before_any_work(command, words, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace("starts = 3", words))
    ran = layerfit(command, "lacquered_copper", tmp_path / "scene.toml", "-o", tmp_path / "out")
    assert ran.code == 2
    assert f"fit asks for {words.split(chr(34))[1]}" in ran.err
    assert command in ran.err
    assert not (tmp_path / "out").exists()


def test_parts_of_a_coated_metal(monkeypatch):
    monkeypatch.setattr(inspect.getmodule(removals), "materials", lambda stack: {})  # `layerfit.study` is a function
    stack = Stack((varnish(tau_s=0.2, g=0.5),), Conductor(alpha=None, alpha_x=0.1, alpha_y=0.3, **COPPER))
    found = {removal.what: removal for removal in removals(stack)}
    assert set(found) >= {"coat: coat", "coat: absorption", "coat: scattering", "coat: colour of tau", "base: anisotropy"}
    assert found["coat: coat"].stack.layers == ()
    assert (found["coat: scattering"].stack.layers[0].tau_s, found["coat: scattering"].stack.layers[0].g) == (None, None)
    assert found["coat: colour of tau"].held == ("coat.tau",)
    assert np.shape(found["coat: colour of tau"].stack.layers[0].tau) == ()
    alone = found["base: anisotropy"].stack.base
    assert float(alone.alpha) == pytest.approx(np.sqrt(0.03))


def test_a_second_lobe_is_a_part():
    paint = CarPaint(kd=0.05, ks=0.06, ks_2=[0.1, 0.12, 0.13], f0_2=0.8, alpha_2=0.15)
    found = {removal.what: removal for removal in removals(Stack((), paint))}
    assert found["base: lobe 2"].stack.base.ks_2 is None


@pytest.mark.parametrize("name", ["conductor, anisotropic", "kubelka_munk", "phong", "flakes"])
def test_every_part_leaves_a_material(name):
    """That evaluates, to something else than it was or the same."""
    w = np.array([[0.3, 0.1, 0.9486833]])
    for removal in removals(STACKS[name]):
        assert np.all(np.isfinite(brdf(removal.stack, w, w))), removal.what


def test_nothing_to_leave_out():
    assert removals(Stack((), Lambert(albedo=0.5))) == []


@pytest.mark.parametrize("part", ["much", "0", "150%"])
def test_a_tolerance_is_a_part(tmp_path, part):
    scene = write_reference(tmp_path, TRUTH)
    ran = layerfit("specialise", tmp_path / "truth.json", scene, "--tolerance", part, "-o", tmp_path / "out")
    assert ran.code == 2
    assert "such as 0.5%" in ran.err
    assert not (tmp_path / "out").exists()
