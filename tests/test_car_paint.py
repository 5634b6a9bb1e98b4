"""Car paint: 50-digit values of its lobes, and the published paints as presets."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import FLOOR, REL, brdf, brdf_rows, cases, close, compiles, direction, every_text, hemisphere, varnish
from layerfit import render
from layerfit._place import Place
from layerfit.errors import InputError
from layerfit.preset import preset_of, read_preset, stack_of
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack, at, evaluate
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


GRID = {"per_uv": 400.0, "half_distance": 1.0, "seed": 3.0}
SPARKLING = CarPaint(kd=0.03, alpha=0.3, sparkle=0.8, ks_2=[0.1, 0.12, 0.13], f0_2=0.8, alpha_2=0.15, sparkle_2=0.5, **GRID)
"""Two lobes that sparkle."""
AND_CLEAR = CarPaint(ks=0.2, sparkle=0.9, ks_2=1.0, f0_2=0.04, alpha_2=0.04, **GRID)
"""One that does, and that of a clear coat, which does not."""
PAINTED = {
    "bare": Stack((), SPARKLING),
    "below a coat": Stack((varnish(tau=None),), SPARKLING),
    "with a clear lobe": Stack((), AND_CLEAR),
}
each = pytest.mark.parametrize("name", PAINTED)

MANY = 20000
DRAWS = 4.5
"""Standard errors that a mean over flakes may be off: one in 150,000 is by chance."""
SEEN = [(0, 0, 0, 0), (30, 0, 40, 170), (60, 0, 50, 150), (45, 0, 20, 10)]
"""Directions to light and viewer: polar angle and azimuth of both, degrees."""


@pytest.mark.parametrize("distance", [1e-3, 1.0])
@pytest.mark.parametrize("name", ["bare", "below a coat"])
def test_the_residual_has_no_mean(name, distance):
    """By its standard error, at every pair of directions: it adds nothing to the mean look, near by or far off."""
    stack = PAINTED[name].astype(np.float64)
    cells = np.random.default_rng(3).integers(-(10**5), 10**5, (MANY, 2)) + 0.5
    places = Place(cells / 400.0, np.full(MANY, distance))
    drawn = jax.jit(lambda wi, wo: jax.vmap(lambda p: evaluate(stack.form, at(stack.prepare(), p), wi, wo))(places))
    for ti, pi, to, po in SEEN:
        wi, wo = direction(ti, pi), direction(to, po)
        mean = np.asarray(render.brdf(stack, wi[None], wo[None]))[0]
        residual = np.asarray(drawn(wi, wo)) - mean
        error = residual.std(0) / np.sqrt(MANY)
        assert np.all(np.abs(residual.mean(0)) < DRAWS * error), (ti, to)
        assert np.all(error < 0.08 * mean), "too few flakes to say anything"
        assert np.all(residual.std(0) > (0.1 if distance < 1.0 else 0.02) * mean), "there is no sparkle"


@pytest.mark.parametrize("kept", [1.0, 0.5])
def test_the_residual_has_the_variance_of_its_flakes(kept):
    """Closed form: the square of a Gaussian lobe is one of half the variance, and its mean over Gaussian tilts a wider one."""
    paint = CarPaint(ks=1.0, f0=1.0, alpha=0.3, sparkle=0.6, **GRID)
    stack = Stack((), paint).astype(np.float64)
    wi, wo = jnp.array([0.0, 0.0, 1.0]), jnp.asarray(direction(20.0))
    uv = (np.random.default_rng(4).integers(-(10**5), 10**5, (MANY, 2)) + 0.5) / 400.0
    distance = np.sqrt(1.0 / kept - 1.0)  # kept = 1 / (1 + distance^2)
    values = np.asarray(
        jax.vmap(lambda p: evaluate(stack.form, at(stack.prepare(), p), wi, wo))(Place(uv, np.full(MANY, distance)))
    )
    variance = 0.6 * 0.09 * kept**2
    own = 0.09 - variance
    half = np.tan(np.radians(10.0))
    flake2 = 1.0 / (np.pi * own) ** 2 * (0.5 * own / (0.5 * own + variance)) * np.exp(-(half**2) / (0.5 * own + variance))
    lobe2 = (np.exp(-(half**2) / 0.09) / (np.pi * 0.09)) ** 2
    mean2 = float(np.asarray(render.brdf(stack, wi[None], wo[None]))[0, 0]) ** 2
    squares = values**2 / mean2
    assert np.mean(squares) == pytest.approx(flake2 / lobe2, abs=DRAWS * np.std(squares) / np.sqrt(MANY))
    assert flake2 / lobe2 > 1.05


def test_far_away_there_is_no_residual():
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    uv = np.random.default_rng(0).uniform(0.0, 1.0, (64, 2))
    for stack in PAINTED.values():
        stack = stack.astype(np.float64)
        np.testing.assert_allclose(render.brdf(stack, wi, wo, Place(uv, np.full(64, 1e5))), brdf_rows(stack, wi, wo), rtol=1e-6)


def test_what_does_not_sparkle_is_as_it_was():
    plain = CarPaint(kd=0.03, alpha=0.3, ks_2=[0.1, 0.12, 0.13], f0_2=0.8, alpha_2=0.15)
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    values = (brdf_rows(Stack((), paint).astype(np.float64), wi, wo) for paint in (plain, SPARKLING))
    np.testing.assert_array_equal(*values)
    assert Stack((), plain).reads == ()
    assert "tilt" not in print_material(Stack((), plain), "plain").functions


@each
def test_a_place_is_reciprocal(name):
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    place = Place(np.random.default_rng(0).uniform(0.0, 1.0, (64, 2)), np.full(64, 0.3))
    stack = PAINTED[name].astype(np.float64)
    there = render.brdf(stack, wi, wo, place)
    np.testing.assert_allclose(there, render.brdf(stack, wo, wi, place), rtol=1e-11)
    assert np.all(np.asarray(there) >= 0.0)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_sparkle_is_finite_at_the_edges(dtype):
    """No sparkle at all and nearly all, the narrowest lobe and the widest, near by and far off, grazing and not."""
    up, grazing = np.array([0.0, 0.0, 1.0]), direction(89.9999)
    ends = [(up, up), (grazing, up), (grazing, grazing), (grazing, direction(89.9999, 180.0)), (up, -up)]
    wi, wo = (jnp.asarray([e[k] for e in ends * 3], dtype) for k in (0, 1))
    place = Place(np.full((15, 2), 0.37), np.repeat([0.0, 1.0, 1e8], 5))
    run = jax.jit(lambda s: jax.jvp(lambda s: render.brdf(s, wi, wo, place), (s,), (jax.tree.map(jnp.ones_like, s),)))
    for sparkle, alpha in ((0.0, 0.3), (0.99, 1e-3), (0.99, 1.0)):
        value, slope = run(Stack((), CarPaint(sparkle=sparkle, alpha=alpha, **GRID)).astype(dtype))
        assert np.all(np.isfinite(value))
        assert np.all(np.isfinite(slope))


@each
def test_the_shader_draws_the_same_sparkle(gl, name):
    parity = check_pairs(print_material(PAINTED[name], name), 16384)
    assert parity.passed, parity


def test_sparkle_validates(tmp_path):
    texts = every_text(PAINTED["below a coat"])
    assert all("lf_brdf(n, v_tangent, v, l, uv, distance)" in text for text in texts.values())
    compiles(tmp_path, texts)


def test_a_preset_holds_sparkle():
    document = preset_of(PAINTED["bare"], "paint")
    again = stack_of({"base": document["base"]}, "here").base
    assert (again.sparkle, again.sparkle_2, again.per_uv, again.seed) == (0.8, 0.5, 400.0, 3.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"sparkle": 0.5}, "come together; per_uv, half_distance, seed is missing"),
        ({"sparkle": 0.5, "sparkle_2": 0.5, **GRID}, "sparkle_2 belongs to ks_2"),
        ({"sparkle": 1.0, **GRID}, "0 to 0.99"),
    ],
)
def test_sparkle_that_cannot_be_is_refused(fields, message):
    with pytest.raises(InputError, match=message):
        stack_of({"base": {"type": "car_paint", **fields}}, "here")
