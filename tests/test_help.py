"""What `--help` says: short enough to be read, and examples that run as they stand, as do the commands of README and docs."""

import re
import shlex
import shutil
from importlib import import_module

import numpy as np
import pytest
import typer.main
from interrupts import PLAN, write_panel

from commands import SCENE, layerfit, write_reference
from layerfit.cli import app
from layerfit.preset import read_preset
from layerfit.render import brdf_values
from measured_files import write_cornell, write_rgl
from test_cli import COMMANDS
from test_docs import blocks, commands

KNOWN = typer.main.get_command(app).commands  # pyright: ignore
HELP = [line for name in COMMANDS for line in re.findall(r"^  (layerfit .*)$", KNOWN[name].help, re.MULTILINE)]
PAGES = [
    shlex.join(words) for block in blocks("console", "sh") for words in commands(block.values[0]) if words[0] == "layerfit"
]


def kind(example: str) -> tuple[str, ...]:
    """The command, the kind of file that it takes, and its options: of those that differ in names and numbers alone one is run.

    A preset by its file is one by its name: each is in many examples.
    """
    _, command, *words = shlex.split(example)
    endings = [word.rpartition(".")[2] for word in words[:2] if "." in word and not word.endswith(".json")]
    return command, *endings, *sorted(word for word in words if word.startswith("-"))


LONG = ("stability", "tradeoff")
"""Of these the examples of the help alone are run."""
EXAMPLES = list({kind(e): e for e in [*PAGES, *HELP] if e in HELP or e.split()[1] not in LONG}.values())

LESS = {
    "--workers": ["--workers", "2"],
    "fit": ["--starts", "1"],
    "structures": ["--only", "diffuse,metal"],
    "truth": ["--paths", "1000"],
    "tradeoff": ["--paths", "1000", "--rounds", "3"],
    "stability": ["--corners", "2", "--digits", "0", "--tiers", "0"],
}
"""Options that leave an example what it is and take most of its time away."""

OPTIMISED = ("fit", "batch", "demo", "truth", "render", "eval", "study")
"""What computes more than it compiles, or is compiled by other tests and programs too."""

SLOW = ("fit", "structures", "batch", "advise", "truth", "tradeoff", "specialise", "demo")


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """Every file that an example names; in place of the references that ship, and of what others measured, small ones."""
    folder = tmp_path_factory.mktemp("workplace")
    shipped = folder / "examples" / "references"
    shipped.mkdir(parents=True)
    scene = write_reference(shipped)
    for name in ("lacquered_copper", "varnished_wood", "brushed_steel"):
        shutil.copy(scene, shipped / f"{name}.toml")
    scene.unlink()
    shutil.copytree(shipped, folder / "captures", ignore=shutil.ignore_patterns("brushed_steel.toml"))  # two scenes are several
    every_start_has = 'free = ["coat.alpha", "coat.eta", "base.alpha"]'
    (folder / "scene.toml").write_text(re.sub("free = .*", every_start_has, SCENE))
    for name in ("reference.exr", "render.exr"):
        shutil.copy(shipped / "reference.exr", folder / name)
    (folder / "out" / "copper").mkdir(parents=True)
    for preset in ("out/preset.json", "out/copper/preset.json"):
        shutil.copy(shipped / "truth.json", folder / preset)
    assert layerfit("export", shipped / "truth.json", "--to", "gltf", "-o", folder / "copper.gltf").code == 0
    (folder / "directions.csv").write_text("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,1\n")
    (folder / "depth.toml").write_text(PLAN)
    write_panel(folder, side=8)
    panel = folder / "panel.toml"
    coat = 'layers = [{ type = "coat", eta = 1.5, alpha = 0.1, absorption_per_mm = 20, thickness_um = 30 }]'
    panel.write_text(panel.read_text().replace("[material]", f"[material]\n{coat}"))
    stack = read_preset(shipped / "truth.json")
    for word in {word for example in EXAMPLES for word in shlex.split(example)}:
        if word.endswith(".bsdf"):
            write_rgl(folder / word, lambda wi, wo: brdf_values(stack, wi, wo))
        elif word.endswith(".brdf"):
            write_cornell(folder / word, lambda wi, wo, nm: brdf_values(stack, wi, wo)[:, :1] * np.ones_like(nm))
    (folder / "paint.toml").write_text('[reference]\nbrdf = "paint.bsdf"\n[material]' + SCENE.partition("[material]")[2])
    return folder


def marks(example: str) -> list[pytest.MarkDecorator]:
    command = example.split()[1]
    return [mark for mark, of in ((pytest.mark.slow, SLOW), (pytest.mark.optimised, OPTIMISED)) if command in of]


@pytest.mark.parametrize("example", [pytest.param(e, marks=marks(e)) for e in EXAMPLES])
def test_an_example_runs(example, workplace, gl, tmp_path, monkeypatch):
    folder = shutil.copytree(workplace, tmp_path / "here")
    monkeypatch.chdir(folder)
    monkeypatch.setattr("layerfit.demo.references", lambda: folder / "captures")
    monkeypatch.setattr("layerfit.shader.cost.LEAST_MS", 0.1)
    monkeypatch.setattr("layerfit.shader.cost.SIDE", 64)
    monkeypatch.setattr(import_module("layerfit.study.variants"), "COMPACT_ERRORS", (1e-2,))
    monkeypatch.setattr(import_module("layerfit.study.variants"), "TABLE_ENTRIES", (16,))
    monkeypatch.setattr("layerfit.view.serve", lambda text, ready, open_browser: ready("http://127.0.0.1/"))
    words = shlex.split(example)[1:]
    ran = layerfit(*words, *(less for word in words for less in LESS.get(word, ())))
    assert ran.code in (0, 1), ran.err  # 1: with findings, as one may have of a small reference
    if "-o" in words:
        assert (folder / words[words.index("-o") + 1]).exists()


def test_every_command_has_an_example():
    assert {example.split()[1] for example in HELP} == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_a_narrow_terminal(command):
    text = layerfit(command, "--help", columns=60).out
    assert "\x1b" not in text
    assert max(len(line) for line in text.splitlines() if not re.match(r" +layerfit ", line)) <= 60  # a command is not cut


def test_the_list_of_commands_is_not_cut():
    lines = re.findall(r"^  [a-z-]+  +(.*)$", layerfit("--help", columns=80).out.partition("Commands:\n")[2], re.MULTILINE)
    assert len(lines) >= len(COMMANDS)
    assert not [line for line in lines if line.endswith("...")]
