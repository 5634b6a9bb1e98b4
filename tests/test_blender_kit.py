"""The script that users run in Blender: what it writes is read, what it cannot say it refuses, and Cycles draws the formula that is fitted.

Blender itself is not needed for most of it: a module that looks like `bpy` is enough. `LAYERFIT_BPY` names a Python that has the real one
(`uv venv --python 3.11 bpy && uv pip install --python bpy/bin/python bpy==5.0.1`).
"""

import importlib.util
import json
import math
import os
import subprocess
import sys
import types
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interchange import SAVE, STAGE

from commands import layerfit
from layerfit.capture.scene import Constant, Directional, Point, Rectangle, SphereLight
from layerfit.capture.scene_file import read_scene
from layerfit.interchange import blender, formats
from layerfit.interchange.mapping import alone
from layerfit.interchange.stage import draw, scene_views
from layerfit.stack import Stack
from layerfit.surfaces import Lambert

CYCLES = {"SUN": 0.02, "RECTANGLE": 0.04, "DISK": 0.04}
"""Relative L2 between Cycles and the formula: its sphere has facets, its pixels a filter, and 64 samples are noise. Under an area both sides draw
directions."""

FILM = 0.07
"""The same of a film."""

LAMPS: list[dict[str, Any]] = [
    {"type": "directional", "to_light": [0.0, 0.6, 0.8], "irradiance_rgb": [3.0, 2.0, 1.0]},
    {"type": "point", "position": [1.0, 2.0, 3.0], "intensity_rgb": [30.0, 30.0, 30.0]},
    {"type": "sphere", "center": [1.0, 2.0, 3.0], "radius": 0.5, "radiance_rgb": [9.0, 9.0, 9.0]},
    {
        "type": "rectangle",
        "center": [1.0, 2.0, 3.0],
        "half_u": [0.5, 0.0, 0.0],
        "half_v": [0.0, 0.4, 0.0],
        "radiance_rgb": [9.0, 9.0, 9.0],
    },
    {"type": "constant", "radiance_rgb": [0.1, 0.1, 0.1]},
]


@pytest.fixture
def kit(monkeypatch) -> Any:
    """The script as a module, with something in place of Blender."""
    stub: Any = types.ModuleType("bpy")
    stub.app = types.SimpleNamespace(version_string="5.0.1")
    monkeypatch.setitem(sys.modules, "bpy", stub)
    spec: Any = importlib.util.spec_from_loader("layerfit_kit", loader=None)
    module = importlib.util.module_from_spec(spec)
    exec(compile(formats.blender_kit(), "layerfit_kit.py", "exec"), module.__dict__)
    return module


@pytest.mark.wheel
def test_the_command_writes_the_script(tmp_path):
    ran = layerfit("blender-kit", "-o", tmp_path / "kit.py")
    assert ran.code == 0, ran.err
    text = (tmp_path / "kit.py").read_text()
    assert text == formats.blender_kit()
    assert "import layerfit" not in text  # Blender's Python has none
    compile(text, "kit.py", "exec")


def test_what_it_writes_is_a_scene(kit, tmp_path):
    camera = {"position": [0.0, -5.0, 0.5], "look_at": [0.0, -4.0, 0.4], "up": [0.0, 0.0, 1.0], "vfov_deg": 25.0}
    path = tmp_path / "ball.toml"
    path.write_text(kit.scene_file("ball.exr", 'a "ball"', camera, LAMPS))
    reference: Any = read_scene(path, Stack((), Lambert(), formats.read_start(_start(tmp_path)).form)).references[0]
    assert reference.exr == tmp_path / "ball.exr"
    assert reference.camera.vfov_deg == 25.0
    assert [type(light) for light in reference.lights] == [Directional, Point, SphereLight, Rectangle, Constant]
    assert reference.lights[1].intensity_rgb == (30.0, 30.0, 30.0)


def _start(folder: Path) -> Path:
    path = folder / "ball.principled.json"
    path.write_text(json.dumps({"schema": blender.SCHEMA, "inputs": {"Metallic": 1.0}}))
    return path


class _Place:
    """As much of a matrix as a lamp needs."""

    translation = (1.0, 2.0, 3.0)


def _lamp(**light: Any) -> Any:
    plain = {"energy": 100.0, "color": (1.0, 0.5, 0.25), "use_nodes": False, "node_tree": None, "shadow_soft_size": 0.0}
    return types.SimpleNamespace(name="lamp", data=types.SimpleNamespace(**(plain | light)), matrix_world=_Place())


def test_watts_of_a_point_become_an_intensity(kit):
    words = kit.lamp(_lamp(type="POINT"))
    assert words["type"] == "point"
    np.testing.assert_allclose(words["intensity_rgb"], np.array([100.0, 50.0, 25.0]) / (4.0 * math.pi))


def test_a_soft_point_is_a_sphere_of_the_same_power(kit):
    words = kit.lamp(_lamp(type="POINT", shadow_soft_size=0.3, exposure=1.0))
    assert words["type"] == "sphere"
    flux = np.array(words["radiance_rgb"]) * math.pi * 4.0 * math.pi * 0.3**2
    np.testing.assert_allclose(flux, [200.0, 100.0, 50.0])


def test_a_lamp_that_a_scene_has_no_word_for_is_refused(kit):
    with pytest.raises(kit.Unsuited, match="suns, points, areas and the world"):
        kit.lamp(_lamp(type="SPOT"))


def _area(shape: str, spread: float = math.pi, scale: float = 1.0) -> Any:
    lamp = _lamp(type="AREA", shape=shape, size=2.0, size_y=3.0, spread=spread)
    columns = [(0.0, scale, 0.0, 0.0), (0.0, 0.0, scale, 0.0), (scale, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0, 1.0)]
    lamp.matrix_world = types.SimpleNamespace(translation=(1.0, 2.0, 3.0), col=columns, to_scale=lambda: (scale,) * 3)
    return lamp


@pytest.mark.parametrize(
    ("shape", "kind", "area"),
    [
        ("SQUARE", "rectangle", 4.0),
        ("RECTANGLE", "rectangle", 6.0),
        ("DISK", "disk", math.pi),
        ("ELLIPSE", "disk", 1.5 * math.pi),
    ],
)
def test_an_area_is_a_patch_of_the_same_power(kit, shape, kind, area):
    words = kit.lamp(_area(shape))
    assert words["type"] == kind
    across = np.cross(words["half_u"], words["half_v"])
    np.testing.assert_allclose(across / np.linalg.norm(across), [-1.0, 0.0, 0.0], err_msg="it shines along -Z of the lamp")
    np.testing.assert_allclose(np.linalg.norm(across) * (4.0 if kind == "rectangle" else math.pi), area)
    np.testing.assert_allclose(np.array(words["radiance_rgb"]) * math.pi * area, [100.0, 50.0, 25.0])


@pytest.mark.parametrize("odd", [{"spread": 1.0}, {"scale": 2.0}])
def test_an_area_that_is_more_than_a_patch_is_refused(kit, odd):
    with pytest.raises(kit.Unsuited, match=r"scaled, or of a spread"):
        kit.lamp(_area("SQUARE", **odd))


def _emission(strength: float = 4.0, linked: bool = False) -> Any:
    plug = lambda value: types.SimpleNamespace(default_value=value, is_linked=linked)  # noqa: E731
    inputs = {"Color": plug((1.0, 0.5, 0.0, 1.0)), "Strength": plug(strength), "Weight": plug(0.0)}
    return types.SimpleNamespace(type="EMISSION", inputs=inputs)


def test_a_lamp_is_as_bright_as_its_emission_makes_it(kit):
    tree = types.SimpleNamespace(nodes=[_emission(), types.SimpleNamespace(type="OUTPUT_LIGHT")])
    words = kit.lamp(_lamp(type="POINT", use_nodes=True, node_tree=tree))
    np.testing.assert_allclose(words["intensity_rgb"], np.array([400.0, 100.0, 0.0]) / (4.0 * math.pi))
    for nodes in ([], [_emission(linked=True)], [_emission(), _emission()]):
        with pytest.raises(kit.Unsuited, match="lit by nodes"):
            kit.lamp(_lamp(type="POINT", use_nodes=True, node_tree=types.SimpleNamespace(nodes=nodes)))


class _Thing:
    """An object of a scene."""

    def __init__(self, kind: str, hidden: bool = False, instances: str = "NONE"):
        self.name, self.type, self.hide_render, self.instance_type = kind.lower(), kind, hidden, instances


def _collection(*things: Any, children: Any = (), hidden: bool = False, exclude: bool = False) -> Any:
    collection = types.SimpleNamespace(objects=things, hide_render=hidden)
    return types.SimpleNamespace(collection=collection, exclude=exclude, children=children)


def test_a_lamp_that_is_not_rendered_is_not_told(kit, monkeypatch):
    seen, inside = _Thing("LIGHT"), _Thing("LIGHT")
    away = [
        _collection(_Thing("LIGHT"), hidden=True, children=[_collection(_Thing("LIGHT"))]),
        _collection(_Thing("LIGHT"), seen, exclude=True, children=[_collection(inside)]),
    ]
    root = _collection(seen, _Thing("LIGHT", hidden=True), _Thing("MESH"), children=[*away, _collection(seen)])
    kit.bpy.context = types.SimpleNamespace(view_layer=types.SimpleNamespace(layer_collection=root))
    monkeypatch.setattr(kit, "lamp", lambda thing: thing)
    assert kit.lights() == [seen, inside]


def test_what_an_empty_shows_of_a_collection_is_left_out(kit):
    ball, cube, plain, shows = _Thing("MESH"), _Thing("MESH"), _Thing("EMPTY"), _Thing("EMPTY", instances="COLLECTION")
    kit.alone(types.SimpleNamespace(objects=[ball, cube, plain, shows]), ball)
    assert [thing.hide_render for thing in (ball, cube, plain, shows)] == [False, True, False, True]


def test_the_exposure_of_a_film_is_one(kit):
    layer, cycles = types.SimpleNamespace(), types.SimpleNamespace(film_exposure=4.0)
    image = types.SimpleNamespace()
    kit.bpy.context = types.SimpleNamespace(view_layer=layer)
    kit.settings(
        types.SimpleNamespace(render=types.SimpleNamespace(image_settings=image), cycles=cycles, view_layers=[layer]), 64
    )
    assert cycles.film_exposure == 1.0


OTHERWISE = """
bpy.ops.mesh.primitive_cube_add(location=(4, 0, 0))
bpy.ops.object.select_all(action="DESELECT")
if sys.argv[3] == "SUN":
    sun.energy, sun.angle = 3.0, 0.1
else:
    lamp.data = area = bpy.data.lights.new("area", "AREA")
    area.energy, area.shape, area.size, area.size_y = 300.0, sys.argv[3], 2.0, 1.2
lamp.location = (2, -3, 2.4)
eye.data.lens, eye.location = 85, (0.8, -4.9, 0.6)
eye.rotation_euler = Vector(eye.location).to_track_quat("Z", "Y").to_euler()
scene.render.resolution_x, scene.render.resolution_y = 72, 64
"""
"""A scene as a user has it: something beside the sphere, another lamp, a camera that looks from aside at a picture that is no square."""


@pytest.mark.parametrize("lamp", ["SUN", "RECTANGLE", "DISK"])
def test_cycles_draws_the_formula_that_is_fitted(tmp_path, lamp):
    """All the way round: a material is exported, Blender builds it, the kit renders it, and the picture is that of the formula."""
    python = os.environ.get("LAYERFIT_BPY")
    if not python:
        pytest.skip("LAYERFIT_BPY does not name a Python with bpy")
    made = blender.engine_of(
        blender.DEFAULTS
        | {"Base Color": [0.9, 0.5, 0.4], "Metallic": 1.0, "Roughness": 0.45, "Specular Tint": [0.9, 0.8, 1.0]}
        | {"Coat Weight": 1.0, "Coat Roughness": 0.3, "Coat IOR": 1.6, "Coat Tint": [0.8, 0.6, 0.3]}
    )
    files = {"make.py": STAGE + OTHERWISE + SAVE, "paint.py": _script(made), "kit.py": formats.blender_kit()}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    run = lambda *words: subprocess.run([python, *map(str, words)], cwd=tmp_path, check=True, capture_output=True)  # noqa: E731
    run("make.py", tmp_path / "user.blend", "paint.py", lamp)
    run("kit.py", "--blend", "user.blend", "--object", "Sphere", "--output", tmp_path, "--samples", "64")
    start = formats.read_start(tmp_path / "Sphere.principled.json")
    assert float(start.layers[0].eta) == pytest.approx(1.6)
    read = blender.read(tmp_path, json.loads((tmp_path / "Sphere.principled.json").read_text()))
    (view,) = scene_views(tmp_path / "Sphere.toml")
    values = draw(view, alone(read))
    assert len(view.target) > 1000
    assert np.sqrt(np.sum((values - view.target) ** 2) / np.sum(view.target**2)) < CYCLES[lamp]
    assert values.sum() == pytest.approx(view.target.sum(), rel=0.01)


@pytest.mark.parametrize("nm", [90.0, 300.0])
def test_cycles_draws_the_film_that_is_fitted(tmp_path, nm):
    """On a metal: what is left between the two are the Gaussians that stand for an eye, where Cycles has a table."""
    python = os.environ.get("LAYERFIT_BPY")
    if not python:
        pytest.skip("LAYERFIT_BPY does not name a Python with bpy")
    film = {"Thin Film Thickness": nm, "Thin Film IOR": 2.2}
    metal = {"Base Color": [0.54, 0.5, 0.45], "Metallic": 1.0, "Roughness": 0.45, "Specular Tint": [0.95, 0.9, 0.9]}
    made = blender.engine_of(blender.DEFAULTS | metal | film)
    for name, text in {"make.py": STAGE + SAVE, "paint.py": _script(made), "kit.py": formats.blender_kit()}.items():
        (tmp_path / name).write_text(text)
    for words in (
        ("make.py", str(tmp_path / "user.blend"), "paint.py"),
        ("kit.py", "--blend", "user.blend", "--samples", "32"),
    ):
        subprocess.run([python, *words], cwd=tmp_path, check=True, capture_output=True)
    read = blender.read(tmp_path, json.loads((tmp_path / "Sphere.principled.json").read_text()))
    assert float(read.film_nm) == nm
    (view,) = scene_views(tmp_path / "Sphere.toml")
    off = lambda values: np.sqrt(np.sum((values - view.target) ** 2) / np.sum(view.target**2))  # noqa: E731
    filmed, bare = (off(draw(view, alone(one))) for one in (read, replace(read, film_nm=None, film_eta=None)))
    assert filmed < min(FILM, bare / 3.0)


def _script(made: Any) -> str:
    from layerfit.interchange.convert import Conversion

    stack = Stack((), Lambert(), formats.read_preset(Path("bare_wood")).form)
    return blender.write(Conversion("paint", stack, made, {}, {}, "nowhere", (), ()))
