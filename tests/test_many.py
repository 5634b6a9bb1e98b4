"""Fits in groups give what each gives alone, and leave to `fit` what is not theirs."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from helpers import sphere_view
from layerfit import fit
from layerfit.capture.scene import Constant
from layerfit.fit import many
from layerfit.fit.medians import InBlocks
from layerfit.fit.residuals import scaled
from layerfit.fit.weights import COLUMNS
from layerfit.forms.faithful import Faithful
from layerfit.layers import Coat
from layerfit.render import predict
from layerfit.stack import Stack
from layerfit.surfaces import Lambert

OF_SIGMA = 0.05
"""How far a value may be from that of a fit alone, in sigmas. Derivatives are kept on a short way, which is worth a thousandth; where a reweighting
ends is worth the rest."""

TRUTH = Stack((Coat(alpha=0.15, eta=1.5, tau=[0.1, 0.3, 0.6]),), Lambert(albedo=[0.5, 0.28, 0.13]), Faithful())
START = Stack((Coat(alpha=0.3, eta=1.4, tau=0.3),), Lambert(albedo=[0.5, 0.28, 0.13]), Faithful())
OPAQUE = dataclasses.replace(TRUTH, layers=(Coat(alpha=0.15, eta=1.5, tau=4.0),))
FREE = ("coat.alpha", "coat.eta", "coat.tau")


@pytest.fixture(scope="module")
def see(tmp_path_factory):
    """A sphere of a coat this thick, with noise that its file states, and fireflies."""
    plain = sphere_view(TRUTH, tmp_path_factory.mktemp("sphere"), 40)

    def make(thickness=1.0, seed=0, of=TRUTH):
        rng = np.random.default_rng(seed)
        reference = dataclasses.replace(plain.reference, thickness_scale={"coat": thickness})
        view = dataclasses.replace(plain, reference=reference)
        image = predict(scaled(of, view.scales(of)), *view.samples().arrays)
        law = 0.02 * image**0.7
        image = image + law * rng.normal(size=image.shape)
        image[rng.choice(len(image), 6, replace=False)] *= 3.0
        noise = law * np.exp(0.3 * rng.normal(size=image.shape))
        return dataclasses.replace(view, target=image.astype(float), noise=noise)

    return make


def test_a_fit_in_a_group_is_that_of_its_own(see):
    """Two pictures of two thicknesses, noise that the files state, fireflies: three such scenes, one after the other."""
    scenes = [[see(seed=2 * k), see(2.0, seed=2 * k + 1)] for k in range(3)]
    candidates = [many.candidate(views, START, free=FREE) for views in scenes]
    assert len({candidate.kind for candidate in candidates}) == 1
    for views, found in zip(scenes, many.begin(candidates)(), strict=True):
        alone = fit(views, START, free=FREE, starts=1)
        sigma = alone.uncertainty.sigma
        assert np.all(np.abs(found.vector - alone.vector) < OF_SIGMA * sigma)
        np.testing.assert_allclose(found.uncertainty.sigma, sigma, rtol=0.01)
        np.testing.assert_allclose(found.uncertainty.correlation, alone.uncertainty.correlation, atol=0.01)
        assert found.misfit == pytest.approx(alone.misfit, rel=1e-3)
        assert found.cost == pytest.approx(alone.cost, rel=1e-4)


def test_what_is_not_of_the_ordinary_kind_is_left_alone(see):
    view = see()
    sky = dataclasses.replace(view, reference=dataclasses.replace(view.reference, lights=(Constant((1.0, 1.0, 1.0)),)))
    for views, options in (
        ([sky], {}),
        ([view], {"starts": 2}),
        ([view], {"metric": "log"}),
        ([view], {"free": [*FREE, "light.ambient"]}),
        ([view, see(2.0)], {"free": FREE, "each": ["coat.alpha"]}),
    ):
        assert many.candidate(views, START, **options) is None


def test_a_fit_that_leaves_the_ordinary_way_says_so(see):
    """A coat that may hide its base asks for a profile; a group is not the place for it."""
    views = [see(of=OPAQUE), see(2.0, seed=1, of=OPAQUE)]
    assert many.begin([many.candidate(views, START, free=FREE)])() == [None]


@pytest.mark.parametrize("count", [1, 2, 61, 62])
def test_medians_of_blocks_are_those_of_columns(count):
    """Of even and odd numbers, of two references in four blocks."""
    rng = np.random.default_rng(count)
    values = rng.gamma(0.5, size=(4, 3, 32)).astype(np.float32)
    of = np.array([0, 1, 0, 1])
    place = np.arange(4)[:, None] // 2 * 32 + np.arange(32)
    there = np.broadcast_to((place < count)[:, None], values.shape)
    over = InBlocks(jnp.asarray(there), jnp.asarray(of), 2)
    middle, total, level = (np.asarray(f) for f in (over.middle(values), over.total(values), over.level(values, there)))
    for reference in range(2):
        mine = np.moveaxis(values, 1, 2)[of == reference][np.moveaxis(there, 1, 2)[of == reference]].reshape(-1, 3)
        assert len(mine) == count
        first = np.flatnonzero(of == reference)[0]
        np.testing.assert_array_equal(middle[first, :, 0], COLUMNS.middle(mine))
        np.testing.assert_allclose(total[first, :, 0], COLUMNS.total(mine), rtol=1e-5)
        assert level[first, 0, 0] == COLUMNS.level(mine, mine >= 0.0)
