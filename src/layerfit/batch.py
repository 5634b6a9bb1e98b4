"""`layerfit batch`: any number of scenes, each fitted once, and one table of what came of them.

Every finished fit is a line of a journal beside the table, written when it is known. What is interrupted goes on after the last of them;
a scene whose files or options changed since is another scene. A fit that fails is a row with its message, and is tried again by the
next run. Fits of one structure and size class share what is compiled.
"""

import csv
import dataclasses
import hashlib
import io
import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from glob import glob
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .cache import use_compilation_cache
from .capture.load import load
from .capture.scene import Scene, read_scene
from .documents import check_directory, finite, write_bytes, write_text
from .errors import InputError, LayerfitError
from .fit.fit import fit
from .fit.result import correlations, flags, parameters
from .fit.words import structure

JOURNAL, TABLE = "batch.jsonl", "results"
CHANNELS = ("r", "g", "b")
TRIES = 2
"""Workers that one scene may take down before it is given up."""

Row = dict[str, Any]
Progress = Callable[[int, int, int], None]


@dataclasses.dataclass(frozen=True)
class Task:
    """A scene, what its row is called and labelled, and how it is fitted."""

    scene: Path
    labels: dict[str, str]
    directory: Path | None
    """Where all that a fit leaves is written; None for the row alone."""
    options: dict[str, Any]

    def key(self) -> str:
        """What this fit depends on: the scene's text, which files it reads and when they were written, and the options."""
        from . import __version__

        digest = hashlib.sha256(
            repr((__version__, self.scene.resolve(), sorted(self.options.items()), self.directory)).encode()
        )
        digest.update(self.scene.read_bytes() if self.scene.is_file() else b"")
        for file in sorted(_files(self.scene)):
            known = file.stat() if file.exists() else None
            digest.update(repr((str(file), known and (known.st_size, known.st_mtime_ns))).encode())
        return digest.hexdigest()[:24]


@dataclasses.dataclass
class Batch:
    """What a batch leaves behind."""

    document: dict[str, Any]
    rows: list[Row]
    good: bool
    """Nothing failed."""


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
    tasks = _tasks(scenes, directory, each, options)
    directory.mkdir(parents=True, exist_ok=True)
    keys = [task.key() for task in tasks]
    kept = {key: row for key, row in _journal(directory / JOURNAL) if row["error"] is None}
    rows = {key: kept[key] for key in keys if key in kept}
    left = {key: task for key, task in zip(keys, tasks, strict=True) if key not in rows}
    began, already, failed = time.perf_counter(), len(rows), 0
    progress(already, 0, len(tasks))
    try:
        for key, row in _fitted(left, workers):
            rows[key] = left[key].labels | row
            _write_line(directory / JOURNAL, {"key": key, "row": rows[key]})
            failed += row["error"] is not None
            progress(len(rows) - failed, failed, len(tasks))
    finally:
        table = _write_table(directory, [rows[key] for key in keys if key in rows])
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


def _tasks(scenes: Sequence[str | Path], directory: Path, each: bool, options: dict[str, Any]) -> list[Task]:
    found = [pair for scene in scenes for pair in _found(str(scene))]
    named = [path.stem for path, _ in found]
    tasks = []
    for (path, labels), name in zip(found, named, strict=True):
        own = name if named.count(name) == 1 else f"{name}_{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]}"
        tasks.append(Task(path, {"scene": str(path), **labels}, directory / own if each else None, options))
    unique = {(task.scene.resolve(), tuple(task.labels.items())): task for task in tasks}
    return list(unique.values())


def _found(what: str) -> Iterator[tuple[Path, dict[str, str]]]:
    """Scene files that a word of the command line stands for, each with its labels."""
    path = Path(what)
    if path.suffix == ".csv" and path.is_file():
        yield from _manifest(path)
        return
    plain = [path] if path.is_file() else sorted(Path(name) for name in glob(what, recursive=True))
    paths = sorted(path.glob("*.toml")) if path.is_dir() else plain
    if not paths:
        raise InputError(
            f"{what}: there is no such scene. Give scene files, a pattern in quotes, a directory of .toml files, or a manifest (.csv)"
        )
    yield from ((path, {}) for path in paths)


def _manifest(path: Path) -> Iterator[tuple[Path, dict[str, str]]]:
    with path.open(newline="", encoding="utf-8") as file:
        lines = csv.DictReader(file)
        if "scene" not in (lines.fieldnames or []):
            raise InputError(
                f"{path}: its first line should name the columns, one of them `scene`; it has {', '.join(lines.fieldnames or ['none'])}"
            )
        for line in lines:
            if None in line or None in line.values():
                raise InputError(f"{path}: line {lines.line_num} should have {len(lines.fieldnames or [])} columns")
            yield path.parent / line.pop("scene"), line


def _files(scene: Path) -> Iterable[Path]:
    """Files that a scene reads; none where it cannot be read, which its fit will say."""
    try:
        references = read_scene(scene).references
    except LayerfitError:
        return []
    lights = [light for reference in references for light in getattr(reference, "lights", ())]
    files = [
        *(r.path for r in references),
        *(getattr(r, "mask", None) for r in references),
        *(getattr(x, "file", None) for x in lights),
    ]
    return {file for file in files if file is not None}


def _journal(path: Path) -> Iterator[tuple[str, Row]]:
    """Rows of earlier runs. A line that was cut off in the writing is none."""
    for line in path.read_bytes().splitlines() if path.is_file() else []:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        yield entry["key"], entry["row"]


def _write_line(path: Path, entry: dict[str, Any]) -> None:
    """Append a line in one write, so that lines of two processes stay whole; on a line of its own where the last was cut off."""
    with path.open("ab+") as file:
        file.seek(max(file.tell() - 1, 0))
        begin = b"" if file.read(1) in (b"", b"\n") else b"\n"
        file.write(begin + json.dumps(finite(entry)).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the process that shares out the work
    use_compilation_cache()


def _fitted(tasks: dict[str, Task], workers: int) -> Iterator[tuple[str, Row]]:
    """Rows as they are known."""
    if workers == 1:
        yield from ((key, run(task)) for key, task in tasks.items())
        return
    left, tries = dict(tasks), dict.fromkeys(tasks, 0)
    while left:
        # Spawned: a process that has run JAX cannot be forked.
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_begin_worker) as pool:
            futures: dict[Future[Row], str] = {pool.submit(run, task): key for key, task in left.items()}
            try:
                for future in as_completed(futures):
                    key = futures[future]
                    row = _row_of(future)
                    if row is None:
                        continue
                    del left[key]
                    yield key, row
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        for key in list(left):  # the pool broke: a worker was killed, and took along what had begun
            tries[key] += 1
            if tries[key] >= TRIES:
                task = left.pop(key)
                yield key, _failed(task, "its worker was killed twice, as by a machine out of memory; try fewer --workers")


def _row_of(future: "Future[Row]") -> Row | None:
    try:
        return future.result()
    except BrokenProcessPool:
        return None


def run(task: Task) -> Row:
    """Fit one scene; its row, or one with the message of what was at fault."""
    began = time.perf_counter()
    try:
        row = _values(task)
    except LayerfitError as error:
        return _failed(task, str(error))
    except Exception as error:  # told in its row, and not the end of the others
        return _failed(task, f"{type(error).__name__}: {error} (a fault of layerfit, not of the scene: please report it)")
    return {"scene": str(task.scene), "error": None, "seconds": round(time.perf_counter() - began, 4), **row}


def _failed(task: Task, message: str) -> Row:
    return {"scene": str(task.scene), "error": message, "seconds": None}


def _values(task: Task) -> Row:
    options = dict(task.options)
    quick = options.pop("quick", False)
    if quick:
        options.setdefault("starts", 1)
    if task.directory is not None:
        from .job import fit_scene

        document = fit_scene(task.scene, task.directory, **options).document
        return {
            "scene": str(task.scene),
            **_columns(document["parameters"]),
            **_outcome(document),
            "directory": str(task.directory),
        }
    scene: Scene = read_scene(task.scene)
    asked = dataclasses.replace(scene.fit, **options)
    result = fit(
        load(scene),
        scene.start,
        free=asked.free,
        fixed=dict(asked.fixed),
        metric=asked.metric,
        loss=asked.loss,
        starts=asked.starts,
        seed=asked.seed,
        model_error=not quick,
        where=f"{task.scene}: fit",
    )
    rows = parameters(result)
    outcome = {
        "converged": result.converged,
        "flags": flags(result, rows, correlations(result)),
        "misfit": result.misfit,
        "steps": result.steps,
    }
    return {"structure": structure(result.stack), **_outcome(outcome), **_columns(rows)}


def _outcome(document: dict[str, Any]) -> Row:
    return {key: document[key] for key in ("converged", "misfit", "steps")} | {"flags": " ".join(document["flags"])}


def _columns(rows: dict[str, dict[str, Any]]) -> Row:
    """Values and sigmas, a column each number: `coat.tau.r`, `coat.tau.r.sigma`."""
    columns: Row = {}
    for name, row in rows.items():
        for key in ("value", "sigma", "corrected"):
            value = row.get(key)
            spread = isinstance(value, list | tuple) or isinstance(row["value"], list | tuple)
            numbers = value if isinstance(value, list | tuple) else [value] * (len(row["value"]) if spread else 1)
            names = [f"{name}.{c}" for c in CHANNELS] if spread else [name]
            if key in row:
                columns |= {n if key == "value" else f"{n}.{key}": v for n, v in zip(names, numbers, strict=True)}
    return columns


def _write_table(directory: Path, rows: Sequence[Row]) -> Path:
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
