"""Maps: a fit for every texel, of images of a flat panel whose varnish and normal vary, drawn by the model itself.

Of 399 texels, 68 % within one sigma are 62 to 74 %: two and a half standard deviations of the count.
"""

import dataclasses

import jax
import numpy as np
import pytest

from commands import layerfit
from layerfit import Coat, Corrected, InputError, Lambert, MapFit, Precise, Stack, fit_map, predict, print_material, read_scene
from layerfit.capture.exr import read_exr, write_exr
from layerfit.capture.geometry import frames
from layerfit.capture.reference import load_reference
from layerfit.capture.scene import Camera, Directional, Reference, Sphere
from layerfit.fit.parameters import known_parameters
from layerfit.maps import model
from layerfit.maps.descent import Descent
from layerfit.maps.judge import LOWER_LIMIT
from layerfit.maps.parameters import mapped
from layerfit.maps.smooth import laplacian
from layerfit.maps.texels import observe
from layerfit.shader.gl import shade_points

SIDE, LIGHTS, NOISE = 20, 6, 0.005
EYE = np.array([0.3, 0.2, 4.0])
FREE = ["coat.thickness_um", "tilt"]
STACK = Stack(
    (Coat(alpha=0.15, eta=1.5, absorption_per_mm=[2.0, 6.0, 15.0], thickness_um=30.0),),
    Lambert(albedo=[0.5, 0.28, 0.13]),
    Corrected(),
)
SCENE = """
[camera]
position = [0.3, 0.2, 4]
look_at = [0, 0, 0]
vfov_deg = 30
[material]
model = "corrected"
[[material.layers]]
type = "coat"
alpha = 0.15
eta = 1.5
absorption_per_mm = [2.0, 6.0, 15.0]
thickness_um = 30.0
[material.base]
type = "lambert"
albedo = [0.5, 0.28, 0.13]
[map]
free = ["coat.thickness_um", "tilt"]
starts = 1
"""

ROW, COLUMN = np.mgrid[0:SIDE, 0:SIDE]
U, V = (COLUMN + 0.5) / SIDE, 1.0 - (ROW + 0.5) / SIDE
THICKNESS = 40.0 + 25.0 * np.sin(4.0 * U) * np.cos(3.0 * V)
TILT = np.stack([0.2 * np.sin(5.0 * U), 0.15 * np.cos(4.0 * V)], -1)
POSITION = np.stack([2.0 * U - 1.0, 2.0 * V - 1.0, np.zeros_like(U)], -1)
FLAT = np.broadcast_to([0.0, 0.0, 1.0], (SIDE, SIDE, 3))


def directions() -> np.ndarray:
    t, p = np.radians(np.tile([25.0, 45.0], 3)), 2.0 * np.pi * np.arange(LIGHTS) / LIGHTS
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)


def drawn(to_light: np.ndarray) -> np.ndarray:
    """The panel under some lights (n, 3), (n, H, W, 3), texel by texel: each is a material, and a normal, of its own."""
    n = np.concatenate([TILT, np.ones((SIDE, SIDE, 1))], -1)
    into = frames(n / np.linalg.norm(n, axis=-1, keepdims=True), None)
    wo = EYE - POSITION
    wo = np.einsum("hwij,hwj->hwi", into, wo / np.linalg.norm(wo, axis=-1, keepdims=True))
    images = np.zeros((len(to_light), SIDE, SIDE, 3))
    for at in np.ndindex(SIDE, SIDE):
        wi = to_light @ into[at].T
        samples = wi[:, None], np.broadcast_to(wo[at], wi.shape), np.pi * np.repeat(wi[:, None, 2:], 3, -1)
        coat = dataclasses.replace(STACK.layers[0], thickness_um=THICKNESS[at])
        images[:, *at] = predict(STACK.with_parts([coat, STACK.base]), *(np.asarray(a, np.float32) for a in samples))
    return images


@pytest.fixture(scope="module")
def panel(tmp_path_factory):
    """A scene of a panel under six lights, in one file with a layer each; a third of a percent of its pixels has no coverage."""
    folder = tmp_path_factory.mktemp("panel")
    rng, lights = np.random.default_rng(0), []
    channels = {f"{name}.{c}": a[..., k] for name, a in (("N", FLAT), ("P", POSITION)) for k, c in enumerate("XYZ")}
    channels |= {"uv.U": U, "uv.V": V, "A": (ROW + COLUMN > 0).astype(float)}
    for k, (to_light, image) in enumerate(zip(directions(), drawn(directions()), strict=True)):
        image *= 1.0 + NOISE * rng.normal(size=image.shape)
        channels |= {f"light{k}.{c}": image[..., i] for i, c in enumerate("RGB")}
        lights.append(
            f'[[reference]]\nexr = "panel.exr"\nbeauty = "light{k}"\n[[reference.light]]\ntype = "directional"\n'
            f"to_light = {to_light.tolist()}\nirradiance_rgb = {np.pi}\n"
        )
    write_exr(folder / "panel.exr", channels)
    (folder / "scene.toml").write_text("".join(lights) + SCENE)
    return folder


@pytest.fixture(scope="module")
def found(panel, gl) -> MapFit:
    return fit_map(panel / "scene.toml", panel / "out")


def test_every_texel_is_found_within_its_sigma(found):
    there = found.seen > 0
    assert there.sum() == SIDE * SIDE - 1
    assert found.rel_l2 == pytest.approx(NOISE, rel=0.1)
    for name, truth in (("coat.thickness_um", THICKNESS), ("tilt", TILT)):
        z = ((found.values[name] - truth) / found.sigmas[name])[there]
        assert 0.62 < np.mean(np.abs(z) < 1.0) < 0.74, name
        assert np.abs(z).max() < 6.0, name
        assert not found.flags[name][there].any()
    assert found.values["coat.thickness_um"][0, 0] == pytest.approx(30.0), "where nothing was seen, the value is the material's"
    assert np.isinf(found.sigmas["coat.thickness_um"][0, 0])
    n = np.concatenate([found.values["tilt"], np.ones((SIDE, SIDE, 1))], -1)[there]
    wanted = np.einsum("ni,nij->nj", n / np.linalg.norm(n, axis=-1, keepdims=True), frames(FLAT[there], None))
    np.testing.assert_allclose(found.normal[there], wanted, atol=1e-6)


def test_files_hold_the_maps(found, panel):
    exr = read_exr(panel / "out" / "maps.exr").channels
    np.testing.assert_allclose(exr["coat.thickness_um"], found.values["coat.thickness_um"], rtol=1e-6)
    np.testing.assert_allclose(exr["tilt.X"], found.values["tilt"][..., 0], atol=1e-7)
    assert {"sigma.coat.thickness_um", "flags.tilt.Y", "N.Z", "A", "misfit"} <= set(exr)
    texture = read_exr(panel / "out" / "textures" / "coat_thickness_um.exr").channels["Y"]
    np.testing.assert_array_equal(texture, exr["coat.thickness_um"])
    assert found.good
    assert found.document["parity"]["max_rel"] < 5e-5
    assert not (panel / "out" / ".tiles").exists()


def test_the_shader_with_its_textures_draws_the_images(found, panel):
    """The whole entry point: textures, tilted normal, light. It is the model's image, to rounding, and the reference's, to its noise."""
    textures = {f"u_{path.stem}": _texture(path) for path in (panel / "out" / "textures").glob("*.exr")}
    assert len(textures) == 2
    text = (panel / "out" / "material.frag").read_text()
    flat = lambda a: np.asarray(a, np.float32).reshape(SIDE * SIDE, -1)  # noqa: E731
    attributes = {"v_position": flat(POSITION), "v_normal": flat(FLAT), "v_uv": flat(np.stack([U, V], -1))}
    to_light = directions()[1]
    uniforms = {"u_eye": tuple(EYE), "u_light": (*to_light, 0.0), "u_light_rgb": (np.pi,) * 3}
    image = shade_points(text, attributes, uniforms, textures).reshape(SIDE, SIDE, 3)
    texels = found.texels
    seen = model.Seen(
        *(a[texels.rows[:, 4:5]] for a in (texels.wi, texels.wo)),
        (texels.weight / texels.wi[..., 2:])[texels.rows[:, 4:5]].transpose(0, 3, 1, 2),
        np.zeros((len(texels.index), 3, 1), np.float32),
        np.ones((len(texels.index), 3, 1), np.float32),
    )
    assert np.all(texels.of[texels.rows[:, 4]] == 1)  # rows are the last reference first
    wanted = model.values(found.vector, seen, jax.tree.map(np.float32, found.stack), free=found.free)
    there = found.seen > 0
    np.testing.assert_allclose(image[there], np.asarray(wanted)[..., 0], rtol=5e-5)
    reference = read_exr(panel / "panel.exr").channels
    target = np.stack([reference[f"light1.{c}"] for c in "RGB"], -1)
    assert np.sqrt(np.mean((image / target - 1.0)[there] ** 2)) < 1.2 * NOISE


def _texture(path):
    channels = read_exr(path).channels
    return np.stack([channels[c] for c in ("Y", "R", "G", "B") if c in channels], -1)


def test_what_is_interrupted_goes_on(panel, found, tmp_path, monkeypatch):
    """The second tile is never reached; the next run takes the first from where it was kept, and gives what one run gives."""
    monkeypatch.setattr("layerfit.maps.TILE", 200)

    def stop(stage, share):
        if stage == "texels" and share > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_map(panel / "scene.toml", tmp_path / "out", progress=stop)
    assert len(list((tmp_path / "out" / ".tiles").glob("*.tile"))) == 1
    assert not (tmp_path / "out" / "map.json").exists()
    counted = []
    monkeypatch.setattr("layerfit.maps.descent.Descent.solve", _counting(counted))
    again = fit_map(panel / "scene.toml", tmp_path / "out")
    assert counted == [199]
    np.testing.assert_allclose(again.values["coat.thickness_um"], found.values["coat.thickness_um"], rtol=1e-5)


def _counting(counted):
    solve = Descent.solve

    def counting(self, which):
        counted.append(len(which))
        return solve(self, which)

    return counting


def test_neighbours_help(panel, found):
    """A quarter of the images' noise is left where the prior is as smooth as the truth is."""
    smooth = fit_map(panel / "scene.toml", smooth={"coat.thickness_um": 0.02, "tilt": 0.01})
    there = found.seen > 0
    off = [np.sqrt(np.mean((m.values["coat.thickness_um"] / THICKNESS - 1.0)[there] ** 2)) for m in (found, smooth)]
    assert off[1] < off[0]
    assert smooth.rel_l2 < 1.1 * found.rel_l2
    ratio = smooth.sigmas["coat.thickness_um"][there] / found.sigmas["coat.thickness_um"][there]
    assert np.abs(ratio - 1.0).max() < 0.05  # of the texel's own images, at another value of its depth


def test_links_of_neighbours():
    index = np.array([0, 1, 3, 5])  # of a map of 2 x 3: 0 1 . / 3 . 5
    u = np.array([1.0, 3.0, 4.0, 7.0])
    assert u @ (laplacian(index, (2, 3)) @ u) == pytest.approx((1.0 - 3.0) ** 2 + (1.0 - 4.0) ** 2)


def test_a_map_over_texture_coordinates(panel):
    """Texel (row, column) is at u = (column + 1/2) / size, v = 1 - (row + 1/2) / size; four pixels of each light see one."""
    scene = read_scene(panel / "scene.toml")
    texels = observe(scene, scene.start, SIDE // 2)
    assert texels.shape == (SIDE // 2, SIDE // 2)
    assert np.all(texels.seen[1:] == 4 * LIGHTS)
    assert texels.seen[0] == 3 * LIGHTS
    pixels = observe(scene, scene.start, None)
    assert np.all(pixels.seen == LIGHTS)
    fine = observe(scene, scene.start, SIDE)
    np.testing.assert_array_equal(fine.index, pixels.index)
    np.testing.assert_array_equal(np.sort(fine.rows), np.sort(pixels.rows))


def test_views_from_anywhere_make_one_map(tmp_path):
    """A sphere seen by two cameras under three lights each, whose varnish has another thickness in every texel of its coordinates."""
    size, side = 8, 40
    wanted = np.random.default_rng(3).uniform(15.0, 60.0, (size, size))
    entries = []
    for k, (eye, to_light) in enumerate(
        [(eye, w) for eye in ([0.0, 0.5, 5.0], [3.5, 0.5, 3.5]) for w in ([0.3, 0.6, 0.8], [0.7, 0.2, 0.7], [0.1, 0.1, 1.0])]
    ):
        camera, light = (
            Camera(tuple(eye), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0),
            Directional(tuple(to_light / np.linalg.norm(to_light)), (np.pi,) * 3),
        )
        path = tmp_path / f"view{k}.exr"
        write_exr(path, {c: np.ones((side, side)) for c in "RGB"})
        view = load_reference(Reference(path, camera, (light,), Sphere(), {}, None, {}), 0.1)
        samples, image = view.samples(), np.zeros((side * side, 3))
        column, row = (np.minimum((view.uv * [1.0, -1.0] + [0.0, 1.0]) * size, size - 1e-6)).astype(int).T
        for at in np.unique(row * size + column):
            which = np.flatnonzero(row * size + column == at)
            coat = dataclasses.replace(STACK.layers[0], thickness_um=wanted.flat[at])
            seen = (a[which] for a in (samples.wi, samples.wo, samples.weight))
            image[view.index[which]] = predict(STACK.with_parts([coat, STACK.base]), *seen)
        image *= 1.0 + NOISE * np.random.default_rng(k).normal(size=image.shape)
        write_exr(path, {c: image[:, i].reshape(side, side) for i, c in enumerate("RGB")})
        entries.append(
            f'[[reference]]\nexr = "{path.name}"\n[reference.camera]\nposition = {eye}\nlook_at = [0, 0, 0]\nvfov_deg = 26\n'
            f'[[reference.light]]\ntype = "directional"\nto_light = {to_light}\nirradiance_rgb = {np.pi}\n'
        )
    rest = SCENE[SCENE.index("[material]") :].replace(', "tilt"', "").replace("starts = 1", f"starts = 1\nsize = {size}")
    (tmp_path / "scene.toml").write_text("".join(entries) + '[geometry]\nkind = "sphere"\n' + rest)
    found = fit_map(tmp_path / "scene.toml")
    there = found.seen >= 3
    assert there.sum() > 20
    np.testing.assert_allclose(found.values["coat.thickness_um"][there], wanted[there], rtol=0.02)
    z = ((found.values["coat.thickness_um"] - wanted) / found.sigmas["coat.thickness_um"])[there]
    assert np.mean(np.abs(z) < 2.0) > 0.8


def test_limits_not_noise(panel, found, tmp_path):
    """Where a coat is too thick for its base to be seen, its thickness is a lower limit; where light is missing, nothing is told."""
    channels = dict(read_exr(panel / "panel.exr").channels)
    dark = (ROW < 3) & (COLUMN > 5)
    thick = dataclasses.replace(STACK.layers[0], thickness_um=5000.0)
    opaque = STACK.with_parts([thick, STACK.base])
    wo = (EYE - POSITION) / np.linalg.norm(EYE - POSITION, axis=-1, keepdims=True)
    for k, to_light in enumerate(directions()):
        wi = np.broadcast_to(to_light, (SIDE * SIDE, 1, 3)).astype(np.float32)
        image = predict(opaque, wi, wo.reshape(-1, 3).astype(np.float32), np.pi * to_light[2] * np.ones_like(wi))
        for c, name in enumerate("RGB"):
            plane = channels[f"light{k}.{name}"]
            channels[f"light{k}.{name}"] = np.where(dark, image.reshape(SIDE, SIDE, 3)[..., c], plane)
    write_exr(tmp_path / "panel.exr", channels)
    (tmp_path / "scene.toml").write_text((panel / "scene.toml").read_text())
    limited = fit_map(tmp_path / "scene.toml")
    flags, values = limited.flags["coat.thickness_um"], limited.values["coat.thickness_um"]
    assert np.mean(flags[dark] & LOWER_LIMIT > 0) > 0.9
    assert np.all(values[dark] < 5000.0)
    assert np.median(values[dark]) > 100.0
    clear = ~dark & (limited.seen > 0)
    assert not flags[clear].any()


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["coat.thicknes_um"], "did you mean 'coat.thickness_um'"),
        ([], "nothing is left to map"),
        (["coat.thickness_um", "coat.absorption_per_mm"], "cannot both be mapped"),
        (["coat.thickness_um", "coat.thickness_scale"], "it multiplies the other"),
    ],
)
def test_what_cannot_be_mapped_is_said(names, words):
    with pytest.raises(InputError, match="map") as error:
        mapped(STACK, names, "scene.toml: map.free")
    assert words in str(error.value)


def test_every_parameter_can_be_mapped():
    start, free = mapped(STACK, list(known_parameters(STACK))[:3], "m")
    assert free.size == sum(len(f.slots) for f in free.free)
    assert np.shape(start.layers[0].absorption_per_mm) == (3,)


def test_a_shader_says_what_no_texture_can_hold():
    precise = dataclasses.replace(STACK, form=Precise())
    with pytest.raises(InputError, match="once a material"):
        print_material(precise, "m", maps=["coat.alpha"])
    with pytest.raises(InputError, match=r"did you mean 'coat\.alpha'"):
        print_material(STACK, "m", maps=["coat.alph"])
    with pytest.raises(InputError, match="leave uniforms out"):
        print_material(STACK, "m", uniforms=True, maps=["coat.alpha"])
    assert "vec3 lf_evaluate(FreeDirection wi, FreeDirection wo, float coat_thickness_um)" in print_material(
        precise, "m", maps=["coat.thickness_um"]
    ).text("essl300")


def test_the_command_makes_a_map(panel, found, tmp_path):
    ran = layerfit("map", panel / "scene.toml", "-o", tmp_path / "out", "--json")
    assert ran.code == 0, ran.err
    assert '"schema": "layerfit/map"' in ran.out
    assert (tmp_path / "out" / "material.frag").is_file()
    ran = layerfit("map", panel / "scene.toml", "-o", tmp_path / "other", "--free", "coat.depth")
    assert ran.code == 2
    assert "unknown parameter 'coat.depth'" in ran.err
    assert not (tmp_path / "other").exists()
