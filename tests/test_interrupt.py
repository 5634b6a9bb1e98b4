"""Ctrl-C: said, exit code 130, and nothing half written."""

import os
import subprocess
import sys

import pytest

from commands import layerfit, snapshot, write_reference
from layerfit.preset import read_preset


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A small scene whose reference layerfit rendered."""
    return write_reference(tmp_path_factory.mktemp("scene"))


def test_an_interrupt_is_said(scene, gl, tmp_path, monkeypatch):
    def interrupted(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("layerfit.job.fit", interrupted)
    ran = layerfit("fit", scene, "-o", tmp_path / "out")
    assert (ran.code, ran.out) == (130, "")
    assert "interrupted" in ran.err
    assert not (tmp_path / "out").exists()


CONTROL_C = """
import os, signal, sys
from pathlib import Path
import layerfit.documents as documents
from layerfit.cli import main

during, replace = sys.argv.pop(1), os.replace

def interrupted(old, new):
    if Path(new).name == during:
        os.kill(os.getpid(), signal.SIGINT)
    replace(old, new)

documents.os.replace = interrupted
main()
"""
"""A fit that gets the signal of Ctrl-C while it writes a file."""


def test_an_interrupt_while_files_are_written_leaves_whole_ones(scene, gl, tmp_path):
    arguments = [sys.executable, "-c", CONTROL_C, "report.html", "fit", scene, "-o", tmp_path / "out", "--starts", "1"]
    environment = {**os.environ, "LAYERFIT_NO_CACHE": "1"}
    ran = subprocess.run(arguments, capture_output=True, text=True, check=False, env=environment)
    assert (ran.returncode, ran.stdout) == (130, ""), ran.stderr
    assert "interrupted; every file that was written is whole" in ran.stderr
    assert "Traceback" not in ran.stderr
    there = snapshot(tmp_path / "out")
    assert set(there) == {"material.frag", "trace.csv", "fit.png", "preset.json"}, "half written, or after the interrupt"
    assert read_preset(tmp_path / "out" / "preset.json").layers[0].name == "coat"
