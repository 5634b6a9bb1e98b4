"""What a batch fits: scenes by file, pattern, directory or manifest, and what each fit depends on."""

import contextlib
import csv
import dataclasses
import functools
import hashlib
import json
import stat
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from glob import glob
from pathlib import Path
from typing import Any

from ..documents import unreadable
from ..errors import InputError


@dataclasses.dataclass(frozen=True)
class Task:
    """A scene, what its row is called and labelled, and how it is fitted."""

    scene: Path
    labels: dict[str, str]
    directory: Path | None
    """Where all that a fit leaves is written; None for the row alone."""
    options: dict[str, Any]

    @property
    def quick(self) -> bool:
        """One start, unless more are asked for, and sigmas of the noise alone."""
        return bool(self.options.get("quick"))

    @property
    def overrides(self) -> dict[str, Any]:
        """What is given otherwise than in the scene's [fit] table."""
        plain = {key: value for key, value in self.options.items() if key != "quick"}
        return {"starts": 1} | plain if self.quick else plain

    def key(self) -> str:
        """What this fit depends on: the scene's text, the files that it names and when they were written, and the options."""
        from .. import __version__

        digest = hashlib.sha256(
            repr((__version__, self.scene.resolve(), sorted(self.options.items()), self.directory)).encode()
        )
        with contextlib.suppress(OSError):  # its fit will say what is the matter
            content = self.scene.read_bytes()
            digest.update(content)
            for name in _texts(content, self.scene.suffix):
                with contextlib.suppress(OSError, ValueError):  # few of them are names of files
                    known = (self.scene.parent / name).stat()
                    if stat.S_ISREG(known.st_mode):
                        digest.update(repr((name, known.st_size, known.st_mtime_ns)).encode())
        return digest.hexdigest()[:24]


@functools.lru_cache(maxsize=64)
def _texts(content: bytes, suffix: str) -> tuple[str, ...]:
    """Every text in a document, sorted; none of one that cannot be read."""
    found: set[str] = set()

    def gather(value: Any) -> None:
        if isinstance(value, str):
            found.add(value)
        for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
            gather(item)

    with contextlib.suppress(ValueError, RecursionError):
        text = content.decode()
        gather(tomllib.loads(text) if suffix == ".toml" else json.loads(text))
    return tuple(sorted(found))


def tasks_of(scenes: Sequence[str | Path], directory: Path, each: bool, options: dict[str, Any]) -> list[Task]:
    found = [pair for scene in scenes for pair in _found(str(scene))]
    named = Counter(path.stem for path, _ in found)
    tasks = []
    for path, labels in found:
        name = path.stem
        own = name if named[name] == 1 else f"{name}_{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]}"
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
    try:
        yield from _rows(path)
    except OSError as error:
        raise unreadable(path, error) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is not a CSV file in UTF-8 ({error})") from None


def _rows(path: Path) -> Iterator[tuple[Path, dict[str, str]]]:
    with path.open(newline="", encoding="utf-8") as file:
        lines = csv.DictReader(file)
        if "scene" not in (lines.fieldnames or []):
            raise InputError(
                f"{path}: its first line should name the columns, one of them `scene`; it has {', '.join(lines.fieldnames or ['none'])}"
            )
        for line in lines:
            if None in line or None in line.values():
                raise InputError(f"{path}: line {lines.line_num} should have {len(lines.fieldnames or [])} columns")
            if "\0" in line["scene"]:
                raise InputError(f"{path}: line {lines.line_num}: {line['scene']!r} is no name of a file")
            yield path.parent / line.pop("scene"), line
