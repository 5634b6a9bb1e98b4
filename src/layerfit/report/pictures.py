"""Picture strips: images side by side at one exposure, with a false-colour difference."""

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..fit.metrics import display

Panel = tuple[str, np.ndarray]
"""A caption and an sRGB image (H, W, 3) in [0, 1]."""

_RAMP = (
    np.array([[0, 0, 4], [51, 13, 96], [120, 28, 109], [187, 55, 84], [237, 105, 37], [252, 180, 25], [252, 255, 164]]) / 255.0
)
"""Dark to bright through violet and orange: even in lightness, and readable without colour vision."""

_BACKGROUND, _INK = (24, 24, 27), (228, 228, 231)
_GAP, _CAPTION = 8, 22


def false_colour(values: np.ndarray) -> np.ndarray:
    """Values (H, W) in [0, 1] as colours."""
    x = np.clip(values, 0.0, 1.0) * (len(_RAMP) - 1)
    low = np.minimum(x.astype(int), len(_RAMP) - 2)
    t = (x - low)[..., None]
    return _RAMP[low] * (1.0 - t) + _RAMP[low + 1] * t


def difference(image: np.ndarray, reference: np.ndarray, white: float, covered: np.ndarray) -> tuple[np.ndarray, float]:
    """Absolute difference in false colour, and the part of white at the end of its scale."""
    error = np.where(covered, np.nan_to_num(np.mean(np.abs(image - reference), -1)), 0.0) / white
    top = max(float(np.quantile(error[covered], 0.99)), 1e-6)
    return np.where(covered[..., None], false_colour(error / top), 0.05), top


def compare(
    panels: Sequence[Panel], image: np.ndarray, reference: np.ndarray, white: float, covered: np.ndarray
) -> list[Panel]:
    """The panels with a difference of two linear images after them."""
    picture, top = difference(image, reference, white, covered)
    return [*panels, (f"difference, 0 to {100.0 * top:.2g} % of white", picture)]


def shown(caption: str, image: np.ndarray, white: float) -> Panel:
    """A linear image as a panel."""
    return caption, display(image, white)


def strip(rows: Sequence[Sequence[Panel]]) -> bytes:
    """Rows of panels as one PNG; small images are enlarged, pixel by pixel, to be seen."""
    height, width = rows[0][0][1].shape[:2]
    scale = max(1, round(256 / max(height, width)))
    height, width = height * scale, width * scale
    columns = max(len(row) for row in rows)
    canvas = Image.new("RGB", (columns * (width + _GAP) + _GAP, len(rows) * (height + _GAP + _CAPTION) + _GAP), _BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(13)
    for r, row in enumerate(rows):
        for c, (caption, image) in enumerate(row):
            x, y = _GAP + c * (width + _GAP), _GAP + r * (height + _GAP + _CAPTION)
            picture = Image.fromarray((np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8))
            canvas.paste(picture.resize((width, height), Image.Resampling.NEAREST), (x, y + _CAPTION))
            draw.text((x, y + 2), caption, fill=_INK, font=font)
    out = io.BytesIO()
    canvas.save(out, "PNG", optimize=True)
    return out.getvalue()


def convergence(rows: Sequence[tuple[float, str, float]]) -> bytes:
    """Error against time of a fit's steps, (seconds, stage, error), the error on a log scale, as a PNG."""
    width, height, left, low, top = 640, 220, 64, 28, 12
    canvas = Image.new("RGB", (width, height), _BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(12)
    time = np.array([row[0] for row in rows])
    cost = np.log10(np.maximum([row[2] for row in rows], 1e-30))
    stages = list(dict.fromkeys(row[1].split()[0] for row in rows))
    floor, ceiling = np.floor(cost.min()), np.ceil(cost.max() + 1e-9)
    to_x = lambda t: left + (t - time[0]) / max(time[-1] - time[0], 1e-9) * (width - left - 12)  # noqa: E731
    to_y = lambda c: top + (ceiling - c) / max(ceiling - floor, 1.0) * (height - top - low)  # noqa: E731
    for decade in np.arange(floor, ceiling + 1, max(1.0, np.ceil((ceiling - floor) / 6))):
        draw.line([(left, to_y(decade)), (width - 12, to_y(decade))], fill=(63, 63, 70))
        draw.text((8, to_y(decade) - 7), f"1e{decade:.0f}", fill=_INK, font=font)
    for (t, stage, _), c in zip(rows, cost, strict=True):
        i = stages.index(stage.split()[0])
        colour = tuple(int(v * 255) for v in false_colour(np.array([[0.35 + 0.6 * i / max(len(stages) - 1, 1)]]))[0, 0])
        y = to_y(c)
        draw.ellipse([to_x(t) - 2, y - 2, to_x(t) + 2, y + 2], fill=colour)
    draw.text((left, height - 20), f"{', '.join(stages)}; {time[-1] - time[0]:.2f} s from left to right", fill=_INK, font=font)
    out = io.BytesIO()
    canvas.save(out, "PNG", optimize=True)
    return out.getvalue()


def plain(image: np.ndarray, white: float) -> bytes:
    """A linear image as an sRGB PNG."""
    out = io.BytesIO()
    Image.fromarray((display(image, white) * 255.0 + 0.5).astype(np.uint8)).save(out, "PNG", optimize=True)
    return out.getvalue()
