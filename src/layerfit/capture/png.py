"""Read masks from PNG pictures."""

from pathlib import Path

import numpy as np

from ..documents import unreadable
from ..errors import InputError

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def read_png(path: Path) -> np.ndarray:
    """The first channel of a PNG of up to 16 bits a channel, from 0 to 1: (H, W), row 0 at the top. Raises `InputError`."""
    from skimage.io import imread

    try:
        with path.open("rb") as file:
            signature = file.read(len(SIGNATURE))
    except OSError as error:
        raise unreadable(path, error) from None
    if signature != SIGNATURE:  # the library would try every other kind of picture, and take what it is
        raise InputError(f"{path}: is not a PNG picture, whatever its name; save it as PNG or EXR")
    try:
        image = np.asarray(imread(path))
    except Exception as error:  # the library raises OSError, ValueError, SyntaxError and more, all for a file at fault
        raise InputError(f"{path}: is a damaged PNG picture ({error}); save it again") from None
    first = image if image.ndim == 2 else image[..., 0]
    return first.astype(np.float32) / (1 if image.dtype == bool else np.iinfo(image.dtype).max)
