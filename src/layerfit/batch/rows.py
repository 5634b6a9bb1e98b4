"""One fit of a batch, as a row of its table."""

import time
from typing import Any

from ..capture.load import load
from ..capture.scene_file import read_scene
from ..errors import LayerfitError
from ..fit.result import correlations, flags, parameters
from ..fit.words import structure
from ..job import asked, fit_scene, fit_views
from .tasks import Task

CHANNELS = ("r", "g", "b")

Row = dict[str, Any]


def run(task: Task) -> Row:
    """Fit one scene; its row, or one with the message of what was at fault."""
    began = time.perf_counter()
    try:
        row = _values(task)
    except LayerfitError as error:
        return failed(task, str(error))
    except Exception as error:  # told in its row, and not the end of the others
        return failed(task, f"{type(error).__name__}: {error} (a fault of layerfit, not of the scene: please report it)")
    return {"scene": str(task.scene), "error": None, "seconds": round(time.perf_counter() - began, 4), **row}


def failed(task: Task, message: str) -> Row:
    return {"scene": str(task.scene), "error": message, "seconds": None}


def _values(task: Task) -> Row:
    options = dict(task.options)
    quick = options.pop("quick", False)
    if quick:
        options.setdefault("starts", 1)
    if task.directory is not None:
        document = fit_scene(task.scene, task.directory, model_error=not quick, **options).document
        return {**_outcome(document), "directory": str(task.directory), **_columns(document["parameters"])}
    scene = asked(read_scene(task.scene), options)
    result = fit_views(load(scene), scene, model_error=not quick)
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
