"""The published form: with a smooth lacquer, and with three coats over every base."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, FLOOR, LAFORTUNE, REL, WOOD, brdf, brdf_rows, cases, close, hemisphere
from layerfit.forms.faithful import Faithful
from layerfit.layers import Coat
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import (
    BASES,
    Blinn,
    CarPaint,
    Conductor,
    CookTorrance,
    Dielectric,
    Flakes,
    KubelkaMunk,
    Lambert,
    OrenNayar,
    Phong,
    TorranceSparrow,
)

NEUMANN = Faithful("n", "n", masked=False)
"""Neumann and Neumann 1989: a smooth lacquer over a diffuse base, one bounce, its mirror lobe apart."""

WI, WO = hemisphere(32, 1), hemisphere(32, 2)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_smooth_lacquer_has_the_digits_of_neumann_and_neumann(oracle, dtype):
    """Light from below; what the top reflects is taken off."""
    for case in cases(oracle)["nn1989"]:
        i = case["in"]
        stack = Stack((Coat(alpha=1e-4, eta=i["eta"], tau=i["tau"]),), Lambert(albedo=i["rho"]), NEUMANN).astype(dtype)
        wi, wo = (jnp.asarray(i[key], dtype) for key in ("wi", "wo"))
        wanted = float(case["out"])
        if dtype == np.float32:
            stack64, *ways = jax.tree.map(lambda x: x.astype(np.float64), (stack, wi, wo))
            wanted = float(brdf(stack64, *ways) - stack64.layers[0].evaluate(*ways))
        lobe = float(stack.layers[0].evaluate(wi, wo))
        found = float(brdf(stack, wi, wo)) - lobe
        assert close(found, wanted, REL[dtype], FLOOR[dtype] * max(1.0, lobe)), case


def test_light_that_facets_hide_is_what_sets_them_apart():
    """A smooth coat hides none; a rough one lets more out than its facets pass."""
    base = Lambert(albedo=0.7)
    for alpha, most in ((1e-4, 1e-5), (0.5, np.inf)):
        plain, masked = (
            np.asarray(brdf_rows(Stack((Coat(alpha=alpha, tau=0.2),), base, form).astype(np.float64), WI, WO))
            for form in (NEUMANN, dataclasses.replace(NEUMANN, masked=True))
        )
        assert np.all(masked >= plain)
        assert np.max(masked / plain - 1.0) < most
    assert np.median(masked / plain - 1.0) > 0.01


def test_the_lacquer_is_reciprocal_and_prints(gl):
    stack = Stack((Coat(alpha=0.05, tau=[0.1, 0.2, 0.4]),), Lambert(albedo=WOOD), NEUMANN)
    there, back = (brdf_rows(stack.astype(np.float64), *ways) for ways in ((WI, WO), (WO, WI)))
    np.testing.assert_allclose(there, back, rtol=1e-12)
    parity = check_pairs(print_material(stack, "lacquer"), 4096)
    assert parity.passed, parity


ANY = {
    "conductor": Conductor(alpha=0.2, **COPPER),
    "dielectric": Dielectric(alpha=0.3, eta=1.9),
    "lambert": Lambert(albedo=WOOD),
    "oren_nayar": OrenNayar(albedo=WOOD, sigma=0.4),
    "phong": Phong(kd=WOOD, ks=0.3, exponent=40.0),
    "blinn": Blinn(kd=WOOD, ks=0.2, exponent=60.0),
    "lafortune": LAFORTUNE,
    "torrance_sparrow": TorranceSparrow(ks=12.0, kappa=7.0, kd=0.1, **COPPER),
    "cook_torrance": CookTorrance(alpha=0.25, ks=0.6, kd=0.1, **COPPER),
    "car_paint": CarPaint(kd=WOOD, ks_2=0.2, f0_2=0.8, alpha_2=0.15),
    "flakes": Flakes(coverage=0.6, albedo=0.1, **COPPER),
    "kubelka_munk": KubelkaMunk(substrate=0.3),
}
COATS = (
    Coat(name="lacquer", alpha=0.1, eta=1.5, tau=0.1, masking="vcavity"),
    Coat(name="binder", alpha=0.3, eta=1.6, tau=[0.1, 0.2, 0.4]),
    Coat(name="primer", alpha=0.2, eta=1.7, distribution="beckmann"),
)


def below(base, *coats):
    return np.asarray(brdf_rows(Stack(coats, base, Faithful()).astype(np.float64), WI, WO))


def test_every_base_is_below_them():
    assert set(ANY) == set(BASES)


@pytest.mark.parametrize("name", ANY)
def test_three_coats_over_any_base(name):
    """Reciprocal, and a coat that is not there changes nothing, wherever it lies."""
    base = ANY[name]
    stack = Stack(COATS, base, Faithful()).astype(np.float64)
    there, back = np.asarray(brdf_rows(stack, WI, WO)), np.asarray(brdf_rows(stack, WO, WI))
    np.testing.assert_allclose(there, back, rtol=1e-11)
    assert np.all(there > 0.0)
    lacquer, binder, _ = COATS
    two = below(base, lacquer, binder)
    # Named by its place, and with depths of nothing: of one structure, which is compiled once.
    none = dataclasses.replace(binder, name="primer", alpha=0.4, eta=1.6, tau=[0.0, 0.0, 0.0])
    np.testing.assert_allclose(below(base, lacquer, binder, none), two, rtol=1e-11)
    none, primer = dataclasses.replace(none, name="binder", eta=1.5), dataclasses.replace(binder, name="primer")
    np.testing.assert_allclose(below(base, lacquer, none, primer), two, rtol=1e-11)
    np.testing.assert_allclose(below(base, Coat(name="none", eta=1.0), lacquer, binder), two, rtol=1e-11)
    black = dataclasses.replace(binder, tau=[60.0, 60.0, 60.0])
    np.testing.assert_allclose(below(base, lacquer, black), below(Lambert(albedo=0.0), lacquer, black), rtol=1e-12)
