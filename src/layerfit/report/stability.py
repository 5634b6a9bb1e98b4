"""What a stability sweep found: a table for the terminal and for the manual, and a heat map for each structure."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .pictures import BACKGROUND, INK, false_colour, png

if TYPE_CHECKING:
    from rich.console import Group

MAX_REL = 1e-4
"""float32 against float64 at the same numbers, at most: what its 24 bits leave after the worst of the divisions at grazing angles."""

_CELL, _ROWS, _LEFT, _TOP, _GAP = 22, 13, 64, 46, 30
_DARKEST, _BRIGHTEST = -8.0, -2.0
"""log10 of the errors at the ends of the colours: a rounding of float32, and a value that is 1 % off."""


def file_name(structure: str) -> str:
    """A structure's name as that of a file."""
    return re.sub(r"[^a-z0-9]+", "_", structure.lower()).strip("_")


def heat_map(entry: Mapping[str, Any], polar_deg: Sequence[float]) -> bytes:
    """Largest error of a structure by angle of the light, from the normal at the left, and value of each parameter, as a PNG."""
    panels = list(entry["heat"].items())
    width = _LEFT + len(polar_deg) * _CELL + _GAP
    canvas = Image.new("RGB", (width * len(panels), _TOP + _ROWS * _CELL + 2 * _GAP), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(11)
    draw.text((8, 6), f"{entry['name']}: relative error of float32, 1e-8 (dark) to 1e-2 (bright)", fill=INK, font=font)
    for k, (key, rows) in enumerate(panels):
        errors = np.array([[math.inf if error is None else error for error in row] for row in rows])
        colours = false_colour((np.log10(np.clip(errors, 1e-9, 1.0)) - _DARKEST) / (_BRIGHTEST - _DARKEST))
        picture = Image.fromarray((255.0 * colours).round().astype(np.uint8))
        canvas.paste(picture.resize((_CELL * errors.shape[1], _CELL * len(rows)), 0), (k * width + _LEFT, _TOP))
        draw.text((k * width + _LEFT, _TOP - 16), key, fill=INK, font=font)
        for row, value in enumerate(entry["lines"][key]):
            draw.text((k * width + _LEFT - 5, _TOP + (row + 0.5) * _CELL), f"{value:.4g}", fill=INK, font=font, anchor="rm")
        for column in range(0, len(polar_deg), 2):
            place = (k * width + _LEFT + (column + 0.5) * _CELL, _TOP + _ROWS * _CELL + 10)
            draw.text(place, f"{polar_deg[column]:g}", fill=INK, font=font, anchor="mm")
    return png(canvas)


_HEADINGS = ("structure", "combinations", "not finite", "value p99.9", "value max", "slope p99.9", "shader max", "breaks")


def _cells(entry: Mapping[str, Any]) -> tuple[str, ...]:
    shader = entry["shader"]
    broken = ", ".join(f"{told['kind']}: {told['parameter']}" for told in entry["breaks"]) or "-"
    drawn = "-" if shader is None else _short(shader["max_rel"])
    figures = (_short(entry["value_rel"]["p999"]), _short(entry["value_rel"]["max"]), _short(entry["slope_rel"]["p999"]), drawn)
    return (entry["name"], str(entry["combinations"]), str(entry["not_finite"]), *figures, broken)


def _short(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.1e}"


def table(document: Mapping[str, Any]) -> "Group":
    """For the terminal: what is not as it should be, the worst cases, and a sentence."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    made = Table(header_style="dim", box=None, pad_edge=False)
    for heading in _HEADINGS:
        made.add_column(heading, justify="left" if heading in ("structure", "breaks") else "right")
    for entry in document["structures"]:
        if not entry["good"]:
            made.add_row(*_cells(entry))
    return Group(*([made] if made.rows else []), Text(sentence(document)))


def sentence(document: Mapping[str, Any]) -> str:
    """The sweep in a sentence."""
    entries = document["structures"]
    odd = [entry for entry in entries if not entry["good"]]
    tried = f"{document['combinations']} combinations of {len(entries)} structures, {document['not_finite']} numbers not finite"
    return f"{tried}; {len(odd) or 'none'} of the structures with findings."


def markdown(document: Mapping[str, Any]) -> str:
    """The whole sweep as tables for the manual."""
    lines = [sentence(document), "", *_row(_HEADINGS), *_row(["---"] * len(_HEADINGS))]
    for entry in document["structures"]:
        lines += _row(_cells(entry))
    lines += ["", "The largest errors of a value, one a structure and material:", ""]
    headings = ("structure", "parameters", "wi", "wo", "float32", "float64", "error")
    lines += [*_row(headings), *_row(["---"] * len(headings))]
    for case in document["worst"]:
        numbers = ", ".join(f"{key} {value:.6g}" for key, value in case["parameters"].items())
        cells = [_list(case[key]) for key in ("wi", "wo", "float32", "float64")]
        lines += _row([case["structure"], numbers, *cells, _short(case["over"])])
    return "\n".join(lines) + "\n"


def _row(cells: Sequence[str]) -> list[str]:
    return [f"| {' | '.join(cells)} |"]


def _list(value: Any) -> str:
    return " ".join(f"{v:.8g}" for v in value) if isinstance(value, list) else f"{value:.8g}"
