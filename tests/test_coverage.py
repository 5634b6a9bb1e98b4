"""Sigmas are true: of many fits of the model's own images under noise, as many end within one and two sigmas as Gaussian errors leave."""

import numpy as np
import pytest
from sigma_coverage import MODELS, limits, noisy, pulls, row, shares, view_of

pytestmark = [pytest.mark.slow, pytest.mark.optimised]

FITS = 100
TRIED = ("phong", "corrected over lambert")
"""A lobe and a coat; the script tries every model."""

CHANCE = 0.999
"""Seeds are fixed, so that this says how near the shares are, not how often the test fails."""

MEAN, SPREAD = 0.15, 0.08
"""Of the pulls of two hundred fits, by chance .07 and .05 if the parameters of a fit told the same."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sphere")
    return {model: pulls(MODELS[model], folder, FITS) for model in TRIED}


def test_as_many_values_lie_within_one_and_two_sigmas_as_should(found):
    every = np.concatenate([values.ravel() for parameters in found.values() for values in parameters.values()])
    assert np.all(np.isfinite(every)), "a value without a sigma"
    for share, (low, high) in zip(shares(every), limits(FITS * len(TRIED), CHANCE), strict=True):
        assert low <= share <= high
    assert abs(every.mean()) < MEAN
    assert abs(every.std() - 1.0) < SPREAD


def test_no_parameter_is_far_from_it(found):
    for parameters in found.values():
        for name, values in parameters.items():
            assert abs(values.mean()) < 0.5, name
            assert 0.75 < values.std() < 1.25, name


def test_the_noise_is_what_it_says(tmp_path):
    clean = view_of(MODELS["lambert"], tmp_path)
    seen = [noisy(clean, 0.02, 0.7, seed) for seed in range(200)]
    scatter = np.std([view.target for view in seen], 0) / seen[0].noise
    np.testing.assert_allclose(scatter.mean(), 1.0, atol=0.01)
    np.testing.assert_allclose(seen[0].noise, 0.02 * np.quantile(clean.target, 0.98) ** 0.3 * clean.target**0.7, rtol=1e-12)


def test_shares_and_limits_are_those_of_a_normal_distribution():
    values = np.random.default_rng(0).normal(size=(100_000, 1))
    np.testing.assert_allclose(shares(values), (0.683, 0.954), atol=0.005)
    np.testing.assert_allclose(limits(100), [(0.59, 0.77), (0.91, 0.99)], atol=0.011)
    values[0] = np.nan
    assert row(values)["without_sigma"] == 1
