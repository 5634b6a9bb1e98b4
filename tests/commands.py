"""What tests of the command line share: ways to run it, and a small reference that it renders itself."""

import contextlib
import dataclasses
import io
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import typer.main

from layerfit.capture.exr import write_exr
from layerfit.cli import app, main

SIDE = 48

TRUTH: dict[str, Any] = {
    "schema": "layerfit/preset",
    "version": 1,
    "name": "truth",
    "model": "corrected",
    "layers": [{"type": "coat", "name": "coat", "alpha": 0.12, "eta": 1.5, "tau": [0.1, 0.25, 0.7]}],
    "base": {"type": "conductor", "name": "base", "alpha": 0.2, "eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]},
}
"""Copper under an amber lacquer."""

SCENE = """\
[reference]
exr = "reference.exr"
[geometry]
kind = "sphere"
[camera]
position = [0.8, 0.6, 4.9]
look_at = [0, 0, 0]
up = [0, 1, 0]
vfov_deg = 26
[[light]]
type = "directional"
to_light = [2, 2.4, 3]
irradiance_rgb = [3, 3, 3]
[material]
model = "corrected"
[[material.layers]]
type = "coat"
name = "coat"
alpha = 0.3
eta = 1.4
tau = [0.3, 0.3, 0.3]
[material.base]
type = "conductor"
name = "base"
alpha = 0.4
eta = [0.201, 0.924, 1.102]
k = [3.913, 2.453, 2.142]
[fit]
free = ["coat.alpha", "coat.eta", "coat.tau", "base.alpha"]
starts = 3
"""
"""The lacquered copper as it is looked for."""


@dataclasses.dataclass(frozen=True)
class Ran:
    """What a command left behind."""

    code: int
    out: str
    err: str


def layerfit(*arguments: Any, columns: int = 120) -> Ran:
    """Run the command line in this process, up to its exit. Where it would end with a traceback, this raises. `columns`: of the terminal."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["layerfit", *map(str, arguments)]),
        mock.patch.dict(os.environ, {"LAYERFIT_NO_CACHE": "1", "COLUMNS": str(columns)}),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            ran = Ran(int(end.code or 0), out.getvalue(), err.getvalue())
            check_next(arguments, ran)
            return ran
    raise AssertionError("the command line did not end by an exit")


SILENT = {"--help", "--version", "-q", "--quiet"}
"""With these a command names no next one."""


def check_next(arguments: tuple[Any, ...], ran: Ran) -> None:
    """A command that has done its work names the next one in its last line, and that is a command; `doctor` names what gets what is missing."""
    if ran.code not in (0, 1) or SILENT.intersection(arguments) or (arguments[0], ran.code) == ("doctor", 1):
        return
    last = ran.err.rstrip().splitlines()[-1]
    assert last.startswith("Next: layerfit "), last
    check_command(shlex.split(last)[2:])


def check_command(words: list[str]) -> None:
    """That words after `layerfit` are a command of it with what it asks for. Raises a usage error where they are not."""
    known: Any = typer.main.get_command(app)
    known.commands[words[0]].make_context(words[0], words[1:], resilient_parsing=False)


def process(*arguments: Any, environment: Mapping[str, str] | None = None, cwd: Path | None = None) -> Ran:
    """Run the command line as a process of its own."""
    ran = subprocess.run(
        [sys.executable, "-m", "layerfit", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env={**os.environ, "LAYERFIT_NO_CACHE": "1", **(environment or {})},
    )
    return Ran(ran.returncode, ran.stdout, ran.stderr)


def write_reference(folder: Path, truth: Mapping[str, Any] = TRUTH) -> Path:
    """Write the truth, a render of it, and the scene that looks for it; returns the scene."""
    (folder / "truth.json").write_text(json.dumps(truth))
    write_exr(folder / "reference.exr", {channel: np.ones((SIDE, SIDE)) for channel in "RGB"})
    scene = folder / "scene.toml"
    scene.write_text(SCENE)
    ran = layerfit("render", folder / "truth.json", scene, "-o", folder / "reference.exr")
    assert ran.code == 0, ran.err
    return scene


def snapshot(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
