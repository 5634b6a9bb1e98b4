"""Figures of a page as SVG and tables: they follow its colours, light or dark, and their text can be searched."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from .pictures import ticks

WIDTH, HEIGHT, LEFT, RIGHT, LOW, TOP = 760, 300, 64, 16, 44, 34
COLOURS = ("#7c3aed", "#d9480f", "#0d9488", "#b45309", "#2563eb", "#be185d")
"""Of the stages of a fit; none is too light or too dark for either ground."""


def convergence(rows: Sequence[tuple[float, str, int, float]]) -> str:
    """Error of a fit against its run time: steps of (seconds, stage, start, error), one line a start in each stage."""
    error = np.log10(np.maximum([row[3] for row in rows], 1e-30))
    floor, ceiling = np.floor(error.min()), np.ceil(error.max() + 1e-9)
    end = max(rows[-1][0], 1e-9)
    x = lambda t: LEFT + t / end * (WIDTH - LEFT - RIGHT)  # noqa: E731
    y = lambda e: TOP + (ceiling - e) / (ceiling - floor) * (HEIGHT - TOP - LOW)  # noqa: E731
    stages = list(dict.fromkeys(row[1].split()[0] for row in rows))
    colour = {stage: COLOURS[k % len(COLOURS)] for k, stage in enumerate(stages)}
    lines: dict[tuple[str, int], list[str]] = {}
    dots = []
    for (t, stage, start, value), e in zip(rows, error, strict=True):
        lines.setdefault((stage, start), []).append(f"{x(t):.1f},{y(e):.1f}")
        title = f"{t:.2f} s, {stage}, start {start + 1}: {value:.3g}"
        dots.append(
            f'<circle cx="{x(t):.1f}" cy="{y(e):.1f}" r="2.2" fill="{colour[stage.split()[0]]}"><title>{escape(title)}</title></circle>'
        )
    paths = [
        f'<polyline class="line" stroke="{colour[stage.split()[0]]}" points="{" ".join(points)}"/>'
        for (stage, _), points in lines.items()
    ]
    parts = [*_decades(floor, ceiling, y), *_seconds(end, x), *paths, *dots, *_legend(colour)]
    name = "error of the pixels in use against seconds since the fit began"
    return f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{name}">{"".join(parts)}</svg>'


def _decades(floor: float, ceiling: float, y) -> list[str]:
    out = []
    for decade in np.arange(floor, ceiling + 1, max(1.0, np.ceil((ceiling - floor) / 6))):
        word = f"{10.0**decade:.0e}" if abs(decade) > 3 else f"{10.0**decade:g}"
        out.append(f'<line class="rule" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(decade):.1f}" y2="{y(decade):.1f}"/>')
        out.append(f'<text x="{LEFT - 8}" y="{y(decade) + 4:.1f}" text-anchor="end">{word}</text>')
    return out


def _seconds(end: float, x) -> list[str]:
    low = HEIGHT - LOW
    out = [f'<text x="{x(t):.1f}" y="{low + 18}" text-anchor="middle">{t:g}</text>' for t in ticks(end)]
    out += [f'<line class="rule" x1="{x(t):.1f}" x2="{x(t):.1f}" y1="{low}" y2="{low + 5}"/>' for t in ticks(end)]
    return [*out, f'<text x="{WIDTH / 2}" y="{HEIGHT - 8}" text-anchor="middle">seconds since the fit began</text>']


def _legend(colour: dict[str, str]) -> list[str]:
    out, x = ['<text x="8" y="18">error of the pixels in use, relative:</text>'], 230
    for stage, hue in colour.items():
        out.append(f'<circle cx="{x}" cy="14" r="4" fill="{hue}"/><text x="{x + 9}" y="18">{escape(stage)}</text>')
        x += 30 + 7 * len(stage)
    return out


def correlations(pairs: Sequence[Sequence], least: float = 0.5) -> str:
    """Pairs (name, name, r) as a triangle of cells; what is not listed is below `least`, and its cell empty."""
    if not pairs:
        return f"<p>No two parameters are correlated by {least:g} or more.</p>"
    names = list(dict.fromkeys(name for a, b, _ in pairs for name in (a, b)))
    found = {frozenset((a, b)): r for a, b, r in pairs}
    head = "".join(f"<th>{escape(name)}</th>" for name in names[:-1])
    body = "".join(
        f"<tr><th>{escape(name)}</th>{''.join(_cell(found.get(frozenset((name, other)))) for other in names[:k])}</tr>"
        for k, name in enumerate(names)
        if k
    )
    return f'<div class="wide"><table class="correlations"><tr><th></th>{head}</tr>{body}</table></div>'


def _cell(r: float | None) -> str:
    if r is None:
        return "<td></td>"
    hue = "#d9480f" if r > 0.0 else "#2563eb"
    return f'<td style="--hue:{hue};--much:{0.7 * r * r:.2f}">{r:+.2f}</td>'


_WIDE, _HIGH, _HIGHEST = 240, 170, 3.0
"""Of the chart of one profile: its size, and the largest rise that is drawn."""


def profiles(rows: Sequence[Mapping[str, Any]]) -> str:
    """The cost along each parameter, over the rise that ends its 95 % interval (the line); rows as in `fit.json`, nothing of none."""
    if not rows:
        return ""
    said = "The cost along a parameter, all others fitted again. Where it crosses the line, the 95 % interval ends."
    return f'<h3>Profiles</h3>{"".join(_profile(row) for row in rows)}<p class="soft">{said}</p>'


def _profile(row: Mapping[str, Any]) -> str:
    left, right, top, low = 10, _WIDE - 10, 28, _HIGH - 26
    values, rise = np.array(row["values"], float), np.minimum(np.array(row["rise"], float), _HIGHEST)
    x = lambda v: left + (v - values[0]) / max(values[-1] - values[0], 1e-12) * (right - left)  # noqa: E731
    y = lambda r: low - r / _HIGHEST * (low - top)  # noqa: E731
    hue = COLOURS[0]
    points = " ".join(f"{x(v):.1f},{y(r):.1f}" for v, r in zip(values, rise, strict=True))
    dots = [
        f'<circle cx="{x(v):.1f}" cy="{y(r):.1f}" r="2.2" fill="{hue}"><title>{v:.4g}: {r:.3g}</title></circle>'
        for v, r in zip(values, rise, strict=True)
    ]
    parts = [
        *(f'<line class="rule" x1="{left}" x2="{right}" y1="{y(r):.1f}" y2="{y(r):.1f}"/>' for r in (1.0, 0.0)),
        f'<polyline class="line" stroke="{hue}" points="{points}"/>',
        *dots,
        f'<text x="{left}" y="18">{escape(row["parameter"])}</text><text x="{left}" y="{_HIGH - 6}">{values[0]:.4g}</text>',
        f'<text x="{right}" y="{_HIGH - 6}" text-anchor="end">{values[-1]:.4g}</text>',
    ]
    name = escape(f"cost along {row['parameter']}")
    return f'<svg class="chart" style="width:{_WIDE}px" viewBox="0 0 {_WIDE} {_HIGH}" role="img" aria-label="{name}">{"".join(parts)}</svg>'
