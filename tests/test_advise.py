"""What images tell before they are fitted."""

import dataclasses
import json

import numpy as np
import pytest

from commands import layerfit, write_reference
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError
from layerfit.fit.advise import STRATA, Advice, Told, _told, advise
from layerfit.fit.parameters import parametrise
from layerfit.report.advice import document, light_map, sentences
from layerfit.stack import Stack
from layerfit.surfaces import Lambert

RNG = np.random.default_rng(0)
JACOBIAN = RNG.normal(size=(400, 3, 2))
MODEL = RNG.uniform(0.2, 1.0, (400, 3))
STRATUM = RNG.integers(0, STRATA, 400)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Paint under a lacquer, one image: a second thickness is what tells them apart."""
    path = write_reference(tmp_path_factory.mktemp("scene"))
    paint = 'type = "lambert"\nname = "base"\nalbedo = [0.5, 0.3, 0.2]\n'
    text = path.read_text()
    base = text.index("[material.base]") + len("[material.base]\n")
    path.write_text(text[:base] + paint + text[text.index("[fit]") :].replace("base.alpha", "base.albedo"))
    return path


@pytest.fixture(scope="module")
def advice(scene) -> Advice:
    """Of a scene whose fit would find ambient light too."""
    read = read_scene(scene)
    return advise(dataclasses.replace(read, fit=dataclasses.replace(read.fit, also=("light.ambient",))))


def test_noise_averages_out_over_pixels_and_what_the_form_gets_wrong_does_not():
    _, free = parametrise(Stack((), Lambert(albedo=0.5)), None, (), "test")
    told = {share: _told(JACOBIAN, MODEL, STRATUM, 0.05 * MODEL, share) for share in (1.0, 100.0)}
    spread = {k: np.linalg.inv(t.gram) @ t.scatter @ np.linalg.inv(t.gram) for k, t in told.items()}
    assert np.all(np.diag(spread[100.0]) < np.diag(spread[1.0]))
    exact = _told(JACOBIAN, MODEL, STRATUM, np.zeros_like(MODEL), 1.0)
    many = _told(JACOBIAN, MODEL, STRATUM, np.zeros_like(MODEL), 100.0)
    of = lambda t: np.linalg.inv(t.gram) @ t.scatter @ np.linalg.inv(t.gram)  # noqa: E731
    np.testing.assert_allclose(of(many), of(exact), rtol=1e-9)
    np.testing.assert_allclose(many.gram, 100.0 * exact.gram, rtol=1e-12)
    assert free.size == 3


def test_where_nothing_is_told_a_parameter_lies_anywhere_in_its_range():
    _, free = parametrise(Stack((), Lambert(albedo=0.5)), None, (), "test")
    lower, upper = free.bounds()
    nothing = Told(np.zeros((3, 3)), np.zeros((3, 3)))
    np.testing.assert_allclose(np.sqrt(np.diag(nothing.covariance(free))), (upper - lower) / np.sqrt(12.0))


def test_what_is_taken_as_told_is_said(advice):
    assert advice.as_told == ("light.ambient",)
    assert "though a fit would find it: light.ambient." in sentences(advice)[-1]
    said = sentences(dataclasses.replace(advice, as_told=(), shared=("base.albedo",)))
    assert said[-1] == "Taken as the same in all references: base.albedo."


def test_over_paint_another_thickness_of_the_lacquer_helps_most(advice):
    best = advice.candidates[0]
    assert best.image.what == "coat 4 times as thick"
    assert best.gain > 1.5
    assert [c.gain for c in advice.candidates] == sorted((c.gain for c in advice.candidates), reverse=True)
    assert min(c.gain for c in advice.candidates) > 0.99, "an image more makes nothing worse"


@pytest.mark.parametrize("key", ["free", "also", "each"])
def test_a_name_that_nothing_has_is_refused(scene, key):
    read = read_scene(scene)
    wrong = dataclasses.replace(read, fit=dataclasses.replace(read.fit, **{key: ("coat.alpha", "light.ambient", "coat.alpa")}))
    with pytest.raises(InputError, match=rf"fit\.{key}: unknown parameter 'coat.alpa' \(did you mean 'coat.alpha'"):
        advise(wrong)


def test_a_light_that_reaches_no_visible_point_brings_nothing(advice):
    reference = advice.candidates[0].image.reference
    away = np.subtract(reference.camera.position, reference.camera.look_at)
    behind = min((c for c in advice.candidates if c.image.kind == "light"), key=lambda c: np.dot(c.image.direction, away))
    lit = max((c for c in advice.candidates if c.image.kind == "light"), key=lambda c: c.gain)
    assert behind.gain == pytest.approx(1.0, abs=0.02)
    assert lit.gain > 1.1


def test_the_document_holds_what_is_said(advice):
    found = json.loads(json.dumps(document(advice), allow_nan=False))
    assert set(found["parameters"]) == {"coat.alpha", "coat.eta", "coat.tau", "base.albedo"}
    assert len(found["candidates"]) == len(advice.candidates)
    kinds = {c["kind"] for c in found["candidates"]}
    assert kinds == {"light", "camera", "thickness", "constant light"}
    assert (
        sentences(advice)[1] == f"Best thickness: coat 4 times as thick; errors {advice.candidates[0].gain:.3g} times smaller."
    )
    assert light_map(advice.candidates).startswith(b"\x89PNG")


def test_what_is_not_determined_is_said(advice):
    blurred = dataclasses.replace(advice, sigma=np.where(np.arange(len(advice.sigma)) == 0, 0.7, advice.sigma))
    assert blurred.determined["coat.alpha"] is False
    assert "They do not determine coat.alpha" in sentences(blurred)[0]
    assert blurred.least_known == "coat.alpha"


def test_the_command_writes_its_files(scene, tmp_path):
    ran = layerfit("advise", scene, "-o", tmp_path, "--json")
    found = json.loads(ran.out)
    assert ran.code == (0 if all(row["identifiable"] for row in found["parameters"].values()) else 1)
    assert json.loads((tmp_path / "advice.json").read_text()) == found
    assert (tmp_path / "advice.png").exists()
    assert "coat 4 times as thick" in ran.err


def test_advice_needs_a_render(scene):
    read = read_scene(scene)
    with pytest.raises(InputError, match="advice is for renders"):
        advise(dataclasses.replace(read, references=()))
