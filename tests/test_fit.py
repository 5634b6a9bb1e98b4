"""From an image back to the material: on images that the model itself made, and on renders by others."""

import dataclasses
import json

import numpy as np
import pytest

from helpers import COPPER
from layerfit.capture.exr import write_exr
from layerfit.capture.geometry import sphere_surface
from layerfit.capture.reference import load_reference
from layerfit.capture.scene import Camera, Constant, Directional, Reference, Sphere
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.residuals import scaled
from layerfit.fit.result import parameters, to_json
from layerfit.fit.weights import inverse_sigma, lost, noise_law, robust
from layerfit.fit.words import measured
from layerfit.layers import Coat
from layerfit.render import predict
from layerfit.stack import Stack
from layerfit.surfaces import (
    Blinn,
    Conductor,
    CookTorrance,
    KubelkaMunk,
    Lafortune,
    Lambert,
    Phong,
    TorranceSparrow,
)

CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
SUN = Directional((0.46175709, 0.55410852, 0.69263564), (np.pi, np.pi, np.pi))

BEHIND = Directional((-0.36, 0.48, -0.8), (np.pi, np.pi, np.pi))
"""From behind: light that grazes the sphere."""

TRUTH = Stack((Coat(alpha=0.12, eta=1.5, tau=[0.08, 0.25, 0.7]),), Conductor(alpha=0.2, **COPPER))
START = Stack((Coat(alpha=0.3, eta=1.35, tau=[0.3, 0.3, 0.3]),), Conductor(alpha=0.4, **COPPER))


@pytest.fixture(scope="module")
def see(tmp_path_factory):
    """Views of a sphere of a material, made by the model, with noise if asked for."""
    path = tmp_path_factory.mktemp("sphere") / "sphere.exr"
    surface = sphere_surface(Sphere(), CAMERA, 48, 48)
    write_exr(path, dict.fromkeys("RGB", np.where(surface.covered, 0.5, 0.0)) | {"A": surface.covered.astype(float)})

    def make(stack=TRUTH, noise=0.0, lights=(SUN,), scale=None, of="coat", seed=0):
        reference = Reference(path, CAMERA, lights, Sphere(), {}, None, {} if scale is None else {of: scale})
        view = load_reference(reference, 0.1)
        samples = view.samples(np.arange(len(view.index)), 256)
        image = predict(scaled(stack, view.scales(stack)), *samples.arrays)
        image = image * (1.0 + noise * np.random.default_rng(seed).normal(size=image.shape))
        return dataclasses.replace(view, target=image.astype(np.float32))

    return make


@pytest.fixture(scope="module")
def clean(see):
    """The fit of an image without noise."""
    return fit([see()], START, starts=3)


def document(result):
    return to_json(result, {}, None, {}, "preset.json")


def values(result):
    return {name: np.asarray(row["value"]) for name, row in document(result)["parameters"].items()}


def test_an_image_of_the_model_gives_its_parameters_back(clean):
    found = values(clean)
    assert clean.converged
    for name, wanted in {"coat.alpha": 0.12, "coat.eta": 1.5, "coat.tau": [0.08, 0.25, 0.7], "base.alpha": 0.2}.items():
        np.testing.assert_allclose(found[name], wanted, rtol=2e-3, err_msg=name)
    assert clean.cost < 1e-6 * sum(s.target.size for s in clean.samples)


CLASSIC = {
    "phong": (Phong(kd=0.3, ks=0.4, exponent=40.0), {"kd": 0.5, "ks": 0.2, "exponent": 15.0}),
    "blinn": (Blinn(kd=0.3, ks=0.4, exponent=80.0), {"kd": 0.5, "ks": 0.2, "exponent": 30.0}),
    "lafortune": (
        Lafortune(kd=0.3, ks=1.2, cx=-0.97, exponent=12.0),
        {"kd": 0.5, "ks": 0.8, "cx": -1.0, "exponent": 20.0},
    ),
    "torrance_sparrow": (
        TorranceSparrow(kd=0.1, ks=9.0, kappa=5.0, **COPPER),
        {"kd": 0.3, "ks": 5.0, "kappa": 8.0},
    ),
    "cook_torrance": (CookTorrance(kd=0.1, ks=0.7, alpha=0.3, **COPPER), {"kd": 0.3, "ks": 0.4, "alpha": 0.15}),
}
"""A classic surface, and where to start from."""


@pytest.mark.parametrize("name", CLASSIC)
def test_a_classic_surface_is_found(see, name):
    truth, start = CLASSIC[name]
    result = fit([see(Stack((), truth))], Stack((), dataclasses.replace(truth, **start)), starts=1)
    assert result.converged
    for field in start:
        np.testing.assert_allclose(values(result)[f"base.{field}"], getattr(truth, field), rtol=3e-3, err_msg=field)


def test_what_is_not_asked_for_stays(clean):
    np.testing.assert_array_equal(clean.stack.base.eta, np.float32(COPPER["eta"]))
    assert set(values(clean)) == {"coat.alpha", "coat.eta", "coat.tau", "base.alpha"}


def test_a_fit_is_the_same_twice_and_its_document_is_plain_json(see, clean):
    again = fit([see()], START, starts=3)
    np.testing.assert_array_equal(again.vector, clean.vector)
    assert json.loads(json.dumps(document(again), allow_nan=False))["converged"] is True


def test_sigmas_cover_the_truth(see):
    result = fit([see(noise=0.03)], START, starts=2)
    rows = document(result)["parameters"]
    for name, wanted in {"coat.alpha": 0.12, "coat.eta": 1.5, "coat.tau": [0.08, 0.25, 0.7], "base.alpha": 0.2}.items():
        error = np.abs(np.asarray(rows[name]["value"]) - wanted)
        assert np.all(error < 4.0 * np.asarray(rows[name]["sigma"])), name
        assert np.all(error < 0.05 * np.maximum(wanted, 0.3)), name


def test_a_thickness_cannot_be_told_from_an_absorption(see):
    coat = Coat(alpha=0.3, eta=1.35, absorption_per_mm=[6.0, 6.0, 6.0], thickness_um=50.0)
    start = dataclasses.replace(START, layers=(coat,))
    free = ["coat.alpha", "coat.eta", "coat.absorption_per_mm", "coat.thickness_um", "base.alpha"]
    result = document(fit([see()], start, free=free, starts=2))
    np.testing.assert_allclose(result["parameters"]["coat.tau"]["value"], [0.08, 0.25, 0.7], rtol=3e-3)
    assert "coat.thickness_um" not in result["parameters"]
    assert any("enter only as tau" in row["why"] for row in result["unidentified"])
    assert "undetermined_direction" in result["flags"]


def test_what_a_coat_scatters_is_found(see):
    truth = Stack((Coat(alpha=0.15, tau=[0.05, 0.15, 0.4], tau_s=[0.5, 0.8, 1.2], g=0.5),), Lambert(albedo=0.2))
    coat = dataclasses.replace(truth.layers[0], tau=0.2, tau_s=0.3, g=0.1)
    start = dataclasses.replace(truth, layers=(coat,))
    free = ["coat.tau", "coat.tau_s", "coat.g"]
    result = fit([see(truth, lights=(SUN, BEHIND))], start, free=free, starts=1)
    assert result.converged
    for field in ("tau", "tau_s", "g"):
        wanted = getattr(truth.layers[0], field)
        np.testing.assert_allclose(values(result)[f"coat.{field}"], wanted, rtol=5e-3, err_msg=field)


ENAMEL = Stack((Coat(alpha=0.1, eta=1.5),), KubelkaMunk(kx=[0.1, 0.4, 0.9], sx=[1.2, 0.8, 0.4], substrate=0.1))
PIGMENT = ["base.kx", "base.sx"]


def test_one_image_does_not_tell_absorption_from_scattering(see):
    """Of the pigment it sees an albedo: with the scattering as it is, the absorption is found, and that it was held is said."""
    start = dataclasses.replace(ENAMEL, base=dataclasses.replace(ENAMEL.base, kx=0.3))
    result = fit([see(ENAMEL)], start, free=PIGMENT, starts=1)
    np.testing.assert_allclose(values(result)["base.kx"], ENAMEL.base.kx, rtol=2e-3)
    (held,) = document(result)["unidentified"]
    assert held["direction"] == {"base.kx": 1.0, "base.sx": 1.0}
    assert "albedo alone" in held["why"]
    assert "base.sx was held at its start" in held["why"]


def test_two_thicknesses_of_a_pigment_tell_them_apart(see):
    start = dataclasses.replace(ENAMEL, base=dataclasses.replace(ENAMEL.base, kx=0.5, sx=0.5))
    views = [see(ENAMEL), see(ENAMEL, scale=4.0, of="base")]
    result = fit(views, start, free=PIGMENT, starts=1)
    assert result.converged
    for field in ("kx", "sx"):
        np.testing.assert_allclose(values(result)[f"base.{field}"], getattr(ENAMEL.base, field), rtol=5e-3, err_msg=field)
    assert not document(result)["unidentified"]


def test_a_pigment_that_hides_its_substrate_is_known_by_a_ratio(see):
    """At any thickness: a direction that the images do not see, named."""
    deep = Stack((), KubelkaMunk(kx=[8.0, 30.0, 60.0], sx=60.0, substrate=0.5))
    start = dataclasses.replace(deep, base=dataclasses.replace(deep.base, kx=20.0))
    result = fit([see(deep), see(deep, scale=2.0, of="base")], start, free=PIGMENT, starts=1)
    found = values(result)
    np.testing.assert_allclose(found["base.kx"] / found["base.sx"], np.divide(deep.base.kx, deep.base.sx), rtol=2e-3)
    blind = document(result)["unidentified"]
    assert {name for row in blind for name in row["direction"]} == {f"base.{f}[{k}]" for f in ("kx", "sx") for k in range(3)}
    assert all("base.kx and base.sx can change together" in row["why"] for row in blind)


def test_a_thickness_that_a_base_does_not_have_is_refused(see):
    with pytest.raises(InputError, match="thickness_scale names 'base'; layers with a thickness are coat"):
        fit([see(scale=2.0, of="base")], START, starts=1)


def test_a_series_of_thicknesses_is_fitted_together(see):
    thin, thick = see(scale=1.0), see(scale=3.0)
    result = fit([thin, thick], START, starts=2)
    np.testing.assert_allclose(values(result)["coat.tau"], [0.08, 0.25, 0.7], rtol=3e-3)
    np.testing.assert_allclose(values(result)["coat.eta"], 1.5, rtol=2e-3)


@pytest.mark.optimised
def test_light_from_everywhere_is_fitted_through_its_quadrature(see):
    result = fit([see(lights=(Constant((1.0, 1.0, 1.0)), SUN))], START, starts=2)
    np.testing.assert_allclose(values(result)["coat.tau"], [0.08, 0.25, 0.7], atol=0.02)
    np.testing.assert_allclose(values(result)["base.alpha"], 0.2, rtol=0.03)


def test_a_parameter_without_effect_is_refused_by_name(see):
    opaque = Stack((Coat(alpha=0.12, eta=1.5, tau=40.0),), Conductor(alpha=0.2, **COPPER))
    with pytest.raises(InputError, match=r"free: base\.alpha has no effect on this image"):
        fit([see(opaque)], opaque, free=["coat.alpha", "base.alpha"], starts=1)


def test_a_parameter_without_effect_that_was_not_asked_for_is_held_with_a_note(see):
    opaque = Stack((Coat(alpha=0.2, eta=1.5, tau=40.0),), Conductor(alpha=0.2, **COPPER))
    result = fit([see(opaque)], opaque, starts=1)
    assert result.notes == ["coat.tau, base.alpha have no effect on this image and were held at the start"]
    assert "base.alpha" not in values(result)


def test_a_parameter_that_wants_to_leave_its_range_is_flagged(see):
    mirror = Stack((), Lambert(albedo=[1.0, 0.6, 0.2]))
    view = see(mirror)
    view = dataclasses.replace(view, target=view.target * np.float32(1.2))
    result = document(fit([view], Stack((), Lambert(albedo=0.5)), starts=1))
    assert result["parameters"]["base.albedo"]["at_bound"] == "upper"
    assert "at_bound:base.albedo" in result["flags"]
    assert np.max(result["parameters"]["base.albedo"]["value"]) <= 1.0
    sigma = result["parameters"]["base.albedo"]["sigma"]
    assert min(sigma) > 0.0, "how far inside the truth may be"
    assert json.loads(json.dumps(result, allow_nan=False))["parameters"]["base.albedo"]["sigma"] == sigma


def test_a_tau_that_follows_from_a_bound_has_its_sigma(see):
    clear = Stack((Coat(alpha=0.12, eta=1.5, tau=[0.0, 0.25, 0.7]),), Conductor(alpha=0.2, **COPPER))
    view = see(clear)
    view = dataclasses.replace(view, target=view.target * np.array([1.1, 1.0, 1.0], np.float32))
    coat = Coat(alpha=0.12, eta=1.5, absorption_per_mm=[6.0, 6.0, 6.0], thickness_um=50.0)
    result = fit([view], dataclasses.replace(clear, layers=(coat,)), free=["coat.absorption_per_mm"], starts=1)
    for name in ("coat.absorption_per_mm", "coat.tau"):
        row = document(result)["parameters"][name]
        assert row["value"][0] == 0.0, name
        assert min(row["sigma"]) > 0.0, name


def test_a_fit_that_misses_the_image_is_called_poor(see, clean):
    assert clean.misfit < 1e-3
    assert "poor_fit" not in document(clean)["flags"]
    stripes = see()
    stripes = dataclasses.replace(stripes, target=stripes.target * (1.0 + 0.3 * (stripes.index[:, None] // 8 % 2)))
    poor = fit([stripes], START, starts=2)
    assert 0.1 < poor.misfit < 0.2
    assert "poor_fit" in document(poor)["flags"]
    assert document(poor)["misfit"] == pytest.approx(poor.misfit, rel=1e-3)


def test_noise_that_is_stated_makes_no_poor_fit(see):
    """The same image twice: what the file knows to be noise is not the model's fault."""
    view = see()
    noise = 0.2 * view.target**0.7
    noisy = dataclasses.replace(view, target=view.target + noise * np.random.default_rng(0).normal(size=noise.shape))
    stated = dataclasses.replace(noisy, noise=noise)
    assert "poor_fit" in document(fit([noisy], TRUTH, starts=1))["flags"]
    assert "poor_fit" not in document(fit([stated], TRUTH, starts=1))["flags"]


def test_sigmas_say_what_they_are_of(clean):
    assert "not of what the form of the model gets wrong" in document(clean)["sigma_is"]


def test_a_result_shows_itself(clean):
    text = repr(clean)
    assert text.startswith("Coat over Conductor; converged: yes, after ")
    flags = document(clean)["flags"]
    assert set(flags) <= {"correlated:base.alpha~coat.eta"}, "by -.956, beside the threshold"
    assert f"flags: {', '.join(flags) or 'none'}\n" in text
    assert len(text.splitlines()) == 1 + len(values(clean))
    page = clean._repr_html_()
    for name, row in document(clean)["parameters"].items():
        assert f"    {name}:" in text
        assert f">{name}</th>" in page
        shown = measured(row["value"], row["sigma"])[0]
        assert shown in text
        assert shown in page
    assert page.count("<tr>") == 1 + len(values(clean))


def test_a_grain_needs_a_tangent(see):
    brushed = Stack((), Conductor(alpha=None, alpha_x=0.1, alpha_y=0.3, **COPPER))
    view = see(brushed)
    assert fit([view], brushed, starts=1).converged
    with pytest.raises(InputError, match=r"sphere\.exr: base\.alpha_x is measured along a tangent, and there is none\. Render"):
        fit([dataclasses.replace(view, tangent=None)], brushed, starts=1)
    coated = dataclasses.replace(TRUTH, layers=(Coat(alpha=None, alpha_x=0.1, alpha_y=0.3),))
    with pytest.raises(InputError, match=r"coat\.alpha_x is measured along a tangent"):
        dataclasses.replace(view, tangent=None).check(coated)
    dataclasses.replace(view, tangent=None).check(TRUTH)


def test_a_wall_of_pixels_too_bright_does_not_pull_a_robust_fit(see):
    view = see()
    spoiled = view.target.copy()
    spoiled[np.random.default_rng(0).choice(len(spoiled), len(spoiled) // 50, replace=False)] *= 20.0
    spoiled = dataclasses.replace(view, target=spoiled)
    square, cauchy = (values(fit([spoiled], START, starts=2, loss=loss))["coat.tau"] for loss in ("square", "cauchy"))
    error = [np.max(np.abs(found - [0.08, 0.25, 0.7])) for found in (square, cauchy)]
    assert error[1] < 0.02
    assert error[1] < 0.5 * error[0]


def test_the_weights_follow_the_law_of_the_noise_not_its_accidents():
    model = np.linspace(0.01, 2.0, 500)[:, None] * np.ones(3)
    noise = 0.03 * model**0.7
    lucky = noise * np.exp(np.random.default_rng(0).normal(size=noise.shape))
    np.testing.assert_allclose(noise_law(model, noise), noise, rtol=1e-6)
    np.testing.assert_allclose(noise_law(model, lucky), noise, rtol=0.1)
    assert np.all(inverse_sigma(model, model, noise, "law") < inverse_sigma(model, model, None, "law"))
    assert np.ptp(inverse_sigma(model, model, noise, "uniform"), axis=0).max() == 0.0


def test_a_firefly_counts_as_eight_scatters_and_nothing_else_is_touched():
    residual = np.random.default_rng(0).normal(size=(1000, 3))
    residual[0] = 100.0
    factor = robust(residual, "square")
    np.testing.assert_allclose(factor[0] ** 2 * 100.0, 8.0, rtol=0.1)
    assert np.all(factor[1:] == 1.0)
    assert np.all(robust(0.1 * residual[1:] ** 3, "square")[np.abs(residual[1:]) < 2.5] == 1.0)


def test_light_that_is_taken_from_fireflies_is_given_back():
    """Skewed noise of a known mean: capped, an image is too dark, and with what was lost it is not."""
    rng = np.random.default_rng(0)
    model = np.linspace(0.5, 1.5, 4000)[:, None] * np.ones(3)
    law = 0.5 * model**0.7
    target = model + law * 0.02 * (rng.pareto(2.2, size=model.shape) - 1.0 / 1.2) / 0.1
    weight = 1.0 / law
    residual = (model - target) * weight
    factor = robust(residual, "square")
    light = lost(residual, factor, weight, law)
    plain, capped = residual.mean(0), (residual * factor**2).mean(0)
    returned = capped - (light.mean * weight).mean(0)
    assert np.all(capped - plain > 2.0 * (light.error * weight).mean(0)), "there is something to give back"
    assert np.all(np.abs(returned - plain) < 0.2 * (capped - plain))
    assert np.ptp(light.mean / law, axis=0).max() < 1e-12, "to all pixels, by their noise"


def test_one_firefly_says_nothing_of_others():
    residual = np.random.default_rng(0).normal(size=(1000, 3))
    residual[0] = -100.0
    ones = np.ones_like(residual)
    light = lost(residual, robust(residual, "square"), ones, ones)
    assert light.mean.max() == light.error.max() == 0.0
    residual[1] = -100.0
    two = lost(residual, robust(residual, "square"), ones, ones)
    np.testing.assert_allclose(two.mean[0], 0.5 * 2 * 92.0 / 1000, rtol=0.02)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_robust_factors_leave_the_bulk_and_lower_the_tail(loss):
    residual = np.random.default_rng(0).normal(size=(1000, 3))
    residual[0] = 100.0
    factor = robust(residual, loss)
    assert np.all(factor[0] < 0.2)
    assert np.median(factor) > 0.9


@pytest.mark.parametrize("model_error", [False, True])
def test_the_scale_of_the_lights_is_fitted_where_it_is_named(see, model_error):
    """A coat over a metal of known index tells how bright its light is, by channel."""
    view = see(noise=0.01)
    scale = np.array([1.4, 1.1, 0.7])
    brighter = dataclasses.replace(view, target=(view.target * scale).astype(np.float32))
    free = ["coat.alpha", "coat.tau", "base.alpha", "light.scale"]
    result = fit([brighter], dataclasses.replace(START, layers=TRUTH.layers), free=free, starts=2, model_error=model_error)
    row = parameters(result)["light.scale"]
    (lit,) = result.lights
    np.testing.assert_allclose(lit["scale"], row["value"], rtol=1e-5)
    assert np.all(np.abs(np.subtract(row["value"], scale)) < 4.0 * np.asarray(row["sigma"])), row
    assert np.all(np.asarray(row["sigma"]) < (0.3 if model_error else 0.1) * scale)
    samples = view.relit(lit).samples()
    np.testing.assert_allclose(predict(result.stack, *samples.arrays[:3]), result.models[0], rtol=1e-4)


def test_a_scale_that_cannot_be_told_from_a_colour_is_named(see):
    """Twice the light on half the albedo is the same image."""
    result = fit(
        [see(Stack((), Lambert(albedo=0.5)))], Stack((), Lambert(albedo=0.3)), free=["base.albedo", "light.scale"], starts=1
    )
    assert any("base.albedo and light.scale" in row["why"] for row in document(result)["unidentified"])
