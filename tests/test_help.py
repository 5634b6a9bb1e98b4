"""What `--help` says: short enough to be read, and examples that run as they stand."""

import re
import shlex
import shutil

import pytest
import typer.main
from interrupts import PLAN, write_panel

from commands import layerfit, process, write_reference
from layerfit.cli import app
from layerfit.preset import read_preset
from layerfit.render import brdf_values
from measured_files import write_rgl
from test_cli import COMMANDS

pytestmark = pytest.mark.optimised

KNOWN = typer.main.get_command(app).commands  # pyright: ignore
EXAMPLES = [line for name in COMMANDS for line in re.findall(r"^  (layerfit .*)$", KNOWN[name].help, re.MULTILINE)]

LESS = {
    "fit": ["--starts", "1"],
    "structures": ["--only", "diffuse,metal"],
    "truth": ["--paths", "1000"],
    "tradeoff": ["--paths", "1000", "--rounds", "3"],
    "stability": ["--corners", "2", "--digits", "0", "--tiers", "0"],
}
"""Options that leave an example what it is and take most of its time away."""


SLOW = ("fit", "structures", "batch", "advise", "truth", "tradeoff", "specialise", "demo")


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """Every file that an example names; in place of the references that ship, a small one."""
    folder = tmp_path_factory.mktemp("workplace")
    shipped = folder / "examples" / "references"
    shipped.mkdir(parents=True)
    scene = write_reference(shipped)
    for name in ("lacquered_copper", "varnished_wood"):
        shutil.copy(scene, shipped / f"{name}.toml")
    scene.unlink()
    shutil.copytree(shipped, folder / "captures")
    shutil.copy(shipped / "lacquered_copper.toml", folder / "scene.toml")
    for name in ("reference.exr", "render.exr"):
        shutil.copy(shipped / "reference.exr", folder / name)
    (folder / "out").mkdir()
    shutil.copy(shipped / "truth.json", folder / "out" / "preset.json")
    (folder / "directions.csv").write_text("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,1\n")
    (folder / "depth.toml").write_text(PLAN)
    write_panel(folder, side=8)
    panel = folder / "panel.toml"
    coat = 'layers = [{ type = "coat", eta = 1.5, alpha = 0.1, absorption_per_mm = 20, thickness_um = 30 }]'
    panel.write_text(panel.read_text().replace("[material]", f"[material]\n{coat}"))
    stack = read_preset(shipped / "truth.json")
    write_rgl(folder / "paint.bsdf", lambda wi, wo: brdf_values(stack, wi, wo))
    return folder


@pytest.mark.parametrize("example", [pytest.param(e, marks=pytest.mark.slow if e.split()[1] in SLOW else ()) for e in EXAMPLES])
def test_an_example_runs(example, workplace, gl, tmp_path, monkeypatch):
    folder = shutil.copytree(workplace, tmp_path / "here")
    monkeypatch.chdir(folder)
    monkeypatch.setattr("layerfit.demo.references", lambda: folder / "captures")
    monkeypatch.setattr("layerfit.view.serve", lambda text, ready, open_browser: ready("http://127.0.0.1/"))
    words = shlex.split(example)[1:]
    ran = layerfit(*words, *LESS.get(words[0], ()))
    assert ran.code in (0, 1), ran.err  # 1: with findings, as one may have of a small reference
    if "-o" in words:
        assert (folder / words[words.index("-o") + 1]).exists()


def test_every_command_has_an_example():
    assert {example.split()[1] for example in EXAMPLES} == set(COMMANDS)


def said(*words, columns):
    return process(*words, "--help", environment={"COLUMNS": str(columns)}).out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_a_narrow_terminal(command):
    text = said(command, columns=60)
    assert "\x1b" not in text
    assert max(len(line) for line in text.splitlines() if not re.match(r" +layerfit ", line)) <= 60  # a command is not cut


def test_the_list_of_commands_is_not_cut():
    lines = re.findall(r"^  [a-z-]+  +(.*)$", said(columns=80).partition("Commands:\n")[2], re.MULTILINE)
    assert len(lines) >= len(COMMANDS)
    assert not [line for line in lines if line.endswith("...")]
