"""A fit in words: what the terminal, the report page and a notebook say alike."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

from .._html import cell, table as html_table
from ..stack import Stack

SIGMA = (
    "of noise and scatter, not of what the form of the model gets wrong: a value can be further from the truth than its sigma"
)
"""What the sigmas are of."""

WHOLE_SIGMA = "of noise and scatter, and of what the form of the model gets wrong by a random walk at this material"
"""The same where that was measured."""

NONE = "\N{EN DASH}"
"""In place of a number that there is none of."""


def structure(stack: Stack) -> str:
    """The layers of a material, outermost first."""
    return " over ".join(type(layer).__name__ for layer in (*stack.layers, stack.base))


def converged(yes: bool, steps: int) -> str:
    """Whether a fit came to its end."""
    return f"{'yes' if yes else 'NO'}, after {steps} steps"


def parameters(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line each: value, sigma, unit, and what a reader should know of it."""
    return [_line(name, row) for name, row in rows.items()]


def _line(name: str, row: Mapping[str, Any]) -> str:
    value, sigma = measured(row["value"], row["sigma"])
    notes = [f"start {number(row['start'])}"] if "start" in row else []
    notes += [f"corrected {measured(row['corrected'], row['sigma'])[0]}"] if "corrected" in row else []
    said = ", ".join([*notes, *states(row)])
    return f"    {name + ':':<26} {value} +/- {sigma}{_unit(row, ' ')}" + (f"  ({said})" if said else "")


def table(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """The same as an HTML table; a column that holds nothing is left out."""
    lines = [_cells(name, row) for name, row in rows.items()]
    kept = [k for k, column in enumerate(zip(*lines, strict=True)) if any(column)]
    heads = "".join(cell("th", HEADS[k]) for k in kept)
    body = "".join(f"<tr>{''.join(_shown(k, line[k]) for k in kept)}</tr>" for line in lines)
    return f"<table><tr>{heads}</tr>{body}</table>"


def remarks(
    pairs: Sequence[Sequence[Any]], blind: Sequence[str], notes: Sequence[str], minima: Sequence[Mapping[str, Any]]
) -> dict[str, list[str]]:
    """What else is known of a fit, lines under their headings; a heading without lines is left out."""
    found = {
        "Correlations (below 0.5 are not listed)": [f"C({a}, {b}) = {r:+.3f}" for a, b, r in pairs[:12]],
        "Identifiability": [*blind, *notes],
        "Other minima (error over that of this one)": other_minima(minima),
    }
    return {heading: lines for heading, lines in found.items() if lines}


def blocks(remarks: Mapping[str, Sequence[str]]) -> str:
    """The same as HTML."""
    return "".join(
        f"<p><b>{html.escape(heading)}</b><br>{'<br>'.join(html.escape(line) for line in lines)}</p>"
        for heading, lines in remarks.items()
    )


def rows(found: Sequence[Mapping[str, Any]]) -> str:
    """Rows of a batch as an HTML table: what has a sigma beside it, with it; and the message of what failed."""
    columns = list(dict.fromkeys(name for row in found for name in row if not name.endswith((".sigma", ".corrected"))))
    return html_table(columns, [[_cell(row, name) for name in columns] for row in found])


def _cell(row: Mapping[str, Any], name: str) -> str:
    value = row.get(name)
    if isinstance(value, float):
        return " \u00b1 ".join(measured(value, row[f"{name}.sigma"])) if f"{name}.sigma" in row else number(value)
    return "" if value is None else str(value)


HEADS = ("parameter", "value", "sigma", "unit", "corrected", "start", "")


def _shown(k: int, words: str) -> str:
    words = html.escape(words)
    return cell("td" if k else "th", f"<span class=soft>{words}</span>" if HEADS[k] == "start" else words)


def _cells(name: str, row: Mapping[str, Any]) -> list[str]:
    value, sigma = measured(row["value"], row["sigma"])
    start = number(row["start"]) if "start" in row else ""
    corrected = measured(row["corrected"], row["sigma"])[0] if "corrected" in row else ""
    return [name, value, f"\u00b1 {sigma}", _unit(row), corrected, start, ", ".join(states(row))]


def _unit(row: Mapping[str, Any], before: str = "") -> str:
    return before + row["unit"] if row.get("unit", "1") != "1" else ""


def states(row: Mapping[str, Any]) -> list[str]:
    """What a reader should know of a parameter."""
    found = [f"at its {row['at_bound']} bound"] if row.get("at_bound") else []
    found += ["not identifiable"] if row.get("identifiable") is False else []
    found += [_interval(row)] if "interval_95" in row else []
    return found + ([f"= {row['derived']}"] if "derived" in row else [])


def _interval(row: Mapping[str, Any]) -> str:
    """A 95 % interval, or lower limits; a channel that has neither has a dash."""
    ends = row["interval_95"] if len(row["interval_95"]) == 3 else [row["interval_95"]]
    if row["lower_limit"]:
        return f"at least {number([None if end is None else end[0] for end in ends])} (95 %)"
    return "95 %: " + ", ".join(NONE if end is None else f"{number(end[0])} to {number(end[1])}" for end in ends)


def number(value: Any) -> str:
    """A value or a colour in four digits, or a dash."""
    if value is None:
        return NONE
    if isinstance(value, list):
        return "[" + ", ".join(number(v) for v in value) + "]"
    return f"{value:.4g}"


def measured(value: Any, sigma: Any) -> tuple[str, str]:
    """A value with the digits that its sigma leaves it, seven at most, and the sigma in two."""
    if isinstance(value, list):
        pairs = [measured(v, s) for v, s in zip(value, sigma if isinstance(sigma, list) else [sigma] * len(value), strict=True)]
        values, sigmas = ("[" + ", ".join(column) + "]" for column in zip(*pairs, strict=True))
        return values, sigmas
    if not sigma or not value:
        return number(value), number(sigma)
    wanted = 1 - math.floor(math.log10(sigma))
    decimals = max(min(wanted, 6 - math.floor(math.log10(abs(value)))), 0)
    return f"{value:.{decimals}f}", f"{sigma:.{decimals}f}" if decimals == wanted else f"{sigma:.2g}"


def starts(count: int, minima: Sequence[Mapping[str, Any]]) -> str:
    """How many starts came to the best minimum, and how many were given up on their way."""
    left = sum(len(row["starts"]) for row in minima if not row["followed"])
    return f"{count}, of which {len(minima[0]['starts'])} reached this minimum" + (
        f" and {left} were given up on their way" if left else ""
    )


def other_minima(minima: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line each: how much worse, how many starts came there, and the values there. Places that were not followed to their end are left out."""
    return [_minimum(row) for row in minima[1:] if row["followed"]]


def _minimum(row: Mapping[str, Any]) -> str:
    values = ", ".join(f"{name} {number(value)}" for name, value in row["values"].items())
    starts = len(row["starts"])
    return f"{math.sqrt(row['cost_over_best']):.3g} ({starts} start{'s' if starts > 1 else ''}): {values}"


def model_error(error: Mapping[str, Any]) -> str:
    """How far the form itself is from the truth, which no fit can better."""
    if not error:
        return "not measured for this material"
    return f"{100.0 * error['p50']:.2g} % (median of materials), {100.0 * error['p90']:.2g} % (9 of 10), {error['of']}"


def poor(misfit: float) -> str:
    """What a poor fit means, in a sentence."""
    return (
        f"The model misses {100.0 * misfit:.0f} % of the image. Check camera, lights and channels, then whether the material has these "
        "layers; its values say little."
    )
