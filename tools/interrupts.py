"""End commands at random moments: every file that is left is whole, and the same command given again ends as if nothing had been.

    python tools/interrupts.py               192 moments, 24 of each command; exit code 1 where something was lost
    python tools/interrupts.py fit batch -n 50 --seed 1

Signals are SIGINT (Ctrl-C) and SIGKILL, by turns. Moments are drawn over the length of a run whose functions are compiled already. Of a run that
was ended: no file that a reader refuses, none under another name but what is kept to go on from, no process left behind; SIGINT gives one
line and exit code 130. Of the run after it: all files, nothing that was kept, and the same bytes in those that two whole runs have the same.
"""

import argparse
import csv
import io
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from PIL import Image

from layerfit.capture.exr import read_exr, write_exr
from layerfit.maps.kept import read_tile

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from commands import snapshot, write_reference

COMMANDS: dict[str, list[str]] = {
    "fit": ["fit", "scene.toml", "-o", "OUT", "--starts", "1"],
    "batch": ["batch", "*.toml", "-o", "OUT", "--quick", "--workers", "2"],
    "export": ["export", "lacquered_copper", "-o", "OUT/copper.frag"],
    "map": ["map", "panel.toml", "-o", "OUT", "--size", "96", "--starts", "1"],
    "study": ["study", "plan.toml", "-o", "OUT"],
    "stability": ["stability", "dielectric, masking", "--corners", "2", "--no-shaders", "-o", "OUT"],
    "tradeoff": ["tradeoff", "glass.json", "-o", "OUT", "--no-fits", "--rounds", "3"],
    "gallery": ["gallery", "wood", "-o", "OUT"],
}
KEPT = re.compile(r"(stability|tradeoff)\.parts\.json|\.tiles/[0-9a-f]{24}-[0-9]{5}\.tile")
"""What a run that was ended may leave besides: parts that are done, which the next run goes on from and throws away."""
PATIENCE = 120
"""Seconds within which all processes of a run that was ended are gone."""


@dataclass(frozen=True)
class Ran:
    """What a run left: its exit code, its words, and its files by name."""

    code: int
    err: str
    files: dict[str, bytes]


def whole(name: str, content: bytes) -> str | None:
    """Why a file is not whole; None for one that is."""
    reader = READERS.get(Path(name).suffix)
    if reader is None or (not KEPT.fullmatch(name) and any(part.startswith(".") for part in Path(name).parts)):
        return "is none of what the command leaves"
    try:
        return None if reader(content) else "is not whole"
    except Exception as error:
        return f"cannot be read: {error}"


def _rows(content: bytes) -> bool:
    rows = list(csv.reader(io.StringIO(content.decode())))
    return content.endswith(b"\n") and len({len(row) for row in rows}) <= 1


def _picture(content: bytes) -> bool:
    Image.open(io.BytesIO(content)).load()
    return content.endswith(b"IEND\xaeB`\x82")


def _in_a_file(read: Callable[[Path], Any]) -> Callable[[bytes], bool]:
    """Of a reader of files."""

    def reader(content: bytes) -> bool:
        with tempfile.NamedTemporaryFile() as file:
            file.write(content)
            file.flush()
            return read(Path(file.name)) is not None

    return reader


def _netcdf(content: bytes) -> bool:
    return len(xarray.load_dataset(io.BytesIO(content)).data_vars) > 0


READERS: dict[str, Callable[[bytes], bool]] = {
    ".json": lambda content: isinstance(json.loads(content), dict),
    ".jsonl": lambda content: content[-1:] in (b"", b"\n") and all(json.loads(line) for line in content.splitlines()),
    ".csv": _rows,
    ".png": _picture,
    ".html": lambda content: content.rstrip().endswith(b"</html>"),
    ".frag": lambda content: (
        content.startswith(b"#version") and content.count(b"{") == content.count(b"}") and content.endswith(b"#endif\n")
    ),
    ".md": lambda content: content.endswith(b"\n"),
    ".parquet": lambda content: len(content) > 8 and content[:4] == content[-4:] == b"PAR1",
    ".tile": _in_a_file(read_tile),
    ".exr": _in_a_file(read_exr),
    ".nc": _netcdf,
}


class Trial:
    """A command in a folder that holds its input: how long it takes, and what it leaves."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        self.run("before")  # compiles
        began = time.perf_counter()
        once, twice = self.run("once"), self.run("twice")
        if "Traceback" in once.err:
            raise RuntimeError(f"{name}, left alone: {once.err}")
        self.seconds = (time.perf_counter() - began) / 2
        self.code, self.names = once.code, once.files.keys()
        self.same = {name: content for name, content in once.files.items() if twice.files[name] == content}

    def run(self, out: str, after: float | None = None, sent: int = 0) -> Ran:
        """The command, with its results in `out`; after so many seconds, a signal."""
        words = [word.replace("OUT", f"{self.name}/{out}") for word in COMMANDS[self.name]]
        started = subprocess.Popen(
            [sys.executable, "-m", "layerfit", *words],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            err = started.communicate(timeout=after)[1]
        except subprocess.TimeoutExpired:
            started.send_signal(sent)
            err = started.communicate(timeout=PATIENCE)[1]
        _wait_for_all(started.pid)
        return Ran(started.returncode, err, snapshot(self.folder / self.name / out))

    def faults(self, moment: float, sent: int, out: str) -> Iterator[str]:
        """What was lost by a signal at a moment, a share of the length of a run."""
        ended = self.run(out, moment * self.seconds, sent)
        yield from (f"{name} {why}" for name, content in ended.files.items() if (why := whole(name, content)))
        yield from (f"{name} is none of its files" for name in ended.files.keys() - self.names if not KEPT.fullmatch(name))
        expected = {signal.SIGINT: (130, -signal.SIGINT), signal.SIGKILL: (-signal.SIGKILL,)}[
            signal.Signals(sent)
        ]  # before and after Python runs
        began = bool(ended.err or ended.code not in (1, -signal.SIGINT))  # else Python itself had not begun
        if began and (ended.code not in (*expected, self.code) or "Traceback" in ended.err):
            yield f"exit code {ended.code}: {ended.err[-2000:]}"
        again = self.run(out)
        if again.code != self.code or "Traceback" in again.err or "Warning" in again.err:
            yield f"the run after it: exit code {again.code}: {again.err[-2000:]}"
        yield from (f"{name} is not there after another run" for name in self.names - again.files.keys())
        yield from (f"{name} is left after another run" for name in again.files.keys() - self.names)
        yield from (
            f"{name} is another after another run" for name, content in self.same.items() if again.files.get(name) != content
        )


def _wait_for_all(group: int) -> None:
    """Wait for the last process of a group. Raises `TimeoutError` where one stays."""
    limit = time.monotonic() + PATIENCE
    while time.monotonic() < limit:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.02)
    raise TimeoutError(f"processes of group {group} are left behind")


def interrupt(trial: Trial, count: int, seed: int) -> Iterator[str]:
    """Faults of a command that is ended at so many moments."""
    draw = random.Random(f"{trial.name} {seed}")
    for k in range(count):
        moment, sent = draw.uniform(0.0, 1.1), (signal.SIGINT, signal.SIGKILL)[k % 2]
        for fault in trial.faults(moment, sent, str(k)):
            yield f"{trial.name}, {sent.name} after {moment * trial.seconds:.3f} s: {fault}"


GLASS = {
    "schema": "layerfit/preset",
    "version": 1,
    "name": "glass",
    "base": {"type": "dielectric", "name": "base", "alpha": 0.2},
}
PLAN = """
study = { free = ["base.alpha"], material = { base = { type = "conductor" } } }
vary = { "base.alpha" = [0.1, 0.2, 0.4] }
reference = { side = 16 }
fit = { starts = 1 }
"""
LIGHT = """
[[reference]]
exr = "panel.exr"
beauty = "light{k}"
[[reference.light]]
type = "directional"
to_light = [{k}, 0, 1]
irradiance_rgb = 3
"""
PANEL = """
[camera]
position = [0, 0, 4]
look_at = [0, 0, 0]
vfov_deg = 30
[material]
base = { type = "lambert" }
[map]
free = ["base.albedo"]
"""


def write_panel(folder: Path, side: int = 96) -> None:
    """A flat panel under two lights, which takes two tiles of texels."""
    row, column = np.mgrid[0:side, 0:side]
    u, v = (column + 0.5) / side, 1.0 - (row + 0.5) / side
    layers = {"P.X": 2.0 * u - 1.0, "P.Y": 2.0 * v - 1.0, "P.Z": 0.0 * u, "N.X": 0.0 * u, "N.Y": 0.0 * u, "N.Z": 0.0 * u + 1.0}
    layers |= {"uv.U": u, "uv.V": v} | {f"light{k}.{c}": 0.2 + 0.3 * u * v for k in (0, 1) for c in "RGB"}
    write_exr(folder / "panel.exr", layers)
    (folder / "panel.toml").write_text("".join(LIGHT.format(k=k) for k in (0, 1)) + PANEL)


def prepare(folder: Path) -> None:
    """What the commands read, and a compilation cache of their own."""
    scene = write_reference(folder)
    (folder / "second.toml").write_text(scene.read_text())
    (folder / "glass.json").write_text(json.dumps(GLASS))
    (folder / "plan.toml").write_text(PLAN)
    write_panel(folder)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder / "cache")
    os.environ.pop("LAYERFIT_NO_CACHE", None)


def main() -> int:
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    options.add_argument("commands", nargs="*", help=f"of {', '.join(COMMANDS)}; left out: all")
    options.add_argument("-n", "--count", type=int, default=24, help="moments of each")
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args()
    total = 0
    with tempfile.TemporaryDirectory() as folder:
        prepare(Path(folder))
        for name in chosen.commands or COMMANDS:
            faults = list(interrupt(Trial(name, Path(folder)), chosen.count, chosen.seed))
            total += len(faults)
            print(f"{name}: {chosen.count} moments, {len(faults)} faults", *faults, sep="\n  ", flush=True)
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
