"""A reference and its fit for a page that compares them: linear pixels in half floats, small enough to travel with the page."""

import dataclasses
import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from .pictures import SIGNED, top

PIXELS = 90_000
"""Of all the references of a page together: larger ones are shown smaller, by the mean of whole blocks."""


@dataclasses.dataclass(frozen=True)
class Pair:
    """A reference and what was fitted to it: linear images (H, W, 3), and where they are compared (H, W)."""

    name: str
    reference: np.ndarray
    fit: np.ndarray
    covered: np.ndarray
    white: float
    """The linear value that is shown as white."""


def comparisons(pairs: Sequence[Pair]) -> tuple[str, dict[str, bytes]]:
    """The HTML of some pairs and the data that belong to it."""
    block = _block(pairs)
    rows = [(f"pixels{k}", _smaller(pair, block)) for k, pair in enumerate(pairs)]
    html = "\n".join(_place(pair, name, block) for name, pair in rows)
    return html, {name: pixels(pair) for name, pair in rows}


def _block(pairs: Sequence[Pair]) -> int:
    """Side of the blocks of pixels that are shown as one."""
    total = sum(pair.covered.size for pair in pairs)
    return max(1, int(np.ceil(np.sqrt(total / PIXELS))))


def _smaller(pair: Pair, block: int) -> Pair:
    """The same pair with blocks of pixels for pixels; compared is a block of which every pixel is."""
    if block == 1:
        return pair
    height, width = (size // block for size in pair.covered.shape)
    blocks = lambda a: a[: height * block, : width * block].reshape(height, block, width, block, *a.shape[2:])  # noqa: E731
    mean = lambda a: np.mean(blocks(np.nan_to_num(a)), (1, 3))  # noqa: E731
    return dataclasses.replace(
        pair, reference=mean(pair.reference), fit=mean(pair.fit), covered=np.all(blocks(pair.covered), (1, 3))
    )


def pixels(pair: Pair) -> bytes:
    """Reference, fit and what is compared as float16: the upper bytes of all numbers, then the lower ones, which packs better."""
    numbers = np.concatenate([np.ravel(np.nan_to_num(a)) for a in (pair.reference, pair.fit, pair.covered)])
    largest = float(np.finfo(np.float16).max)
    halves = np.clip(numbers, -largest, largest).astype(">f2").view(np.uint8).reshape(-1, 2)
    return halves.T.tobytes()


def _place(pair: Pair, name: str, block: int) -> str:
    height, width = pair.covered.shape
    data: dict[str, Any] = {
        "name": pair.name,
        "width": width,
        "height": height,
        "white": pair.white,
        "scale": top(pair.fit, pair.reference, pair.white, pair.covered),
        "ramp": SIGNED.round(4).tolist(),
        "pixels": name,
    }
    smaller = f" (one pixel here for {block} by {block})" if block > 1 else ""
    return f'<h2>{escape(pair.name)}{smaller}</h2>\n<div data-compare="{escape(json.dumps(data))}"></div>'
