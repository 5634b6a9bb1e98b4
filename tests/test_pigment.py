"""Pigment in layers as a base: two fluxes against 50-digit values, below a coat, in a fit, in a shader, and as shipped paints."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import FLOOR, REL, brdf, brdf_rows, cases, close, direction, hemisphere, varnish
from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.optics.fresnel import transmittance_dielectric
from layerfit.optics.scattering import kubelka_munk, kubelka_munk_over, saunderson, stacked
from layerfit.preset import preset_of, read_preset, stack_of
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import KubelkaMunk, Lambert
from layerfit.walk import walk_rows

WI, WO = hemisphere(64, 1), hemisphere(64, 2)
UP = jnp.array([0.0, 0.0, 1.0])

GLAZE = KubelkaMunk(kx=[0.9, 0.3, 0.2], sx=0.1, kx_2=[0.1, 0.4, 3.5], sx_2=[1.9, 1.3, 0.02], substrate=0.8)


def values(layers, base, form=None):
    stack = Stack(layers, base) if form is None else Stack(layers, base, form)
    return np.asarray(brdf_rows(stack.astype(np.float64), WI, WO))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_the_albedo_has_its_digits(oracle, dtype):
    for case in cases(oracle)["km_over"]:
        i = {key: np.asarray(value, dtype) for key, value in case["in"].items()}
        stack = Stack((), KubelkaMunk(kx=i["K"] * i["x"], sx=i["S"] * i["x"], substrate=i["Rg"]))
        value, wanted = float(brdf(stack.astype(dtype), UP.astype(dtype), UP.astype(dtype))) * np.pi, float(case["out"])
        if dtype == np.float32:
            wanted = float(brdf(stack.astype(np.float64), UP, UP)) * np.pi
        assert close(value, wanted, REL[dtype], FLOOR[dtype]), case


def test_without_a_substrate_what_passes_is_lost(oracle):
    for case in cases(oracle)["km_layer"][:8]:
        K, S, x = case["in"].values()
        assert close(float(KubelkaMunk(kx=K * x, sx=S * x).albedo), float(case["out"][0]), 1e-12, 1e-13)
    absent, black = KubelkaMunk(kx=0.3, sx=0.7), KubelkaMunk(kx=0.3, sx=0.7, substrate=0.0)
    np.testing.assert_allclose(values((), absent), values((), black), rtol=1e-14)
    assert len(jax.tree.leaves(absent)) == 2


def test_layers_compose():
    """From the substrate up, or by their fluxes from the top down; two of one pigment are one of twice the thickness."""
    three = KubelkaMunk(kx=0.4, sx=0.9, kx_2=1.1, sx_2=0.2, kx_3=0.05, sx_3=3.0, substrate=0.3)
    top, middle, lowest = three.pigments
    down = stacked(top, stacked(middle, lowest))
    assert float(down.R) == pytest.approx(float(dataclasses.replace(three, substrate=None).albedo), rel=1e-13)
    halves = KubelkaMunk(kx=0.2, sx=0.45, kx_2=0.2, sx_2=0.45, substrate=0.3)
    assert float(halves.albedo) == pytest.approx(float(KubelkaMunk(kx=0.4, sx=0.9, substrate=0.3).albedo), rel=1e-13)
    nothing = dataclasses.replace(three, kx=0.0, sx=0.0)
    below = KubelkaMunk(kx=1.1, sx=0.2, kx_2=0.05, sx_2=3.0, substrate=0.3)
    assert float(nothing.albedo) == pytest.approx(float(below.albedo), rel=1e-14)


def test_a_deep_layer_is_seen_by_the_ratio_alone():
    deep = [float(KubelkaMunk(kx=0.05 * x, sx=x, substrate=0.9).albedo) for x in (200.0, 800.0)]
    assert deep[0] == pytest.approx(deep[1], rel=1e-12)
    assert (1.0 - deep[0]) ** 2 / (2.0 * deep[0]) == pytest.approx(0.05, rel=1e-12)


FORMS = {"corrected": Corrected(), "precise": Precise(), "faithful": Faithful()}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_below_a_coat_it_is_a_lambertian_boundary_of_its_albedo(form):
    np.testing.assert_allclose(
        values((varnish(),), GLAZE, form), values((varnish(),), Lambert(albedo=GLAZE.albedo), form), rtol=1e-13
    )


def test_a_clear_coat_is_the_boundary_of_saunderson():
    """Diffuse light from everywhere, sent anywhere, without what the top reflects: for each direction the coat has the same series."""
    u, weight = np.polynomial.legendre.leggauss(24)
    cosine, weight = 0.5 * (u + 1.0), 0.5 * weight
    angle = np.degrees(np.arccos(cosine))
    wi = np.repeat([direction(t) for t in angle], 24, 0)
    wo = np.tile([direction(t, 90.0) for t in angle], (24, 1))
    coat = Stack((Coat(alpha=1e-3, eta=1.5),), GLAZE, Corrected(rough_interface=False)).astype(np.float64)
    top = jax.vmap(coat.layers[0].evaluate)(jnp.asarray(wi), jnp.asarray(wo))
    both = np.outer(2.0 * weight * cosine, 2.0 * weight * cosine).ravel()
    found = np.pi * both @ (np.asarray(brdf_rows(coat, wi, wo)) - np.asarray(top)[:, None])
    T = np.asarray(jax.vmap(transmittance_dielectric, (0, None))(jnp.asarray(cosine), jnp.asarray(1.5)))
    k1 = 1.0 - float(2.0 * weight @ (T * cosine))
    k2 = 1.0 - (1.0 - k1) / 1.5**2
    np.testing.assert_allclose(found, saunderson(GLAZE.albedo, jnp.asarray(k1), jnp.asarray(k2)) - k1, rtol=1e-4)


def test_the_walk_knows_it():
    """As a Lambertian base of its albedo, to the last path."""
    coat = Coat(alpha=np.full(4, 0.2), eta=np.full(4, 1.5))
    pigment = KubelkaMunk(kx=np.full(4, 0.2), sx=np.full(4, 1.5), substrate=np.full(4, 0.4))
    same = Lambert(albedo=float(KubelkaMunk(kx=0.2, sx=1.5, substrate=0.4).albedo) * np.ones(4))
    found, wanted = (walk_rows(Stack((coat,), base), WI[:4], WO[:4], paths=64).mean for base in (pigment, same))
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


@pytest.mark.parametrize("base", [GLAZE, KubelkaMunk(kx=0.3, sx=0.7)], ids=["glaze", "one layer"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_derivatives_are_finite_where_nothing_absorbs_or_scatters(base, dtype):
    names = [field.name for field in dataclasses.fields(base) if field.name != "name" and getattr(base, field.name) is not None]

    def albedo(*numbers):
        return jnp.sum(dataclasses.replace(base, **dict(zip(names, numbers, strict=True))).albedo)

    slope = jax.jit(jax.grad(albedo, tuple(range(len(names)))))
    for number in (0.0, 1e-6, 1.0):
        found = slope(*(jnp.asarray(number, dtype) for _ in names))
        assert all(np.isfinite(x) for x in found), number


@pytest.mark.parametrize("uniforms", [False, True], ids=["constants", "uniforms"])
def test_a_shader_holds_its_albedo_or_computes_it(gl, uniforms):
    """Constants hold one number a channel and no Kubelka and Munk; from uniforms the shader computes it."""
    shader = print_material(Stack((), GLAZE) if uniforms else Stack((varnish(),), GLAZE), "glaze", uniforms)
    assert ("lf_kubelka_munk" in shader.functions) == uniforms
    assert ("uniform vec3 u_base_kx_2;" in shader.functions) == uniforms
    parity = check_pairs(shader, 16384)
    assert parity.passed, parity


def test_presets_hold_it_and_errors_say_what_to_do():
    document = preset_of(Stack((varnish(),), GLAZE, Precise()), "a")
    again = stack_of({key: document[key] for key in ("layers", "base")}, "here")
    assert isinstance(again.form, Precise)
    assert preset_of(again, "a") == document
    assert "substrate" not in json.dumps(document["left_out"])
    assert "base: substrate" in preset_of(Stack((), KubelkaMunk()), "a")["left_out"]
    with pytest.raises(InputError, match="kx_2, sx_2 come together; sx_2 is missing"):
        stack_of({"base": {"type": "kubelka_munk", "kx_2": 1.0}}, "here")
    with pytest.raises(InputError, match="kx_3 belongs to kx_2, which is not there"):
        stack_of({"base": {"type": "kubelka_munk", "kx_3": 1.0, "sx_3": 1.0}}, "here")


# The pigments of the shipped paints, outermost first, and how thick they lie.
PAINTS = {
    "indian_red_enamel": (("Indian Red", 4.0),),
    "green_glaze_over_yellow": (("Phthalo Green", 0.5), ("Hansa Yellow", 4.0)),
}


@pytest.mark.parametrize("name", PAINTS)
def test_paints_are_those_that_were_published(measured, name):
    published = json.loads((measured / "kubelka_munk_curtis1997.json").read_text())["pigments"]
    base = read_preset(name).base
    for suffix, (pigment, thickness) in zip(("", "_2", "_3"), PAINTS[name], strict=False):
        np.testing.assert_allclose(getattr(base, f"kx{suffix}"), np.multiply(published[pigment]["K"], thickness))
        np.testing.assert_allclose(getattr(base, f"sx{suffix}"), np.multiply(published[pigment]["S"], thickness))


def test_published_pigments_are_over_black_and_white_what_others_find(measured):
    for pigment in json.loads((measured / "kubelka_munk_curtis1997.json").read_text())["pigments"].values():
        layer = kubelka_munk(jnp.asarray(pigment["K"]), jnp.asarray(pigment["S"]))
        np.testing.assert_allclose(layer.R, pigment["R_over_black_x1"], atol=6e-7)
        np.testing.assert_allclose(layer.T, pigment["T_x1"], atol=6e-7)
        np.testing.assert_allclose(kubelka_munk_over(layer, jnp.asarray(1.0)), pigment["R_over_white_x1"], atol=6e-7)
