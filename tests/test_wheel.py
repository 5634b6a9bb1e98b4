"""What has to work where layerfit is installed and nothing else of it is: `make wheel` runs these on the wheel, the others on the
source tree. Everything runs as a process of its own, in a folder that holds nothing.
"""

import json
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pytest

import layerfit
from commands import TRUTH, process
from layerfit._data import references, shaders
from layerfit.capture.exr import read_exr, write_exr

pytestmark = pytest.mark.wheel

STRIDE = 4
"""One pixel in 4 x 4 of a shipped reference: normals and positions are those of the pixel that is kept."""


@pytest.fixture
def preset(tmp_path):
    (tmp_path / "copper.json").write_text(json.dumps(TRUTH))
    return tmp_path / "copper.json"


def test_the_package_is_the_installed_one():
    assert distribution("layerfit").version == layerfit.__version__


def test_the_command_is_installed():
    command = Path(sys.executable).with_name("layerfit")
    ran = subprocess.run([command, "--version"], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, f"layerfit {layerfit.__version__}\n", "")


def test_types_ship():
    assert (Path(layerfit.__file__).parent / "py.typed").is_file()


def test_data_ship():
    for name in ("material.frag", "samples.frag", "cost.frag", "brdf.glsl", "lights.glsl", "output.glsl", "phong.glsl"):
        assert (shaders() / name).is_file(), name
    scenes = {path.stem for path in references().glob("*.toml")}
    assert {"lacquered_copper", "varnished_wood", "brushed_steel", "coated_paint"} <= scenes
    for scene in scenes:
        assert (references() / f"{scene}.exr").is_file(), scene


def test_a_shader_is_printed(preset, tmp_path):
    for target, head in (("glsl330", "#version 330 core"), ("essl300", "#version 300 es")):
        ran = process("export", "copper.json", "--target", target, cwd=tmp_path)
        assert ran.code == 0, ran.err
        assert ran.out.startswith(head)
        assert "vec3 lf_brdf(vec3 n, vec3 v, vec3 l)" in ran.out


def test_a_table_is_evaluated(preset, tmp_path):
    (tmp_path / "d.csv").write_text("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,1\n")
    ran = process("eval", "copper.json", "d.csv", cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert min(float(value) for value in ran.out.splitlines()[1].split(",")[6:]) > 0.1


def test_a_shipped_reference_is_fitted_and_its_shader_verified(gl, tmp_path):
    name = "lacquered_copper"
    channels = read_exr(references() / f"{name}.exr").channels
    write_exr(tmp_path / f"{name}.exr", {key: np.ascontiguousarray(a[::STRIDE, ::STRIDE]) for key, a in channels.items()})
    (tmp_path / f"{name}.toml").write_text((references() / f"{name}.toml").read_text())
    ran = process("fit", f"{name}.toml", "-o", "out", "--starts", "2", "--json", cwd=tmp_path)
    assert ran.code == 0, ran.err
    document = json.loads(ran.out)
    assert document["converged"] is True
    assert document["error"]["rel_l2"] < 0.05
    truth = json.loads((references() / f"{name}.truth.json").read_text())
    wanted = truth["material"]["coat"]["tau"]
    np.testing.assert_allclose(document["parameters"]["coat.tau"]["value"], wanted, atol=0.05)
    ran = process("verify", "out/preset.json", f"{name}.toml", "--json", cwd=tmp_path)
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["passed"] is True


def test_an_exr_is_inspected(tmp_path):
    ran = process("inspect", references() / "coated_paint.exr", "--json", cwd=tmp_path)
    assert json.loads(ran.out)["roles"]["normal"]["channels"], ran.err
