"""Error against run time: what is tried, what is measured, which of it is the front, and what an interrupt leaves."""

import csv
import io
import json
import re

import numpy as np
import pytest

from commands import layerfit, snapshot
from helpers import STACKS, needs_tools, varnish
from layerfit.errors import MachineError
from layerfit.forms.corrected import Corrected
from layerfit.forms.precise import Precise
from layerfit.preset import preset_of, write_preset
from layerfit.report.scatter import Panel, Point, scatter
from layerfit.report.tradeoff import fit_front, front
from layerfit.stack import Stack
from layerfit.study import fits, shaders
from layerfit.study.errors import relative, seen
from layerfit.study.kept import Kept
from layerfit.study.shaders import shaders_of, table_bytes
from layerfit.study.variants import EXACT, TABLE_ENTRIES, materials, variants
from layerfit.surfaces import Conductor, Dielectric, Lambert
from layerfit.tradeoffs import FILES, PARTS, against_walk

pytestmark = needs_tools

GLASS = Stack((), Dielectric(alpha=0.3, eta=1.5))
WOOD = Stack((), Lambert(albedo=[0.5, 0.28, 0.13]))


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Few pairs, a small sphere, short draws."""
    monkeypatch.setattr(shaders, "PAIRS", 1024)
    monkeypatch.setattr(shaders, "SIDE", 24)
    monkeypatch.setattr(fits, "SIDE", 32)
    monkeypatch.setattr("layerfit.shader.cost.LEAST_MS", 0.1)
    monkeypatch.setattr("layerfit.shader.cost.SIDE", 64)


@pytest.fixture
def glass(tmp_path):
    path = tmp_path / "glass.json"
    write_preset(path, GLASS, "glass")
    return path


def test_ways_of_a_coated_metal():
    """Of each form, and with reflectances that are not exact."""
    stack = Stack((varnish(),), Conductor(alpha=0.2, eta=[0.2, 0.9, 1.1], k=[3.9, 2.5, 2.1]), Corrected(orders=2))
    found = variants(stack)
    orders = ["corrected, 0 orders", "corrected, 1 order"]
    assert list(materials(stack)) == [EXACT, "precise", "faithful", *orders, "schlick", "lazanyi"]
    assert all(preset_of(way, "m")["base"]["type"] == "conductor" for way in materials(stack).values())
    tables = [f"tables, {entries}" for entries in TABLE_ENTRIES]
    assert list(found) == [EXACT, "precise", "faithful", *orders, "schlick", "lazanyi", "faithful, compact", *tables]
    assert [table_bytes(shader) for shader in shaders_of({n: found[n] for n in tables}).values()] == [320, 1280, 5120, 20480]
    assert found[EXACT] is stack
    assert isinstance(found["precise"].form, Precise)
    assert [layer.fresnel for layer in (*found["schlick"].layers, found["schlick"].base)] == ["schlick"] * 2


def test_ways_that_print_the_same_are_one():
    """Over a diffuse base there are no bounces to leave out, and nothing approximates a Lambertian reflectance."""
    assert list(variants(WOOD)) == [EXACT]
    assert "corrected, 1 order" not in variants(STACKS["corrected over lambert"])


def test_the_precise_form_keeps_its_coat():
    found = materials(STACKS["precise over conductor"])["schlick"]
    assert (found.layers[0].fresnel, found.base.fresnel) == ("exact", "schlick")


def test_fronts():
    row = lambda tier, cost, error: {"tier": tier, "x_phong": cost, "p999_rel": error}  # noqa: E731
    rows = [row("slow", 3.0, 0.0), row("quick", 1.0, 0.5), row("beaten", 2.0, 0.5), row("middle", 1.5, 0.1)]
    assert front(rows, "exact") == ["quick", "middle", "slow"]
    assert fit_front([{"name": "a", "seconds": 1.0, "rel_l2": 0.1}, {"name": "b", "seconds": 2.0, "rel_l2": 0.2}]) == ["a"]


def test_errors_are_relative_above_the_floor():
    truth = np.array([[1.0, 0.0, 1e-6], [2.0, 2.0, 2.0]])
    off = relative(truth + np.array([[0.1, 0.0, 1e-6], [0.0, 0.0, 0.0]]), truth, 1e-4)
    assert off["max_rel"] == pytest.approx(0.1)
    assert off["rms_rel"] == pytest.approx(np.sqrt((0.1**2 + 0.01**2) / 6.0))
    assert seen(truth, truth) == 0.0
    assert seen(1.1 * truth, truth) > 0.5


def test_what_is_written(glass, gl, tmp_path):
    ran = layerfit("tradeoff", glass, "-o", tmp_path / "out", "--no-fits", "--rounds", "3", "--json")
    assert ran.code == 0, ran.err
    assert set(snapshot(tmp_path / "out")) == set(FILES)
    document = json.loads((tmp_path / "out" / "tradeoff.json").read_text(), parse_constant=pytest.fail)
    assert document == json.loads(ran.out)
    rows = {row["tier"]: row for row in document["tiers"]}
    assert list(rows) == [EXACT, "schlick", "lazanyi"]
    assert (rows[EXACT]["max_rel"], rows[EXACT]["delta_e"]) == (0.0, 0.0)
    assert rows["schlick"]["max_rel"] > rows["lazanyi"]["rms_rel"] > 0.0
    assert all(row["instructions"] > document["phong"]["instructions"] for row in rows.values())
    assert all(row["x_phong_spread"][0] <= row["x_phong"] <= row["x_phong_spread"][1] for row in rows.values())
    assert document["walk"] == {"absent": "there is no coat: every form is the base alone"}
    assert document["device"] in ran.err
    table = list(csv.DictReader(io.StringIO((tmp_path / "out" / "tradeoff.csv").read_text())))
    assert [row["tier"] for row in table] == list(rows)
    page = (tmp_path / "out" / "tradeoff.html").read_text()
    assert not re.search(r'(src|href)="(?!data:)', page), "it would fetch something"
    assert all(tier in page for tier in rows)


def test_an_interrupt_keeps_what_is_done(glass, gl, tmp_path, monkeypatch):
    def interrupted(*args, **options):
        raise KeyboardInterrupt

    command = ("tradeoff", glass, "-o", tmp_path / "out", "--no-fits", "--rounds", "3")
    with monkeypatch.context() as patch:
        patch.setattr(shaders, "against_exact", interrupted)
        assert layerfit(*command).code == 130
    assert set(snapshot(tmp_path / "out")) == {PARTS}
    with monkeypatch.context() as patch:
        patch.setattr("layerfit.tradeoffs.times", interrupted)  # it would be measured again
        assert layerfit(*command).code == 0
    assert set(snapshot(tmp_path / "out")) == set(FILES)


def test_parts_are_of_one_question(tmp_path):
    path = tmp_path / "parts.json"
    assert Kept(path, ["a", 1]).part("x", lambda: 1) == 1
    assert Kept(path, ["a", 1]).part("x", lambda: 2) == 1
    assert Kept(path, ["b", 1]).part("x", lambda: 3) == 3
    path.write_text('{"question"')
    assert Kept(path, ["b", 1]).part("x", lambda: 4) == 4


def test_a_machine_without_the_tools_is_told_before_the_work(glass, gl, tmp_path, monkeypatch):
    def absent():
        raise MachineError("spirv-opt was not found")

    monkeypatch.setattr("layerfit.tradeoffs.tools", absent)
    ran = layerfit("tradeoff", glass, "-o", tmp_path / "out")
    assert ran.code == 2
    assert "spirv-opt was not found" in ran.err
    assert not (tmp_path / "out").exists()


def test_against_the_walk():
    stack = STACKS["corrected over lambert"]
    found = against_walk(stack, "wood", {"exact": stack, "faithful": variants(stack)["faithful"]}, 200)
    tiers = found["tiers"]
    assert tiers["exact"]["median"] < 0.3 < tiers["faithful"]["median"]
    assert 0.0 < found["walk"]["noise_rel"] < 0.1
    assert tiers["faithful"]["delta_e"] > tiers["exact"]["delta_e"]


@pytest.mark.parametrize("solver", fits.SOLVERS)
def test_solvers_find_a_colour_in_both_precisions(solver):
    task = fits.drawn_task(WOOD)
    assert task.error(task.start) > 0.1
    rows = [fits._solved(task, solver, precision) for precision in ("float32", "float64")]
    # 2 % of noise on some 500 pixels, and weights that follow the noisy image: a few parts in a thousand of bias.
    assert all(row["rel_l2"] < 0.25 * fits.NOISE for row in rows), rows
    assert rows[0]["rel_l2"] == pytest.approx(rows[1]["rel_l2"], rel=0.05)


def test_every_fit_has_a_name_of_its_own():
    names = [name for name, _ in fits.runs(fits.drawn_task(WOOD))]
    assert len(set(names)) == len(names) >= 10


def test_a_picture_of_points():
    points = [Point("exact", 6.0, 0.0, True, (5.5, 6.5)), Point("quick", 1.2, 1e-2, True), Point("beaten", 7.0, 3e-2, False)]
    png = scatter([Panel("error", "time", points)])
    assert png.startswith(b"\x89PNG")
