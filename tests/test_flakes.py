"""Metallic paint: where flakes lie, that their mean look is the same from any distance, and that shaders draw the same flakes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, FLOOR, REL, STACKS, cases, close, direction, hemisphere, varnish, with_slope
from layerfit._place import Place
from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.layers import Coat
from layerfit.optics.flakes import circle, exponential, flake_tilt, into_facet, kept_tilt, tilted_normal
from layerfit.preset import preset_of, stack_of
from layerfit.render import brdf
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack, at, evaluate
from layerfit.surfaces import Flakes

CLEAR = Coat(alpha=0.05, eta=1.5)
ELEK = Stack((varnish(),), Flakes(lost="nothing", **COPPER), Faithful())
MANY = 20000

DRAWS = 4.5
"""Standard errors that a mean over flakes may be off: one in 150,000 is by chance."""


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_normals_have_their_digits(oracle, dtype):
    tried = 0
    for case in cases(oracle)["flake_normal"]:
        i = case["in"]
        number = lambda key, i=i: jnp.asarray(i[key], dtype)  # noqa: E731
        uv = jnp.stack([number("u"), number("v")])
        within = np.asarray(uv * number("density"), float) % 1.0
        if dtype == np.float32 and not np.all((within > 1e-3) & (within < 1.0 - 1e-3)):
            continue  # rounding decides which cell it is
        tried += 1
        spread = number("sigma") * kept_tilt(number("dist"), number("dist_ref"))
        normal = tilted_normal(flake_tilt(uv, number("density"), spread, jnp.uint32(i["seed"])))
        for value, wanted in zip(normal, case["out"], strict=True):
            assert close(float(value), float(wanted), REL[dtype], FLOOR[dtype]), i
    assert tried > 30


def test_tilts_have_the_spread_that_they_say():
    uv = np.random.default_rng(0).uniform(-50.0, 50.0, (MANY, 2))
    tilt = np.asarray(jax.vmap(lambda w: flake_tilt(w, jnp.asarray(10.0), jnp.asarray(0.3), jnp.uint32(1)))(jnp.asarray(uv)))
    np.testing.assert_allclose(tilt.mean(0), 0.0, atol=DRAWS * 0.3 / np.sqrt(2 * MANY))
    assert np.mean(np.sum(tilt**2, 1)) == pytest.approx(0.09, rel=DRAWS / np.sqrt(MANY))


@pytest.mark.parametrize(("dtype", "error"), [(np.float64, 1e-15), (np.float32, 2e-7)])
def test_what_tilts_are_made_of_has_its_digits(dtype, error):
    ends = 2 ** np.arange(24)
    k = np.concatenate([np.arange(2**10, 2**24, 2**12), ends - 1, 2**24 - ends])
    exact, bits, like = (k + 0.5) / 2**24, jnp.asarray(k * 256 + 37, jnp.uint32), jnp.zeros((), dtype)
    points = np.stack([np.cos(2.0 * np.pi * exact), np.sin(2.0 * np.pi * exact)], -1)
    np.testing.assert_allclose(jax.vmap(lambda b: circle(b, like))(bits), points, atol=error)
    found = np.asarray(jax.vmap(lambda b: exponential(b, like))(bits))
    assert found.dtype == dtype
    np.testing.assert_allclose(found, -np.log1p(exact - 1.0), rtol=error)


def test_half_a_turn_takes_the_normal_of_a_flake_to_the_vertical():
    n = tilted_normal(jnp.array([0.3, -0.2]))
    np.testing.assert_allclose(into_facet(n, n), [0.0, 0.0, 1.0], atol=1e-15)
    wi, wo = jnp.asarray(hemisphere(2, 1))
    assert float(into_facet(wi, n) @ into_facet(wo, n)) == pytest.approx(float(wi @ wo), abs=1e-15)


SEEN = [(0, 0, 0, 0), (30, 0, 30, 180), (30, 0, 40, 170), (60, 0, 50, 150), (75, 0, 70, 180), (45, 0, 20, 10)]
"""Directions to light and viewer: polar angle and azimuth of both, degrees."""


@pytest.mark.parametrize("distance", [1e-3, 1.0])
@pytest.mark.parametrize("coats", [(), (CLEAR,)], ids=["bare", "coated"])
def test_the_mean_look_does_not_change_with_the_distance(coats, distance):
    """The mean over many flakes against the lobe seen from afar, by its standard error."""
    stack = Stack(coats, Flakes(alpha=0.15, sigma=0.3, **COPPER)).astype(np.float64)
    cells = np.random.default_rng(3).integers(-(10**5), 10**5, (MANY, 2)) + 0.5
    places = Place(cells / 400.0, np.full(MANY, distance))
    drawn = jax.jit(lambda wi, wo: jax.vmap(lambda p: evaluate(stack.form, at(stack.prepare(), p), wi, wo))(places))
    for ti, pi, to, po in SEEN:
        wi, wo = direction(ti, pi), direction(to, po)
        values = np.asarray(drawn(wi, wo))
        far = np.asarray(brdf(stack, wi[None], wo[None]))[0]
        off = (values.mean(0) - far) / np.maximum(values.std(0) / np.sqrt(MANY), 1e-9 * far)
        assert np.all(np.abs(off) < DRAWS), (ti, to, values.mean(0) / far, off)
        assert np.all(values.std(0) / np.sqrt(MANY) < 0.08 * far), "too few flakes to say anything"


def test_far_away_a_flake_is_the_mean_and_near_by_it_is_not():
    stack = Stack((CLEAR,), Flakes(**COPPER)).astype(np.float64)
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    uv = np.random.default_rng(0).uniform(0.0, 1.0, (64, 2))
    mean = np.asarray(brdf(stack, wi, wo))
    far, near = (np.asarray(brdf(stack, wi, wo, Place(uv, np.full(64, d)))) for d in (1e5, 1e-2))
    np.testing.assert_allclose(far, mean, rtol=1e-6)
    assert np.median(np.abs(near - mean) / mean) > 0.1


def test_elek_loses_what_distance_takes():
    """Without the returned roughness, a far surface is a mirror of flakes that all lie flat."""
    kept, lost = (Stack((), Flakes(lost=lost, **COPPER)).astype(np.float64) for lost in ("roughness", "nothing"))
    up = np.array([[0.0, 0.0, 1.0]])
    far = Place(np.zeros((1, 2)), np.array([1e4]))
    assert np.all(brdf(lost, up, up, far) > 3.0 * brdf(kept, up, up, far))


@pytest.mark.parametrize("stack", [STACKS["corrected over flakes"], ELEK], ids=["corrected", "Elek"])
def test_one_flake_is_reciprocal(stack):
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    place = Place(np.random.default_rng(0).uniform(0.0, 1.0, (64, 2)), np.full(64, 0.3))
    np.testing.assert_allclose(brdf(stack.astype(float), wi, wo, place), brdf(stack.astype(float), wo, wi, place), rtol=1e-11)


@pytest.mark.parametrize(
    ("stack", "dtype"),
    [(STACKS["flakes"], np.float64), (STACKS["flakes"], np.float32), (ELEK, np.float32)],
    ids=["float64", "float32", "Elek"],
)
def test_values_and_derivatives_of_a_flake_are_finite_at_the_edges(stack, dtype):
    stack = stack.astype(dtype)
    grazing, up = direction(89.9999), np.array([0.0, 0.0, 1.0])
    ends = [(up, up), (grazing, up), (grazing, grazing), (grazing, direction(89.9999, 180.0)), (up, -up)]
    wi, wo = (jnp.asarray([e[k] for e in ends * 3], dtype) for k in (0, 1))
    place = Place(np.full((15, 2), 0.37), np.repeat([0.0, 1.0, 1e8], 5))
    value, slope = with_slope(lambda s: brdf(s, wi, wo, place), stack)
    assert np.all(np.isfinite(value))
    assert np.all(np.isfinite(slope))


def test_derivatives_flow_through_the_tilt():
    paint = Flakes(**COPPER)
    wi, wo = direction(20.0), direction(30.0, 170.0)

    def value(sigma):
        stack = Stack((), Flakes(sigma=sigma, **COPPER)).astype(jnp.float64)
        return brdf(stack, wi[None], wo[None], Place(jnp.full((1, 2), 0.37), jnp.full(1, 0.4)))[0, 0]

    step = 1e-5
    numeric = (value(paint.sigma + step) - value(paint.sigma - step)) / (2.0 * step)
    assert abs(float(numeric)) > 1e-3
    assert float(jax.jit(jax.grad(value))(paint.sigma)) == pytest.approx(float(numeric), rel=1e-6)


def test_pigment_and_coverage_share_the_area():
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    flakes, pigment = Flakes(**COPPER), [0.02, 0.05, 0.3]
    mixed = brdf(Stack((), Flakes(coverage=0.25, albedo=pigment, **COPPER)).astype(float), wi, wo)
    alone = brdf(Stack((), flakes).astype(float), wi, wo)
    np.testing.assert_allclose(mixed, 0.25 * alone + 0.75 * np.array(pigment) / np.pi, rtol=1e-12)


def test_the_shader_of_elek_draws_the_same_flakes(gl):
    assert check_pairs(print_material(ELEK, "Elek"), 20000).passed


NARROW = {
    f"{alpha}, {sigma}, {name}": Stack(coats, Flakes(alpha=alpha, sigma=sigma, lost=lost, **COPPER), form)
    for alpha, sigma in ((0.002, 1.0), (0.002, 0.2), (0.01, 0.2), (0.035, 0.2))
    for name, coats, lost, form in (
        ("bare", (), "roughness", Corrected()),
        ("coated", (CLEAR,), "roughness", Corrected()),
        ("Elek", (), "nothing", Corrected()),
    )
}
"""A tilt that is off by a millionth of it moves a narrow lobe by a part of its width."""


@pytest.mark.parametrize("name", NARROW)
def test_the_shader_draws_narrow_flakes(gl, name):
    parity = check_pairs(print_material(NARROW[name], name), 65536)
    assert parity.passed, parity


def test_the_shader_asks_for_what_flakes_need():
    text = print_material(STACKS["flakes"], "paint").text()
    assert "lf_brdf(n, v_tangent, v, l, uv, distance)" in text
    assert "uint(lf_base.seed)" in text
    assert "into_facet" not in text


def test_a_preset_holds_flakes():
    document = {
        "type": "flakes",
        "name": "base",
        "alpha": 0.1,
        "sigma": 0.2,
        "eta": 1.4,
        "k": 7.0,
        "seed": 7.0,
        "lost": "nothing",
    }
    stack = stack_of({"base": document}, "here")
    again = preset_of(stack, "paint")["base"]
    assert {key: again[key] for key in document} == document
    with pytest.raises(InputError, match="come together; coverage is missing"):
        stack_of({"base": {"type": "flakes", "albedo": 0.2}}, "here")
