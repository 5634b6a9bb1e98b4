"""`layerfit batch`: any number of scenes, each fitted once, and one table of what came of them.

Every finished fit is a line of a journal beside the table, written when it is known. What is interrupted goes on after the last of them;
a scene whose files or options changed since is another scene. A fit that fails is a row with its message, and is tried again by the
next run. Fits of one structure and size class share what is compiled.
"""

import dataclasses
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..documents import check_directory, write_text
from ..fit import words
from .rows import Row
from .sharing import fitted
from .table import JOURNAL, journal, write_line, write_table
from .tasks import tasks_of

Progress = Callable[[int, int, int], None]


@dataclasses.dataclass
class Batch:
    """What a batch leaves behind."""

    document: dict[str, Any]
    rows: list[Row]
    good: bool
    """Nothing failed."""

    def _repr_html_(self) -> str:
        """For notebooks: a line for each scene, with its values and sigmas."""
        return f"<p>{self.document['done']} done, {self.document['failed']} failed</p>{words.rows(self.rows)}"


def fit_batch(
    scenes: Sequence[str | Path],
    directory: str | Path,
    *,
    workers: int = 1,
    each: bool = False,
    quick: bool = False,
    progress: Progress = lambda done, failed, total: None,
    **options: Any,
) -> Batch:
    """Fit every scene, and write one table to `directory`: `results.csv`, and `results.parquet` where pyarrow is installed.

    `scenes` are scene files, patterns such as "captures/*.toml", directories of scene files, or manifests: CSV files with a column `scene`,
    whose other columns label the rows. `workers` processes share the work; a scene whose worker is killed is tried again. With `each`,
    every fit leaves in a directory of its own what `layerfit fit` leaves; with `quick`, fits have one start and do not measure the form's
    error. `options` override the scenes' [fit] tables. `progress` is told how many are done, failed and there. Raises `InputError` where
    there is nothing to fit or nowhere to write.
    """
    directory = Path(directory)
    check_directory(directory)
    options = {key: value for key, value in options.items() if value is not None} | ({"quick": True} if quick else {})
    tasks = tasks_of(scenes, directory, each, options)
    directory.mkdir(parents=True, exist_ok=True)
    keys = [task.key() for task in tasks]
    kept = {key: row for key, row in journal(directory / JOURNAL) if row["error"] is None}
    rows = {key: kept[key] for key in keys if key in kept}
    left = {key: task for key, task in zip(keys, tasks, strict=True) if key not in rows}
    began, already, failed = time.perf_counter(), len(rows), 0
    progress(already, 0, len(tasks))
    try:
        for key, row in fitted(left, workers):
            rows[key] = left[key].labels | row
            write_line(directory / JOURNAL, {"key": key, "row": rows[key]})
            failed += row["error"] is not None
            progress(len(rows) - failed, failed, len(tasks))
    finally:
        table = write_table(directory, [rows[key] for key in keys if key in rows])
    seconds = time.perf_counter() - began
    document = {
        "schema": "layerfit/batch",
        "version": 1,
        "done": len(rows) - failed,
        "failed": failed,
        "kept": already,
        "fits_per_s": round((len(rows) - already) / seconds, 3) if len(rows) > already else None,
        "table": str(table),
    }
    write_text(directory / "batch.json", json.dumps(document, indent=2) + "\n")
    return Batch(document, [rows[key] for key in keys], failed == 0)
