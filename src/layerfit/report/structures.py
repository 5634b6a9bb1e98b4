"""The structures that were tried: a table, what follows from it in words, and error against parameters."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..fit.result import POOR, flags, parameters
from ..fit.structures import NO_BOUNDARY, STRONG, StructureChoice, Tried
from .pictures import BACKGROUND, INK, LINE, png
from .scatter import free_place

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA, VERSION = "layerfit/structures", 1

_BARE, _COATED = (240, 170, 40), (86, 180, 233)
_SCALE = 2
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _LOW = 760, 420, 64, 190, 44, 48


def document(choice: StructureChoice) -> dict[str, Any]:
    """The content of `structures.json`."""
    best, pareto = choice.best, [t.candidate.name for t in choice.pareto]
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "metric": choice.metric,
        "criterion": "BIC, over the effective number of residuals",
        "residuals": choice.residuals,
        "effective_residuals": round(choice.effective_residuals, 1),
        "chosen": choice.chosen.candidate.name,
        "lowest_bic": best.candidate.name,
        "coat": {"supported": choice.coated, "bic_gain": _rounded(choice.coat_gain)},
        "retro_reflection": _rounded(choice.retro),
        "pareto": pareto,
        "in_words": sentences(choice),
        "structures": [_row(t, best) for t in sorted(choice.tried, key=lambda t: t.bic)],
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, 2)


def _row(tried: Tried, best: Tried) -> dict[str, Any]:
    rows = parameters(tried.result)
    return {
        "name": tried.candidate.name,
        "words": tried.candidate.words,
        "coats": tried.layers,
        "parameters": tried.parameters,
        "error": float(f"{tried.error:.4g}"),
        "misfit": float(f"{tried.result.misfit:.4g}"),
        "bic_above_lowest": round(tried.bic - best.bic, 2),
        "converged": tried.result.converged,
        "flags": flags(tried.result, rows, []),
        "values": {name: row["value"] for name, row in rows.items()},
    }


def table(found: Mapping[str, Any]) -> "Table":
    """The structures, lowest criterion first."""
    from rich.table import Table
    from rich.text import Text

    made = Table(header_style="dim", box=None, pad_edge=False)
    for heading in ("structure", "coats", "parameters", "error", "misfit", "BIC", "Pareto"):
        made.add_column(heading, justify="left" if heading == "structure" else "right", no_wrap=True)
    for row in found["structures"]:
        chosen = row["name"] == found["chosen"]
        words = Text(row["words"], "bold" if chosen else "")
        numbers = (
            str(row["coats"]),
            str(row["parameters"]),
            f"{row['error']:.3g}",
            f"{row['misfit']:.3g}",
            f"+{row['bic_above_lowest']:.1f}",
        )
        made.add_row(words, *numbers, "*" if row["name"] in found["pareto"] else "")
    return made


def sentences(choice: StructureChoice) -> list[str]:
    """What follows, in words: the structure, the coat, and what none of them explains."""
    chosen, best = choice.chosen, choice.best
    said = [f"Chosen: {chosen.candidate.words}, {chosen.parameters} parameters, off by {100.0 * chosen.error:.2g} %."]
    if chosen is not best:
        said[0] += (
            f" {best.candidate.words.capitalize()}, {best.parameters} parameters, is off by {100.0 * best.error:.2g} %: by "
            f"{chosen.bic - best.bic:.1f} in BIC, and {STRONG:g} would be strong evidence."
        )
    said += _of_coat(choice)
    if chosen.result.misfit > POOR:
        said.append(
            f"It misses {100.0 * chosen.result.misfit:.0f} % of the reference: of these structures it is the best choice, and none that explains it."
        )
    if choice.retro is not None:
        said.append(
            f"Towards the light the reference is {choice.retro:.1f} times as bright as this: it sends light back where it came from, and none "
            "of these structures does. A Lafortune lobe may (cx and cz of one sign)."
        )
    return said


def _of_coat(choice: StructureChoice) -> list[str]:
    """Whether there is a coat."""
    if not math.isfinite(choice.coat_gain):
        return []
    gain = f"the best structure with a coat gains {choice.coat_gain:.1f} in BIC over the best without one"
    if not choice.coated:
        return [
            f"No coat is supported: {gain}." if choice.coat_gain > 0.0 else "No coat is supported: none with one is better."
        ]
    coat = choice.chosen.result.stack.layers[0]
    if float(coat.eta) >= NO_BOUNDARY:
        return [f"A coat is supported: {gain}."]
    return [
        f"What is supported over the base is a medium, not a surface: {gain}, and its index is {float(coat.eta):.2f}. Of a smooth boundary "
        "nothing shows beside its mirror image; where that was left out, its index is to be given."
    ]


def pareto(choice: StructureChoice) -> bytes:
    """Error against the number of parameters as a PNG; a line along those that none with fewer is nearer than."""
    canvas = Image.new("RGB", (_SCALE * _WIDTH, _SCALE * _HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(12 * _SCALE)
    errors = np.log10([max(t.error, 1e-12) for t in choice.tried])
    low, high = float(np.floor(errors.min() * 2.0) / 2.0), float(np.ceil(errors.max() * 2.0) / 2.0 + 1e-6)
    most = max(t.parameters for t in choice.tried) + 1
    left, right, top, bottom = _LEFT, _WIDTH - _RIGHT, _TOP, _HEIGHT - _LOW
    to_x = lambda p: _SCALE * (left + p / most * (right - left))  # noqa: E731
    to_y = lambda e: _SCALE * (top + (high - np.log10(max(e, 1e-12))) / (high - low) * (bottom - top))  # noqa: E731
    for half in np.arange(low, high + 0.25, 0.5):
        y = float(to_y(10.0**half))
        draw.line([(_SCALE * left, y), (_SCALE * right, y)], fill=LINE, width=_SCALE)
        draw.text((_SCALE * (left - 6), y), f"{10.0**half:.2g}", fill=INK, font=font, anchor="rm")
    for p in range(0, most + 1, 2):
        draw.text((to_x(p), _SCALE * (bottom + 12)), str(p), fill=INK, font=font, anchor="mm")
    draw.text((_SCALE * (left + right) / 2, _SCALE * (_HEIGHT - 14)), "parameters", fill=INK, font=font, anchor="mm")
    draw.text(
        (_SCALE * 8, _SCALE * 8),
        f"relative error ({choice.metric}); amber bare, blue coated; the ring is chosen",
        fill=INK,
        font=font,
    )
    front = [(to_x(t.parameters), float(to_y(t.error))) for t in choice.pareto]
    draw.line(front, fill=INK, width=_SCALE)
    boxes: list[tuple[float, ...]] = []
    for t in sorted(choice.tried, key=lambda t: (t.parameters, -t.error)):
        x, y, r = to_x(t.parameters), float(to_y(t.error)), 4 * _SCALE
        draw.ellipse([x - r, y - r, x + r, y + r], fill=_COATED if t.layers else _BARE)
        if t is choice.chosen:
            draw.ellipse([x - 2 * r, y - 2 * r, x + 2 * r, y + 2 * r], outline=INK, width=_SCALE)
        at = free_place(draw, (x + 2.4 * r, y), t.candidate.name, font, boxes, 2.0 * _SCALE)
        draw.text(at, t.candidate.name, fill=INK, font=font, anchor="lm")
    return png(canvas.reduce(_SCALE))
