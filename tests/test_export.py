"""The exported shader itself, with its own `main`, lights and output, drawn and compared with JAX; and that a bad drawing is seen."""

import dataclasses
import json
import re

import jax
import numpy as np
import pytest

from helpers import COPPER, STACKS, compiles, printed, varnish
from layerfit.errors import MachineError
from layerfit.layers import Coat
from layerfit.render import radiance
from layerfit.report.text import worst
from layerfit.shader import gl as gl_module, verify
from layerfit.shader.export import HEADERS, print_material
from layerfit.shader.gl import shade_points
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert

EYE = np.array([0.8, 0.6, 4.9])
DISTANT, POINT = np.array([0.4, 0.6, 0.7, 0.0]), np.array([2.0, -1.0, 3.0, 1.0])
IRRADIANCE, INTENSITY = np.array([3.0, 2.0, 1.0]), np.array([5.0, 9.0, 14.0])

REL = 2e-4
"""The shader has positions and normals as float32 and makes its directions of them: 1e-7 of a half vector, seen through a lobe
of width .05, is 1e-7 / .05^2 of the value, and a few times that at grazing angles."""

FLOOR = 1e-3
"""Part of the brightest value below which pixels are compared absolutely."""


def sphere(count: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, normals and tangents on a unit sphere, as a mesh would bring them: float32."""
    k = np.arange(count) + 0.5
    z, phi = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    normal = np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    return normal.astype(np.float32), (normal * 1.7).astype(np.float32), tangent.astype(np.float32)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def by_jax(stack, lights):
    """Radiance (n, 3) of the sphere in double precision; below its horizon it is 0."""
    position, normal, tangent = (a.astype(float) for a in sphere())
    n, v = unit(normal), unit(EYE - position)
    t = unit(tangent - np.sum(tangent * n, -1, keepdims=True) * n)
    frame = np.stack([t, np.cross(n, t), n], -2)
    wi, weight = [], []
    for light, rgb in lights:
        away = light[:3] - light[3] * position
        distance2 = np.sum(away * away, -1, keepdims=True)
        l = away / np.sqrt(distance2)
        wi.append(np.einsum("nij,nj->ni", frame, l))
        weight.append(rgb / (distance2 if light[3] else 1.0) * np.maximum(np.sum(n * l, -1, keepdims=True), 0.0))
    wo = np.einsum("nij,nj->ni", frame, v)
    return np.asarray(jax.jit(radiance)(stack.astype(np.float64), np.stack(wi, 1), wo, np.stack(weight, 1)))


def drawn(text, lights, uniforms=None):
    """The same by the exported text."""
    position, normal, tangent = sphere()
    attributes = {"v_position": position, "v_normal": normal, "v_tangent": tangent}
    if "v_tangent" not in text:
        del attributes["v_tangent"]
    rows = lambda values: tuple(map(tuple, values)) if len(values) > 1 else tuple(values[0])  # noqa: E731
    host = {"u_eye": tuple(EYE), "u_light": rows([p for p, _ in lights]), "u_light_rgb": rows([rgb for _, rgb in lights])}
    return shade_points(text, attributes, {**host, **{k: _plain(v) for k, v in (uniforms or {}).items()}})


def _plain(value):
    return tuple(value.tolist()) if np.ndim(value) else float(value)


def with_lights(text, count):
    """The text as an engine would compile it for more lights."""
    version, rest = text.split("\n", 1)
    return f"{version}\n#define LF_LIGHTS {count}\n{rest}"


def agree(image, wanted):
    error = np.abs(image - wanted) / np.maximum(np.abs(wanted), FLOOR * wanted.max())
    assert np.mean(wanted.max(-1) > 0.0) > 0.2, "too little of the sphere is lit to say anything"
    assert np.all(np.isfinite(image))
    place = np.unravel_index(np.argmax(error), error.shape)
    assert error.max() <= REL, (place, image[place], wanted[place])


DRAWN = (
    "corrected over conductor",
    "corrected over lambert",
    "corrected, clear coat",
    "corrected, anisotropic",
    "corrected, three layers",
    "faithful over conductor",
    "conductor",
    "oren_nayar",
)


@pytest.mark.parametrize("target", HEADERS)
@pytest.mark.parametrize("uniforms", [False, True], ids=["constants", "uniforms"])
@pytest.mark.parametrize("name", DRAWN)
def test_the_exported_shader_draws_the_material(gl, name, uniforms, target):
    if target == "essl300":
        assert "GL_ARB_ES3_compatibility" in gl.extensions, "this driver cannot compile GLSL ES in a desktop context"
    shader = print_material(STACKS[name], name, uniforms)
    lights = [(DISTANT, IRRADIANCE)]
    agree(drawn(shader.text(target), lights, shader.uniforms), by_jax(STACKS[name], lights))


def test_several_lights_of_both_kinds(gl):
    stack = STACKS["corrected over conductor"]
    lights = [(DISTANT, IRRADIANCE), (POINT, INTENSITY), (DISTANT * [-1.0, 1.0, 1.0, 1.0], IRRADIANCE[::-1])]
    agree(drawn(with_lights(print_material(stack, "m").text(), 3), lights), by_jax(stack, lights))


def test_a_light_direction_need_not_be_of_unit_length(gl):
    stack = STACKS["corrected over lambert"]
    text = print_material(stack, "m").text()
    np.testing.assert_allclose(
        drawn(text, [(DISTANT * 7.0, IRRADIANCE)]), drawn(text, [(DISTANT, IRRADIANCE)]), rtol=1e-4, atol=1e-6
    )


OTHERS = {
    "copper under amber": (
        Stack((varnish(),), Conductor(alpha=0.2, **COPPER)),
        Stack(
            (varnish(alpha=0.3, eta=1.7, tau=[0.4, 0.0, 0.1]),), Conductor(alpha=0.08, eta=[1.5, 1.0, 0.6], k=[7.6, 6.6, 5.4])
        ),
    ),
    "wood under varnish": (
        Stack((varnish(),), Lambert(albedo=[0.5, 0.28, 0.13])),
        Stack((varnish(alpha=0.05, eta=1.35, tau=[0.2, 0.2, 0.2]),), Lambert(albedo=[0.1, 0.2, 0.7])),
    ),
    "known absorption": (
        Stack((Coat(alpha=0.1, absorption_per_mm=[1.0, 4.0, 12.0], thickness_um=50.0),), Conductor(alpha=0.2, **COPPER)),
        Stack((Coat(alpha=0.1, absorption_per_mm=[1.0, 4.0, 12.0], thickness_um=90.0),), Conductor(alpha=0.2, **COPPER)),
    ),
}


@pytest.mark.parametrize("target", HEADERS)
@pytest.mark.parametrize("name", OTHERS)
def test_other_uniforms_are_another_material(gl, name, target):
    """What an artist does with --uniforms: the text stays, the numbers move."""
    first, second = OTHERS[name]
    text = print_material(first, "m", uniforms=True).text(target)
    values = print_material(second, "m", uniforms=True).uniforms
    lights = [(DISTANT, IRRADIANCE)]
    wanted = by_jax(second, lights)
    agree(drawn(text, lights, values), wanted)
    assert np.max(np.abs(by_jax(first, lights) - wanted)) > 0.05 * wanted.max(), "the two materials look alike"


@pytest.mark.parametrize("name", DRAWN)
def test_every_uniform_is_declared_and_given(name):
    shader = print_material(STACKS[name], name, uniforms=True)
    declared = re.findall(r"^uniform (?:float|vec3) (u_(?!eye|light)\w+);", shader.text(), re.MULTILINE)
    assert declared == list(shader.uniforms)
    assert declared, "a material without numbers"


@pytest.mark.parametrize("define", ["LF_LIBRARY", "LF_SRGB", "LF_LIGHTS 4"])
def test_what_can_be_defined_validates(define, tmp_path):
    shader = print_material(STACKS["corrected, anisotropic"], "m")
    end = "out vec4 c;\nvoid main() { c = vec4(lf_brdf(vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 0.6, 0.8), vec3(0.0, 0.0, 1.0)), 1.0); }\n"
    split = {target: shader.text(target).split("\n", 1) for target in HEADERS}
    last = end if define == "LF_LIBRARY" else ""
    compiles(
        tmp_path, {f"{target}.frag": f"{first}\n#define {define}\n{rest}{last}" for target, (first, rest) in split.items()}
    )


def test_srgb_on_request(gl):
    """LF_SRGB encodes for a screen (IEC 61966-2-1)."""
    text = print_material(STACKS["corrected over lambert"], "m").text()
    version, rest = text.split("\n", 1)
    lights = [(DISTANT, IRRADIANCE)]
    x = np.clip(drawn(text, lights), 0.0, 1.0)
    wanted = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1.0 / 2.4) - 0.055)
    np.testing.assert_allclose(drawn(f"{version}\n#define LF_SRGB\n{rest}", lights), wanted, atol=2e-6)


@pytest.mark.parametrize("target", HEADERS)
@pytest.mark.parametrize("name", STACKS)
def test_the_text_stands_alone(name, target):
    text = printed(STACKS[name]).text(target)
    assert text.startswith("#version ")
    assert "#include" not in text
    assert not re.search(r"^//@|@[A-Z]+@", text, re.MULTILINE), "a slot was left open"
    assert not re.search(r"\n\n\n", text)
    assert text.endswith("#endif\n")
    assert text.isascii()


def sabotaged(monkeypatch, change):
    """The printed functions drawn by a `main` that somebody broke."""
    real = verify.shade_points
    monkeypatch.setattr(verify, "shade_points", lambda text, *args: real(change(text), *args))


SHADER_MAIN = "color = vec4("


def test_pixels_that_are_not_drawn_are_seen(gl, monkeypatch):
    sabotaged(monkeypatch, lambda text: text.replace(SHADER_MAIN, "if (v_wi.x > 0.5) discard;\n    color = vec4("))
    with pytest.raises(MachineError, match=r"left \d+ of 65536 pixels undrawn, the first is number \d+"):
        verify.check_pairs(print_material(STACKS["lambert"], "m"))


def test_a_draw_that_draws_nothing_is_seen(gl, monkeypatch):
    sabotaged(monkeypatch, lambda text: text.replace(SHADER_MAIN, "discard;\n    color = vec4("))
    with pytest.raises(MachineError, match="left 65536 of 65536 pixels undrawn, the first is number 0"):
        verify.check_pairs(print_material(STACKS["lambert"], "m"))


def test_a_draw_outside_of_its_pixels_is_seen(gl, monkeypatch):
    """Points larger than a pixel: every pixel is drawn, by whichever point came last."""
    vertex = "layerfit.shader.gl._POINT_VERTEX"
    monkeypatch.setattr(vertex, gl_module._POINT_VERTEX.replace("gl_PointSize = 1.0", "gl_PointSize = 8.0"))
    with pytest.raises(MachineError, match="drew to pixels outside the image"):
        verify.check_pairs(print_material(STACKS["lambert"], "m"), 500)


def test_a_wrong_value_is_a_failure_and_is_named(gl, monkeypatch):
    """One pixel in 65536, wrong by a thousandth."""
    shader = print_material(STACKS["corrected over conductor"], "m")
    wi, wo = verify.random_pairs(65536, 0)
    k = 31_007
    there = f"distance(v_wi, vec3({', '.join(f'{float(x):.9g}' for x in wi[k])})) < 1e-7"
    sabotaged(
        monkeypatch, lambda text: text.replace("* v_weight", f"* v_weight * ({there} ? vec3(1.0, 1.001, 1.0) : vec3(1.0))")
    )
    parity = verify.check_pairs(shader)
    assert not parity.passed
    assert parity.max_rel == pytest.approx(1e-3, rel=0.02)
    assert parity.p999_rel < 1e-5, "one pixel is not the rule"
    assert parity.worst["channel"] == "g"
    np.testing.assert_array_equal(parity.worst["wi"], wi[k].astype(float))
    np.testing.assert_array_equal(parity.worst["wo"], wo[k].astype(float))
    assert parity.worst["shader"] == pytest.approx(1.001 * parity.worst["jax"], rel=1e-5)


@pytest.mark.parametrize("value", ["0.0 / v_zero", "1.0 / v_zero"], ids=["NaN", "infinity"])
def test_a_value_that_is_not_finite_is_a_failure(gl, monkeypatch, value):
    zero = "(v_wi.x - v_wi.x)"
    sabotaged(monkeypatch, lambda text: text.replace("* v_weight", f"* v_weight + vec3({value.replace('v_zero', zero)})"))
    parity = verify.check_pairs(print_material(STACKS["conductor"], "m"), 600)
    assert parity.max_rel == np.inf
    assert not parity.passed
    document = json.loads(json.dumps(parity.to_json(), allow_nan=False))
    assert document["max_rel"] is None
    assert document["worst"]["shader"] is None
    assert "shader not finite, JAX 0." in worst(document["worst"])


def test_another_material_is_a_failure(gl):
    """The shader of one material against JAX of another: what verification is there to see."""
    right = print_material(STACKS["corrected over conductor"], "m")
    wrong = dataclasses.replace(right, stack=STACKS["corrected, clear coat"])
    assert verify.check_pairs(right, 6000).passed
    assert not verify.check_pairs(wrong, 6000).passed


def test_a_shader_that_does_not_compile_says_where(gl):
    with pytest.raises(MachineError, match=r"does not compile the shader"):
        shade_points(
            "#version 330 core\nin vec3 v_a;\nout vec4 color;\nvoid main() { color = v_a; }\n", {"v_a": np.zeros((4, 3))}
        )


def test_parity_is_relative_above_the_floor():
    model = np.array([[1.0, 1e-6, 0.0], [2.0, 1.0, 1.0]], np.float32)
    shader = np.array([[1.0, 2e-6, 0.0], [2.002, 1.0, 1.0]], np.float32)
    parity = verify.compare(shader, model, floor=1e-2, describe=lambda row: {"row": row})
    assert parity.max_rel == pytest.approx(1e-3, rel=1e-3)
    assert parity.worst == {"row": 1, "channel": "r", "shader": pytest.approx(2.002), "jax": 2.0}
    assert parity.count == 6
