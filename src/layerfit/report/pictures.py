"""Picture strips: images side by side at one exposure, with a false-colour difference."""

import dataclasses
import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..fit.metrics import display


@dataclasses.dataclass(frozen=True)
class Panel:
    """One picture of a strip."""

    caption: str
    image: np.ndarray
    """sRGB, (H, W, 3) in [0, 1]."""
    scale: str = ""
    """What the bright end of the false colours stands for; empty for a picture in its own colours."""
    signed: bool = False
    """Whether they have two ends, the other for as much below 0."""


_Font = ImageFont.FreeTypeFont | ImageFont.ImageFont  # the second where Pillow comes without FreeType

RAMP = (
    np.array([[0, 0, 4], [51, 13, 96], [120, 28, 109], [187, 55, 84], [237, 105, 37], [252, 180, 25], [252, 255, 164]]) / 255.0
)
"""Dark to bright through violet and orange: even in lightness, and readable without colour vision."""

SIGNED = (
    np.array([[158, 210, 255], [66, 146, 226], [27, 78, 138], [0, 0, 4], [138, 60, 18], [226, 122, 44], [255, 218, 160]])
    / 255.0
)
"""Light blue below 0, dark at 0, light orange above: the two are told apart without colour vision of red and green."""

BACKGROUND, INK, LINE = (24, 24, 27), (228, 228, 231), (63, 63, 70)
_NOT_COMPARED = 0.3
"""Grey of pixels that a difference leaves out: no colour of the ramp."""
_SIDE = 256
"""Small images are enlarged to about this many pixels, by a whole factor; larger ones than twice as many are shrunk."""
_GAP, _LINE_HEIGHT = 8, 22


def false_colour(values: np.ndarray, ramp: np.ndarray = RAMP) -> np.ndarray:
    """Values (H, W) in [0, 1] as colours."""
    x = np.clip(values, 0.0, 1.0) * (len(ramp) - 1)
    low = np.minimum(x.astype(int), len(ramp) - 2)
    t = (x - low)[..., None]
    return ramp[low] * (1.0 - t) + ramp[low + 1] * t


def difference(image: np.ndarray, reference: np.ndarray, white: float, covered: np.ndarray) -> Panel:
    """Difference of two linear images, the mean over the channels with its sign, in false colour: orange where the image is too bright, blue
    where it is too dark. Its scale ends at the 99th percentile of its size."""
    end = top(image, reference, white, covered)
    error = np.where(covered, np.nan_to_num(np.mean(image - reference, -1)), 0.0) / white
    picture = np.where(covered[..., None], false_colour(0.5 + 0.5 * error / end, SIGNED), _NOT_COMPARED)
    return Panel("difference (orange: too bright)", picture, f"{100.0 * end:.2g} % of white", signed=True)


def top(image: np.ndarray, reference: np.ndarray, white: float, covered: np.ndarray) -> float:
    """End of the scale of a difference, in parts of white: the same for all channels and for their mean."""
    return max(float(np.quantile(np.nan_to_num(np.mean(np.abs(image - reference), -1))[covered], 0.99)) / white, 1e-6)


def shown(caption: str, image: np.ndarray, white: float) -> Panel:
    """A linear image as a panel."""
    return Panel(caption, display(image, white))


def strip(rows: Sequence[Sequence[Panel]]) -> bytes:
    """Rows of panels as one PNG, with the scale of their false colours below."""
    height, width = rows[0][0].image.shape[:2]
    longest = max(height, width)
    factor = max(1.0, round(_SIDE / longest)) if longest <= 2 * _SIDE else 2 * _SIDE / longest
    height, width = round(height * factor), round(width * factor)
    columns = max(len(row) for row in rows)
    row_height = height + _GAP + 2 * _LINE_HEIGHT
    canvas = Image.new("RGB", (columns * (width + _GAP) + _GAP, len(rows) * row_height + _GAP), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(13)
    for r, row in enumerate(rows):
        for c, panel in enumerate(row):
            x, y = _GAP + c * (width + _GAP), _GAP + r * row_height
            draw.text((x, y + 2), _fitting(draw, panel.caption, width, font), fill=INK, font=font)
            picture = _fitted(panel.image, width, height)
            canvas.paste(picture, (x, y + _LINE_HEIGHT))
            if panel.scale:
                _draw_scale(canvas, draw, (x, y + _LINE_HEIGHT + height + 5), width, panel, font)
    return png(canvas)


def _fitted(image: np.ndarray, width: int, height: int) -> Image.Image:
    """An image in a box, as large as it can be without changing its shape."""
    picture = Image.fromarray((np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8))
    factor = min(width / picture.width, height / picture.height)
    how = Image.Resampling.NEAREST if factor >= 1.0 else Image.Resampling.LANCZOS
    return picture.resize((max(1, round(picture.width * factor)), max(1, round(picture.height * factor))), how)


def _fitting(draw: ImageDraw.ImageDraw, text: str, width: int, font: _Font) -> str:
    """As much of a caption as there is room for."""
    if draw.textlength(text, font=font) <= width:
        return text
    while text and draw.textlength(f"{text}...", font=font) > width:
        text = text[:-1]
    return f"{text}..."


def _draw_scale(
    canvas: Image.Image, draw: ImageDraw.ImageDraw, at: tuple[int, int], width: int, panel: Panel, font: _Font
) -> None:
    """The false colours from end to end, in a line, and the grey of what was not compared."""
    x, y = at
    bar = max(24, width // 3 - 20)
    ramp, start, end = (SIGNED, "-", f"+ {panel.scale}") if panel.signed else (RAMP, "0", panel.scale)
    colours = np.repeat(false_colour(np.linspace(0.0, 1.0, bar), ramp)[None], 10, 0)
    draw.text((x, y - 3), start, fill=INK, font=font)
    canvas.paste(Image.fromarray((colours * 255.0 + 0.5).astype(np.uint8)), (x + 12, y))
    draw.text((x + bar + 18, y - 3), end, fill=INK, font=font)
    text, grey = "left out", round(255 * _NOT_COMPARED)
    left = x + width - draw.textlength(text, font=font)
    if left - 16 > x + bar + 24 + draw.textlength(end, font=font):
        draw.rectangle((left - 15, y, left - 6, y + 9), fill=(grey, grey, grey))
        draw.text((left, y - 3), text, fill=INK, font=font)


def ticks(end: float) -> np.ndarray:
    """About six round numbers from 0 to `end`."""
    raw = end / 6.0
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= raw)
    return np.arange(0.0, end * (1.0 + 1e-9), step)


def plain(image: np.ndarray, white: float) -> bytes:
    """A linear image as an sRGB PNG."""
    return png(Image.fromarray((display(image, white) * 255.0 + 0.5).astype(np.uint8)))


def png(image: Image.Image) -> bytes:
    """The file of a picture."""
    out = io.BytesIO()
    image.save(out, "PNG", optimize=True)
    return out.getvalue()
