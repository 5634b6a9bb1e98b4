"""Files that are broken, or were made to break: each reader reads them or says in one message why not.

`tools/fuzz.py` makes them by the ten thousand; here are a few of each kind, and all that were once neither read nor refused.
"""

import json
import struct
import warnings

import numpy as np
import pytest
from fuzz import made
from fuzz_files import ANEW, KINDS, corpus

from commands import SCENE, TRUTH
from layerfit.batch import fit_batch
from layerfit.batch.table import Journal
from layerfit.capture.exr import read_exr, write_exr
from layerfit.capture.load import load
from layerfit.capture.measured.read import read_brdf
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError, LayerfitError
from layerfit.interchange.formats import read_start
from layerfit.maps.kept import read_tile
from layerfit.preset import read_preset
from layerfit.study.kept import Kept
from layerfit.study.sweep import read_plan
from measured_files import write_cornell, write_rgl, write_tensors

EACH = 40


def refusal(read, path):
    """The message of a reader that does not take a file."""
    try:
        read(path)
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize("kind", KINDS)
def test_mutated_files_are_read_or_refused(kind, tmp_path):
    whole = corpus(kind, tmp_path)
    suffix, read = KINDS[kind]
    path = tmp_path / f"mutated{suffix}"
    refused = 0
    for number in range(EACH):
        path.write_bytes(made(kind, number, whole))
        said = refusal(read, path)
        refused += said is not None
        assert said is None or str(path) in said
    assert refused == 0 if kind in ANEW else refused > EACH // 8, "the mutations reach the readers"
    for data in whole:
        path.write_bytes(data)
        read(path)


HUGE, LONG = "9" * 400, "9" * 5000

SCENES = {
    "a whole number that no float holds": (("vfov_deg = 26", f"vfov_deg = {HUGE}"), "should be a finite number"),
    "a whole number of thousands of digits": (("vfov_deg = 26", f"vfov_deg = {LONG}"), "not valid TOML"),
    "light beyond float32": (("irradiance_rgb = [3, 3, 3]", "irradiance_rgb = 1e200"), "at most 1e\\+15"),
    "a list for a light's type": (('type = "directional"', 'type = ["directional"]'), "light\\[0\\]\\.type"),
    "a list for a model": (('model = "corrected"', 'model = ["corrected"]'), "model = \\['corrected'\\]"),
    "text for a table": (('exr = "reference.exr"', 'exr = "reference.exr"\nthickness_scale = "coat"'), "should be a table"),
    "options that are none": (('model = "corrected"', 'model = "corrected"\noptions = 3'), "should be a table"),
    "lobes without end": (('model = "corrected"', 'model = "corrected"\noptions = {orders = 1000000}'), "from 0 to 16"),
    "a word for a switch": (('model = "corrected"', 'model = "corrected"\noptions = {steer = "no"}'), "true or false"),
    "starts without end": (("[geometry]", "[fit]\nstarts = 1000000000\n[geometry]"), "from 1 to 1000"),
    "fixed values that are a list": (("[geometry]", '[fit]\nfixed = ["coat.eta"]\n[geometry]'), "should be a table"),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_was_made_to_break(name, tmp_path):
    (old, new), said = SCENES[name]
    text = SCENE.partition("[fit]")[0]
    assert old in text
    path = tmp_path / "scene.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        read_scene(path)


PRESETS = {
    "a whole number that no float holds": (("0.12", HUGE), "should be a finite number"),
    "half of a character": (('"truth"', '"\\ud800"'), "surrogates not allowed"),
    "a name that is code": (('"name": "coat"', '"name": "coat; void main() {}"'), "letters, digits and underscores"),
    "a name that is a path": (('"name": "base"', '"name": "../base"'), "letters, digits and underscores"),
    "a name of another alphabet": (('"name": "base"', '"name": "b\u00e4se"'), "letters, digits and underscores"),
}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_that_was_made_to_break(name, tmp_path):
    (old, new), said = PRESETS[name]
    text = json.dumps(TRUTH)
    assert old in text
    path = tmp_path / "preset.json"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        read_preset(path)


def test_more_coats_than_a_shader_bears_are_refused(tmp_path):
    coats = [{"type": "coat", "name": f"coat_{k}"} for k in range(9)]
    path = tmp_path / "preset.json"
    path.write_text(json.dumps(TRUTH | {"layers": coats}))
    with pytest.raises(InputError, match="9 layers over the base are too many"):
        read_preset(path)


def test_a_document_without_end_is_refused(tmp_path):
    """A study may name its material's file: any that the user can read."""
    path = tmp_path / "plan.toml"
    path.write_text('study = { material = "/dev/zero" }\nvary = { "base.alpha" = [0.1] }')
    with pytest.raises(InputError, match="/dev/zero: more than 4194304 bytes are too many"):
        read_plan(path)


def test_a_material_without_end_is_refused(tmp_path):
    path = tmp_path / "start.glb"
    path.symlink_to("/dev/zero")
    with pytest.raises(InputError, match=r"start\.glb: more than 67108864 bytes are too many for a material"):
        read_start(path)


MANIFESTS = {
    "another encoding": (b"scene,name\na.toml,\xe9\n", "is not a CSV file in UTF-8"),
    "a name with a zero": (b"scene,name\na\0.toml,one\n", "line 2: .* is no name of a file"),
    "a field without end": (b"scene,name\n" + b"a" * 200_000 + b",one\n", "is not a CSV file in UTF-8"),
}


@pytest.mark.parametrize("name", MANIFESTS)
def test_a_manifest_that_was_made_to_break(name, tmp_path):
    content, said = MANIFESTS[name]
    path = tmp_path / "scenes.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        fit_batch([path], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("layer", ["N.X", "P.Y", "T.Z", "uv.U", "SE.G"])
@pytest.mark.parametrize("number", [np.nan, np.inf, 3e38])
def test_channels_whose_numbers_are_none(layer, number, tmp_path):
    """What is no number is left out and counted, and nothing overflows."""
    path = tmp_path / "whole.exr"
    (data,) = corpus("views", tmp_path)
    path.write_bytes(data)
    channels = {name: np.array(a) for name, a in read_exr(path).channels.items()}
    channels[layer][3, 3:5] = number
    write_exr(path, channels)
    with warnings.catch_warnings(action="error"):
        KINDS["views"][1](path)
        (view,) = load(read_scene(tmp_path / "views.toml"))
    lost = {"N.X": 2, "P.Y": 2, "T.Z": 2, "uv.U": 2, "SE.G": 0}[layer]
    if layer == "N.X" and not np.isfinite(number):
        assert view.dropped == {"not covered by the object": 2}
    else:
        assert view.dropped.get("NaN or infinite", 0) == (0 if np.isfinite(number) else lost)


LINES = [
    "[]",
    "3",
    '{"key": "two"}',
    '{"key": "two", "row": []}',
    '{"key": 2, "row": {"error": null}}',
    "[" * 100_000,
    '{"key": "tw',
]


@pytest.mark.parametrize("line", LINES)
def test_a_line_of_a_journal_that_is_none(line, tmp_path):
    path = tmp_path / "batch.jsonl"
    path.write_text('{"key": "one", "row": {"error": null}}\n' + line + '\n{"key": "three", "row": {"error": "it failed"}}\n')
    journal = Journal(path)
    assert [journal.done(key) for key in ("one", "two", "three")] == [True, False, False]
    assert list(journal.rows(["one", "two", "three"])) == [{"error": None}, {"error": "it failed"}]


@pytest.mark.parametrize("content", ["[]", '{"question": ["a", 1]}', '{"question": ["a", 1], "parts": 3}', "[" * 100_000])
def test_parts_that_are_none_are_made_again(content, tmp_path):
    path = tmp_path / "parts.json"
    path.write_text(content)
    assert Kept(path, ["a", 1]).part("x", lambda: 4) == 4


def test_a_tile_that_was_spoilt_is_none(tmp_path):
    path = tmp_path / "one.tile"
    (whole,) = corpus("tile", tmp_path)
    path.write_bytes(whole)
    found = read_tile(path)
    assert found is not None
    np.testing.assert_array_equal(found.u, np.ones((4, 3)))
    for spoilt in (b"", whole[:-1], whole[:40] + b"\xff" + whole[41:]):
        path.write_bytes(spoilt)
        assert read_tile(path) is None


def test_a_message_is_never_longer_than_a_page():
    error = LayerfitError(f"file.toml: camera = '{'x' * 100_000}': should be a number")
    assert len(str(error)) < 2010
    assert str(error).startswith("file.toml: camera")
    assert str(error).endswith("should be a number")


def test_a_small_picture_that_claims_to_be_huge_is_refused_at_once(tmp_path):
    path = tmp_path / "huge.exr"
    data = bytearray(corpus("exr", tmp_path)[1])
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = data.index(name) + len(name) + 4
        data[at : at + 16] = struct.pack("<4i", 0, 0, 99_999, 99_999)
    path.write_bytes(data)
    with pytest.raises(InputError, match="100000 x 100000"):
        read_exr(path)


@pytest.mark.parametrize(
    ("field", "value"),
    [("theta_i", np.nan), ("sigma", np.inf), ("vndf", -1.0), ("theta_i", -0.5), ("phi_i", 400.0), ("ndf", 1e30)],
)
def test_a_table_with_a_number_that_it_cannot_have(field, value, tmp_path, monkeypatch):
    import measured_files

    def broken(path, fields):
        array = fields[field].copy()
        array.flat[0] = value
        write_tensors(path, {**fields, field: array})

    monkeypatch.setattr(measured_files, "write_tensors", broken)
    path = tmp_path / "paint.bsdf"
    write_rgl(path, lambda wi, wo: np.full((len(wi), 3), 0.2), side=4)
    with warnings.catch_warnings(action="error"), pytest.raises(InputError, match=f"field '{field}' holds numbers"):
        read_brdf(path)


def test_a_tensor_without_numbers_is_refused(tmp_path):
    path = tmp_path / "paint.bsdf"
    shape = struct.pack("<HBQ2Q", 2, 10, 0, 0, 2**63)
    path.write_bytes(b"tensor_file\0" + struct.pack("<BBI", 1, 0, 1) + struct.pack("<H", 3) + b"rgb" + shape)
    with pytest.raises(InputError, match="field 'rgb' is empty"):
        read_brdf(path)


def test_an_angle_in_degrees_is_refused(tmp_path):
    path = tmp_path / "paint.brdf"
    write_cornell(path, lambda wi, wo, wavelengths: np.full((len(wi), len(wavelengths)), 0.2))
    lines = path.read_text().splitlines()
    lines[-1] = " ".join(["70", *lines[-1].split()[1:]])
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="above 10 rad"):
        read_brdf(path)
