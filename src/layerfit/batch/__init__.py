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

from ..capture.scene_file import check_request
from ..documents import check_directory, write_text
from ..fit import words
from .cluster import fitted as fitted_on
from .rows import Row
from .sharing import fitted
from .table import JOURNAL, Journal, write_table
from .tasks import Task, tasks_of

Progress = Callable[[int, int, int], None]


@dataclasses.dataclass
class Batch:
    """What a batch leaves behind."""

    document: dict[str, Any]
    rows: Sequence[Row]
    """Read from the journal as they are asked for."""
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
    scheduler: str | None = None,
    each: bool = False,
    quick: bool = False,
    progress: Progress = lambda done, failed, total: None,
    **options: Any,
) -> Batch:
    """Fit every scene, and write one table to `directory`: `results.csv`, and `results.parquet` where pyarrow is installed.

    `scenes` are scene files, patterns such as "captures/*.toml", directories of scene files, or manifests: CSV files with a column `scene`,
    whose other columns label the rows. `workers` processes share the work, or with `scheduler`, such as "tcp://node1:8786", those of a
    cluster of dask.distributed, who read the same files; a scene whose worker is killed is tried again. With `each`,
    every fit leaves in a directory of its own what `layerfit fit` leaves; with `quick`, fits have one start and do not measure the form's
    error. `options` override the scenes' [fit] tables. `progress` is told how many are done, failed and there. Raises `InputError` where
    there is nothing to fit or nowhere to write.
    """
    directory = Path(directory)
    check_directory(directory)
    options = {key: value for key, value in options.items() if value is not None}
    check_request(options, "[fit] of all scenes")
    options |= {"quick": True} if quick else {}
    tasks = {task.key(): task for task in tasks_of(scenes, directory, each, options)}
    directory.mkdir(parents=True, exist_ok=True)
    journal = Journal(directory / JOURNAL)
    left = {key: task for key, task in tasks.items() if not journal.done(key)}
    began, done, failed = time.perf_counter(), len(tasks) - len(left), 0
    already = done
    progress(done, failed, len(tasks))
    try:
        for rows in fitted_on(left, scheduler) if scheduler else fitted(left, workers):
            journal.write((key, _labelled(row, left[key])) for key, row in rows)
            failed += sum(row["error"] is not None for _, row in rows)
            done += sum(row["error"] is None for _, row in rows)
            progress(done, failed, len(tasks))
    finally:
        table = write_table(directory, journal.rows(list(tasks)))
    seconds = time.perf_counter() - began
    document = {
        "schema": "layerfit/batch",
        "version": 1,
        "done": done,
        "failed": failed,
        "kept": already,
        "fits_per_s": round((done + failed - already) / seconds, 3) if left else None,
        "table": str(table),
    }
    write_text(directory / "batch.json", json.dumps(document, indent=2) + "\n")
    return Batch(document, journal.rows(list(tasks)), failed == 0)


def _labelled(row: Row, task: Task) -> Row:
    """A row with what its scene is called here."""
    return task.labels | row | {"scene": str(task.scene)}
