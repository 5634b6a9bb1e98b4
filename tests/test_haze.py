"""Coats that scatter: energy, limits, and distance from the random walk."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, QUICKLY, brdf, brdf_rows, cases, close, direction, hemisphere
from layerfit.errors import InputError
from layerfit.fit.residuals import scaled
from layerfit.forms import haze
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.preset import preset_of, stack_of
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert, OrenNayar
from layerfit.walk import Haze, top_lobe, walk_rows

ROWS = 256
METAL = Conductor(alpha=0.2, **COPPER)
PAPER = Lambert(albedo=0.7)
BASES = [PAPER, OrenNayar(albedo=0.7), METAL]
MODES = {"all": Corrected(), "once": Corrected(multiple=False)}


# Of one size everywhere: what is compiled for one test serves the next.
rows = jax.jit(brdf_rows, compiler_options=QUICKLY)
WI, WO = hemisphere(ROWS, 1), hemisphere(ROWS, 2)


def brdf_64(coat, base, form=MODES["all"], wi=WI, wo=WO):
    """Rows of up to ROWS directions, filled up by repetition."""
    filled = (np.resize(w, (ROWS, 3)) for w in (wi, wo))
    return np.asarray(rows(Stack((coat,), base, form).astype(np.float64), *filled))[: len(wi)]


def albedo(stack, wi, count=4 * ROWS):
    u, v = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.618033988749895) % 1.0
    wo = np.stack([np.sqrt(u) * np.cos(2.0 * np.pi * v), np.sqrt(u) * np.sin(2.0 * np.pi * v), np.sqrt(1.0 - u)], -1)
    values = [rows(stack, np.broadcast_to(wi, (ROWS, 3)), some) for some in np.split(wo, 4)]
    return np.pi * np.mean(np.concatenate(values), 0)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("base", BASES, ids=lambda b: type(b).__name__)
def test_a_coat_that_scatters_nothing_is_a_clear_one(base, mode):
    clear = brdf_64(Coat(alpha=0.2, tau=0.3), base)
    for tau_s, rel in ((0.0, 1e-12), (1e-9, 1e-7)):
        milky = brdf_64(Coat(alpha=0.2, tau=0.3, tau_s=tau_s, g=0.6), base, MODES[mode])
        np.testing.assert_allclose(milky, clear, rtol=rel)


def test_what_does_not_scatter_is_absent():
    clear, milky, even = (
        Stack((Coat(tau=0.2, tau_s=tau_s, g=g),), METAL) for tau_s, g in ((None, None), (0.5, 0.3), (0.5, None))
    )
    up = jnp.array([0.0, 0.0, 1.0])
    size = [len(str(jax.make_jaxpr(brdf_rows)(s, up[None], up[None]))) for s in (clear, even, milky)]
    assert size[0] < size[1] < size[2]
    assert clear.astype(np.float64).prepare().haze is None


def test_even_scattering_is_that_of_g_0():
    for base in (PAPER, METAL):
        none, zero = (brdf_64(Coat(alpha=0.2, tau=0.3, tau_s=0.7, g=g), base) for g in (None, 0.0))
        np.testing.assert_allclose(none, zero, rtol=1e-12)


def test_single_scattering_has_its_digits(oracle):
    """A smooth coat over a black base; what its top reflects is taken off, and where light grazes takes the digits."""
    told = [case for case in cases(oracle)["hk_coated"] if min(case["in"]["wi"][2], case["in"]["wo"][2]) >= 1e-3]
    wi, wo, eta, albedo, tau, g = (
        jnp.array([case["in"][key] for case in told]) for key in ("wi", "wo", "eta", "albedo", "tau", "g")
    )
    coats = Coat(alpha=np.full(len(told), 1e-3), eta=eta, tau=tau * (1.0 - albedo), tau_s=tau * albedo, g=g)
    form = Corrected(multiple=False, rough_interface=False, broaden=False)

    def one(coat, wi, wo):
        return brdf(Stack((coat,), Lambert(albedo=jnp.zeros(())), form), wi, wo), coat.evaluate(wi, wo)

    for case, whole, lobe in zip(told, *jax.jit(jax.vmap(one), compiler_options=QUICKLY)(coats, wi, wo), strict=True):
        assert close(float(whole - lobe), float(case["out"]), 1e-10, 1e-12 * max(1.0, float(lobe))), case


@pytest.mark.parametrize(("g", "less"), [(-0.5, 0.08), (0.0, 0.02), (0.5, 0.02), (0.9, 0.02)])
def test_a_white_medium_over_a_white_base_sends_all_light_back(g, less):
    """Within the error of the thirds; of a medium that scatters backwards a part is lost, and nowhere is light won."""
    for tau_s in (0.3, 1.0, 4.0):
        stack = Stack((Coat(alpha=0.1, tau=0.0, tau_s=tau_s, g=g),), Lambert(albedo=1.0)).astype(np.float64)
        for theta in (0.0, 60.0):
            assert np.all(albedo(stack, direction(theta)) == pytest.approx(1.0 - 0.5 * less, abs=0.5 * less + 0.015))


def test_scattering_hides_what_is_below():
    black, white = (brdf_64(Coat(alpha=0.2, tau=8.0, tau_s=40.0, g=0.3), Lambert(albedo=a)) for a in (0.0, 0.9))
    np.testing.assert_allclose(black, white, rtol=1e-5)


# Per base: relative error of the light from below allowed. A quarter of it at most is noise of the walk.
NEAR = {"lambert": 0.03, "conductor": 0.08}


@pytest.mark.optimised(1)
@pytest.mark.parametrize("kind", NEAR)
def test_it_is_near_to_the_walk(kind):
    """Where each of the parts counts: `tools/measure_haze.py` measures it over random materials."""
    base = Lambert(albedo=0.5) if kind == "lambert" else Conductor(alpha=0.3, eta=[0.2] * 3, k=[3.5] * 3)
    grey = base if kind == "lambert" else dataclasses.replace(base, eta=0.2, k=3.5)
    coat = Coat(alpha=0.1, eta=1.5, tau=0.4)
    wo = np.array([direction(t, p) for t in (10.0, 35.0, 60.0) for p in (60.0, 120.0, 180.0)])
    wi = np.broadcast_to(direction(40.0), wo.shape)
    g = np.array([-0.4, 0.0, 0.5])
    every = lambda table: jax.tree.map(lambda x: np.broadcast_to(x, 27), table)  # noqa: E731
    scatters = {"coat": Haze(np.full(27, 0.9), g.repeat(9))}
    tiled = np.tile(wi, (3, 1)), np.tile(wo, (3, 1))
    found = walk_rows(every(Stack((coat,), grey)), *tiled, paths=8000, interface="multi", haze=scatters).mean[:, 0]
    for cosine, wanted in zip(g, found.reshape(3, 9), strict=True):
        milky = dataclasses.replace(coat, tau_s=0.9, g=cosine)
        f = (brdf_64(milky, base, wi=wi, wo=wo) - top_lobe(Stack((coat,), base), wi[0], wo))[:, 0]
        assert np.sum(np.abs(f - wanted) * wo[:, 2]) / np.sum(wanted * wo[:, 2]) < NEAR[kind], cosine


@pytest.mark.parametrize("base", [PAPER, METAL], ids=lambda b: type(b).__name__)
def test_derivatives_are_those_of_the_values(base):
    """By every number of the coat, against central differences; finite where nothing scatters."""
    fields = ("tau", "tau_s", "g", "eta")

    def light(x):
        coat = Coat(alpha=0.2, **dict(zip(fields, x, strict=True)))
        return brdf_rows(dataclasses.replace(Stack((coat,), base), layers=(coat,)).astype(np.float64), WI[:8], WO[:8])

    along = jax.jit(lambda x, direction: jax.jvp(light, (x,), (direction,)), compiler_options=QUICKLY)
    slopes = lambda x: np.stack([along(x, direction)[1] for direction in jnp.eye(4)], -1)  # noqa: E731
    for point in ([0.3, 0.7, -0.3, 1.5], [0.3, 0.7, 0.6, 1.5]):
        x = jnp.asarray(point)
        found = slopes(x)
        for k, step in enumerate(1e-6 * np.eye(4)):
            wanted = (along(x + step, step)[0] - along(x - step, step)[0]) / 2e-6
            np.testing.assert_allclose(found[..., k], wanted, rtol=2e-5, atol=1e-6)
    for point in ([0.0, 0.0, 0.0, 1.5], [0.0, 0.0, 0.9, 1.0], [50.0, 50.0, -0.95, 3.0], [0.0, 1e-6, 0.95, 1.5]):
        assert np.all(np.isfinite(slopes(jnp.asarray(point))))


def test_the_derivative_by_the_mean_cosine_is_there_at_0():
    phase = lambda g, spread: haze.widened_phase(jnp.asarray(0.3), g, jnp.asarray(spread))  # noqa: E731
    for spread, wanted in ((0.0, 3.0 * 0.7 * haze.EVENLY), (0.1, None)):
        slope = float(jax.grad(phase)(jnp.asarray(0.0), spread))
        assert slope == pytest.approx(wanted, rel=1e-6) if wanted else 0.0 < slope < 3.0 * 0.7 * haze.EVENLY


def test_what_boundaries_add_widens_the_phase_function():
    on = jnp.asarray(0.0)
    phases = [float(haze.widened_phase(on, jnp.asarray(0.8), jnp.asarray(s))) for s in (0.0, 0.01, 0.1, 1.0)]
    assert phases == sorted(phases, reverse=True)
    assert phases[0] == pytest.approx(1.8 / 0.04 * haze.EVENLY, rel=1e-12)


def test_a_preset_keeps_it_and_errors_say_what_to_do():
    milk = {"type": "coat", "tau_s": [0.5, 0.6, 0.7], "g": 0.4}
    stack = stack_of({"layers": [milk], "base": {"type": "lambert"}}, "here")
    assert isinstance(stack.form, Corrected)
    document = preset_of(stack, "milk")
    assert document["layers"][0]["tau_s"] == [0.5, 0.6, 0.7]
    assert document["layers"][0]["g"] == 0.4
    with pytest.raises(InputError, match=r"here: layers\[0\]: g says how a coat scatters, but there is no tau_s"):
        stack_of({"layers": [{"type": "coat", "g": 0.4}], "base": {"type": "lambert"}}, "here")
    for model in ("precise", "faithful"):
        with pytest.raises(InputError, match=r'not for this material: coat scatters light.*Use "corrected"'):
            stack_of({"model": model, "layers": [milk], "base": {"type": "lambert"}}, "here")
    over = [milk, {"type": "coat", "name": "primer"}]
    with pytest.raises(InputError, match="coat scatters light and lies over primer: only the innermost"):
        stack_of({"layers": over, "base": {"type": "lambert"}}, "here")


@pytest.mark.parametrize("form", [Precise(), Faithful()])
def test_forms_that_do_not_know_it_refuse_it(form):
    with pytest.raises(ValueError, match="form is not for this material: coat scatters"):
        Stack((Coat(tau_s=0.5),), Lambert(), form).astype(np.float32).prepare()


def test_a_thicker_coat_scatters_more():
    coat = scaled(Stack((Coat(tau=0.1, tau_s=0.4, g=0.3),), PAPER), [2.0, 1.0]).layers[0]
    assert (coat.tau, coat.tau_s, coat.g) == (0.2, 0.8, 0.3)
    coat = scaled(Stack((Coat(absorption_per_mm=2.0, thickness_um=100.0, tau_s=0.4),), PAPER), [2.0, 1.0]).layers[0]
    assert (coat.thickness_um, coat.absorption_per_mm, coat.tau_s) == (200.0, 2.0, 0.8)


@pytest.mark.parametrize("form", MODES.values(), ids=MODES)
def test_it_prints_below_another_coat(gl, form):
    """With even scattering over a grooved base, and scattered once."""
    primer = Coat(name="primer", alpha=0.2, eta=1.35, tau_s=2.0)
    parity = check_pairs(print_material(Stack((Coat(tau=0.2), primer), OrenNayar(), form), "primer"), 4096)
    assert parity.p999_rel <= 1e-5
    assert parity.max_rel <= 5e-5
