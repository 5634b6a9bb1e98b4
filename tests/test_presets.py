"""The presets that ship: each is read, is what the writer writes, prints to a valid shader, and sends back no more than it gets."""

import json
import shutil
import subprocess

import jax
import numpy as np
import pytest

from layerfit._data import shaders
from layerfit.errors import InputError
from layerfit.preset import preset_of, read_preset
from layerfit.render import brdf
from layerfit.shader.export import HEADERS, print_material

PRESETS = sorted((shaders() / "presets").glob("*.json"))

MOST_ENERGY = 1.02
"""The corrected form may exceed 1 by one or two percent where a narrow lobe lies below a coat."""

EACH = pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)


@pytest.mark.wheel
def test_presets_ship():
    assert len(PRESETS) >= 5


@pytest.mark.wheel
@EACH
def test_a_preset_is_what_the_writer_writes(path):
    document = json.loads(path.read_text())
    assert document["name"] == path.stem
    assert path.read_text() == json.dumps(preset_of(read_preset(path), path.stem), indent=2) + "\n"


@EACH
def test_a_preset_is_told_of_in_the_list(path):
    assert f"| `{path.stem}` |" in (shaders() / "README.md").read_text()


@pytest.mark.wheel
@EACH
def test_a_preset_is_found_by_its_name(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert preset_of(read_preset(path.stem), path.stem) == preset_of(read_preset(path), path.stem)


def test_a_name_that_is_none_is_said_with_the_nearest():
    with pytest.raises(InputError, match=r"no shipped preset.*lacquered_copper"):
        read_preset("lacquered_coper")


@EACH
def test_a_preset_prints_to_a_valid_shader(path, tmp_path):
    if shutil.which("glslangValidator") is None:
        pytest.skip("no glslangValidator; on Debian or Ubuntu: apt-get install -y glslang-tools")
    stack = read_preset(path)
    # A film is integrated over the spectrum before it is printed: uniforms are refused, which test_film.py holds.
    ways = (False,) if getattr(stack.base, "has_film", False) else (False, True)
    for target in HEADERS:
        for uniforms in ways:
            file = tmp_path / f"{target}_{uniforms}.frag"
            file.write_text(print_material(stack, path.stem, uniforms).text(target))
            ran = subprocess.run(["glslangValidator", str(file)], capture_output=True, text=True, check=False)
            assert ran.returncode == 0, ran.stdout


@EACH
def test_a_preset_sends_back_no_more_than_it_gets(path):
    count = 65536
    u, v = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.618033988749895) % 1.0
    x, y = np.sqrt(u) * np.cos(2.0 * np.pi * v), np.sqrt(u) * np.sin(2.0 * np.pi * v)
    wo = np.stack([x, y, np.sqrt(1.0 - u)], -1)  # by the cosine: the albedo is pi times the mean
    values = jax.jit(brdf)
    stack = read_preset(path)
    for theta in np.radians([5.0, 45.0, 75.0]):
        wi = np.broadcast_to([np.sin(theta), 0.0, np.cos(theta)], wo.shape)
        albedo = np.pi * np.mean(values(stack, wi, wo), 0)
        assert np.all(albedo > 0.02)
        assert np.all(albedo < MOST_ENERGY), f"at {np.degrees(theta):.0f} degrees"
