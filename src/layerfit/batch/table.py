"""What a batch writes: a line of its journal for each fit at once, and the table of all."""

import csv
import io
import json
import os
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..documents import finite, write_bytes, write_text
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
    """Append a line in one write, so that lines of two processes stay whole; on a line of its own where the last was cut off."""
    with path.open("ab+") as file:
        file.seek(max(file.tell() - 1, 0))
        begin = b"" if file.read(1) in (b"", b"\n") else b"\n"
        file.write(begin + json.dumps(finite(entry)).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def write_table(directory: Path, rows: Sequence[Row]) -> Path:
    """`results.csv`, and `results.parquet` where pyarrow is installed; which of them to read."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    path = directory / f"{TABLE}.csv"
    write_text(path, text.getvalue())
    if find_spec("pyarrow") is None:
        return path
    import pyarrow
    from pyarrow import parquet

    sink = io.BytesIO()
    parquet.write_table(pyarrow.table({name: [row.get(name) for row in rows] for name in names}), sink)
    write_bytes(path.with_suffix(".parquet"), sink.getvalue())
    return path.with_suffix(".parquet")
