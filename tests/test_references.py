"""What references have for themselves beside the material that they share, and what is not known of their light."""

import dataclasses
import json

import jax
import numpy as np
import pytest

from helpers import COPPER
from layerfit.capture.exr import write_exr
from layerfit.capture.geometry import sphere_surface
from layerfit.capture.reference import load_reference
from layerfit.capture.scene import Camera, Constant, Directional, Reference, Sphere
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.parameters import parametrise
from layerfit.fit.problem import Problem
from layerfit.fit.residuals import scaled
from layerfit.fit.result import parameters, to_json
from layerfit.job import fit_scene
from layerfit.layers import Coat
from layerfit.preset import read_preset
from layerfit.render import predict
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert

CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
KEY = Directional((0.46175709, 0.55410852, 0.69263564), (np.pi, np.pi, np.pi), "key")
FILL = Directional((-0.6, 0.0, 0.8), (np.pi, np.pi, np.pi), "fill")

COATED = Stack((Coat(alpha=0.12, eta=1.5, tau=[0.08, 0.25, 0.7]),), Conductor(alpha=0.2, **COPPER))
POOR = Stack((Coat(alpha=0.2, eta=1.4, tau=[0.3, 0.3, 0.3]),), Conductor(alpha=0.3, **COPPER))
METAL = Stack((), Conductor(alpha=0.2, **COPPER))
DULL = Stack((), Conductor(alpha=0.3, **COPPER))
WOOD = Stack((), Lambert(albedo=[0.5, 0.28, 0.13]))
GREY = Stack((), Lambert(albedo=0.4))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    covered = sphere_surface(Sphere(), CAMERA, 32, 32).covered
    path = tmp_path_factory.mktemp("sphere") / "sphere.exr"
    write_exr(path, dict.fromkeys("RGB", np.where(covered, 0.5, 0.0)) | {"A": covered.astype(float)})
    return path


@pytest.fixture(scope="module")
def see(path):
    """Views of a sphere under lights that are so bright, of a layer that is so thick, as if nothing of that were known."""

    def make(stack=COATED, lights=(KEY,), lit=None, scale=None, told=None, noise=0.0, seed=0):
        thick = {} if scale is None else {"coat": scale}
        view = load_reference(Reference(path, CAMERA, lights, Sphere(), {}, None, thick), 0.1)
        made = view.relit(lit or {}).samples(quadrature=256, seed=99)
        image = predict(scaled(stack, view.scales(stack)), *made.arrays[:3])
        image = image * (1.0 + noise * np.random.default_rng(seed).normal(size=image.shape))
        reference = dataclasses.replace(view.reference, thickness_scale={} if told is None else {"coat": told})
        return dataclasses.replace(view, reference=reference, target=image.astype(np.float32))

    return make


def document(result):
    return to_json(result, {}, None, {}, "preset.json")


def near(row, wanted, sigmas=4.0, part=0.05):
    """Within its sigmas, which are small."""
    value, sigma = np.asarray(row["value"]), np.asarray(row["sigma"])
    assert np.all(np.abs(value - wanted) < sigmas * sigma), row
    assert np.all(sigma < part * np.maximum(wanted, 0.1)), row


AMBIENT = np.array([0.2, 0.05, 0.3])


def test_ambient_light_is_found_beside_a_colour(see):
    view = see(WOOD, lit={"ambient": AMBIENT}, noise=0.02)
    result = fit([view], GREY, also=["light.ambient"], starts=2)
    rows = parameters(result)
    near(rows["light.ambient"], AMBIENT)
    near(rows["base.albedo"], WOOD.base.albedo)
    assert not document(result)["unidentified"]
    np.testing.assert_allclose(result.lights[0]["ambient"], rows["light.ambient"]["value"], rtol=1e-5)
    image = predict(result.materials[0], *view.relit(result.lights[0]).samples(quadrature=128).arrays[:3])
    np.testing.assert_allclose(image, view.target, rtol=0.12)


def test_the_sigma_of_ambient_light_is_true(see):
    pulls = []
    for seed in range(12):
        view = see(WOOD, lit={"ambient": AMBIENT}, noise=0.03, seed=seed)
        row = parameters(fit([view], WOOD, free=["base.albedo", "light.ambient"], starts=1))["light.ambient"]
        pulls.append((np.asarray(row["value"]) - AMBIENT) / row["sigma"])
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.5, "36 pulls: 99 times of 100 within .7 and 1.3 if they are Gaussian"


def test_ambient_light_that_is_grey_is_one_number(see):
    result = fit(
        [see(WOOD, lit={"ambient": np.full(3, 0.2)}, noise=0.02)], GREY, free=["base.albedo", "light.ambient.grey"], starts=1
    )
    row = parameters(result)["light.ambient.grey"]
    assert isinstance(row["value"], float)
    near(row, 0.2)


def test_light_from_everywhere_alone_is_the_colour_over_again(see):
    """Twice the light on half the albedo is the same image."""
    everywhere = see(WOOD, lights=(Constant((1.0, 1.0, 1.0)),))
    result = fit([everywhere], GREY, free=["base.albedo", "light.ambient"], starts=1)
    assert any("base.albedo and light.ambient can change together" in row["why"] for row in document(result)["unidentified"])


def test_what_is_not_asked_for_is_not_there(see):
    stack, free = parametrise(GREY, None, (), "fit", [see(WOOD)])
    with jax.enable_x64(True):
        problem = Problem([see(WOOD)], stack, free, "law", "square", 0)
    assert problem.blocks.lights is None
    assert problem.samples[0].wi.shape[1] == 1
    assert problem.lights(free.pack(stack)) == [{}]


def test_lights_of_unknown_brightness_are_told_apart(see):
    """Two of known direction, together in one image of a metal."""
    lit = {"key": np.array([2.0, 1.5, 1.2]), "fill": np.array([0.5, 0.6, 0.7])}
    result = fit([see(METAL, (KEY, FILL), lit, noise=0.01)], DULL, free=["base.alpha", "light.key", "light.fill"], starts=1)
    rows = parameters(result)
    for name, wanted in lit.items():
        near(rows[f"light.{name}"], wanted, part=0.2)
    near(rows["base.alpha"], 0.2)


def test_all_lights_and_each_of_them_are_one_too_many(see):
    free = ["base.alpha", "light.scale.grey", "light.key.grey", "light.fill.grey"]
    result = fit([see(METAL, (KEY, FILL))], DULL, free=free, starts=1)
    (row,) = document(result)["unidentified"]
    assert (
        row["why"] == "light.fill.grey and light.key.grey and light.scale.grey can change together without changing the image"
    )


def test_a_reference_has_its_own_width(see):
    rough = Stack((), dataclasses.replace(METAL.base, alpha=0.35))
    views = [see(METAL, noise=0.01), see(rough, noise=0.01, seed=1)]
    result = fit(views, DULL, free=["base.k"], each=["base.alpha"], starts=2)
    rows = parameters(result)
    assert list(rows) == ["base.alpha@0", "base.alpha@1", "base.k"]
    near(rows["base.alpha@0"], 0.2)
    near(rows["base.alpha@1"], 0.35)
    near(rows["base.k"], COPPER["k"])
    found = [float(stack.base.alpha) for stack in result.materials]
    np.testing.assert_allclose(found, [rows[f"base.alpha@{k}"]["value"] for k in (0, 1)], rtol=1e-5)
    assert float(result.stack.base.alpha) == found[0]


def test_a_reference_has_its_own_light(see):
    scales = np.array([1.0, 1.6])
    views = [see(METAL, lit={"scale": np.full(3, scale)}, noise=0.01, seed=k) for k, scale in enumerate(scales)]
    result = fit(views, DULL, free=["base.alpha"], each=["light.scale.grey"], starts=1)
    rows = parameters(result)
    ratio = rows["light.scale.grey@1"]["value"] / rows["light.scale.grey@0"]["value"]
    assert ratio == pytest.approx(1.6, rel=0.01)
    assert [set(lit) for lit in result.lights] == [{"scale"}, {"scale"}]


@pytest.fixture(scope="module")
def series(see):
    return [see(scale=scale, noise=0.01, seed=k) for k, scale in enumerate((1.0, 2.7, 0.4))]


def test_unknown_ratios_of_thickness_are_found(series):
    result = fit(series, POOR, each=["coat.thickness_scale"], starts=1)
    rows = parameters(result)
    near(rows["coat.tau"], [0.08, 0.25, 0.7], part=0.15)
    near(rows["coat.thickness_scale@1"], 2.7)
    near(rows["coat.thickness_scale@2"], 0.4, part=0.2)
    assert "coat.thickness_scale@0" not in rows
    assert not document(result)["unidentified"]
    assert any("only ratios of thickness show: coat.thickness_scale@0 was held at 1" in note for note in result.notes)


def test_absorption_is_absolute_where_one_thickness_is_known(series):
    start = dataclasses.replace(POOR, layers=(Coat(alpha=0.12, eta=1.5, absorption_per_mm=[6.0, 6.0, 6.0], thickness_um=50.0),))
    free, known = ["coat.absorption_per_mm", "coat.thickness_scale", "base.alpha"], {"coat.thickness_um": 50.0}
    result = fit(series, start, free=free, fixed=known, starts=1)
    rows = parameters(result)
    near(rows["coat.absorption_per_mm"], np.array([0.08, 0.25, 0.7]) / 0.05, part=0.1)
    near(rows["coat.thickness_scale@1"], 2.7)
    assert float(result.materials[1].layers[0].thickness_um) == pytest.approx(135.0, rel=0.05)
    assert not document(result)["unidentified"]


def test_absorption_is_not_absolute_where_no_thickness_is_known(see):
    """Known ratios of thickness are no thickness."""
    views = [see(scale=scale, told=scale, noise=0.01) for scale in (1.0, 2.7)]
    coat = Coat(alpha=0.12, eta=1.5, absorption_per_mm=[6.0, 6.0, 6.0], thickness_um=50.0)
    free = ["coat.absorption_per_mm", "coat.thickness_um", "base.alpha"]
    result = fit(views, dataclasses.replace(POOR, layers=(coat,)), free=free, starts=1)
    assert "coat.thickness_um" not in parameters(result)
    (row,) = document(result)["unidentified"]
    assert "enter only as tau" in row["why"]
    np.testing.assert_allclose(document(result)["parameters"]["coat.tau"]["value"], [0.08, 0.25, 0.7], rtol=0.05)


REFUSED = {
    "coat.tall": r"fit\.free: unknown parameter 'coat\.tall' \(did you mean 'coat\.tau'\?\)",
    "light.rim": r"unknown parameter 'light\.rim'.*of the scene there is light\.scale, light\.scale\.grey, light\.ambient",
    "coat.thickness_scale": r"coat\.thickness_scale is of several references, over the first; there is one",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_scene_does_not_have_is_refused(see, name):
    with pytest.raises(InputError, match=REFUSED[name]):
        fit([see()], COATED, free=["base.alpha", name])


def test_a_light_is_not_two_numbers_and_one(see):
    with pytest.raises(InputError, match=r"light\.ambient and light\.ambient\.grey are the same light"):
        fit([see()], COATED, free=["light.ambient", "light.ambient.grey"])


SCENE = """
[[reference]]
exr = "one.exr"
[[reference]]
exr = "two.exr"

[camera]
position = [0.8, 0.6, 4.9]
look_at = [0, 0, 0]
vfov_deg = 26

[geometry]
kind = "sphere"

[[light]]
type = "directional"
name = "key"
to_light = [0.46175709, 0.55410852, 0.69263564]
irradiance_rgb = 3.14159

[material.base]
type = "lambert"
albedo = 0.3

[fit]
each = ["base.albedo"]
free = ["light.ambient.grey"]
starts = 1
"""


def test_a_scene_of_two_colours_under_ambient_light_is_fitted_and_shown(see, tmp_path):
    for name, albedo in (("one", [0.5, 0.28, 0.13]), ("two", [0.2, 0.4, 0.6])):
        view = see(Stack((), Lambert(albedo=albedo)), lit={"ambient": np.full(3, 0.2)})
        image = view.image(view.target)
        alpha = view.covered.astype(float)
        write_exr(tmp_path / f"{name}.exr", {**dict(zip("RGB", np.moveaxis(image, -1, 0), strict=True)), "A": alpha})
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = read_scene(tmp_path / "scene.toml")
    assert scene.references[0].lights[0].name == "key"
    outcome = fit_scene(scene, tmp_path / "out", model_error=False)
    rows = json.loads((tmp_path / "out" / "fit.json").read_text())["parameters"]
    np.testing.assert_allclose(rows["base.albedo@1"]["value"], [0.2, 0.4, 0.6], rtol=0.02)
    assert rows["light.ambient.grey"]["value"] == pytest.approx(0.2, rel=0.05)
    assert outcome.good
    assert outcome.document["error"]["rel_l2"] < 0.03
    report = (tmp_path / "out" / "report.html").read_text()
    assert "light.ambient.grey" in report
    assert "base.albedo@1" in report
    assert outcome.document["presets"] == ["preset.json", "preset_2.json"]
    for preset, albedo in zip(outcome.document["presets"], ([0.5, 0.28, 0.13], [0.2, 0.4, 0.6]), strict=True):
        np.testing.assert_allclose(read_preset(tmp_path / "out" / preset).base.albedo, albedo, rtol=0.02)
    assert (tmp_path / "out" / "material.frag").read_text() != (tmp_path / "out" / "material_2.frag").read_text()
    assert set(outcome.written) == {path.name for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('name = "ambient"', r"light\[0\]\.name = 'ambient': should be letters"),
        ("name = 3", r"light\[0\]\.name = 3: should be letters"),
    ],
)
def test_a_name_that_has_a_meaning_is_refused(tmp_path, line, said):
    (tmp_path / "scene.toml").write_text(SCENE.replace('name = "key"', line))
    with pytest.raises(InputError, match=said):
        read_scene(tmp_path / "scene.toml")


def test_each_is_a_list_of_names(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace('each = ["base.albedo"]', 'each = "base.albedo"'))
    with pytest.raises(InputError, match=r"fit\.each: should be a list of parameters"):
        read_scene(tmp_path / "scene.toml")
