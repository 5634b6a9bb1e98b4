"""`layerfit specialise`: what one scene does not need of a material is left out, as far as its image stays near."""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .capture.load import load
from .capture.scene import FitRequest, Scene
from .capture.scene_file import read_scene
from .documents import check_directory, finite, of_ours, write_files
from .errors import InputError
from .fit.fit import fit
from .fit.parameters import known_parameters, with_fixed
from .preset import left_out, preset_of, read_preset
from .report import specialise as report
from .report.told import Told
from .shader.cost import instructions, times, tools
from .shader.export import print_material
from .shader.gl import renderer
from .shader.verify import check_pairs
from .stack import Stack
from .study import fits, shaders
from .study.kept import Kept
from .study.removals import Removal, removals

SCHEMA, VERSION = "layerfit/specialise", 1
PIXELS = 4096
"""That a refit uses: it starts near its end, and errors are taken on all pixels."""
PARTS = "specialise.parts.json"

Progress = Callable[[str, float], None]


@dataclasses.dataclass(frozen=True)
class _Tried:
    """A material in the scene: its error there, and the length of its shader."""

    stack: Stack
    error: float
    instructions: int


def specialise(
    preset: str | Path | Stack,
    scene: str | Path | Scene,
    directory: str | Path = "out",
    *,
    tolerance: float = 0.005,
    name: str | None = None,
    force: bool = False,
    progress: Progress = lambda stage, share: None,
) -> dict[str, Any]:
    """Leave out what a scene does not need, part by part, and write the material that is left; returns the content of `specialise.json`.

    The part that saves most instructions is tried first: the rest is fitted to the scene's references again, from where it was. It stays out while
    the relative L2 error of the scene's pixels is at most `tolerance` above that of the whole material. What was done is kept when it is
    interrupted. A shader that differs from JAX is not written, but by `force`. Raises `LayerfitError` for input or a machine that is at fault.
    """
    stack = preset if isinstance(preset, Stack) else read_preset(Path(preset))
    name = name or ("material" if isinstance(preset, Stack) else Path(preset).stem)
    read = scene if isinstance(scene, Scene) else read_scene(scene)
    directory = Path(directory)
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"--tolerance {tolerance:g}: should be a part between 0 and 1, such as 0.5%")
    fits.check_alone(read, stack, "specialise")
    check_directory(directory)
    device = {"renderer": renderer(), "counted_by": tools()}
    views = load(read)
    for view in views:
        view.check(stack)
    task = fits.Task(views, stack, None, {}, [view.samples().target for view in views])
    kept = Kept(directory / PARTS, [preset_of(stack, name), str(read.path), tolerance, device])
    whole = _Tried(stack, task.error(stack), _length(stack))
    found, rows = _reduced(whole, task, read.fit, tolerance, kept, progress)
    progress("time", 0.95)
    ways = {"whole": stack, "specialised": found.stack}
    printed = shaders.shaders_of(ways)
    timings = kept.part("times", lambda: {key: shaders.timed(timing) for key, timing in times(printed).items()})
    parity = check_pairs(printed["specialised"])
    document = finite(
        {
            "schema": SCHEMA,
            "version": VERSION,
            "name": name,
            "scene": str(read.path),
            "tolerance": tolerance,
            "renderer": device["renderer"],
            "machine": shaders.machine(),
            "counted_by": device["counted_by"],
            "error": {"whole": whole.error, "specialised": found.error},
            "instructions": {"whole": whole.instructions, "specialised": found.instructions},
            "time": timings,
            "numbers": {key: _numbers(way) for key, way in ways.items()},
            "tried": rows,
            "left_out": left_out(found.stack),
            "parity": parity.to_json() | {"passed": parity.passed, "renderer": parity.renderer},
        }
    )
    document["in_words"] = report.sentences(document)
    record = {"scene": str(read.path), "tolerance": tolerance, "removed": [row for row in rows if row["removed"]]}
    files = {
        "material.frag": print_material(found.stack, name).text() if parity.passed or force else None,
        "preset.json": json.dumps(preset_of(found.stack, name, fit={"specialised": record}), indent=2) + "\n",
        "specialise.html": report.page(document),
        "specialise.json": json.dumps(document, indent=2, allow_nan=False) + "\n",
    }
    write_files(directory, of_ours(directory, files, "specialise.json", SCHEMA))
    kept.done()
    return Told(document, report.table(document), *document["in_words"])


def _reduced(
    whole: _Tried, task: fits.Task, request: FitRequest, tolerance: float, kept: Kept, progress: Progress
) -> tuple[_Tried, list[dict[str, Any]]]:
    """The material without all that can go, and a row for each part that was tried."""
    now, held = whole, frozenset[str]()
    rows: list[dict[str, Any]] = []
    tried: set[str] = set()
    shorter = _shorter(now)
    while candidates := [(r, n) for r, n in shorter if r.what not in tried]:
        removal, length = min(candidates, key=lambda pair: pair[1])
        tried.add(removal.what)
        progress(removal.what, 0.9 * len(tried) / (len(tried) + len(candidates)))
        without = held | set(removal.held)
        fitted = _refitted(removal, task, request, without, kept)
        error = task.error(fitted)
        goes = error - whole.error <= tolerance
        rows.append(
            {
                "what": removal.what,
                "removed": goes,
                "error": float(f"{error:.4g}"),
                "growth": float(f"{error - whole.error:.3g}"),
                "instructions_saved": now.instructions - length,
                "numbers_saved": _numbers(now.stack) - _numbers(removal.stack),
            }
        )
        if goes:
            now, held = _Tried(fitted, error, _length(fitted)), without
            shorter = _shorter(now)
    return now, rows


def _shorter(now: _Tried) -> Sequence[tuple[Removal, int]]:
    """Parts whose removal makes the shader shorter, or leaves fewer numbers to fit and to set; with the shader's length."""
    lengths = [(removal, _length(removal.stack)) for removal in removals(now.stack)]
    return [(r, length) for r, length in lengths if length < now.instructions or _numbers(r.stack) < _numbers(now.stack)]


def _numbers(stack: Stack) -> int:
    """Of which a material consists: columns of the Jacobian, if all were free."""
    return sum(np.size(leaf) for leaf in jax.tree.leaves(stack))


def _length(stack: Stack) -> int:
    return instructions(print_material(stack, "m")).total


def _refitted(removal: Removal, task: fits.Task, request: FitRequest, held: frozenset[str], kept: Kept) -> Stack:
    """The material without the part, its other parameters fitted again; as it is where none is free."""
    asked = fits.free_in(request, removal.stack)
    free = [key for key in known_parameters(removal.stack) if key in asked and key not in held and key not in request.fixed]
    if not free:
        return removal.stack

    def run() -> dict[str, Any]:
        views = [fits.thinned(view, PIXELS // len(task.views)) for view in task.views]
        found = fit(views, removal.stack, free=free, metric=request.metric, loss=request.loss, starts=1, where="specialise")
        return {key: np.asarray(value, np.float32).tolist() for key, value in found.free.values(found.vector).items()}

    return _with_values(removal.stack, kept.part(removal.what, run))


def _with_values(stack: Stack, values: Mapping[str, Any]) -> Stack:
    """The material with these of its parameters."""
    ranges = {key: (spec.lower, spec.upper) for key, (_, _, spec) in known_parameters(stack).items()}
    # Kept in float32, which may round a value at its bound across it.
    return with_fixed(stack, {key: np.clip(value, *ranges[key]).tolist() for key, value in values.items()}, "specialise")
