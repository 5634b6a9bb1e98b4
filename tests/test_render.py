"""Pixels of a material: sums over light samples, in parts of any number."""

import itertools

import jax
import numpy as np
import pytest

from helpers import COPPER, hemisphere, varnish
from layerfit import _compiled
from layerfit.render import predict, radiance
from layerfit.stack import Stack
from layerfit.surfaces import BASES, Blinn, Conductor, Phong

STACK = Stack((varnish(),), Conductor(alpha=0.2, **COPPER))


@pytest.mark.parametrize(("pixels", "lights"), [(5, 1), (3, 20), (3, 513), (2, 1030)])
def test_a_pixel_is_the_sum_over_its_lights(pixels, lights):
    """However many are summed at once, and however they are padded to make equal parts."""
    wi = hemisphere(pixels * lights).reshape(pixels, lights, 3)
    wo = hemisphere(pixels, 1)
    weight = np.random.default_rng(0).random((pixels, lights, 3)) / lights
    wanted = jax.jit(radiance)(STACK.astype(np.float64), wi, wo, weight)
    np.testing.assert_allclose(predict(STACK, wi, wo, weight), wanted, rtol=2e-5)


@pytest.fixture
def kept(monkeypatch, tmp_path):
    monkeypatch.setattr(_compiled, "KEPT", [tmp_path / "traced"])
    return tmp_path / "traced"


def test_what_an_earlier_run_traced_is_not_traced_again(kept):
    """Nor is it taken for another: not for other classes, constants, sizes or precisions, and not where its file is broken."""
    traces = []

    def twice(base, *, times):
        traces.append(base)
        return jax.tree.map(lambda x: times * x, base)

    def run(base, times=2.0):
        made = _compiled.Compiled(twice)(base, times=times)
        return len(traces), len(list(kept.iterdir())), made

    phong, blinn = ({"base": jax.tree.map(np.float32, cls(exponent=7.0))} for cls in (Phong, Blinn))
    count, files, made = run(phong)
    assert (count, files, type(made["base"])) == (1, 1, Phong)
    count, files, made = run(phong)
    assert (count, files, type(made["base"]), float(made["base"].exponent)) == (1, 1, Phong, 14.0)
    assert made["base"].name == phong["base"].name
    count, files, made = run(blinn)
    assert (count, files, type(made["base"])) == (2, 2, Blinn)
    count, files, made = run(phong, 3.0)
    assert (count, files, float(made["base"].exponent)) == (3, 3, 21.0)
    assert run(np.zeros(3, np.float32))[:2] == (4, 4)
    assert run(np.zeros(3))[:2] == (5, 5)
    for path in kept.iterdir():
        path.write_bytes(path.read_bytes()[:-1])
    count, files, made = run(phong)
    assert (count, files, float(made["base"].exponent)) == (6, 5, 14.0)


def test_a_cache_that_cannot_be_written_stops_nothing(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(_compiled, "KEPT", [tmp_path / "file" / "traced"])
    assert _compiled.Compiled(lambda x: 2.0 * x)(np.float32(3.0)) == 6.0


def test_what_failed_to_compile_is_tried_again(monkeypatch):
    doubled = _compiled.Compiled(lambda x: 2.0 * x)
    with monkeypatch.context() as wrong:
        wrong.setitem(_compiled.OPTIONS, "no_such_option", True)
        with pytest.raises(jax.errors.JaxRuntimeError, match="no_such"):
            doubled(np.float32(3.0))
    assert doubled(np.float32(3.0)) == 6.0


def test_classes_with_fields_alike_are_of_different_structure():
    """Structures are what compiled functions are kept by: a Blinn may not be drawn by what was compiled for a Phong."""
    bases = [cls() for cls in BASES.values()]
    alike = [(a, b) for a, b in itertools.combinations(bases, 2) if len(jax.tree.leaves(a)) == len(jax.tree.leaves(b))]
    assert alike
    for a, b in alike:
        assert jax.tree.structure(a) != jax.tree.structure(b), (a, b)
    leaves, structure = jax.tree.flatten(bases[0])
    assert jax.tree.structure(jax.tree.unflatten(structure, leaves)) == structure
