"""What a batch writes: a line of its journal for each fit at once, and the table of all.

Rows are read from the journal when they are asked for. In memory are the places of their lines: a batch may have any number of scenes.
"""

import contextlib
import csv
import errno
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import overload

from ..documents import finite, one_writer, undisturbed, whole
from ..errors import InputError
from .rows import Row

JOURNAL, TABLE = "batch.jsonl", "results"

PORTION = 5000
"""Rows that are in memory at a time while the table is written."""


class Journal:
    """The fits of this run and of earlier ones, by their keys."""

    def __init__(self, path: Path):
        self.path = path
        self._places: dict[str, tuple[int, bool]] = {}
        for place, key, row in _entries(path):
            self._places[key] = place, row["error"] is None

    def done(self, key: str) -> bool:
        """Whether a fit is there, and did not fail."""
        return self._places.get(key, (0, False))[1]

    def __contains__(self, key: str) -> bool:
        return key in self._places

    def write(self, rows: Iterable[tuple[str, Row]]) -> None:
        """Append lines, whole and for good. Raises `InputError` where they cannot be written."""
        entries = [(key, row, json.dumps(finite({"key": key, "row": row})).encode() + b"\n") for key, row in rows]
        place = _append(self.path, b"".join(line for _, _, line in entries))
        for key, row, line in entries:
            self._places[key] = place, row["error"] is None
            place += len(line)

    def rows(self, keys: Sequence[str]) -> "Rows":
        """The last rows of these fits, but for those that there are none of."""
        return Rows(self.path, [self._places[key][0] for key in keys if key in self])


class Rows(Sequence[Row]):
    """Rows of a journal, read as they are asked for."""

    def __init__(self, path: Path, places: Sequence[int]):
        self._path, self._places = path, places

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, k: int) -> Row: ...
    @overload
    def __getitem__(self, k: slice) -> list[Row]: ...
    def __getitem__(self, k: int | slice) -> Row | list[Row]:
        return list(self._read(self._places[k])) if isinstance(k, slice) else next(self._read([self._places[k]]))

    def __iter__(self) -> Iterator[Row]:
        return self._read(self._places)

    def _read(self, places: Sequence[int]) -> Iterator[Row]:
        if not places:  # there may be no file
            return
        with self._path.open("rb") as file:
            for place in places:
                file.seek(place)
                yield json.loads(file.readline())["row"]


def _entries(path: Path) -> Iterator[tuple[int, str, Row]]:
    """Lines of earlier runs: where they begin, keys and rows. A line that was cut off in the writing, or spoilt since, is none."""
    place = 0
    with path.open("rb") if path.is_file() else contextlib.nullcontext([]) as lines:
        for line in lines:
            entry = None
            with contextlib.suppress(ValueError, RecursionError):
                entry = json.loads(line)
            match entry:
                case {"key": str(key), "row": {"error": _} as row}:
                    yield place, key, row
            place += len(line)


def _append(path: Path, lines: bytes) -> int:
    """Append lines, on a line of their own where the last was cut off; a disk that is full leaves none of them. Those of two processes stay
    whole. Gives the place of the first; raises `InputError` where they cannot be written."""
    try:
        with one_writer(path.parent), path.open("ab+", buffering=0) as file:
            end = file.tell()
            file.seek(max(end - 1, 0))
            begin = b"" if file.read(1) in (b"", b"\n") else b"\n"
            if file.write(begin + lines) < len(begin + lines):
                file.truncate(end)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(file.fileno())
            return end + len(begin)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}. What was fitted before is kept in it.") from None


def write_table(directory: Path, rows: Iterable[Row]) -> Path:
    """`results.csv`, and `results.parquet` where pyarrow is installed; which of them to read. They take their names together."""
    kinds = _kinds(rows)
    files: dict[str, Callable[[Path], None]] = {f"{TABLE}.csv": lambda place: _csv(place, list(kinds), rows)}
    if find_spec("pyarrow"):
        files[f"{TABLE}.parquet"] = lambda place: _parquet(place, kinds, rows)
    with one_writer(directory), contextlib.ExitStack() as calm, contextlib.ExitStack() as named:
        for name, write in files.items():
            write(named.enter_context(whole(directory / name)))
        calm.enter_context(undisturbed())
    return directory / list(files)[-1]


def _kinds(rows: Iterable[Row]) -> dict[str, type]:
    """Names of the columns, in the order in which they come up, and what they hold."""
    kinds: dict[str, type] = {}
    for row in rows:
        for name, value in row.items():
            if value is not None and kinds.get(name, type(None)) in (
                type(None),
                int,
            ):  # whole numbers may be of a column that has others
                kinds[name] = type(value)
            kinds.setdefault(name, type(None))
    return kinds


def _csv(place: Path, names: Sequence[str], rows: Iterable[Row]) -> None:
    with place.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, names, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def _parquet(place: Path, kinds: dict[str, type], rows: Iterable[Row]) -> None:
    import pyarrow
    from pyarrow import parquet

    types = {float: pyarrow.float64(), int: pyarrow.int64(), bool: pyarrow.bool_(), type(None): pyarrow.null()}
    schema = pyarrow.schema([(name, types.get(kind, pyarrow.string())) for name, kind in kinds.items()])
    left = iter(rows)
    with parquet.ParquetWriter(place, schema) as table:
        while some := list(islice(left, PORTION)):
            table.write_table(pyarrow.Table.from_pylist(some, schema=schema))
