"""Reading and writing EXR: what is whole comes back exactly, what is not is one clear error, and nothing else is printed."""

import contextlib
import os
import random
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from layerfit.capture import layout
from layerfit.capture.exr import read_exr, write_exr
from layerfit.capture.layout import MAX_SAMPLES
from layerfit.errors import InputError

HEIGHT, WIDTH = 20, 30
LOSSLESS = ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "ZSTD"]
LOSSY = ["PXR24", "B44", "B44A", "DWAA", "DWAB"]
HTJ2K = ["HTJ2K256", "HTJ2K32", "LJ2K"]


def pixels(seed: int = 0, height: int = HEIGHT, width: int = WIDTH, dtype: str = "f4") -> np.ndarray:
    return (3 * np.random.default_rng(seed).random((height, width))).astype(dtype)


def window(x0: int, y0: int, x1: int, y1: int) -> tuple[np.ndarray, np.ndarray]:
    return np.array([x0, y0], "i4"), np.array([x1, y1], "i4")


def tiles(side: int) -> OpenEXR.TileDescription:
    description = OpenEXR.TileDescription()
    description.xSize = description.ySize = side
    return description


def multipart(path: Path) -> dict[str, np.ndarray]:
    """A file as Karma writes it, tiled in one part; gives what is in it under the full names."""
    content = {"C.R": pixels(1), "C.G": pixels(2), "N.X": pixels(3), "N.Y": pixels(4), "Z": pixels(5)}
    OpenEXR.File(
        [
            OpenEXR.Part({}, {"R": content["C.R"], "G": content["C.G"]}, "C"),
            OpenEXR.Part({}, {"N.X": content["N.X"], "N.Y": content["N.Y"]}, "N"),
            OpenEXR.Part({"type": OpenEXR.tiledimage, "tiles": tiles(8)}, {"Z": content["Z"]}, "Z"),
        ]
    ).write(str(path))
    return content


def attribute(name: str, kind: str, value: bytes) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def header(
    width: int = WIDTH,
    height: int = HEIGHT,
    display: tuple[int, int] | None = None,
    channels: bytes = b"R\0" + struct.pack("<iBxxxii", 2, 0, 1, 1) + b"\0",
    compression: int = 0,
    flags: int = 0,
    extra: bytes = b"",
) -> bytes:
    """An EXR header written by hand, for what no writer would write."""
    columns, rows = display or (width, height)
    return b"".join(
        [
            b"\x76\x2f\x31\x01" + struct.pack("<I", 2 | flags),
            attribute("channels", "chlist", channels),
            attribute("compression", "compression", bytes([compression])),
            attribute("dataWindow", "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1)),
            attribute("displayWindow", "box2i", struct.pack("<4i", 0, 0, columns - 1, rows - 1)),
            attribute("lineOrder", "lineOrder", b"\0"),
            attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
            extra + b"\0",
        ]
    )


def with_blocks(head: bytes, blocks: list[bytes]) -> bytes:
    at = len(head) + 8 * len(blocks)
    table = b""
    for block in blocks:
        table += struct.pack("<Q", at)
        at += len(block)
    return head + table + b"".join(blocks)


@contextlib.contextmanager
def unprivileged() -> Iterator[None]:
    """As somebody whom file permissions hold, also where the tests run as root."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)


def test_float_round_trip(tmp_path: Path):
    content = {"R": pixels(1), "N.X": -pixels(2), "RGB": pixels(3)}
    content["R"][0, :3] = np.nan, np.inf, 1e-40
    attributes = {"chromaticities": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767), "comments": "x"}
    matrix = np.arange(16, dtype="f4").reshape(4, 4)
    write_exr(tmp_path / "é.exr", content, header=attributes | {"worldToCamera": matrix})
    exr = read_exr(str(tmp_path / "é.exr"))
    assert exr.channels.keys() == content.keys()
    for name, values in content.items():
        assert exr.channels[name].dtype == np.float32
        np.testing.assert_array_equal(exr.channels[name], values)
    assert exr.half == frozenset()
    assert exr.display_window == exr.data_window == (0, 0, WIDTH - 1, HEIGHT - 1)
    assert exr.header["comments"] == "x"
    assert exr.header["worldToCamera"] == matrix.tolist()
    np.testing.assert_allclose(exr.header["chromaticities"], attributes["chromaticities"], rtol=1e-6)
    write_exr(tmp_path / "again.exr", exr.channels, header=exr.header)
    assert read_exr(tmp_path / "again.exr").header == exr.header


def test_half_round_trip_clips_and_keeps_what_is_not_finite(tmp_path: Path):
    values = pixels()
    values[0, :4] = 1e6, -1e6, np.inf, np.nan
    write_exr(tmp_path / "h.exr", {"R": values, "A": np.ones((HEIGHT, WIDTH))}, half=True)
    exr = read_exr(tmp_path / "h.exr")
    assert exr.half == {"R", "A"}
    np.testing.assert_array_equal(exr.channels["R"][0, :4], [65504, -65504, np.inf, np.nan])
    np.testing.assert_allclose(exr.channels["R"][1:], values[1:], rtol=2**-11)


def test_mixed_types_are_told_apart(tmp_path: Path):
    numbers = np.arange(HEIGHT * WIDTH, dtype="u4").reshape(HEIGHT, WIDTH)
    content = {"R": pixels(dtype="f2"), "N.X": pixels(), "id": numbers, "hash": numbers + np.uint32(2**31)}
    OpenEXR.File({}, content).write(str(tmp_path / "m.exr"))
    exr = read_exr(tmp_path / "m.exr")
    assert exr.half == {"R"}
    assert exr.parts[0].types == {"R": "half", "N.X": "float", "id": "uint", "hash": "uint"}
    np.testing.assert_array_equal(exr.channels["id"], numbers)
    assert "hash" not in exr.channels
    assert "2^24" in exr.left_out["hash"]


def test_parts_prefix_their_channels_once(tmp_path: Path):
    content = multipart(tmp_path / "k.exr")
    exr = read_exr(tmp_path / "k.exr")
    assert exr.channels.keys() == content.keys()
    for name, values in content.items():
        np.testing.assert_array_equal(exr.channels[name], values)
    assert [(part.name, part.kind, part.channels) for part in exr.parts] == [
        ("C", "scanline", ("C.G", "C.R")),
        ("N", "scanline", ("N.X", "N.Y")),
        ("Z", "tiled", ("Z",)),
    ]


def test_the_name_of_a_single_part_is_no_prefix(tmp_path: Path):
    """OpenEXR 3.3 writes one, "Part0"."""
    OpenEXR.File({"name": "Part0"}, {"R": pixels()}).write(str(tmp_path / "s.exr"))
    exr = read_exr(tmp_path / "s.exr")
    assert exr.parts[0].name == "Part0"
    assert list(exr.channels) == ["R"]


def test_parts_that_make_one_name_are_refused(tmp_path: Path):
    OpenEXR.File([OpenEXR.Part({}, {"b.R": pixels()}, "a"), OpenEXR.Part({}, {"R": pixels()}, "a.b")]).write(
        str(tmp_path / "d.exr")
    )
    with pytest.raises(InputError, match=r"d\.exr: two channels are both called a\.b\.R"):
        read_exr(tmp_path / "d.exr")


@pytest.mark.parametrize("x0", [-5, 0, 7, 100])
@pytest.mark.parametrize("y0", [-50, -3, 4])
@pytest.mark.parametrize("dtype", ["f2", "f4"])
def test_data_window_lands_on_the_display_window(tmp_path: Path, x0: int, y0: int, dtype: str):
    values = pixels(dtype=dtype)
    display = (-2, 1, 36, 15)
    windows = {"dataWindow": window(x0, y0, x0 + WIDTH - 1, y0 + HEIGHT - 1), "displayWindow": window(*display)}
    OpenEXR.File(windows, {"R": values}).write(str(tmp_path / "w.exr"))
    exr = read_exr(tmp_path / "w.exr")
    expected = np.zeros((15, 39), "f4")
    for row in range(15):
        for column in range(39):
            y, x = row + display[1] - y0, column + display[0] - x0
            if 0 <= y < HEIGHT and 0 <= x < WIDTH:
                expected[row, column] = values[y, x]
    np.testing.assert_array_equal(exr.channels["R"], expected)
    assert exr.display_window == display
    assert exr.data_window == (x0, y0, x0 + WIDTH - 1, y0 + HEIGHT - 1)


@pytest.mark.parametrize("name", LOSSLESS + LOSSY)
@pytest.mark.parametrize("height", [1, 31, 300])
def test_compressions(tmp_path: Path, name: str, height: int):
    if not hasattr(OpenEXR, f"{name}_COMPRESSION"):
        pytest.skip(f"this OpenEXR has no {name}")
    values = np.add.outer(np.linspace(0, 3, height), np.linspace(0, 1, 9)).astype("f2")
    OpenEXR.File({"compression": getattr(OpenEXR, f"{name}_COMPRESSION")}, {"R": values}).write(str(tmp_path / "c.exr"))
    exr = read_exr(tmp_path / "c.exr")
    np.testing.assert_allclose(exr.channels["R"], values, rtol=0, atol=0 if name in LOSSLESS else 0.2)
    assert exr.parts[0].compression == ("none" if name == "NO" else name.lower())


@pytest.mark.parametrize("name", HTJ2K)
def test_compressions_with_an_unsafe_decoder_are_refused(tmp_path: Path, name: str):
    """One damaged block of LJ2K ended the whole process ("malloc(): invalid size"), others printed to standard output."""
    if not hasattr(OpenEXR, f"{name}_COMPRESSION"):
        pytest.skip(f"this OpenEXR has no {name}")
    OpenEXR.File({"compression": getattr(OpenEXR, f"{name}_COMPRESSION")}, {"R": pixels()}).write(str(tmp_path / "j.exr"))
    with pytest.raises(InputError, match=r"j\.exr: is compressed with HTJ2K, .* ZIP"):
        read_exr(tmp_path / "j.exr")


def levels(size: tuple[int, int], mode: int) -> list[tuple[int, int, int, int]]:
    """Height, width and numbers of the levels of a tiled file, by going on halving."""

    def halvings(side: int) -> list[int]:
        sides = [side]
        while sides[-1] > 1:
            sides.append(-(-sides[-1] // 2) if mode >> 4 else sides[-1] // 2)
        return sides

    down, across = halvings(size[0]), halvings(size[1])
    if mode & 0xF == 0:
        return [(*size, 0, 0)]
    if mode & 0xF == 2:
        return [(h, w, i, j) for i, h in enumerate(down) for j, w in enumerate(across)]
    count = max(len(down), len(across))
    both = zip(down + [1] * (count - len(down)), across + [1] * (count - len(across)), strict=True)
    return [(h, w, k, k) for k, (h, w) in enumerate(both)]


@pytest.mark.parametrize("mode", [0, 1, 2, 0x10, 0x11, 0x12])
@pytest.mark.parametrize("size", [(1, 1), (5, 7), (33, 17), (100, 3)])
def test_tiles_of_all_levels_are_counted(tmp_path: Path, mode: int, size: tuple[int, int]):
    height, width, side = *size, 8
    head = header(width, height, flags=0x200, extra=attribute("tiles", "tiledesc", struct.pack("<IIB", side, side, mode)))
    blocks = []
    for h, w, row, column in levels(size, mode):
        image = np.arange(h * w, dtype="<f4").reshape(h, w) + 1000 * row
        for y in range(0, h, side):
            for x in range(0, w, side):
                data = image[y : y + side, x : x + side].tobytes()
                blocks.append(struct.pack("<5i", x // side, y // side, column, row, len(data)) + data)
    (tmp_path / "t.exr").write_bytes(with_blocks(head, blocks))
    assert layout._tile_count(size, (side, side), mode) == len(blocks)
    np.testing.assert_array_equal(read_exr(tmp_path / "t.exr").channels["R"], np.arange(height * width).reshape(size))


def several(path: Path, compression: OpenEXR.Compression = OpenEXR.ZIP_COMPRESSION) -> None:
    OpenEXR.File({"compression": compression}, {"R": pixels(height=40), "G": pixels(height=40)}).write(str(path))


@pytest.mark.parametrize("write", [several, multipart])
def test_truncation_is_an_error_at_every_length(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], write: Callable[[Path], object]
):
    whole, cut = tmp_path / "whole.exr", tmp_path / "cut.exr"
    write(whole)
    read_exr(whole)
    data = whole.read_bytes()
    lengths = [*range(1, 900, 3), *range(900, len(data), 97), len(data) - 1]
    for length in lengths:
        cut.write_bytes(data[:length])
        with pytest.raises(InputError, match=r"cut\.exr: (the EXR file is cut off or was not finished: |is not an EXR)"):
            read_exr(cut)
    assert capfd.readouterr() == ("", "")


def test_unfinished_file_says_so(tmp_path: Path):
    head = header(height=3)
    (tmp_path / "u.exr").write_bytes(head + struct.pack("<3Q", 0, 0, 0) + bytes(4000))
    with pytest.raises(InputError, match=r"u\.exr: .* block 1 of 3 was not written"):
        read_exr(tmp_path / "u.exr")


@pytest.mark.parametrize("name", ["ZIP", "RLE", "PXR24", "DWAA"])
def test_damaged_block_is_one_error_and_no_text(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str):
    path = tmp_path / "b.exr"
    OpenEXR.File({"compression": getattr(OpenEXR, f"{name}_COMPRESSION")}, {"R": np.ones((64, 64), "f4")}).write(str(path))
    data = bytearray(path.read_bytes())
    data[-12:] = bytes(range(200, 212))
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"b\.exr: the pixels cannot be decoded \(.*\); the file is damaged") as error:
        read_exr(path)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_damaged_part_is_not_left_out_in_silence(tmp_path: Path):
    multipart(tmp_path / "p.exr")
    data = (tmp_path / "p.exr").read_bytes()
    data = data.replace(struct.pack("<2i", 1, 0), struct.pack("<2i", 2, 0), 1)  # part 1's first block says that it is part 2's
    (tmp_path / "p.exr").write_bytes(data)
    with pytest.raises(InputError, match="cannot be decoded"):
        read_exr(tmp_path / "p.exr")


CHANNEL = struct.pack("<iBxxxii", 2, 0, 1, 1)
HOSTILE = {
    "claims 100000 x 100000": (header(100_000, 100_000), "claims 100000 x 100000 pixels, more than the 16384 x 16384"),
    "claims all of 32 bits": (header(2**31 - 1, 2**31 - 1), "claims 2147483647 x 2147483647 pixels"),
    "display window": (header(display=(100_000, 100_000)), "claims 100000 x 100000 pixels"),
    "samples": (header(16384, 16384, channels=b"R\0" + CHANNEL + b"S\0" + CHANNEL + b"\0"), f"more than the {MAX_SAMPLES}"),
    "samples of the display": (
        header(channels=b"R\0" + CHANNEL + b"S\0" + CHANNEL + b"\0", display=(16384, 16384)),
        "claims 5",
    ),
    "empty window": (header(0, 5), "a window goes from"),
    "no blocks": (header(16384, 16384), "cut off or was not finished"),
    "a million tiles": (
        header(16384, 16384, flags=0x200, extra=attribute("tiles", "tiledesc", struct.pack("<IIB", 1, 1, 0))),
        "claims 268435456 blocks",
    ),
    "no tile size": (header(flags=0x200, extra=attribute("tiles", "tiledesc", struct.pack("<IIB", 0, 8, 0))), "no tiles of 0"),
    "no tiles": (header(flags=0x200), "the attribute tiles is missing"),
    "deep flag": (header(flags=0x800), "holds deep data"),
    "deep type": (header(extra=attribute("type", "string", b"deepscanline")), "holds deep data"),
    "version": (b"\x76\x2f\x31\x01" + struct.pack("<I", 3) + header()[8:], "version and flags are 0x3"),
    "flags": (header(flags=0x8000), "version and flags are 0x8002"),
    "compression": (header(compression=99), "there is no compression 99"),
    "attribute twice": (header(extra=attribute("dataWindow", "box2i", bytes(16))), "dataWindow is there twice"),
    "negative size": (header(extra=b"x\0string\0" + struct.pack("<i", -1)), "claims -1 bytes"),
    "size of 2 GB": (header(extra=b"x\0string\0" + struct.pack("<i", 2**31 - 1)), "claims 2147483647 bytes"),
    "name without end": (header()[:8] + b"x" * 400, "a name has no end"),
    "name in no code": (header(extra=attribute("x", "int", bytes(4)).replace(b"x", b"\xff", 1)), "is not UTF-8"),
    "escape codes": (header(channels=b"\x1b[31mR\0" + CHANNEL + b"\0"), "control characters"),
    "no channels": (header(channels=b"\0"), "list of channels is empty"),
    "channels cut off": (header(channels=b"R\0" + CHANNEL[:9]), "list of channels does not end"),
    "channel twice": (header(channels=(b"R\0" + CHANNEL) * 2 + b"\0"), "channel R is there twice"),
    "channel of no type": (header(channels=b"R\0" + struct.pack("<iBxxxii", 7, 0, 1, 1) + b"\0"), "has no known type"),
    "30000 channels": (header(channels=b"".join(b"%d\0" % i + CHANNEL for i in range(30_000)) + b"\0"), "more than 20000"),
    "subsampled": (
        header(channels=b"RY\0" + struct.pack("<iBxxxii", 2, 0, 2, 2) + b"\0"),
        "channel RY .* save the render as RGB",
    ),
    "sampled never": (header(channels=b"R\0" + struct.pack("<iBxxxii", 2, 0, 0, 1) + b"\0"), "channel R"),
    "no part": (header()[:4] + struct.pack("<I", 0x1002) + b"\0" * 20, "attribute dataWindow is missing"),
    "chunk count": (
        header(flags=0x1000, extra=attribute("chunkCount", "int", struct.pack("<i", 2**30))) + b"\0",
        "does not have 20 blocks",
    ),
    "text": (b"This is not a picture.", "is not an EXR file; save the render as OpenEXR"),
    "PNG": (b"\x89PNG\r\n\x1a\n" + bytes(50), "is a PNG picture; save the render as OpenEXR"),
    "nothing": (b"", "is empty"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_headers_are_one_error(tmp_path: Path, capfd: pytest.CaptureFixture[str], case: str):
    data, words = HOSTILE[case]
    (tmp_path / "x.exr").write_bytes(data)
    with pytest.raises(InputError, match=rf"x\.exr: .*{words}") as error:
        read_exr(tmp_path / "x.exr")
    assert len(str(error.value)) < 500
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_handwritten_header_is_sound(tmp_path: Path):
    """What the hostile headers vary can itself be read."""
    values = pixels()
    blocks = [struct.pack("<2i", y, row.nbytes) + row.tobytes() for y, row in enumerate(values)]
    (tmp_path / "x.exr").write_bytes(with_blocks(header(), blocks))
    np.testing.assert_array_equal(read_exr(tmp_path / "x.exr").channels["R"], values)


def test_deep_file_is_refused(tmp_path: Path):
    samples = np.empty((4, 4), dtype=object)
    for i in range(16):
        samples[i // 4, i % 4] = np.arange(1 + i % 3, dtype="f4")
    deep = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    OpenEXR.File(deep, {"Z": samples}).write(str(tmp_path / "deep.exr"))
    with pytest.raises(InputError, match=r"deep\.exr: holds deep data .*; flatten it"):
        read_exr(tmp_path / "deep.exr")


def mutated(data: bytes, draw: random.Random) -> bytes:
    """A few bytes changed, most of them in the header and in what leads the blocks."""
    out = bytearray(data)
    for _ in range(draw.choice([1, 1, 2, 4])):
        at = draw.randrange(draw.choice([400, 900, len(out)]))
        match draw.randrange(4):
            case 0:
                out[at] = draw.randrange(256)
            case 1:
                out[at : at + 4] = struct.pack("<i", draw.choice([0, 1, -1, 255, 16384, 100_000, 2**31 - 1, -(2**31)]))
            case 2:
                del out[at : at + draw.choice([1, 4, 50])]
            case _:
                out[at:at] = out[draw.randrange(len(out)) :][: draw.choice([1, 4, 30])]
    return bytes(out)


@pytest.mark.parametrize("write", [several, multipart])
def test_mutations_are_read_or_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str], write: Callable[[Path], object]):
    path = tmp_path / "m.exr"
    write(path)
    data = path.read_bytes()
    refusals = []
    for seed in range(400):
        path.write_bytes(mutated(data, random.Random(seed)))
        try:
            exr = read_exr(path)
        except InputError as error:
            refusals.append(str(error))
        else:
            x0, y0, x1, y1 = exr.display_window
            assert all(values.shape == (y1 - y0 + 1, x1 - x0 + 1) for values in exr.channels.values())
    assert 100 < len(refusals) < 400
    assert all(text.startswith(f"{path}: ") and len(text) < 800 for text in refusals)
    assert capfd.readouterr() == ("", "")


def test_what_is_no_file(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.exr: cannot be read: No such file"):
        read_exr(tmp_path / "none.exr")
    with pytest.raises(InputError, match="is a directory"):
        read_exr(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe: is not a file"):
        read_exr(tmp_path / "pipe")
    for name in ("a\0b", "\udcff"):
        with pytest.raises(InputError, match="rename the file"):
            read_exr(tmp_path / name)


def test_no_permission_to_read(tmp_path: Path):
    write_exr(tmp_path / "p.exr", {"R": pixels()})
    (tmp_path / "p.exr").chmod(0)
    with unprivileged(), pytest.raises(InputError, match=r"p\.exr: cannot be read: Permission denied"):
        read_exr(tmp_path / "p.exr")


def test_text_of_others_is_passed_on(tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    write_exr(tmp_path / "q.exr", {"R": pixels()})
    real = OpenEXR.File

    def talking(*args: object, **kwargs: object) -> OpenEXR.File:
        print("to stdout")
        os.write(2, b"to stderr\n")
        return real(*args, **kwargs)

    monkeypatch.setattr(OpenEXR, "File", talking)
    read_exr(tmp_path / "q.exr")
    assert capfd.readouterr() == ("to stdout\n", "to stderr\n")


def test_write_replaces_or_leaves_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "w.exr"
    write_exr(path, {"R": pixels(1)})
    write_exr(path, {"R": pixels(2)})
    np.testing.assert_array_equal(read_exr(path).channels["R"], pixels(2))

    class Half(OpenEXR.File):  # a disk that is full
        def write(self, name: str) -> None:
            super().write(name)
            os.truncate(name, 500)

    monkeypatch.setattr(OpenEXR, "File", Half)
    with pytest.raises(InputError):
        write_exr(path, {"R": pixels(3)})
    monkeypatch.undo()
    np.testing.assert_array_equal(read_exr(path).channels["R"], pixels(2))
    assert [entry.name for entry in tmp_path.iterdir()] == ["w.exr"]


def test_write_errors_say_where(tmp_path: Path):
    channels = {"R": pixels()}
    with pytest.raises(InputError, match="no is not a folder; create it"):
        write_exr(tmp_path / "no" / "x.exr", channels)
    with pytest.raises(InputError, match="cannot be written: Is a directory"):
        write_exr(tmp_path, channels)
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    for folder in (tmp_path, *tmp_path.parents):  # pytest closes its folders to others; those above are not its own
        if folder == tmp_path or folder.name.startswith(("pytest-", "popen-")):
            folder.chmod(0o755)
    with unprivileged(), pytest.raises(InputError, match=r"x\.exr: cannot be written: Permission denied.*choose another"):
        write_exr(locked / "x.exr", channels)
    assert list(locked.iterdir()) == []


@pytest.mark.parametrize(
    "channels", [{}, {"R": np.ones(5)}, {"R": np.ones((0, 5))}, {"R": np.ones((2, 3)), "G": np.ones((3, 2))}]
)
def test_write_takes_pictures_only(tmp_path: Path, channels: dict[str, np.ndarray]):
    with pytest.raises(ValueError, match="of one shape"):
        write_exr(tmp_path / "x.exr", channels)
