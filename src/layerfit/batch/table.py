"""What a batch writes: a line of its journal for each fit at once, and the table of all."""

import csv
import errno
import io
import json
import os
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..documents import finite, one_writer, write_files
from ..errors import InputError
from .rows import Row

JOURNAL, TABLE = "batch.jsonl", "results"


def journal(path: Path) -> Iterator[tuple[str, Row]]:
    """Rows of earlier runs. A line that was cut off in the writing is none."""
    for line in path.read_bytes().splitlines() if path.is_file() else []:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        yield entry["key"], entry["row"]


def write_line(path: Path, entry: dict[str, Any]) -> None:
    """Append a line, on a line of its own where the last was cut off; a disk that is full leaves none of it. Lines of two processes stay
    whole. Raises `InputError` where it cannot be written."""
    try:
        with one_writer(path.parent), path.open("ab+", buffering=0) as file:
            end = file.tell()
            file.seek(max(end - 1, 0))
            begin = b"" if file.read(1) in (b"", b"\n") else b"\n"
            line = begin + json.dumps(finite(entry)).encode() + b"\n"
            if file.write(line) < len(line):
                file.truncate(end)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(file.fileno())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}. What was fitted before is kept in it.") from None


def write_table(directory: Path, rows: Sequence[Row]) -> Path:
    """`results.csv`, and `results.parquet` where pyarrow is installed; which of them to read."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    files: dict[str, str | bytes] = {f"{TABLE}.csv": text.getvalue()}
    if find_spec("pyarrow"):
        files[f"{TABLE}.parquet"] = _parquet(names, rows)
    write_files(directory, files)
    return directory / list(files)[-1]


def _parquet(names: Sequence[str], rows: Sequence[Row]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    sink = io.BytesIO()
    parquet.write_table(pyarrow.table({name: [row.get(name) for row in rows] for name in names}), sink)
    return sink.getvalue()
