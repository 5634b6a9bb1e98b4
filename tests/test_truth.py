"""The closed forms against the random walk, as a command tells it: forms that are right, forms that are wrong, and what is written."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from PIL import Image

from commands import layerfit, snapshot
from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.preset import read_preset
from layerfit.report.truth import sentence
from layerfit.stack import Stack
from layerfit.surfaces import Lambert
from layerfit.truth import NOISE, below, compare, forms_of, hemisphere, noise, relative_error
from layerfit.walk import Estimate

pytestmark = pytest.mark.optimised(1)

EXACT = 0.02
"""A smooth coat over a Lambert surface has a closed form: what is left is the coat's width and the walk's noise."""

GLOSSY = Stack((Coat(alpha=0.02, eta=1.5),), Lambert(albedo=0.5))
COPPER = read_preset("lacquered_copper")


@pytest.fixture(scope="module")
def glossy():
    return compare(GLOSSY, "glossy")


@pytest.fixture(scope="module")
def copper(tmp_path_factory):
    directory = tmp_path_factory.mktemp("truth") / "out"
    return directory, layerfit("truth", "lacquered_copper", "-o", directory, "--paths", "400", "--seed", "3", "--json")


@pytest.mark.parametrize("form", ["precise", "corrected"])
def test_a_form_that_is_the_truth(glossy, form):
    assert max(glossy["forms"][form]["error_rel"]) < EXACT


def test_the_formula_of_the_paper_is_far_off(glossy):
    faithful = glossy["forms"]["faithful"]
    assert faithful["median"] > 0.5
    assert min(faithful["error_rel"]) > 0.5


def test_the_walk_is_as_quiet_as_it_should_be(glossy):
    # The noise of the pilot is itself known to a few percent alone.
    assert max(glossy["noise_rel"]) < 1.1 * NOISE


def test_numbers_depend_on_the_seed_alone():
    first, again, other = (compare(COPPER, "copper", paths=200, seed=seed) for seed in (5, 5, 6))
    assert first == again
    assert first["forms"]["faithful"]["error_rel"] != other["forms"]["faithful"]["error_rel"]


def test_noise_is_the_error_of_an_exact_form():
    """Of normal values about the truth, in the measure of the errors."""
    fan = hemisphere(40.0)
    rng = np.random.default_rng(1)
    f = rng.uniform(0.5, 1.5, (len(fan.wo), 3))
    se = 0.01 * f
    errors = [relative_error(f, Estimate(f + se * rng.standard_normal(f.shape), se), fan) for _ in range(400)]
    assert np.mean(errors, 0) == pytest.approx(noise(Estimate(f, se), fan), rel=0.03)


def test_black_channels_have_no_error():
    lacquer = dataclasses.replace(COPPER.layers[0], tau=np.array([0.1, 0.3, 50.0]))
    document = compare(Stack((lacquer,), COPPER.base), "red", paths=200)
    rows = document["forms"]["corrected"]["error_rel_rgb"]
    assert all(blue is None and red < 0.2 for red, _, blue in rows)
    assert document["forms"]["corrected"]["median"] < 0.2


def test_the_light_from_below_holds_no_top_lobe():
    black = Stack(GLOSSY.layers, Lambert(albedo=0.0))
    assert np.max(np.abs(below(black, [hemisphere(20.0)])[0])) < 1e-9


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_which_forms_are_compared(interface):
    assert list(forms_of(COPPER, interface)) == ["precise", "corrected", "faithful"]
    assert forms_of(COPPER, interface)["precise"] == Precise(interface)
    two = Stack((Coat(name="top"), Coat(name="primer", eta=1.8)), Lambert(), Corrected(orders=1))
    others = {"corrected": Corrected(orders=1), "faithful": Faithful()}
    assert forms_of(two, interface) == {"precise": Precise(interface)} | others
    three = dataclasses.replace(two, layers=(*two.layers, Coat(name="filler")))
    assert forms_of(three, interface) == others


@pytest.mark.parametrize("form", [Precise("multi"), Precise("single"), Corrected()])
def test_the_interface_is_the_presets(form, monkeypatch):
    walked = []

    def walk(stack: Stack, wi: Any, wo: Any, *, interface: str, **options: Any) -> Estimate:
        walked.append(interface)
        return Estimate(np.ones((len(wo), 3)), np.ones((len(wo), 3)))

    monkeypatch.setattr("layerfit.truth.walk", walk)
    document = compare(Stack(COPPER.layers, COPPER.base, form), "copper")
    assert {document["interface"], *walked} == {getattr(form, "interface", "single")}


def test_what_is_written(copper):
    directory, ran = copper
    assert ran.code == 0, ran.err
    assert set(snapshot(directory)) == {"truth.json", "truth.png"}
    document = json.loads((directory / "truth.json").read_text())
    assert document == json.loads(ran.out)
    assert (document["schema"], document["version"], document["seed"]) == ("layerfit/truth", 1, 3)
    assert document["paths"] == [400] * 5
    assert np.std(np.asarray(Image.open(directory / "truth.png"), float)) > 5.0
    for plane in document["planes"]:
        sizes = {len(values) for values in (plane["outgoing_deg"], plane["walk"], *plane["forms"].values())}
        assert len(sizes) == 1


def test_what_is_said(copper):
    directory, ran = copper
    document = json.loads(ran.out)
    assert "incidence" in ran.err
    assert "75 deg" in ran.err
    assert f"Wrote truth.png and truth.json in {directory}/" in ran.err
    assert document["in_a_sentence"] in ran.err
    assert all(f"{name} is " in document["in_a_sentence"] for name in ("precise", "corrected", "faithful"))


def words(*errors: float | None) -> str:
    document: dict[str, Any] = {"incidence_deg": [0.0, 40.0, 75.0], "forms": {"corrected": {"error_rel": errors}}}
    return sentence(document)


def test_the_sentence():
    assert words(0.01, 0.02, 0.031) == "Below the coat, corrected is within 3.1 % of the walk at all angles."
    assert words(0.01, 0.02, 0.12) == "Below the coat, corrected is within 2 % of the walk up to 40 degrees, 12 % off at 75."
    assert words(0.2, 0.02, 0.03).endswith("within 3 % of the walk at 40 and 75 degrees, 20 % off at 0.")
    assert words(0.5, 0.9, 1.4).endswith("not to be trusted: 50 % to 140 % off the walk.")
    assert words(0.01, 0.02, None).endswith("within 2 % of the walk at all angles.")


def test_a_form_that_is_far_off_is_a_finding(tmp_path):
    preset = {"schema": "layerfit/preset", "version": 1, "name": "paint", "model": "faithful"}
    preset |= {"layers": [{"type": "coat", "alpha": 0.02}], "base": {"type": "lambert"}}
    (tmp_path / "paint.json").write_text(json.dumps(preset))
    ran = layerfit("truth", tmp_path / "paint.json", "-o", tmp_path / "out", "--paths", "100")
    assert ran.code == 1
    assert ran.out == ""


REFUSED = {
    "no coat": ([], 0.5, "there is no coat"),
    "index of air": ([{"type": "coat", "eta": 1.0}], 0.5, "index of air"),
    "V-cavities": ([{"type": "coat", "masking": "vcavity"}], 0.5, "V-cavities"),
    "nothing comes back": ([{"type": "coat"}], 0.0, "nothing to compare"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_materials_without_a_walk(name, tmp_path):
    layers, albedo, said = REFUSED[name]
    preset = {"schema": "layerfit/preset", "version": 1, "name": "x", "layers": layers}
    preset["base"] = {"type": "lambert", "albedo": albedo}
    (tmp_path / "x.json").write_text(json.dumps(preset))
    ran = layerfit("truth", tmp_path / "x.json", "-o", tmp_path / "out", "--paths", "100")
    assert ran.code == 2
    assert said in ran.err
    assert set(snapshot(tmp_path)) == {"x.json"}


def test_an_unknown_interface():
    with pytest.raises(InputError, match="did you mean 'multi'"):
        compare(COPPER, "copper", interface="mulit")


def test_a_directory_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    ran = layerfit("truth", "lacquered_copper", "-o", tmp_path / "file")
    assert ran.code == 2
    assert "is a file, not a directory" in ran.err
