"""How commands talk: documents, quiet and verbose, colours, help by example, completion, and what each names as the next command."""

import json
import os
import pty
import re
import subprocess
import sys

import numpy as np
import pytest
import typer.main

from commands import TRUTH, check_command, layerfit, process, write_reference
from layerfit.cli import app, fitting
from layerfit.shipped import shipped_presets
from test_cli import COMMANDS

KNOWN = typer.main.get_command(app).commands  # pyright: ignore


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_reference(tmp_path_factory.mktemp("talk"))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_can_give_a_document_and_be_quiet_or_verbose(name):
    options = {word for parameter in KNOWN[name].params for word in parameter.opts}
    assert {"--json", "--quiet", "-q", "--verbose", "-v"} <= options


def test_documents_of_commands_that_write_or_print(scene, tmp_path):
    """Nothing but the document is on standard output; what it says is there, is."""
    preset = scene.parent / "truth.json"
    (tmp_path / "d.csv").write_text("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,1\n")
    document = lambda *words: json.loads(layerfit(*words, "--json").out)  # noqa: E731
    assert document("render", preset, scene, "-o", tmp_path / "a.png") == {"written": [str(tmp_path / "a.png")]}
    table = document("eval", preset, tmp_path / "d.csv")
    plain = layerfit("eval", preset, tmp_path / "d.csv").out.splitlines()
    assert ",".join(table["columns"]) == plain[0]
    assert table["rows"] == [[float(value) for value in plain[1].split(",")]]
    shader = document("export", preset, "--target", "essl300")
    assert shader["shader"] == layerfit("export", preset, "--target", "essl300").out
    assert (shader["name"], shader["target"], shader["tier"]) == ("truth", "essl300", "exact")
    page = document("gallery", "lacquered_copper", "-o", tmp_path / "g")
    assert page == {"written": str(tmp_path / "g" / "index.html"), "presets": ["lacquered_copper"]}
    assert (tmp_path / "g" / "index.html").is_file()


def test_quiet_leaves_the_result_and_faults(scene):
    preset = scene.parent / "truth.json"
    loud, quiet = layerfit("export", preset), layerfit("export", preset, "-q")
    assert (quiet.code, quiet.out, quiet.err) == (0, loud.out, "")
    assert layerfit("export", "nowhere.json", "-q").err.startswith("layerfit: nowhere.json")


def test_verbose_says_what_runs_and_where_a_fault_arose(scene, tmp_path):
    ran = layerfit("presets", "copper", "-v")
    assert re.match(r"layerfit \S+, Python \S+, JAX \S+, .*; compilation cache: none\n", ran.err)
    assert re.search(r"^Done after \d+\.\d\d s\nNext: layerfit view ", ran.err, re.MULTILINE)
    ran = layerfit("export", "nowhere.json", "-v")
    assert ran.code == 2
    assert "in read_document" in ran.err
    assert "Traceback" not in layerfit("export", "nowhere.json").err


def test_stages_are_lines_where_it_is_verbose(scene, tmp_path, capsys):
    from layerfit.cli.talk import manner, progress

    manner.verbose, manner.quiet = True, False
    try:
        with progress() as report:
            for share in (0.0, 0.5):
                report("coarse", share)
            report("fine", 0.9)
    finally:
        manner.verbose = False
    assert re.findall(r"^ +\d+\.\d\d s  (\w+)$", capsys.readouterr().err, re.MULTILINE) == ["coarse", "fine"]


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ([], ["view", "o/preset.json"]),
        (["poor_fit", "correlated:a~b"], ["structures", "a.toml"]),
        (["not_identifiable:coat.tau"], ["advise", "a.toml", "--preset", "o/preset.json"]),
        (["not_converged", "poor_fit"], ["fit", "a.toml", "--starts", "32", "--also", "light.ambient", "--also", "coat.tau"]),
        (["shader_differs", "poor_fit"], ["doctor"]),
    ],
)
def test_the_gravest_flag_of_a_fit_chooses_the_next_command(flags, words):
    from pathlib import Path

    again = ("fit", "a.toml", "--starts", 32, *fitting._words({"--start": None, "--also": ["light.ambient", "coat.tau"]}))
    then = [str(word) for word in fitting._after_fit(flags, Path("a.toml"), Path("o"), again)]
    assert then[: len(words)] == words
    check_command(then)


def test_the_next_scene_to_look_at_is_one_without_a_misfit():
    from pathlib import Path

    rows = [{"scene": f"{k}.toml", "error": "", "misfit": misfit} for k, misfit in enumerate((0.1, None, 0.2))]
    assert fitting._after_batch(rows, Path("o"))[1] == "1.toml"


def test_no_more_corners_are_asked_for_than_there_may_be(monkeypatch):
    monkeypatch.setattr("layerfit.stability.sweep.stability_of", lambda *_, **__: {"good": True})
    monkeypatch.setattr("layerfit.report.stability.table", lambda document: "")
    assert (
        layerfit("stability", "lambert", "--corners", 65536)
        .err.splitlines()[-1]
        .startswith("Next: layerfit stability lambert --corners 65536")
    )


def test_a_black_reference_has_a_misfit():
    from types import SimpleNamespace

    from layerfit.fit.weights import misfit

    black = np.zeros((4, 3))
    assert misfit([black], [SimpleNamespace(target=black, noise=None)], [np.ones((4, 3))]) == 0.0


def on_terminal(**environment):
    """What a command writes to a terminal."""
    master, slave = pty.openpty()
    keep = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "TERM", "FORCE_COLOR")}
    code = "from layerfit.cli.talk import stderr, stdout; stderr.print('[bold red]a'); stdout.print('[green]b')"
    ran = subprocess.run(
        [sys.executable, "-c", code], stdout=slave, stderr=slave, check=True, env={**keep, "TERM": "xterm", **environment}
    )
    assert ran.returncode == 0
    os.close(slave)
    return os.read(master, 10_000).decode()


def test_colours_only_on_a_terminal_that_may_have_them():
    assert "\x1b[" in on_terminal()
    assert "\x1b" not in on_terminal(NO_COLOR="1")
    ran = process("inspect", "nowhere.exr", environment={"TERM": "xterm"})
    assert ran.code == 2
    assert "\x1b" not in ran.err + ran.out, "colours where there is no terminal"


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("layerfit view lacquered_o", ["lacquered_oak"]),
        ("layerfit export x.json --target ess", ["essl300"]),
        ("layerfit fit x.toml --metric l", ["law", "log"]),
        ("layerfit spec", ["specialise"]),
        ("layerfit fit examples/", []),
    ],
)
def test_a_shell_completes_words(line, wanted):
    words = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1), "_LAYERFIT_COMPLETE": "complete_bash"}
    code = "import sys; sys.argv = ['layerfit']; from layerfit.__main__ import run; run()"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env={**os.environ, **words})
    assert ran.stdout.split() == wanted


def test_all_presets_are_completed():
    from layerfit.cli.complete import presets

    assert presets("") == sorted(preset.name for preset in shipped_presets())
    assert TRUTH["name"] not in presets("")
