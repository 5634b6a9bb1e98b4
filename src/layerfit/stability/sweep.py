"""`layerfit stability`: every structure on its grid, in float32, in float64 and as its printed shader."""

import dataclasses
import functools
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .._compiled import sources
from ..documents import check_directory, finite, write_bytes, write_text
from ..errors import InputError
from ..forms.precise import Precise
from ..report import stability as report
from ..report.told import Told
from ..shader.gl import renderer
from ..stack import Stack
from ..study.kept import Kept
from . import limits, shader
from .digits import numbers
from .effort import USUAL, Effort
from .exact import in_exact, judged
from .grid import POLAR_DEG, Grid, directions, grid
from .measure import Values, by_last_bits, plain_values, slope_error, value_error, values_of
from .models import structures
from .tier import TIERS, try_tier

WORST = 10
PARTS = "stability.parts.json"
"""What is done of a sweep, until all of it is."""

Progress = Callable[[str, float], None]


def sweep(
    word: str = "",
    *,
    effort: Effort = USUAL,
    parts: Path | None = None,
    progress: Progress = lambda stage, share: None,
) -> dict[str, Any]:
    """The content of `stability.json`, for all structures whose names hold `word`. The same numbers for the same seed.

    What is done is kept in the file `parts`, and an interrupted sweep goes on from there, if source and effort are the same. Raises
    `InputError` where no structure has such a name, and `MachineError` where shaders are asked for and there is no OpenGL, or digits and
    no mpmath.
    """
    chosen = {name: stack for name, stack in structures().items() if word in name}
    if not chosen:
        raise InputError(
            f"no structure has {word!r} in its name; without a name all are tried, from {next(iter(structures()))!r} on"
        )
    if effort.digits:
        numbers()
    if effort.shaders:
        renderer()
    kept = Kept(parts, [word, dataclasses.asdict(effort), sources().hex()]) if parts else None
    found = []
    for k, (name, stack) in enumerate(chosen.items()):
        progress(name, k / len(chosen))
        make = functools.partial(try_structure, name, stack, effort)
        found.append(kept.part(name, make) if kept else make())
        jax.clear_caches()  # of each structure some 100 MB
    if kept:
        kept.done()
    return finite(_document(found, effort))


def _document(found: list[dict[str, Any]], effort: Effort) -> dict[str, Any]:
    worst = sorted((case for entry in found for case in entry["worst"]), key=_over, reverse=True)[:WORST]
    return {
        "schema": "layerfit/stability",
        "version": 3,
        **dataclasses.asdict(effort),
        "polar_deg": list(POLAR_DEG),
        "combinations": sum(entry["combinations"] for entry in found),
        "not_finite": sum(entry["not_finite"] for entry in found),
        "structures": found,
        "worst": worst,
        "good": all(entry["good"] for entry in found),
    }


def _over(case: Mapping[str, Any]) -> float:
    """Its error; what is kept without one is not finite."""
    return math.inf if case["over"] is None else case["over"]


def try_structure(name: str, stack: Stack, effort: Effort = USUAL) -> dict[str, Any]:
    """One structure: how many digits float32 has of values and derivatives, what is not finite, and what physics says and does not hold."""
    tried = grid(stack, effort.corners, effort.seed)
    wi, wo, polar = (a.astype(np.float32) for a in directions())
    single, double = (values_of(tried.stack(stack, dtype), wi, wo, dtype) for dtype in (np.float32, np.float64))
    value, slope = value_error(single.f, double.f), slope_error(single, double, tried)
    breaks = limits.breaks(tried, plain_values(tried.stack(stack, np.float64, rounded=False), wi, wo))
    rows = [tried.default, 0][: effort.tiers]
    tiers = {tier: try_tier(tier, stack, tried, rows, (wi, wo), effort.shaders) if rows else None for tier in TIERS}
    made = [found for found in tiers.values() if found]
    lost = sum(np.sum(~np.isfinite(part)) for part in (single.f, single.slopes, double.f, double.slopes, *single.gradients))
    entry = {
        "name": name,
        "parameters": [f.name for f in tried.free],
        "materials": len(tried.values),
        "combinations": int(value.size) + sum(found["combinations"] for found in made),
        "not_finite": int(lost) + sum(found["not_finite"] for found in made),
        "beyond": beyond(single.f, double.f, by_last_bits(double, tried)),
        "value_rel": _quantiles(value),
        "slope_rel": _quantiles(slope),
        "breaks": breaks,
        "shader": shader.printed(stack, tried, effort.seed) if effort.shaders else None,
        **tiers,
        "digits": _digits(stack, tried, (single, double), (value, slope.max(0)), effort) if effort.digits else None,
        "heat": {key: _heat(value[rows], polar) for key, rows in tried.lines.items()},
        "lines": {f.name: tried.values[tried.lines[f.name], k].tolist() for k, f in enumerate(tried.free)},
        "worst": [*_worst(name, tried, value, single, double, (wi, wo))],
    }
    return entry | {"good": report.good(entry)}


def beyond(single: np.ndarray, double: np.ndarray, moved: np.ndarray) -> int:
    """Combinations (m, d) of which float32 is off by more than the tolerance, relative and absolute, and than the inputs' last bits move it."""
    off = np.abs(single - double)
    far = ~((off <= report.MAX_REL * np.abs(double)) | (off <= report.MAX_ABS) | (off <= moved))
    return int(np.sum(far if far.ndim == 2 else far.any(-1)))


def _digits(
    stack: Stack,
    tried: Grid,
    values: tuple[Values, Values],
    errors: tuple[np.ndarray, np.ndarray],
    effort: Effort,
) -> dict[str, Any]:
    """The materials with the largest errors of a value and of a slope, the defaults, and others: in 50 digits."""
    pairs = [w.astype(np.float32) for w in directions()[:2]]
    drawn = np.random.default_rng((effort.seed, 2)).integers(0, len(tried.values), effort.digits).tolist()
    rows = list(dict.fromkeys([*(int(np.argmax(error.max(1))) for error in errors), tried.default, *drawn]))
    rows = rows[: 1 if isinstance(stack.form, Precise) else effort.digits]  # a precise one takes a minute
    worst = np.stack([np.argmax(error, 1) for error in errors])
    cases = in_exact(stack, tried, (pairs[0], pairs[1]), rows, worst, values[1], effort.seed)
    limits_of = (
        (report.MAX_REL, report.MAX_ABS, report.SLOPE_REL),
        (report.MAX_REL_DOUBLE, report.MAX_ABS_DOUBLE, report.SLOPE_REL_DOUBLE),
    )
    moved = by_last_bits(values[1], tried)
    allowed = moved, np.zeros_like(moved)  # float64 is tried at numbers of float32
    found = zip(values, limits_of, allowed, strict=True)
    single, double = (judged(cases, v, tried, limit, of_inputs, pairs) for v, limit, of_inputs in found)
    slopes = sum(case.slopes.size for case in cases)
    return {
        "cases": len(cases),
        "slopes": slopes,
        "without_slope": int(sum(np.isnan(case.slopes).sum() for case in cases)),
        "float32": single,
        "float64": double,
    }


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
    document = sweep(word, parts=directory / PARTS, **options)
    write_stability(document, directory)
    return Told(document, report.table(document))
