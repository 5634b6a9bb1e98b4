"""Intervals from the profile of the cost, on costs that are known and on a coat that hides its base."""

import dataclasses

import numpy as np
import pytest

from helpers import COPPER, sphere_view
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.profile import along, lower_limit, scatter, threshold
from layerfit.fit.result import to_json
from layerfit.fit.starts import Minimum
from layerfit.fit.words import parameters as said
from layerfit.layers import Coat
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert

GRAM = np.array([[2.0, 1.2], [1.2, 1.0]])
ORIGIN = np.array([1.0, -2.0])
WIDE = (-50.0, 50.0)


def parabola(u, slot):
    """Refit of a quadratic cost: the other entry goes where its slope ends."""
    other = 1 - slot
    away = u - ORIGIN
    away[other] = -GRAM[other, slot] / GRAM[other, other] * away[slot]
    return Minimum((0,), ORIGIN + away, float(0.5 * away @ GRAM @ away), GRAM)


BEST = Minimum((0,), ORIGIN, 0.0, GRAM)


@pytest.mark.parametrize("slot", [0, 1])
@pytest.mark.parametrize("first", [0.01, 0.3, 2.0])
def test_the_interval_of_a_parabola_is_that_of_its_inverse(slot, first):
    limit = 0.5 * 3.841
    found = along(parabola, BEST, slot, first, limit, WIDE)
    half = np.sqrt(2.0 * limit * np.linalg.inv(GRAM)[slot, slot])
    np.testing.assert_allclose(found.interval, (ORIGIN[slot] - half, ORIGIN[slot] + half), rtol=1e-6)
    assert np.all(np.diff(found.at) > 0.0)


def flat(u, slot):
    """A cost that does not care how large the first entry is, once it is."""
    return Minimum((0,), u, float(np.exp(-2.0 * u[0])), np.zeros((2, 2)))


def test_a_side_that_does_not_rise_has_no_end():
    best = flat(np.array([4.0, 0.0]), 0)
    lower, upper = along(flat, best, 0, 0.1, 0.1, (0.0, 10.0)).interval
    assert upper is None
    assert lower == pytest.approx(-0.5 * np.log(0.1), rel=0.05)
    found = lower_limit(flat, best, 0, 0.1, 0.1, (0.0, 10.0), np.ones(2))
    assert found is not None
    assert found.interval == pytest.approx((lower, None))


def black(u, slot):
    """A base of any colour below an absorbing coat, of which no light comes back: what is left of it is exp(-2 depth)."""
    return Minimum((0,), np.array([u[0], 0.0]), 0.0, np.diag([0.0, 1e4 * np.exp(-4.0 * u[0])]))


@pytest.mark.parametrize("fitted", [0.1, 3.0])
def test_what_hides_any_base_is_deep_and_not_over_a_black_one(fitted):
    """The cost is the same everywhere. Integrated over the colour, 1 / sqrt(1 + (100 exp(-2 depth))^2 / 12) is left of the likelihood."""
    best = black(np.array([fitted, 0.0]), 0)
    limit = threshold(1.0, 0.0)
    found = lower_limit(black, best, 0, 0.1, limit, (0.0, 10.0), np.ones(2))
    assert found.integrated
    lower, upper = found.interval
    left = np.exp(-0.5 * 3.841)
    assert upper is None
    assert lower == pytest.approx(-0.25 * np.log(12e-4 * (1.0 / left**2 - 1.0)), rel=0.02)


def test_what_is_seen_is_no_lower_limit():
    assert lower_limit(parabola, BEST, 0, 0.1, 1.0, WIDE, np.ones(2)) is None


def test_the_threshold_is_of_chi_square_and_of_what_no_noise_explains():
    assert threshold(2.0, 0.0) == pytest.approx(3.841)
    assert threshold(2.0, 400.0) == pytest.approx(3.841 + 100.0)
    assert threshold(2.0, 400.0, 7.0) == pytest.approx(3.841 + 107.0), "and of what the form is known to get wrong"


@pytest.mark.parametrize("slot", [0, 1])
def test_the_scatter_is_that_of_the_residuals_whatever_the_weights_expect(slot):
    assert scatter(GRAM, 3.0 * np.linalg.inv(GRAM), slot) == pytest.approx(3.0)


@pytest.mark.parametrize("slot", range(len(GRAM)))
def test_the_scatter_does_not_know_of_a_parameter_that_hardly_has_an_effect(slot):
    """Its column is parallel to another, and so small that the covariance leaves it out."""
    n = len(GRAM)
    gram, covariance = np.zeros((n + 1, n + 1)), np.full((n + 1, n + 1), 0.0)
    gram[:n, :n] = GRAM
    gram[n, :n] = gram[:n, n] = 1e-20 * GRAM[0]
    gram[n, n] = 1.01e-40 * GRAM[0, 0]
    covariance[:n, :n], covariance[n, n] = 3.0 * np.linalg.inv(GRAM), np.inf
    assert scatter(gram, covariance, slot) == pytest.approx(3.0)


DEEP = Stack((Coat(alpha=0.12, eta=1.5, tau=[6.0, 6.0, 0.5]),), Conductor(alpha=0.2, **COPPER))


@pytest.fixture(scope="module")
def view(tmp_path_factory):
    return sphere_view(DEEP, tmp_path_factory.mktemp("deep"), 32)


@pytest.fixture(scope="module")
def result(view):
    """A coat that hides its base in red and green, under noise that hides what is left of it."""
    noise = 0.02 * view.target**0.7
    noisy = view.target + noise * np.random.default_rng(0).normal(size=noise.shape)
    start = dataclasses.replace(DEEP, layers=(dataclasses.replace(DEEP.layers[0], tau=np.full(3, 2.0)),))
    return fit([dataclasses.replace(view, target=noisy, noise=noise)], start, starts=4, profile=["coat.eta"])


def test_a_depth_that_hides_the_base_is_a_lower_limit(result):
    document = to_json(result, {}, None, {}, "preset.json")
    assert "lower_limit:coat.tau" in document["flags"]
    red, green, blue = document["parameters"]["coat.tau"]["interval_95"]
    for lower, upper in (red, green):
        assert upper is None
        assert 1.0 < lower < 6.0
    assert blue is None, "the base is seen there, and no profile was asked for"
    row = document["parameters"]["coat.tau"]
    assert row["sigma"][:2] == [None, None], "a limit has no sigma"
    assert row["sigma"][2] > 0.0
    assert document["parameters"]["base.alpha"]["identifiable"], "blue shows it"
    line = next(line for line in said(document["parameters"]) if "coat.tau" in line)
    assert f"at least [{red[0]:.4g}, {green[0]:.4g}, " in line


def test_below_a_coat_that_may_be_opaque_nothing_is_known(tmp_path):
    stack = dataclasses.replace(DEEP, layers=(dataclasses.replace(DEEP.layers[0], tau=np.full(3, 3.0)),))
    view = sphere_view(stack, tmp_path, 32)
    noise = 0.05 * view.target**0.7
    noisy = view.target + noise * np.random.default_rng(0).normal(size=noise.shape)
    document = to_json(
        fit([dataclasses.replace(view, target=noisy, noise=noise)], stack, starts=1), {}, None, {}, "preset.json"
    )
    assert {"lower_limit:coat.tau", "not_identifiable:base.alpha"} <= set(document["flags"])
    assert document["parameters"]["base.alpha"]["sigma"] is None
    assert document["parameters"]["coat.eta"]["sigma"] > 0.0


def test_a_depth_over_a_base_that_could_be_black_is_a_lower_limit_with_a_note(tmp_path):
    """No light comes back from a Lambert base at this depth; a fit of its colour and the depth ends anywhere."""
    stack = dataclasses.replace(
        DEEP, layers=(dataclasses.replace(DEEP.layers[0], tau=np.full(3, 5.0)),), base=Lambert(albedo=[0.5, 0.3, 0.6])
    )
    view = sphere_view(stack, tmp_path, 24)
    noise = 0.02 * view.target**0.7
    noisy = view.target + noise * np.random.default_rng(0).normal(size=noise.shape)
    black = dataclasses.replace(
        stack, layers=(dataclasses.replace(DEEP.layers[0], tau=np.full(3, 0.3)),), base=Lambert(albedo=0.02)
    )
    result = fit([dataclasses.replace(view, target=noisy, noise=noise)], black, free=["coat.tau", "base.albedo"], starts=1)
    document = to_json(result, {}, None, {}, "preset.json")
    assert "lower_limit:coat.tau" in document["flags"]
    for lower, upper in document["parameters"]["coat.tau"]["interval_95"]:
        assert upper is None
        assert 1.0 < lower < 5.0
    assert any("coat.tau is a lower limit if what lies below is not black" in note for note in document["notes"])


def test_an_interval_that_is_asked_for_holds_the_truth(result):
    row = to_json(result, {}, None, {}, "preset.json")["parameters"]["coat.eta"]
    lower, upper = row["interval_95"]
    assert lower < 1.5 < upper
    assert lower < row["value"] < upper
    assert row["lower_limit"] is False
    assert any(p["parameter"] == "coat.eta" and min(p["rise"]) == 0.0 for p in to_json(result, {}, None, {}, "")["profiles"])


def test_a_profile_of_what_is_not_fitted_is_refused(view):
    with pytest.raises(InputError, match=r"no profile of 'coat\.taw' \(did you mean 'coat\.tau'\?\): it is not fitted"):
        fit([view], DEEP, profile=["coat.taw"])
