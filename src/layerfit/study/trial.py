"""One trial of a study: a material is drawn, with noise, and looked for again."""

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.measured.sphere import bare_sphere
from ..capture.samples import View
from ..capture.scene import LOSSES, METRICS
from ..documents import nearest
from ..errors import InputError
from ..fit.fit import fit
from ..fit.parameters import Parametrisation, known_parameters, parametrise, with_fixed
from ..fit.result import FitResult
from ..fit.starts import space_filling
from ..preset import MODELS
from ..render import predict
from ..stack import Stack
from .fits import thinned


@dataclasses.dataclass(frozen=True)
class Setting:
    """How the reference is taken and the fit is made: all that a study can vary beside the material."""

    noise: float = 0.01
    """Of a pixel, relative, one standard deviation."""
    side: int = 64
    """Pixels across the sphere's picture."""
    pixels: int = 0
    """Pixels of each picture that are fitted, stratified by half angle; 0 for all."""
    lights: int = 1
    """Pictures, each under a light of its own, evenly around the camera."""
    light_deg: float = 45.0
    """Angle between light and camera."""
    starts: int = 4
    metric: str = "law"
    loss: str = "square"
    model: str = ""
    """The form that is fitted; empty for that of the material."""


REFERENCE = ("noise", "side", "pixels", "lights", "light_deg")
FIT = ("starts", "metric", "loss", "model")
RANGES = {
    "noise": (0.0, 10.0),
    "side": (8, 4096),
    "pixels": (0, 10**7),
    "lights": (1, 64),
    "light_deg": (0.0, 120.0),
    "starts": (1, 1000),
}
WORDS = {"metric": METRICS, "loss": LOSSES, "model": ("", *MODELS)}


def names_of(stack: Stack) -> list[str]:
    """Everything that a study of a material can vary."""
    return [*known_parameters(stack), *(f"reference.{key}" for key in REFERENCE), *(f"fit.{key}" for key in FIT)]


def at_point(stack: Stack, setting: Setting, point: Mapping[str, Any], where: str) -> tuple[Stack, Setting]:
    """The material and the setting of a point. Raises `InputError` for a name that there is not, or a value out of its range."""
    known = names_of(stack)
    if unknown := [name for name in point if name not in known]:
        raise InputError(f"{where}: unknown {unknown[0]!r}{nearest(unknown[0], known)}. There are {', '.join(known)}")
    parts = {name: name.partition(".") for name in point}
    changed = {
        key: point[name]
        for name, (group, _, key) in parts.items()
        if group in ("reference", "fit") and key in (*REFERENCE, *FIT)
    }
    for key, value in changed.items():
        _check(key, value, f"{where}: {key}")
    material = {
        name: value for name, value in point.items() if parts[name][2] not in changed or name in known_parameters(stack)
    }
    return with_fixed(stack, material, where), dataclasses.replace(setting, **changed)


def _check(key: str, value: Any, where: str) -> None:
    if key in WORDS:
        if value not in WORDS[key]:
            raise InputError(f"{where} = {value!r}: should be one of {', '.join(WORDS[key])}{nearest(str(value), WORDS[key])}")
        return
    low, high = RANGES[key]
    whole = isinstance(low, int)
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float) or not low <= value <= high:
        raise InputError(f"{where} = {value!r}: should be a {'whole ' if whole else ''}number from {low} to {high}")


def pictures(stack: Stack, setting: Setting, seed: int) -> list[View]:
    """The material as a camera sees it: a sphere under each light, with noise."""
    angle, rng, views = np.radians(setting.light_deg), np.random.default_rng(seed), []
    for turn in 2.0 * np.pi * np.arange(setting.lights) / setting.lights:
        to_light = (np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle))
        view = bare_sphere(Path("sphere"), setting.side, to_light=to_light)
        view.check(stack)
        view = thinned(view, setting.pixels) if setting.pixels else view
        light = predict(stack, *view.samples().arrays)
        views.append(dataclasses.replace(view, target=light * (1.0 + setting.noise * rng.normal(size=light.shape))))
    return views


def refound(stack: Stack, setting: Setting, free: Sequence[str] | None, seed: int) -> dict[str, Any]:
    """Draw a material and fit it again, from the middle of the ranges of its `free` parameters: numbers by name, and rows of numbers, one for each
    fitted entry (three of a colour), under "rows"."""
    where = "study"
    views = pictures(stack, setting, seed)
    wide, named = parametrise(stack, free, (), where)
    middle = named.put(wide, named.fields(space_filling(named, 1, seed)[0]), np)
    if setting.model:
        middle = dataclasses.replace(middle, form=MODELS[setting.model]())
    began = time.perf_counter()
    found = fit(
        views,
        middle,
        free=[f.name for f in named.free],
        metric=setting.metric,
        loss=setting.loss,
        starts=setting.starts,
        seed=seed,
        where=where,
    )
    seconds = time.perf_counter() - began
    return {
        "seconds": round(seconds, 4),
        "misfit": found.misfit,
        "converged": found.converged,
        "steps": found.steps,
        "correlation": _strongest(found),
        "rows": _rows(found, wide, named),
    }


def _rows(found: FitResult, truth: Stack, named: Parametrisation) -> dict[str, dict[str, float]]:
    """Value, sigma and truth of every entry, and how far off it is, relative; sigma infinite where the pictures do not tell it."""
    values = _flat(found.free.values(found.vector))
    sigmas = found.uncertainty.sigma * found.free.slopes(found.vector)
    told = dict(zip(found.free.names, zip(values, sigmas, strict=True), strict=True))
    rows = {}
    for name, true in zip(named.names, _flat(named.values(named.pack(truth))), strict=True):
        value, sigma = told.get(name, (np.nan, np.inf))
        rows[name] = {
            "value": float(value),
            "sigma": float(min(sigma, 1e30)),
            "truth": float(true),
            "error": float(abs(value - true) / max(abs(true), 1e-6)),
        }
    return rows


def _flat(values: Mapping[str, Any]) -> np.ndarray:
    return np.concatenate([np.atleast_1d(v) for v in values.values()])


def _strongest(found: FitResult) -> float:
    """The largest correlation between two entries, its size."""
    correlation = np.abs(np.nan_to_num(found.uncertainty.correlation, posinf=0.0, neginf=0.0))
    np.fill_diagonal(correlation, 0.0)
    return float(correlation.max(initial=0.0))
