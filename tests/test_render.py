"""Pixels of a material: sums over light samples, in parts of any number."""

import itertools

import jax
import numpy as np
import pytest

from helpers import COPPER, hemisphere, varnish
from layerfit.render import predict, radiance
from layerfit.stack import Stack
from layerfit.surfaces import BASES, Conductor

STACK = Stack((varnish(),), Conductor(alpha=0.2, **COPPER))


@pytest.mark.parametrize(("pixels", "lights"), [(5, 1), (3, 20), (3, 513), (2, 1030)])
def test_a_pixel_is_the_sum_over_its_lights(pixels, lights):
    """However many are summed at once, and however they are padded to make equal parts."""
    wi = hemisphere(pixels * lights).reshape(pixels, lights, 3)
    wo = hemisphere(pixels, 1)
    weight = np.random.default_rng(0).random((pixels, lights, 3)) / lights
    wanted = jax.jit(radiance)(STACK.astype(np.float64), wi, wo, weight)
    np.testing.assert_allclose(predict(STACK, wi, wo, weight), wanted, rtol=2e-5)


def test_classes_with_fields_alike_are_of_different_structure():
    """Structures are what compiled functions are kept by: a Blinn may not be drawn by what was compiled for a Phong."""
    bases = [cls() for cls in BASES.values()]
    alike = [(a, b) for a, b in itertools.combinations(bases, 2) if len(jax.tree.leaves(a)) == len(jax.tree.leaves(b))]
    assert alike
    for a, b in alike:
        assert jax.tree.structure(a) != jax.tree.structure(b), (a, b)
    leaves, structure = jax.tree.flatten(bases[0])
    assert jax.tree.structure(jax.tree.unflatten(structure, leaves)) == structure
