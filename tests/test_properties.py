"""What users call, over all that it may be given: every number of a material from end to end of its range, ends included.

Few structures are compiled, each once; an example holds many materials and directions.
"""

import dataclasses
import inspect
import json
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

import layerfit as lf
from drawn import FEW, MANY, ROWS, at, shares
from helpers import QUICKLY
from layerfit._directions import random_pairs
from layerfit.preset import stack_of
from layerfit.stability.grid import parameters
from layerfit.stability.models import structures

STRUCTURES = structures()
COMPILED = (
    "conductor, anisotropic",
    "dielectric",
    "oren_nayar",
    "kubelka_munk",
    "corrected, coat over lambert",
    "precise, coat over conductor",
)
RECIPROCAL = {"conductor, anisotropic", "dielectric", "oren_nayar", "corrected, coat over lambert"}
"""What is reciprocal by its formula; `precise` is near to a walk, which is so in the mean."""

TURNED = 1e-9
"""Of a BRDF in float64, when its directions are turned: cosines of half vectors at grazing angles lose half of their digits."""


def materials(template: Any, places: np.ndarray, dtype: Any = float) -> Any:
    """A material a row, every number of it at its place in its range."""
    columns = [at(free.spec, place).astype(dtype) for free, place in zip(parameters(template), places.T, strict=True)]
    return jax.tree.unflatten(jax.tree.structure(template), columns)


@cache
def values(name: str) -> Any:
    """BRDF (rows, n, 3) of materials and pairs of directions."""
    each = jax.vmap(lambda stack, wi, wo: lf.brdf(stack, wi, wo), (0, None, None))
    return jax.jit(each, compiler_options=QUICKLY)


def turned(w: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(w) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("name", COMPILED)
def test_a_brdf_is_finite_not_negative_and_of_its_surface(name):
    """Reciprocal where its formula is, and the same in a frame that is turned about the normal where no grain is in it."""
    template = STRUCTURES[name]
    count = len(parameters(template))
    isotropic = "anisotropic" not in name

    @FEW
    @given(shares(ROWS, count), st.integers(0, 1000), st.floats(0.0, 2.0 * np.pi))
    def holds(places: np.ndarray, seed: int, angle: float) -> None:
        stack = materials(template, places)
        wi, wo = (w.astype(float) for w in random_pairs(48, seed))
        wi, wo = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (wi, wo))
        f = np.asarray(values(name)(stack, wi, wo))
        assert f.shape == (ROWS, 48, 3)
        assert np.all(np.isfinite(f))
        assert f.min() >= 0.0
        scale = np.maximum(f, 1e-6)
        if name in RECIPROCAL:
            assert np.max(np.abs(np.asarray(values(name)(stack, wo, wi)) - f) / scale) < TURNED
        if isotropic:
            again = np.asarray(values(name)(stack, turned(wi, angle), turned(wo, angle)))
            assert np.max(np.abs(again - f) / scale) < 1e3 * TURNED

    holds()


@MANY
@given(st.sampled_from(sorted(STRUCTURES)), st.data())
def test_a_preset_is_read_as_it_was_written(tmp_path_factory, name, data):
    """Of every structure, to the digits that a preset keeps; written again, it is the same text."""
    template = STRUCTURES[name]
    stack = jax.tree.map(lambda a: a[0], materials(template, data.draw(shares(1, len(parameters(template))))))
    path = tmp_path_factory.mktemp("preset") / "a.json"
    lf.write_preset(path, stack, "a")
    read = lf.read_preset(path)
    assert jax.tree.structure(read) == jax.tree.structure(stack)
    for old, new in zip(jax.tree.leaves(stack), jax.tree.leaves(read), strict=True):
        np.testing.assert_allclose(new, old, rtol=1e-5, atol=1e-12)
    lf.write_preset(path.with_name("b.json"), read, "a")
    assert path.with_name("b.json").read_text() == path.read_text()
    assert stack_of(
        {k: v for k, v in json.loads(path.read_text()).items() if k in ("model", "interface", "options", "layers", "base")}, "a"
    )


@MANY
@given(st.text(max_size=200))
def test_a_name_is_never_code(name):
    """Whatever a material is called: the lines of its shader that are no comments stay what they are."""
    code = lambda text: [line for line in text.splitlines() if line and not line.startswith("//")]  # noqa: E731
    assert code(dataclasses.replace(printed(), name=name).text()) == code(printed().text())


@cache
def printed() -> lf.Shader:
    return lf.print_material(STRUCTURES["lambert"], "m")


INDEX = st.floats(0.01, 20.0)


@settings(FEW, max_examples=20)
@given(arrays(float, 3, elements=INDEX), arrays(float, 3, elements=st.floats(0.0, 20.0)))
def test_a_short_fresnel_formula_says_how_good_it_is(eta, k):
    found = lf.fit_lazanyi(eta, k)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(found))
    assert np.all(np.asarray(found.error) >= 0.0)


@settings(FEW, max_examples=40)
@given(
    st.lists(st.floats(1.0, 2000.0), min_size=2, max_size=20, unique=True).map(sorted),
    st.data(),
    st.floats(1e-3, 1e5),
)
def test_an_absorption_spectrum_is_three_channels_or_refused(wavelengths, data, thickness):
    absorption = data.draw(st.lists(st.floats(0.0, 1e6), min_size=len(wavelengths), max_size=len(wavelengths)))
    try:
        found = lf.absorption_rgb(wavelengths, absorption, thickness)
    except lf.InputError:
        return
    channels = found.absorption_per_mm
    assert channels.shape == (3,)
    assert np.all(np.isfinite(channels))
    assert np.all(channels >= 0.0)


@settings(FEW)
@given(arrays(float, (2, 12, 13, 3), elements=st.floats(0.0, 1e4)), arrays(bool, (12, 13)))
def test_errors_of_an_image(images, covered):
    image, reference = images
    covered[0, 0] = True
    same, other = lf.image_error(reference, reference, covered), lf.image_error(image, reference, covered)
    assert same["rel_l2"] == 0.0
    assert same["delta_e"] == pytest.approx(0.0, abs=1e-9)
    assert same["ssim"] == pytest.approx(1.0)
    assert other["rel_l2"] >= 0.0
    assert not any(np.isnan(value) for value in other.values())


@settings(FEW, max_examples=4)
@given(st.integers(0, 1000), st.floats(0.1, 10.0), st.permutations(range(4)))
def test_light_is_linear(seed, scale, order):
    """Brighter lights, and lights in another order."""
    stack = STRUCTURES["corrected, coat over lambert"]
    wi, wo = random_pairs(4 * 16, seed)
    wi, weight = wi.reshape(16, 4, 3), np.random.default_rng(seed).uniform(0.0, 3.0, (16, 4, 3)).astype(np.float32)
    seen = lf.predict(stack, wi, wo[:16], weight)
    np.testing.assert_allclose(lf.predict(stack, wi, wo[:16], np.float32(scale) * weight), scale * seen, rtol=1e-5)
    np.testing.assert_allclose(lf.predict(stack, wi[:, order], wo[:16], weight[:, order]), seen, rtol=1e-5)
    one_by_one = sum(lf.predict(stack, wi[:, k : k + 1], wo[:16], weight[:, k : k + 1]) for k in range(4))
    np.testing.assert_allclose(one_by_one, seen, rtol=1e-5)
    np.testing.assert_allclose(
        lf.radiance(stack, *(jnp.asarray(a, jnp.float32) for a in (wi, wo[:16], weight))), seen, rtol=2e-5
    )


@settings(FEW, max_examples=100)
@given(st.text(max_size=30))
def test_a_word_finds_presets(word):
    for found in lf.shipped_presets(word):
        assert word.lower() in f"{found.name} {found.group} {found.structure} {found.description}".lower()


@settings(FEW, max_examples=60)
@given(arrays(np.float32, (12, 13, 3), elements=st.floats(0.0, 1e4, width=32)), st.integers(0, 155), st.floats(0.01, 100.0))
def test_a_pixel_that_is_off_is_named(model, pixel, by):
    """A picture is like itself, and the worst pixel of one that is not is told by its place."""
    rows = model.reshape(-1, 3)
    same = lf.check_image(rows, rows, np.arange(156), 13)
    assert same.passed
    assert same.max_rel == 0.0
    broken = rows.copy()
    broken[pixel] += by * (1.0 + rows.max())
    other = lf.check_image(broken, rows, np.arange(156), 13)
    assert not other.passed
    assert (other.worst["x"], other.worst["y"]) == (pixel % 13, pixel // 13)


ELSEWHERE = {
    # files of any content
    "inspect": "test_inspect",
    "load": "test_measured",
    "read_brdf": "test_hostile",
    "read_scene": "test_hostile",
    "read_start": "test_interchange",
    "metal": "test_spectra",
    # what takes seconds: known materials, and what is refused
    "advise": "test_advise",
    "choose_structure": "test_structures",
    "choose_tier": "test_tiers",
    "export_to": "test_interchange",
    "fit": "test_fit",
    "fit_batch": "test_batch",
    "fit_map": "test_maps",
    "fit_scene": "test_references",
    "make_tier": "test_tiers",
    "specialise": "test_specialise",
    "structures_of": "test_structures",
    "study": "test_study",
    "tradeoff": "test_tradeoff",
    # the shader beside JAX, on random and extreme pairs of every structure
    "check_pairs": "test_printer",
    "shade_samples": "test_printer",
    # what is made of a result that is there
    "live": "test_notebook",
    "parameters": "test_references",
    "plot_convergence": "test_shown",
    "plot_plane": "test_shown",
    "plot_study": "test_study",
    "plot_tradeoff": "test_shown",
    "use_compilation_cache": "test_cache",
}
"""Public functions that no property here is of, and the tests of each."""


def test_every_public_function_is_tried():
    """A new one has a property here, or is listed with where it is tried."""
    here = Path(__file__)
    functions = {name for name in lf.__all__ if inspect.isfunction(getattr(lf, name))}
    tried = {name for name in functions if f"lf.{name}(" in here.read_text()}
    assert functions - tried == set(ELSEWHERE)
    for name, file in ELSEWHERE.items():
        assert name in here.with_name(f"{file}.py").read_text()
