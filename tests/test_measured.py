"""Measured BRDFs: each format read back as it was written, and a material found again in it."""

import dataclasses
import json

import numpy as np
import pytest

from commands import layerfit
from helpers import COPPER, STACKS, hemisphere
from layerfit.capture.inspect import inspect
from layerfit.capture.load import load
from layerfit.capture.measured.data import half_angle
from layerfit.capture.measured.read import read_brdf
from layerfit.capture.measured.rgl import bilinear, warped
from layerfit.capture.measured.sphere import coordinates, interpolated, sphere_of
from layerfit.capture.scene import METRICS
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError
from layerfit.fit.difference import compared, curve
from layerfit.fit.fit import fit
from layerfit.fit.result import parameters
from layerfit.fit.weights import brightness, inverse_sigma
from layerfit.job import fit_scene
from layerfit.optics.spectra import resampling, rgb_weights
from layerfit.render import predict
from layerfit.report.planes import planes
from layerfit.stack import Stack
from layerfit.surfaces import CookTorrance
from measured_files import write_cornell, write_merl, write_rgl, write_table, write_tensors

PAINT = Stack((), CookTorrance(alpha=0.3, kd=[0.1, 0.2, 0.4], ks=0.5, **COPPER))
GREY = Stack((), CookTorrance(alpha=0.3, kd=0.2, ks=0.5, eta=1.5, k=3.0))
"""A surface with a lobe and a diffuse part; the second one's spectrum is flat."""

FLOAT32 = 1e-5
"""Relative: values are stored, or evaluated, in single precision."""


def values(stack, wi, wo):
    """BRDF (n, 3); one executable for any number of pairs."""
    wi, wo = (np.asarray(w, np.float32) for w in (wi, wo))
    return predict(stack, wi[:, None], wo, np.ones((len(wi), 1, 3), np.float32)).astype(float)


def paint(wi, wo):
    return values(PAINT, wi, wo)


def made(path):
    """A file in the format of its name, and the material that it is of."""
    if path.suffix == ".brdf":
        write_cornell(path, lambda wi, wo, wavelengths: np.repeat(values(GREY, wi, wo)[:, :1], len(wavelengths), -1))
        return GREY
    if path.suffix == ".csv":
        write_table(path, paint, hemisphere(300), hemisphere(300, 1))
    elif path.suffix == ".binary":
        write_merl(path, paint, (8, 6, 10))
    else:
        write_rgl(path, paint)
    return PAINT


FORMATS = ["paint.csv", "paint.binary", "paint.bsdf", "paint.brdf"]


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_is_read_as_it_was_written(name, tmp_path):
    truth = made(tmp_path / name)
    found = read_brdf(tmp_path / name)
    assert len(found.f) > 200
    np.testing.assert_allclose(found.f, values(truth, found.wi, found.wo), rtol=FLOAT32)
    for w in (found.wi, found.wo):
        np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1.0, rtol=1e-6)


def scene_of(folder, truth, reference, **fit):
    """A scene with this reference, that starts away from the truth."""
    base = {"type": "cook_torrance", "alpha": 0.2, "kd": 0.3, "ks": 0.3}
    base |= {key: np.asarray(getattr(truth.base, key)).tolist() for key in ("eta", "k")}
    path = folder / "scene.json"
    path.write_text(json.dumps({"reference": reference, "material": {"base": base}, "fit": fit}))
    return path


@pytest.mark.parametrize("name", FORMATS)
def test_a_material_is_found_in_it(name, tmp_path):
    truth = made(tmp_path / name)
    scene = read_scene(scene_of(tmp_path, truth, {"brdf": name}))
    result = fit(load(scene), scene.start, starts=1)
    rows = parameters(result)
    assert result.converged
    for field in ("alpha", "kd", "ks"):
        wanted = getattr(truth.base, field)
        np.testing.assert_allclose(
            rows[f"base.{field}"]["value"], np.broadcast_to(wanted, np.shape(rows[f"base.{field}"]["value"])), rtol=2e-3
        )


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A scene of a CSV with a spike that the material has not, and its outcome."""
    folder = tmp_path_factory.mktemp("table")
    wi, wo = hemisphere(500), hemisphere(500, 1)
    wo[:60] = wi[:60] * [-1.0, -1.0, 1.0] + 1e-3 * hemisphere(60, 2)
    wo[:60] /= np.linalg.norm(wo[:60], axis=-1, keepdims=True)
    write_table(folder / "spiked.csv", lambda i, o: paint(i, o) + 40.0 * (half_angle(i, o) < np.radians(1.0))[:, None], wi, wo)
    return folder


@pytest.mark.parametrize("metric", METRICS)
def test_every_metric_finds_the_material_beside_the_masked_spike(table, metric):
    scene = read_scene(scene_of(table, PAINT, {"brdf": "spiked.csv", "min_half_deg": 1.5}, metric=metric))
    (view,) = load(scene)
    assert 40 < view.dropped["half vector within 1.5 degrees of the normal"] <= 60  # others are grazing
    result = fit([view], scene.start, metric=scene.fit.metric, starts=1)
    assert result.converged
    np.testing.assert_allclose(parameters(result)["base.alpha"]["value"], 0.3, rtol=2e-3)


def test_a_metric_minds_what_it_says():
    """A model that is a tenth too bright everywhere: relative and logarithmic differences are alike in the dark and in the light."""
    target = np.geomspace(1e-2, 1.0, 50)[:, None] * np.ones(3)
    white = brightness(target)
    for metric, even in {"uniform": False, "relative": True, "log": True, "cube_root": False}.items():
        by = curve(metric, white)
        difference = compared(1.1 * target, by) - compared(target, by)
        residual = np.abs(difference * inverse_sigma(target, target, None, metric))
        dark, light = residual[25, 0], residual[-1, 0]
        assert light > dark
        assert (light < 1.5 * dark) == even, metric


def test_zeros_are_dropped_and_counted_and_negative_channels_clipped(tmp_path):
    wi, wo = hemisphere(100), hemisphere(100, 1)

    def f(i, o):
        f = paint(i, o)
        f[:7] = 0.0
        f[7:10, 0] = -0.1
        return f

    write_table(tmp_path / "a.csv", f, wi, wo)
    found = read_brdf(tmp_path / "a.csv")
    assert found.dropped == {"zero or less in all channels": 7}
    assert found.clipped == 3
    assert np.all(found.f >= 0.0)
    assert "colour outside of Rec.709" in {finding.what for finding in inspect(tmp_path / "a.csv").findings}


@pytest.mark.parametrize("name", FORMATS)
def test_inspect_says_what_is_in_a_file(name, tmp_path):
    made(tmp_path / name)
    ran = layerfit("inspect", str(tmp_path / name))
    assert ran.code == 0
    assert "half angle" in ran.out
    told = json.loads(layerfit("inspect", str(tmp_path / name), "--json").out)
    found = read_brdf(tmp_path / name)
    assert told["samples"] == len(found.f)
    assert told["kind"] == found.kind
    assert told["ranges"]["red [1/sr]"][1] == pytest.approx(found.f[:, 0].max(), rel=1e-4)


def test_cells_that_were_not_measured_are_no_samples(tmp_path):
    write_merl(tmp_path / "a.binary", paint, (8, 6, 10))
    found = read_brdf(tmp_path / "a.binary")
    assert found.dropped["marked as invalid"] + len(found.f) == 480
    assert np.all(np.minimum(found.wi[:, 2], found.wo[:, 2]) > 0.0)


def test_a_spectrum_becomes_its_colour_under_the_illuminant(tmp_path):
    spectrum = lambda wl: 0.1 + 0.3 * np.exp(-(((wl - 480.0) / 40.0) ** 2))  # noqa: E731
    write_cornell(tmp_path / "a.brdf", lambda wi, wo, wl: np.repeat(spectrum(wl)[None], len(wi), 0))
    for illuminant in ("D65", "A"):
        found = read_brdf(tmp_path / "a.brdf", illuminant)
        wavelengths = np.arange(400.0, 701.0, 10.0)
        wanted = spectrum(wavelengths) @ resampling(wavelengths) @ rgb_weights(illuminant)
        np.testing.assert_allclose(found.f, np.broadcast_to(wanted, found.f.shape), rtol=1e-6)
        assert found.layout["illuminant"] == illuminant


def test_an_anisotropic_file_knows_its_grain(tmp_path):
    phi_i = (-3.0, -1.5, 0.0, 1.5)
    grain = lambda wi, wo: np.repeat(0.2 + 0.1 * (wi[:, :1] + wo[:, :1]) ** 2, 3, -1)  # noqa: E731
    write_rgl(tmp_path / "a.bsdf", grain, phi_i)
    found = read_brdf(tmp_path / "a.bsdf")
    assert not found.isotropic
    np.testing.assert_allclose(found.f, grain(found.wi, found.wo), rtol=FLOAT32)


def test_an_isotropic_measurement_says_nothing_of_a_grain(tmp_path):
    made(tmp_path / "paint.csv")
    write_rgl(tmp_path / "paint.bsdf", paint)
    scene = read_scene(scene_of(tmp_path, PAINT, {"brdf": "paint.bsdf"}))
    brushed = Stack((), dataclasses.replace(STACKS["conductor, anisotropic"].base))
    with pytest.raises(InputError, match="isotropic"):
        fit(load(scene), brushed)


def test_a_warp_sends_uniform_points_where_the_density_is():
    """The integral of the density below each point is where the point came from."""
    rng = np.random.default_rng(0)
    density = rng.uniform(0.1, 3.0, (5, 7))
    u, v = rng.uniform(size=(2, 40))
    x, y = warped(density, u, v)
    fine = (np.arange(4000) + 0.5) / 4000
    grid = bilinear(density, *(a.ravel() for a in np.meshgrid(fine, fine[::8]))).reshape(500, 4000)
    rows = grid.mean(1)
    np.testing.assert_allclose([rows[fine[::8] < b].sum() / rows.sum() for b in y], v, atol=4e-3)
    for a, b, wanted in zip(x, y, u, strict=True):
        row = bilinear(density, fine, np.full(4000, b))
        np.testing.assert_allclose(row[fine < a].sum() / row.sum(), wanted, atol=1e-3)


def test_alike_directions_are_near_one_another():
    """To exchange light and view, to turn the sample or to mirror it changes nothing of an isotropic BRDF."""
    wi, wo = hemisphere(50), hemisphere(50, 1)
    turned = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    wanted = coordinates(wi, wo)
    for other in ((wo, wi), (wi @ turned, wo @ turned), (wi * [1, -1, 1], wo * [1, -1, 1])):
        np.testing.assert_allclose(coordinates(*other), wanted, atol=1e-9)


def test_between_samples_values_are_those_of_the_material(tmp_path):
    write_merl(tmp_path / "a.binary", paint, (30, 30, 30))
    found = read_brdf(tmp_path / "a.binary")
    wi, wo = hemisphere(200, 5), hemisphere(200, 6)
    seen = np.minimum(wi[:, 2], wo[:, 2]) > 0.3
    f, near = interpolated(found, wi[seen], wo[seen])
    assert near.mean() > 0.95
    wanted = paint(wi[seen], wo[seen])[near]
    assert np.quantile(np.abs(f[near] - wanted) / wanted, 0.99) < 0.1


BROKEN = {
    "short.binary": (b"\1\0\0\0", "too short"),
    "sizes.binary": (np.array([90, 90, 180], "<i4").tobytes() + bytes(24), "is not a MERL table"),
    "negative.binary": (np.array([-1, -1, 1], "<i4").tobytes() + bytes(24), "is not a MERL table"),
    "huge.binary": (np.array([2**31 - 1] * 3, "<i4").tobytes(), "is not a MERL table"),
    "magic.bsdf": (b"tensor", "does not begin"),
    "cut.bsdf": (b"tensor_file\0\1\0\2\0\0\0\3\0abc", "ends within its list"),
    "beyond.bsdf": (b"tensor_file\0\1\0\1\0\0\0\1\0a\1\0\12" + b"\0" * 8 + b"\xff" * 8, "beyond the end"),
    "words.brdf": (b"2 400 700 0.1 0.2 x", "no number"),
    "count.brdf": (b"1.5 400 700", "how many wavelengths"),
    "row.brdf": (b"2 400 700 0.1 0.2 0.3", "ends within a row"),
    "few.brdf": (b"2 500 600 0.1 0.2 0.3 0.4 1 1", "cover 400 to 700"),
    "header.csv": (b"wi_x,wi_y\n0,0\n", "header lacks"),
    "zero.brdf": (b"2 400 700 0.1 0 0.3 0 0 0", "none of its 1 entries has a value"),
    "unknown.exr2": (b"", "ends in .brdf"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_one_clear_message(name, tmp_path):
    data, message = BROKEN[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=message) as caught:
        read_brdf(tmp_path / name)
    assert name in str(caught.value)


@pytest.mark.parametrize("field", ["rgb", "ndf", "theta_i"])
def test_a_field_that_is_missing_is_named(field, tmp_path):
    fields = {name: np.ones(shape) for name, shape in SHAPES.items() if name != field}
    write_tensors(tmp_path / "a.bsdf", fields)
    with pytest.raises(InputError, match=f"no field '{field}'"):
        read_brdf(tmp_path / "a.bsdf")


SHAPES = {"theta_i": (2,), "phi_i": (1,), "sigma": (2, 2), "ndf": (2, 2), "vndf": (1, 2, 2, 2), "rgb": (1, 2, 3, 2, 2)}


def test_a_scene_says_what_is_wrong_with_its_measurement(tmp_path):
    made(tmp_path / "paint.csv")
    for reference, message in (
        ({"brdf": "paint.csv", "min_half_deg": 90}, "below 90"),
        ({"brdf": "paint.csv", "mask": "a.png"}, "unknown key 'mask'"),
        ({"brdf": "paint.csv", "exr": "a.exr"}, "unknown key 'exr'"),
    ):
        with pytest.raises(InputError, match=message):
            read_scene(scene_of(tmp_path, PAINT, reference))
    scene = read_scene(scene_of(tmp_path, PAINT, {"brdf": "paint.csv", "min_half_deg": 80}))
    with pytest.raises(InputError, match="of its samples can be compared"):
        load(scene)


def test_a_fit_of_a_measurement_leaves_what_a_fit_leaves(tmp_path, gl):
    write_merl(tmp_path / "paint.binary", paint, (20, 16, 16))
    outcome = fit_scene(scene_of(tmp_path, PAINT, {"brdf": "paint.binary"}, starts=1, metric="log"), tmp_path / "out")
    assert outcome.good
    document = json.loads((tmp_path / "out" / "fit.json").read_text())
    assert document["metric"] == "log"
    assert document["error"]["rel_l2"] < 1e-3
    assert document["parity"]["passed"]
    assert document["pixels"]["dropped"][0]["marked as invalid"] > 0
    assert {"fit.png", "planes.png", "preset.json", "material.frag", "report.html", "trace.csv"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }


def test_a_sphere_shows_what_was_measured(tmp_path):
    write_merl(tmp_path / "paint.binary", paint, (30, 30, 30))
    (view,) = load(read_scene(scene_of(tmp_path, PAINT, {"brdf": "paint.binary"})))
    sphere = sphere_of(view)
    samples = sphere.samples()
    wanted = paint(samples.wi[:, 0], samples.wo) * samples.weight[:, 0]
    error = np.linalg.norm(sphere.target - wanted) / np.linalg.norm(wanted)
    assert len(sphere.index) > 3000
    assert error < 0.05


def test_planes_of_incidence_have_the_mirror_on_their_right(tmp_path):
    write_merl(tmp_path / "paint.binary", paint, (30, 30, 30))
    found = planes(read_brdf(tmp_path / "paint.binary"), paint)
    assert len(found) >= 4
    for plane in found:
        brightest = plane.outgoing_deg[np.argmax(plane.measured[:, 0])]
        assert brightest > 0.0
        model = np.interp(plane.outgoing_deg, plane.at_deg, plane.model[:, 0])
        # Samples lie some degrees beside the plane and the incidence.
        assert np.median(np.abs(model - plane.measured[:, 0]) / model) < 0.1


@pytest.mark.parametrize("name", ["cayman.brdf", "krylon_blue.brdf", "cg_sunflower_rgb.bsdf", "paper_white_rgb.bsdf"])
def test_real_measurements_are_read(name, measured):
    found = read_brdf(measured / name)
    assert len(found.f) > 1000
    assert found.isotropic
    assert found.description
    if name == "paper_white_rgb.bsdf":
        # White paper sends back most of the light, about as much to all sides.
        away = (np.minimum(found.wi[:, 2], found.wo[:, 2]) > 0.5) & (half_angle(found.wi, found.wo) > 0.3)
        np.testing.assert_allclose(np.median(found.f[away], 0) * np.pi, 0.9, atol=0.15)
