"""Studies: designs cover what they should, trials are labelled, and what is interrupted goes on."""

import csv

import numpy as np
import pytest

from commands import layerfit
from layerfit import InputError, plot_study, study
from layerfit.study import sweep
from layerfit.study.design import designed, factor_of
from layerfit.study.trial import Setting, names_of, pictures

xarray = pytest.importorskip("xarray", reason="pip install 'layerfit[study]'")
pyplot = pytest.importorskip("matplotlib.pyplot", reason="pip install 'layerfit[plot]'")

METAL = {"base": {"type": "conductor", "alpha": 0.2, "eta": [0.2, 0.92, 1.1], "k": [3.9, 2.45, 2.1]}}
PLAN = {
    "study": {"material": METAL, "free": ["base.alpha"], "repeats": 2},
    "vary": {"base.alpha": [0.1, 0.3], "reference.noise": [0.001, 0.01, 0.1]},
    "reference": {"side": 16},
    "fit": {"starts": 1},
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    return folder, study(PLAN, folder)


def test_trials_are_labelled_by_what_varied(found):
    """Values are those of the fits: near the truth, within their sigmas, which follow the noise."""
    dataset = found[1]
    assert dict(dataset.sizes) == {"base.alpha": 2, "reference.noise": 3, "repeat": 2, "parameter": 1}
    np.testing.assert_allclose(dataset.truth.sel({"base.alpha": 0.3}), 0.3)
    z = (dataset.value - dataset.truth) / dataset.sigma
    assert np.sqrt((z**2).mean()) < 2.0
    sigma = dataset.sigma.median("repeat").squeeze()
    ratio = sigma.sel({"reference.noise": 0.1}) / sigma.sel({"reference.noise": 0.001})
    assert np.all((ratio > 60.0) & (ratio < 150.0))  # 100; the scatter of some 150 pixels tells a sigma to a fifth
    assert np.all(dataset.converged == 1.0)
    assert dataset.attrs["failures"] == ""
    noisy = dataset.value.sel({"reference.noise": 0.1})
    assert np.all(noisy.isel(repeat=0) != noisy.isel(repeat=1)), "each repeat has noise of its own"


def test_files_hold_the_trials(found):
    folder, dataset = found
    with (folder / "study.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 12
    assert float(lines[0]["error base.alpha"]) == pytest.approx(float(dataset.error.values.ravel()[0]))
    with xarray.open_dataset(folder / "study.nc", engine="scipy") as again:
        np.testing.assert_array_equal(again.value, dataset.value)
        assert again.attrs["factors"] == "base.alpha reference.noise"


def test_what_is_interrupted_goes_on(found, tmp_path, monkeypatch):
    dataset = found[1]
    tried = []

    def counting(*args):
        tried.append(args)
        if len(tried) == 3:
            raise KeyboardInterrupt
        return refound(*args)

    refound = sweep.refound
    monkeypatch.setattr(sweep, "refound", counting)
    with pytest.raises(KeyboardInterrupt):
        study(PLAN, tmp_path)
    assert not (tmp_path / "study.nc").exists()
    again = study(PLAN, tmp_path)
    assert len(tried) == 3 + 10, "two of twelve were known"
    np.testing.assert_array_equal(again.value, dataset.value)
    study(PLAN | {"reference": {"side": 24}}, tmp_path)
    assert len(tried) == 13 + 12, "another picture is another question"


def test_a_trial_that_fails_is_told_and_ends_no_other(tmp_path):
    def measured(stack, point):
        if point["base.alpha"] > 0.2:
            raise InputError("too rough for it")
        return {"width": float(stack.base.alpha)}

    seen = []
    dataset = study(PLAN, tmp_path, measure=measured, progress=lambda *counts: seen.append(counts))
    assert seen[-1] == (6, 6, 12)
    assert dataset.attrs["failures"].splitlines() == [f"{k}: too rough for it" for k in range(6, 12)]
    assert np.isnan(dataset.width.sel({"base.alpha": 0.3})).all()
    np.testing.assert_array_equal(dataset.width.sel({"base.alpha": 0.1}), 0.1)
    study(PLAN, tmp_path, measure=measured, progress=lambda *counts: seen.append(counts))
    assert "too rough" in (tmp_path / "study.csv").read_text()


def test_a_measure_of_ones_own():
    dataset = study(
        {
            "study": {"material": METAL, "design": "sobol", "points": 8},
            "vary": {"base.alpha": {"from": 0.01, "to": 1.0, "scale": "log"}},
        },
        measure=lambda stack, point: {"twice": 2.0 * float(stack.base.alpha)},
    )
    np.testing.assert_allclose(dataset.twice, 2.0 * dataset["base.alpha"])
    assert dict(dataset.sizes) == {"point": 8}


@pytest.mark.parametrize(("design", "points"), [("latin", 12), ("sobol", 16)])
def test_designs_fill_the_ranges(design, points):
    """One point in each of as many strata, for every factor (McKay et al. 1979); of a Sobol' sequence at a power of two as well."""
    factors = [factor_of("a", {"from": 0.0, "to": 2.0}, "a"), factor_of("b", {"from": 0.1, "to": 10.0, "scale": "log"}, "b")]
    rows = designed(factors, design, points, 3, "plan")
    assert rows == designed(factors, design, points, 3, "plan")
    unit = np.array([[row["a"] / 2.0, (np.log10(row["b"]) + 1.0) / 2.0] for row in rows])
    for column in unit.T:
        assert sorted(np.floor(column * points).astype(int)) == list(range(points))
    levels = designed([factor_of("c", ["x", "y"], "c")], design, points, 3, "plan")
    assert sorted(row["c"] for row in levels).count("x") == points // 2


def test_a_grid_has_every_combination():
    rows = designed(
        [factor_of("a", [1, 2], "a"), factor_of("b", {"from": 1.0, "to": 100.0, "steps": 3, "scale": "log"}, "b")],
        "grid",
        None,
        0,
        "p",
    )
    assert [(row["a"], round(row["b"], 9)) for row in rows] == [
        (1, 1.0),
        (1, 10.0),
        (1, 100.0),
        (2, 1.0),
        (2, 10.0),
        (2, 100.0),
    ]


def test_pictures_are_as_asked(tmp_path):
    stack = sweep.read_plan(PLAN).stack
    views = pictures(stack, Setting(side=32, lights=3, light_deg=30.0, pixels=64, noise=0.0), 0)
    assert [len(view.index) for view in views] == [64, 64, 64]
    for view in views:
        light = view.reference.lights[0]
        assert np.degrees(np.arccos(light.to_light[2])) == pytest.approx(30.0)
    assert {"base.alpha", "reference.noise", "fit.model"} <= set(names_of(stack))


FAULTS = [
    ({"study": {"material": METAL}}, r"no \[vary\]"),
    ({"study": {"material": METAL}, "vary": {"base.alfa": [0.1]}}, r"did you mean 'base\.alpha'"),
    ({"study": {"material": METAL}, "vary": {"base.alpha": [7.0]}}, "should be a number from"),
    ({"study": {"material": METAL}, "vary": {"reference.side": [1]}}, "whole number from 8"),
    ({"study": {"material": METAL}, "vary": {"base.alpha": {"from": 1.0, "to": 0.1}}}, "the second larger"),
    ({"study": {"material": METAL}, "vary": {"base.alpha": {"from": 0.1, "to": 1.0}}}, "a grid needs levels"),
    ({"study": {"material": METAL, "design": "sobol", "points": 12}, "vary": {"base.alpha": [0.1]}}, "powers of two; give 16"),
    ({"study": {"material": METAL, "measure": "walks"}, "vary": {"base.alpha": [0.1]}}, "did you mean 'walk'"),
    ({"study": {"material": METAL, "repeats": 0}, "vary": {"base.alpha": [0.1]}}, "at least 1"),
    ({"study": {}, "vary": {"base.alpha": [0.1]}}, "name or the file of a preset"),
]


@pytest.mark.parametrize(("plan", "words"), FAULTS)
def test_a_plan_at_fault_is_told_in_one_message(plan, words, tmp_path):
    with pytest.raises(InputError, match=words):
        study(plan, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_pictures_of_a_study(found):
    _, dataset = found
    heat = plot_study(dataset)
    assert heat.get_xlabel() == "base.alpha"
    assert heat.images[0].get_array().shape == (3, 2)
    profile = plot_study(dataset, against=["reference.noise"], parameter="base.alpha", ax=pyplot.subplots()[1])
    middle = profile.get_lines()[0].get_ydata()
    assert middle[0] < middle[2]
    points = plot_study(dataset, "error", ["seconds"], ax=pyplot.subplots()[1])
    assert len(points.get_lines()[0].get_xdata()) == 12
    with pytest.raises(InputError, match=r"did you mean 'error'"):
        plot_study(dataset, "eror")
    pyplot.close("all")


def test_the_command_leaves_a_study(tmp_path):
    plan = """
        study = { free = ["base.alpha"], material = { base = { type = "conductor" } } }
        vary = { "base.alpha" = [0.2] }
        reference = { side = 16 }
        fit = { starts = 1 }
    """
    (tmp_path / "plan.toml").write_text(plan)
    ran = layerfit("study", tmp_path / "plan.toml", "-o", tmp_path / "out", "--json")
    assert ran.code == 0, ran.err
    assert '"schema": "layerfit/study"' in ran.out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["study.csv", "study.jsonl", "study.nc", "study.png"]
