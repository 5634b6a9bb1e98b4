"""What a fit gives back: as a record, and as the document that `fit.json` and `--json` hold."""

import dataclasses
import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._compiled import Clock
from ..capture.load import AnyView
from ..capture.samples import Samples
from ..capture.scene import Lit
from ..preset import left_out, rounded
from ..stack import Stack
from . import words
from .discrepancy import Discrepancy
from .parameters import Free, Parametrisation
from .profile import ABSORBING, Profile
from .starts import SIGHT, Minimum
from .uncertainty import WEAK_SIGMA, Uncertainty, in_words

SCHEMA = "layerfit/fit"
VERSION = 1
REPORTED = 0.5
"""Correlations below this are not listed."""

POOR = 0.1
"""Misfit that makes a fit poor: twice what the weights expect of a closed form (`weights.MODEL_SHARE`), as a mean over the image."""

NEAR_BOUND = 1e-6
"""Part of its range within which a value stands at the end of it."""


@dataclasses.dataclass(frozen=True)
class Row:
    """One step of the fit, for the convergence trace."""

    time_s: float
    stage: str
    start: int
    step: int
    error: float
    """Weighted residual over the weighted image, root of sums of squares, of the pixels in use."""


@dataclasses.dataclass(frozen=True)
class Held:
    """A free parameter that was held at its start, because the data cannot tell it from another."""

    direction: dict[str, float]
    why: str


@dataclasses.dataclass(repr=False)
class Fitted:
    """A fitted material and what is known of it, without the images."""

    stack: Stack
    """The material; where references have something for themselves, that of the first."""
    free: Parametrisation
    vector: np.ndarray
    start_vector: np.ndarray
    gram: np.ndarray
    """J^T J at the solution, in the coordinates of the fit."""
    uncertainty: Uncertainty
    """By noise and misfit of the images."""
    discrepancy: Discrepancy | None
    """By what the form of the model gets wrong; None where it was not measured."""
    held: list[Held]
    converged: bool
    cost: float
    steps: int
    minima: list[Minimum]
    notes: list[str]
    misfit: float
    """Weighted residual over the weighted image, without the noise that the files state."""
    profiles: list[Profile]
    """Of the parameters that were asked for, and of depths that are but lower limits."""
    hidden: list[str]
    """Parameters of what lies below a coat that may be opaque: whatever they are, the images can be the same."""

    def __repr__(self) -> str:
        return "\n".join([_heading(self), *words.parameters(parameters(self))])

    def _repr_html_(self) -> str:
        """For notebooks."""
        remarks = words.remarks(correlations(self), [row["why"] for row in unidentified(self)], self.notes, minima(self))
        return f"<p>{html.escape(_heading(self))}</p>{words.table(parameters(self))}{words.blocks(remarks)}"


@dataclasses.dataclass(repr=False)
class FitResult(Fitted):
    """A fitted material, what is known of it, and what it was fitted to."""

    materials: list[Stack]
    """As it is in each reference, as thick as it is there."""
    lights: list[Lit]
    """How bright the lights of each reference are, over what the scene says; of ambient light the radiance. Empty where they are known."""
    start: Stack
    trace: list[Row]
    models: list[np.ndarray]
    """Radiance of the fitted material at the usable pixels of each reference."""
    samples: list[Samples]
    views: Sequence[AnyView]
    clock: Clock
    solve_s: float


def _heading(result: Fitted) -> str:
    found = flags(result, parameters(result), correlations(result))
    outcome = words.converged(result.converged, result.steps)
    return f"{words.structure(result.stack)}; converged: {outcome}; flags: {', '.join(found) or 'none'}"


def parameters(result: Fitted) -> dict[str, dict[str, Any]]:
    """Every free parameter with its value, start, sigma and state, and the derived optical depths.

    Where the form's error was measured, `sigma` holds `sigma_noise` and `sigma_model`, and `corrected` is the value without that error.
    """
    u, free = result.vector, result.free
    slopes, sigma = free.slopes(u), _sigmas(result)
    low, high = _at_bounds(result)
    known = result.discrepancy is not None
    corrected = free.values(_corrected(result)) if known else {}
    values, starts = free.values(u), free.values(result.start_vector)
    rows: dict[str, dict[str, Any]] = {}
    for f in free.free:
        at = list(f.slots)
        rows[f.name] = {
            "value": rounded(values[f.name]),
            "start": rounded(starts[f.name]),
            "sigma": _sigma(slopes[at] * sigma[at]),
            "at_bound": "lower" if np.any(low[at]) else "upper" if np.any(high[at]) else None,
            "identifiable": f.name not in result.hidden and not np.any(result.uncertainty.sigma[at] >= WEAK_SIGMA),
            "unit": f.spec.unit,
        }
        if known:
            rows[f.name] |= {key: _sigma(slopes[at] * part[at]) for key, part in _sigma_parts(result).items()}
            rows[f.name]["corrected"] = rounded(corrected[f.name])
        ends = [_interval(result, f, slot) for slot in f.slots]
        if any(ends):
            rows[f.name]["interval_95"] = ends[0] if len(ends) == 1 else ends
            rows[f.name]["lower_limit"] = f.field in ABSORBING and any(_is_lower_limit(end) for end in ends)
    for layer in result.stack.layers:
        if getattr(layer, "absorption_per_mm", None) is not None:
            rows[f"{layer.name}.tau"] = _derived_tau(result, layer)
    return rows


def _interval(result: Fitted, f: Free, slot: int) -> list[float | None] | None:
    """Ends of the 95 % interval of one entry, in the units of the field: None for an end that there is none of, or without a profile."""
    profile = next((p for p in result.profiles if p.slot == slot), None)
    if profile is None:
        return None
    return [None if end is None else float(f"{float(f.from_steps(end, np)):.4g}") for end in profile.interval]


def _is_lower_limit(ends: list[float | None] | None) -> bool:
    return ends is not None and ends[1] is None and bool(ends[0])


def _at_bounds(result: Fitted) -> tuple[np.ndarray, np.ndarray]:
    """Which entries of the vector stand at the lower and at the upper end of their range."""
    lower, upper = result.free.bounds()
    near = NEAR_BOUND * (upper - lower)
    return result.vector <= lower + near, result.vector >= upper - near


def _sigmas(result: Fitted) -> np.ndarray:
    """Sigmas in the coordinates of the fit; at a bound, how far inside the truth may be. NaN for what is but a limit, and what that hides."""
    sigma = np.sqrt(sum(part**2 for part in _sigma_parts(result).values()))
    for f in result.free.free:
        for slot in f.slots:
            if f.name in result.hidden or (f.field in ABSORBING and _is_lower_limit(_interval(result, f, slot))):
                sigma[slot] = np.nan
    return sigma


def _sigma_parts(result: Fitted) -> dict[str, np.ndarray]:
    """By what the images are scattered by, and by what the form gets wrong: the whole of it, as no one value is owed the correction."""
    parts = {"sigma_noise": result.uncertainty.sigma}
    if result.discrepancy is not None:
        parts["sigma_model"] = np.hypot(result.discrepancy.step, result.discrepancy.error)
    return parts


def _corrected(result: Fitted) -> np.ndarray:
    """The vector that an exact form would have been fitted with, inside the bounds."""
    step = np.zeros_like(result.vector) if result.discrepancy is None else result.discrepancy.step
    if np.any(_at_bounds(result)):
        step = step + result.uncertainty.outside
    return np.clip(result.vector + step, *result.free.bounds())


def _sigma(values: np.ndarray) -> Any:
    finite = [None if not np.isfinite(v) else float(f"{v:.4g}") for v in values]
    return finite[0] if len(finite) == 1 else finite


def _derived_tau(result: Fitted, layer: Any) -> dict[str, Any]:
    """tau = absorption thickness, with the sigma of whichever is fitted."""
    tau = np.broadcast_to(np.asarray(layer.optical_depth, float), 3)
    sigma = np.zeros(3)
    slopes = result.free.slopes(result.vector) * _sigmas(result)
    other = {"absorption_per_mm": layer.thickness_um, "thickness_um": layer.absorption_per_mm}
    for f in result.free.free:
        if f.name.startswith(f"{layer.name}.") and f.field in other:
            sigma = np.hypot(sigma, 1e-3 * slopes[list(f.slots)] * np.asarray(other[f.field], float))
    return {"value": rounded(tau), "sigma": _sigma(sigma), "derived": "absorption_per_mm * thickness_um"}


def correlations(result: Fitted) -> list[list[Any]]:
    """Pairs of parameters that the data tell apart badly, strongest first."""
    matrix, names = result.uncertainty.correlation, result.free.names
    pairs = [
        [names[i], names[j], round(float(matrix[i, j]), 3)]
        for i in range(len(names))
        for j in range(i)
        if np.isfinite(matrix[i, j]) and abs(matrix[i, j]) >= REPORTED
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def unidentified(result: Fitted) -> list[dict[str, Any]]:
    """Directions in which the parameters move without being seen, in words."""
    scale = np.sqrt(np.maximum(np.diag(result.gram), 0.0))
    rows = []
    for direction in result.uncertainty.blind:
        parts, why = in_words(direction, result.free, np.where(scale > 0.0, scale, 1.0))
        rows.append({"direction": parts, "why": why})
    for held in result.held:
        rows.append({"direction": held.direction, "why": held.why})
    return rows


def minima(result: Fitted) -> list[dict[str, Any]]:
    """Where the starts led, best first: which of them, the cost over that of the best with the same weights, and the values there."""
    values = [result.vector, *(m.vector for m in result.minima[1:])]
    return [
        {
            "starts": sorted(m.starts),
            "cost_over_best": float(f"{m.over:.4g}"),
            "followed": m.ended,
            "values": {name: rounded(value) for name, value in result.free.values(u).items()},
        }
        for m, u in zip(result.minima, values, strict=True)
    ]


def profiles(result: Fitted) -> list[dict[str, Any]]:
    """The cost along parameters, over the rise that ends their 95 % interval."""
    fields = {slot: f for f in result.free.free for slot in f.slots}
    return [
        {
            "parameter": result.free.names[p.slot],
            "values": rounded(fields[p.slot].from_steps(p.at, np)),
            "rise": [float(f"{rise:.4g}") for rise in p.rise],
        }
        for p in result.profiles
    ]


def flags(result: Fitted, rows: dict[str, dict[str, Any]], pairs: list[list[Any]]) -> list[str]:
    """What a reader should know before using the values; empty for a fit without blemish."""
    found = [] if result.converged else ["not_converged"]
    found += ["poor_fit"] if result.misfit > POOR else []
    found += [f"at_bound:{name}" for name, row in rows.items() if row.get("at_bound")]
    found += [f"lower_limit:{name}" for name, row in rows.items() if row.get("lower_limit")]
    found += [f"not_identifiable:{name}" for name, row in rows.items() if row.get("identifiable") is False]
    found += [f"correlated:{a}~{b}" for a, b, r in pairs if abs(r) > 0.95]
    if unidentified(result):
        found.append("undetermined_direction")
    if any(m.over <= SIGHT for m in result.minima[1:] if m.ended):
        found.append("other_minimum")
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
        "sigma_is": words.SIGMA if result.discrepancy is None else words.WHOLE_SIGMA,
        "correlations": pairs,
        "unidentified": unidentified(result),
        "error": error,
        "misfit": float(f"{result.misfit:.4g}"),
        "parity": parity,
        "model_error": {},
        "time": {key: round(value, 3) for key, value in seconds.items()},
        "steps": result.steps,
        "starts": sum(len(m.starts) for m in result.minima),
        "minima": minima(result),
        "profiles": profiles(result),
        "pixels": {
            "used": sum(len(s.index) for s in result.samples),
            "dropped": [view.dropped for view in result.views],
        },
        "notes": result.notes,
        "left_out": left_out(result.stack),
        "preset": preset,
    }
