"""Tiles of a map, kept as they are done: what was interrupted goes on where it was."""

import hashlib
import io
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from ..batch.tasks import Task
from ..capture.scene import Scene
from ..documents import write_bytes
from ..preset import preset_of
from .descent import Found

FOLDER = ".tiles"
DIGEST = hashlib.sha256().digest_size


class Tiles:
    """Files of tiles in a folder of their own, whole or not there; of another question they are other files, and those of the last go."""

    def __init__(self, directory: Path | None, scene: Scene, asked: dict[str, Any]) -> None:
        """Without a directory nothing is kept."""
        self.directory = None if directory is None else directory / FOLDER
        question = [json.dumps(preset_of(scene.start, "map")), sorted(asked.items()), Task(scene.path, {}, None, {}).key()]
        self.key = hashlib.sha256(repr(question).encode()).hexdigest()[:24]

    def get(self, tile: int) -> Found | None:
        """What was found of a tile before."""
        path = self._path(tile)
        return None if path is None or not path.is_file() else read_tile(path)

    def put(self, tile: int, found: Found) -> None:
        """Keep a tile. Raises `InputError` where it cannot be written."""
        path = self._path(tile)
        if path is not None:
            write_tile(path, found)

    def done(self) -> None:
        """Throw the files away: all of it stands in the maps."""
        if self.directory is not None:
            shutil.rmtree(self.directory, ignore_errors=True)

    def _path(self, tile: int) -> Path | None:
        return None if self.directory is None else self.directory / f"{self.key}-{tile:05d}.tile"


def write_tile(path: Path, found: Found) -> None:
    """A tile behind its digest: what a disk has spoilt is known before it is taken for numbers."""
    content = io.BytesIO()
    np.savez(content, **vars(found))
    write_bytes(path, hashlib.sha256(content.getvalue()).digest() + content.getvalue())


def read_tile(path: Path) -> Found | None:
    """What stands in a file of `write_tile`; None where that is not what was written."""
    content = path.read_bytes()
    digest, arrays = content[:DIGEST], content[DIGEST:]
    if hashlib.sha256(arrays).digest() != digest:
        return None
    with np.load(io.BytesIO(arrays), allow_pickle=False) as loaded:
        return Found(**loaded)
