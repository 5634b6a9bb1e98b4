"""One fit of a batch, as a row of its table."""

import dataclasses
import time
from typing import Any

from ..capture.load import AnyView, load
from ..capture.scene import Scene
from ..capture.scene_file import read_scene
from ..errors import LayerfitError
from ..fit.result import Fitted, correlations, flags, parameters
from ..fit.words import structure
from ..job import asked, fit_scene, fit_views
from .tasks import Task

CHANNELS = ("r", "g", "b")

Row = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Opened:
    """A scene with its references read."""

    scene: Scene
    views: list[AnyView]


def opened(task: Task) -> Opened:
    """Raises `InputError` for a scene that cannot be read."""
    scene = asked(read_scene(task.scene), task.overrides)
    return Opened(scene, load(scene))


def run(task: Task, found: Opened | None = None) -> Row:
    """Fit one scene, which may have been opened before; its row, or one with the message of what was at fault."""
    began = time.perf_counter()
    try:
        return done(task, _values(task, found), time.perf_counter() - began)
    except Exception as error:  # told in its row, and not the end of the others
        return failed(task, message(error))


def message(error: Exception) -> str:
    """What a row says of what was at fault."""
    if isinstance(error, LayerfitError):
        return str(error)
    return f"{type(error).__name__}: {error} (a fault of layerfit, not of the scene: please report it)"


def done(task: Task, values: Row, seconds: float) -> Row:
    return {"scene": str(task.scene), "error": None, "seconds": round(seconds, 4), **values}


def failed(task: Task, message: str) -> Row:
    return {"scene": str(task.scene), "error": message, "seconds": None}


def _values(task: Task, found: Opened | None) -> Row:
    model_error = not task.quick
    if task.directory is not None:
        document = fit_scene(task.scene, task.directory, model_error=model_error, **task.overrides).document
        return {**_outcome(document), "directory": str(task.directory), **_columns(document["parameters"])}
    found = found or opened(task)
    return values_of(fit_views(found.views, found.scene, model_error=model_error))


def values_of(result: Fitted) -> Row:
    """What a row holds of a fit."""
    rows = parameters(result)
    outcome = {
        "converged": result.converged,
        "flags": flags(result, rows, correlations(result)),
        "misfit": result.misfit,
        "steps": result.steps,
    }
    return {"structure": structure(result.stack), **_outcome(outcome), **_columns(rows)}


def _outcome(document: dict[str, Any]) -> Row:
    return {key: document[key] for key in ("converged", "misfit", "steps")} | {"flags": " ".join(document["flags"])}


def _columns(rows: dict[str, dict[str, Any]]) -> Row:
    """Values and sigmas, a column each number: `coat.tau.r`, `coat.tau.r.sigma`."""
    columns: Row = {}
    for name, row in rows.items():
        for key in ("value", "sigma", "corrected"):
            value = row.get(key)
            spread = isinstance(value, list | tuple) or isinstance(row["value"], list | tuple)
            numbers = value if isinstance(value, list | tuple) else [value] * (len(row["value"]) if spread else 1)
            names = [f"{name}.{c}" for c in CHANNELS] if spread else [name]
            if key in row:
                columns |= {n if key == "value" else f"{n}.{key}": v for n, v in zip(names, numbers, strict=True)}
    return columns
