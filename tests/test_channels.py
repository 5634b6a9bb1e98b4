"""The channel resolver: what each renderer calls its channels, what the scene says instead, and what it refuses."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from layerfit.capture.channels import ROLES, resolve
from layerfit.capture.exr import Exr, read_exr, write_exr
from layerfit.errors import InputError


def picture(folder: Path, *names: str) -> Exr:
    """A file of 2 x 3 pixels; each channel has a value of its own."""
    write_exr(folder / "x.exr", {name: np.full((2, 3), float(i)) for i, name in enumerate(names)})
    return read_exr(folder / "x.exr")


def parts(folder: Path, content: Mapping[str, str]) -> Exr:
    """A file of several parts: name of the part to the names of its channels."""
    made = [
        OpenEXR.Part({}, {channel: np.full((2, 3), 10.0 * i + j, "f4") for j, channel in enumerate(channels.split())}, part)
        for i, (part, channels) in enumerate(content.items())
    ]
    OpenEXR.File(made).write(str(folder / "x.exr"))
    return read_exr(folder / "x.exr")


def layer(name: str, suffixes: str) -> list[str]:
    return [f"{name}.{suffix}" if name else suffix for suffix in suffixes]


BLENDER = [
    *layer("ViewLayer.Combined", "RGBA"),
    *layer("ViewLayer.Normal", "XYZ"),
    *layer("ViewLayer.Position", "XYZ"),
    *layer("ViewLayer.Depth", "Z"),
    *layer("ViewLayer.Mist", "Z"),
    *layer("ViewLayer.DiffCol", "RGB"),
]
ONE_PART = {
    "Mitsuba, one surface": (
        [*"RGBA", *layer("N", "XYZ"), *layer("P", "XYZ"), "Z", *layer("SE", "RGB")],
        {
            "beauty": "R G B",
            "alpha": "A",
            "normal": "N.X N.Y N.Z",
            "position": "P.X P.Y P.Z",
            "depth": "Z",
            "noise": "SE.R SE.G SE.B",
        },
    ),
    "Mitsuba, its own names": (
        [*layer("image", "RGBA"), *layer("albedo", "RGB"), *layer("sh_normal", "XYZ"), *layer("position", "XYZ"), "depth.T"],
        {
            "beauty": "image.R image.G image.B",
            "alpha": "image.A",
            "normal": "sh_normal.X sh_normal.Y sh_normal.Z",
            "position": "position.X position.Y position.Z",
            "depth": "depth.T",
        },
    ),
    "Mitsuba, the user's names": ([*"RGB", "dd.T"], {"beauty": "R G B", "depth": "dd.T"}),
    "Blender": (
        BLENDER,
        {
            "beauty": "ViewLayer.Combined.R ViewLayer.Combined.G ViewLayer.Combined.B",
            "alpha": "ViewLayer.Combined.A",
            "normal": "ViewLayer.Normal.X ViewLayer.Normal.Y ViewLayer.Normal.Z",
            "position": "ViewLayer.Position.X ViewLayer.Position.Y ViewLayer.Position.Z",
            "depth": "ViewLayer.Depth.Z",
        },
    ),
    "Blender, older, and its compositor": (
        [*layer("View Layer.Combined", "RGBA"), *layer("Composite.Combined", "RGBA"), *layer("View Layer.Normal", "XYZ")],
        {
            "beauty": "View Layer.Combined.R View Layer.Combined.G View Layer.Combined.B",
            "alpha": "View Layer.Combined.A",
            "normal": "View Layer.Normal.X View Layer.Normal.Y View Layer.Normal.Z",
        },
    ),
    "Blender, mist alone is no depth": (
        [*layer("ViewLayer.Combined", "RGB"), "ViewLayer.Mist.Z"],
        {"beauty": "ViewLayer.Combined.R ViewLayer.Combined.G ViewLayer.Combined.B"},
    ),
    "Arnold": (
        [*"RGBA", *layer("N", "RGB"), *layer("P", "RGB"), "Z", *layer("RGBA_key", "RGB"), *layer("coat", "RGB")],
        {"beauty": "R G B", "alpha": "A", "normal": "N.R N.G N.B", "position": "P.R P.G P.B", "depth": "Z"},
    ),
    "V-Ray": (
        [".R", ".G", ".B", ".A", *layer("normals", "XYZ"), *layer("worldPositions", "RGB"), *layer("zDepth", "RGB")],
        {
            "beauty": ".R .G .B",
            "alpha": ".A",
            "normal": "normals.X normals.Y normals.Z",
            "position": "worldPositions.R worldPositions.G worldPositions.B",
            "depth": "zDepth.R",
        },
    ),
    "Karma in one part": (
        [*layer("C", "RGBA"), *layer("N", "xyz"), *layer("P", "xyz"), "Pz"],
        {"beauty": "C.R C.G C.B", "alpha": "C.A", "normal": "N.x N.y N.z", "position": "P.x P.y P.z", "depth": "Pz"},
    ),
    "MoonRay": ([*"rgb", *layer("WP", "xyz")], {"beauty": "r g b", "position": "WP.x WP.y WP.z"}),
    "pbrt": (
        [*"RGB", *layer("P", "XYZ"), *layer("Ns", "XYZ")],
        {"beauty": "R G B", "position": "P.X P.Y P.Z", "normal": "Ns.X Ns.Y Ns.Z"},
    ),
    "another case": (
        [*layer("Beauty", "RGB"), "Alpha.Y", *layer("NORMAL", "XYZ")],
        {"beauty": "Beauty.R Beauty.G Beauty.B", "alpha": "Alpha.Y", "normal": "NORMAL.X NORMAL.Y NORMAL.Z"},
    ),
    "an axis is no depth": ([*"RGB", *"XYZ"], {"beauty": "R G B"}),
    "earlier names win": (
        [*"RGB", *layer("Normal", "XYZ"), *layer("N", "XYZ"), *layer("depth", "Z"), "Z"],
        {"beauty": "R G B", "normal": "N.X N.Y N.Z", "depth": "Z"},
    ),
    "XYZ before RGB": ([*"RGB", *layer("N", "RGBXYZ")], {"beauty": "R G B", "normal": "N.X N.Y N.Z"}),
    "exact case before another": (
        [*"RGB", *layer("n", "XYZ"), *layer("Normal", "XYZ")],
        {"beauty": "R G B", "normal": "Normal.X Normal.Y Normal.Z"},
    ),
    "beside the beauty before elsewhere": (
        [*layer("a.Combined", "RGB"), *layer("b.Normal", "XYZ"), *layer("a.normal", "XYZ"), *layer("b.N", "XYZ")],
        {"beauty": "a.Combined.R a.Combined.G a.Combined.B", "normal": "a.normal.X a.normal.Y a.normal.Z"},
    ),
}
SEVERAL_PARTS = {
    "Karma": (
        {"N": "R G B", "albedo": "R G B", "C": "R G B A", "P": "R G B", "depth": "Z"},
        {"beauty": "C.R C.G C.B", "alpha": "C.A", "normal": "N.R N.G N.B", "position": "P.R P.G P.B", "depth": "depth.Z"},
    ),
    "Blender 5": (
        {
            "ViewLayer.Combined": "ViewLayer.Combined.R ViewLayer.Combined.G ViewLayer.Combined.B",
            "ViewLayer.Depth": "ViewLayer.Depth.Z",
        },
        {"beauty": "ViewLayer.Combined.R ViewLayer.Combined.G ViewLayer.Combined.B", "depth": "ViewLayer.Depth.Z"},
    ),
    "layers within parts": (
        {"main": "R G B A Z", "more": "N.X N.Y N.Z specular.R specular.G specular.B"},
        {"beauty": "main.R main.G main.B", "alpha": "main.A", "depth": "main.Z", "normal": "more.N.X more.N.Y more.N.Z"},
    ),
    "a part before a layer": (
        {"beauty": "R G B N.X N.Y N.Z", "Normal": "X Y Z"},
        {"beauty": "beauty.R beauty.G beauty.B", "normal": "Normal.X Normal.Y Normal.Z"},
    ),
    "parts of one channel": (
        {"rgba": "R G B", "A": "A", "Z": "Z"},
        {"beauty": "rgba.R rgba.G rgba.B", "alpha": "A", "depth": "Z"},
    ),
}


@pytest.mark.parametrize("case", [*ONE_PART, *SEVERAL_PARTS])
def test_names_of_renderers(tmp_path: Path, case: str):
    if case in ONE_PART:
        names, expected = ONE_PART[case]
        exr = picture(tmp_path, *names)
    else:
        content, expected = SEVERAL_PARTS[case]
        exr = parts(tmp_path, content)
    channels = resolve(exr)
    assert {role: " ".join(names) for role, names in channels.names.items()} == expected
    assert channels.chosen.keys() == set(ROLES)
    for role in ROLES:
        values = getattr(channels, role)
        if role not in expected:
            assert values is None
            assert channels.chosen[role].startswith("none: no part or layer is called ")
            continue
        assert channels.chosen[role].startswith(", ".join(channels.names[role]) + ": ")
        stacked = np.stack([exr.channels[name] for name in channels.names[role]], -1)
        np.testing.assert_array_equal(values, stacked if role in ("beauty", "normal", "position", "noise") else stacked[..., 0])


def test_choice_names_what_was_passed_over(tmp_path: Path):
    channels = resolve(picture(tmp_path, *"RGB", *layer("N", "XYZ"), *layer("normals", "XYZ")))
    assert channels.chosen["normal"] == "N.X, N.Y, N.Z: the layer N; there are also normals"
    assert channels.chosen["beauty"] == "R, G, B: no layer"


AMBIGUOUS = {
    "two views": (
        [*layer("left.Combined", "RGB"), *layer("right.Combined", "RGB")],
        "beauty",
        "left.Combined and right.Combined",
    ),
    "two colours": ([*layer("a", "RGB"), *layer("b", "RGB")], "beauty", "a and b"),
    "two normals": ([*"RGB", *layer("left.N", "XYZ"), *layer("right.N", "XYZ")], "normal", r"left\.N and right\.N"),
    "two depths": ([*"RGB", "a.T", "b.T"], "depth", r"a\.T and b\.T"),
}


@pytest.mark.parametrize("case", AMBIGUOUS)
def test_equally_good_candidates_are_an_error_that_names_both(tmp_path: Path, case: str):
    names, role, both = AMBIGUOUS[case]
    exr = picture(tmp_path, *names)
    with pytest.raises(InputError, match=rf"x\.exr: two layers could be the {role}, {both}; .* {role} = ") as error:
        resolve(exr)
    chosen = str(error.value).split(f'{role} = "')[1].split('"')[0]
    assert resolve(exr, {role: chosen}).names[role]  # the advice works as it is


SAID = {
    "layer": ({"normal": "N"}, "normal", "N.X N.Y N.Z"),
    "layer with a dot": ({"normal": "geo."}, "normal", "geo.X geo.Y geo.Z"),
    "layer that starts with a dot": ({"normal": "vray"}, "normal", ".vray.X .vray.Y .vray.Z"),
    "channels": ({"beauty": "coat.R, coat.G,coat.B"}, "beauty", "coat.R coat.G coat.B"),
    "grey": ({"beauty": "Z,Z,Z"}, "beauty", "Z Z Z"),
    "layer of colours": ({"beauty": "coat"}, "beauty", "coat.R coat.G coat.B"),
    "one channel": ({"alpha": "mask.M"}, "alpha", "mask.M"),
    "layer of one channel": ({"depth": "far"}, "depth", "far.Z"),
    "alpha follows the beauty": ({"beauty": "coat"}, "alpha", "coat.A"),
}
SCENE_FILE = [
    *"RGBAZ",
    *layer("N", "XYZ"),
    *layer("geo", "XYZ"),
    *layer("coat", "RGBA"),
    *layer(".vray", "XYZ"),
    "mask.M",
    "far.Z",
]


@pytest.mark.parametrize("case", SAID)
def test_the_scene_has_the_first_word(tmp_path: Path, case: str):
    overrides, role, expected = SAID[case]
    channels = resolve(picture(tmp_path, *SCENE_FILE), overrides)
    assert channels.names[role] == tuple(expected.split())
    if role in overrides:
        assert channels.chosen[role].endswith(f'the scene says {role} = "{overrides[role]}"')


def test_the_scene_can_leave_a_role_out(tmp_path: Path):
    channels = resolve(picture(tmp_path, *SCENE_FILE), {"alpha": "none", "depth": "none"})
    assert channels.alpha is None
    assert channels.depth is None
    assert channels.chosen["alpha"] == "none: the scene says so"


REFUSED = {
    "absent layer": (
        {"normal": "geom"},
        r'normal = "geom" of the scene is not in the file \(nearest: geo.*\); the file holds .*N\.X',
    ),
    "absent channel": ({"beauty": "coat.R,coat.G,coat.W"}, r"is not in the file \(nearest: .*coat.*\)"),
    "two channels": ({"beauty": "R,G"}, r"is not three channels or a layer with RGB or rgb; the file holds"),
    "one for three": ({"normal": "Z"}, r"is not three channels or a layer with XYZ or RGB or xyz or rgb"),
    "three for one": ({"depth": "R,G,B"}, r"is not one channel or its layer"),
    "an axis": ({"depth": "N"}, r"is not one channel or its layer"),
    "unknown role": ({"normals": "N"}, r"not normals \(nearest: normal, noise\)"),
    "a number": ({"depth": 3}, r"depth = 3 must be a text"),
    "nothing": ({"depth": ""}, r"is not in the file"),
    "no beauty": ({"beauty": "none"}, r"there is no beauty.*beauty = "),
}


@pytest.mark.parametrize("case", REFUSED)
def test_overrides_that_do_not_fit(tmp_path: Path, case: str):
    overrides, words = REFUSED[case]
    with pytest.raises(InputError, match=rf"x\.exr: .*{words}"):
        resolve(picture(tmp_path, *SCENE_FILE), overrides)


def test_channel_that_was_not_read(tmp_path: Path):
    values = {name: np.ones((2, 3), "f4") for name in "RGB"} | {"hash": np.full((2, 3), 2**30, "u4")}
    OpenEXR.File({}, values).write(str(tmp_path / "x.exr"))
    with pytest.raises(InputError, match=r'depth = "hash" of the scene was not read: whole numbers'):
        resolve(read_exr(tmp_path / "x.exr"), {"depth": "hash"})


@pytest.mark.parametrize(
    ("names", "need", "words"),
    [
        (["Y"], (), r"there is no beauty; .* beauty = .*; the file holds Y$"),
        ([*layer("N", "RGB"), *layer("albedo", "RGB")], (), "there is no beauty"),
        ([*"RGB", *layer("shading_normal", "XYZ")], ("normal",), r"no normal \(nearest: shading_normal.*\); .* normal = "),
        ([*"RGB", *layer("N", "XYZ")], ("normal", "position"), r"there is no position.* position = .*; the file holds .*N\.X"),
        ([*"RGB", *(f"c{i:03}" for i in range(300))], ("depth",), r"and 263 more$"),
    ],
)
def test_missing_roles_say_what_is_there_and_which_key_to_set(
    tmp_path: Path, names: list[str], need: tuple[str, ...], words: str
):
    with pytest.raises(InputError, match=rf"x\.exr: .*{words}"):
        resolve(picture(tmp_path, *names), need=need)


def test_references(references: Path):
    files = sorted(references.glob("*.exr"))
    assert files, f"no EXR in {references}"
    for file in files:
        names = resolve(read_exr(file)).names
        view = "ViewLayer." if file.name.startswith("cy_") else ""
        expected = {"beauty"} if file.name.startswith("env_") else {"beauty", "alpha", "normal", "position", "depth"}
        assert names.keys() == (expected | {"noise"} if file.name.startswith("pt_") else expected), file
        assert names["beauty"] == tuple(f"{view}Combined.{c}" if view else c for c in "RGB"), file
        if "normal" in expected:
            assert names["normal"] == tuple(f"{view}Normal.{c}" if view else f"N.{c}" for c in "XYZ"), file
            assert names["depth"] == (f"{view}Depth.Z" if view else "Z",), file
