"""`layerfit stability`: what it tries, that it sees faults, and a few structures at their corners."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from commands import layerfit
from layerfit._fields import params
from layerfit.layers import LAYERS
from layerfit.render import brdf
from layerfit.report import stability as report
from layerfit.stability import exact, limits, measure, sweep, tier
from layerfit.stability.grid import CLOSE, POLAR_DEG, directions, grid, parameters
from layerfit.stability.models import structures
from layerfit.stack import FORMS, Stack
from layerfit.surfaces import BASES, Lambert
from layerfit.tiers.compact import compact
from layerfit.tiers.tier import TIERS

NARROW_BECKMANN = "conductor, distribution beckmann"


def test_every_layer_base_form_and_choice_is_tried():
    tried = structures()
    stacks = list(tried.values())
    assert {type(stack.base) for stack in stacks} == set(BASES.values())
    assert {type(layer) for stack in stacks for layer in stack.layers} == set(LAYERS.values())
    assert {type(stack.form) for stack in stacks} == set(FORMS)
    parts = [part for stack in stacks for part in (*stack.layers, stack.base)]
    for cls in (*BASES.values(), *LAYERS.values()):
        own = [part for part in parts if type(part) is cls]
        for name, _ in params(cls):
            assert any(getattr(part, name) is not None for part in own), (cls, name)
        for field in dataclasses.fields(cls):
            assert {getattr(part, field.name) for part in own} >= set(field.metadata.get("choices", ())), (cls, field.name)
    for form in FORMS:
        for field in dataclasses.fields(form):
            assert len({getattr(stack.form, field.name) for stack in stacks if type(stack.form) is form}) == 2, (
                form,
                field.name,
            )


def test_every_tier_is_tried():
    names = structures()
    by_formula = {name.partition(", tier ")[2] for name in names} - {""}
    assert {"exact", "faithful", *by_formula, *tier.TIERS} == set(TIERS)
    for base in ("conductor", "lambert"):
        assert any(name.endswith(f"coat over {base}, tier schlick") for name in names)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("corrected, coat over conductor", "compact"),
        ("corrected, coat over oren_nayar", "compact"),
        ("corrected, two coats over conductor", "compact"),
        ("faithful, coat over conductor", "compact"),
        ("faithful, coat over conductor", "tables"),
    ],
)
def test_tiers_have_derivatives(name, kind):
    """Along turns of the directions: at the normal and in the mirror direction roots of 0 had none."""
    stack = structures()[name]
    tried = grid(stack, corners=2)
    pairs = tuple(w.astype(np.float32) for w in directions()[:2])
    found = tier.try_tier(kind, stack, tried, [tried.default], pairs, shaders=False)
    assert found is not None
    assert (found["materials"], found["not_finite"]) == (1, 0)
    assert found["value_max"] < 1e-5


def test_the_shader_of_a_tier_is_drawn_at_places(gl):
    """Of flakes, which differ from place to place."""
    stack = structures()["corrected, coat over flakes"]
    tried = grid(stack, corners=2)
    pairs = tuple(w.astype(np.float32) for w in directions()[:2])
    found = tier.try_tier("compact", stack, tried, [tried.default], pairs, shaders=True)
    assert found is not None
    assert found["not_finite"] == 0
    assert found["shader_max"] < 1e-3


def test_a_grid_holds_the_ends_of_all_ranges_and_what_is_close_to_them():
    stack = structures()["corrected, coat over lambert"]
    tried = grid(stack, corners=256)
    free = parameters(stack)
    assert [f.name for f in free] == ["coat.alpha", "coat.eta", "coat.tau", "base.albedo"]
    ends = np.array([(f.spec.lower, f.spec.upper) for f in free])
    corners = tried.values[:16]
    assert len(np.unique(corners, axis=0)) == 16
    assert np.all((corners == ends[:, 0]) | (corners == ends[:, 1]))
    index = tried.values[tried.lines["coat.eta"], 1]
    assert (index[0], index[-1]) == (1.0, 3.0)
    np.testing.assert_allclose(index[1:4], 1.0 + 2.0 * np.array(CLOSE))
    assert np.all(np.diff(index) > 0.0)
    few = grid(stack, corners=5).values[:5]
    np.testing.assert_array_equal(few[:2], ends.T)


@pytest.mark.parametrize("name", ["conductor", "corrected, coat over lambert"])
def test_a_grid_holds_the_material_that_it_is_given(name):
    stack = structures()[name]
    tried = grid(stack, corners=4)
    assert tried.inputs(tried.default) == {
        f.name: float(leaf) for f, leaf in zip(tried.free, jax.tree.leaves(stack.astype(np.float32)), strict=True)
    }


def test_what_is_not_finite_is_worst_and_what_has_no_error_is_not():
    cases = [{"over": over} for over in (0.0, 1e-6, None, 1e-3)]
    assert [case["over"] for case in sorted(cases, key=sweep._over, reverse=True)] == [None, 1e-3, 1e-6, 0.0]


def test_directions_are_unit_vectors_above_the_surface():
    wi, wo, place = directions()
    np.testing.assert_allclose(np.linalg.norm([wi, wo], axis=-1), 1.0, rtol=1e-15)
    assert min(wi[:, 2].min(), wo[:, 2].min()) > 1e-4
    np.testing.assert_allclose(np.degrees(np.arccos(wi[:, 2])), np.array(POLAR_DEG)[place], atol=1e-5)
    assert any(np.array_equal(i, o) for i, o in zip(wi, wo, strict=True)), "retro"


@pytest.fixture(scope="module")
def beckmann(gl):
    return sweep.try_structure(NARROW_BECKMANN, structures()[NARROW_BECKMANN], sweep.Effort(corners=8, digits=2))


def test_narrow_gaussian_facets_hold_near_the_horizon(beckmann):
    """The square of a divisor was 0 in float32: derivatives were NaN where half vectors graze and facets are narrow."""
    assert beckmann["not_finite"] == 0
    assert beckmann["value_rel"]["max"] < 1e-5
    assert beckmann["slope_rel"]["p999"] < 1e-3
    assert beckmann["breaks"] == []
    assert beckmann["shader"]["not_finite"] == 0
    assert beckmann["shader"]["max_rel"] < 5e-5
    assert beckmann["digits"]["float64"]["slope_beyond"] == 0
    assert beckmann["good"]


def test_the_worst_cases_reproduce(beckmann):
    case = beckmann["worst"][0]
    values = {name.partition(".")[2]: np.float32(value) for name, value in case["parameters"].items()}
    stack = Stack((), BASES["conductor"](distribution="beckmann", **values))
    with jax.enable_x64(False):
        value = float(brdf(stack, *(jnp.asarray([case[key]], np.float32) for key in ("wi", "wo")))[0, 0])
    assert value == pytest.approx(case["float32"], rel=1e-6)


def test_what_jumps_or_turns_is_told():
    tried = grid(Stack((), Lambert()), corners=2)
    albedo = tried.values[:, 0]

    def of(f):
        return [told["kind"] for told in limits.breaks(tried, f[:, None])]

    assert of(albedo / np.pi) == []
    assert of(np.where(albedo > 0.0, 1.0 + albedo, 0.0)) == ["jump"]
    assert of(albedo * (1.2 - albedo)) == ["not monotone"]


def test_what_is_not_finite_is_an_infinite_error():
    broken, whole = np.array([[1.0, np.nan]]), np.ones((1, 2))
    np.testing.assert_array_equal(measure.value_error(broken, whole), [[0.0, np.inf]])
    nothing = np.zeros((1, 2))
    assert sweep.beyond(broken, whole, nothing) == 1
    assert sweep.beyond(broken, whole, nothing + 1.0) == 1
    off, right = np.array([[1.0 + 2e-4, 5e-7]]), np.array([[1.0, 0.0]])
    assert sweep.beyond(off, right, nothing) == 1
    assert sweep.beyond(off, right, nothing + 3e-4) == 0


def test_what_the_last_bit_of_the_inputs_moves_is_no_fault_of_a_formula():
    """A power of a cosine near its right angle, which is a difference of products: another last bit is another value."""
    stack = structures()["phong, scaling faithful"]
    tried = grid(stack, corners=2)
    pairs = tuple(w.astype(np.float32) for w in directions()[:2])
    single, double = (measure.values_of(tried.stack(stack, dtype), *pairs, dtype) for dtype in (np.float32, np.float64))
    error = measure.value_error(single.f, double.f)
    moved = measure.by_last_bits(double, tried)
    assert sweep.beyond(single.f, double.f, np.zeros_like(moved)) > 0
    assert sweep.beyond(single.f, double.f, moved) == 0
    # Neighbours in float32 are as far apart, at the pair that is worst.
    row, pair = np.unravel_index(np.argmax(error), error.shape)
    material = tried.material(stack, int(row)).astype(np.float64)
    here = [w[pair] for w in pairs]
    beside = [np.nextafter(w, np.float32(side)) for w, side in zip(here, (2.0, -2.0), strict=True)]
    with jax.enable_x64(True):
        values = [float(brdf(material, *(jnp.asarray(w[None], float) for w in at))[0, 0]) for at in (here, beside)]
    assert report.MAX_REL * abs(values[0]) < abs(values[1] - values[0]) < moved[row, pair]


def test_a_line_holds_the_index_of_another_layer_and_what_is_beside_it():
    stack = structures()["corrected, coat over dielectric"]
    tried = grid(stack, corners=2)
    (k,) = (k for k, f in enumerate(tried.free) if f.name == "base.eta")
    along, spec = tried.values[tried.lines["base.eta"], k], tried.free[k].spec
    for side in (-1.0, 1.0):
        for step in (0.0, *CLOSE):
            beside = 1.5 + side * step * (spec.upper - spec.lower)
            assert np.any(np.abs(along - beside) < 1e-15), step


def test_parts_are_evaluated_as_one():
    """In parts of a fixed size, of which the last is filled up."""
    stack = structures()["lambert"]
    tried = grid(stack, corners=2)
    count = measure.PART + 3
    many = dataclasses.replace(tried, values=np.linspace(0.0, 1.0, count)[:, None], lines={})
    wi, wo, _ = directions()
    values = measure.values_of(many.stack(stack, np.float32), wi[:2], wo[:2], np.float32)
    assert values.f.shape == (count, 2)
    assert values.slopes.shape == (3, count, 2)
    np.testing.assert_allclose(values.f[:, 0], many.values[:, 0] / np.pi, rtol=1e-6)


def test_turned_directions_stay_unit_vectors():
    w = jnp.asarray(directions()[0])
    way = measure.turn(w)
    np.testing.assert_allclose(np.sum(way * w, 1), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 1.0, rtol=1e-14)


def test_digits_see_a_wrong_derivative_and_leave_out_a_kink():
    """A derivative that is off by a part in a thousand is told in float64; where there is none, nothing is."""
    pytest.importorskip("mpmath")
    stack = structures()["conductor"]
    tried = grid(stack, corners=2)
    pairs = tuple(w.astype(np.float32)[5:7] for w in directions()[:2])
    double = measure.values_of(tried.stack(stack, np.float64), *pairs, np.float64)
    worst = np.zeros((2, len(tried.values)), int)
    row = int(tried.lines["base.alpha"][4])
    cases = exact.in_exact(stack, tried, pairs, [row], worst, double, 0)
    limits_of = (1e-10, 1e-13, 1e-7)
    moved = np.zeros_like(double.f)
    held = exact.judged(cases, double, tried, limits_of, moved, pairs)
    assert (held["value_beyond"], held["slope_beyond"]) == (0, 0)
    wrong = dataclasses.replace(double, slopes=1.001 * double.slopes)
    assert exact.judged(cases, wrong, tried, limits_of, moved, pairs)["slope_beyond"] > 0


def test_a_base_that_is_not_seen_has_a_compact_tier():
    """What is left of light below was a difference of roundings, and the root of it not a number."""
    stack = structures()["corrected, coat over lambert"]
    for row in (1, 2):  # a depth of 50; a black base
        made = compact(grid(stack, corners=8).material(stack, row), 1e-2)
        assert not isinstance(made, str)
        assert made[1] < 1e-2


def test_an_interrupted_sweep_goes_on(monkeypatch, tmp_path):
    effort, parts = sweep.Effort(corners=2, shaders=False, digits=0, tiers=0), tmp_path / "parts.json"
    tried = []

    def once(name, stack, effort):
        tried.append(name)
        if len(tried) == 2:
            raise KeyboardInterrupt
        return {"name": name, "combinations": 1, "not_finite": 0, "worst": [], "good": True}

    monkeypatch.setattr(sweep, "try_structure", once)
    with pytest.raises(KeyboardInterrupt):
        sweep.sweep("phong", effort=effort, parts=parts)
    document = sweep.sweep("phong", effort=effort, parts=parts)
    names = [name for name in structures() if "phong" in name]
    assert [entry["name"] for entry in document["structures"]] == names
    assert tried == [*names[:2], *names[1:]]
    assert not parts.exists()


def test_the_command_leaves_tables_and_maps(gl, tmp_path):
    ran = layerfit("stability", "oren_nayar, form", "-o", tmp_path, "--corners", "4", "--digits", "1")
    assert ran.code == 0, ran.err
    document = json.loads((tmp_path / "stability.json").read_text())
    (entry,) = document["structures"]
    assert document["combinations"] == entry["materials"] * len(directions()[0])
    assert "none of the structures with findings" in " ".join(ran.err.split())
    assert (tmp_path / "stability.md").read_text().startswith(report.sentence(document))
    assert (tmp_path / "heat" / "oren_nayar_form_qualitative.png").read_bytes().startswith(b"\x89PNG")


def test_a_structure_that_is_not_there(tmp_path):
    ran = layerfit("stability", "granite", "-o", tmp_path / "out")
    assert (ran.code, ran.out) == (2, "")
    assert "no structure has 'granite' in its name" in ran.err
    assert not (tmp_path / "out").exists()
