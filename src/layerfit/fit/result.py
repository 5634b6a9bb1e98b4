"""A fit as a document: what `fit.json` and `--json` hold."""

from typing import Any

import numpy as np

from ..preset import left_out, rounded
from .fit import FitResult
from .uncertainty import WEAK_SIGMA, in_words

SCHEMA = "layerfit/fit"
VERSION = 1
REPORTED = 0.5
"""Correlations below this are not listed."""


def parameters(result: FitResult) -> dict[str, dict[str, Any]]:
    """Every free parameter with its value, start, sigma and state, and the derived optical depths."""
    u, free = result.vector, result.free
    slopes, sigma = free.slopes(u), result.uncertainty.sigma
    lower, upper = free.bounds()
    span = upper - lower
    values, starts = free.values(u), free.values(result.start_vector)
    rows: dict[str, dict[str, Any]] = {}
    for f in free.free:
        at = list(f.slots)
        low, high = np.any(u[at] <= lower[at] + 1e-6 * span[at]), np.any(u[at] >= upper[at] - 1e-6 * span[at])
        rows[f.name] = {
            "value": rounded(values[f.name]),
            "start": rounded(starts[f.name]),
            "sigma": _sigma(slopes[at] * sigma[at]),
            "at_bound": "lower" if low else "upper" if high else None,
            "identifiable": bool(np.all(sigma[at] < WEAK_SIGMA)),
            "unit": f.spec.unit,
        }
    for layer in result.stack.layers:
        if layer.absorption_per_mm is not None:
            rows[f"{layer.name}.tau"] = _derived_tau(result, layer)
    return rows


def _sigma(values: np.ndarray) -> Any:
    finite = [None if not np.isfinite(v) else float(f"{v:.4g}") for v in values]
    return finite[0] if len(finite) == 1 else finite


def _derived_tau(result: FitResult, layer: Any) -> dict[str, Any]:
    """tau = absorption thickness, with the sigma of whichever is fitted."""
    tau = np.broadcast_to(np.asarray(layer.optical_depth, float), 3)
    relative = np.zeros(3)
    slopes = result.free.slopes(result.vector) * result.uncertainty.sigma
    values = result.free.values(result.vector)
    for f in result.free.free:
        if f.name in (f"{layer.name}.absorption_per_mm", f"{layer.name}.thickness_um"):
            relative = np.hypot(relative, slopes[list(f.slots)] / np.maximum(np.abs(values[f.name]), 1e-12))
    return {"value": rounded(tau), "sigma": _sigma(relative * tau), "derived": "absorption_per_mm * thickness_um"}


def correlations(result: FitResult) -> list[list[Any]]:
    """Pairs of parameters that the data tell apart badly, strongest first."""
    matrix, names = result.uncertainty.correlation, result.free.names
    pairs = [
        [names[i], names[j], round(float(matrix[i, j]), 3)]
        for i in range(len(names))
        for j in range(i)
        if np.isfinite(matrix[i, j]) and abs(matrix[i, j]) >= REPORTED
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def unidentified(result: FitResult) -> list[dict[str, Any]]:
    """Directions in which the parameters move without being seen, in words."""
    scale = np.sqrt(np.maximum(np.diag(result.gram), 0.0))
    rows = []
    for direction in result.uncertainty.blind:
        parts, why = in_words(direction, result.free, np.where(scale > 0.0, scale, 1.0))
        rows.append({"direction": parts, "why": why})
    for held in result.held:
        rows.append({"direction": held.direction, "why": held.why})
    return rows


def flags(result: FitResult, rows: dict[str, dict[str, Any]], pairs: list[list[Any]]) -> list[str]:
    """What a reader should know before using the values; empty for a fit without blemish."""
    found = [] if result.converged else ["not_converged"]
    found += [f"at_bound:{name}" for name, row in rows.items() if row.get("at_bound")]
    found += [f"not_identifiable:{name}" for name, row in rows.items() if row.get("identifiable") is False]
    found += [f"correlated:{a}~{b}" for a, b, r in pairs if abs(r) > 0.95]
    if unidentified(result):
        found.append("undetermined_direction")
    return found


def to_json(
    result: FitResult,
    error: dict[str, float],
    parity: dict[str, Any] | None,
    seconds: dict[str, float],
    preset: str,
) -> dict[str, Any]:
    """The document of a fit, in the form that scripts rely on."""
    rows = parameters(result)
    pairs = correlations(result)
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "converged": result.converged,
        "flags": flags(result, rows, pairs),
        "parameters": rows,
        "correlations": pairs,
        "unidentified": unidentified(result),
        "error": error,
        "parity": parity,
        "model_error": {},
        "time": {key: round(value, 3) for key, value in seconds.items()},
        "steps": result.steps,
        "starts": len(result.minima),
        "minima": [{"start": m.start, "cost": float(f"{m.cost:.6g}")} for m in result.minima],
        "pixels": {
            "used": sum(len(s.index) for s in result.samples),
            "dropped": [view.dropped for view in result.views],
        },
        "notes": result.notes,
        "left_out": left_out(result.stack),
        "preset": preset,
    }
