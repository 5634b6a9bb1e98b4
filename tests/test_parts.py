"""Surfaces, layers and forms over all that they may be given: materials with every number from end to end of its range, ends included.

What no material here calls, and no list says is tried elsewhere, fails the last test.
"""

import importlib
import pkgutil
import sys
from collections.abc import Iterator
from functools import cache
from inspect import unwrap
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import layerfit as lf
from drawn import FEW, ROWS, shares
from helpers import QUICKLY
from layerfit import forms, layers, surfaces
from layerfit._directions import random_pairs, random_places
from layerfit.forms import one_coat, two_coats
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import held
from layerfit.layers import Patina
from layerfit.stability.grid import parameters
from layerfit.stack import Stack, prepared
from layerfit.surfaces import Conductor
from test_properties import STRUCTURES, materials

NAMES = (
    "conductor, filmed",
    "dielectric, fresnel lazanyi",
    "oren_nayar, form qualitative",
    "blinn, whole",
    "torrance_sparrow, whole",
    "cook_torrance, whole",
    "corrected, coat over conductor, distribution beckmann",
    "corrected, coat over conductor, trapped True",
    "corrected, coat, filmed over conductor",
    "corrected, coat over phong, whole",
    "corrected, coat over lafortune",
    "corrected, coat over oren_nayar",
    "corrected, coat over kubelka_munk",
    "corrected, coat over car_paint, whole",
    "corrected, coat over flakes, whole",
    "corrected, coat, whole over conductor",
    "corrected, milky coat over lambert",
    "faithful, coat over conductor",
    "precise, coat, anisotropic over conductor, anisotropic",
    "precise, two coats over conductor",
    "corrected, patina, whole",
    "faithful, patina, by its thickness",
    "weathered, overgrowth, whole",
    "weathered, polish erosion deposit",
)
"""Of all structures enough to call every function, but for those of what is added as it was published."""

ADDED = Stack((Patina(albedo=0.5, depth=0.3, softness=0.03, mixing="added"),), Conductor(), Faithful())
TRIED = {name: STRUCTURES[name] for name in NAMES} | {"faithful, patina, mixing added, scattering": ADDED}

PAIRS = 16

ELSEWHERE = {
    "against_walk": "test_tradeoff",
    "held": "test_parts",
    "Origin": "test_tables",
    "origin": "test_tables",
}
"""Functions and classes that no material calls, and the tests of each; declarations of fields are called as a class is made."""

DECLARES = ("_param", "_choice", "metal_eta", "metal_k", "film_nm", "film_eta", "lazanyi_a", "lazanyi_alpha")


@cache
def values(name: str) -> Any:
    """BRDF (rows, n, 3) of materials, pairs of directions and places, and its derivative along all numbers of a material at once."""

    def each(stack: Any, wi: Any, wo: Any, place: Any) -> Any:
        along = jax.tree.map(jnp.ones_like, stack)
        return jax.jvp(lambda stack: lf.brdf(stack, wi, wo, place), (stack,), (along,))

    return jax.jit(jax.vmap(each, (0, None, None, None)), compiler_options=QUICKLY)


@pytest.mark.parametrize("name", TRIED)
def test_a_material_is_finite_and_not_negative(name):
    template = TRIED[name]
    count = len(parameters(template))

    @settings(FEW, max_examples=4)
    @given(shares(ROWS, count), st.integers(0, 1000))
    def holds(places: np.ndarray, seed: int) -> None:
        places[:2] = [[0.0], [1.0]]  # all at once, too
        stack = materials(template, places, np.float32)
        f, slope = values(name)(stack, *random_pairs(PAIRS, seed), random_places(PAIRS, seed))
        assert f.shape == (ROWS, PAIRS, 3)
        for x in (f, slope):
            row = int(np.argmin(np.isfinite(x).all((1, 2))))
            assert np.all(np.isfinite(x[row])), jax.tree.map(lambda leaf, row=row: leaf[row], stack)
        assert f.min() >= 0.0

    holds()


@pytest.mark.parametrize(
    ("name", "form"), [("precise, coat over conductor", one_coat), ("precise, two coats over lambert", two_coats)]
)
def test_what_a_shader_holds_is_what_was_baked(name, form):
    """Of a precise material: the parts of its form, without the numbers that a shader may set."""
    made = prepared(STRUCTURES[name].astype(np.float32))
    constants = held(made)
    assert set(constants) == set(form.HELD)
    assert all(constants[key] is getattr(made, key) for key in constants)
    assert not {"coat", "coats", "base"} & set(constants)


def modules() -> Iterator[Any]:
    """Of the three packages."""
    for package in (surfaces, layers, forms):
        for found in pkgutil.iter_modules(package.__path__):
            yield importlib.import_module(f"{package.__name__}.{found.name}")


def public() -> Iterator[Any]:
    """Functions and classes that begin with no underscore, of every module."""
    for module in modules():
        own = [value for name, value in vars(module).items() if not name.startswith("_")]
        yield from (x for x in own if callable(x) and getattr(x, "__module__", "") == module.__name__)


def codes(value: Any) -> set[CodeType]:
    """Of a function; of a class those of its own methods and of what is derived from it."""
    if not isinstance(value, type):
        return {unwrap(value).__code__}
    own = [getattr(method, "fget", method) for method in vars(value).values()]
    found = {method.__code__ for method in own if isinstance(method, FunctionType)}
    return found.union(*(codes(derived) for derived in value.__subclasses__()))


def called() -> set[CodeType]:
    """What is called where the materials are traced."""
    found: set[CodeType] = set()
    wi, wo = random_pairs(2, 0)
    # What was called before with the same is not called again.
    jax.clear_caches()
    for forget in [getattr(value, "cache_clear", None) for module in modules() for value in vars(module).values()]:
        if forget:
            forget()
    before = sys.gettrace()
    sys.settrace(lambda frame, *_: found.add(frame.f_code))  # of calls alone: of what it returns, None, no lines are traced
    try:
        for stack in TRIED.values():
            stack = jax.tree.map(jnp.float32, stack)
            for place in (None, random_places(2, 0)) if stack.reads else (None,):
                jax.eval_shape(lf.brdf, stack, wi, wo, place)
    finally:
        sys.settrace(before)
    return found


def test_every_function_and_class_is_of_a_material_here():
    reached, here = called(), Path(__file__)
    options = {type(stack.form) for stack in TRIED.values()}
    left = [x for x in public() if not codes(x) & reached and x not in options]
    untried = {x.__name__ for x in left if not x.__name__.endswith(DECLARES)}
    assert untried == set(ELSEWHERE)
    for name, file in ELSEWHERE.items():
        assert name.lower() in here.with_name(f"{file}.py").read_text()
