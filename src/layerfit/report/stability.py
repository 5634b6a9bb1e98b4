"""What a stability sweep found: a table for the terminal and for the manual, and a heat map for each structure."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .pictures import BACKGROUND, INK, false_colour

if TYPE_CHECKING:
    from rich.console import Group

MAX_REL, MAX_ABS = 1e-4, 1e-6
"""float32 against float64 or 50 digits at the same numbers, at most: what its 24 bits leave after the worst of the divisions at grazing
angles; values [1/sr] within the second are as good as equal."""
MAX_REL_DOUBLE, MAX_ABS_DOUBLE = 1e-10, 1e-13
"""The same of float64 against 50 digits."""
SLOPE_REL, SLOPE_REL_DOUBLE = 1e-3, 1e-7
"""Derivatives against those of 50 digits, of float32 and float64."""

_CELL, _LEFT, _TOP, _GAP = 15, 64, 46, 30
_ACROSS = 4
"""Panels in a row."""
_DARKEST, _BRIGHTEST = -8.0, -2.0
"""log10 of the errors at the ends of the colours: a rounding of float32, and a value that is 1 % off."""


def file_name(structure: str) -> str:
    """A structure's name as that of a file."""
    return re.sub(r"[^a-z0-9]+", "_", structure.lower()).strip("_")


def good(entry: Mapping[str, Any]) -> bool:
    """Whether all of a structure holds: finite, without breaks, and within the tolerances, in each precision and as a shader."""
    lost = [entry["not_finite"], entry["beyond"], len(entry["breaks"])]
    lost += [entry["shader"]["not_finite"]] if entry["shader"] else []
    lost += [entry["digits"][key][what] for key in ("float32", "float64") for what in _BEYOND] if entry["digits"] else []
    return not any(lost)


_BEYOND = "value_beyond", "slope_beyond"


def heat_map(entry: Mapping[str, Any], polar_deg: Sequence[float]) -> bytes:
    """Largest error of a structure by angle of the light, from the normal at the left, and value of each parameter, as a PNG."""
    panels = list(entry["heat"].items())
    most = max(len(rows) for _, rows in panels)
    width, height = _LEFT + len(polar_deg) * _CELL + _GAP, _TOP + most * _CELL + _GAP
    size = min(len(panels), _ACROSS) * width, -(-len(panels) // _ACROSS) * height
    canvas = Image.new("RGB", (max(size[0], 2 * width), size[1]), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    draw.text((8, 4), f"{entry['name']}: relative error of float32,", fill=INK, font=ImageFont.load_default(11))
    draw.text((8, 16), "1e-8 (dark) to 1e-2 (bright)", fill=INK, font=ImageFont.load_default(11))
    for k, (key, rows) in enumerate(panels):
        place = k % _ACROSS * width + _LEFT, k // _ACROSS * height + _TOP
        _panel(canvas, draw, place, key, np.array(rows, float), entry["lines"][key], polar_deg)
    # As a palette: a third of the bytes, and flat squares lose nothing.
    out = io.BytesIO()
    canvas.quantize(64).save(out, "PNG", optimize=True)
    return out.getvalue()


def _panel(
    canvas: Any, draw: Any, place: tuple[int, int], key: str, rows: Any, values: Any, polar_deg: Sequence[float]
) -> None:
    (left, top), font = place, ImageFont.load_default(9)
    errors = np.where(np.isnan(rows), np.inf, rows)  # JSON has no word for infinity
    colours = false_colour((np.log10(np.clip(errors, 1e-9, 1.0)) - _DARKEST) / (_BRIGHTEST - _DARKEST))
    picture = Image.fromarray((255.0 * colours).round().astype(np.uint8))
    canvas.paste(picture.resize((_CELL * rows.shape[1], _CELL * len(rows)), 0), place)
    draw.text((left, top - 13), key, fill=INK, font=ImageFont.load_default(11))
    for row, value in enumerate(values):
        draw.text((left - 5, top + (row + 0.5) * _CELL), f"{value:.4g}", fill=INK, font=font, anchor="rm")
    for column in range(0, len(polar_deg), 2):
        spot = (left + (column + 0.5) * _CELL, top + len(rows) * _CELL + 8)
        draw.text(spot, f"{polar_deg[column]:g}", fill=INK, font=font, anchor="mm")


def _found(key: str, *what: str) -> Callable[[Mapping[str, Any]], str]:
    """Of the cases in 50 digits: how many are beyond a tolerance, or the largest error."""

    def cell(entry: Mapping[str, Any]) -> str:
        if entry["digits"] is None:
            return "-"
        found = entry["digits"][key]
        return str(sum(found[name] for name in what)) if what == _BEYOND else _short(found[what[0]])

    return cell


def _of(part: str, key: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda entry: "-" if entry[part] is None else _short(entry[part][key])


def _breaks(entry: Mapping[str, Any]) -> str:
    return ", ".join(f"{told['kind']}: {told['parameter']}" for told in entry["breaks"]) or "-"


def _short(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.1e}"


_COLUMNS: tuple[tuple[str, str | None, Callable[[Mapping[str, Any]], str]], ...] = (
    ("structure", "structure", lambda entry: entry["name"]),
    ("combinations", None, lambda entry: str(entry["combinations"])),
    ("not finite", "not finite", lambda entry: str(entry["not_finite"])),
    ("float32: value p99.9", None, _of("value_rel", "p999")),
    ("max", None, _of("value_rel", "max")),
    ("beyond", "float32 off", lambda entry: str(entry["beyond"])),
    ("50 digits: value", None, _found("float32", "value_max")),
    ("slope", None, _found("float32", "slope_max")),
    ("beyond", "off from 50 digits", _found("float32", *_BEYOND)),
    ("float64: value", None, _found("float64", "value_max")),
    ("slope", None, _found("float64", "slope_max")),
    ("beyond", "float64 off", _found("float64", *_BEYOND)),
    ("shader max", None, _of("shader", "max_rel")),
    ("compact", None, _of("compact", "value_max")),
    ("tables", None, _of("tables", "value_max")),
    ("breaks", "breaks", _breaks),
)
"""Of the tables: what each is called in the manual and in the terminal, which has not all of them, and what it says of a structure."""


def table(document: Mapping[str, Any]) -> "Group":
    """For the terminal: what is not as it should be, the worst cases, and a sentence."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    made = Table(header_style="dim", box=None, pad_edge=False)
    shown = [(name, cell) for _, name, cell in _COLUMNS if name]
    for name, _ in shown:
        made.add_column(name, justify="left" if name in ("structure", "breaks") else "right")
    for entry in document["structures"]:
        if not entry["good"]:
            made.add_row(*(cell(entry) for _, cell in shown))
    return Group(*([made] if made.rows else []), Text(sentence(document)))


def sentence(document: Mapping[str, Any]) -> str:
    """The sweep in a sentence."""
    entries = document["structures"]
    odd = [entry for entry in entries if not entry["good"]]
    tried = f"{document['combinations']} combinations of {len(entries)} structures, {document['not_finite']} numbers not finite"
    beyond = sum(entry["beyond"] for entry in entries)
    return f"{tried}, {beyond} values of float32 beyond the tolerance; {len(odd) or 'none'} of the structures with findings."


def markdown(document: Mapping[str, Any]) -> str:
    """The whole sweep as tables for the manual."""
    lines = [sentence(document), "", *_row([heading for heading, _, _ in _COLUMNS]), *_row(["---"] * len(_COLUMNS))]
    for entry in document["structures"]:
        lines += _row([cell(entry) for _, _, cell in _COLUMNS])
    lines += ["", "The largest errors of a value, one a structure and material:", "", *_cases(document["worst"])]
    return "\n".join(lines) + "\n"


def _cases(worst: Sequence[Mapping[str, Any]]) -> list[str]:
    headings = ("structure", "parameters", "wi", "wo", "float32", "float64", "error")
    lines = [*_row(headings), *_row(["---"] * len(headings))]
    for case in worst:
        numbers = ", ".join(f"{key} {value:.9g}" for key, value in case["parameters"].items())
        cells = [_list(case[key]) for key in ("wi", "wo", "float32", "float64")]
        lines += _row([case["structure"], numbers, *cells, _short(case["over"])])
    return lines


def _row(cells: Sequence[str]) -> list[str]:
    return [f"| {' | '.join(cells)} |"]


def _list(value: Any) -> str:
    return " ".join(f"{v:.9g}" for v in value) if isinstance(value, list) else f"{value:.9g}"
