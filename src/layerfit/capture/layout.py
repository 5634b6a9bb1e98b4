"""How an EXR file is laid out, read in Python before the library opens it.

What passes here has a sound header, is bearable in memory, and has all of its blocks within the file.
"""

import math
import os
import stat
import struct
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from ..documents import EXR, unreadable
from ..errors import InputError

MAX_SIDE = 16384
"""Widest and highest picture that is read: beyond it a header is damaged more often than meant."""
MAX_SAMPLES = 2**28
"""Most numbers (pixels times channels, over all parts) that are read: 1 GiB as float32."""

_MAX_HEADER = 2**26  # bytes: an ID manifest can hold some MiB
_MAX_ENTRIES = 20_000  # attributes and channels, over all parts: a render writes fewer than 100 a part
_MAX_BLOCKS = 2**20
_OTHER_FORMATS = {b"\x89PNG": "PNG", b"\xff\xd8\xff": "JPEG", b"II*\0": "TIFF", b"MM\0*": "TIFF", b"#?RA": "Radiance HDR"}
_TILED, _DEEP, _MULTIPART = 0x200, 0x800, 0x1000
_KNOWN_FLAGS = _TILED | _DEEP | _MULTIPART | 0x400  # 0x400: names of up to 255 bytes
_SAMPLE_TYPES = (0, 1, 2)  # uint, half, float
_COMPRESSIONS = {  # number in the file: name, rows in a block
    0: ("none", 1),
    1: ("rle", 1),
    2: ("zips", 1),
    3: ("zip", 16),
    4: ("piz", 32),
    5: ("pxr24", 16),
    6: ("b44", 32),
    7: ("b44a", 32),
    8: ("dwaa", 32),
    9: ("dwab", 256),
    13: ("zstd", 1),
}
# The decoder of these (OpenJPH, as of OpenEXR 3.5.3) overruns its memory on damaged blocks, which ends the whole process.
_HTJ2K = (10, 11, 12)

Window = tuple[int, int, int, int]
"""First column, first row, last column, last row, all of them inside."""


def shape(window: Window) -> tuple[int, int]:
    """Rows and columns of a window."""
    x0, y0, x1, y1 = window
    return y1 - y0 + 1, x1 - x0 + 1


@dataclass(frozen=True)
class Layout:
    """What the header says of one part, checked."""

    name: str
    kind: str
    compression: str
    data_window: Window
    display_window: Window
    channels: tuple[str, ...]
    chunks: int
    leader: int
    """Bytes before a block's pixels: part, place and, last, size."""


class _Source:
    """An open file with a cursor; reading past its end is an error that says so."""

    def __init__(self, path: Path, fd: int):
        self.path, self.fd, self.at, self.entries = path, fd, 0, 0
        self.size = os.fstat(fd).st_size

    def take(self, count: int) -> bytes:
        data = os.pread(self.fd, count, self.at) if 0 <= count <= self.size - self.at else b""
        if len(data) != count:
            raise self.cut_off(f"byte {self.size} is the last one and the header goes on")
        self.at += count
        return data

    def name(self) -> str:
        """The text up to the next zero byte, which is at most 255 bytes away."""
        raw, zero, _ = os.pread(self.fd, 256, self.at).partition(b"\0")
        if not zero:
            raise self.cut_off("the header ends within a name") if len(raw) < 256 else self.damaged("a name has no end")
        self.at += len(raw) + 1
        return self.text(raw)

    def text(self, raw: bytes) -> str:
        try:
            text = raw.decode()
        except UnicodeDecodeError:
            raise self.damaged(f"the name {raw[:40]!r} is not UTF-8") from None
        if not text.isprintable():
            raise self.damaged(f"the name {text[:40]!r} holds control characters")
        return text

    def count_entry(self) -> None:
        self.entries += 1
        if self.entries > _MAX_ENTRIES:
            raise self.damaged(f"it has more than {_MAX_ENTRIES} attributes and channels")

    def damaged(self, why: str) -> InputError:
        return InputError(f"{self.path}: the EXR file is damaged: {why}; copy or render it again")

    def cut_off(self, why: str) -> InputError:
        return InputError(f"{self.path}: the EXR file is cut off or was not finished: {why}; copy or render it again")


def read_layout(path: Path) -> list[Layout]:
    """The parts of a file whose header is sound, whose size is bearable and whose blocks all lie within the file."""
    try:
        str(path).encode()
        fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # not to wait for the other end of a pipe
    except OSError as error:
        raise unreadable(path, error) from None
    except ValueError:
        raise InputError(f"{str(path)!a}: the name holds bytes that are not UTF-8, or zeros; rename the file") from None
    try:
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            what = "a directory" if stat.S_ISDIR(os.fstat(fd).st_mode) else "not a file"
            raise InputError(f"{path}: is {what}; give the name of an EXR file")
        source = _Source(path, fd)
        layouts = _read_headers(source)
        _check_blocks(source, layouts)
    finally:
        os.close(fd)
    return layouts


def _read_headers(source: _Source) -> list[Layout]:
    start = os.pread(source.fd, 4, 0)
    if start != EXR:
        known = [f"a {name} picture" for magic, name in _OTHER_FORMATS.items() if start.startswith(magic)]
        what = known[0] if known else "not an EXR file" if source.size else "empty"
        raise InputError(f"{source.path}: is {what}; save the render as OpenEXR (linear, half or float)")
    source.at = 4
    (version,) = struct.unpack("<I", source.take(4))
    if version & 0xFF != 2 or version & ~0xFF & ~_KNOWN_FLAGS:
        raise source.damaged(f"version and flags are {version:#x}")
    if version & _DEEP:
        raise _deep(source.path)
    layouts = [_read_part(source, version)]
    if version & _MULTIPART:
        while os.pread(source.fd, 1, source.at) != b"\0":
            layouts.append(_read_part(source, version))
        source.take(1)
        if any(part.display_window != layouts[0].display_window for part in layouts):
            raise source.damaged("its parts have different display windows")
        if len({part.name for part in layouts}) != len(layouts):
            raise source.damaged("two parts have the same name")
    for count in ("data_window", "display_window"):
        samples = sum(math.prod(shape(getattr(part, count))) * len(part.channels) for part in layouts)
        if samples > MAX_SAMPLES:
            raise InputError(
                f"{source.path}: claims {samples} numbers (pixels times channels), more than the {MAX_SAMPLES} that are read; "
                "save a smaller picture, or only the channels that are needed"
            )
    return layouts


def _deep(path: Path) -> InputError:
    return InputError(f"{path}: holds deep data (several samples a pixel); flatten it in the renderer or the compositor")


def _read_part(source: _Source, version: int) -> Layout:
    found: dict[str, tuple[str, bytes]] = {}
    while name := source.name():
        kind = source.name()
        (size,) = struct.unpack("<i", source.take(4))
        source.count_entry()
        if name in found:
            raise source.damaged(f"the attribute {name} is there twice")
        if size < 0 or source.at + size > _MAX_HEADER:
            raise source.damaged(f"the attribute {name} claims {size} bytes")
        found[name] = kind, source.take(size)

    def attribute(name: str, kind: str, form: str) -> tuple:
        got, raw = found.get(name, ("", b""))
        if got != kind or len(raw) != struct.calcsize(form):
            raise source.damaged(f"the attribute {name} is missing or is no {kind}")
        return struct.unpack(form, raw)

    part_name, part_kind = (source.text(found[key][1]) if key in found else "" for key in ("name", "type"))
    if part_kind.startswith("deep"):
        raise _deep(source.path)
    tiled = part_kind == "tiledimage" if version & _MULTIPART else bool(version & _TILED)
    data, display = attribute("dataWindow", "box2i", "<4i"), attribute("displayWindow", "box2i", "<4i")
    for window in (data, display):
        height, width = shape(window)
        if height < 1 or width < 1:
            raise source.damaged(f"a window goes from {window[:2]} to {window[2:]}")
        if height > MAX_SIDE or width > MAX_SIDE:
            raise InputError(
                f"{source.path}: claims {width} x {height} pixels, more than the {MAX_SIDE} x {MAX_SIDE} that are read; "
                "save a smaller picture, or copy the file again if it is not that large"
            )
    (number,) = attribute("compression", "compression", "<B")
    if number in _HTJ2K:
        raise InputError(f"{source.path}: is compressed with HTJ2K, which is not read; save the render with ZIP compression")
    if number not in _COMPRESSIONS:
        raise source.damaged(f"there is no compression {number}")
    compression, rows = _COMPRESSIONS[number]
    channels = _read_channels(source, found.get("channels", ("", b"")))
    chunks = -(-shape(data)[0] // rows)
    if tiled:
        tile_width, tile_height, mode = attribute("tiles", "tiledesc", "<IIB")
        if not (1 <= tile_width <= MAX_SIDE and 1 <= tile_height <= MAX_SIDE) or mode & 0xF > 2 or mode >> 4 > 1:
            raise source.damaged(f"there are no tiles of {tile_width} x {tile_height}, mode {mode}")
        chunks = _tile_count(shape(data), (tile_height, tile_width), mode)
    if version & _MULTIPART and attribute("chunkCount", "int", "<i")[0] != chunks:
        raise source.damaged(f"the part {part_name!r} does not have {chunks} blocks")
    leader = (20 if tiled else 8) + (4 if version & _MULTIPART else 0)
    return Layout(part_name, "tiled" if tiled else "scanline", compression, data, display, channels, chunks, leader)


def _read_channels(source: _Source, attribute: tuple[str, bytes]) -> tuple[str, ...]:
    kind, raw = attribute
    names: dict[str, None] = {}
    at = 0
    if kind != "chlist":
        raise source.damaged("it has no list of channels")
    while (end := raw.find(b"\0", at)) > at:
        text = source.text(raw[at:end])
        source.count_entry()
        if len(raw) < end + 17:
            raise source.damaged("its list of channels does not end")
        sample, x_step, y_step = struct.unpack_from("<i4xii", raw, end + 1)
        if (x_step, y_step) != (1, 1) and min(x_step, y_step) > 0:
            raise InputError(
                f"{source.path}: the channel {text} is stored for one in {x_step} columns and {y_step} rows only, as luminance "
                "and chroma are; save the render as RGB"
            )
        if sample not in _SAMPLE_TYPES or min(x_step, y_step) < 1 or text in names:
            raise source.damaged(f"the channel {text} is there twice or has no known type")
        names[text] = None
        at = end + 17
    if raw[at:] != b"\0" or not names:
        raise source.damaged("its list of channels is empty or does not end")
    return tuple(names)


def _tile_count(size: tuple[int, int], tile: tuple[int, int], mode: int) -> int:
    """Number of tiles over all levels: one level (mode 0), halved in both directions at once (1), or in each on its own (2)."""

    def tiles(side: int, of: int, level: int) -> int:
        half = -(-side // 2**level) if mode >> 4 else side // 2**level
        return -(-max(1, half) // of)

    def levels(side: int) -> int:
        return 1 + ((side - 1).bit_length() if mode >> 4 else side.bit_length() - 1)

    match mode & 0xF:
        case 0:
            return tiles(size[0], tile[0], 0) * tiles(size[1], tile[1], 0)
        case 1:
            return sum(tiles(size[0], tile[0], k) * tiles(size[1], tile[1], k) for k in range(levels(max(size))))
        case _:
            down, across = (sum(tiles(side, of, k) for k in range(levels(side))) for side, of in zip(size, tile, strict=True))
            return down * across


def _check_blocks(source: _Source, layouts: list[Layout]) -> None:
    """Every block that the table of offsets names must lie behind the table and within the file."""
    blocks = sum(part.chunks for part in layouts)
    if blocks > _MAX_BLOCKS:
        raise source.damaged(f"it claims {blocks} blocks")
    table = iter(np.frombuffer(source.take(8 * blocks), "<u8").tolist())
    for part in layouts:
        for number, offset in enumerate(islice(table, part.chunks), 1):
            where = f"block {number} of {part.chunks}" + (f" of part {part.name}" if part.name else "")
            if offset == 0:
                raise source.cut_off(f"{where} was not written")
            if not source.at <= offset <= source.size - part.leader:
                raise source.cut_off(f"{where} should be at byte {offset} of {source.size}")
            (size,) = struct.unpack("<i", os.pread(source.fd, 4, offset + part.leader - 4))
            if size < 0:
                raise source.damaged(f"{where} claims {size} bytes")
            if size > source.size - part.leader - offset:
                raise source.cut_off(f"{where} goes on to byte {offset + part.leader + size} of {source.size}")
