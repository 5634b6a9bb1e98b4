"""The commands as users run them: what they write, what they print, and how they end."""

import csv
import importlib
import io
import json
import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from commands import SIDE, TRUTH, layerfit, process, snapshot, write_reference
from layerfit import __version__, fit_scene
from layerfit._data import references
from layerfit.capture.exr import read_exr
from layerfit.errors import PIPE_CODE
from layerfit.preset import read_preset
from layerfit.render import brdf
from layerfit.shader.verify import check_image

pytestmark = pytest.mark.optimised

COMMANDS = (
    "fit",
    "structures",
    "batch",
    "advise",
    "map",
    "study",
    "render",
    "eval",
    "export",
    "verify",
    "view",
    "blender-kit",
    "truth",
    "tradeoff",
    "specialise",
    "stability",
    "presets",
    "gallery",
    "metal",
    "inspect",
    "demo",
    "doctor",
)

CONSTANT_LIGHT = """\
[[light]]
type = "constant"
radiance_rgb = [1, 1, 1]
[material]"""

FOUND = 1e-3
"""How near a fit comes to the parameters of a render of its own model: the render holds float32."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A small scene whose reference layerfit rendered."""
    return write_reference(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def fitted(scene, gl, tmp_path_factory):
    """A fit of it: its directory and what the command said."""
    directory = tmp_path_factory.mktemp("fit") / "deep" / "out"
    return directory, layerfit("fit", scene, "-o", directory, "--json")


def test_a_fit_ends_well(fitted):
    _, ran = fitted
    assert ran.code == 0, ran.err
    for block in ("[[Fit]]", "[[Parameters]]", "[[Correlations]]", "[[Left out]]", "[[Shader]]", "[[Time]]"):
        assert block in ran.err
    assert "converged:   yes" in ran.err
    assert ": PASS" in ran.err


def test_a_fit_leaves_these_files_and_no_others(fitted):
    directory, _ = fitted
    assert set(snapshot(directory)) == {"fit.json", "preset.json", "material.frag", "report.html", "fit.png", "trace.csv"}


def test_json_on_standard_output_is_the_result(fitted):
    directory, ran = fitted
    document = json.loads(ran.out)
    assert document == json.loads((directory / "fit.json").read_text())


def test_the_result_is_as_promised(fitted):
    directory, _ = fitted
    document = json.loads((directory / "fit.json").read_text(), parse_constant=pytest.fail)
    assert document["schema"] == "layerfit/fit"
    assert document["version"] == 1
    assert document["converged"] is True
    assert document["flags"] == []
    assert set(document["parameters"]) == {"coat.alpha", "coat.eta", "coat.tau", "base.alpha"}
    for name, row in document["parameters"].items():
        assert {"value", "start", "sigma", "at_bound", "identifiable"} <= set(row), name
        assert row["at_bound"] is None
        assert row["identifiable"] is True
    for a, b, r in document["correlations"]:
        assert isinstance(a, str)
        assert isinstance(b, str)
        assert 0.5 <= abs(r) <= 1.0
    assert document["unidentified"] == []
    assert set(document["error"]) == {"rel_l2", "psnr_db", "ssim", "delta_e"}
    assert document["parity"]["max_rel"] < 5e-5
    assert document["parity"]["p999_rel"] < 1e-5
    assert document["starts"] == 3
    assert document["preset"] == "preset.json"
    assert document["model"] == {
        "name": "corrected",
        "options": {},
        "layers": "Coat over Conductor",
        "why": "asked for; precise is the form nearest to the random walk for one coat",
    }
    assert document["quadrature"] is None
    assert document["weighting"]["noise"] == [False]


def test_the_time_is_accounted_for(fitted):
    document = json.loads(fitted[1].out)
    shares = dict(document["time"])
    total = shares.pop("total_s")
    assert {"import_s", "trace_s", "compile_s", "solve_s", "verify_s"} <= set(shares)
    assert all(value >= 0.0 for value in shares.values())
    assert total * 0.9 < sum(shares.values()) <= total * 1.001


def test_every_pixel_is_accounted_for(fitted):
    pixels = json.loads(fitted[1].out)["pixels"]
    assert pixels["used"] == pixels["usable"]
    assert pixels["used"] + sum(pixels["dropped"][0].values()) == SIDE * SIDE


def test_a_fit_finds_what_was_rendered(fitted):
    values = {name: row["value"] for name, row in json.loads(fitted[1].out)["parameters"].items()}
    coat, base = TRUTH["layers"][0], TRUTH["base"]
    truth = {"coat.alpha": coat["alpha"], "coat.eta": coat["eta"], "coat.tau": coat["tau"], "base.alpha": base["alpha"]}
    for name, wanted in truth.items():
        np.testing.assert_allclose(values[name], wanted, rtol=FOUND, err_msg=name)


def test_the_preset_is_the_fit(fitted):
    directory, ran = fitted
    found = json.loads(ran.out)["parameters"]
    stack = read_preset(directory / "preset.json")
    assert float(stack.layers[0].eta) == pytest.approx(found["coat.eta"]["value"], rel=1e-7)
    document = json.loads((directory / "preset.json").read_text())
    assert document["schema"] == "layerfit/preset"
    assert document["fit"]["sigma"]["coat.eta"] == found["coat.eta"]["sigma"]
    assert document["left_out"] == ["coat: anisotropy", "base: anisotropy"]


def test_the_shader_is_that_of_the_preset(fitted):
    directory, _ = fitted
    ran = layerfit("export", directory / "preset.json")
    body = lambda text: text.split("// Printed by layerfit")[1]  # noqa: E731  the first line names the file
    assert body(ran.out) == body((directory / "material.frag").read_text())


def test_the_picture_shows_four_panels(fitted):
    pixels = _pixels(fitted[0] / "fit.png").astype(int)
    panel = SIDE * round(256 / SIDE)
    assert pixels.shape[1] > 4 * panel
    assert panel < pixels.shape[0] < panel + 80
    left, right = pixels[40:panel, 8:panel], pixels[40:panel, 2 * (panel + 8) + 8 : 2 * (panel + 8) + panel]
    assert left.max() > 200  # the highlight
    assert np.mean(np.abs(left - right)) < 8.0  # reference and shader, but for the rim


def test_the_trace_is_error_against_time(fitted):
    rows = list(csv.DictReader(io.StringIO((fitted[0] / "trace.csv").read_text())))
    assert list(rows[0]) == ["time_s", "stage", "start", "step", "error"]
    times = [float(row["time_s"]) for row in rows]
    assert times == sorted(times)
    assert float(rows[-1]["error"]) < 1e-3 < float(rows[0]["error"])
    assert len(rows) == json.loads(fitted[1].out)["steps"]


def test_the_report_stands_alone(fitted):
    text = (fitted[0] / "report.html").read_text()
    assert not re.search(r'(src|href)="(?!data:)', text), "it would fetch something"
    for said in (
        "The fit converged",
        "coat.tau",
        "lit at a grazing angle or not at all (cosine below 0.1)",
        "corrected form",
        "5 % of the value",
    ):
        assert said in text, said
    for share in ("import", "trace", "compile", "solve", "verify"):
        assert re.search(rf"{share} \d+\.\d\d s \(\d+ %\)", text), share


def test_a_fit_again_replaces_the_files(fitted, scene, tmp_path):
    directory, ran = fitted
    before = json.loads(ran.out)
    directory = Path(shutil.copytree(directory, tmp_path / "out"))  # others look at what the first fit left
    again = layerfit("fit", scene, "-o", directory, "--json")
    document = json.loads(again.out)
    assert document["parameters"] == before["parameters"], "the same fit gives another result"
    assert set(snapshot(directory)) == {"fit.json", "preset.json", "material.frag", "report.html", "fit.png", "trace.csv"}


def test_a_render_is_linear_and_says_where_the_object_is(scene, tmp_path):
    ran = layerfit("render", scene.parent / "truth.json", scene, "-o", tmp_path / "new" / "copper.exr")
    assert (ran.code, ran.out) == (0, f"{tmp_path / 'new' / 'copper.exr'}\n")
    there, reference = read_exr(tmp_path / "new" / "copper.exr").channels, read_exr(scene.parent / "reference.exr").channels
    for channel in "RGBA":
        np.testing.assert_array_equal(there[channel], reference[channel])
    assert layerfit("render", scene.parent / "truth.json", scene, "-o", tmp_path / "copper.png").code == 0
    assert _pixels(tmp_path / "copper.png").shape == (SIDE, SIDE, 3)


def test_values_for_a_table_of_directions(scene, tmp_path):
    (tmp_path / "d.csv").write_text("wo_z,wi_x,wi_y,wi_z,wo_x,wo_y\n1,0,0,1,0,0\n0.6,0.8,0,0.6,-0.8,0\n0.6,0,0,-1,0.8,0\n")
    ran = layerfit("eval", scene.parent / "truth.json", tmp_path / "d.csv")
    assert ran.code == 0, ran.err
    rows = list(csv.DictReader(io.StringIO(ran.out)))
    assert list(rows[0]) == ["wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z", "f_r", "f_g", "f_b"]
    wi = np.array([[float(row[f"wi_{axis}"]) for axis in "xyz"] for row in rows])
    wo = np.array([[float(row[f"wo_{axis}"]) for axis in "xyz"] for row in rows])
    stack = read_preset(scene.parent / "truth.json").astype(np.float64)
    values = np.array([[float(row[f"f_{channel}"]) for channel in "rgb"] for row in rows])
    np.testing.assert_allclose(values, brdf(stack, wi, wo), rtol=1e-8)
    assert np.all(values[:2] > 0.0)
    assert np.all(values[2] == 0.0), "light from below"
    assert layerfit("eval", scene.parent / "truth.json", tmp_path / "d.csv", "-o", tmp_path / "v.csv").out == ""
    assert (tmp_path / "v.csv").read_text() == ran.out


def test_values_by_another_tier_and_by_the_random_walk(scene, tmp_path):
    (tmp_path / "d.csv").write_text("wo_z,wi_x,wi_y,wi_z,wo_x,wo_y\n1,0,0,1,0,0\n0.6,0.8,0,0.6,-0.8,0\n0.6,0,0,-1,0.8,0\n")

    def values(*options):
        ran = layerfit("eval", "piano_black", tmp_path / "d.csv", *options)
        assert ran.code == 0, ran.err
        rows = list(csv.DictReader(io.StringIO(ran.out)))
        return np.array([[float(row[name]) for name in list(rows[0])[6:]] for row in rows])

    exact, compact, truth = (
        values(),
        values("--tier", "compact", "--max-error", "1e-3"),
        values("--tier", "walk", "--paths", "2000"),
    )
    np.testing.assert_allclose(compact, exact, rtol=1e-3)
    assert np.any(compact != exact)
    assert truth.shape == (3, 6)
    assert np.all(truth[2] == 0.0), "light from below"
    off = np.abs(truth[:2, :3] - exact[:2])
    assert np.all(off < 5.0 * truth[:2, 3:] + 0.03 * exact[:2])
    assert np.all(truth[:2, 3:] > 0.0)
    bare = tmp_path / "bare.json"
    bare.write_text(json.dumps({key: value for key, value in TRUTH.items() if key != "layers"}))
    assert layerfit("eval", bare, tmp_path / "d.csv", "--paths", "5").err.count("--paths is for --tier walk") == 1
    refused = layerfit("export", bare, "--tier", "walk")
    assert (refused.code, refused.out) == (2, "")
    assert "no shader does the random walk" in refused.err
    for name, options in (("walked.exr", ("--tier", "walk")), ("exact.exr", ())):
        drawn = layerfit("render", bare, scene, *options, "-o", tmp_path / name)
        assert drawn.code == 0, drawn.err
    there, reference = (read_exr(tmp_path / name).channels["G"] for name in ("walked.exr", "exact.exr"))
    assert np.max(reference) > 0.0
    np.testing.assert_allclose(there, reference, rtol=1e-4, atol=1e-6)


def test_no_directions_no_values(scene, tmp_path):
    (tmp_path / "d.csv").write_text("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n")
    assert layerfit("eval", scene.parent / "truth.json", tmp_path / "d.csv").out.splitlines() == [
        "wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,f_r,f_g,f_b"
    ]


@pytest.mark.parametrize(("target", "head"), [("glsl330", "#version 330 core"), ("essl300", "#version 300 es")])
def test_a_shader_for_each_target(scene, tmp_path, target, head):
    ran = layerfit("export", scene.parent / "truth.json", "--target", target)
    assert ran.code == 0, ran.err
    assert ran.out.startswith(head)
    layerfit("export", scene.parent / "truth.json", "--target", target, "-o", tmp_path / "a.frag")
    assert (tmp_path / "a.frag").read_text() == ran.out


def test_a_shader_with_uniforms(scene):
    text = layerfit("export", scene.parent / "truth.json", "--uniforms").out
    assert "uniform float u_coat_alpha;" in text
    assert "uniform vec3 u_base_eta;" in text
    assert "const Coat" not in text


def test_verification_passes_and_names_the_worst_value(scene, gl):
    ran = layerfit("verify", scene.parent / "truth.json", "--json")
    assert ran.code == 0, ran.err
    assert ran.err.splitlines()[-2:] == ["PASS", "Next: layerfit export " + str(scene.parent / "truth.json") + " -o truth.frag"]
    assert re.search(r"worst value: [rgb] at wi \(.*\), wo \(.*\): shader \S+, JAX \S+", ran.err)
    document = json.loads(ran.out)
    assert document["passed"] is True
    assert document["image"] == {}
    assert {"max_rel", "p999_rel", "worst"} <= set(document["parity"])
    assert document["renderer"]


def test_verification_against_a_reference(scene, gl, tmp_path):
    ran = layerfit("verify", scene.parent / "truth.json", scene, "-o", tmp_path, "--json")
    assert ran.code == 0, ran.err
    image = json.loads(ran.out)["image"]
    assert set(image) >= {"psnr_db", "ssim", "delta_e"}
    assert image["psnr_db"] > 90.0  # the reference is this material
    assert _pixels(tmp_path / "verify.png").shape[1] > 4 * SIDE


@pytest.mark.parametrize("limit", ["--fail", "--hardfail"])
def test_verification_that_fails_is_a_finding(scene, gl, limit):
    ran = layerfit("verify", scene.parent / "truth.json", limit, "1e-9")
    assert ran.code == 1
    assert ran.err.splitlines()[-2:] == ["FAILURE", "Next: layerfit doctor"]


def test_a_shader_that_is_not_the_material_is_a_finding(scene, gl, tmp_path, monkeypatch):
    """A driver that makes NaN of everything: seen, said, and still valid JSON."""
    monkeypatch.setattr(
        "layerfit.shader.verify.shade_points", lambda text, attributes, *_: np.full((len(attributes["v_wo"]), 3), np.nan)
    )
    ran = layerfit("verify", scene.parent / "truth.json", "--json")
    assert ran.code == 1
    assert "max not finite" in ran.err
    assert ran.err.splitlines()[-2:] == ["FAILURE", "Next: layerfit doctor"]
    assert json.loads(ran.out, parse_constant=pytest.fail)["parity"]["max_rel"] is None
    ran = layerfit("fit", scene, "-o", tmp_path, "--json")
    assert ran.code == 1
    document = json.loads(ran.out, parse_constant=pytest.fail)
    assert document["converged"] is True
    assert document["flags"] == ["shader_differs"]
    assert "is NOT the fitted material" in (tmp_path / "report.html").read_text()


def test_a_driver_that_miscompiles_gets_no_shader(scene, gl, tmp_path, monkeypatch):
    """One channel of one pixel is 1 % off: it is named, the shader of an earlier fit goes, and `--force` writes the new one."""
    x, y, row = 20, 17, []

    def miscompiled(image, model, index, width):
        row[:] = np.flatnonzero(index == y * width + x)
        image[row, 1] *= 1.01
        return check_image(image, model, index, width)

    monkeypatch.setattr("layerfit.drawings.check_image", miscompiled)
    (tmp_path / "material.frag").write_text("of an earlier fit")
    (tmp_path / "fit.json").write_text('{"schema": "layerfit/fit"}')
    ran = layerfit("fit", scene, "-o", tmp_path, "--starts", "1", "--json")
    assert row, "a pixel of the sphere"
    assert ran.code == 1
    assert "material.frag is NOT written" in ran.err
    assert f"g at pixel x {x}, y {y}" in ran.err
    worst = json.loads(ran.out)["parity"]["worst"]
    assert (worst["x"], worst["y"], worst["channel"]) == (x, y, "g")
    assert not (tmp_path / "material.frag").exists()
    assert f"pixel x {x}, y {y}" in (tmp_path / "report.html").read_text()
    assert layerfit("fit", scene, "-o", tmp_path, "--starts", "1", "--force").code == 1
    assert "lf_brdf" in (tmp_path / "material.frag").read_text()


def test_a_fit_that_does_not_converge_is_a_finding(scene, gl, tmp_path, monkeypatch):
    for module, steps in (("fit", "FINE_STEPS"), ("starts", "FINE_STEPS"), ("starts", "COARSE_STEPS")):
        monkeypatch.setattr(importlib.import_module(f"layerfit.fit.{module}"), steps, 1)
    ran = layerfit("fit", scene, "-o", tmp_path, "--starts", "1", "--json")
    assert ran.code == 1, ran.err
    document = json.loads(ran.out)
    assert document["converged"] is False
    assert "not_converged" in document["flags"]
    assert "converged:   NO" in ran.err
    assert "did NOT converge" in (tmp_path / "report.html").read_text()


def test_an_inspection(scene):
    ran = layerfit("inspect", scene.parent / "reference.exr", "--json")
    assert ran.code == 0, ran.err
    document = json.loads(ran.out)
    assert document["roles"]["beauty"]["channels"] == ["R", "G", "B"]
    assert [c["name"] for c in document["channels"]] == ["A", "B", "G", "R"]
    table = layerfit("inspect", scene.parent / "reference.exr")
    assert "R, G, B" in table.out
    hint, last = table.err.splitlines()
    assert Path(hint.split()[-1]).is_file(), "a scene file to begin from: there is none beside the render"
    assert last.startswith("Next: layerfit fit ")
    shipped = layerfit("inspect", references() / "lacquered_copper.exr")
    assert shipped.err.startswith("Next: layerfit fit ")


def test_a_shipped_reference_by_the_process_itself(gl, tmp_path):
    """Start to end as a user runs it: exit code, streams and all."""
    ran = process("fit", references() / "brushed_steel.toml", "-o", "steel", "--starts", "2", "--json", cwd=tmp_path)
    assert ran.code == 0, ran.err
    parameters = json.loads(ran.out)["parameters"]
    truth = json.loads((references() / "brushed_steel.truth.json").read_text())
    for axis in ("alpha_x", "alpha_y"):
        wanted = _find(truth, axis)
        assert math.isclose(parameters[f"base.{axis}"]["value"], wanted, rel_tol=1e-4), axis
    assert "\x1b" not in ran.err, "colours where there is no terminal"
    assert (tmp_path / "steel" / "fit.png").is_file()


def _pixels(path):
    with Image.open(path) as picture:
        return np.asarray(picture)


def _find(document, key):
    if isinstance(document, dict):
        return document[key] if key in document else next(filter(None, (_find(v, key) for v in document.values())), None)
    return next(filter(None, (_find(v, key) for v in document)), None) if isinstance(document, list) else None


def test_a_fit_from_python_takes_paths_as_text(scene, gl, tmp_path):
    outcome = fit_scene(str(scene), str(tmp_path / "out"), starts=1)
    assert outcome.good
    assert outcome.directory == tmp_path / "out"
    assert (tmp_path / "out" / "fit.json").is_file()


def test_the_demonstration_fits_what_is_shipped(scene, gl, tmp_path, monkeypatch):
    monkeypatch.setattr("layerfit.demo.references", lambda: scene.parent)
    ran = layerfit("demo", "-o", tmp_path)
    assert ran.code == 0, ran.err
    assert "[1/1] scene" in ran.err
    assert str(tmp_path / "scene" / "fit.png") in ran.err
    assert (tmp_path / "scene" / "fit.json").is_file()


def test_a_closed_pipe_is_no_fault(scene):
    """As in `layerfit export preset.json | head -1`."""
    arguments = [sys.executable, "-m", "layerfit", "export", scene.parent / "truth.json"]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as ran:
        ran.stdout.close()
        assert ran.stderr.read() == b""
    assert ran.returncode == PIPE_CODE


def test_closed_standard_output_is_said():
    ran = subprocess.run(
        f"exec {sys.executable} -m layerfit presets wood >&-", shell=True, stderr=subprocess.PIPE, text=True, check=False
    )
    assert ran.returncode == 2
    assert ran.stderr.startswith("layerfit: standard output is closed")


@pytest.mark.parametrize("arguments", [["presets", "wood"], ["presets", "wood", "--json"]])
def test_standard_output_on_a_full_disk_is_said(arguments):
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "layerfit", *arguments]
        ran = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert ran.returncode == 2
    assert ran.stderr == ("layerfit: standard output: cannot be written: No space left on device. Send it to another place.\n")


def test_light_from_everywhere_is_reported_as_a_quadrature(scene, gl, tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.import_module("layerfit.fit.pixels"), "EVALUATIONS", 128 * 496)
    text = re.sub(r"\[\[light\]\].*?\[material\]", CONSTANT_LIGHT, scene.read_text(), flags=re.DOTALL)
    text = re.sub(r"free = .*", 'free = ["coat.tau"]', text).replace("reference.exr", "lit.exr")
    (tmp_path / "lit.toml").write_text(text)
    shutil.copy(scene.parent / "reference.exr", tmp_path / "lit.exr")
    assert layerfit("render", scene.parent / "truth.json", tmp_path / "lit.toml", "-o", tmp_path / "lit.exr").code == 0
    ran = layerfit("fit", tmp_path / "lit.toml", "-o", tmp_path / "out", "--starts", "1", "--json")
    document = json.loads(ran.out)
    quadrature = document["quadrature"]
    assert quadrature["directions"] == 124 > quadrature["fit_directions"]
    assert 0.0 < quadrature["rms"] < quadrature["fit_rms"] < 0.2, "more directions, less error"
    assert re.search(r"light: +quadrature: pictures 124 directions a pixel, [\d.]+ % rms error", ran.err)
    pixels = document["pixels"]
    assert pixels["used"] < pixels["usable"]
    assert f"{pixels['used']} used, drawn at random from {pixels['usable']}" in ran.err


@pytest.fixture(scope="module")
def helped():
    """What each command says of itself, all in one process, and whether that has imported a package which takes time."""
    watch = """
import contextlib, io, json, sys
from layerfit.cli import app
said = {}
for command in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()) as text:
        app([command, "--help"], standalone_mode=False)
    said[command] = text.getvalue(), "jax" in sys.modules or "numpy" in sys.modules
json.dump(said, sys.stdout)
"""
    return json.loads(subprocess.run([sys.executable, "-c", watch, *COMMANDS], capture_output=True, check=True).stdout)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples_and_costs_nothing(command, helped):
    said, heavy = helped[command]
    assert not heavy, "help should need neither jax nor numpy"
    assert f"Examples:\n    layerfit {command}" in said


def test_all_commands_are_listed_and_tried():
    listed = layerfit("--help").out
    assert re.findall(r"^  ([a-z][\w-]*)  ", listed, re.MULTILINE) == list(COMMANDS)


def test_the_version():
    assert layerfit("--version").out == f"layerfit {__version__}\n"


def test_no_command_is_help():
    assert "Commands" in (ran := layerfit()).out + ran.err
    assert ran.code == 2


@pytest.mark.parametrize("module", ["layerfit", "layerfit.cli"])
def test_names_cost_nothing_to_import(module):
    code = f"import sys, {module}; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, cwd=Path("/")).returncode == 0


def test_presets_are_listed():
    ran = layerfit("presets", "lacquered")
    assert ran.code == 0
    lines = ran.out.splitlines()
    assert "metal" in lines
    assert "wood" in lines
    assert re.search(r"^  lacquered_copper +rough copper under an amber lacquer$", ran.out, re.MULTILINE)
    documents = json.loads(layerfit("presets", "lacquered", "--json").out)
    assert [document["name"] for document in documents] == [line.split()[0] for line in lines if line.startswith("  ")]
    assert Path(documents[0]["path"]).is_file()
    assert layerfit("presets").out.count("\n") > len(lines)
    both = layerfit("presets", "copper lacquer", "--json")
    assert [document["name"] for document in json.loads(both.out)] == ["lacquered_copper"]


def test_a_word_that_no_preset_has_is_said():
    ran = layerfit("presets", "unobtainium")
    assert (ran.code, ran.out) == (2, "")
    assert "no shipped preset has 'unobtainium' in its name or description" in ran.err
