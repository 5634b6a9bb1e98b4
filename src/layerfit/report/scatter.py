"""Named points in panels with logarithmic scales, and a line along those that none is better than in both."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .pictures import BACKGROUND, INK, LINE, png

POINT, FRONT = (86, 180, 233), (240, 170, 40)
_SCALE = 2
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _LOW = 560, 400, 64, 20, 40, 48


@dataclasses.dataclass(frozen=True)
class Point:
    """A named point; `spread` is of x."""

    name: str
    x: float
    y: float
    front: bool
    spread: tuple[float, float] | None = None


@dataclasses.dataclass(frozen=True)
class Panel:
    """Points on two scales. Points at y = 0 are drawn at the bottom, under the scale."""

    title: str
    x_label: str
    points: Sequence[Point]


def free_place(
    draw: Any, at: tuple[float, float], text: str, font: Any, boxes: list[tuple[float, ...]], step: float
) -> tuple[float, float]:
    """Where a label beside a point stands without covering another one; its box is added to those."""
    box = draw.textbbox(at, text, font=font, anchor="lm")
    while any(_overlap(box, other) for other in boxes):
        at = at[0], at[1] + step
        box = draw.textbbox(at, text, font=font, anchor="lm")
    boxes.append(box)
    return at


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def scatter(panels: Sequence[Panel]) -> bytes:
    """Panels side by side as a PNG."""
    canvas = Image.new("RGB", (_SCALE * _WIDTH * len(panels), _SCALE * _HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    for k, panel in enumerate(panels):
        _draw_panel(draw, ImageFont.load_default(12 * _SCALE), k * _WIDTH, panel)
    return png(canvas.reduce(_SCALE))


def _draw_panel(draw: Any, font: Any, x0: int, panel: Panel) -> None:
    left, right, top, bottom = x0 + _LEFT, x0 + _WIDTH - _RIGHT, _TOP, _HEIGHT - _LOW
    known = [p.y for p in panel.points if p.y > 0.0]
    y_ticks = _decades(known or [1.0])
    low, high = math.log10(y_ticks[0]) - 0.3, math.log10(y_ticks[-1]) + 0.1
    xs = [x for p in panel.points for x in (p.x, *(p.spread or ()))]
    first, last = math.log10(min(xs)) - 0.05, math.log10(max(xs)) + 0.45  # room for names on the right
    to_x = lambda x: _SCALE * (left + (math.log10(x) - first) / (last - first) * (right - left))  # noqa: E731
    to_y = lambda y: _SCALE * (bottom - ((math.log10(y) - low) / (high - low) if y > 0.0 else 0.0) * (bottom - top))  # noqa: E731
    for tick in y_ticks:
        draw.line([(_SCALE * left, to_y(tick)), (_SCALE * right, to_y(tick))], fill=LINE, width=_SCALE)
        draw.text((_SCALE * (left - 6), to_y(tick)), f"{tick:g}", fill=INK, font=font, anchor="rm")
    for tick in _steps(10.0**first, 10.0**last):
        draw.line([(to_x(tick), _SCALE * bottom), (to_x(tick), _SCALE * (bottom + 4))], fill=INK, width=_SCALE)
        draw.text((to_x(tick), _SCALE * (bottom + 14)), f"{tick:g}", fill=INK, font=font, anchor="mm")
    draw.text((_SCALE * (left + right) / 2, _SCALE * (_HEIGHT - 14)), panel.x_label, fill=INK, font=font, anchor="mm")
    draw.text((_SCALE * (x0 + 8), _SCALE * 8), panel.title, fill=INK, font=font)
    _draw_points(draw, font, panel.points, to_x, to_y)


def _draw_points(draw: Any, font: Any, points: Sequence[Point], to_x: Any, to_y: Any) -> None:
    best = sorted((p for p in points if p.front), key=lambda p: p.x)
    draw.line([(to_x(p.x), to_y(p.y)) for p in best], fill=FRONT, width=_SCALE)
    boxes: list[tuple[float, ...]] = []
    for p in sorted(points, key=lambda p: -p.y):
        x, y, r = to_x(p.x), to_y(p.y), 4 * _SCALE
        colour = FRONT if p.front else POINT
        if p.spread:
            draw.line([(to_x(p.spread[0]), y), (to_x(p.spread[1]), y)], fill=colour, width=_SCALE)
        draw.ellipse([x - r, y - r, x + r, y + r], fill=colour)
        draw.text(
            free_place(draw, (x + 2.0 * r, y), p.name, font, boxes, 2.0 * _SCALE), p.name, fill=INK, font=font, anchor="lm"
        )


def _decades(values: Sequence[float]) -> list[float]:
    return [10.0**k for k in range(math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)) + 1e-9) + 1)]


def _steps(low: float, high: float) -> list[float]:
    """Round numbers between two values: fewer where they span more than a decade."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    digits = [1.0, 2.0, 3.0, 4.0, 5.0, 7.0] if high < 20.0 * low else [1.0, 3.0]
    return [x for k in decades for x in np.array(digits) * 10.0**k if low <= x <= high]
