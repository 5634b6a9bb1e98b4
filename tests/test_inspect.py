"""What `inspect` shows of a reference, and that every check sees its own fault and keeps quiet about a sound picture."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from rich.console import Console

from layerfit.capture.channels import resolve
from layerfit.capture.checks import check
from layerfit.capture.exr import read_exr, write_exr
from layerfit.capture.inspect import inspect
from layerfit.errors import InputError

EYE = np.array([0.8, 0.6, 4.9])
BACK = EYE / np.linalg.norm(EYE)
RIGHT = np.cross([0, 1, 0], BACK) / np.linalg.norm(np.cross([0, 1, 0], BACK))
UP = np.cross(BACK, RIGHT)
TO_CAMERA = np.stack([RIGHT, UP, BACK], -1)
"""Columns are the camera's axes: v @ TO_CAMERA are camera coordinates of a world direction."""
SIZE = 48
ACES = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)

Picture = dict[str, np.ndarray]


def sphere() -> Picture:
    """A sound reference: the unit sphere at pixel centres, seen from EYE in 26 degrees; its depth is the distance."""
    ticks = (2 * (np.arange(SIZE) + 0.5) / SIZE - 1) * np.tan(np.radians(13))
    x, y = np.meshgrid(ticks, -ticks)
    ray = x[..., None] * RIGHT + y[..., None] * UP - BACK
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    b = ray @ EYE
    under = b**2 - (EYE @ EYE - 1)
    hit = under > 0
    distance = np.where(hit, -b - np.sqrt(np.where(hit, under, 0)), 0)
    point = np.where(hit[..., None], EYE + distance[..., None] * ray, 0)
    shade = np.clip(point @ np.array([0.5, 0.6, 0.6]), 0, None)
    return {
        **{channel: shade * albedo for channel, albedo in zip("RGB", (0.8, 0.5, 0.3), strict=True)},
        "A": hit.astype(float),
        **vector("N", point),
        **vector("P", point),
        "Z": distance,
    }


def vector(layer: str, values: np.ndarray) -> Picture:
    return {f"{layer}.{axis}": values[..., i].copy() for i, axis in enumerate("XYZ")}


def stacked(picture: Picture, layer: str) -> np.ndarray:
    return np.stack([picture[f"{layer}.{axis}"] for axis in "XYZ"], -1)


def found(folder: Path, picture: Picture, eye: np.ndarray | None = EYE, half: bool = False, **header: object) -> dict[str, str]:
    """What is found in a picture, with the severity."""
    write_exr(folder / "x.exr", picture, half=half, header=header)
    exr = read_exr(folder / "x.exr")
    findings = check(resolve(exr), exr, eye)
    assert all(finding.detail and finding.advice.endswith(".") for finding in findings)
    return {finding.what: finding.severity for finding in findings}


SOUND = {"depth is the distance from the camera": "note"}


def test_sound_picture_has_no_findings_but_the_kind_of_depth(tmp_path: Path):
    assert found(tmp_path, sphere()) == SOUND


def test_eye_is_taken_from_the_header(tmp_path: Path):
    matrix = np.eye(4, dtype="f4")
    matrix[:3, :3] = TO_CAMERA
    matrix[3, :3] = -EYE @ TO_CAMERA
    assert found(tmp_path, sphere(), eye=None) == {}
    assert found(tmp_path, sphere(), eye=None, worldToCamera=matrix) == SOUND
    assert found(tmp_path, sphere(), eye=None, worldToCamera=np.zeros((4, 4), "f4")) == {}


def camera_normals(picture: Picture) -> None:
    """The camera is turned by 11 degrees only: the fault that is easiest to overlook."""
    picture |= vector("N", stacked(picture, "N") @ TO_CAMERA)


def mirrored_normals(picture: Picture) -> None:
    picture["N.Y"] *= -1


def encoded_normals(picture: Picture) -> None:
    picture |= vector("N", np.where(picture["A"][..., None] > 0, 0.5 * stacked(picture, "N") + 0.5, 0))


def encoded_camera_normals(picture: Picture) -> None:
    camera_normals(picture)
    encoded_normals(picture)


def short_normals(picture: Picture) -> None:
    picture |= vector("N", 0.9 * stacked(picture, "N"))


def some_short_normals(picture: Picture) -> None:
    picture["N.X"][20:24], picture["N.Y"][20:24], picture["N.Z"][20:24] = 0.3, 0.3, 0.3


def bumpy_normals(picture: Picture) -> None:
    """Not a fault: normals that are off by 10 degrees in all directions."""
    bumpy = stacked(picture, "N") + 0.15 * np.random.default_rng(0).standard_normal((SIZE, SIZE, 3))
    picture |= vector("N", picture["A"][..., None] * bumpy / np.linalg.norm(bumpy, axis=-1, keepdims=True))


def inward_normals(picture: Picture) -> None:
    picture |= vector("N", -stacked(picture, "N"))


def other_normals(picture: Picture) -> None:
    other = np.random.default_rng(0).standard_normal((SIZE, SIZE, 3))
    picture |= vector("N", other / np.linalg.norm(other, axis=-1, keepdims=True))


def opaque_background(picture: Picture) -> None:
    picture["A"][:] = 1


def soft_edge(picture: Picture) -> None:
    picture["A"][10:12] *= 0.5


def no_alpha_left(picture: Picture) -> None:
    picture["A"] *= 0.5


def no_positions(picture: Picture) -> None:
    for axis in "XYZ":
        del picture[f"P.{axis}"]


def planar_depth(picture: Picture) -> None:
    picture["Z"] = picture["A"] * ((EYE - stacked(picture, "P")) @ BACK)


def near_plane(picture: Picture) -> None:
    picture["Z"] = picture["A"] * (picture["Z"] - 0.05)


def scaled_depth(picture: Picture) -> None:
    picture["Z"] *= 0.1


def camera_positions(picture: Picture) -> None:
    planar_depth(picture)
    picture |= vector("P", picture["A"][..., None] * ((stacked(picture, "P") - EYE) @ TO_CAMERA))
    camera_normals(picture)


def nan_beauty(picture: Picture) -> None:
    picture["G"][24, 24] = np.nan


def infinite_normal(picture: Picture) -> None:
    picture["N.Z"][24, 24] = np.inf


def infinite_background(picture: Picture) -> None:
    picture["Z"][picture["A"] == 0] = np.inf


def black(picture: Picture) -> None:
    for channel in "RGB":
        picture[channel][:] = 0


def bright(picture: Picture) -> None:
    picture["R"][24, 24] = 65504


NO_POSITIONS = {"space of the normals is unchecked": "note"}
FAULTS: dict[Callable[[Picture], None], dict[str, str]] = {
    camera_normals: {**SOUND, "normals are not in the space of the positions": "warning"},
    mirrored_normals: {**SOUND, "normals are not in the space of the positions": "warning"},
    encoded_normals: {**SOUND, "normals are encoded to 0..1": "warning"},
    encoded_camera_normals: {
        **SOUND,
        "normals are encoded to 0..1": "warning",
        "normals are not in the space of the positions": "warning",
    },
    short_normals: {**SOUND, "normals are not of unit length": "warning"},
    some_short_normals: {**SOUND, "normals are not of unit length": "note"},
    bumpy_normals: SOUND,
    inward_normals: {**SOUND, "normals point away from the camera": "warning"},
    other_normals: {**SOUND, "normals do not follow the positions": "warning"},
    opaque_background: {**SOUND, "covered pixels without a normal": "warning"},
    soft_edge: {**SOUND, "partly covered pixels": "note"},
    no_alpha_left: {"partly covered pixels": "note", "no pixel is fully covered": "warning"},
    no_positions: NO_POSITIONS,
    planar_depth: {"depth is planar": "note"},
    near_plane: SOUND,
    scaled_depth: {"depth does not fit positions and camera": "warning"},
    camera_positions: {"positions are in camera space": "warning"},
    nan_beauty: {**SOUND, "beauty is not finite": "warning"},
    infinite_normal: {**SOUND, "normal is not finite": "warning"},
    infinite_background: {**SOUND, "depth is not finite": "note"},
    black: {**SOUND, "the beauty is black": "warning"},
    bright: {**SOUND, "beauty is clipped": "warning"},
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_every_fault_is_found_and_no_other(tmp_path: Path, fault: Callable[[Picture], None]):
    picture = sphere()
    fault(picture)
    assert found(tmp_path, picture) == FAULTS[fault]


def test_half_floats(tmp_path: Path):
    picture = sphere()
    assert found(tmp_path, picture, half=True) == {**SOUND, "beauty in half floats": "note", "geometry in half floats": "note"}
    picture["R"][24, 24] = 1e9  # the writer clips it
    assert found(tmp_path, picture, half=True)["beauty is clipped"] == "warning"


@pytest.mark.parametrize(
    ("header", "what"),
    [
        ({"chromaticities": (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)}, None),
        ({"chromaticities": ACES}, "primaries are not Rec.709"),
        ({"colorInteropID": "lin_rec709_scene"}, None),
        ({"colorInteropID": "lin_ap1_scene"}, "colour space is not linear Rec.709"),
    ],
)
def test_colour_space(tmp_path: Path, header: dict[str, object], what: str | None):
    write_exr(tmp_path / "x.exr", sphere(), header=header)
    findings = inspect(tmp_path / "x.exr").findings
    assert [finding.what for finding in findings] == ([what] if what else [])
    assert all("ACEScg" in finding.detail for finding in findings if "primaries" in finding.what)


@pytest.mark.parametrize(
    ("corner", "what", "severity"),
    [
        ((4, 0), "data window differs from display window", "note"),
        ((-4, -4), "data window differs from display window", "note"),
        ((500, 0), "data window lies outside the display window", "warning"),
    ],
)
def test_windows(tmp_path: Path, corner: tuple[int, int], what: str, severity: str):
    low = np.array(corner, "i4")
    windows = {"dataWindow": (low, low + SIZE - 1), "displayWindow": (np.zeros(2, "i4"), np.full(2, SIZE - 1, "i4"))}
    values = {name: channel.astype("f4") for name, channel in sphere().items()}
    OpenEXR.File(windows, values).write(str(tmp_path / "w.exr"))
    first = inspect(tmp_path / "w.exr").findings[0]
    assert (first.what, first.severity) == (what, severity)


def test_pictures_without_geometry_and_alpha(tmp_path: Path):
    only_colours = {channel: sphere()[channel] + 0.1 for channel in "RGB"}
    assert found(tmp_path, only_colours) == {}
    picture = sphere()
    del picture["A"]
    assert found(tmp_path, picture) == SOUND  # covered is where the normals are


def test_a_plane_tells_its_frame(tmp_path: Path):
    """All normals alike: a turn about them cannot be told, and must not be found."""
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE), np.linspace(1, -1, SIZE))
    ones = np.ones_like(x)
    picture = dict.fromkeys("RGBA", ones) | vector("P", np.stack([x, y, 0.5 * ones], -1))
    for normal, fault in (((0, 0, 1), False), ((0, 0.6, 0.8), True)):
        what = found(tmp_path, picture | vector("N", ones[..., None] * np.array(normal)))
        assert ("normals are not in the space of the positions" in what) == fault


def test_json_is_strict_and_complete(tmp_path: Path):
    picture = sphere()
    picture["G"][0, 0], picture["B"][:] = np.nan, np.inf
    write_exr(tmp_path / "x.exr", picture, header={"expTime": float("nan"), "comments": "x"})
    inspection = inspect(tmp_path / "x.exr", eye=EYE.tolist())
    shown = json.loads(json.dumps(inspection.to_json(), allow_nan=False))
    assert shown["file"] == str(tmp_path / "x.exr")
    (part,) = shown["parts"]
    name = part.pop("name")  # none, or OpenEXR 3.3's "Part0"
    assert part == {"kind": "scanline", "compression": "zip", "data_window": [0, 0, SIZE - 1, SIZE - 1]}
    channels = {channel.pop("name"): channel for channel in shown["channels"]}
    assert channels.keys() == picture.keys()
    assert channels["B"] == {"part": name, "type": "float", "min": None, "max": None, "not_finite": SIZE**2}
    assert channels["G"]["not_finite"] == 1
    assert channels["R"]["max"] == pytest.approx(picture["R"].max())
    assert shown["roles"]["normal"] == {"channels": ["N.X", "N.Y", "N.Z"], "why": "N.X, N.Y, N.Z: the layer N"}
    assert shown["roles"]["noise"]["channels"] is None
    assert [finding["what"] for finding in shown["findings"]] == [
        "beauty is not finite",
        "depth is the distance from the camera",
    ]
    assert shown["findings"][0]["detail"].startswith(f"1 NaN and {SIZE**2} infinite numbers in {SIZE**2} pixels")
    assert shown["header"]["comments"] == "x"
    assert shown["header"]["expTime"] is None


def text(path: Path, overrides: dict[str, str] | None = None) -> str:
    shown = io.StringIO()
    Console(file=shown, width=200).print(inspect(path, overrides).render())
    return shown.getvalue()


def test_render_shows_channels_roles_and_findings(tmp_path: Path):
    path = tmp_path / "[bold]x.exr"
    write_exr(path, sphere() | {"[red]mask": np.ones((SIZE, SIZE))}, half=True)
    shown = text(path, overrides={"alpha": "[red]mask"})
    assert "[bold]x.exr: 48 x 48" in shown
    assert "[red]mask: the scene says" in shown
    assert "beauty in half floats" in shown
    assert "N.X, N.Y, N.Z: the layer N" in shown


def test_left_out_channels_are_shown(tmp_path: Path):
    values = {channel: np.ones((2, 3), "f4") for channel in "RGB"} | {"hash": np.full((2, 3), 2**30, "u4")}
    OpenEXR.File({}, values).write(str(tmp_path / "x.exr"))
    assert "hash" in inspect(tmp_path / "x.exr").to_json()["left_out"]
    assert "whole numbers above 2^24" in text(tmp_path / "x.exr")


def test_unknown_channels_are_shown_and_the_key_to_set(tmp_path: Path):
    write_exr(tmp_path / "x.exr", {"left.R": np.ones((2, 3)), "left.G": np.ones((2, 3))})
    inspection = inspect(tmp_path / "x.exr")
    assert inspection.channels is None
    assert inspection.to_json()["roles"] is None
    (finding,) = inspection.findings
    assert finding.severity == "warning"
    assert "there is no beauty" in finding.detail
    assert "left.G" in text(tmp_path / "x.exr")
    with pytest.raises(InputError, match="is not in the file"):
        inspect(tmp_path / "x.exr", {"beauty": "right"})


def test_references(references: Path):
    """Each file has what its own record says of it, and no fault."""
    records = sorted(references.glob("*.json"))
    assert records, f"no records in {references}"
    for record in records:
        known = json.loads(record.read_text())
        inspection = inspect(references / known["file"], eye=known["camera"]["position"])
        what = {finding.what: finding.severity for finding in inspection.findings}
        assert set(what.values()) <= {"note"}, (record.name, what)
        cycles = known["renderer"].startswith("Blender")
        assert ("depth is planar" in what) == cycles, record.name
        assert ("depth is the distance from the camera" in what) != cycles, record.name
        assert ("beauty in half floats" in what) == ("asuser" in record.name)
        assert ("partly covered pixels" in what) != known.get("exact", False), record.name
        json.dumps(inspection.to_json(), allow_nan=False)
