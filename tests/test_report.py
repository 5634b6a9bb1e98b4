"""Reports and pictures: what they say of a result, and what they show."""

import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image, ImageDraw

from layerfit.fit.words import SIGMA, blocks, measured, remarks, table
from layerfit.report import charts, pictures
from layerfit.report.html import page
from layerfit.report.text import image_error, lines, relative, worst

DOCUMENT = {
    "model": {"name": "faithful", "options": {"refract_at": "n"}, "layers": "Coat over Lambert", "why": "asked for"},
    "model_error": {
        "of": "light from below the coat, against the random walk",
        "interface": "single",
        "p50": 0.02,
        "p90": 0.05,
    },
    "converged": False,
    "flags": ["not_converged", "poor_fit", "at_bound:coat.alpha"],
    "misfit": 0.234,
    "sigma_is": SIGMA,
    "steps": 12,
    "starts": 4,
    "minima": [
        {"starts": [0, 2], "cost_over_best": 1.0, "followed": True, "values": {"coat.alpha": 0.001}},
        {"starts": [1], "cost_over_best": 1.21, "followed": True, "values": {"coat.alpha": 0.25, "coat.tau": [1.0, 2.0, 3.0]}},
        {"starts": [3], "cost_over_best": 7.0, "followed": False, "values": {"coat.alpha": 0.9}},
    ],
    "error": {"rel_l2": 0.1, "psnr_db": 30.0, "ssim": 0.9, "delta_e": 2.0},
    "pixels": {"used": 50, "usable": 100, "dropped": [{"NaN or infinite": 3}, {"NaN or infinite": 4, "masked": 1}]},
    "weighting": {"kind": "law", "loss": "huber", "model_share": 0.05, "floor_share": 0.02, "noise": [True, False]},
    "quadrature": {"directions": 992, "rms": 0.0082, "fit_directions": 495, "fit_rms": 0.0139},
    "parameters": {
        "coat.alpha": {"value": 0.001, "start": 0.3, "sigma": None, "at_bound": "lower", "identifiable": False, "unit": "1"},
        "coat.thickness_um": {"value": 50.0, "start": 10.0, "sigma": 3.1, "at_bound": None, "identifiable": True, "unit": "um"},
        "coat.tau": {"value": [0.1, 0.2, 0.3], "sigma": [0.01, 0.02, None], "derived": "absorption_per_mm * thickness_um"},
    },
    "correlations": [["coat.alpha", "coat.tau[0]", -0.97]],
    "profiles": [{"parameter": "coat.alpha", "values": [0.05, 0.1, 0.2], "rise": [1.0, 0.0, 1.0]}],
    "unidentified": [{"direction": {}, "why": "a and b can change together without changing the image"}],
    "notes": ["base.alpha has no effect on this image and was held at its start"],
    "left_out": [],
    "parity": {
        "max_rel": None,
        "p999_rel": 2e-6,
        "worst": {"x": 3, "y": 4, "channel": "g", "shader": None, "jax": 0.25},
        "passed": False,
        "renderer": "a driver",
    },
    "time": {"total_s": 2.0, "import_s": 0.5, "solve_s": 1.5},
}


def test_a_notebook_shows_what_the_terminal_does():
    said = remarks([["a", "b", -0.97]], ["a and b <together>"], ["a note"], DOCUMENT["minima"])
    text = blocks(said)
    for line in ("C(a, b) = -0.970", "a and b &lt;together&gt;", "a note", "coat.alpha 0.25"):
        assert line in text
    assert blocks(remarks([], [], [], DOCUMENT["minima"][:1])) == ""


def test_a_profile_is_drawn_with_its_ends():
    row = {"parameter": "coat.eta", "values": [1.4, 1.45, 1.5, 1.55, 1.6], "rise": [4.0, 1.0, 0.0, 1.0, 4.0]}
    drawn = charts.profiles([row, row])
    assert drawn.count("<svg") == 2
    points = [tuple(map(float, point.split(","))) for point in re.search(r'points="([^"]*)"', drawn)[1].split()]
    assert [point[1] for point in points] == [points[4 - k][1] for k in range(5)], "symmetric"
    assert max(points, key=lambda point: point[1]) == points[2], "the minimum is lowest, in the middle"
    end = float(re.search(r'class="rule"[^>]* y1="([0-9.]+)"', drawn)[1])
    assert points[1][1] == pytest.approx(end, abs=0.1), "the line is where the interval ends"
    assert charts.profiles([]) == ""


@pytest.mark.parametrize(
    "said",
    [
        "Coat over Lambert, faithful form, refract_at = n",
        "why:         asked for",
        "off by:      2 % (median of materials), 5 % (9 of 10), light from below the coat, against the random walk",
        "converged:   NO, after 12 steps",
        "not_converged, poor_fit, at_bound:coat.alpha",
        "The model misses 23 % of the image.",
        "[[Parameters]] (sigmas are of noise and scatter, not of what the form of the model gets wrong",
        "50 used, drawn at random from 100 that can be compared; left out: 7 NaN or infinite, 1 masked",
        "5 % of the value, 2 % of the image's brightness and the noise of the files that state it; huber loss",
        "pictures 992 directions a pixel, 0.82 % rms error of a pixel; the fit 495, 1.4 %",
        "4, of which 2 reached this minimum and 1 were given up on their way",
        "    1.1 (1 start): coat.alpha 0.25, coat.tau [1, 2, 3]\n",
        "0.001 +/- –  (start 0.3, at its lower bound, not identifiable)",
        "50.0 +/- 3.1 um  (start 10)",
        "[0.100, 0.200, 0.3] +/- [0.010, 0.020, –]  (= absorption_per_mm * thickness_um)",
        "C(coat.alpha, coat.tau[0]) = -0.970",
        "can change together without changing the image",
        "was held at its start",
        "max not finite, p99.9 2.0e-06 relative: FAILURE",
        "worst value: g at pixel x 3, y 4: shader not finite, JAX 0.25",
        "2.00 s in all: import 0.50 s (25 %), solve 1.50 s (75 %)",
    ],
)
def test_the_report_says(said):
    assert said in "\n".join(lines(DOCUMENT))


def test_a_good_fit_is_not_called_poor():
    assert "misses" not in "\n".join(lines(DOCUMENT | {"flags": []}))


def page_of(name: str, document: dict) -> str:
    return page(name, document, [], b"", [(0.1, "coarse", 0, 1.0)], "", {})


def test_a_column_that_holds_nothing_is_left_out():
    row = {"value": 0.1, "sigma": 0.01, "start": 0.3, "unit": "1"}
    assert re.findall("<th.*?>(.*?)</th>", table({"coat.alpha": row})) == ["parameter", "value", "sigma", "start", "coat.alpha"]
    heads = re.findall("<th.*?>(.*?)</th>", table({"coat.alpha": row, "coat.depth": row | {"unit": "um", "corrected": 0.11}}))
    assert heads[:6] == ["parameter", "value", "sigma", "unit", "corrected", "start"]


def test_the_page_says_what_the_terminal_says():
    text = page_of("<name>", DOCUMENT)
    assert "&lt;name&gt;" in text
    assert "The model misses 23 % of the image." in text
    assert SIGMA in text.split("[[Fit]]")[0], "beside the table, not only in the lines below it"
    assert "The model misses" not in page_of("", DOCUMENT | {"flags": []})
    assert ">± –</td>" in table(DOCUMENT["parameters"])
    assert ">um</td>" in table(DOCUMENT["parameters"])


@pytest.mark.parametrize(
    ("weighting", "said"),
    [
        (
            {"kind": "uniform", "loss": "square"},
            "metric:      values, the same for every pixel: for a measured BRDF the cosine-weighted L2\n",
        ),
        ({"kind": "log", "loss": "square"}, "metric:      logarithms of values\n"),
        ({"noise": [True], "loss": "square"}, "and the noise that the file states\n"),
        ({"noise": [False], "loss": "square"}, "; no file states its noise\n"),
    ],
)
def test_the_metric_in_words(weighting, said):
    document = DOCUMENT | {"weighting": DOCUMENT["weighting"] | weighting}
    assert said in "\n".join(lines(document))


@pytest.mark.parametrize(
    ("value", "sigma", "said"),
    [
        (0.120539, 0.0001347, ("0.12054", "0.00013")),
        (0.1041, 0.00198, ("0.1041", "0.0020")),
        (0.3, 2.9e-8, ("0.3000000", "2.9e-08")),  # no more digits than float32 has
        (123.4, 12.0, ("123", "12")),
        (1e-4, 2.0, ("0.0", "2.0")),
        (0.0, 0.1, ("0", "0.1")),
        (1.5, None, ("1.5", "–")),
        ([0.1, 0.2], [0.01, None], ("[0.100, 0.2]", "[0.010, –]")),
        ([0.1, 0.2], None, ("[0.1, 0.2]", "[–, –]")),
    ],
)
def test_digits_follow_from_sigma(value, sigma, said):
    assert measured(value, sigma) == said


def test_what_is_not_finite_is_said():
    assert relative(None) == "not finite"
    assert image_error({"rel_l2": None, "psnr_db": None, "ssim": None, "delta_e": None}) == "not finite"
    assert worst({"wi": [0.0, 0.6, 0.8], "wo": [0.0, 0.0, 1.0], "channel": "b", "shader": 1.0, "jax": 2.0}) == (
        "b at wi (0.000000, 0.600000, 0.800000), wo (0.000000, 0.000000, 1.000000): shader 1, JAX 2"
    )


def opened(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png))).astype(int)


def test_false_colours_grow_brighter():
    colours = pictures.false_colour(np.linspace(-0.5, 1.5, 101)[None])[0]
    luminance = colours @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(luminance) >= 0.0)
    assert luminance[0] < 0.02
    assert luminance[-1] > 0.9


def test_colours_of_a_signed_difference_are_dark_at_zero_and_grow_brighter_both_ways():
    colours = pictures.false_colour(np.linspace(0.0, 1.0, 101)[None], pictures.SIGNED)[0]
    luminance = colours @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(luminance[:51]) <= 0.0)
    assert np.all(np.diff(luminance[50:]) >= 0.0)
    assert luminance[50] < 0.02
    blue, orange = colours[:50, 2] - colours[:50, 0], colours[51:, 0] - colours[51:, 2]
    assert min(blue.min(), orange.min()) > 0.0


def test_a_difference_ends_its_scale_at_the_99th_percentile_and_greys_what_is_left_out():
    reference = np.zeros((10, 10, 3))
    image = np.zeros((10, 10, 3))
    image[:, 5:] = 0.02
    image[5, 5:] = -0.02
    image[0, 0] = np.nan
    covered = np.ones((10, 10), bool)
    covered[9] = False
    panel = pictures.difference(image, reference, 2.0, covered)
    assert panel.scale == "1 % of white"
    assert np.ptp(panel.image[9]) == 0.0
    np.testing.assert_allclose(panel.image[4, 7], pictures.SIGNED[-1])
    np.testing.assert_allclose(panel.image[5, 7], pictures.SIGNED[0])
    np.testing.assert_allclose(panel.image[5, 2], pictures.SIGNED[3])
    assert np.all(np.isfinite(panel.image))


@pytest.mark.parametrize(("size", "shown"), [((48, 48), 240), ((128, 128), 256), ((400, 400), 400), ((1024, 1024), 512)])
def test_panels_are_shown_at_a_size_that_can_be_seen(size, shown):
    grey = pictures.Panel("grey", np.full((*size, 3), 0.5))
    picture = opened(pictures.strip([[grey]]))
    rows, columns = np.nonzero(np.all(picture == 128, -1))
    assert (np.ptp(rows) + 1, np.ptp(columns) + 1) == (shown, shown)


def test_rows_of_other_shapes_keep_them():
    wide, tall = (pictures.Panel("p", np.full((*size, 3), 0.5)) for size in ((64, 128), (128, 64)))
    picture = opened(pictures.strip([[wide], [tall]]))
    below = np.all(picture[picture.shape[0] // 2 :] == 128, -1)
    rows, columns = np.nonzero(below)
    assert np.ptp(rows) > 1.8 * np.ptp(columns)


def test_what_is_written_in_a_picture_is_in_its_font(monkeypatch):
    written = []
    monkeypatch.setattr(ImageDraw.ImageDraw, "text", lambda self, at, text, **options: written.append((text, options["font"])))
    rng = np.random.default_rng(0)
    image, covered = rng.random((64, 64, 3)), np.ones((64, 64), bool)
    pictures.strip([[pictures.shown("fit", image, 1.0), pictures.difference(image, image[::-1], 1.0, covered)]])
    missing = lambda font: bytes(font.getmask("\N{OBJECT REPLACEMENT CHARACTER}"))  # noqa: E731
    assert {"-", "left out"} <= {text for text, _ in written}
    for text, font in written:
        for letter in set(text) - {" "}:
            assert bytes(font.getmask(letter)) != missing(font), (text, letter)


def test_a_long_caption_stays_over_its_panel():
    panel = pictures.Panel("a caption that is much too long for the picture below it, and goes on", np.zeros((64, 64, 3)))
    picture = opened(pictures.strip([[panel, pictures.Panel("", np.zeros((64, 64, 3)))]]))
    second = picture[8:28, 256 + 2 * 8 :]
    assert np.ptp(second.reshape(-1, 3), axis=0).max() == 0


@pytest.mark.parametrize(
    "rows", [[(0.1, "coarse", 0, 1.0)], [(0.5, "coarse", 0, 9.0), (0.7, "fine 1", 0, 1e-7), (9.0, "fine 2", 0, 0.0)]]
)
def test_convergence_is_drawn_whatever_the_steps(rows):
    drawn = ElementTree.fromstring(charts.convergence(rows))
    dots = [node for node in drawn.iter("circle") if node.get("r") == "2.2"]
    assert len(dots) == len(rows)
    for dot in dots:
        assert charts.LEFT <= float(dot.get("cx", "")) <= charts.WIDTH - charts.RIGHT
        assert charts.TOP <= float(dot.get("cy", "")) <= charts.HEIGHT - charts.LOW


def test_correlations_are_a_triangle():
    table = ElementTree.fromstring(charts.correlations([["a", "b", 0.9], ["c", "<a>", -0.6]]))
    rows = [[cell.text for cell in row.iter("td")] for row in table.iter("tr")][1:]
    assert rows == [["+0.90"], [None, None], [None, None, "-0.60"]]
    assert "No two parameters" in charts.correlations([])
