"""Thin films: 50-digit values, physics of interference, the colour in three channels against the spectrum, and a thickness that is found."""

import dataclasses
import functools
import itertools
from typing import Any

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from helpers import (
    COPPER,
    FLOOR,
    brdf,
    brdf_rows,
    cases,
    close,
    compiles,
    direction,
    hemisphere,
    sphere_view,
    varnish,
    with_slope,
)
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.result import parameters
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.optics.film import bake, film_reflectance, film_transmittance, schlick_complement
from layerfit.optics.fresnel import fresnel_conductor, fresnel_dielectric, transmittance_dielectric
from layerfit.optics.spectra import WAVELENGTHS_NM, daylight_weights, rgb_weights
from layerfit.preset import preset_of, read_preset, stack_of
from layerfit.render import predict
from layerfit.shader.export import HEADERS, print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert
from layerfit.surfaces.film import DARKEST, Baked, baked_f0, film_passes, film_reflects
from layerfit.walk import check

DTYPES = [np.float64, np.float32]
REL = {np.float64: 1e-11, np.float32: 1e-4}
"""A phase of many turns has lost the digits of its whole turns."""
SLOPE = {np.float64: 1e-7, np.float32: 1e-3}

BAKED_RMS, BAKED_MAX = 0.0025, 0.025
"""Of the reflectance of a polynomial against the spectrum, over the materials of `tools/measure_film.py`: .0021 and .023."""

TITANIUM: dict[str, Any] = {"eta": [2.749, 2.509, 2.238], "k": [3.844, 3.398, 3.014]}
FILM: dict[str, Any] = {"film_nm": 60.0, "film_eta": [2.3, 2.35, 2.45]}
FILMED: dict[str, Stack] = {
    "on metal": Stack((), Conductor(alpha=0.2, **TITANIUM, **FILM)),
    "below a coat": Stack((varnish(),), Conductor(alpha=0.2, **TITANIUM, **FILM)),
    "on a coat": Stack((varnish(film_nm=110.0, film_eta=1.38),), Lambert(albedo=[0.5, 0.28, 0.13])),
    "between coats, into the rarer": Stack(
        (varnish(eta=1.7), Coat(name="primer", alpha=0.2, eta=1.35, film_nm=90.0, film_eta=2.0)), Lambert()
    ),
    "faithful": Stack((varnish(film_nm=300.0, film_eta=1.9),), Conductor(alpha=0.2, **COPPER, **FILM), Faithful()),
}

each = pytest.mark.parametrize("name", FILMED)


SLOPES = jax.jit(jax.grad(film_reflectance, argnums=range(5)))


def over(c, fn, *numbers):
    """Values of a formula at cosines (n,) or at one, of the other arguments as they are."""
    c, *numbers = np.broadcast_arrays(np.atleast_1d(np.asarray(c, float)), *numbers)
    return vectorised(fn)(c, *(x.astype(float) for x in numbers))


@functools.cache
def vectorised(fn):
    return jax.jit(jax.vmap(fn))


def arguments(case, dtype):
    """c, film_eta, eta, k and thickness of a case."""
    i = case["in"]
    return [np.asarray(x, dtype) for x in (i["c"], i["n2"], i["n3"], i["k3"], i["d_nm"] / i["lam_nm"])]


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_film_has_its_digits(oracle, dtype):
    reflected, passed = jax.jit(film_reflectance), jax.jit(film_transmittance)
    for case in cases(oracle)["thin_film"]:
        inputs, wanted = arguments(case, dtype), float(case["out"])
        if dtype == np.float32:
            wanted = float(reflected(*(x.astype(np.float64) for x in inputs)))
        assert close(float(reflected(*inputs)), wanted, REL[dtype], FLOOR[dtype]), case
        assert close(float(passed(*inputs)), 1.0 - wanted, REL[dtype], FLOOR[dtype]), case


def airy(c, film_eta, eta, k, thickness):
    """The formula as published, in as many digits as are set."""
    below = mpmath.mpc(eta, k)
    q2, q3 = (mpmath.sqrt(n * n - 1 + c * c) for n in (mpmath.mpc(film_eta), below))
    back = mpmath.exp(4j * mpmath.pi * thickness * q2)
    total = 0
    for above, film, under in ((c, q2, q3), (1 / c, film_eta**2 / q2, below**2 / q3)):
        r12, r23 = (above - film) / (above + film), (film - under) / (film + under)
        total += abs((r12 + r23 * back) / (1 + r12 * r23 * back)) ** 2 / 2
    return total


@pytest.mark.parametrize(
    "inputs",
    [(0.3, 1.7, 2.1, 3.3, 0.61), (0.8, 2.4, 0.2, 3.9, 1.3), (0.05, 1.38, 1.5, 0.1, 0.2), (0.4, 0.8, 1.1, 2.0, 0.15)],
    ids=["metal", "silver", "grazing", "light fades in the film"],
)
@pytest.mark.parametrize("dtype", DTYPES)
def test_values_and_derivatives_are_those_of_the_formula(inputs, dtype):
    rounded = [np.asarray(x, dtype) for x in inputs]
    slopes = SLOPES(*map(jnp.asarray, rounded))
    with mpmath.workdps(50):
        exact = [mpmath.mpf(float(x)) for x in rounded]
        assert float(film_reflectance(*map(jnp.asarray, rounded))) == pytest.approx(float(airy(*exact)), rel=REL[dtype])
        for k, slope in enumerate(slopes):
            wanted = mpmath.diff(airy, tuple(exact), tuple(int(j == k) for j in range(5)))
            assert float(slope) == pytest.approx(float(wanted), rel=SLOPE[dtype], abs=SLOPE[dtype])


@pytest.mark.parametrize("dtype", DTYPES)
def test_values_and_derivatives_are_finite_at_the_edges(dtype):
    """Grazing light, matched indices, total reflection at either side, no film and a thick one."""
    below = ((0.1, 5.0), (1.5, 0.0), (1.0, 0.0), (0.6, 0.0), (4.0, 15.0))
    grid = itertools.product((0.0, 1e-6, 0.3, 0.8, 1.0), (0.5, 0.6, 1.0, 1.0001, 3.0), below, (0.0, 1e-6, 0.3, 20.0))
    columns = [jnp.asarray(column, dtype) for column in zip(*((c, n, *b, t) for c, n, b, t in grid), strict=True)]
    both = lambda *x: (film_reflectance(*x), film_transmittance(*x))  # noqa: E731
    one_by_one = jax.vmap(lambda *x: jax.vmap(lambda t: jax.jvp(both, x, tuple(t)))(jnp.eye(5, dtype=dtype)))
    (reflected, passed), slopes = jax.jit(one_by_one)(*columns)
    assert all(np.all(np.isfinite(x)) for x in (reflected, passed, *slopes))
    matched_grazing = (columns[0] == 0.0) & (columns[2] == 1.0) & (columns[3] == 0.0)  # 0 / 0: a boundary that is not there
    total = np.asarray(reflected + passed)[:, 0][~np.asarray(matched_grazing)]
    np.testing.assert_allclose(total, 1.0, atol=1e-13 if dtype == np.float64 else 1e-6)


def test_no_thickness_is_no_film():
    c = np.linspace(0.0, 1.0, 101)[1:]
    for film, (eta, k) in itertools.product((0.7, 2.4), ((0.2, 3.9), (3.0, 3.0), (1.5, 0.0))):
        bare, none = over(c, fresnel_conductor, eta, k), over(c, film_reflectance, film, eta, k, 0.0)
        np.testing.assert_allclose(none, bare, rtol=1e-12, atol=1e-14)
    through = over(c, film_transmittance, 2.4, 1.5, 0.0, 0.0)
    np.testing.assert_allclose(through, over(c, transmittance_dielectric, 1.5), rtol=1e-12)


def test_half_a_wave_is_not_seen_and_a_quarter_may_take_all():
    half = 0.5 / 1.7
    np.testing.assert_allclose(
        over(1.0, film_reflectance, 1.7, 1.5, 0.0, 3 * half), over(1.0, fresnel_dielectric, 1.5), rtol=1e-10
    )
    n = 1.5**0.5
    np.testing.assert_allclose(over(1.0, film_reflectance, n, 1.5, 0.0, 0.25 / n), 0.0, atol=1e-15)


def test_a_film_reflects_the_same_from_both_sides():
    """It takes up nothing: so do its two media exchange as much."""
    sine = np.linspace(0.0, 0.99, 30)
    above = over(np.sqrt(1.0 - sine**2), film_reflectance, 2.1, 1.5, 0.0, 0.37)
    below = over(np.sqrt(1.0 - (sine / 1.5) ** 2), film_reflectance, 2.1 / 1.5, 1.0 / 1.5, 0.0, 0.37 * 1.5)
    np.testing.assert_allclose(above, below, rtol=1e-9)


def test_daylight_is_that_of_colour_science():
    np.testing.assert_allclose(daylight_weights(), rgb_weights("D65"), atol=1e-11)


def spectral(c, film_eta, eta, k, film_nm):
    """Reflectance (3,) in daylight."""
    at = jax.vmap(lambda wavelength: film_reflectance(c, film_eta, eta, k, film_nm / wavelength))(jnp.asarray(WAVELENGTHS_NM))
    return jnp.sum(jnp.asarray(daylight_weights()) * at, 0)


def test_three_channels_are_the_spectrum():
    """And no three wavelengths: thick films do not alias."""
    c = jnp.linspace(0.05, 1.0, 20)
    thickness = jnp.array([0.0, 50.0, 120.0, 300.0, 500.0, 800.0, 1200.0, 2000.0])

    def both(c, film_eta, eta, k, film_nm):
        f0 = lambda c: baked_f0(Baked(*bake(film_eta, eta, k, film_nm)), c)  # noqa: E731
        reflects = jax.vmap(lambda c: film_reflects(c, f0(c)))(c)
        passes = jax.vmap(lambda c: film_passes(c, f0(c)))(c)
        truth = jax.vmap(lambda c: spectral(c, film_eta, eta, k, film_nm))(c)
        return reflects, passes, jnp.clip(truth, 0.0, 1.0)

    compared = jax.jit(jax.vmap(both, (None, None, None, None, 0)))
    below = TITANIUM, COPPER, {"eta": [1.5] * 3, "k": [0.0] * 3}
    errors = []
    for film_eta, metal in itertools.product((1.38, 1.8, 2.4), below):
        index = jnp.asarray(metal["eta"]), jnp.asarray(metal["k"])
        reflects, passes, truth = compared(c, jnp.full(3, film_eta), *index, thickness)
        np.testing.assert_allclose(reflects + passes, 1.0, atol=1e-12)
        errors.append(reflects - truth)
    assert np.sqrt(np.mean(np.square(errors))) < BAKED_RMS
    assert np.max(np.abs(errors)) < BAKED_MAX


def transfer_matrix(c, film_eta, eta, k, film_nm, wavelength_nm, layers=1):
    """Reflectance of a film cut into layers, by a product of complex 2 x 2 matrices (Abeles 1950); arrays that broadcast."""
    c, film, below, film_nm, wavelength_nm = np.broadcast_arrays(c, film_eta, eta + 1j * k, film_nm, wavelength_nm)
    depth = np.diff(np.concatenate([[0.0], np.sort(np.random.default_rng(0).uniform(size=layers - 1)), [1.0]]))
    q2, q3 = (np.sqrt(n * n - (1.0 - c) * (1.0 + c) + 0j) for n in (film, below))
    total = 0.0
    for above, inside, under in ((c, q2, q3), (1.0 / c, film**2 / q2, below**2 / q3)):
        field = np.stack([np.ones_like(under), under], -1)[..., None]  # E and H at the lower side
        for part in depth[::-1]:
            d = 2.0 * np.pi * part * film_nm / wavelength_nm * q2
            rows = [[np.cos(d), -1j * np.sin(d) / inside], [-1j * np.sin(d) * inside, np.cos(d)]]
            field = np.moveaxis(np.array(rows), (0, 1), (-2, -1)) @ field
        E, H = field[..., 0, 0], field[..., 1, 0]
        total = total + 0.5 * np.abs((above * E - H) / (above * E + H)) ** 2
    return total


ANGLES_DEG = np.array([0.0, 30.0, 60.0, 75.0, 85.0])
BY_ANGLE = {"metal": 7e-4, "coat": 5e-4}
"""Root mean square of the reflectance, over three channels and 21 films, at any of these angles: 4.5e-4 and 3.2e-4."""


@pytest.mark.parametrize("layers", [1, 4])
def test_a_film_is_a_product_of_matrices(layers):
    """However many layers it is cut into, at every angle and wavelength."""
    c = np.cos(np.radians(ANGLES_DEG))[:, None, None]
    wavelength, film_nm = WAVELENGTHS_NM[::8][:, None], np.array([5.0, 110.0, 700.0])
    for film_eta, eta, k in ((2.4, 2.5, 3.4), (1.38, 1.5, 0.0), (1.8, 0.2, 3.9)):
        exact = transfer_matrix(c, film_eta, eta, k, film_nm, wavelength, layers)
        places = [a.ravel() for a in np.broadcast_arrays(c, film_nm / wavelength)]
        mine = over(places[0], film_reflectance, film_eta, eta, k, places[1])
        np.testing.assert_allclose(mine, exact.ravel(), rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("below", BY_ANGLE)
def test_the_colour_of_a_film_is_that_of_its_matrices_at_every_angle(below):
    """The three numbers that a shader has, on a metal and on a coat, against 81 wavelengths."""
    index = TITANIUM if below == "metal" else {"eta": [1.5] * 3, "k": [0.0] * 3}
    eta, k = (np.array(index[key]) for key in ("eta", "k"))
    c, film_nm = np.cos(np.radians(ANGLES_DEG)), np.arange(0.0, 601.0, 30.0)
    shape = c[:, None, None, None], film_nm[:, None, None]
    waves = transfer_matrix(shape[0], 2.4, eta, k, shape[1], WAVELENGTHS_NM[:, None])
    exact = np.clip(np.einsum("ctwk,wk->ctk", waves, daylight_weights()), 0.0, 1.0)

    def colour(film_nm):
        film = {"film_nm": film_nm, "film_eta": jnp.float64(2.4)}
        layer = Conductor(eta=eta, k=k, **film) if below == "metal" else Coat(eta=jnp.float64(1.5), **film)
        return jax.vmap(layer.below(jnp.float64(1.0)).reflectance)(c)

    found = jnp.swapaxes(jax.jit(jax.vmap(colour))(film_nm), 0, 1)
    rms = np.sqrt(np.mean((found - exact) ** 2, (1, 2)))
    assert np.all(rms < BY_ANGLE[below]), rms


def test_a_dark_channel_ends_smoothly():
    """Never below the darkest, with the slope 0 there, and untouched from twice that on; what does not reflect passes."""
    f0 = jnp.concatenate([jnp.linspace(-0.0205, 0.02, 82), jnp.array([0.3, 0.9, 1.0, 1.2])])
    one = jnp.ones_like(f0)
    reflects, passes = (jax.vmap(fn) for fn in (film_reflects, film_passes))
    value, slope = jax.jvp(lambda f0: reflects(one, f0), (f0,), (one,))
    np.testing.assert_allclose(value + passes(one, f0), 1.0, atol=1e-15)
    assert float(jnp.min(value)) == pytest.approx(DARKEST, rel=1e-12)
    assert np.all(slope[f0 < 0.0] == 0.0)
    between = (f0 > 0.0) & (f0 < 2.0 * DARKEST)
    assert np.sum(between) > 5
    np.testing.assert_allclose(slope[between], f0[between] / (2.0 * DARKEST), rtol=1e-12, atol=1e-15)
    kept = (f0 >= 2.0 * DARKEST) & (f0 <= 1.0)
    np.testing.assert_allclose(value[kept], f0[kept], rtol=1e-14)


def test_the_complement_is_that_of_schlick():
    c = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(schlick_complement(c), 1.0 - (1.0 - c) ** 5, atol=1e-15)


def test_a_channel_is_one_of_the_colour():
    """A renderer maps over channels; a film has to know which it is in."""
    stack = FILMED["on metal"].astype(np.float32)
    wi, wo = hemisphere(64, 1).astype(np.float32), hemisphere(64, 2).astype(np.float32)
    whole = brdf_rows(stack, wi, wo)
    np.testing.assert_allclose(predict(stack, wi[:, None], wo, np.ones((64, 1, 3))), whole, rtol=2e-5)


def test_a_film_of_no_thickness_is_nearly_none():
    """By the polynomial's own error."""
    wi, wo = hemisphere(128, 3), hemisphere(128, 4)
    bare = Stack((varnish(),), Conductor(alpha=0.3, **TITANIUM)).astype(np.float64)
    none = dataclasses.replace(bare, base=Conductor(alpha=0.3, **TITANIUM, film_nm=0.0, film_eta=2.4)).astype(np.float64)
    np.testing.assert_allclose(brdf_rows(none, wi, wo), brdf_rows(bare, wi, wo), rtol=4e-3)


@pytest.mark.parametrize("name", ["below a coat", "on a coat"])
def test_reciprocity(name):
    stack = FILMED[name].astype(np.float64)
    wi, wo = hemisphere(64, 1), hemisphere(64, 2)
    np.testing.assert_allclose(brdf_rows(stack, wi, wo), brdf_rows(stack, wo, wi), rtol=1e-11)


def test_derivatives_agree_with_differences():
    stack = FILMED["on metal"].astype(np.float64)
    wi, wo = jnp.asarray(direction(35.0)), jnp.asarray(direction(50.0, 150.0))
    fn = jax.jit(lambda stack: jnp.sum(brdf(stack, wi, wo)))
    slopes = jax.tree.leaves(jax.jit(jax.grad(fn))(stack))
    leaves, structure = jax.tree.flatten(stack)
    for k, (leaf, slope) in enumerate(zip(leaves, slopes, strict=True)):
        h = 1e-6 * float(jnp.max(jnp.abs(leaf)))
        values = [fn(jax.tree.unflatten(structure, [*leaves[:k], leaf + s * h, *leaves[k + 1 :]])) for s in (1.0, -1.0)]
        assert float(jnp.sum(slope)) == pytest.approx(float(values[0] - values[1]) / (2.0 * h), rel=2e-5, abs=1e-8)


def test_a_material_with_a_film_is_finite_in_single_precision():
    stack = FILMED["on metal"].astype(np.float32)
    edge = np.array([direction(t, p) for t, p in [(0, 0), (89.99, 0), (89.99, 180), (45, 0), (45, 180)]], np.float32)
    wi, wo = np.repeat(edge, len(edge), 0), np.tile(edge, (len(edge), 1))
    values, slopes = with_slope(lambda s: brdf_rows(s, wi, wo), stack)
    assert np.all(np.isfinite(values))
    assert np.all(np.isfinite(slopes))


@each
def test_parity(gl, name):
    parity = check_pairs(print_material(FILMED[name], "test"), 16384)
    assert parity.p999_rel <= 1e-5, parity
    assert parity.max_rel <= 5e-5, parity


VIOLET: dict[str, Any] = {"film_nm": 180.0, "film_eta": [2.3, 2.35, 2.45]}
SATURATED: dict[str, Stack] = {
    "on metal": Stack((), Conductor(alpha=0.2, **TITANIUM, **VIOLET)),
    "on narrow metal": Stack((), Conductor(alpha=0.03, **TITANIUM, **VIOLET)),
    "hardly reflecting": Stack((varnish(film_nm=110.0, film_eta=1.23),), Lambert(albedo=[0.5, 0.28, 0.13])),
}
"""Films with a channel that passes through 0 at some angle."""


@pytest.mark.parametrize("name", SATURATED)
def test_parity_of_saturated_films(gl, name):
    """Where a channel is next to nothing, and next to all of the others."""
    parity = check_pairs(print_material(SATURATED[name], "test"))
    assert parity.passed, parity


@each
def test_validates(name, tmp_path):
    shader = print_material(FILMED[name], "test")
    compiles(tmp_path, {f"{target}.frag": shader.text(target) for target in HEADERS})


def test_what_has_no_film_has_nothing_of_it():
    bare = print_material(Stack((varnish(),), Conductor(**TITANIUM)), "bare").text()
    assert "film" not in bare
    filmed = print_material(FILMED["on metal"], "filmed").text()
    assert "vec3 lf_film_on_metal(Conductor base, float c) {" in filmed
    assert "base: under a film of 60 nm" in filmed
    assert "fresnel_conductor" not in filmed


def test_what_is_integrated_once_cannot_be_a_uniform():
    with pytest.raises(InputError, match=r"base\.film_nm: a film is integrated over the spectrum once a material"):
        print_material(FILMED["on metal"], "test", uniforms=True)


@pytest.mark.parametrize("name", ["on a coat", "below a coat"])
def test_the_precise_form_and_the_walk_refuse_a_film(name):
    stack = FILMED[name]
    document = preset_of(stack, "test")
    material = {key: document[key] for key in ("layers", "base")}
    assert isinstance(stack_of(material, "here").form, type(stack.form)), "corrected is taken in its place"
    with pytest.raises(InputError, match=r'model = "precise" is not for this material: \w+ has a thin film'):
        stack_of({**material, "model": "precise"}, "here")
    with pytest.raises(ValueError, match="thin film"):
        dataclasses.replace(stack, form=Precise()).prepare()
    with pytest.raises(ValueError, match="thin film, which the walk does not know"):
        check(stack, "single", {})


@pytest.mark.parametrize(
    ("film", "message"),
    [
        ({"film_nm": 50.0}, "film_eta is missing"),
        ({"film_nm": 50.0, "film_eta": 2.4, "fresnel": "schlick"}, 'leave fresnel = "schlick" out'),
        ({"film_nm": 2500.0, "film_eta": 2.4}, "0 to 2000 nm"),
        ({"film_nm": 50.0, "film_eta": 2.4, "film_0": 1.0}, "unknown key 'film_0'"),
    ],
)
@pytest.mark.parametrize("kind", ["conductor", "coat"])
def test_a_film_that_cannot_be_is_refused(kind, film, message):
    layer = {"type": kind, **film}
    material = {"base": layer} if kind == "conductor" else {"layers": [layer], "base": {"type": "lambert"}}
    with pytest.raises(InputError, match=message):
        stack_of(material, "here")


def test_a_film_that_cannot_be_is_refused_in_python():
    with pytest.raises(InputError, match="base: film_nm and film_eta come together"):
        Stack((), Conductor(film_nm=50.0)).prepare()


@pytest.mark.parametrize(("preset", "order"), [("tempered_steel", "bgr"), ("anodised_titanium", "bgr")])
def test_shipped_films_have_the_colour_of_their_kind(preset, order):
    up = np.array([[0.0, 0.0, 1.0]])
    colour = np.asarray(brdf_rows(read_preset(preset).astype(np.float64), up, up))[0]
    assert "".join("rgb"[k] for k in np.argsort(-colour)) == order


TRUTH = Stack((), Conductor(alpha=0.3, film_nm=62.0, film_eta=2.4, **TITANIUM))


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """A sphere of titanium with a film."""
    return sphere_view(TRUTH, tmp_path_factory.mktemp("film"), 32)


@pytest.mark.parametrize("start", [20.0, 400.0])
def test_the_thickness_of_a_film_is_found(sphere, start):
    begun = dataclasses.replace(TRUTH, base=dataclasses.replace(TRUTH.base, film_nm=start, alpha=0.15))
    found = fit([sphere], begun, starts=4)
    rows = parameters(found)
    assert set(rows) >= {"base.film_nm", "base.alpha"}
    assert "base.film_eta" not in {f.name for f in found.free.free}, "near the normal only film_eta film_nm is seen"
    assert found.converged
    assert rows["base.film_nm"]["value"] == pytest.approx(62.0, rel=1e-3)
    assert rows["base.alpha"]["value"] == pytest.approx(0.3, rel=1e-3)
