"""What the form of the model does to fitted parameters, told by the random walk."""

import dataclasses
import json
from unittest import mock

import numpy as np
import pytest

from helpers import COPPER, sphere_view
from layerfit.capture.exr import write_exr
from layerfit.capture.samples import View
from layerfit.capture.scene import EnvironmentMap
from layerfit.fit import discrepancy
from layerfit.fit.discrepancy import PLACES, unmeasured
from layerfit.fit.fit import fit
from layerfit.fit.result import parameters, to_json
from layerfit.forms.corrected import Corrected
from layerfit.layers import Coat, Patina
from layerfit.render import predict
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert
from layerfit.walk import top_lobe, walk_rows

pytestmark = pytest.mark.optimised

TRUTH = {"coat.alpha": 0.12, "coat.eta": 1.5, "coat.tau": [0.08, 0.25, 0.7], "base.alpha": 0.2}
MATERIAL = Stack((Coat(alpha=0.12, eta=1.5, tau=TRUTH["coat.tau"]),), Conductor(alpha=0.2, **COPPER), Corrected())
START = Stack((Coat(alpha=0.2, eta=1.4, tau=[0.3, 0.3, 0.3]),), Conductor(alpha=0.3, **COPPER), Corrected())


def walked(view: View, stack: Stack, paths: int) -> np.ndarray:
    """Radiance at the pixels of a view by the random walk, (pixels, 3)."""
    samples = view.samples()
    wi, wo = samples.wi[:, 0], samples.wo
    rows = dataclasses.replace(stack, form=Corrected())
    coat = dataclasses.replace(
        rows.layers[0], tau=np.float32([TRUTH["coat.tau"]]), alpha=np.float32([0.12]), eta=np.float32([1.5])
    )
    base = Conductor(**{k: np.float32([v]) for k, v in {"alpha": 0.2, **COPPER}.items()})
    below = walk_rows(Stack((coat,), base), wi, wo, paths=paths, seed=5).mean
    top = np.concatenate([top_lobe(stack, i, o[None]) for i, o in zip(wi, wo, strict=True)])
    return ((top + below) * samples.weight[:, 0]).astype(np.float32)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    view = sphere_view(MATERIAL, tmp_path_factory.mktemp("walk"), 32)
    view = dataclasses.replace(view, target=walked(view, MATERIAL, 8000))
    with mock.patch.object(discrepancy, "PLACES", (0.0,)):  # it was drawn at the centres of the pixels
        return fit([view], START, free=tuple(TRUTH), starts=2, model_error=True)


def test_a_value_without_the_error_of_its_form_is_nearer_to_the_truth(result):
    rows = parameters(result)
    scale = {name: np.maximum(np.abs(wanted), 0.3 if name == "coat.tau" else 0.0) for name, wanted in TRUTH.items()}
    off = {
        key: np.concatenate([np.atleast_1d(np.abs(np.subtract(rows[n][key], TRUTH[n])) / scale[n]) for n in TRUTH])
        for key in ("value", "corrected")
    }
    assert np.median(off["value"]) > 0.02, "there is something to correct"
    assert np.median(off["corrected"]) < 0.4 * np.median(off["value"])
    assert np.max(off["corrected"]) < 0.6 * np.max(off["value"])


def test_the_truth_is_within_three_sigma(result):
    for name, row in parameters(result).items():
        pull = np.abs(np.subtract(row["value"], TRUTH[name])) / row["sigma"]
        assert np.all(pull < 3.0), name
        parts = np.hypot(row["sigma_noise"], row["sigma_model"])
        np.testing.assert_allclose(row["sigma"], parts, rtol=2e-3)
        assert np.all(np.asarray(row["sigma_model"]) > np.asarray(row["sigma_noise"])), "noise is not what makes it wrong"


def test_it_is_said_what_a_sigma_is_of(result):
    document = to_json(result, {}, None, {}, "preset.json")
    assert "what the form of the model gets wrong" in document["sigma_is"]
    json.dumps(document, allow_nan=False)
    assert "corrected" in repr(result)
    assert "corrected" in result._repr_html_()


def test_a_pixel_sees_all_of_its_surface(tmp_path):
    """A narrow highlight at 24 x 24 pixels is the mean of 4 x 4 smaller ones, each seen at its centre."""
    stack = Stack((Coat(alpha=0.1, eta=1.5),), Conductor(alpha=0.2, **COPPER), Corrected())
    folders = [tmp_path / name for name in ("fine", "coarse")]
    for folder in folders:
        folder.mkdir()
    fine, coarse = (sphere_view(stack, folder, side) for folder, side in zip(folders, (96, 24), strict=True))
    each = fine.image(fine.target).reshape(24, 4, 24, 4, 3).mean((1, 3)).reshape(-1, 3)
    whole = fine.covered.reshape(24, 4, 24, 4).all((1, 3)).ravel()[coarse.index]
    which = np.flatnonzero(whole)
    wanted = each[coarse.index[which]]
    inside = [predict(stack, *coarse.moved(which, dx, dy).samples().arrays[:3]) for dx in PLACES for dy in PLACES]
    bright = wanted > 0.2 * wanted.max()
    at_centre, over_pixel = (np.abs(f / wanted - 1.0)[bright] for f in (coarse.target[which], np.mean(inside, 0)))
    assert np.max(at_centre) > 0.05
    assert np.max(over_pixel) < 0.1 * np.max(at_centre)


def test_a_pixel_sees_all_of_its_surface_under_a_map(tmp_path):
    """The same of light from a map, by quadratures that draw the same numbers at all places of a pixel."""
    stack = Stack((Coat(alpha=0.07, eta=1.8),), Lambert(albedo=[0.1, 0.1, 0.1]), Corrected())
    height, width = 16, 32
    lamp = np.full((height, width), 0.1)
    lamp[4:6, 18:20] = 50.0
    write_exr(tmp_path / "map.exr", dict.fromkeys("RGB", lamp))
    light = (EnvironmentMap(tmp_path / "map.exr"),)
    view = sphere_view(stack, tmp_path, 24)
    view = dataclasses.replace(view, reference=dataclasses.replace(view.reference, lights=light))
    at = [view.moved(np.arange(len(view.index)), dx, dy) for dx in PLACES for dy in PLACES]
    centre, *inside = (predict(stack, *v.samples(quadrature=4000).arrays[:3]) for v in (view, *at))
    wanted = centre - np.mean(inside, 0)
    found = discrepancy._extent(stack, view, view.index)
    assert np.max(np.abs(wanted)) > 0.05 * np.max(centre), "a lamp's image is narrower than a pixel"
    assert np.linalg.norm(found - wanted) < 0.4 * np.linalg.norm(wanted), "of 496 directions"


def test_a_bare_surface_has_no_error(tmp_path):
    stack = Stack((), Conductor(alpha=0.3, **COPPER))
    result = fit(
        [sphere_view(stack, tmp_path, 32)],
        Stack((), Conductor(alpha=0.2, **COPPER)),
        free=["base.alpha"],
        starts=1,
        model_error=True,
    )
    row = parameters(result)["base.alpha"]
    assert (row["sigma_model"], row["corrected"]) == (0.0, row["value"])
    assert not result.notes


@pytest.mark.parametrize(
    ("stack", "why"),
    [
        (Stack((Patina(),), Conductor()), "place to place"),
        (Stack((Coat(masking="vcavity"),), Conductor()), "V-cavities"),
        (Stack((Coat(tau_s=[0.1, 0.2, 0.3]),), Conductor()), "all channels alike"),
        (Stack((Coat(film_nm=200.0, film_eta=2.0),), Conductor()), "thin film"),
    ],
)
def test_what_the_walk_does_not_know_is_said(stack, why):
    assert why in (unmeasured(stack) or "")
