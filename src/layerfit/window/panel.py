"""The sliders of a window: a bar for every number of a material, between its bounds, to drag or to move by keys."""

import dataclasses
from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .._fields import Param
from ..fit.parameters import Free, known_parameters, with_fixed
from ..stack import Stack

WIDTH = 340
"""All lengths are in pixels of the window."""
ROW, HEAD, GAP = 20, 26, 12
BAR = (132, 258)
"""Where bars begin and end."""
PAPER, LINE, INK, SOFT = (24, 24, 27), (63, 63, 70), (228, 228, 231), (161, 161, 170)
ACCENT = (251, 191, 36)
CHANNELS = ((239, 83, 80), (102, 187, 106), (79, 156, 249))
STEP, LEAP = 0.01, 0.1
"""Of a bar, for a key."""
HELP = (
    "drag: turn   yellow mark or Shift: light   wheel: nearer",
    "Up, Down: choose   Left, Right: move (Shift: more)",
    "Home: this one as it was   R: all   S: save as a preset",
    "comma, period: exposure   T: tone   M: shape   Esc: close",
)


@dataclasses.dataclass
class Bar:
    """One number of a parameter."""

    of: Free
    channel: int | None
    """0, 1 or 2 of a colour; None for a number of its own."""
    start: float
    value: float

    @property
    def place(self) -> float:
        """Where it is on its bar, 0 to 1, in the coordinate that a fit steps in."""
        return self._place(self.value)

    @property
    def start_place(self) -> float:
        return self._place(self.start)

    def _place(self, value: float) -> float:
        low, high = self._ends
        return float(np.clip((self.of.to_steps(value) - low) / (high - low), 0.0, 1.0))

    def move(self, place: float) -> None:
        """To a place on its bar, the nearest of it."""
        low, high = self._ends
        value = self.of.from_steps(low + min(max(place, 0.0), 1.0) * (high - low), np)
        self.value = float(np.clip(value, self.of.spec.lower, self.of.spec.upper))

    @property
    def _ends(self) -> tuple[float, float]:
        spec = self.of.spec
        return float(self.of.to_steps(spec.lower)), float(self.of.to_steps(spec.upper))

    @property
    def color(self) -> tuple[int, int, int]:
        return ACCENT if self.channel is None else CHANNELS[self.channel]


class Panel:
    """The bars of a material, of which one is chosen."""

    def __init__(self, stack: Stack):
        self.stack = stack
        self.bars = [
            bar for name, (k, field, spec) in known_parameters(stack).items() for bar in _bars(stack, name, k, field, spec)
        ]
        self.chosen, self.scrolled = 0, 0
        self.said = ""

    @property
    def material(self) -> Stack:
        """The material with the numbers of the bars."""
        values: dict[str, list[float]] = {}
        for bar in self.bars:
            values.setdefault(bar.of.name, []).append(bar.value)
        return with_fixed(self.stack, {name: value if len(value) > 1 else value[0] for name, value in values.items()}, "window")

    def choose(self, by: int, height: int) -> None:
        """The next bar, or the one before it; it comes in sight."""
        self.chosen = (self.chosen + by) % len(self.bars)
        y = next(y for y, bar in self._rows() if bar is self.bars[self.chosen])
        room = self.room(height)
        self.scrolled = max(min(self.scrolled, y - HEAD), y + ROW - room, 0)

    def scroll(self, by: int, height: int) -> None:
        """Down by so many pixels, as far as there is more."""
        self.scrolled = min(max(self.scrolled + by, 0), max(self._length - self.room(height), 0))

    def at(self, y: int) -> int | None:
        """Number of the bar at a height from the top."""
        for k, (top, _) in enumerate(self._rows()):
            if top <= y + self.scrolled < top + ROW:
                return k
        return None

    def drag(self, x: int) -> None:
        """The chosen bar to a place across the panel."""
        self.bars[self.chosen].move((x - BAR[0]) / (BAR[1] - BAR[0]))

    def reset(self, every: bool) -> None:
        """The chosen number as it was, or all of them."""
        for bar in self.bars if every else [self.bars[self.chosen]]:
            bar.value = bar.start

    def _rows(self) -> Iterator[tuple[int, Bar]]:
        """Bars with their heights from the top, unscrolled: below the name of their layer."""
        y, layer = 0, None
        for bar in self.bars:
            y += HEAD if bar.of.layer != layer else 0
            layer = bar.of.layer
            yield y, bar
            y += ROW

    @property
    def _length(self) -> int:
        return max(y for y, _ in self._rows()) + ROW + GAP

    @staticmethod
    def room(height: int) -> int:
        """What the lines of help leave to the bars."""
        return height - (len(HELP) + 1) * ROW - GAP

    def image(self, height: int, scale: float) -> Image.Image:
        """As it looks at a height, on a screen with so many pixels for one of the window."""
        picture = Image.new("RGB", (round(WIDTH * scale), round(height * scale)), PAPER)
        page = _Page(ImageDraw.Draw(picture), scale)
        for k, (top, bar) in enumerate(self._rows()):
            self._draw(page, top - self.scrolled, bar, k)
        page.box((0, self.room(height), WIDTH, height), PAPER)
        page.box((GAP, self.room(height), WIDTH - GAP, self.room(height)), LINE)
        for k, line in enumerate((*HELP, self.said)):
            page.text((GAP, self.room(height) + 6 + k * ROW), line, ACCENT if k == len(HELP) else SOFT)
        return picture

    def _draw(self, page: "_Page", y: int, bar: Bar, k: int) -> None:
        layer, _, field = bar.of.name.partition(".")
        if k == 0 or self.bars[k - 1].of.layer != bar.of.layer:
            page.text((GAP, y - HEAD + 6), layer, INK)
        if k == self.chosen:
            page.box((4, y, WIDTH - 4, y + ROW - 1), LINE)
        if not bar.channel:
            unit = "" if bar.of.spec.unit == "1" else f" [{bar.of.spec.unit}]"
            page.text((GAP + 6, y + 2), f"{field}{unit}", INK if k == self.chosen else SOFT)
        left, right, middle = *BAR, y + ROW // 2
        at = lambda place: left + place * (right - left)  # noqa: E731
        page.box((left, middle - 1, right, middle + 1), SOFT)
        page.box((left, middle - 1, at(bar.place), middle + 1), bar.color)
        page.box((at(bar.start_place), middle - 5, at(bar.start_place) + 1, middle + 5), INK)
        page.box((at(bar.place) - 3, middle - 6, at(bar.place) + 3, middle + 6), bar.color)
        page.text((BAR[1] + 10, y + 2), f"{bar.value:.4g}", INK)


def _bars(stack: Stack, name: str, k: int, field: str, spec: Param) -> list[Bar]:
    value = np.asarray(getattr((*stack.layers, stack.base)[k], field), float)
    of = Free(name, k, field, spec, ())
    return [Bar(of, channel if value.ndim else None, float(v), float(v)) for channel, v in enumerate(value.ravel())]


@dataclasses.dataclass
class _Page:
    """What is drawn on, in pixels of the window."""

    draw: ImageDraw.ImageDraw
    scale: float

    def __post_init__(self) -> None:
        self.font = ImageFont.load_default(12.5 * self.scale)

    def box(self, corners: tuple[float, ...], color: tuple[int, int, int]) -> None:
        self.draw.rectangle([self.scale * c for c in corners], fill=color)

    def text(self, at: tuple[float, float], text: str, color: tuple[int, int, int]) -> None:
        self.draw.text((self.scale * at[0], self.scale * at[1]), text, fill=color, font=self.font)
