"""A measured BRDF and a fit in planes of incidence: samples as dots, the model as lines, a panel for every incidence."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..capture.measured.data import MeasuredBrdf, direction
from .pictures import BACKGROUND, INK, LINE, png

ANGLES = 15.0, 30.0, 45.0, 60.0, 75.0
"""Incidences that are looked for [degrees]."""

NEAR_DEG, BESIDE_DEG = 5.0, 8.0
"""How far a sample may be from the incidence, and from the plane."""

FEWEST = 8
"""Samples that make a panel."""

DARKEST = 0.05
"""Part of the values that may lie below the scale: they are noise, or clipped."""

DECADES = 2.0, 7.0
"""That are shown, at least and at most."""

CHANNELS = (230, 97, 60), (90, 190, 120), (86, 160, 233)
_SCALE = 2  # drawn larger and reduced, which smooths the lines
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _LOW = 300, 260, 52, 10, 34, 40


@dataclass(frozen=True)
class Plane:
    """Samples near one plane of incidence, and the model in it."""

    incidence_deg: float
    outgoing_deg: np.ndarray
    """(n,), the mirror side positive."""
    measured: np.ndarray
    """(n, 3) [1/sr]."""
    at_deg: np.ndarray
    model: np.ndarray
    """(m, 3) [1/sr] at outgoing angles (m,)."""


def planes(brdf: MeasuredBrdf, model: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> list[Plane]:
    """The planes of incidence in which there are samples; `model` gives f (n, 3) of directions (n, 3)."""
    theta_i, theta_o = (np.degrees(np.arccos(np.clip(w[:, 2], 0.0, 1.0))) for w in (brdf.wi, brdf.wo))
    turn = np.arctan2(brdf.wo[:, 1], brdf.wo[:, 0]) - np.arctan2(brdf.wi[:, 1], brdf.wi[:, 0])
    signed = -theta_o * np.sign(np.cos(turn))
    inside = np.abs(np.sin(turn)) * np.minimum(theta_o, theta_i) < BESIDE_DEG * np.minimum(theta_o / 45.0, 1.0) + 1e-3
    found: list[Plane] = []
    for angle in ANGLES if brdf.isotropic else ():
        near = inside & (np.abs(theta_i - angle) < NEAR_DEG)
        if near.sum() < FEWEST:
            continue
        incidence = float(np.median(theta_i[near]))
        near &= np.abs(theta_i - incidence) < 0.5 * NEAR_DEG
        at = np.linspace(-85.0, 85.0, 341)
        wo = direction(np.radians(at), np.full_like(at, np.pi))
        wi = np.broadcast_to(direction(np.radians(incidence), np.array(0.0)), wo.shape)
        found.append(Plane(incidence, signed[near], brdf.f[near], at, model(wi, wo)))
    return found


def drawn(found: Sequence[Plane], name: str) -> bytes:
    """The panels side by side as a PNG, values on a logarithmic scale."""
    canvas = Image.new("RGB", (_SCALE * _WIDTH * len(found), _SCALE * _HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(12 * _SCALE)
    values = np.concatenate([plane.measured[plane.measured > 0.0] for plane in found])
    top = float(np.ceil(np.log10(values.max())))
    bottom = float(np.clip(np.floor(np.log10(np.quantile(values, DARKEST))), top - DECADES[1], top - DECADES[0]))
    for k, plane in enumerate(found):
        _panel(draw, font, k * _WIDTH, plane, (bottom, top))
    draw.text((_SCALE * _LEFT, _SCALE * 4), f"{name}: dots measured, lines fitted [1/sr]", fill=INK, font=font)
    return png(canvas.reduce(_SCALE))


def _panel(draw: ImageDraw.ImageDraw, font: Any, x0: int, plane: Plane, scale: tuple[float, float]) -> None:
    left, right, high, low = x0 + _LEFT, x0 + _WIDTH - _RIGHT, _TOP, _HEIGHT - _LOW
    to_x = lambda a: _SCALE * (left + (a + 90.0) / 180.0 * (right - left))  # noqa: E731
    bottom, top = scale
    to_y = lambda f: _SCALE * np.clip(high + (top - np.log10(np.maximum(f, 1e-30))) / (top - bottom) * (low - high), high, low)  # noqa: E731
    for decade in np.arange(bottom, top + 1.0):
        y = float(to_y(10.0**decade))
        draw.line([(_SCALE * left, y), (_SCALE * right, y)], fill=LINE, width=_SCALE)
        draw.text((_SCALE * (left - 6), y), f"{10.0**decade:g}", fill=INK, font=font, anchor="rm")
    for angle in (-60, -30, 0, 30, 60):
        draw.text((to_x(angle), _SCALE * (low + 10)), f"{angle}", fill=INK, font=font, anchor="mm")
    middle = _SCALE * (left + right) / 2
    draw.text(
        (middle, _SCALE * (_HEIGHT - 12)),
        f"outgoing, light from {plane.incidence_deg:.0f} deg",
        fill=INK,
        font=font,
        anchor="mm",
    )
    for c, colour in enumerate(CHANNELS):
        line = [*zip(to_x(plane.at_deg), to_y(plane.model[:, c]), strict=True)]
        draw.line(line, fill=colour, width=_SCALE, joint="curve")
        for x, y in zip(to_x(plane.outgoing_deg), to_y(plane.measured[:, c]), strict=True):
            draw.ellipse([x - 2 * _SCALE, y - 2 * _SCALE, x + 2 * _SCALE, y + 2 * _SCALE], outline=colour, width=_SCALE)
