"""Which structure data support: known materials are recognised, and nothing is claimed that is not there."""

import dataclasses
import json

import numpy as np
import pytest

from commands import SCENE, layerfit
from helpers import hemisphere, sphere_view
from layerfit.capture.load import load
from layerfit.capture.measured.view import load_measured
from layerfit.capture.scene import MeasuredReference
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError
from layerfit.fit.candidates import candidates
from layerfit.fit.structures import STRONG, _asked, choose_structure, effective
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.render import predict
from layerfit.report.structures import document, sentences
from layerfit.stack import Stack
from layerfit.structures import ANY, structures_of
from layerfit.surfaces import CarPaint, Lambert
from measured_files import write_table

pytestmark = pytest.mark.optimised

SOME = ["diffuse", "lobe", "coat_diffuse"]
"""Structures that are quick to compile."""

WI, WO = hemisphere(900), hemisphere(900, 1)
WO[:400] = WI[:400] * [-1.0, -1.0, 1.0] + 0.3 * hemisphere(400, 2) * [1.0, 1.0, 0.0]  # into the highlight
WO /= np.linalg.norm(WO, axis=-1, keepdims=True)

TRUTHS = {
    "diffuse": Stack((), Lambert(albedo=[0.6, 0.3, 0.1])),
    "lobe": Stack((), CarPaint(kd=[0.3, 0.2, 0.1], ks=[0.3, 0.3, 0.2], f0=0.3, alpha=0.25)),
    "coat_diffuse": Stack((Coat(alpha=0.15, eta=1.5),), Lambert(albedo=[0.6, 0.3, 0.1]), Precise()),
}


def measurement(folder, f):
    """A view of a CSV of values."""
    write_table(folder / "a.csv", f, WI, WO)
    return load_measured(MeasuredReference(folder / "a.csv", "D65", 0.0, {}), 0.1)


def values(stack, wi, wo):
    wi, wo = (np.asarray(w, np.float32) for w in (wi, wo))
    return predict(stack, wi[:, None], wo, np.ones((len(wi), 1, 3), np.float32)).astype(float)


@pytest.mark.parametrize("name", TRUTHS)
def test_a_known_structure_is_recognised_in_a_noisy_measurement(name, tmp_path):
    rng = np.random.default_rng(0)
    view = measurement(tmp_path, lambda wi, wo: values(TRUTHS[name], wi, wo) * (1.0 + 0.02 * rng.normal(size=(len(wi), 3))))
    choice = choose_structure([view], structures=SOME)
    assert choice.chosen.candidate.name == name
    assert choice.coated == (name == "coat_diffuse")
    assert ("No coat is supported" in " ".join(sentences(choice))) != choice.coated
    # Independent noise: every residual counts, in every channel.
    assert choice.effective_residuals > 0.5 * choice.residuals


def test_the_simplest_of_those_that_explain_all_is_chosen(tmp_path):
    """Without noise, several are exact: what is left is rounding, and decides nothing."""
    choice = choose_structure([measurement(tmp_path, lambda wi, wo: values(TRUTHS["diffuse"], wi, wo))], structures=SOME)
    assert choice.chosen.candidate.name == "diffuse"
    assert min(t.error for t in choice.tried if t.layers) < 1e-2
    assert choice.pareto[0].candidate.name == "diffuse"


def test_light_that_comes_back_is_said_to_be_none_of_these(tmp_path):
    def f(wi, wo):
        back = np.sum(wi * wo, -1, keepdims=True)
        return values(TRUTHS["diffuse"], wi, wo) + 3.0 * np.exp((back - 1.0) / 0.02)

    wo = WO.copy()
    wo[400:500] = WI[400:500] + 0.05 * hemisphere(100, 3)
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    write_table(tmp_path / "a.csv", f, WI, wo)
    view = load_measured(MeasuredReference(tmp_path / "a.csv", "D65", 0.0, {}), 0.1)
    choice = choose_structure([view], structures=["diffuse", "coat_diffuse"])
    assert choice.retro is not None
    said = " ".join(sentences(choice))
    assert "where it came from" in said
    assert "none that explains it" in said


def test_an_image_is_a_reference_too(tmp_path):
    view = sphere_view(TRUTHS["coat_diffuse"], tmp_path, 40)
    choice = choose_structure([view], structures=SOME)
    assert choice.chosen.candidate.name == "coat_diffuse"
    np.testing.assert_allclose(choice.chosen.result.stack.layers[0].alpha, 0.15, rtol=0.02)


def test_what_a_scene_asks_of_its_lights_is_fitted_beside_each_structure(tmp_path):
    """Ambient light that nobody told of: from everywhere, a diffuse surface sends back its albedo of it."""
    lit, radiance = sphere_view(TRUTHS["diffuse"], tmp_path, 24), 0.2
    view = dataclasses.replace(lit, target=lit.target + radiance * np.asarray(TRUTHS["diffuse"].base.albedo, np.float32))
    choice = choose_structure([view], structures=["diffuse"], also=("light.ambient",))
    np.testing.assert_allclose(choice.chosen.result.lights[0]["ambient"], radiance, rtol=0.02)
    np.testing.assert_allclose(choice.chosen.result.stack.base.albedo, TRUTHS["diffuse"].base.albedo, rtol=0.02)


def test_of_what_a_scene_frees_the_lights_alone_are_passed_on(tmp_path, monkeypatch):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.replace("starts = 3", 'also = ["light.ambient", "base.k"]\neach = ["light.scale", "coat.alpha"]'))

    class Passed(Exception):
        pass

    def passed(views, **options):
        raise Passed(options["also"], options["each"])

    monkeypatch.setattr("layerfit.structures.load", lambda scene: [])
    monkeypatch.setattr("layerfit.structures.choose_structure", passed)
    with pytest.raises(Passed) as found:
        structures_of(path, tmp_path / "out")
    assert found.value.args == (("light.ambient",), ("light.scale",))


def test_flakes_are_tried_where_they_can_be_drawn(tmp_path):
    """Without texture coordinates, nothing says where on the surface a flake is."""
    view = sphere_view(TRUTHS["diffuse"], tmp_path, 16)
    known = candidates(np.array([0.5, 0.5, 0.5]))
    names = lambda *views: {candidate.name for candidate in _asked(known, None, views)}  # noqa: E731
    placed, measured = view, measurement(tmp_path, lambda wi, wo: values(TRUTHS["diffuse"], wi, wo))
    assert names(placed, measured) - names(dataclasses.replace(view, uv=None)) == {"coat_flakes"}


def test_residuals_that_are_alike_count_less():
    place = np.random.default_rng(0).uniform(size=(1200, 2))
    noise = np.random.default_rng(1).normal(size=(1200, 3))
    smooth = np.sin(6.0 * place[:, :1] + 4.0 * place[:, 1:])
    independent, grey = effective(noise, place), effective(np.repeat(noise[:, :1], 3, -1), place)
    assert 0.7 * 3600 < independent <= 3600
    assert 0.7 * 1200 < grey <= 1200
    together = effective(smooth + 0.1 * noise, place)
    assert 2.0 <= together < 40.0
    # Twice the samples of the same misfit tell no more of it.
    np.testing.assert_allclose(effective((smooth + 0.1 * noise)[:600], place[:600]), together, rtol=0.35)
    assert effective(np.zeros_like(noise), place) == 3600, "of a fit without any residual"


def test_an_unknown_structure_is_named_with_the_nearest(tmp_path):
    view = measurement(tmp_path, lambda wi, wo: values(TRUTHS["diffuse"], wi, wo))
    with pytest.raises(InputError, match="did you mean 'coat_diffuse'"):
        choose_structure([view], structures=["coat_difuse"])


def test_what_is_written_of_a_search(tmp_path, gl):
    measurement(tmp_path, lambda wi, wo: values(TRUTHS["coat_diffuse"], wi, wo))
    ran = layerfit(
        "structures", str(tmp_path / "a.csv"), "-o", str(tmp_path / "out"), "--only", "diffuse,coat_diffuse", "--json"
    )
    assert ran.code == 0
    assert "A coat is supported" in ran.err
    written = json.loads((tmp_path / "out" / "structures.json").read_text())
    assert json.loads(ran.out) == written
    assert written["chosen"] == "coat_diffuse"
    assert written["coat"]["supported"] is True
    assert written["coat"]["bic_gain"] > STRONG
    assert {"structures.png", "fit.png", "fit.json", "preset.json"} <= {p.name for p in (tmp_path / "out").iterdir()}
    fitted = json.loads((tmp_path / "out" / "fit.json").read_text())["parameters"]
    np.testing.assert_allclose(fitted["coat.eta"]["value"], 1.5, rtol=1e-2)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.bsdf"], "cannot be read"),
        (["a.csv", "--only", "coats"], "should be one of diffuse"),
        (["a.csv", "--metric", "logs"], "should be one of law, uniform"),
        (["scene.toml"], "there is no [reference]"),
    ],
)
def test_a_fault_is_one_message_and_leaves_nothing(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    measurement(tmp_path, lambda wi, wo: values(TRUTHS["diffuse"], wi, wo))
    (tmp_path / "scene.toml").write_text("")
    ran = layerfit("structures", *arguments, "-o", "out")
    assert ran.code == 2
    assert said in ran.err
    assert not (tmp_path / "out").exists()


def test_the_names_of_a_scene_are_of_its_own_material(tmp_path, monkeypatch):
    class Chosen(Exception):
        pass

    def fitted(scene, *_, **__):
        assert (scene.fit.also, scene.fit.each) == ((), ())
        raise Chosen

    measurement(tmp_path, lambda wi, wo: values(TRUTHS["diffuse"], wi, wo))
    (tmp_path / "scene.toml").write_text('[reference]\nbrdf = "a.csv"\n[fit]\nalso = ["coat.tau"]\neach = ["coat.alpha"]\n')
    monkeypatch.setattr("layerfit.structures.fit_scene", fitted)
    with pytest.raises(Chosen):
        structures_of(tmp_path / "scene.toml", tmp_path / "out", structures=["diffuse"])


def test_a_scene_needs_no_material_for_it(tmp_path):
    measurement(tmp_path, lambda wi, wo: values(TRUTHS["diffuse"], wi, wo))
    (tmp_path / "scene.toml").write_text('[reference]\nbrdf = "a.csv"\n')
    (view,) = load(read_scene(tmp_path / "scene.toml", ANY))
    assert document(choose_structure([view], structures=["diffuse"]))["chosen"] == "diffuse"


def test_white_paper_has_no_coat(measured):
    view = load_measured(MeasuredReference(measured / "paper_white_rgb.bsdf", "D65", 1.5, {}), 0.1)
    choice = choose_structure([view], structures=SOME)
    assert not choice.coated
    assert choice.effective_residuals < 0.02 * choice.residuals  # its misfit is smooth


def test_frosted_enamel_has_one(measured):
    view = load_measured(MeasuredReference(measured / "krylon_blue.brdf", "D65", 1.5, {}), 0.1)
    choice = choose_structure([view], structures=SOME)
    assert choice.chosen.candidate.name == "coat_diffuse"
    assert choice.coat_gain > STRONG
    assert 1.2 < float(choice.chosen.result.stack.layers[0].eta) < 1.7
