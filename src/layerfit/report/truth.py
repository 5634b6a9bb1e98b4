"""The closed forms beside the random walk: a table for the terminal, a sentence, and curves in the plane of incidence."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .pictures import BACKGROUND, INK, LINE, png, ticks

if TYPE_CHECKING:
    from rich.console import Group

TRUST = 0.1
"""A form that is nearer to the walk than this can be trusted: twice what a fit allows for the misfit of the model."""

_COLOURS = {"precise": (86, 180, 233), "corrected": (240, 170, 40), "faithful": (214, 120, 180)}
"""Told apart on a dark ground without colour vision too (after Okabe and Ito)."""
_BAND = (110, 110, 118)
_SCALE = 2  # drawn larger and reduced, which smooths the lines
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _LOW = 400, 300, 58, 12, 58, 46
_HEADROOM = 1.6
"""How far above the walk the curves are shown, over its largest value: beyond that they are cut off."""


def table(document: Mapping[str, Any]) -> "Group":
    """Relative errors by incidence and in all, beside the noise of the walk."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    title = f"{document['name']}: relative error below the coat, {document['interface']} interface"
    made = Table(header_style="dim", box=None, pad_edge=False)
    for heading in ("incidence", "paths", "noise of the walk", *document["forms"]):
        made.add_column(heading, justify="right")
    rows = zip(document["incidence_deg"], document["paths"], document["noise_rel"], strict=True)
    for k, (angle, paths, noise) in enumerate(rows):
        errors = [form["error_rel"][k] for form in document["forms"].values()]
        made.add_row(f"{angle:g} deg", f"{paths}", percent(noise), *(_cell(error) for error in errors))
    for key in ("median", "p90"):
        made.add_row(key, "", "", *(_cell(form[key]) for form in document["forms"].values()))
    # A title of the table would be wrapped to its width.
    return Group(Text(title, "bold"), made)


def _cell(error: float | None) -> Any:
    from rich.text import Text

    return Text(percent(error), "" if error is None or not error > TRUST else "yellow")


def percent(value: float | None) -> str:
    """A share in as many digits as mean something; a channel without light has none."""
    if value is None or not np.isfinite(value):
        return "-"
    return f"{100.0 * value:.0f} %" if value >= 0.0995 else f"{100.0 * value:.2g} %"


def sentence(document: Mapping[str, Any]) -> str:
    """Where each form can be trusted."""
    angles = document["incidence_deg"]
    parts = [f"{name} is {_reach(angles, form['error_rel'])}" for name, form in document["forms"].items()]
    return f"Below the coat, {'; '.join(parts)}."


def _reach(angles: Sequence[float], errors: Sequence[float | None]) -> str:
    """The angles within `TRUST` in words, and how far off the others are."""
    known = [(angle, error) for angle, error in zip(angles, errors, strict=True) if error is not None and np.isfinite(error)]
    near = [pair for pair in known if pair[1] <= TRUST]
    far = [pair for pair in known if pair[1] > TRUST]
    if not near:
        low, high = (percent(pick(error for _, error in far)) for pick in (min, max))
        return f"not to be trusted: {low} off the walk" if low == high else f"not to be trusted: {low} to {high} off the walk"
    within = f"within {percent(max(error for _, error in near))} of the walk"
    if not far:
        return f"{within} at all angles"
    where = (
        f"up to {near[-1][0]:g} degrees" if near == known[: len(near)] else f"at {_listed(f'{a:g}' for a, _ in near)} degrees"
    )
    return f"{within} {where}, {_listed(f'{percent(error)} off at {angle:g}' for angle, error in far)}"


def _listed(words: Any) -> str:
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last


def curves(document: Mapping[str, Any]) -> bytes:
    """BRDF from below the coat against the outgoing angle, mean of the channels, a panel for every incidence, as a PNG."""
    planes = document["planes"]
    canvas = Image.new("RGB", (_SCALE * _WIDTH * len(planes), _SCALE * _HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(13 * _SCALE)
    for k, plane in enumerate(planes):
        _panel(draw, font, k * _WIDTH, plane)
    draw.rectangle((0, 0, canvas.width, _SCALE * (_TOP - 8)), fill=BACKGROUND)  # over what runs out of the panels
    for k, plane in enumerate(planes):
        title = f"BRDF [1/sr], light from {plane['incidence_deg']:g} degrees"
        draw.text((_SCALE * (k * _WIDTH + _LEFT), _SCALE * (_TOP - 18)), title, fill=INK, font=font, anchor="lm")
    x = _LEFT
    for name, colour in {"walk, with two sigmas": INK, **{name: _COLOURS[name] for name in document["forms"]}}.items():
        _line(draw, [(x, 17), (x + 22, 17)], colour)
        draw.text((_SCALE * (x + 28), _SCALE * 8), name, fill=INK, font=font)
        x += 50 + round(draw.textlength(name, font=font) / _SCALE)
    return png(canvas.reduce(_SCALE))


def _panel(draw: ImageDraw.ImageDraw, font: Any, x0: int, plane: Mapping[str, Any]) -> None:
    angles = np.array(plane["outgoing_deg"])
    truth, se = (
        np.mean(plane[key], -1) for key in ("walk", "walk_se")
    )  # paths are shared: the sigmas of channels do not cancel
    top = max(_HEADROOM * float(truth.max()), 1e-12)
    left, right, high, low = x0 + _LEFT, x0 + _WIDTH - _RIGHT, _TOP, _HEIGHT - _LOW
    to_x = lambda a: left + (a + 90.0) / 180.0 * (right - left)  # noqa: E731
    to_y = lambda f: low - f / top * (low - high)  # noqa: E731
    text = lambda x, y, words, anchor: draw.text((_SCALE * x, _SCALE * y), words, fill=INK, font=font, anchor=anchor)  # noqa: E731
    for tick in ticks(top):
        _line(draw, [(left, to_y(tick)), (right, to_y(tick))], LINE, 1)
        text(left - 6, to_y(tick), f"{tick:.3g}", "rm")
    for angle in (-60, -30, 0, 30, 60):
        _line(draw, [(to_x(angle), low), (to_x(angle), low + 4)], INK, 1)
        text(to_x(angle), low + 14, f"{angle}", "mm")
    text((left + right) / 2, _HEIGHT - 12, "outgoing angle, mirror side positive", "mm")
    edge = [*zip(to_x(angles), to_y(truth + 2.0 * se), strict=True)]
    edge += [*zip(to_x(angles), to_y(truth - 2.0 * se), strict=True)][::-1]
    draw.polygon([(_SCALE * x, _SCALE * y) for x, y in edge], fill=_BAND)
    _line(draw, [*zip(to_x(angles), to_y(truth), strict=True)], INK)
    for name, values in reversed(plane["forms"].items()):  # the nearest form on top
        _line(draw, [*zip(to_x(angles), to_y(np.mean(values, -1)), strict=True)], _COLOURS[name])


def _line(draw: ImageDraw.ImageDraw, points: Sequence[Any], colour: tuple[int, int, int], width: int = 3) -> None:
    draw.line([(_SCALE * x, _SCALE * y) for x, y in points], fill=colour, width=width, joint="curve")
