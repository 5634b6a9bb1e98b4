"""Scene files and presets: what is read, and what is said when it cannot be."""

import json
from pathlib import Path

import numpy as np
import pytest

from helpers import STACKS
from layerfit.capture.scene import Directional, EnvironmentMap, Point
from layerfit.capture.scene_file import read_scene
from layerfit.documents import write_text
from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.preset import left_out, preset_of, read_preset, stack_of, write_preset

SCENE = """
[reference]
exr = "a.exr"
[camera]
position = [0.8, 0.6, 4.9]
look_at = [0, 0, 0]
up = [0, 1, 0]
vfov_deg = 26
[[light]]
type = "directional"
to_light = [0, 3, 4]
irradiance_rgb = [3, 2, 1]
[material]
model = "corrected"
[[material.layers]]
type = "coat"
name = "coat"
alpha = 0.1
eta = 1.5
tau = [0.1, 0.2, 0.3]
[material.base]
type = "conductor"
name = "base"
alpha = 0.2
eta = [0.2, 0.9, 1.1]
k = [3.9, 2.4, 2.1]
[fit]
free = ["coat.alpha"]
"""


@pytest.fixture
def scene(tmp_path):
    """Write a scene with one text replaced, and read it."""

    def read(old="", new="", text=SCENE):
        assert old in text
        path = tmp_path / "scene.toml"
        path.write_text(text.replace(old, new, 1) if old else text)
        return read_scene(path)

    return read


def test_a_scene_is_read(scene, tmp_path):
    s = scene()
    (reference,) = s.references
    assert reference.exr == tmp_path / "a.exr"
    assert reference.camera.vfov_deg == 26.0
    assert reference.lights == (Directional((0.0, 0.6, 0.8), (3.0, 2.0, 1.0)),)
    assert reference.geometry is None
    assert s.fit.free == ("coat.alpha",)
    assert [layer.name for layer in s.start.layers] == ["coat"]
    np.testing.assert_array_equal(s.start.layers[0].tau, [0.1, 0.2, 0.3])


def test_a_path_may_be_text(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    assert read_scene(str(path)).references == read_scene(path).references


def test_json_is_read_like_toml(tmp_path):
    import tomllib

    path = tmp_path / "scene.json"
    path.write_text(json.dumps(tomllib.loads(SCENE)))
    assert read_scene(path).references[0].lights[0].irradiance_rgb == (3.0, 2.0, 1.0)


def test_several_references_share_or_override(scene):
    text = SCENE.replace(
        '[reference]\nexr = "a.exr"',
        '[[reference]]\nexr = ["a.exr", "b.exr"]\n[[reference]]\nexr = "c.exr"\n'
        'thickness_scale = { coat = 4 }\nlight = { type = "point", position = [1, 2, 3], intensity_rgb = [1, 1, 1] }',
    )
    s = scene(text=text)
    assert [r.exr.name for r in s.references] == ["a.exr", "b.exr", "c.exr"]
    assert isinstance(s.references[2].lights[0], Point)
    assert s.references[2].thickness_scale == {"coat": 4.0}
    assert s.references[0].thickness_scale == {}


def test_an_environment_map_is_named_from_the_scene(scene, tmp_path):
    s = scene(
        'type = "directional"\nto_light = [0, 3, 4]\nirradiance_rgb = [3, 2, 1]',
        'type = "envmap"\nfile = "studio.exr"\nscale = 2\nlayout = "lat-long, Y up"',
    )
    assert s.references[0].lights[0] == EnvironmentMap(tmp_path / "studio.exr", (2.0, 2.0, 2.0))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("vfov_deg = 26", "vfov_deg = 0", "vfov_deg.*between 0 and 180"),
        ("vfov_deg = 26", "fov = 26", "unknown key 'fov'.*did you mean 'vfov_deg'"),
        ("look_at = [0, 0, 0]", "look_at = [0.8, 0.6, 4.9]", "do not span a view"),
        ("[camera]", "[cameras]", "unknown key 'cameras'.*did you mean 'camera'"),
        ('exr = "a.exr"', "exr = 3", "exr = 3: should be text"),
        ('type = "directional"', 'type = "direction"', "did you mean 'directional'"),
        ("to_light = [0, 3, 4]", "to_light = [0, 0, 0]", "a direction is not zero"),
        ("to_light = [0, 3, 4]", "", "needs to_light"),
        (
            'type = "directional"\nto_light = [0, 3, 4]\nirradiance_rgb = [3, 2, 1]',
            'type = "disk"\ncenter = [0, 3, 4]\nhalf_u = [1, 0, 1]\nhalf_v = [-2, 0, -2]\nradiance_rgb = 1',
            "half_u and half_v lie along one line",
        ),
        ("irradiance_rgb = [3, 2, 1]", "irradiance_rgb = [3, -2, 1]", "light is not negative"),
        ("irradiance_rgb = [3, 2, 1]", "irradiance_rgb = [3, nan, 1]", "finite"),
        ('model = "corrected"', 'model = "correct"', "did you mean 'corrected'"),
        ("eta = 1.5", "eta = 0.5", "outside its range 1 to 3"),
        ("eta = 1.5", "eta = [1.5, 1.5, 1.5]", "one number for all channels"),
        ("eta = 1.5", "ior = 1.5", "unknown key 'ior'"),
        ("alpha = 0.1", "alpha = 0.1\nalpha_x = 0.1\nalpha_y = 0.2", "either alpha, or alpha_x and alpha_y"),
        ("alpha = 0.1", "alpha_x = 0.1", "one is missing"),
        ("tau = [0.1, 0.2, 0.3]", "absorption_per_mm = 1.0", "come together"),
        ("tau = [0.1, 0.2, 0.3]", "tau = 0.1\nabsorption_per_mm = 1.0\nthickness_um = 50", "either tau"),
        ('name = "coat"', 'name = "base"', "share a name"),
        ('name = "coat"', 'name = "a; discard;"', "letters, digits and underscores"),
        ('type = "conductor"', 'type = "copper"', "type = 'copper' is not one of"),
        ('free = ["coat.alpha"]', 'loss = "hubert"', "did you mean 'huber'"),
        ('free = ["coat.alpha"]', "starts = 0", "from 1 to 1000"),
        ('free = ["coat.alpha"]', "min_cosine = 1", "from 0 to below 1"),
        ('free = ["coat.alpha"]', 'free = "coat.alpha"', "a list of parameters"),
        ("[material.base]", "[material.basis]", "unknown key 'basis'"),
    ],
)
def test_a_fault_is_named(scene, old, new, message):
    with pytest.raises(InputError, match=message):
        scene(old, new)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[camera", "not valid TOML"),
        (b"\xff\xfe", "not UTF-8"),
        ("", r"there is no \[reference\]"),
        ("x" * 5_000_000, "too many"),
    ],
)
def test_a_file_that_is_no_scene(tmp_path, content, message):
    path = tmp_path / "scene.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=message):
        read_scene(path)


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_scene(tmp_path / "none.toml")


@pytest.mark.parametrize("name", STACKS)
def test_a_preset_says_all_of_a_material(name, tmp_path):
    path = tmp_path / "preset.json"
    write_preset(path, STACKS[name], "test")
    back = read_preset(path)
    assert preset_of(back, "test") == preset_of(STACKS[name], "test")
    assert back.form == STACKS[name].form


def test_a_scene_starts_from_a_preset(scene, tmp_path):
    write_preset(tmp_path / "start.json", STACKS["corrected over lambert"], "wood")
    head = SCENE.split("[material]")[0]
    assert scene(text=head + '[material]\npreset = "start.json"\n').start.form == Corrected()
    s = scene(text=head + '[material]\npreset = "start.json"\nmodel = "faithful"\noptions = { refract_at = "n" }\n')
    assert s.start.form == Faithful(refract_at="n")
    with pytest.raises(InputError, match="cannot be read"):
        scene(text=head + '[material]\npreset = "nowhere.json"\n')


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "other"}, "not a preset"),
        ({"version": 99}, "version 99.*reads version 1"),
        ({"colour": 1}, "unknown key 'colour'"),
        ({"base": None}, "should be a table"),
        ({"layers": {}}, "should be a list"),
        ({"options": {"order": 2}}, "did you mean 'orders'"),
    ],
)
def test_a_preset_that_is_none(tmp_path, change, message):
    path = tmp_path / "preset.json"
    path.write_text(json.dumps(preset_of(STACKS["corrected over lambert"], "test") | change))
    with pytest.raises(InputError, match=message):
        read_preset(path)


def test_left_out_in_words():
    words = left_out(STACKS["corrected, clear coat"])
    assert "coat: absorption" in words
    assert "base: anisotropy" in words
    assert "coat" in left_out(STACKS["lambert"])


def test_stack_of_names_the_place():
    with pytest.raises(InputError, match=r"here: base\.alpha = 7"):
        stack_of({"base": {"type": "conductor", "alpha": 7}}, "here")


def test_files_are_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_text(path, "first")

    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(InputError, match="No space left"):
        write_text(path, "second")
    assert path.read_text() == "first"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_shipped_scenes_are_read():
    from layerfit._data import references

    scenes = sorted(Path(references()).glob("*.toml"))
    assert len(scenes) >= 4
    for path in scenes:
        assert all(r.exr.is_file() for r in read_scene(path).references)
