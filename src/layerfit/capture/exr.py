"""Read and write EXR pictures. The only file that imports OpenEXR.

A file is laid out in Python before the library opens it (`layout`): the library allocates what a header claims, whatever the
size of the file, and answers a cut-off or damaged block with text on the console and fewer parts. What passes is bounded in
memory, and what the library then still cannot decode is an error, never a part that is missing or black.
"""

import contextlib
import io
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from ..documents import whole
from ..errors import InputError
from .layout import Window, read_layout, shape

HALF_MAX = 65504.0
"""Largest finite half float."""

_STRUCTURE = {"channels", "chunkCount", "compression", "dataWindow", "displayWindow"}
_STRUCTURE |= {"lineOrder", "name", "preview", "tiles", "type"}


@dataclass(frozen=True)
class Part:
    """One part of a file; the only one may be unnamed. `channels` are full names, `types` says half, float or uint."""

    name: str
    kind: str
    compression: str
    data_window: Window
    channels: tuple[str, ...]
    types: dict[str, str]
    header: dict[str, Any]


@dataclass(frozen=True)
class Exr:
    """A picture in memory: float32 arrays (H, W) on the display window, row 0 at the top, black outside the data window.

    Channels of a multi-part file are named PART.CHANNEL, unless they start with the part's name already. `half` names those
    stored as half floats, `data_window` encloses the data windows of all parts, `header` holds the attributes that are plain
    values (of parts that differ, the first one's), and `left_out` says of each channel that was not read why.
    """

    path: Path
    channels: dict[str, np.ndarray]
    half: frozenset[str]
    display_window: Window
    data_window: Window
    parts: tuple[Part, ...]
    header: dict[str, Any]
    left_out: dict[str, str]


def read_exr(path: str | os.PathLike[str]) -> Exr:
    """Read all channels of a scan-line or tiled file, of one part or several.

    Raises `InputError` for what is not a whole, flat EXR of a size that can be borne (see `layout`).
    """
    path = Path(path)
    layouts = read_layout(path)
    with _captured() as said:
        try:
            parts = OpenEXR.File(str(path), separate_channels=True).parts
        except Exception as error:  # the bindings raise RuntimeError, ValueError, TypeError and more, all for a file at fault
            raise _undecodable(path, f"{error}; {said()}") from None
        if len(parts) != len(layouts):  # a part that fails is left out of the list, and only the console is told
            raise _undecodable(path, said())
    channels: dict[str, np.ndarray] = {}
    left_out: dict[str, str] = {}
    header: dict[str, Any] = {}
    read = []
    for part, layout in zip(parts, layouts, strict=True):
        types = {}
        for name in layout.channels:
            full = _full_name(layout.name, name) if len(layouts) > 1 else name
            if full in channels or full in left_out:
                raise InputError(f"{path}: two channels are both called {full}; write the parts under names of their own")
            # popped: the library's copy must not live beside all of ours
            pixels = part.channels.pop(name).pixels if name in part.channels else np.empty(0)
            if pixels.shape != shape(layout.data_window):
                raise _undecodable(path, f"channel {full} has no pixels")
            types[full] = {"float16": "half", "float32": "float", "uint32": "uint"}[pixels.dtype.name]
            if types[full] == "uint" and int(pixels.max()) > 2**24:
                left_out[full] = "whole numbers above 2^24, which float32 cannot hold"
            else:
                channels[full] = _placed(pixels, layout.data_window, layout.display_window)
        plain = _plain_attributes(part.header)
        header = plain | header
        read.append(Part(layout.name, layout.kind, layout.compression, layout.data_window, tuple(types), types, plain))
    x0, y0, x1, y1 = zip(*(part.data_window for part in read), strict=True)
    data_window = (min(x0), min(y0), max(x1), max(y1))
    half = frozenset(name for part in read for name, kind in part.types.items() if kind == "half")
    return Exr(path, channels, half, layouts[0].display_window, data_window, tuple(read), header, left_out)


def write_exr(
    path: str | os.PathLike[str],
    channels: Mapping[str, np.ndarray],
    half: bool = False,
    header: Mapping[str, Any] | None = None,
) -> None:
    """Write channels (H, W) as one ZIP-compressed part, whole or not at all: a reader never sees half a file.

    As half floats, finite values beyond the largest half are clipped to it. `header` holds further attributes, arrays or lists
    for vectors and matrices. Raises `InputError` where the file cannot be written.
    """
    path = Path(path)
    arrays = {name: np.asarray(a) for name, a in channels.items()}
    if not arrays or len(shapes := {a.shape for a in arrays.values()}) != 1 or len(size := shapes.pop()) != 2 or 0 in size:
        raise ValueError(f"channels must be arrays (H, W) of one shape, not {[(name, a.shape) for name, a in arrays.items()]}")
    pixels = {name: _to_half(a) if half else np.ascontiguousarray(a, np.float32) for name, a in arrays.items()}
    attributes = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    attributes |= {key: np.asarray(v, np.float32) if isinstance(v, list) else v for key, v in (header or {}).items()}
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written, {path.parent} is not a folder; create it or choose another one")
    with whole(path) as place:
        with _captured() as said:
            try:
                OpenEXR.File(attributes, pixels).write(str(place))
            except RuntimeError as error:
                reason = _one_line(f"{error}; {said()}".replace(str(place), path.name))
                raise InputError(f"{path}: cannot be written ({reason}); choose another folder") from None
        try:
            read_layout(place)
        except InputError:  # a full disk leaves blocks out, and the library says nothing
            raise InputError(f"{path}: cannot be written whole (is the disk full?); choose another folder") from None


def _to_half(values: np.ndarray) -> np.ndarray:
    clipped = np.where(np.isfinite(values), np.clip(values, -HALF_MAX, HALF_MAX), values)
    return np.ascontiguousarray(clipped, np.float16)


def _full_name(part: str, channel: str) -> str:
    return channel if channel == part or channel.startswith(part + ".") else f"{part}.{channel}"


def _placed(pixels: np.ndarray, data: Window, display: Window) -> np.ndarray:
    """The pixels of the data window as float32 on the display window: zeros around them, overscan cropped."""
    if data == display:
        return np.ascontiguousarray(pixels, np.float32)
    out = np.zeros(shape(display), np.float32)
    x0, y0 = max(data[0], display[0]), max(data[1], display[1])
    x1, y1 = min(data[2], display[2]) + 1, min(data[3], display[3]) + 1
    if x0 < x1 and y0 < y1:
        inside = pixels[y0 - data[1] : y1 - data[1], x0 - data[0] : x1 - data[0]]
        out[y0 - display[1] : y1 - display[1], x0 - display[0] : x1 - display[0]] = inside
    return out


def _plain_attributes(header: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes that are numbers, texts or lists of numbers, without the file's structure and the library's own types."""
    plain = {}
    for key, value in header.items():
        numbers = isinstance(value, tuple) and all(isinstance(v, int | float) for v in value)
        if key not in _STRUCTURE and (numbers or isinstance(value, int | float | str | np.ndarray)):
            plain[key] = value.tolist() if isinstance(value, np.ndarray) else value
    return plain


_console = threading.Lock()


@contextlib.contextmanager
def _captured() -> Iterator[Callable[[], str]]:
    """Hold back what the library prints while it reads or writes: from C++ to file descriptor 2, from Python to `sys.stdout`.

    Gives a function that returns the text so far. What was held while nothing failed came from other threads and is passed on.
    """
    with _console, tempfile.TemporaryFile() as held, contextlib.ExitStack() as undo:
        with contextlib.suppress(OSError):  # standard error may be closed: then nothing is printed
            saved = os.dup(2)
            undo.callback(os.close, saved)
            os.dup2(held.fileno(), 2)
            undo.callback(os.dup2, saved, 2)
        python = undo.enter_context(contextlib.redirect_stdout(io.StringIO()))

        def errors() -> str:
            return os.pread(held.fileno(), 2**16, 0).decode(errors="replace")

        yield lambda: errors() + python.getvalue()
        undo.close()
        for stream, text in ((sys.stdout, python.getvalue()), (sys.stderr, errors())):
            if text and stream is not None:
                stream.write(text)


def _one_line(text: str) -> str:
    """The library's words in one short line."""
    lines = dict.fromkeys(line.strip() for line in text.replace(";", "\n").splitlines())
    return "; ".join(line for line in lines if line)[:300] or "the library gives no reason"


def _undecodable(path: Path, reason: str) -> InputError:
    return InputError(
        f"{path}: the pixels cannot be decoded ({_one_line(reason)}); the file is damaged, copy or render it again"
    )
