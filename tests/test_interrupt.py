"""Ctrl-C: said, exit code 130, and nothing half written."""

import subprocess
import sys

import pytest
from interrupts import Trial, interrupt, whole

from commands import layerfit, snapshot, write_reference


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
from layerfit import documents
from layerfit.__main__ import _interrupted

link = os.link

def interrupted(old, new, **options):
    link(old, new, **options)
    if Path(new).name == sys.argv[2]:
        os.kill(os.getpid(), signal.SIGINT)

documents.os.link = interrupted
signal.signal(signal.SIGINT, _interrupted)
documents.write_files(Path(sys.argv[1]), dict.fromkeys("abc", "new"))
print("it went on")
"""
"""A program that gets the signal of Ctrl-C while it names its files."""


@pytest.mark.parametrize("during", ["a", "c"])
def test_an_interrupt_while_files_are_named_leaves_all_of_them(during, tmp_path):
    arguments = [sys.executable, "-c", CONTROL_C, tmp_path, during]
    ran = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (130, ""), ran.stderr
    assert ran.stderr == "layerfit: interrupted; every file that was written is whole\n"
    assert snapshot(tmp_path) == dict.fromkeys("abc", b"new")


def test_random_moments(tmp_path):
    """A few; `python tools/interrupts.py` tries more, of commands that take longer."""
    trial = Trial("gallery", tmp_path)
    assert trial.names == {"index.html"}
    assert [*interrupt(trial, count=4, seed=0)] == []


HALF = {
    "a.json": b'{"a": 1',
    "a.jsonl": b'{"a": 1}\n{"b',
    "a.csv": b"a,b\n1,2\n3\n",
    "a.png": b"\x89PNG\r\n\x1a\n",
    "a.html": b"<html><body>",
    "a.frag": b"#version 330 core\nvoid main() {",
    "a.md": b"# A",
    "a.parquet": b"PAR1",
    ".a.json": b"{}",
    "a.part": b"",
}


@pytest.mark.parametrize("name", HALF)
def test_half_files_are_seen(name):
    assert whole(name, HALF[name])
