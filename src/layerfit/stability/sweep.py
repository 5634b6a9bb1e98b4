"""`layerfit stability`: every structure on its grid, in float32, in float64 and as its printed shader."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import check_directory, finite, write_bytes, write_text
from ..errors import InputError
from ..report import stability as report
from ..report.told import Told
from ..stack import Stack
from . import limits, shader
from .grid import POLAR_DEG, Grid, directions, grid
from .measure import Values, slope_error, value_error, values_of
from .models import structures

CORNERS = 128
"""Corners of the ranges of one structure, of as many as there are."""
WORST = 10

Progress = Callable[[str, float], None]


def sweep(
    word: str = "",
    *,
    corners: int = CORNERS,
    shaders: bool = True,
    seed: int = 0,
    progress: Progress = lambda stage, share: None,
) -> dict[str, Any]:
    """The content of `stability.json`, for all structures whose names hold `word`. The same numbers for the same seed.

    Raises `InputError` where no structure has such a name, and `MachineError` where shaders are asked for and there is no OpenGL.
    """
    chosen = {name: stack for name, stack in structures().items() if word in name}
    if not chosen:
        raise InputError(
            f"no structure has {word!r} in its name; without a name all are tried, from {next(iter(structures()))!r} on"
        )
    found = []
    for k, (name, stack) in enumerate(chosen.items()):
        progress(name, k / len(chosen))
        found.append(try_structure(name, stack, corners=corners, shaders=shaders, seed=seed))
    worst = sorted((case for entry in found for case in entry["worst"]), key=lambda case: -case["over"])[:WORST]
    return finite(
        {
            "schema": "layerfit/stability",
            "version": 1,
            "seed": seed,
            "polar_deg": list(POLAR_DEG),
            "combinations": sum(entry["combinations"] for entry in found),
            "not_finite": sum(entry["not_finite"] for entry in found),
            "structures": found,
            "worst": worst,
            "good": all(entry["good"] for entry in found),
        }
    )


def try_structure(name: str, stack: Stack, *, corners: int = CORNERS, shaders: bool = True, seed: int = 0) -> dict[str, Any]:
    """One structure: how many digits float32 has of values and derivatives, what is not finite, and what physics says and does not hold."""
    tried = grid(stack, corners, seed)
    wi, wo, polar = (a.astype(np.float32) for a in directions())
    single, double = (values_of(tried.stack(stack, dtype), wi, wo, dtype) for dtype in (np.float32, np.float64))
    value, slope = value_error(single, double), slope_error(single, double, tried)
    parts = (single.f, single.slopes, double.f, double.slopes, *single.gradients)
    breaks = limits.breaks(tried, double)
    printed = shader.printed(name, stack, tried, seed) if shaders else None
    entry = {
        "name": name,
        "parameters": [f.name for f in tried.free],
        "materials": len(tried.values),
        "combinations": int(value.size),
        "not_finite": int(sum(np.sum(~np.isfinite(part)) for part in parts)),
        "value_rel": _quantiles(value),
        "slope_rel": _quantiles(slope),
        "breaks": breaks,
        "shader": printed,
        "heat": {key: _heat(value[rows], polar) for key, rows in tried.lines.items()},
        "lines": {f.name: tried.values[tried.lines[f.name], k].tolist() for k, f in enumerate(tried.free)},
        "worst": [*_worst(name, tried, value, single, double, (wi, wo))],
    }
    held = entry["not_finite"] == 0 and not breaks and (printed is None or printed["not_finite"] == 0)
    return entry | {"good": bool(held and entry["value_rel"]["max"] <= report.MAX_REL)}


def _quantiles(error: np.ndarray) -> dict[str, float]:
    return {
        "p50": float(np.median(error)),
        "p999": float(np.quantile(error, 0.999, method="higher")),
        "max": float(error.max()),
    }


def _heat(error: np.ndarray, polar: np.ndarray) -> list[list[float]]:
    """Largest error by value of the parameter and angle of the light."""
    return [[float(row[polar == k].max()) for k in range(len(POLAR_DEG))] for row in error]


def _worst(
    name: str, tried: Grid, error: np.ndarray, single: Values, double: Values, pairs: tuple[Any, Any]
) -> list[dict[str, Any]]:
    """The largest errors of a structure, one a material, with what reproduces them."""
    rows = np.argsort(-error.max(1))[:WORST]
    found = []
    for row in rows:
        pair = int(np.argmax(error[row]))
        found.append(
            {
                "structure": name,
                "over": float(error[row, pair]),
                "parameters": tried.inputs(int(row)),
                **{key: [float(x) for x in w[pair]] for key, w in zip(("wi", "wo"), pairs, strict=True)},
                "float32": np.asarray(single.f[row, pair], float).tolist(),
                "float64": double.f[row, pair].tolist(),
            }
        )
    return found


def write_stability(document: Mapping[str, Any], directory: Path) -> None:
    """Leave `stability.json`, `stability.md` and a heat map for each structure in a directory, each whole or not at all."""
    for entry in document["structures"]:
        write_bytes(
            directory / "heat" / f"{report.file_name(entry['name'])}.png", report.heat_map(entry, document["polar_deg"])
        )
    write_text(directory / "stability.md", report.markdown(document))
    write_text(directory / "stability.json", json.dumps(document, indent=1, allow_nan=False) + "\n")


def stability_of(directory: Path, word: str = "", **options: Any) -> Told:
    """Sweep, and write the results; a directory that cannot be written to is told before the work."""
    check_directory(directory)
    document = sweep(word, **options)
    write_stability(document, directory)
    return Told(document, report.table(document))
