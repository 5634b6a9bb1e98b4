"""Files are written whole or not at all, whatever happens meanwhile: a full disk, a kill, another process that writes the same."""

import contextlib
import json
import os
import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from commands import snapshot
from layerfit import documents
from layerfit.batch.table import Journal
from layerfit.capture.exr import read_exr, write_exr
from layerfit.documents import of_ours, undisturbed, whole, write_bytes, write_files
from layerfit.errors import InputError


@pytest.fixture(params=["nameless", "hidden"])
def way(request, monkeypatch):
    """Both ways of writing: the second is that of file systems where a file cannot be without a name."""
    if request.param == "hidden":
        monkeypatch.setattr(documents, "_nameless", lambda directory: None)
    return request.param


@contextlib.contextmanager
def room(size: int) -> Iterator[None]:
    """As a disk with room for so many bytes of a file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_file_is_written(way, tmp_path):
    path = tmp_path / "new" / "a.txt"
    for content in (b"one", b"another"):
        write_bytes(path, content)
        assert snapshot(tmp_path) == {"new/a.txt": content}
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


def test_a_file_of_the_longest_name_is_written(way, tmp_path):
    write_bytes(tmp_path / ("n" * 255), b"one")
    assert len(snapshot(tmp_path)) == 1


def test_an_exception_leaves_what_was_there(way, tmp_path):
    write_bytes(tmp_path / "a.txt", b"one")

    def half(place):
        place.write_bytes(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), whole(tmp_path / "a.txt") as place:
        half(place)
    assert snapshot(tmp_path) == {"a.txt": b"one"}


def test_a_full_disk_leaves_what_was_there(way, tmp_path):
    write_files(tmp_path, {"small": "one", "large": "one"})
    before = snapshot(tmp_path)
    with room(1000), pytest.raises(InputError, match=r"large: cannot be written: File too large\. It was left as it was"):
        write_files(tmp_path, {"small": "another", "large": b"x" * 1001})
    assert snapshot(tmp_path) == before


def test_a_full_disk_leaves_the_old_picture(way, tmp_path):
    path = tmp_path / "a.exr"
    write_exr(path, {"Y": np.ones((4, 4))})
    noise = np.random.default_rng(0).uniform(size=(64, 64))
    with room(1000), pytest.raises(InputError, match=r"a\.exr: cannot be written"):
        write_exr(path, {"Y": noise})
    assert list(snapshot(tmp_path)) == ["a.exr"]
    assert read_exr(path).channels["Y"].shape == (4, 4)


def test_a_full_disk_leaves_whole_lines(tmp_path):
    path, row = tmp_path / "batch.jsonl", {"error": None}
    Journal(path).write([("a", row)])
    before = path.read_bytes()
    with room(len(before) + 10), pytest.raises(InputError, match=r"batch\.jsonl: cannot be written: No space left"):
        Journal(path).write([("b", row | {"name": "x" * 100})])
    assert path.read_bytes() == before
    path.write_bytes(before + b'{"key": "c", "ro')  # as a kill leaves it
    Journal(path).write([("d", row | {"name": "last"})])
    journal = Journal(path)
    assert [key for key in "abcd" if key in journal] == ["a", "d"]
    assert list(journal.rows(["a", "d"])) == [row, row | {"name": "last"}]


def test_what_is_no_file_is_written_straight(tmp_path):
    """A pipe, or /dev/stdout: it is not replaced by a file."""
    path, read = tmp_path / "pipe", []
    os.mkfifo(path)
    reader = Thread(target=lambda: read.append(path.read_bytes()))
    reader.start()
    write_bytes(path, b"one")
    reader.join()
    assert read == [b"one"]
    assert path.is_fifo()


def test_a_full_device_is_said():
    with pytest.raises(InputError, match=r"/dev/full: cannot be written: No space left on device"):
        write_bytes(Path("/dev/full"), b"one")


def test_a_directory_in_the_place_of_a_file_leaves_the_others(way, tmp_path):
    write_files(tmp_path, {"a": "one", "b": "one"})
    (tmp_path / "c").mkdir()
    with pytest.raises(InputError, match=r"c: is a directory, where a file goes"):
        write_files(tmp_path, dict.fromkeys("abc", "another"))
    assert snapshot(tmp_path) == {"a": b"one", "b": b"one"}


@pytest.mark.parametrize(
    ("earlier", "left"),
    [('{"schema": "layerfit/fit"}', False), (None, True), ('{"schema": "other"}', True), ("[]", True), ("no JSON", True)],
)
def test_what_an_earlier_result_did_not_leave_stays(earlier, left, tmp_path):
    (tmp_path / "planes.png").write_text("of the user")
    if earlier is not None:
        (tmp_path / "fit.json").write_text(earlier)
    files = of_ours(tmp_path, {"planes.png": None, "fit.json": "new"}, "fit.json", "layerfit/fit")
    write_files(tmp_path, files)
    assert (tmp_path / "planes.png").exists() == left


def test_of_numbered_files_of_an_earlier_result_none_is_left(tmp_path):
    for name in ("preset_2.json", "preset_3.json", "notes_2.txt", "other.txt"):
        (tmp_path / name).write_text("earlier")
    names = ["preset.json", "preset_2.json", "preset_3.json", "notes_2.txt", "other.txt", "../preset_2.json", 3]
    (tmp_path / "fit.json").write_text(json.dumps({"schema": "layerfit/fit", "files": names}))
    contents = {"preset.json": "new", "preset_2.json": "new", "fit.json": "new"}
    write_files(tmp_path, of_ours(tmp_path, contents, "fit.json", "layerfit/fit"))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == contents | {
        "notes_2.txt": "earlier",
        "other.txt": "earlier",
    }


NAMES = [f"{k}.json" for k in range(5)]

OFTEN = """
import json, sys
from pathlib import Path
from layerfit import documents

if sys.argv[2] == "hidden":
    documents._nameless = lambda directory: None
for k in range(100):
    text = json.dumps([sys.argv[3], k, "x" * 10_000])
    documents.write_files(Path(sys.argv[1]), {f"{name}.json": text for name in range(5)})
"""


def test_two_processes_leave_the_files_of_one(way, tmp_path):
    both = [subprocess.Popen([sys.executable, "-c", OFTEN, tmp_path, way, who]) for who in ("one", "two")]
    read = 0
    while any(process.poll() is None for process in both):
        for path in tmp_path.glob("[0-9].json"):
            read += bool(json.loads(path.read_text()))
    assert [process.wait() for process in both] == [0, 0]
    found = snapshot(tmp_path)
    assert sorted(found) == NAMES
    assert len(set(found.values())) == 1, "of two results"
    assert read > 10


KILLED = """
import os, signal, sys
from pathlib import Path
from layerfit.documents import whole

with whole(Path(sys.argv[1])) as place:
    place.write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_kill_leaves_nothing(tmp_path):
    ran = subprocess.run([sys.executable, "-c", KILLED, tmp_path / "a.txt"], check=False)
    assert ran.returncode == -signal.SIGKILL
    try:
        os.close(os.open(tmp_path, os.O_TMPFILE | os.O_WRONLY))
    except OSError as error:
        pytest.skip(f"files of {tmp_path} cannot be without a name: {error}")
    assert snapshot(tmp_path) == {}


def test_a_handler_that_python_did_not_set_is_left_alone(monkeypatch):
    """As in a program that Python is embedded in: it could not be put back."""
    monkeypatch.setattr(signal, "getsignal", lambda number: None)
    monkeypatch.setattr(signal, "signal", lambda number, handler: pytest.fail("it was replaced"))
    with undisturbed():
        pass
