"""What the documents say holds: tables are those of the source, links lead somewhere, commands parse, scenes read, Python runs."""

import dataclasses
import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import gallery
import manual
import pytest

from commands import check_command
from helpers import compiles
from layerfit.capture.channels import ROLES
from layerfit.capture.scene import Camera, FitRequest, Reference, Sphere
from layerfit.capture.scene_file import LIGHTS, read_scene
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import LAYERS
from layerfit.preset import read_preset
from layerfit.shipped import shipped_presets
from layerfit.study.sweep import read_plan
from layerfit.surfaces import BASES

REPOSITORY = Path(__file__).parents[1]
PAGES = [
    *sorted(REPOSITORY.glob("*.md")),
    *sorted((REPOSITORY / "docs").glob("*.md")),
    REPOSITORY / "shaders" / "README.md",
    REPOSITORY / "examples" / "references" / "README.md",
]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")

PICTURE_BYTES = 200_000
"""Pictures are kept in git for good."""


def name(page: Path) -> str:
    return str(page.relative_to(REPOSITORY))


def blocks(*kinds: str):
    """Blocks of code of some kinds, in all pages."""
    found = [
        pytest.param(text, id=f"{name(page)}:{k}")
        for page in PAGES
        for k, (kind, text) in enumerate(FENCE.findall(page.read_text()))
        if kind in kinds
    ]
    assert found
    return found


def anchors(page: Path) -> set[str]:
    """Names by which GitHub links to the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", page.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", sorted((REPOSITORY / "docs").glob("*.md")), ids=name)
def test_tables_are_those_of_the_source(page):
    assert manual.updated(page.read_text()) == page.read_text(), "run python tools/manual.py"


@pytest.mark.parametrize("table", manual.TABLES)
def test_every_table_is_in_the_manual(table):
    assert any(f"<!-- table: {table} -->" in page.read_text() for page in (REPOSITORY / "docs").glob("*.md"))


def test_every_model_has_a_picture():
    """That of a preset that has it, or of a material that is drawn because no preset has it."""
    kinds = {preset.name: _kinds(json.loads(preset.path.read_text())) for preset in shipped_presets()}
    assert set(manual.SHOWN) == set.union(*kinds.values())
    assert {*manual.SHOWN, *manual.EXAMPLES} == {*LAYERS, *BASES}
    for kind, preset in manual.SHOWN.items():
        assert kind in kinds[preset], kind


def _kinds(preset: Any) -> set[str]:
    return {part["type"] for part in (*preset["layers"], preset["base"])}


@pytest.mark.parametrize("kind", manual.EXAMPLES)
def test_the_picture_of_a_model_is_drawn_by_its_shader(kind):
    shader = (REPOSITORY / "tests" / "golden" / f"{kind}.frag").read_text()
    picture = REPOSITORY / "docs" / "images" / f"{kind}.png"
    assert gallery.drawn_by(picture) == gallery.stamp(shader), "run python tools/manual.py --draw"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for link in LINK.findall(page.read_text()):
        if re.match(r"https?://", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target), link


def test_every_page_is_reached_from_the_readme():
    reached, left = set(), [REPOSITORY / "README.md"]
    while left:
        page = left.pop().resolve()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        left += [
            page.parent / link.partition("#")[0]
            for link in LINK.findall(page.read_text())
            if not link.startswith(("http", "#"))
        ]
    assert {page.resolve() for page in (REPOSITORY / "docs").glob("*.md")} <= reached


@pytest.mark.parametrize("picture", sorted((REPOSITORY / "docs" / "images").iterdir()), ids=name)
def test_pictures_are_small_and_used(picture):
    assert picture.stat().st_size < PICTURE_BYTES
    assert any(picture.name in page.read_text() for page in PAGES)


def commands(text: str) -> list[list[str]]:
    """The command lines of a block, as words; variables before a command and comments after it are dropped."""
    lines = (line.removeprefix("$ ") for line in text.replace("\\\n", " ").splitlines())
    words = [
        shlex.split(re.sub(r"^(\w+=\S+ )+", "", line), comments=True)
        for line in lines
        if re.match(r"(\w+=\S+ )*(layerfit|make|python) ", line)
    ]
    return words


@pytest.mark.parametrize("text", blocks("console", "sh"))
def test_commands_parse(text):
    for tool, *words in commands(text):
        if tool == "layerfit":
            check_command(words)
        elif tool == "make":
            goals = [word for word in words if "=" not in word]
            makefile = (REPOSITORY / "Makefile").read_text()
            assert all(re.search(rf"^{goal}:", makefile, re.MULTILINE) for goal in goals)
        elif words[0].endswith(".py"):
            assert (REPOSITORY / words[0]).is_file()


def test_commands_are_found():
    assert commands("$ layerfit fit a.toml -o b  # c\nBAD\nA=1 layerfit demo \\\n -o d") == [
        ["layerfit", "fit", "a.toml", "-o", "b"],
        ["layerfit", "demo", "-o", "d"],
    ]


WHOLE = {
    "reference": {"exr": "a.exr"},
    "camera": {"position": [0, 0, 5], "look_at": [0, 0, 0], "vfov_deg": 30},
    "light": [{"type": "constant", "radiance_rgb": 1}],
    "material": {"layers": [{"type": "coat"}], "base": {"type": "lambert"}},
}
"""What a part of a scene is completed with."""


@pytest.mark.parametrize("text", blocks("toml"))
def test_scenes_and_plans_are_read(text, tmp_path):
    document = tomllib.loads(text)
    if "study" in document:
        assert read_plan(document).points
        return
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(WHOLE | document))
    assert read_scene(path).references


@pytest.mark.parametrize("text", blocks("json"))
def test_presets_are_read(text, tmp_path):
    path = tmp_path / "preset.json"
    path.write_text(text)
    assert read_preset(path)


@pytest.mark.parametrize("text", blocks("python"))
def test_python_runs(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LAYERFIT_NO_CACHE", "1")
    (tmp_path / "examples").symlink_to(REPOSITORY / "examples")
    exec(compile(text, "<document>", "exec"), {})


@pytest.mark.parametrize("text", blocks("glsl"))
def test_whole_shaders_are_valid(text, tmp_path):
    if not text.startswith("#version"):
        pytest.skip("a part")
    compiles(tmp_path, {"a.vert": text})


def test_every_key_of_a_scene_is_described():
    text = (REPOSITORY / "docs" / "scenes.md").read_text()
    fields = {f.name for record in (Camera, Sphere, FitRequest) for f in dataclasses.fields(record)}
    lights = {key for _, readers in LIGHTS.values() for key in readers} | set(LIGHTS)
    reference = {f.name for f in dataclasses.fields(Reference)} - {"lights", "channels"}
    missing = {key for key in fields | lights | reference | set(ROLES) if f"`{key}`" not in text}
    assert not missing


@pytest.mark.parametrize("form", [Corrected, Faithful, Precise])
def test_every_option_of_a_form_is_described(form):
    text = manual.BLOCK.sub("", (REPOSITORY / "docs" / "model.md").read_text())
    assert not {f.name for f in dataclasses.fields(form) if f"`{f.name}`" not in text}
