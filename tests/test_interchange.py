"""Materials in the words of other programs: their formulas are theirs, nothing changes on the way there and back, and what is lost is measured."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from commands import SCENE, TRUTH, layerfit, snapshot
from helpers import COPPER, QUICKLY, compiles, hemisphere
from layerfit import job
from layerfit.errors import InputError
from layerfit.interchange import blender, formats, gltf, materialx, openpbr, web
from layerfit.interchange.convert import Conversion, convert
from layerfit.interchange.dialects import DIALECTS
from layerfit.interchange.engine import Engine
from layerfit.interchange.formats import identifier, read_start
from layerfit.interchange.iridescence import filmed_metal, to_rgb
from layerfit.interchange.mapping import copied, metal_of, stack_of
from layerfit.layers import Coat
from layerfit.optics.film import film_reflectance
from layerfit.optics.fresnel import conductor_f0
from layerfit.optics.spectra import WAVELENGTHS_NM, daylight_weights
from layerfit.preset import read_preset
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Dielectric, Lambert

AS_PRINTED = 5e-5
"""Relative: MaterialX computes in float32 on the GPU, of inputs written with six digits."""
FLOOR = 1e-3
"""BRDF [1/sr] below which a difference is compared absolutely."""
EYE = 0.06
"""Of the reflectance of a film: four Gaussians in place of an eye, where a channel is next to black."""
SIX_DIGITS = 2e-5
"""What a document keeps of a number, in a BRDF whose lobe goes with the fourth power of a roughness."""

RED = [0.8, 0.3, 0.1]
TAU = [0.1, 0.3, 0.6]
PARTS: dict[str, dict[str, Any]] = {
    "metal": {"base": "metal", "base_color": RED, "edge_tint": [0.9, 0.8, 1.0], "alpha": 0.2},
    "metal with a grain": {"base": "metal", "base_color": RED, "edge_tint": [0.9, 0.8, 1.0], "alpha_x": 0.1, "alpha_y": 0.3},
    "diffuse": {"base": "diffuse", "base_color": RED},
    "glossy": {"base": "glossy", "base_color": RED, "alpha": 0.2, "ior": 1.7},
    "metal with a film": {"base": "metal", "base_color": RED, "alpha": 0.2, "film_nm": 380.0, "film_eta": 1.6},
    "mixed": {"base": "mixed", "base_color": RED, "edge_tint": [0.9, 0.8, 1.0], "metallic": 0.4, "alpha": 0.2},
}
COATED = ("metal", "diffuse", "mixed")
"""Bases that are written below a coat."""


def engine(dialect: str, part: str, coated: bool) -> Engine:
    """A coat over a base, or a base alone, with all that a program has words for."""
    rules, values = DIALECTS[dialect], dict(PARTS[part])
    if not rules.edge_tint:
        values.pop("edge_tint", None)
    if rules.film is None:
        values = {key: value for key, value in values.items() if not key.startswith("film")}
    if coated:
        values["coat_alpha"] = 0.1
        if rules.coat_index:
            values["coat_ior"] = 1.6
        if rules.path is not None:
            values["coat_tau"] = TAU
    return Engine(dialect=dialect, **values)


def conversion(made: Engine, stack: Any = None) -> Conversion:
    return Conversion("paint", stack, made, {}, {}, "nowhere", (), ())


EACH = [(part, coated) for part in PARTS for coated in (False, True) if not coated or part in COATED]
EVERY = pytest.mark.parametrize(("part", "coated"), EACH, ids=[f"{p}, coated" if c else p for p, c in EACH])


@jax.jit
def _rows(made: Engine, wi: Any, wo: Any) -> Any:
    return jax.vmap(lambda i, o: jnp.broadcast_to(made.below(jnp.ones(())).evaluate(i, o), (3,)))(wi, wo)


def values(made: Engine, wi: Any, wo: Any) -> np.ndarray:
    """BRDF (n, 3) of an engine's material."""
    traced = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), made)
    return np.asarray(jax.jit(_rows, compiler_options=QUICKLY)(traced, wi, wo))


@pytest.fixture(scope="module")
def pairs() -> tuple[np.ndarray, np.ndarray]:
    """Pairs of directions, a third of them about the mirror direction."""
    wi, wo = hemisphere(600, 1), hemisphere(600, 2)
    near = wi[:200] * [-1.0, -1.0, 1.0] + 0.05 * wo[:200]
    wo[:200] = near / np.linalg.norm(near, axis=-1, keepdims=True)
    return wi, wo


@EVERY
def test_materialx_draws_the_formula_that_is_fitted(part, coated, pairs, gl):
    if not materialx.is_here():
        pytest.skip("no MaterialX: pip install 'layerfit[interchange]'")
    made = engine("openpbr", part, coated)
    drawn = materialx.brdf(materialx.shader(openpbr.write(conversion(made))), *pairs)
    wanted = values(made, *pairs)
    assert np.max(np.abs(drawn - wanted) / np.maximum(wanted, FLOOR)) < AS_PRINTED


READERS = {
    "openpbr": lambda made: openpbr.read(Path("a.mtlx"), openpbr.write(conversion(made))),
    "gltf": lambda made: gltf.read(Path("a.gltf"), gltf.write(conversion(made)).encode()),
    "blender": lambda made: blender.read(Path("a.json"), {"schema": blender.SCHEMA, "inputs": blender.principled(made)}),
}


@pytest.mark.parametrize("dialect", READERS)
@EVERY
def test_what_is_written_is_read_back(dialect, part, coated, pairs):
    made = engine(dialect, part, coated)
    again = READERS[dialect](made)
    assert again.base == made.base
    wanted = values(made, *pairs)
    assert np.max(np.abs(values(again, *pairs) - wanted) / np.maximum(wanted, FLOOR)) < SIX_DIGITS


def test_a_coat_over_black_is_the_boundary_of_its_glass(pairs):
    """In Blender's formula a coat is Smith, GGX and Fresnel, as ours is; a base that is black adds nothing."""
    made = Engine(dialect="blender", base="diffuse", base_color=0.0, coat_alpha=0.15, coat_ior=1.4)
    glass = Dielectric(alpha=jnp.asarray(0.15), eta=jnp.asarray(1.4))
    wanted = jax.vmap(lambda i, o: glass.evaluate(i, o))(*map(jnp.asarray, pairs))
    np.testing.assert_allclose(values(made, *pairs)[:, 0], wanted, rtol=1e-12)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_coat_sends_back_no_more_light_than_it_gets(dialect):
    """Over white: the furnace, at three angles of view."""
    made = Engine(
        dialect=dialect,
        base="diffuse",
        base_color=1.0,
        coat_alpha=0.3,
        **({"coat_ior": 1.5} if DIALECTS[dialect].coat_index else {}),
    )
    wi = hemisphere(40_000, 3)
    for cosine in (0.3, 0.7, 1.0):
        wo = np.broadcast_to([np.sqrt(1.0 - cosine**2), 0.0, cosine], wi.shape)
        sent = np.mean(values(made, wi, wo)[:, 0] * wi[:, 2]) * 2.0 * np.pi * 0.98
        assert sent < 1.01 if DIALECTS[dialect].passes != "half" else sent < 1.06  # Babylon's masking is the short one
        assert sent > 0.3


def test_the_index_of_a_metal_is_found_by_two_reflectances():
    eta, k = np.array(COPPER["eta"]), np.array(COPPER["k"])
    made = copied(Stack((), Conductor(alpha=0.2, **COPPER), read_preset("brushed_steel").form), "openpbr")
    found_eta, found_k = metal_of(np.asarray(made.base_color), np.asarray(made.edge_tint))
    np.testing.assert_allclose(
        conductor_f0(*map(jnp.asarray, (found_eta, found_k))), conductor_f0(*map(jnp.asarray, (eta, k))), rtol=1e-6
    )
    np.testing.assert_allclose(found_eta[1:], eta[1:], rtol=0.1)  # of red, 82 degrees say little: the edge tint is clipped at 1
    np.testing.assert_allclose(found_k[1:], k[1:], rtol=0.1)


def test_layers_come_back_from_a_coat_over_a_base():
    stack = read_preset("lacquered_copper")
    again = stack_of(copied(stack, "openpbr"))
    coat, was = again.layers[0], stack.layers[0]
    assert isinstance(coat, Coat)
    for field in ("alpha", "eta", "tau"):
        np.testing.assert_allclose(getattr(coat, field), getattr(was, field), rtol=1e-6)
    assert isinstance(again.base, Conductor)
    np.testing.assert_allclose(again.base.alpha, stack.base.alpha)
    diffuse = stack_of(copied(read_preset("clear_coated_red_paint"), "gltf"))
    assert isinstance(diffuse.base, Lambert)
    assert len(diffuse.layers) == 1


def test_a_dielectric_keeps_the_widths_of_its_grain(tmp_path):
    """Over a colour as a coat, over black as a base."""
    for color, part in ((0.5, "layers"), (0.0, "base")):
        path = tmp_path / f"{part}.gltf"
        basic = {"metallicFactor": 0.0, "roughnessFactor": 0.5, "baseColorFactor": [color, color, color, 1.0]}
        extensions = {gltf.ANISOTROPY: {"anisotropyStrength": 0.5}}
        path.write_text(json.dumps({"materials": [{"pbrMetallicRoughness": basic, "extensions": extensions}]}))
        stack = read_start(path)
        lobe: Any = stack.layers[0] if part == "layers" else stack.base
        assert lobe.alpha is None
        assert (float(lobe.alpha_x), float(lobe.alpha_y)) == (0.4375, 0.25)


def test_a_grain_wider_than_a_layer_has_it_is_the_widest(tmp_path):
    """Of a rough surface with a strong grain, other programs make a lobe wider than 1."""
    principled, surface = tmp_path / "a.json", tmp_path / "a.mtlx"
    inputs = {"Metallic": 1.0, "Roughness": 1.0, "Anisotropic": 0.9}
    principled.write_text(json.dumps({"schema": blender.SCHEMA, "inputs": inputs}))
    made = {"base_metalness": 1.0, "specular_roughness": 1.0, "specular_roughness_anisotropy": 0.9}
    items = "".join(f"<input name='{name}' value='{value}'/>" for name, value in made.items())
    surface.write_text(f"<materialx><open_pbr_surface name='a'>{items}</open_pbr_surface></materialx>")
    for path, narrow in ((principled, np.sqrt(1.0 - 0.9 * 0.9)), (surface, 0.1 * np.sqrt(2.0 / 1.01))):
        base: Any = read_start(path).base
        assert float(base.alpha_x) == 1.0
        np.testing.assert_allclose(base.alpha_y, narrow)


def test_a_tangent_may_have_any_name():
    text = openpbr.write(conversion(Engine(dialect="openpbr", alpha_x=0.1, alpha_y=0.3)))
    quoted = openpbr.read(Path("a.mtlx"), text.replace('"across"', '"a\'cross"'))
    assert float(quoted.alpha_y) == pytest.approx(0.3, rel=1e-4)
    other = openpbr.read(Path("a.mtlx"), text.replace('nodename="across"', 'nodename="a\'cross"'))
    assert float(other.alpha_x) == pytest.approx(0.3, rel=1e-4)


@pytest.fixture(scope="module")
def found() -> dict[str, Conversion]:
    """Two materials: a lacquered metal, and one that glTF has words for."""
    stacks = {name: read_preset(name) for name in ("lacquered_copper", "brushed_steel")}
    return {name: convert(stack, name, "gltf") for name, stack in stacks.items()}


def test_the_best_values_are_nearer_than_a_copy(found):
    copper = found["lacquered_copper"]
    assert copper.error["delta_e"] < 0.6 * copper.copied_error["delta_e"]
    assert copper.error["rel_l2"] < 0.3 * copper.copied_error["rel_l2"]
    assert any("absorption" in sentence for sentence in copper.lost)
    assert np.all(np.asarray(copper.engine.base_color) < np.asarray(copied(copper.stack, "blender").base_color))


def test_next_to_nothing_is_lost_of_what_there_are_words_for(found):
    steel = found["brushed_steel"]
    assert steel.error["rel_l2"] < 0.01
    assert steel.error["delta_e"] < 0.05
    assert not any("grain" in sentence for sentence in steel.lost)


def test_a_film_is_written_where_it_is_nearer_than_none():
    """Of a temper colour: the extension of glTF, and a start of a fit from it."""
    stack = read_preset("anodised_titanium")
    made, cycles, plain = (convert(stack, "titanium", dialect) for dialect in ("gltf", "blender", "openpbr"))
    assert plain.engine.film_nm is None
    for filmed, on in ((made, "a clear medium"), (cycles, "a metal")):
        assert filmed.engine.film_nm is not None
        assert filmed.error["delta_e"] < 0.5 * plain.error["delta_e"]
        assert any(f"three channels, on {on}" in sentence for sentence in filmed.lost)
        base: Any = stack_of(filmed.engine).base
        assert float(base.film_nm) == pytest.approx(float(filmed.engine.film_nm))
    assert gltf.material(made.engine, "titanium")["extensions"][gltf.IRIDESCENCE]["iridescenceFactor"] == 1.0
    assert float(cycles.engine.film_nm) == pytest.approx(np.mean(stack.base.film_nm), rel=0.05)


def test_a_film_on_a_metal_is_that_of_the_spectrum():
    """In Cycles' way it turns the phase as the metal does: the Gaussians that stand for an eye are what is left between the two."""
    f0, f82, eta = jnp.array([0.54, 0.5, 0.45]), jnp.array([0.72, 0.67, 0.64]), jnp.asarray(2.2)
    root = jnp.sqrt(f0)
    n = (1.0 + root) / (1.0 - root) * (1.0 - f82) + (1.0 - f0) / (1.0 + f0) * f82
    k = jnp.sqrt((f0 * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - f0))
    rgb = to_rgb(jnp.float64)
    filmed = jax.jit(lambda c, nm: filmed_metal(c, nm, eta, f0, f82, rgb))
    waves = jax.jit(jax.vmap(lambda c, depth: film_reflectance(c, eta, n, k, depth), (None, 0)))
    for nm in (50.0, 90.0, 300.0):
        for c in (0.5, 0.8, 1.0):
            wanted = np.sum(daylight_weights() * np.asarray(waves(c, nm / WAVELENGTHS_NM)), 0)
            np.testing.assert_allclose(filmed(c, nm), wanted, atol=EYE)


def test_a_film_of_openpbr_is_where_a_fit_starts():
    """Written it is not: MaterialX halves what is below a film."""
    text = openpbr.write(conversion(engine("openpbr", "metal", False)))
    film = {"thin_film_weight": 1.0, "thin_film_thickness": 0.38, "thin_film_ior": 1.6}
    items = "".join(f'<input name="{name}" type="float" value="{value}"/>' for name, value in film.items())
    read = openpbr.read(Path("a.mtlx"), text.replace("</open_pbr_surface>", f"{items}</open_pbr_surface>"))
    base: Any = stack_of(read).base
    assert (float(base.film_nm), float(base.film_eta)) == (380.0, 1.6)


def test_gltf_is_valid(found, tmp_path):
    """By the validator of Khronos."""
    script = "const v = require('gltf-validator'), fs = require('fs');" + (
        "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => console.log(JSON.stringify(r.issues)));"
    )
    node = shutil.which("node")
    if node is None or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True, check=False).returncode:
        pytest.skip("no gltf-validator: npm install gltf-validator, and name its node_modules in NODE_PATH")
    film = {"film": conversion(engine("gltf", "metal with a film", True))}
    for name, made in (found | film).items():
        path = tmp_path / f"{name}.gltf"
        path.write_text(gltf.write(made))
        ran = subprocess.run([node, "-e", script, str(path)], capture_output=True, text=True, check=True)
        issues = json.loads(ran.stdout)
        assert issues["numErrors"] == issues["numWarnings"] == 0, issues


def test_the_sphere_of_a_gltf_is_closed_and_faces_outwards(found):
    import base64

    document = json.loads(gltf.write(found["brushed_steel"]))
    data = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    views = [data[v["byteOffset"] : v["byteOffset"] + v["byteLength"]] for v in document["bufferViews"]]
    points = np.frombuffer(views[0], "<f4").reshape(-1, 3)
    corners = points[np.frombuffer(views[1], "<u2").reshape(-1, 3)].astype(float)
    volume = np.linalg.det(corners).sum() / 6.0
    assert 0.97 * 4.0 / 3.0 * np.pi < volume < 4.0 / 3.0 * np.pi


@pytest.mark.parametrize("coated", [False, True])
def test_code_for_the_web_says_the_same_numbers(coated):
    three = web.three_settings(engine("three", "metal with a grain" if not coated else "diffuse", coated))
    assert three["metalness"] == ("0" if coated else "1")
    assert ("clearcoat" in three) == coated
    assert ("specularIntensity" in three) == coated
    babylon = web.babylon_settings(engine("babylon", "metal", coated))
    assert float(babylon["roughness"]) ** 2 == pytest.approx(0.2, rel=1e-5)
    if coated:
        assert babylon["clearCoat.tintColor"] == "new Color3({:g}, {:g}, {:g})".format(*np.exp(-np.array(TAU)))
        assert babylon["clearCoat.indexOfRefraction"] == "1.6"


def test_three_js_gets_the_shader_itself():
    stack = read_preset("bare_wood")
    text = web.write_three(conversion(engine("three", "diffuse", False), stack))
    assert "#version" not in text  # three.js writes it
    assert "vec3 lf_brdf(" in text
    assert text.count("export const") == 2


def test_the_stages_of_the_shader_for_three_js_fit_together(tmp_path):
    """Compiled and linked as WebGL 2 would, with the line that three.js puts in front."""
    text = web.write_three(conversion(engine("three", "metal with a grain", False), read_preset("brushed_steel")))
    vertex = text.partition("vertexShader: `")[2].partition("`")[0]
    fragment = json.loads(text.partition("fragmentShader: ")[2].rpartition(",\n});")[0])
    stages = {"a.vert": f"precision highp float;\n{vertex}", "a.frag": fragment}
    compiles(tmp_path, {name: f"#version 300 es\n{stage}" for name, stage in stages.items()}, "-l")


def test_names_are_those_of_every_format():
    assert identifier("1 lacquered-copper") == "material_1_lacquered_copper"


@pytest.fixture
def preset(tmp_path) -> Path:
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(TRUTH))
    return path


def test_an_export_says_what_is_lost_and_keeps_it_in_the_preset(preset, tmp_path, monkeypatch, found):
    copper = replace(found["lacquered_copper"], name="paint")
    monkeypatch.setattr(formats, "convert", lambda *_: copper)
    ran = layerfit("export", preset, "--to", "gltf", "-o", tmp_path / "paint.gltf")
    assert ran.code == 0, ran.err
    for sentence in copper.lost:
        assert f"lost: {sentence}" in ran.err
    assert json.loads((tmp_path / "paint.gltf").read_text())["materials"][0]["name"] == "paint"
    assert json.loads(preset.read_text())["losses"] == {"gltf": copper.to_json()}
    assert read_preset(preset).layers[0].name == "coat"


def test_an_export_that_cannot_be_written_leaves_the_preset_as_it_is(preset, tmp_path, monkeypatch, found):
    monkeypatch.setattr(formats, "convert", lambda *_: found["lacquered_copper"])
    (tmp_path / "folder").mkdir()
    before = preset.read_bytes()
    ran = layerfit("export", preset, "--to", "gltf", "-o", tmp_path / "folder")
    assert ran.code == 2
    assert "cannot be written" in ran.err
    assert preset.read_bytes() == before


def test_a_script_for_blender_is_python(found):
    made = replace(found["lacquered_copper"], engine=engine("blender", "metal", True))
    text = blender.write(made)
    compile(text, "paint.py", "exec")
    assert '"Coat IOR": 1.6' in text


def test_a_fit_starts_from_a_material_of_blender(tmp_path, monkeypatch):
    start, scene = tmp_path / "principled.json", tmp_path / "scene.toml"
    scene.write_text(SCENE)
    inputs = {
        "Base Color": [0.9, 0.6, 0.4, 1.0],
        "Metallic": 1.0,
        "Roughness": 0.5,
        "Coat Weight": 1.0,
        "Coat Tint": [0.8, 0.6, 0.3, 1.0],
    }
    start.write_text(json.dumps({"schema": blender.SCHEMA, "inputs": inputs}))
    fitted: list[Any] = []

    def fit_scene(scene: Any, *_: Any, **__: Any) -> Any:
        fitted.append(scene.start)
        raise InputError("far enough")

    monkeypatch.setattr(job, "fit_scene", fit_scene)
    assert "far enough" in layerfit("fit", scene, "--start", start).err
    coat, base = fitted[0].layers[0], fitted[0].base
    assert (coat.name, base.name) == ("coat", "base")
    np.testing.assert_allclose(coat.tau, -0.5 * np.log([0.8, 0.6, 0.3]))
    assert float(coat.alpha) == 1e-3  # Blender's default, .03 squared, is below the range
    assert base.alpha == 0.25


def _surface(name: str, value: str) -> str:
    """An OpenPBR document with one input."""
    return f"<materialx><open_pbr_surface name='a'><input name='{name}' value='{value}'/></open_pbr_surface></materialx>"


BAD = {
    "a.gltf": ("{}", "no glTF material"),
    "textured.gltf": (
        '{"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}',
        "baseColorTexture .* Use factors alone",
    ),
    "words.gltf": ('{"materials": [{"pbrMetallicRoughness": {"metallicFactor": "x"}}]}', "metallicFactor = 'x'"),
    "bright.gltf": (
        '{"materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [2, 1, 1, 1]}}]}',
        "base.albedo = .* outside its range 0 to 1",
    ),
    "a.glb": ("glTF", "not a binary glTF"),
    "a.mtlx": ("<materialx>", "not valid XML"),
    "entities.mtlx": ('<!DOCTYPE a [<!ENTITY b "c">]><materialx/>', "declares entities"),
    "other.mtlx": ("<materialx><standard_surface name='a'/></materialx>", "no open_pbr_surface"),
    "graph.mtlx": (
        "<materialx><open_pbr_surface name='a'><input name='base_color' nodename='b'/></open_pbr_surface></materialx>",
        "comes from a graph or a texture",
    ),
    "three.mtlx": (_surface("base_metalness", "0, 0, 0"), "base_metalness = .*: should be a finite number"),
    "one.mtlx": (_surface("coat_color", "0.5"), "coat_color = 0.5: should be three numbers"),
    "word.mtlx": (_surface("coat_ior", "glass"), "coat_ior = 'glass': should be a finite number"),
    "digits.gltf": (
        '{"materials": [{"pbrMetallicRoughness": {"metallicFactor": %s}}]}' % ("9" * 400),
        "metallicFactor = .*: should be a finite number",
    ),
    "a.json": ('{"schema": "something"}', "not a material of Blender"),
    "a.blend": ("BLENDER", "blender-kit"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_start_that_cannot_be_read_says_why(name, tmp_path):
    text, said = BAD[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said):
        read_start(tmp_path / name)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--to", "gltff"], "did you mean 'gltf'"),
        (["--to", "gltf", "--uniforms"], "are of the shader"),
        (["--scene", "a.toml"], "--scene is for --to"),
        (["--to", "gltf", "--scene", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_an_export_that_cannot_be_says_why_and_writes_nothing(options, said, preset, tmp_path):
    before = snapshot(tmp_path)
    ran = layerfit("export", preset, *options)
    assert ran.code == 2
    assert said in ran.err
    assert snapshot(tmp_path) == before


def test_shipped_presets_stay_as_they_are(monkeypatch, found):
    path = formats.find_preset(Path("brushed_steel"))
    before = path.read_bytes()
    monkeypatch.setattr(formats, "convert", lambda *_: found["brushed_steel"])
    assert not formats.export_to(Path("brushed_steel"), "gltf").stored
    assert path.read_bytes() == before
