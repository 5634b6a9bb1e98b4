"""What is wrong with a file, an argument or the machine: one message that says what, where, why and what to do. Exit code 2, no
traceback, and nothing on the disk that was not there before.
"""

import json
import os
import re
import resource
import shlex
import shutil
import sys
from pathlib import Path
from unittest import mock

import moderngl
import numpy as np
import pytest
from interrupts import PLAN, write_panel

from commands import SIDE, TRUTH, layerfit, process, snapshot, write_reference
from layerfit.capture.exr import read_exr, write_exr

pytestmark = pytest.mark.optimised

MIDDLE = SIDE // 2


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A folder in which everything is as it should be."""
    return write_reference(tmp_path_factory.mktemp("good")).parent


@pytest.fixture
def folder(good, tmp_path):
    """A copy of it to spoil, with results of an earlier fit."""
    shutil.copytree(good, tmp_path / "in")
    (tmp_path / "in" / "out").mkdir()
    for name in ("fit.json", "preset.json", "report.html"):
        (tmp_path / "in" / "out" / name).write_text("of an earlier fit")
    return tmp_path / "in"


def refused(folder, ran, *said):
    """One message, exit code 2, and nothing else anywhere."""
    assert ran.code == 2, ran
    assert ran.out == ""
    assert ran.err.count("layerfit:") == 1, ran.err
    assert ran.err.startswith("layerfit: ")
    assert "Traceback" not in ran.err
    for pattern in said:
        assert re.search(pattern, ran.err), (pattern, ran.err)


def refuses(folder, arguments, *said):
    before = snapshot(folder)
    refused(folder, layerfit(*arguments), *said)
    assert snapshot(folder) == before, "something was written"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def change(path: Path, **changes: object) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def spoil(path: Path, values: float, where: object) -> None:
    """Set some pixels of a picture."""
    channels = {name: np.array(a) for name, a in read_exr(path).channels.items()}
    for channel in "RGB":
        channels[channel][where] = values
    write_exr(path, channels)


def truncate(folder):
    path = folder / "reference.exr"
    path.write_bytes(path.read_bytes()[:-700])


def not_a_picture(folder):
    (folder / "reference.exr").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))


def without_green(folder):
    channels = dict(read_exr(folder / "reference.exr").channels)
    write_exr(folder / "reference.exr", {name: channels[name] for name in ("R", "B", "A")})


def lit_from(light):
    def spoil(folder):
        scene = folder / "scene.toml"
        text = scene.read_text()
        scene.write_text(re.sub(r"\[\[light\]\].*?\[material\]", f"[[light]]\n{light}\n[material]", text, flags=re.DOTALL))

    return spoil


def in_scene(old, new):
    return lambda folder: edit(folder / "scene.toml", old, new)


SCENES = {
    "truncated EXR": (truncate, [r"reference\.exr: .*(cut off|damaged)", r"block|byte"]),
    "another format": (not_a_picture, [r"reference\.exr: .*PNG"]),
    "missing EXR": (lambda f: (f / "reference.exr").unlink(), [r"reference\.exr: .*(not|No such)"]),
    "EXR is a directory": (in_scene('"reference.exr"', '"out"'), [r"/out: .*(folder|directory)"]),
    "missing channel": (without_green, [r"there is no beauty", r'beauty = "LAYER"', r"the file holds A, B, R"]),
    "no normals": (in_scene('[geometry]\nkind = "sphere"\n', ""), [r"no normal channel", r'kind = "sphere"']),
    "all black": (lambda f: spoil(f / "reference.exr", 0.0, ...), [r"reference\.exr: the object is black", r"check"]),
    "all NaN": (lambda f: spoil(f / "reference.exr", np.nan, ...), [r"only 0 of 2304 pixels", r"\d+ NaN or infinite"]),
    "camera in the sphere": (
        in_scene("[0.8, 0.6, 4.9]", "[0.2, 0.1, 0.3]"),
        [r"inside the sphere", r"check camera\.position and geometry\.radius"],
    ),
    "sphere out of sight": (in_scene("look_at = [0, 0, 0]", "look_at = [0.8, 0.6, 9]"), [r"only 0 of 2304", r"not covered"]),
    "light below": (in_scene("[2, 2.4, 3]", "[-2, -2.4, -3]"), [r"no light reaches the visible side", r"\[\[light\]\]"]),
    "spherical light below": (
        lit_from('type = "sphere"\ncenter = [-8, -6, -49]\nradius = 1\nradiance_rgb = 9'),
        [r"no light reaches the visible side", r"\[\[light\]\]"],
    ),
    "light around the object": (
        lit_from('type = "sphere"\ncenter = [0, 0, 0]\nradius = 2\nradiance_rgb = 9'),
        [r"holds part of the surface", r"smaller or move"],
    ),
    "map is missing": (lit_from('type = "envmap"\nfile = "sky.exr"'), [r"sky\.exr: ", r"(not|No such)"]),
    "unknown key": (
        in_scene("vfov_deg", "vfov_degree"),
        [r"scene\.toml: camera", r"'vfov_degree'", r"did you mean 'vfov_deg'"],
    ),
    "unknown parameter": (
        in_scene('"coat.tau"', '"coat.tauu"'),
        [r"scene\.toml: fit\.free", r"did you mean 'coat\.tau'", r"This material has"],
    ),
    "no effect": (
        lambda f: (in_scene('"coat.tau", ', "")(f), in_scene("tau = [0.3, 0.3, 0.3]", "tau = [19, 19, 19]")(f)),
        [r"base\.alpha has no effect on this image at any start", r"leave it out"],
    ),
    "nothing to fit": (
        in_scene('free = ["coat.alpha", "coat.eta", "coat.tau", "base.alpha"]', "free = []"),
        [r"nothing is left to fit"],
    ),
    "broken TOML": (in_scene("[camera]", "[camera"), [r"scene\.toml: not valid TOML", r"line 5"]),
    "mask of another size": (
        lambda f: (write_exr(f / "m.exr", {"Y": np.ones((4, 4))}), in_scene("[geometry]", 'mask = "m.exr"\n[geometry]')(f)),
        [r"m\.exr: the mask is 4 x 4, the reference 48 x 48"],
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_cannot_be_fitted(name, folder, gl):
    fault, said = SCENES[name]
    fault(folder)
    refuses(folder, ["fit", folder / "scene.toml", "-o", folder / "out"], *said)


PRESETS = {
    "broken JSON": (lambda p: edit(p, "{", "{{"), [r"not valid JSON", r"line 1"]),
    "another kind": (lambda p: change(p, schema="lamp/preset"), [r"not a preset", r"lamp/preset", r"layerfit/preset"]),
    "a newer version": (lambda p: change(p, version=2), [r"version 2", r"reads version 1"]),
    "no version": (lambda p: change(p, version=None), [r"version None", r"reads version 1"]),
    "unknown key": (lambda p: change(p, bases=1), [r"unknown key 'bases'", r"did you mean 'base'"]),
    "unknown layer": (lambda p: edit(p, '"coat"', '"cote"'), [r"layers\[0\]: type = 'cote'", r"did you mean 'coat'"]),
    "out of range": (lambda p: edit(p, "1.5", "0.5"), [r"layers\[0\]\.eta = 0\.5", r"outside its range 1 to 3"]),
    "not a number": (lambda p: edit(p, "0.12", "NaN"), [r"layers\[0\]\.alpha = nan", r"finite"]),
    "a list": (lambda p: p.write_text("[]"), [r"a table of keys"]),
    "empty": (lambda p: p.write_text(""), [r"not valid JSON"]),
    "missing": (lambda p: p.unlink(), [r"cannot be read: No such file", r"Check the path"]),
    "a directory": (lambda p: (p.unlink(), p.mkdir()), [r"directory"]),
    "a picture": (lambda p: shutil.copy(p.parent / "reference.exr", p), [r"is an EXR image", r"layerfit inspect"]),
}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_that_is_none(name, folder):
    fault, said = PRESETS[name]
    fault(folder / "truth.json")
    refuses(folder, ["export", folder / "truth.json", "-o", folder / "out" / "a.frag"], r"truth\.json: ", *said)


@pytest.mark.parametrize("command", ["fit", "render", "eval", "export", "verify", "inspect"])
def test_a_directory_for_a_file(command, folder):
    more = {"render": [folder / "scene.toml", "-o", folder / "a.exr"], "eval": [folder / "d.csv"]}.get(command, [])
    refuses(folder, [command, folder / "out", *more], r"/out: ", r"(is a|Is a) (directory|folder)")


TABLES = {
    "wrong column": ("wi_x,wi_y,wi_z,wo_x,wo_y,woz\n", [r"header lacks wo_z", r"wi_x wi_y wi_z wo_x wo_y wo_z"]),
    "no header": ("0,0,1,0,0,1\n", [r"header lacks wi_x"]),
    "empty": ("", [r"header lacks wi_x"]),
    "a word": ("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,up\n", [r"line 2: a number is missing or is none"]),
    "a short row": ("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,1\n0,0,1,0,0\n", [r"line 3: a number is missing or is none"]),
    "NaN": ("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,nan,0,0,1\n", [r"row 1 holds a number that is not finite"]),
    "no unit vector": ("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,2,0,0,1\n", [r"row 1: a direction has length 2", r"unit vectors"]),
    "bytes": (b"\xff\xfe\x00", [r"not a CSV file in UTF-8"]),
}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_that_cannot_be_read(name, folder):
    content, said = TABLES[name]
    (folder / "d.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    arguments = ["eval", folder / "truth.json", folder / "d.csv", "-o", folder / "out" / "v.csv"]
    refuses(folder, arguments, r"d\.csv: ", *said)


MISUSED = {
    "fit": r"fit: Missing argument 'scene'\. `layerfit fit --help`",
    "ft scene.toml": r"Did you mean 'fit'\? `layerfit --help`",
    "help fit": r"No such command 'help'\. `layerfit --help`",
    "--json presets": r"--json is of a command: put it after, as in `layerfit presets --json`",
    "fit scene.toml --ouput x": r"fit: No such option: --ouput .*--output.*`layerfit fit --help`",
    "fit scene.toml extra": r"unexpected extra argument.*extra.*`layerfit fit --help`",
    "fit scene.toml -o ''": r"an argument is empty: has a variable of the shell no value\?",
    "fit scene.toml --starts ten": r"fit: Invalid value for '--starts'.*`layerfit fit --help`",
    "fit scene.toml --starts 1001": r"fit\.starts = 1001: should be a whole number from 1 to 1000",
    "fit scene.toml --loss hubert": r"fit\.loss = 'hubert': should be one of square, huber, cauchy \(did you mean 'huber'\?\)",
    "batch scene.toml --metric loog": r"metric = 'loog': should be one of .*did you mean 'log'",
    "structures scene.toml --metric loog": r"metric = 'loog': should be one of .*did you mean 'log'",
    "structures scene.toml --only metl": r"structure 'metl': should be one of .*did you mean 'metal'",
    "map scene.toml --free coat.alpha --starts 1001": r"map\.starts = 1001: should be a whole number",
    "map scene.toml --free coat.alpha --shared coat.alpha": r"coat\.alpha is both free and shared",
    "fit scene": r"scene: cannot be read: No such file.*did you mean 'scene\.toml'",
    "inspect referense.exr": r"cannot be read: No such file.*did you mean 'reference\.exr'",
    "fit lacquered_copper": r"is a preset that ships, not a scene file.*--start lacquered_copper",
    "fit truth.json": r"is a layerfit/preset, not a scene file.*preset = \"truth\.json\"",
    "fit reference.exr": r"reference\.exr: is an EXR image.*layerfit inspect",
    "render scene.toml truth.json -o a.exr": r"is a scene file, not a preset.*layerfit presets",
    "render truth.json scene.toml -o a.exr --max-error 0.01": r"--max-error is for --tier compact or tables",
    "export truth.json --target glsl33": r"--target glsl33: .*essl300.*did you mean 'glsl330'",
    "export truth.json --max-error 0": r"a largest error of 0: it should be above 0",
    "export truth.json --max-error nan": r"a largest error of nan: it should be above 0",
    "export truth.json --to gltf --target essl300": r"--target, .* are of the shader: leave them out, or --to",
    "export truth.json --to gltf -o copper.mtlx": r"copper\.mtlx: --to gltf writes a file that ends in \.gltf",
    "verify truth.json --fail nan": r"--fail nan: should be a relative difference of 0 or more",
    "blender-kit -o .": r"\.: cannot be written: it is a directory.*the name of a file",
    "presets coper": r"no shipped preset has 'coper'.*did you mean 'copper'",
    "study plan.toml -o new": r"plan\.toml: vary: unknown 'base\.alfa' \(did you mean 'base\.alpha'\?\)",
    "metal coppr": r"'coppr' is not known; near are copper\. `layerfit metal` lists",
}
"""Wrong words by the message for them."""


@pytest.mark.parametrize("words", MISUSED)
def test_wrong_words_are_told_what_is_right(words, folder, monkeypatch):
    monkeypatch.chdir(folder)
    Path("plan.toml").write_text(PLAN.replace("base.alpha", "base.alfa"))
    refuses(folder, shlex.split(words), MISUSED[words])


def outputs(folder):
    """Commands that write, to a place yet to be named."""
    (folder / "d.csv").write_text("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z\n0,0,1,0,0,1\n")
    (folder / "plan.toml").write_text(PLAN)
    write_panel(folder, side=8)
    scene, preset, bare = folder / "scene.toml", folder / "truth.json", folder / "bare.json"
    bare.write_text(json.dumps(TRUTH | {"layers": []}))
    return {
        "map": ["map", folder / "panel.toml", "-o"],
        "study": ["study", folder / "plan.toml", "-o"],
        "batch": ["batch", scene, "--quick", "-o"],
        "stability": ["stability", "lambert", "--digits", "0", "-o"],
        "tradeoff": ["tradeoff", bare, "-o"],
        "specialise": ["specialise", preset, scene, "-o"],
        "truth": ["truth", preset, "-o"],
        "structures": ["structures", scene, "-o"],
        "advise": ["advise", scene, "-o"],
        "gallery": ["gallery", "wood", "-o"],
        "view": ["view", preset, "-o"],
        "blender-kit": ["blender-kit", "-o"],
        "fit": ["fit", scene, "-o"],
        "render": ["render", preset, scene, "-o"],
        "eval": ["eval", preset, folder / "d.csv", "-o"],
        "export": ["export", preset, "-o"],
        "verify": ["verify", preset, scene, "-o"],
        "demo": ["demo", "-o"],
    }


TO_FILES = ("render", "eval", "export", "view", "blender-kit")
TO_DIRECTORIES = (
    *("fit", "map", "study", "batch", "stability", "tradeoff", "specialise", "truth", "structures", "advise", "gallery"),
    *("verify", "demo"),
)


@pytest.mark.parametrize("command", [*TO_FILES, *TO_DIRECTORIES])
def test_an_output_that_cannot_be_made(command, folder, gl):
    """Below a file: no user, root included, can make a directory there."""
    name = folder / "truth.json" / "deep" / "x.exr"
    refuses(folder, [*outputs(folder)[command], name], r"truth\.json", r"[Cc]hoose another")


@pytest.mark.parametrize("command", TO_DIRECTORIES)
def test_a_file_where_a_directory_should_be(command, folder, gl):
    refuses(
        folder, [*outputs(folder)[command], folder / "truth.json"], r"truth\.json", r"is a file", r"another output directory"
    )


@pytest.mark.parametrize("command", TO_FILES)
def test_a_directory_where_a_file_should_be(command, folder):
    (folder / "full.exr").mkdir()
    (folder / "full.exr" / "kept").write_text("kept")
    refuses(
        folder,
        [*outputs(folder)[command], folder / "full.exr"],
        r"full\.exr: cannot be written",
        r"(d|D)irectory",
        r"hoose another",
    )


def test_a_picture_of_no_known_kind(folder):
    refuses(
        folder, ["render", folder / "truth.json", folder / "scene.toml", "-o", folder / "a.jpg"], r"a\.jpg", r"\.exr .*\.png"
    )


def test_a_picture_without_a_scene(folder, gl):
    refuses(folder, ["verify", folder / "truth.json", "-o", folder / "new"], r"no picture without a scene")


def test_pixels_that_are_not_finite_are_left_out_and_counted(folder, gl):
    spoil(folder / "reference.exr", np.nan, (slice(MIDDLE, MIDDLE + 2), slice(MIDDLE, MIDDLE + 3)))
    spoil(folder / "reference.exr", np.inf, (MIDDLE - 3, slice(MIDDLE, MIDDLE + 4)))
    ran = layerfit("fit", folder / "scene.toml", "-o", folder / "new", "--json")
    assert ran.code == 0, ran.err
    document = json.loads(ran.out)
    assert document["pixels"]["dropped"][0]["NaN or infinite"] == 10
    assert "10 NaN or infinite" in ran.err
    assert "10 NaN or infinite" in (folder / "new" / "report.html").read_text()
    np.testing.assert_allclose(document["parameters"]["coat.tau"]["value"], TRUTH["layers"][0]["tau"], rtol=1e-3)
    found = layerfit("inspect", folder / "reference.exr", "--json")
    assert found.code == 1, "not finite pixels are a finding"
    assert "10 pixels" in json.dumps(json.loads(found.out)["findings"])


NO_DRIVER = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json", "DISPLAY": "", "WAYLAND_DISPLAY": ""}


@pytest.mark.parametrize("command", ["fit", "verify", "map", "stability", "tradeoff"])
def test_a_machine_without_a_gl_driver(command, folder):
    more = outputs(folder)[command]
    before = snapshot(folder)
    refused(
        folder,
        process(*more, folder / "out", environment=NO_DRIVER),
        r"no OpenGL 3\.3 driver was found",
        r"egl: ",
        r"apt-get install .*libegl1 libgl1-mesa-dri",
    )
    assert snapshot(folder) == before


@pytest.mark.parametrize("command", ["view", "gallery"])
def test_pages_need_no_driver(command, folder):
    ran = process(*outputs(folder)[command], folder / "new", environment=NO_DRIVER)
    assert ran.code == 0, ran.err
    page = folder / "new" / "index.html" if command == "gallery" else folder / "new"
    assert page.read_bytes().rstrip().endswith(b"</html>")


def test_a_driver_that_is_too_old(folder):
    ran = process("verify", folder / "truth.json", environment={"MESA_GL_VERSION_OVERRIDE": "3.1", "DISPLAY": ""})
    refused(folder, ran, r"no OpenGL 3\.3 driver was found \(egl: ")


def test_a_driver_without_float_targets(folder, gl, monkeypatch):
    def incomplete(*_):
        raise moderngl.Error("the framebuffer is not complete")

    monkeypatch.setattr("layerfit.shader.gl._targets", [])
    monkeypatch.setattr(
        "layerfit.shader.gl.context", lambda: mock.Mock(info=gl.info, framebuffer=incomplete, program=gl.program)
    )
    refuses(folder, ["verify", folder / "truth.json"], r"does not draw to float32 images", r"LIBGL_ALWAYS_SOFTWARE=1")


@pytest.mark.parametrize("command", ["eval", "map", "study", "view"])
def test_a_device_that_is_not_there(command, folder):
    more = outputs(folder)[command]
    before = snapshot(folder)
    ran = process(*more, folder / "new", environment={"JAX_PLATFORMS": "cuda"})
    refused(folder, ran, r"JAX does not find the device that JAX_PLATFORMS=cuda asks for", r"unset JAX_PLATFORMS")
    assert snapshot(folder) == before


def test_a_package_that_is_missing(folder, tmp_path):
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / "moderngl.py").write_text("raise ModuleNotFoundError(\"No module named 'moderngl'\", name='moderngl')")
    path = os.pathsep.join([str(hidden), *sys.path])
    ran = process("verify", folder / "truth.json", environment={"PYTHONPATH": path})
    refused(folder, ran, r"the Python package moderngl cannot be imported", r"pip install", r"layerfit doctor")
    ran = process("doctor", environment={"PYTHONPATH": path, "JAX_PLATFORMS": "cuda"})
    assert ran.code == 1, ran.err
    assert "No module named 'moderngl'" in ran.out
    assert "JAX does not find the device" in ran.out


def test_a_fault_ends_the_process_with_2_and_a_word(folder):
    """As a user sees it: the message alone, on standard error."""
    edit(folder / "scene.toml", "[camera]", "[kamera]")
    before = snapshot(folder)
    ran = process("fit", "scene.toml", "-o", "out", cwd=folder)
    refused(folder, ran, r"^layerfit: scene\.toml: unknown key 'kamera' \(did you mean 'camera'\?\)\. Known keys: .*\n$")
    assert snapshot(folder) == before


@pytest.mark.parametrize("command", ["map", "study", "tradeoff", "gallery", "view", "blender-kit"])
def test_a_full_disk(command, folder, gl):
    """No file of this process grows beyond 200 bytes, which the system says as it says that a disk is full."""
    arguments = outputs(folder)[command]
    before = snapshot(folder)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, hard))
    try:
        ran = layerfit(*arguments, folder / "new")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    refused(folder, ran, r"cannot be written: (File too large|No space left on device)")
    left = {name: content for name, content in snapshot(folder).items() if name not in before}
    assert set(left.values()) <= {b""}, "half a file"


def test_a_full_disk_leaves_the_old_results(folder, gl, monkeypatch):
    """The last moment at which a fit can fail: each file is the old one or the new one, and whole."""
    import os

    real = os.replace

    def full(source, target):
        if str(target).endswith("preset.json"):
            raise OSError(28, "No space left on device")
        real(source, target)

    monkeypatch.setattr("os.replace", full)
    before = snapshot(folder)
    refused(
        folder,
        layerfit("fit", folder / "scene.toml", "-o", folder / "out"),
        r"preset\.json: cannot be written",
        r"No space left",
    )
    after = snapshot(folder)
    for name in ("out/fit.json", "out/preset.json", "out/report.html"):
        assert after[name] == before[name]
    assert not [name for name in after if Path(name).name.startswith(".")], "a temporary file was left"
