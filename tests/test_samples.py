"""From a reference to samples: geometry, lights, masks, and the faults of both."""

import numpy as np
import pytest
from PIL import Image

from layerfit.capture.exr import write_exr
from layerfit.capture.geometry import camera_rays, frames, sphere_surface, sphere_tangent
from layerfit.capture.lights import HALF_VECTOR_WIDTHS, _half_vector_pdf, receive
from layerfit.capture.reference import load_reference
from layerfit.capture.scene import (
    Camera,
    Constant,
    Directional,
    Disk,
    EnvironmentMap,
    Point,
    Rectangle,
    Reference,
    Sphere,
    SphereLight,
)
from layerfit.errors import InputError

CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
SUN = Directional((0.46175709, 0.55410852, 0.69263564), (np.pi, np.pi, np.pi))


def reference(path, lights=(SUN,), geometry=None, camera=CAMERA, **more):
    return Reference(path, camera, tuple(lights), geometry, {}, more.get("mask"), more.get("thickness_scale", {}))


@pytest.fixture
def lambert(tmp_path):
    """Write a rendered diffuse sphere of albedo .5; keyword arguments replace channels."""

    def make(size=48, **channels):
        surface = sphere_surface(Sphere(), CAMERA, size, size)
        cosine = np.maximum(surface.normal @ np.array(SUN.to_light), 0.0)
        hit = np.isfinite(cosine) & surface.covered
        image = np.where(hit, cosine, 0.0) * 0.5
        data = dict.fromkeys("RGB", image) | {"A": surface.covered.astype(float)}
        data |= {f"N.{c}": np.where(hit, surface.normal[..., k], 0.0) for k, c in enumerate("XYZ")}
        data |= {f"P.{c}": np.where(hit, surface.position[..., k], 0.0) for k, c in enumerate("XYZ")}
        data |= {name.replace("_", "."): value for name, value in channels.items()}
        path = tmp_path / "sphere.exr"
        write_exr(path, {name: value for name, value in data.items() if value is not None})
        return path

    return make


def test_rays_hit_what_the_camera_looks_at():
    rays = camera_rays(CAMERA, 101, 101)
    to_origin = -np.array(CAMERA.position) / np.linalg.norm(CAMERA.position)
    np.testing.assert_allclose(rays[50, 50], to_origin, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0)
    assert rays[0, 50, 1] > rays[100, 50, 1]  # row 0 is the top
    edge = np.arccos(rays[50, 50] @ camera_rays(CAMERA, 101, 101)[0, 50])
    assert np.degrees(edge) == pytest.approx(13.0, rel=0.02)


def test_the_analytic_sphere_agrees_with_a_renderer(references):
    path = references / "ex_diffuse.exr"
    rendered = load_reference(reference(path), 0.1)
    analytic = load_reference(reference(path, geometry=Sphere()), 0.1)
    both, at, there = np.intersect1d(rendered.index, analytic.index, return_indices=True)
    assert len(both) > 0.97 * len(rendered.index)
    np.testing.assert_allclose(rendered.normal[at], analytic.normal[there], atol=2e-5)
    np.testing.assert_allclose(rendered.position[at], analytic.position[there], atol=2e-5)


def test_a_lambertian_sphere_gives_its_albedo(lambert):
    view = load_reference(reference(lambert()), 0.1)
    s = view.samples()
    np.testing.assert_allclose(s.target / s.weight.sum(1), 0.5 / np.pi, rtol=1e-4)
    assert s.wi.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(s.wi, axis=-1), 1.0, atol=1e-6)
    np.testing.assert_allclose(view.image(s.target)[view.covered], s.target)


def test_frames_are_rotations():
    n = np.random.default_rng(0).normal(size=(500, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    n[0], n[1] = [0, 0, 1], [0, 0, -1]
    for tangent in (None, sphere_tangent(n, (0.3, 1.0, 0.2))):
        R = frames(n, tangent)
        np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(R), 1.0)
        np.testing.assert_allclose(np.einsum("nij,nj->ni", R, n), np.broadcast_to([0, 0, 1], n.shape), atol=1e-12)


def received(light, samples=992, n=64, count=1):
    """Sum of weights (irradiance) at points with normals around the Z axis."""
    theta = np.linspace(0.0, 1.2, n)
    normal = np.stack([np.sin(theta), np.zeros(n), np.cos(theta)], -1)
    view = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
    return normal, receive((light,) * count, np.zeros((n, 3)), normal, view, samples, 0)


def test_exact_lights():
    normal, light = received(Directional((0.0, 0.0, 1.0), (1.0, 2.0, 3.0)))
    np.testing.assert_allclose(light.weight[:, 0], normal[:, 2:] * [1.0, 2.0, 3.0])
    normal, light = received(Point((0.0, 0.0, 2.0), (4.0, 4.0, 4.0)))
    np.testing.assert_allclose(light.weight[:, 0, 0], normal[:, 2], rtol=1e-12)
    assert received(Point((0.0, 0.0, 2.0), (4.0, 4.0, 4.0)), count=3)[1].weight.shape[1] == 3


def test_light_is_the_same_however_many_points_ask_for_it(monkeypatch):
    """Points are worked on in blocks; exact lights do not depend on them, and a quadrature keeps its mean."""
    whole = received(Constant((1.0, 1.0, 1.0)), samples=64)[1]
    monkeypatch.setattr("layerfit.capture.lights.CACHED", 640)
    normal, blocks = received(Constant((1.0, 1.0, 1.0)), samples=64)
    assert blocks.weight.shape == whole.weight.shape
    np.testing.assert_array_equal(blocks.weight[:10, :16], whole.weight[:10, :16])  # of the cosine lobe, which is drawn first
    assert np.ptp(blocks.to_light[:20, 0] @ [1.0, 2.0, 3.0]) > 0.0, "each block has draws of its own"
    assert np.mean(blocks.weight[..., 0].sum(1)) == pytest.approx(np.pi, rel=0.02)
    exact = received(Directional((0.0, 0.0, 1.0), (1.0, 2.0, 3.0)), samples=64)[1]
    np.testing.assert_allclose(exact.weight[:, 0], normal[:, 2:] * [1.0, 2.0, 3.0])


def test_half_vectors_are_drawn_as_often_as_their_density_says():
    """The density of the mixture integrates to one over what is drawn below the horizon and above it."""
    wo = np.array([[0.6, 0.0, 0.8]])
    z, phi = np.meshgrid((np.arange(800) + 0.5) / 400 - 1.0, (np.arange(800) + 0.5) / 800 * 2.0 * np.pi)
    s = np.sqrt(1.0 - z * z)
    sphere = np.stack([s * np.cos(phi), s * np.sin(phi), z], -1).reshape(1, -1, 3)
    total = _half_vector_pdf(sphere, wo, HALF_VECTOR_WIDTHS).sum() * 4.0 * np.pi / sphere.shape[1]
    widths = np.array(HALF_VECTOR_WIDTHS)[:, None, None]
    tan2, angle = np.meshgrid(np.linspace(0.0, 1.0, 2001)[:-1], (np.arange(64) + 0.5) / 64 * 2.0 * np.pi)
    tan = widths * np.sqrt(tan2 / (1.0 - tan2))
    below = (0.6 * tan * np.cos(angle) + 0.8) <= 0.0  # normals that face away from the viewer reflect nothing
    assert total == pytest.approx(3.0 - below.mean((1, 2)).sum(), rel=2e-3)


def test_constant_light_is_pi():
    _, light = received(Constant((1.0, 1.0, 1.0)))
    irradiance = light.weight[..., 0].sum(1)
    np.testing.assert_allclose(irradiance, np.pi, rtol=0.03)
    assert np.mean(irradiance) == pytest.approx(np.pi, rel=2e-3)


def test_a_small_sphere_is_a_point():
    normal, light = received(SphereLight((0.0, 0.0, 10.0), 0.5, (1.0, 1.0, 1.0)))
    solid_angle = np.pi * (0.5 / 10.0) ** 2
    ratio = light.weight[..., 0].sum(1) / (solid_angle * normal[:, 2])
    np.testing.assert_allclose(ratio, 1.0, atol=0.03)
    assert np.mean(ratio) == pytest.approx(1.0, abs=2e-3)


def test_a_sphere_that_holds_the_surface_is_refused():
    with pytest.raises(InputError, match="holds part of the surface"):
        received(SphereLight((0.0, 0.0, 1.0), 2.0, (1.0, 1.0, 1.0)))


def _from_polygon(corners, normal):
    """Irradiance from a polygon of radiance 1, all of it above the horizon (Lambert 1760)."""
    corners = corners / np.linalg.norm(corners, axis=-1, keepdims=True)
    total = 0.0
    for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
        edge = np.cross(a, b)
        total += np.arccos(a @ b) * (edge @ normal) / np.linalg.norm(edge)
    return abs(total) / 2.0


@pytest.mark.parametrize("center", [(0.3, -0.2, 1.5), (0.0, 0.0, 4.0)])
def test_a_rectangle_gives_what_its_corners_say(center):
    center, u, v = np.array(center), np.array([0.5, 0.1, 0.1]), np.array([0.0, -0.8, 0.2])
    normal, light = received(Rectangle(tuple(center), tuple(u), tuple(v), (1.0, 1.0, 1.0)))
    corners = np.array([center + a * u + b * v for a, b in [(1, 1), (1, -1), (-1, -1), (-1, 1)]])
    wanted = [_from_polygon(corners, n) for n in normal]
    ratio = light.weight[..., 0].sum(1) / wanted
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)
    assert np.mean(ratio) == pytest.approx(1.0, abs=2e-3)


def test_a_disk_overhead_is_a_cone():
    normal, light = received(Disk((0.0, 0.0, 2.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (1.0, 1.0, 1.0)))
    ratio = light.weight[..., 0].sum(1) / (np.pi / 5.0 * normal[:, 2])
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)
    assert np.mean(ratio) == pytest.approx(1.0, abs=3e-3)


@pytest.mark.parametrize("kind", [Rectangle, Disk])
def test_a_flat_light_shines_to_one_side(kind):
    away = kind((0.0, 0.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1.0))
    assert not received(away)[1].weight.any()


def test_an_environment_map_is_where_its_pixels_say(tmp_path):
    """One bright texel is a light in the direction that the layout gives it."""
    height, width = 32, 64
    for row, column in [(5, 10), (9, 40), (3, 63)]:
        image = np.zeros((height, width))
        image[row, column] = 1000.0
        path = tmp_path / f"map{row}.exr"
        write_exr(path, dict.fromkeys("RGB", image))
        phi, theta = 2 * np.pi * (column + 0.5) / width, np.pi * (row + 0.5) / height
        d = np.array([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)])
        normal, view = d[None], d[None]
        light = receive((EnvironmentMap(path),), np.zeros((1, 3)), normal, view, 4000, 0)
        mean = np.einsum("sc,sj->j", light.weight[0], light.to_light[0])
        np.testing.assert_allclose(mean / np.linalg.norm(mean), d, atol=5e-3)  # a texel is .1 wide
        solid_angle = 2 * np.pi**2 / (height * width) * np.sin(theta)
        assert light.weight[0, :, 0].sum() == pytest.approx(1000.0 * solid_angle, rel=0.03)


def test_a_white_map_is_constant_light(tmp_path):
    path = tmp_path / "white.exr"
    write_exr(path, dict.fromkeys("RGB", np.ones((16, 32))))
    for light in (EnvironmentMap(path), EnvironmentMap(path, up="z"), EnvironmentMap(path, rows="on poles")):
        _, result = received(light)
        assert np.mean(result.weight[..., 0].sum(1)) == pytest.approx(np.pi, rel=2e-3)


def test_z_up_turns_the_map(tmp_path):
    image = np.zeros((32, 64))
    image[:4] = 1.0  # the pole of the map
    path = tmp_path / "pole.exr"
    write_exr(path, dict.fromkeys("RGB", image))
    for up, axis in (("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])):
        n = np.array([axis])
        light = receive((EnvironmentMap(path, up=up),), np.zeros((1, 3)), n, n, 2000, 0)
        mean = np.einsum("sc,sj->j", light.weight[0], light.to_light[0])
        np.testing.assert_allclose(mean / np.linalg.norm(mean), axis, atol=0.02)


def test_a_map_with_no_light_is_refused(tmp_path):
    path = tmp_path / "black.exr"
    write_exr(path, dict.fromkeys("RGB", np.zeros((8, 16))))
    with pytest.raises(InputError, match="somewhere above 0"):
        received(EnvironmentMap(path))


def test_pixels_that_are_not_finite_are_left_out_and_counted(lambert):
    image = np.full((48, 48), 0.2)
    image[20:23, 20:24] = np.nan
    image[24, 24] = np.inf
    view = load_reference(reference(lambert(R=image)), 0.1)
    assert view.dropped["NaN or infinite"] == 13
    assert np.all(np.isfinite(view.target))


def test_grazing_and_unlit_pixels_are_left_out(lambert):
    view = load_reference(reference(lambert()), 0.1)
    assert np.min(np.sum(view.normal * view.view, -1)) > 0.1
    assert np.min(view.normal @ np.array(SUN.to_light)) > 0.1
    assert any("grazing" in reason for reason in view.dropped)


def test_a_mask_is_used(lambert, tmp_path):
    mask = np.zeros((48, 48))
    mask[:24] = 1.0
    write_exr(tmp_path / "mask.exr", {"Y": mask})
    view = load_reference(reference(lambert(), mask=tmp_path / "mask.exr"), 0.1)
    assert np.max(view.index) < 24 * 48
    write_exr(tmp_path / "small.exr", {"Y": mask[:10]})
    with pytest.raises(InputError, match="the mask is 48 x 10"):
        load_reference(reference(lambert(), mask=tmp_path / "small.exr"), 0.1)


@pytest.mark.parametrize("kind", ["1 bit", "8 bits", "16 bits", "RGB", "grey and alpha"])
def test_a_mask_is_read_from_a_png(lambert, tmp_path, kind):
    """Just above half is inside, just below is not."""
    upper = np.arange(48)[:, None] < 24 + np.zeros(48)
    grey = np.where(upper, 128, 127).astype(np.uint8)
    pictures = {
        "1 bit": Image.fromarray(upper),
        "8 bits": Image.fromarray(grey),
        "16 bits": Image.fromarray(np.where(upper, 32768, 32767).astype(np.uint16)),
        "RGB": Image.fromarray(np.stack([grey, 255 - grey, grey], -1)),
        "grey and alpha": Image.fromarray(np.stack([grey, np.full_like(grey, 255)], -1), "LA"),
    }
    pictures[kind].save(tmp_path / "mask.png")
    view = load_reference(reference(lambert(), mask=tmp_path / "mask.png"), 0.1)
    write_exr(tmp_path / "mask.exr", {"Y": upper})
    same = load_reference(reference(lambert(), mask=tmp_path / "mask.exr"), 0.1)
    np.testing.assert_array_equal(view.index, same.index)
    assert view.dropped["masked"] > 100


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda png: png[:30], r"mask\.png: is a damaged PNG picture"),
        (lambda png: png[:-30], r"mask\.png: is a damaged PNG picture"),
        (lambda png: b"", r"mask\.png: is not a PNG picture"),
        (lambda png: b"II*\0" + png, r"mask\.png: is not a PNG picture"),
        (lambda png: None, r"mask\.png: cannot be read: No such file"),
    ],
)
def test_a_png_that_is_none_is_refused(lambert, tmp_path, spoil, said):
    path = tmp_path / "mask.png"
    Image.fromarray(np.full((48, 48), 255, np.uint8)).save(path)
    content = spoil(path.read_bytes())
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        load_reference(reference(lambert(), mask=path), 0.1)


def test_a_png_of_another_size_is_refused(lambert, tmp_path):
    Image.fromarray(np.full((10, 48), 255, np.uint8)).save(tmp_path / "mask.png")
    with pytest.raises(InputError, match=r"mask\.png: the mask is 48 x 10, the reference 48 x 48 pixels"):
        load_reference(reference(lambert(), mask=tmp_path / "mask.png"), 0.1)


def test_pixels_whose_tangent_is_no_direction_are_left_out(lambert):
    """Zero where there are no texture coordinates, or along the normal."""
    surface = sphere_surface(Sphere(), CAMERA, 48, 48)
    tangent = np.nan_to_num(sphere_tangent(surface.normal, CAMERA.up))
    tangent[:20] = 0.0
    tangent[20:24] = np.nan_to_num(surface.normal[20:24])
    tangent[24:25] = np.nan
    path = lambert(**{f"T_{c}": tangent[..., k] for k, c in enumerate("XYZ")})
    view = load_reference(reference(path), 0.1)
    assert view.dropped["without a tangent"] > 300
    assert np.all(view.index // 48 >= 25)
    samples = view.samples()
    np.testing.assert_allclose(np.linalg.norm(samples.wi, axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize(
    ("channels", "more", "message"),
    [
        ({"R": np.zeros((48, 48)), "G": np.zeros((48, 48)), "B": np.zeros((48, 48))}, {}, "black in every usable pixel"),
        ({"N_X": None, "N_Y": None, "N_Z": None}, {}, "no normal channel"),
        ({"P_X": None, "P_Y": None, "P_Z": None}, {}, "no position channel"),
        ({"R": np.full((48, 48), np.nan)}, {}, "only 0 of 2304 pixels"),
        ({}, {"lights": [Directional((-0.46, -0.55, -0.69), (1.0, 1.0, 1.0))]}, "no light reaches"),
        ({}, {"geometry": Sphere(radius=6.0)}, "the camera stands inside the sphere"),
    ],
)
def test_a_reference_that_cannot_be_fitted(lambert, channels, more, message):
    with pytest.raises(InputError, match=message):
        load_reference(reference(lambert(**channels), **more), 0.1)
