"""Car paint: 50-digit values of its lobes, and the published paints as presets."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from helpers import FLOOR, REL, brdf, cases, close
from layerfit.errors import InputError
from layerfit.preset import read_preset, stack_of
from layerfit.stack import Stack
from layerfit.surfaces import CarPaint

PAINTS = {
    "ford f8": "ford_f8",
    "polaris silber": "polaris_silver",
    "opel titan": "opel_titan",
    "bmw339": "bmw_339",
    "2k acrylack": "acrylic_2k",
    "white": "white",
    "blue": "blue",
    "blue matte": "blue_matte",
}
"""Published names and those of the presets."""


def rump(case):
    """The paint of a case: lobes of (ks, f0, m)."""
    fields = {}
    for suffix, (ks, f0, alpha) in zip(("", "_2", "_3"), case["lobes"], strict=True):
        fields |= {f"ks{suffix}": ks, f"f0{suffix}": f0, f"alpha{suffix}": alpha}
    return Stack((), CarPaint(kd=case["kd"], scaling="rump", **fields))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_lobes_have_their_digits(oracle, dtype):
    for case in cases(oracle)["rump2008"]:
        i = case["in"]
        stack = rump(i).astype(dtype)
        wi, wo = (jnp.asarray(i[key], dtype) for key in ("wi", "wo"))
        wanted = float(case["out"])
        if dtype == np.float32:
            wanted = float(brdf(stack.astype(np.float64), wi.astype(np.float64), wo.astype(np.float64)))
        assert close(float(brdf(stack, wi, wo)), wanted, REL[dtype], FLOOR[dtype]), i


def test_presets_are_the_published_paints(measured):
    published = json.loads((measured / "gunther2005_carpaint.json").read_text())["paints"]
    assert set(published) == set(PAINTS)
    for name, paint in published.items():
        base = read_preset(f"car_paint_{PAINTS[name]}").base
        np.testing.assert_allclose(base.kd, paint["kd"])
        there = [k for k in range(3) if np.any(np.array(paint["ks"][k]) > 0.0)]
        assert len(base.lobes) == len(there)
        for k, lobe in zip(there, base.lobes, strict=True):
            np.testing.assert_allclose(lobe.ks, paint["ks"][k])
            assert (lobe.f0, lobe.alpha) == (paint["r0"][k], paint["m"][k])


@pytest.mark.parametrize("name", sorted(set(PAINTS.values()) - {"acrylic_2k"}))
def test_the_narrow_lobe_sends_back_what_a_clear_coat_does(name):
    """Of the ways to scale published lobes this one gives a lacquer's 4 % at normal incidence; the others a quarter of it."""
    clear = read_preset(f"car_paint_{name}").base.lobes[-1]
    assert clear.alpha < 0.05
    assert 0.02 < float(np.mean(clear.reflectance(jnp.ones(())))) < 0.06


def test_scalings_differ_by_what_they_say():
    wi, wo = jnp.array([0.3, 0.0, np.sqrt(0.91)]), jnp.array([-0.2, 0.1, np.sqrt(0.95)])
    own, rumps, published = (
        float(brdf(Stack((), CarPaint(scaling=s)).astype(np.float64), wi, wo)) for s in ("normalized", "rump", "cook_torrance")
    )
    assert rumps / own == pytest.approx(4.0 / np.pi, rel=1e-12)
    assert published / own == pytest.approx(4.0, rel=1e-12)


def test_a_lobe_that_is_not_whole_is_refused():
    with pytest.raises(InputError, match="f0_2 is missing"):
        stack_of({"base": {"type": "car_paint", "ks_2": 0.1, "alpha_2": 0.1}}, "here")
