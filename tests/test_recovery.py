"""Fits of renders by others, from a poor start, against what is known of them."""

import json

import numpy as np
import pytest
from renders import render

from layerfit.capture.load import load
from layerfit.fit.fit import fit
from layerfit.fit.result import to_json

pytestmark = [pytest.mark.slow, pytest.mark.optimised]


@pytest.fixture(scope="module")
def recover(references, tmp_path_factory):
    """Fit one render of the folder; the document of the fit, and the truth."""
    scratch = tmp_path_factory.mktemp("scenes")

    def run(name, model=None):
        case = render(references / f"{name}.json", scratch, model)
        result = fit(load(case.scene), case.scene.start)
        return to_json(result, {}, None, {}, "preset.json") | {"residual": result.trace[-1].error}, case.truth

    return run


def value(document, name):
    return np.asarray(document["parameters"][name]["value"])


def test_a_rough_conductor_is_found_to_the_last_digits(recover):
    found, truth = recover("ex_roughconductor_cu")
    np.testing.assert_allclose(value(found, "base.alpha"), truth["base.alpha"], rtol=1e-3)
    assert found["residual"] < 1e-5
    assert found["converged"]


def test_the_index_of_a_plastic_is_found(recover):
    found, truth = recover("ex_roughplastic")
    np.testing.assert_allclose(value(found, "coat.eta"), truth["coat.eta"], rtol=0.02)
    np.testing.assert_allclose(value(found, "coat.alpha"), truth["coat.alpha"], rtol=0.03)


def test_lacquered_copper_is_found(recover):
    found, truth = recover("pt_cu_amber")
    np.testing.assert_allclose(value(found, "coat.eta"), truth["coat.eta"], rtol=0.04)
    np.testing.assert_allclose(value(found, "coat.alpha"), truth["coat.alpha"], rtol=0.08)
    np.testing.assert_allclose(value(found, "base.alpha"), truth["base.alpha"], rtol=0.08)
    np.testing.assert_allclose(value(found, "coat.tau"), truth["coat.tau"], atol=0.05)


def test_varnished_wood_says_what_it_cannot_tell_apart(recover):
    found, truth = recover("pt_wood_varnish")
    albedo, tau = value(found, "base.albedo"), value(found, "coat.tau")
    pairs = {frozenset(pair[:2]): pair[2] for pair in found["correlations"]}
    for c in range(3):
        assert pairs[frozenset((f"base.albedo[{c}]", f"coat.tau[{c}]"))] > 0.9
    assert any(flag.startswith("correlated:") for flag in found["flags"])
    # What light does below a clear coat is seen through their combination, which is right where each alone is not.
    seen = lambda albedo, tau: np.asarray(albedo) * np.exp(-2.25 * np.asarray(tau))  # noqa: E731
    np.testing.assert_allclose(seen(albedo, tau), seen(truth["base.albedo"], truth["coat.tau"]), rtol=0.08)


@pytest.mark.parametrize("name", ["cy_coat_cu_tint", "cy_coat_wood_asuser"])
def test_a_coat_of_another_law_is_fitted_as_well_as_it_can_be(recover, name):
    found, _ = recover(name)
    assert found["converged"]
    assert found["residual"] < 0.12
    json.dumps(found, allow_nan=False)
