"""Advice in words, as a document, and as a map of the directions from which a further light would help."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..capture.geometry import normalise
from ..capture.scene import Camera
from ..fit import words
from ..fit.advise import Advice, Candidate
from ..preset import rounded
from .pictures import Panel, false_colour, strip

SCHEMA = "layerfit/advice"
VERSION = 1
SIDE = 256
"""Pixels across the map."""

SHOWN = 12
"""Further images that the terminal lists."""


def document(advice: Advice) -> dict[str, Any]:
    """What `layerfit advise --json` prints."""
    free, determined = advice.free, advice.determined
    values, spread = free.values(advice.vector), advice.sigma * free.slopes(advice.vector)
    rows = {}
    for f in free.free:
        sigma = [float(f"{s:.2g}") for s in spread[list(f.slots)]]
        rows[f.name] = {
            "value": rounded(values[f.name]),
            "sigma": sigma[0] if len(sigma) == 1 else sigma,
            "unit": f.spec.unit,
            "identifiable": determined[f.name],
        }
    candidates = [
        {
            "kind": c.image.kind,
            "what": c.image.what,
            "direction": c.image.direction,
            "gain": float(f"{c.gain:.4g}"),
            "worst_sigma": float(f"{c.worst:.3g}"),
        }
        for c in advice.candidates
    ]
    return {"schema": SCHEMA, "version": VERSION, "parameters": rows, "candidates": candidates, "in_words": sentences(advice)}


def sentences(advice: Advice) -> list[str]:
    """What the capture tells, and the best further image of each kind."""
    known = [name for name, yes in advice.determined.items() if yes]
    unknown = [name for name, yes in advice.determined.items() if not yes]
    told = f"These images determine {', '.join(known)}." if known else "These images determine nothing of what is free."
    told += f" They do not determine {', '.join(unknown)}." if unknown else ""
    best: dict[str, Candidate] = {}
    for candidate in advice.candidates:
        best.setdefault(candidate.image.kind, candidate)
    kinds = [f"Best {kind}: {c.image.what}; errors {c.gain:.3g} times smaller." for kind, c in best.items()]
    steady = min(advice.candidates, key=lambda c: c.worst)
    taken = [f"Taken as the scene says, though a fit would find it: {', '.join(advice.as_told)}."] if advice.as_told else []
    taken += [f"Taken as the same in all references: {', '.join(advice.shared)}."] if advice.shared else []
    return [told, *kinds, f"Best for what is known least, {advice.least_known}: {steady.image.what}.", *taken]


def lines(found: Mapping[str, Any]) -> list[str]:
    """The document as text: parameters, then further images, best first."""
    out = ["[[Determined]] (predicted sigmas, of noise that the file states and of what a form gets wrong)"]
    out += words.parameters(found["parameters"])
    out += ["[[Further images]] (how many times smaller errors would be; sigma of what would then be known least)"]
    out += [f"    {c['gain']:<6.3g} {c['worst_sigma']:<8.2g} {c['what']}" for c in found["candidates"][:SHOWN]]
    return [*out, "[[In words]]", *(f"    {sentence}" for sentence in found["in_words"])]


def light_map(candidates: Sequence[Candidate]) -> bytes:
    """All directions of a further light around the object as a disc, PNG: the camera's own in the middle, from behind at the rim.

    Equal areas (Lambert 1772); colours say by how much errors shrink.
    """
    lights = [c for c in candidates if c.image.kind == "light"]
    less = np.array([1.0 - 1.0 / c.gain for c in lights])
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, SIDE), np.linspace(1.0, -1.0, SIDE))
    r2 = x * x + y * y
    # From a disc of radius 1 to the sphere: height 1 - 2 r^2.
    side = 2.0 * np.sqrt(np.maximum(1.0 - r2, 0.0))
    local = np.stack([x * side, y * side, 1.0 - 2.0 * r2], -1)
    nearest = local @ _axes(lights[0].image.reference.camera) @ np.array([c.image.direction for c in lights]).T
    weight = np.maximum(nearest - 0.8, 1e-9) ** 2  # neighbours are 25 degrees apart: each place has some within 37
    smooth = (weight @ less) / weight.sum(-1)
    top = max(float(less.max()), 1e-6)
    picture = np.where((r2 <= 1.0)[..., None], false_colour(np.maximum(smooth, 0.0) / top), 24.0 / 255.0)
    return strip([[Panel("errors less by a further light from there", picture, f"{100.0 * top:.0f} %")]])


def _axes(camera: Camera) -> np.ndarray:
    """Right, up and towards the camera, as rows."""
    back = normalise(np.subtract(camera.position, camera.look_at))
    right = normalise(np.cross(camera.up, back))
    return np.stack([right, np.cross(back, right), back])
