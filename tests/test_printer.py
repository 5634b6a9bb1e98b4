"""The printer: every primitive on the GL driver, structure of the text, and what it refuses."""

import re
from pathlib import Path

import gallery
import jax
import jax.numpy as jnp
import manual
import numpy as np
import pytest

from helpers import STACKS, compiles, every_text, printed
from layerfit._chunk import CHUNKS, chunk, dot, member, safe_divide, safe_power, safe_sqrt, struct, vec2, vec3, vec4
from layerfit._types import Scalar, Vec3
from layerfit.layers import LAYERS
from layerfit.optics.hashing import hash_cell, unit
from layerfit.preset import MODELS, read_preset
from layerfit.shader.bounds import ANY
from layerfit.shader.export import print_material
from layerfit.shader.gl import shade_points
from layerfit.shader.glsl import PrintError, literal
from layerfit.shader.primitives import BUILTINS, PRIMITIVES as PRINTED
from layerfit.shader.printer import Printer
from layerfit.shader.verify import random_pairs
from layerfit.shipped import shipped_presets
from layerfit.surfaces import BASES

GOLDEN = Path(__file__).parent / "golden"


def run_both(fn, *columns):
    """A function of vec3 columns on the GPU and in JAX: two arrays (n, 3)."""
    printer = Printer(CHUNKS)
    example = jnp.zeros(3, jnp.float32)
    names = ["abc"[k] for k in range(len(columns))]
    whole = lambda *args: jnp.broadcast_to(fn(*args), (3,)).astype(jnp.float32)  # noqa: E731
    printer.function(whole, "lf_test", [], [(example, name, ANY) for name in names])
    source = "#version 330 core\n" + printer.structs_text() + printer.functions_text()
    source += "".join(f"in vec3 v_{name};\n" for name in names)
    source += f"out vec4 color;\nvoid main() {{ color = vec4(lf_test({', '.join(f'v_{n}' for n in names)}), 1.0); }}\n"
    columns = [np.asarray(c, np.float32) for c in columns]
    gpu = shade_points(source, {f"v_{n}": c for n, c in zip(names, columns, strict=True)})
    return gpu, np.asarray(jax.jit(jax.vmap(whole))(*columns)), source


rng = np.random.default_rng(0)
WIDE = np.sort(rng.uniform(-20.0, 20.0, (500, 3)), 0)
UNIT = rng.uniform(-1.0, 1.0, (500, 3))
POSITIVE = 10.0 ** rng.uniform(-6.0, 3.0, (500, 3))
SMALL = np.sign(UNIT) * 10.0 ** rng.uniform(-7.0, 0.0, (500, 3))
ANGLE = rng.uniform(-1.5, 1.5, (500, 3))


def _word(a):
    """An unsigned word with all of its bits in use."""
    return (a[0] * 1e6).astype(jnp.int32).astype(jnp.uint32) * jnp.uint32(2654435761)


def _pieces(word):
    """A word in two numbers that a float32 holds exactly."""
    high = word >> jnp.uint32(16)
    return jnp.stack([high, word - high * jnp.uint32(65536), jnp.uint32(0)]).astype(jnp.float32)


PRIMITIVES = {
    "add": (lambda a, b: a + b, WIDE, UNIT),
    "sub": (lambda a, b: a - (b - a), WIDE, UNIT),
    "mul": (lambda a, b: a * (b * a), WIDE, UNIT),
    "div": (lambda a, b: a / (b / a), POSITIVE, POSITIVE),
    "neg": (lambda a, b: -(-a - b), WIDE, UNIT),
    "max": (lambda a, b: jnp.maximum(a, b[0]) + jnp.maximum(b[0], a), WIDE, UNIT),
    "min": (lambda a, b: jnp.minimum(a, b) + jnp.minimum(b[0], a), WIDE, UNIT),
    "pow": (lambda a, b: jnp.power(a, b), POSITIVE, UNIT),
    "integer_pow": (lambda a: (a + 0.5) ** 3 + a**2 + a**-2 + a**-1, POSITIVE),
    "square": (lambda a: jnp.square(a - 0.5), WIDE),
    "exp": (jnp.exp, WIDE * 0.5),
    "exp2": (jnp.exp2, WIDE * 0.5),
    "log": (jnp.log, POSITIVE),
    "sqrt": (jnp.sqrt, POSITIVE),
    "rsqrt": (jax.lax.rsqrt, POSITIVE),
    "sin": (jnp.sin, ANGLE),
    "cos": (jnp.cos, ANGLE),
    "tan": (lambda a: jnp.tan(0.8 * a), ANGLE),
    "atan2": (lambda a, b: jnp.stack([jnp.arctan2(a[k], b[k]) for k in range(3)]), WIDE, UNIT),
    "erf": (jax.lax.erf, ANGLE * 3.0),
    "expm1": (jnp.expm1, SMALL * 3.0),
    "log1p": (lambda a: jnp.log1p(jnp.abs(a)), SMALL * 5.0),
    "abs": (jnp.abs, WIDE),
    "sign": (jnp.sign, WIDE),
    "floor": (jnp.floor, WIDE),
    "ceil": (jnp.ceil, WIDE),
    "clamp": (lambda a: jax.lax.clamp(jnp.float32(-0.5), a, jnp.float32(0.75)), UNIT),
    "gt": (lambda a, b: jnp.where(a > b, a, 0.0) + jnp.where(a[0] > b[0], 1.0, 2.0), UNIT, UNIT[::-1]),
    "ge": (lambda a, b: jnp.where(a >= b[0], a, b), UNIT, UNIT[::-1]),
    "lt": (lambda a, b: jnp.where(a[0] < b, a, b), UNIT, UNIT[::-1]),
    "le": (lambda a, b: jnp.where(a <= b, a, b), UNIT, UNIT),
    "eq": (lambda a, b: jnp.where(a == b, 1.0, b), UNIT, UNIT),
    "ne": (lambda a, b: jnp.where(a != b, 1.0, b), UNIT, UNIT),
    "and": (lambda a, b: jnp.where((a[0] > 0.0) & (b[0] > 0.0), a, b), UNIT, UNIT[::-1]),
    "or": (lambda a, b: jnp.where((a[0] > 0.0) | (b[0] > 0.0), a, b), UNIT, UNIT[::-1]),
    "xor": (lambda a: _pieces(_word(a) ^ (_word(a) * jnp.uint32(40503))), WIDE),
    "bitcast_convert_type": (lambda a: _pieces(jax.lax.bitcast_convert_type(a[0], jnp.uint32)), WIDE),
    "shift_left": (lambda a: _pieces(_word(a) << (_word(a) >> jnp.uint32(27)) | jnp.uint32(2)), WIDE),
    "shift_right_logical": (lambda a: _pieces((_word(a) + jnp.uint32(7)) >> jnp.uint32(5)), WIDE),
    "not": (lambda a, b: jnp.where(~(a[0] > b[0]), a, b), UNIT, UNIT[::-1]),
    "select_n": (lambda a, b: jnp.where(a[0] > 0.0, b, a), UNIT, UNIT[::-1]),
    "broadcast_in_dim": (lambda a, b: jnp.full(3, a[0]) * jnp.ones(3, jnp.float32) + b, UNIT, UNIT[::-1]),
    "convert_element_type": (lambda a: (a > 0.0).astype(jnp.float32) + (a[0] > 0.5).astype(jnp.float32), UNIT),
    "slice": (lambda a, b: jnp.stack([a[2], (a + b)[0], jnp.sum(a[:2] * 2.0)]), UNIT, UNIT[::-1]),
    "concatenate": (lambda a, b: jnp.concatenate([a[:2], b[1:2]]), UNIT, UNIT[::-1]),
    "stack": (lambda a, b: jnp.stack([a[1], b[0], a[2]]), UNIT, UNIT[::-1]),
    "reduce_sum": (lambda a, b: jnp.sum(a * b) * a, UNIT, UNIT[::-1]),
    "dot": (lambda a, b: dot(a, b) * a, UNIT, UNIT[::-1]),
    "vec2": (lambda a, b: jnp.concatenate([vec2(a[0]) * b[:2] + a[1:], b[2:]]), UNIT, UNIT[::-1]),
    "vec3": (lambda a, b: vec3(a[0]) * b + a, UNIT, UNIT[::-1]),
    "vec4": (lambda a, b: (vec4(a[0]) * jnp.concatenate([b, a[:1]]) + 1.0)[1:], UNIT, UNIT[::-1]),
    "reshape": (lambda a: jnp.reshape(a, (3,)) + jnp.reshape(a[1:2], ()), UNIT),
    "squeeze": (lambda a: jnp.squeeze(a[1:2]) * a, UNIT),
    "copy": (lambda a: jnp.copy(a) + 1.0, UNIT),
    "stop_gradient": (lambda a: jax.lax.stop_gradient(a) * 2.0, UNIT),
    "scan": (
        lambda a: jax.lax.scan(lambda t, x: (t + a * x * t, None), a, jnp.asarray(np.arange(1, 6, dtype=np.float32)))[0],
        np.abs(UNIT),
    ),
    "safe_sqrt": (lambda a: safe_sqrt(a), UNIT),
    "safe_divide": (lambda a, b: safe_divide(a, b[0]), UNIT, np.abs(UNIT) - 0.1),
    "power": (lambda a: safe_power(a, 1.34), UNIT),
}

# An exp that is 17 units in the last place off, as GLSL allows, and what is made of it; the others are rounding.
LOOSE = {
    "reduce_sum": 5e-6,
    "dot": 5e-6,
    "exp": 3e-6,
    "exp2": 3e-6,
    "pow": 2e-5,
    "erf": 1e-6,
    "expm1": 3e-6,
    "log": 2e-6,
    "log1p": 1e-6,
    "sin": 4e-6,
    "cos": 4e-6,
    "tan": 6e-6,
    "power": 2e-5,
}


NEAR_ZERO = {"sin", "cos", "tan", "log", "erf", "power", "reduce_sum", "dot"}
"""Where the value is a difference of larger numbers: compared absolutely near 0."""


@pytest.mark.parametrize("name", PRIMITIVES)
def test_primitive_on_the_gpu(gl, name):
    fn, *columns = PRIMITIVES[name]
    gpu, wanted, source = run_both(fn, *columns)
    scale = np.maximum(np.abs(wanted), 1e-3 if name in NEAR_ZERO else 1e-30)
    error = np.where(gpu == wanted, 0.0, np.abs(gpu - wanted) / scale)
    assert np.all(np.isfinite(gpu)), source
    assert error.max() <= LOOSE.get(name, 1e-6), (error.max(), source)


def test_what_a_loop_reads_keeps_its_name_to_the_end_of_the_loop(gl):
    """A value from outside is read again in the next turn: its name was given to another one after its last use in the text."""

    def summed(outside):
        def step(total, x):
            return total + (lambda inside: inside * inside)(jnp.cos(outside * x)), None

        return jax.lax.scan(step, outside, jnp.asarray(np.arange(1, 6, dtype=np.float32)))[0]

    gpu, model, source = run_both(lambda a: summed(a * a + 1.0), UNIT)
    np.testing.assert_allclose(gpu, model, rtol=1e-5, err_msg=source)


def test_the_hash_is_the_same_to_the_bit(gl):
    """On the GPU, in JAX, and in Python's own whole numbers."""

    def word(k):
        return lambda a: _pieces(hash_cell(jnp.floor(a[:2]), jnp.uint32(2**31 + 5))[k])

    def by_hand(x, y, z):
        mask = 2**32 - 1
        x, y, z = ((v * 1664525 + 1013904223) & mask for v in (x, y, z))
        for stir in range(2):
            x = (x + y * z) & mask
            y = (y + z * x) & mask
            z = (z + x * y) & mask
            if stir == 0:
                x, y, z = (v ^ (v >> 16) for v in (x, y, z))
        return x, y, z

    cells = WIDE * 1e5
    hashed = np.array([by_hand(*(int(v) & (2**32 - 1) for v in np.floor(np.float32(c[:2]))), 2**31 + 5) for c in cells])
    for k in range(3):
        gpu, jax_value, _ = run_both(word(k), cells)
        np.testing.assert_array_equal(gpu, jax_value)
        np.testing.assert_array_equal(gpu[:, 0] * 65536.0 + gpu[:, 1].astype(float), hashed[:, k])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_hashed_numbers_are_never_0_or_1(dtype):
    for bits in (0, 2**32 - 1):
        u = unit(jnp.uint32(bits), jnp.zeros((), dtype))
        assert u.dtype == dtype
        assert 0.0 < float(u) < 1.0


def test_every_primitive_is_tried():
    """Nothing is printed that no test runs on a GPU."""
    assert set(PRINTED) | BUILTINS <= set(PRIMITIVES)


@pytest.mark.parametrize("name", STACKS)
def test_parity_on_random_and_extreme_pairs(gl, name):
    from layerfit.shader.verify import check_pairs

    parity = check_pairs(printed(STACKS[name]))
    assert parity.count == 3 * 65536
    assert parity.p999_rel <= 1e-5, parity
    assert parity.max_rel <= 5e-5, parity


def test_the_pairs_are_unit_above_and_extreme():
    wi, wo = random_pairs(6000, 1)
    for w in (wi, wo):
        np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1.0, atol=1e-6)
        assert np.all(w[:, 2] > 0.0)
        assert np.min(w[:, 2]) < 1e-3
    h = wi + wo
    tilt = np.hypot(h[:, 0], h[:, 1]) / h[:, 2]
    assert np.mean(tilt < 0.05) > 0.1  # in the highlight


@pytest.mark.parametrize("name", STACKS)
def test_validates(name, tmp_path):
    compiles(tmp_path, every_text(STACKS[name]))


UNIFORMS = (
    "corrected over lambert",
    "corrected over conductor",
    "corrected, anisotropic",
    "milky over lambert",
    "faithful over conductor",
)


@pytest.mark.parametrize("name", UNIFORMS)
def test_uniforms_and_constants_draw_the_same(gl, name):
    from layerfit.shader.verify import shade_samples

    wi, wo = random_pairs(4096, 2)
    one = np.ones((len(wi), 1, 3), np.float32)
    constants, uniforms = (shade_samples(printed(STACKS[name], u), wi[:, None], wo, one) for u in (False, True))
    np.testing.assert_allclose(uniforms, constants, rtol=2e-5, atol=1e-6)


FORMS = (
    "corrected over conductor",
    "corrected over lambert",
    "corrected, three layers",
    "faithful over conductor",
    "precise, two coats",
)
GOLDEN_STACKS = {name: STACKS[name] for name in FORMS} | manual.EXAMPLES
"""What no preset shows: the shaders of those lie beside them."""


@pytest.mark.parametrize("name", GOLDEN_STACKS)
def test_golden(name, request):
    """The printed text, whole, but for last digits that are a processor's: a change is one of every shipped shader and is looked at.

    --update-golden rewrites.
    """
    path = GOLDEN / (re.sub(r"\W+", "_", name) + ".frag")
    text = print_material(GOLDEN_STACKS[name], name).text()
    if request.config.getoption("--update-golden"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    assert gallery.same(text, path.read_text())


def test_every_model_has_a_printed_shader_that_is_kept():
    kept = [*GOLDEN_STACKS.values(), *(read_preset(preset.path) for preset in shipped_presets())]
    shown = {type(part) for stack in kept for part in (*stack.layers, stack.base, stack.form)}
    assert shown >= {*LAYERS.values(), *BASES.values(), *MODELS.values()}
    assert {re.sub(r"\W+", "_", name) + ".frag" for name in GOLDEN_STACKS} == {path.name for path in GOLDEN.iterdir()}


def test_the_text_reads_as_written_by_hand():
    text = print_material(STACKS["corrected over conductor"], "lacquered copper").text()
    assert "float lf_fresnel_dielectric(float c, float eta) {" in text
    assert "    float delta = (eta - 1.0) * (eta + 1.0);" in text
    assert (
        "// D V, the GGX density (Walter et al. 2007, eq. 33) and height-correlated Smith masking (Heitz 2014, eq. 99), by one division."
        in text
    )
    assert "const Coat lf_coat = Coat(" in text
    assert re.search(r"0\.1, +// alpha: width of the facet slopes", text)
    assert not re.search(r"\bt\d*\b = ", text), "a local without a name"
    assert max(map(len, text.splitlines())) < 180


def test_what_a_material_does_without_is_not_in_its_text():
    clear = print_material(STACKS["corrected, clear coat"], "clear").text()
    assert "exp(" not in clear.split("lf_evaluate(FreeDirection wi")[1].split("lf_brdf")[0]
    assert "tau" not in clear
    assert "anisotropic" not in clear
    bare = print_material(STACKS["lambert"], "paper").text()
    assert "fresnel" not in bare
    assert "fresnel" in clear


def test_guards_are_plain_operations():
    _, _, source = run_both(lambda a: safe_sqrt(a), UNIT)
    assert "sqrt(max(a, 0.0))" in source.replace("vec3(0.0)", "0.0")


def test_an_unknown_primitive_names_the_line():
    with pytest.raises(PrintError, match=r"test_printer\.py:\d+.*'cumsum'"):
        Printer(CHUNKS).function(lambda a: jnp.cumsum(a), "lf_test", [], [(jnp.zeros(3, jnp.float32), "a", ANY)])


def test_a_shape_that_glsl_has_not_is_refused():
    with pytest.raises(PrintError, match="shape"):
        Printer(CHUNKS).function(lambda a: jnp.sum(jnp.outer(a, a), 0), "lf_test", [], [(jnp.zeros(3, jnp.float32), "a", ANY)])


def test_two_chunks_of_one_name_are_refused():
    with pytest.raises(ValueError, match="ggx_d"):

        @chunk
        def ggx_d(x):
            return x


@struct
class Pair:
    """Two numbers that a chunk returns."""

    input: Scalar = member("a word that GLSL reserves")
    sample: Vec3 = member("another")


@chunk
def reserved_words(half: Vec3, out: Scalar) -> Pair:
    """Parameters, locals and fields called as GLSL keywords."""
    packed = half * out
    return Pair(out + 1.0, packed)


def test_reserved_words(gl):
    def fn(a, b):
        pair = reserved_words(a, b[0])
        return pair.sample * pair.input

    gpu, wanted, _ = run_both(fn, UNIT, UNIT[::-1])
    np.testing.assert_allclose(gpu, wanted, rtol=1e-6)


@chunk
def overloaded(x):
    """Twice."""
    return x + x


def test_one_chunk_serves_scalars_and_vectors(gl):
    gpu, wanted, source = run_both(lambda a: overloaded(a) * overloaded(a[0]), UNIT)
    np.testing.assert_allclose(gpu, wanted, rtol=1e-6)
    assert source.count("lf_overloaded(vec3 x)") == 1
    assert source.count("lf_overloaded(float x)") == 1


def test_a_name_is_reused_only_when_its_old_value_is_done():
    def fn(a):
        x = a * 2.0
        kept = x + 1.0
        x = x * 3.0
        return kept * x * kept

    gpu_source = run_both(fn, UNIT)
    np.testing.assert_allclose(gpu_source[0], gpu_source[1], rtol=1e-6)


def test_literals():
    assert literal(np.float32(0.1)) == "0.1"
    assert literal(np.float32(1.0)) == "1.0"
    assert literal(np.float32(1e-30)) == "1e-30"
    assert literal(np.array([1.0, 1.0, 1.0], np.float32)) == "vec3(1.0)"
    assert literal(np.uint32(7)) == "7u"
    assert literal(np.bool_(True)) == "true"
    with pytest.raises(PrintError, match="nan"):
        literal(np.float32(np.nan))


def test_text_without_source_positions_is_valid(gl, monkeypatch):
    """Names come from an internal of JAX; without it they are plainer and the numbers the same."""
    from layerfit.shader import names
    from layerfit.shader.verify import check_pairs

    monkeypatch.setattr(names, "user_frames", None)
    shader = print_material(STACKS["corrected over conductor"], "test")
    assert "throughput" not in shader.functions
    assert check_pairs(shader, 4096).passed
