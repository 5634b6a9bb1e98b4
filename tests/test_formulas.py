"""Every formula of `layerfit.optics` over all that it may be given: from end to end of each range, ends included.

A formula whose domain is not listed here fails the first test. One batch of a module's formulas is compiled for all examples.
"""

import dataclasses
import importlib
import inspect
import math
import pkgutil
from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from drawn import FEW, ROWS, at, shares
from helpers import QUICKLY
from layerfit import optics
from layerfit._fields import Param, params
from layerfit.layers import Coat, Patina
from layerfit.optics import (
    directions,
    film,
    flakes,
    fresnel,
    growth,
    hashing,
    interface,
    lazanyi,
    medium,
    microfacet,
    noise,
    scattering,
    spectra,
)
from layerfit.optics.scattering import TwoFlux
from layerfit.surfaces import Conductor, Flakes

ROUNDING = {np.float64: 1e-9, np.float32: 1e-4}
"""By which a result may leave its range, over the size of the range."""


@dataclasses.dataclass(frozen=True)
class Kind:
    """A kind of argument: how many places in ranges it takes, and what they make of it (rows, places) -> (rows, ...)."""

    places: int
    made: Callable[[np.ndarray], Any]


def number(lower: float, upper: float, scale: Any = "linear", soft: float = 1.0) -> Kind:
    spec = Param(None, lower, upper, scale, "", soft=soft)
    return Kind(1, lambda p: at(spec, p[:, 0]))


def field(cls: Any, name: str) -> Kind:
    """A field of a layer, over its range."""
    return Kind(1, lambda p: at(dict(params(cls))[name], p[:, 0]))


def whole(upper: int) -> Kind:
    """Whole numbers from 0, both ends among them."""
    return Kind(1, lambda p: np.floor(p[:, 0] * upper).astype(np.uint32))


def _direction(p: np.ndarray) -> np.ndarray:
    # By the angle: its cosine is squared near grazing, where formulas break. At the end it is 0, not a rounding of it.
    theta, phi = 0.5 * np.pi * p[:, 0], 2.0 * np.pi * p[:, 1]
    z = np.where(p[:, 0] == 1.0, 0.0, np.cos(theta))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z], -1)


def flux(R: Any, kept: Any) -> TwoFlux:
    """A layer that sends back R, and lets through a part of the rest."""
    return TwoFlux(R, kept * (1.0 - R))


UNIT, FULL = number(0.0, 1.0), (0.0, 1.0)
POSITIVE = (0.0, math.inf)
ANY = (-math.inf, math.inf)
W = Kind(2, _direction)
LIT = Kind(2, lambda p: _direction(p * [1.0 - 1e-4, 1.0]))  # above the surface
ALPHA = field(Coat, "alpha")
ETA = number(0.25, 4.0, "log")  # of a boundary between two dielectrics, from either side
DENSER = field(Coat, "eta")
INDEX, K = field(Conductor, "eta"), field(Conductor, "k")
FILM = field(Coat, "film_eta")
WAVES = number(0.0, 7.0)  # a film of 2000 nm in the shortest light that is seen
DEPTH = field(Coat, "tau")
G = field(Coat, "g")
PATH = number(1.0, 1e4, "log")
FLUXES = number(0.0, 1e3, "softlog")
YEARS, ONSET, STEEP = (field(Patina, name) for name in ("years", "onset_years", "steepness"))
TILT = Kind(2, lambda p: 6.0 * p - 3.0)  # three times the widest spread
UV = Kind(2, lambda p: 200.0 * p - 100.0)
WORDS = Kind(3, lambda p: np.floor(p * 0xFFFFFFFF).astype(np.uint32))
SEED = whole(16777215)
BITS = whole(0xFFFFFFFF)


def facets(kind: Any) -> dict[str, Any]:
    """The functions that choose a formula by its name, as formulas."""
    return {
        f"density {kind}": (lambda h, a: microfacet.density(kind, h, a), (W, ALPHA), POSITIVE),
        f"projection {kind}": (lambda w, a: microfacet.projection(kind, w, a), (W, ALPHA), POSITIVE),
        f"visibility {kind}": (lambda i, o, a: microfacet.visibility("smith", kind, i, o, a), (W, W, ALPHA), POSITIVE),
    }


DOMAINS: dict[Any, dict[str, Any]] = {
    directions: {
        "along": (directions.along, (W,), (-1.0, 1.0)),
        "sine2": (directions.sine2, (W,), FULL),
        "direction": (lambda w, c: directions.direction(w[:2], c), (W, UNIT), (-1.0, 1.0)),
        "above": (lambda w, wo: directions.above(directions.both_above(w, wo), w), (W, W), (-1.0, 1.0)),
    },
    film: {
        "film_reflectance": (film.film_reflectance, (UNIT, FILM, INDEX, K, WAVES), FULL),
        "film_transmittance": (film.film_transmittance, (UNIT, FILM, INDEX, K, WAVES), FULL),
        "schlick_complement": (film.schlick_complement, (UNIT,), FULL),
        "chebyshev_argument": (film.chebyshev_argument, (UNIT,), (-1.0, 1.0)),
        "bake": (lambda *given: jnp.stack(film.bake(*given)), (FILM, INDEX, K, field(Coat, "film_nm")), ANY),
    },
    flakes: {
        "flake_tilt": (flakes.flake_tilt, (UV, field(Flakes, "per_uv"), field(Flakes, "sigma"), SEED), (-6.0, 6.0)),
        "exponential": (flakes.exponential, (BITS, UNIT), (0.0, 17.5)),
        "circle": (flakes.circle, (BITS, UNIT), (-1.0, 1.0)),
        "odd_number": (lambda bits: flakes.odd_number(bits).astype(float), (BITS,), (1.0, 2.0**flakes.ODD)),
        "tilted_normal": (flakes.tilted_normal, (TILT,), (-1.0, 1.0)),
        "tilted_d": (flakes.tilted_d, (W, TILT, ALPHA), POSITIVE),
        "kept_tilt": (flakes.kept_tilt, (number(0.0, 1e6, "softlog"), field(Flakes, "half_distance")), FULL),
        "lost_variance": (flakes.lost_variance, (number(0.0, 1e6, "softlog"), field(Flakes, "half_distance")), FULL),
        "into_facet": (lambda w, t: flakes.into_facet(w, flakes.tilted_normal(t)), (W, TILT), (-1.0, 1.0)),
        "half_into_facet": (
            lambda i, o, t: flakes.half_into_facet(i, o, t, flakes.tilted_normal(t)),
            (LIT, LIT, TILT),
            (-1.0, 1.0),
        ),
    },
    fresnel: {
        "fresnel_dielectric": (fresnel.fresnel_dielectric, (UNIT, ETA), FULL),
        "transmittance_dielectric": (fresnel.transmittance_dielectric, (UNIT, ETA), FULL),
        "fresnel_conductor": (fresnel.fresnel_conductor, (UNIT, INDEX, K), FULL),
        "fresnel_hoffman": (fresnel.fresnel_hoffman, (UNIT, UNIT, UNIT), (-1.0, 2.0)),
        "fresnel_schlick": (fresnel.fresnel_schlick, (UNIT, UNIT), FULL),
        "rarer_cosine": (fresnel.rarer_cosine, (UNIT, ETA), FULL),
        "dielectric_f0": (fresnel.dielectric_f0, (ETA,), FULL),
        "conductor_f0": (fresnel.conductor_f0, (INDEX, K), FULL),
    },
    growth: {
        "softplus": (growth.softplus, (number(-1e7, 1e7),), POSITIVE),
        "exposed_part": (growth.exposed_part, (UNIT, UNIT), FULL),
        "coverage": (growth.coverage, (YEARS, ONSET, STEEP), FULL),
        "grown": (growth.grown, (UNIT, UNIT), FULL),
        "partly_grown": (growth.partly_grown, (UNIT, UNIT, field(Patina, "softness")), FULL),
        "onset": (growth.onset, (UNIT, ONSET, STEEP), POSITIVE),
        "tarnish_thickness": (growth.tarnish_thickness, (YEARS, ONSET, UNIT, field(Patina, "blur")), (0.0, 101.0)),
    },
    hashing: {
        "pcg3d": (lambda v: hashing.pcg3d(v) * 1.0, (WORDS,), (0.0, 2.0**32)),
        "hash_cell": (lambda p, seed: hashing.hash_cell(jnp.floor(p), seed) * 1.0, (UV, SEED), (0.0, 2.0**32)),
        "unit": (lambda v, like: hashing.unit(v[0], like), (WORDS, UNIT), (1e-9, 1.0 - 1e-9)),
    },
    interface: {
        "facet_tilt": (interface.facet_tilt, (ALPHA,), (0.0, 0.2)),
        "second_facet": (interface.second_facet, (ALPHA,), FULL),
        "spread_lengthening": (interface.spread_lengthening, (DENSER, ALPHA), POSITIVE),
        "drift_scale": (interface.drift_scale, (DENSER, ALPHA), POSITIVE),
        "facet_cosine": (interface.facet_cosine, (W, number(0.0, 0.2)), FULL),
        "with_second_facet": (interface.with_second_facet, (UNIT, UNIT), FULL),
        "rough_transmittance": (interface.rough_transmittance, (UNIT, ETA, UNIT), FULL),
        "drift": (interface.drift, (W, number(0.0, 41.0), ALPHA), POSITIVE),
        "slope_spread": (interface.slope_spread, (UNIT, DENSER), POSITIVE),
        "steer": (interface.steer, (W, number(0.0, 41.0)), (-1.0, 1.0)),
    },
    lazanyi: {
        # What was fitted may leave the range by its error; the fit itself is tried among what users call.
        "fresnel_lazanyi": (lazanyi.fresnel_lazanyi, (UNIT, UNIT, number(-2.0, 2.0), number(0.1, 50.0, "log")), (-2.0, 3.0)),
    },
    medium: {
        "refract_about_normal": (medium.refract_about_normal, (W, DENSER), (-1.0, 1.0)),
        "cosine_below": (medium.cosine_below, (UNIT, ETA), FULL),
        "refract_about_facet": (
            lambda i, o, eta: medium.refract_about_facet(
                i, microfacet.half_vector(i, o), c := microfacet.half_cosine(i, o), medium.cosine_below(c, eta), eta
            ),
            (W, W, DENSER),
            (-1.0, 1.0),
        ),
        "transmittance": (medium.transmittance, (DEPTH, PATH), FULL),
    },
    microfacet: {
        "ggx_d": (microfacet.ggx_d, (W, ALPHA), POSITIVE),
        "ggx_d_anisotropic": (microfacet.ggx_d_anisotropic, (W, ALPHA, ALPHA), POSITIVE),
        "beckmann_d": (microfacet.beckmann_d, (W, ALPHA), POSITIVE),
        "beckmann_d_anisotropic": (microfacet.beckmann_d_anisotropic, (W, ALPHA, ALPHA), POSITIVE),
        "beckmann_by_slopes": (microfacet.beckmann_by_slopes, (number(0.0, 1e6, "softlog"), UNIT, ALPHA), POSITIVE),
        "ggx_lambda": (microfacet.ggx_lambda, (number(0.0, 1e8, "softlog"),), POSITIVE),
        "ggx_lobe": (microfacet.ggx_lobe, (LIT, LIT, W, ALPHA), POSITIVE),
        "ggx_projection": (microfacet.ggx_projection, (W, ALPHA), FULL),
        "ggx_projection_anisotropic": (microfacet.ggx_projection_anisotropic, (W, ALPHA, ALPHA), FULL),
        "beckmann_projection": (microfacet.beckmann_projection, (W, ALPHA), (0.0, 1.3)),
        "beckmann_projection_anisotropic": (microfacet.beckmann_projection_anisotropic, (W, ALPHA, ALPHA), (0.0, 1.3)),
        "v_smith": (microfacet.v_smith, (UNIT, UNIT, UNIT, UNIT), POSITIVE),
        "v_smith_separable": (microfacet.v_smith_separable, (UNIT, UNIT, UNIT, UNIT), POSITIVE),
        "v_cavity": (microfacet.v_cavity, (W, W), POSITIVE),
        "half_vector": (microfacet.half_vector, (W, W), (-1.0, 1.0)),
        "half_cosine": (microfacet.half_cosine, (W, W), FULL),
        **facets("ggx"),
        **facets("beckmann"),
    },
    noise: {
        "corner_value": (lambda p, seed: noise.corner_value(jnp.floor(p), seed), (UV, SEED), FULL),
        "value_noise": (noise.value_noise, (UV, SEED), FULL),
        "fbm": (noise.fbm, (UV, SEED), FULL),
    },
    scattering: {
        "kubelka_munk": (scattering.kubelka_munk, (FLUXES, FLUXES), FULL),
        "kubelka_munk_over": (lambda R, T, below: scattering.kubelka_munk_over(flux(R, T), below), (UNIT, UNIT, UNIT), FULL),
        "kubelka_munk_infinite": (scattering.kubelka_munk_infinite, (FLUXES, FLUXES), FULL),
        "stacked": (lambda *x: scattering.stacked(flux(*x[:2]), flux(*x[2:])), (UNIT, UNIT, UNIT, UNIT), FULL),
        "saunderson": (scattering.saunderson, (UNIT, UNIT, UNIT), FULL),
        "henyey_greenstein": (scattering.henyey_greenstein, (number(0.0, 2.0), G), POSITIVE),
        "scattered_back": (scattering.scattered_back, (UNIT, UNIT, DEPTH, UNIT, UNIT), POSITIVE),
        "scattered_through": (scattering.scattered_through, (UNIT, UNIT, DEPTH, UNIT, UNIT), POSITIVE),
        "once_back": (scattering.once_back, (UNIT, DEPTH, DEPTH, PATH, PATH), POSITIVE),
        "once_through": (scattering.once_through, (UNIT, DEPTH, DEPTH, PATH, PATH), POSITIVE),
        "mean_transmittance": (scattering.mean_transmittance, (number(0.0, 1e4, "softlog"),), FULL),
        "unscattered": (scattering.unscattered, (DEPTH, UNIT), FULL),
    },
}
"""By module, a formula with the kinds of its arguments and the range of what it gives: of every number of it."""

ELSEWHERE = {
    directions: {"both_above"},  # a condition: with `above`
    lazanyi: {"fit_lazanyi"},  # in test_properties
    microfacet: {"density", "lobe", "projection", "visibility"},  # each by the names that it takes
    spectra: {"covers", "resample", "resampling", "delta_e", "absorption_rgb"},  # below, and in test_properties
}
"""Formulas that are tried in another way."""

NUMBERS = (
    "Scalar",
    "Colour",
    "Direction",
    "Vec",
    "UInt",
    "UVec",
    "Width",
    "Number",
    "TwoFlux",
    "Float[",
    "ndarray",
    "jax.Array",
    "Any",
)


def takes_numbers(fn: Any) -> bool:
    """By the annotations of its arguments."""
    kinds = [kind for name, kind in inspect.get_annotations(inspect.unwrap(fn)).items() if name != "return"]
    return any(word in str(getattr(kind, "__name__", kind)) for kind in kinds for word in NUMBERS)


def public(module: Any) -> set[str]:
    """The functions of a module that begin with no underscore and are its own."""
    own = [(name, value) for name, value in vars(module).items() if callable(value) and not name.startswith("_")]
    return {
        name
        for name, value in own
        if getattr(value, "__module__", "") == module.__name__ and not isinstance(value, type) and takes_numbers(value)
    }


def test_every_formula_has_its_domain():
    names = [module.name for module in pkgutil.iter_modules(optics.__path__)]
    for module in (importlib.import_module(f"{optics.__name__}.{name}") for name in names):
        listed = set(DOMAINS.get(module, {})) | ELSEWHERE.get(module, set())
        assert public(module) <= listed, f"{module.__name__}: these say nothing of what they may be given"


@cache
def compiled(module: Any) -> Any:
    """Values and derivatives, along all arguments at once, of all formulas of a module: (rows, ...) each."""

    def one(arguments: dict[str, Any]) -> Any:
        return {name: _slope(DOMAINS[module][name][0], given) for name, given in arguments.items()}

    return jax.jit(jax.vmap(one), compiler_options=QUICKLY)


def _slope(fn: Any, given: tuple[Any, ...]) -> Any:
    along = jax.tree.map(lambda x: jnp.ones_like(x) if x.dtype.kind == "f" else np.zeros(x.shape, jax.dtypes.float0), given)
    return jax.jvp(lambda *x: jax.tree.leaves(fn(*x)), given, along)  # a struct of batches is none: its shapes are checked


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("module", DOMAINS, ids=lambda module: module.__name__.rpartition(".")[2])
def test_a_formula_holds_over_its_whole_domain(module, dtype):
    """Finite, with finite derivatives, and in its range."""
    formulas = DOMAINS[module]
    count = sum(kind.places for _, kinds, _ in formulas.values() for kind in kinds)

    @settings(FEW, max_examples=8)
    @given(shares(ROWS, count))
    def holds(places: np.ndarray) -> None:
        places[:2] = [[0.0], [1.0]]  # all at once, too
        arguments, used = {}, 0
        for name, (_, kinds, _) in formulas.items():
            made = []
            for kind in kinds:
                value = kind.made(places[:, used : used + kind.places])
                made.append(jax.tree.map(lambda x: x.astype(dtype) if x.dtype.kind == "f" else x, value))
                used += kind.places
            arguments[name] = tuple(made)
        for name, (value, slope) in compiled(module)(arguments).items():
            lower, upper = formulas[name][2]
            room = ROUNDING[dtype] * (upper - lower if math.isfinite(upper - lower) else 1.0)
            for leaf, by in zip(value, slope, strict=True):
                rows, slopes = (np.asarray(x).reshape(ROWS, -1) for x in (leaf, by))
                good = np.isfinite(rows) & (rows >= lower - room) & (rows <= upper + room) & np.isfinite(slopes)
                worst = int(np.argmin(good.all(-1)))
                told = jax.tree.map(lambda x, row=worst: x[row], arguments[name])
                assert good.all(), (name, told, rows[worst], slopes[worst])

    holds()


@settings(FEW)
@given(arrays(float, (2, 9, 3), elements=st.floats(0.0, 1e4)))
def test_differences_of_colours(colours):
    """None of a colour to itself, and the same both ways but for what the formula makes of two grounds."""
    one, other = colours
    np.testing.assert_allclose(spectra.delta_e(one, one), 0.0, atol=1e-9)
    assert np.all(np.isfinite(spectra.delta_e(one, other)))
    assert np.all(spectra.delta_e(one, other) >= 0.0)


@settings(FEW, max_examples=60)
@given(st.lists(st.floats(300.0, 900.0), min_size=2, max_size=20, unique=True).map(sorted), st.data())
def test_a_spectrum_stays_between_its_samples(wavelengths, data):
    values = data.draw(st.lists(st.floats(0.0, 1e6), min_size=len(wavelengths), max_size=len(wavelengths)))
    grid = np.array(wavelengths)
    try:
        found = spectra.resample(grid, values)
    except spectra.InputError:
        assert not spectra.covers(grid)
        return
    assert spectra.covers(grid)
    assert found.min() >= min(values)
    assert found.max() <= max(values)
    np.testing.assert_allclose(np.array(values) @ spectra.resampling(grid), found, rtol=1e-9)
