"""Error against run time: tables for the terminal, what follows in words, the picture with its Pareto fronts, and the page."""

import html
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .._html import table
from . import pages
from .html import figure
from .scatter import Panel, Point, scatter
from .truth import percent

if TYPE_CHECKING:
    from rich.table import Table

_TIERS = (
    "tier",
    "x Phong",
    "instructions",
    "a further light",
    "max",
    "p99.9",
    "RMS",
    "delta E",
    "walk: median",
    "p90",
    "tables",
)
_SHORT = {0: "tier", 1: "x Phong", 2: "instructions", 5: "p99.9", 7: "delta E", 8: "walk"}
"""Columns of them that a terminal has room for."""
_FITS = ("fit", "seconds", "steps", "error")


def error_of(row: Mapping[str, Any], against: str) -> float | None:
    """What a front is drawn of: the 99.9th percentile against the exact material, the median against the walk."""
    if against == "exact":
        return row["p999_rel"]
    return row["walk"] and row["walk"]["median"]


def front(rows: Sequence[Mapping[str, Any]], against: str) -> list[str]:
    """Tiers that no cheaper one is as near as."""
    known = [(row["x_phong"], error, row["tier"]) for row in rows if (error := error_of(row, against)) is not None]
    return _best(known)


def fit_front(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Fits that no quicker one is as near as."""
    return _best([(row["seconds"], row["rel_l2"], row["name"]) for row in rows])


def _best(points: Sequence[tuple[float, float, str]]) -> list[str]:
    order = sorted(points)
    return [name for k, (_, error, name) in enumerate(order) if all(error < other for _, other, _ in order[:k])]


def tier_cells(row: Mapping[str, Any]) -> list[str]:
    """A row of the table of tiers."""
    low, high = row["x_phong_spread"]
    walk = row["walk"] or {}
    return [
        row["tier"],
        f"{row['x_phong']:.2f} ({low:.2f}-{high:.2f})",
        str(row["instructions"]),
        f"+{row['instructions_per_light']}",
        *(f"{row[key]:.2g}" for key in ("max_rel", "p999_rel", "rms_rel", "delta_e")),
        *(percent(walk.get(key)) for key in ("median", "p90")),
        str(row["table_bytes"]),
    ]


def fit_cells(row: Mapping[str, Any]) -> list[str]:
    """A row of the table of fits."""
    return [row["name"], f"{row['seconds']:.3g}", str(row["steps"]), f"{row['rel_l2']:.2g}"]


def tables(document: Mapping[str, Any]) -> "list[Table]":
    """Tiers and fits, for the terminal."""
    cells = [tier_cells(row) for row in document["tiers"]]
    made = [_table(tuple(_SHORT.values()), [[row[k] for k in _SHORT] for row in cells])]
    fitted = [fit_cells(row) for row in document["fits"] if "absent" not in row]
    return [*made, _table(_FITS, fitted)] if fitted else made


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> "Table":
    from rich.table import Table

    made = Table(header_style="dim", box=None, pad_edge=False)
    for k, heading in enumerate(headings):
        made.add_column(heading, justify="right" if k else "left", no_wrap=True)
    for row in rows:
        made.add_row(*row)
    return made


def sentences(document: Mapping[str, Any]) -> list[str]:
    """What follows: the fronts, and what is not there."""
    said = [
        f"Shaders by {document['device']} on {document['machine']}, {document['lights']} light{'s' * (document['lights'] > 1)}."
    ]
    by = {"exact": "the material itself", "walk": "the random walk"}
    for against, words in by.items():
        best = sorted((row for row in document["tiers"] if row[f"pareto_{against}"]), key=lambda row: row["x_phong"])
        if best:
            listed = (f"{row['tier']} ({row['x_phong']:.2f} x Phong, {percent(error_of(row, against))})" for row in best)
            said.append(f"Nearest to {words} for their time: {', '.join(listed)}.")
    if "absent" in document["walk"]:
        said.append(f"Not compared with the random walk: {document['walk']['absent']}.")
    said += [f"No fit: {row['absent']}." for row in document["fits"] if "absent" in row]
    quick = [row for row in document["fits"] if row.get("pareto") and row["kind"] == "fit"]
    if quick:
        listed = (f"{row['name']} ({row['seconds']:.2g} s, {percent(row['rel_l2'])})" for row in quick)
        said.append(f"Fits that no quicker one is as near as: {', '.join(listed)}.")
    return said


def picture(document: Mapping[str, Any]) -> bytes:
    """The fronts as a PNG: tiers against the exact material and against the walk, and fits."""
    panels = []
    titles = {
        "exact": "relative error against the exact material, p99.9",
        "walk": "relative error below the coat, against the random walk, median",
    }
    for against, title in titles.items():
        points = [
            Point(row["tier"], row["x_phong"], error, row[f"pareto_{against}"], tuple(row["x_phong_spread"]))
            for row in document["tiers"]
            if (error := error_of(row, against)) is not None
        ]
        if points:
            panels.append(Panel(title, "time, x Phong", points))
    for kind, title in (("fit", "fits: relative L2"), ("solver", "one descent: relative L2")):
        rows = [row for row in document["fits"] if row.get("kind") == kind]
        points = [Point(row["name"], row["seconds"], row["rel_l2"], row["pareto"]) for row in rows]
        if points:
            panels.append(Panel(title, "seconds", points))
    return scatter(panels)


def page(document: Mapping[str, Any], drawing: bytes) -> str:
    """The same as one HTML file that makes no request."""
    fitted = [fit_cells(row) for row in document["fits"] if "absent" not in row]
    phong, per_light = document["phong"]["instructions"], document["phong"]["instructions_per_light"]
    title = f"{document['name']}: error against run time"
    body = f"""<h1>{html.escape(title)}</h1>
{"".join(f"<p>{html.escape(sentence)}</p>" for sentence in document["in_words"])}
{figure(drawing, "error against run time", "Both scales are logarithmic. Amber: nothing that is cheaper is as near.")}
<h2>Shaders</h2>
{table(_TIERS, [tier_cells(row) for row in document["tiers"]])}
<p class=soft>Time over that of Phong in the same round: median of {document["rounds"]} rounds, and its quartiles. Instructions of SPIR-V after
spirv-opt -O ({html.escape(document["counted_by"])}); Phong has {phong}, and {per_light} for each further light.
Max, p99.9 and RMS are relative, over random and extreme pairs of directions, delta E 2000 over pixels, against the material itself.</p>
{"<h2>Fits</h2>" + table(_FITS, fitted) if fitted else ""}"""
    return pages.page(title, body)
