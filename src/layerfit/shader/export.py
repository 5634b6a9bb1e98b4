"""A material as a shader: the traced functions in the template of `shaders/`, with the fitted values as constants or uniforms."""

import dataclasses
import re
from collections.abc import Callable, Sequence
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from .. import __version__
from .._chunk import CHUNKS
from .._fields import params
from .._place import TANGENT, Place
from .._types import FreeDirection
from ..forms import weathering
from ..optics.lazanyi import fit_lazanyi
from ..preset import left_out, model_name
from ..stack import Stack, at, evaluate
from .bounds import ANY, Bounds
from .glsl import literal
from .printer import PREFIX, Printer
from .template import AT_UV, COSINES, FREE, MAPS, SIZES, asks, template
from .values import TILT, check_live, check_maps, constants, held_constants, mapped, named, numbers

UNIT = 1e-5
"""What a direction's length may be off 1."""

HEADERS = {
    "glsl330": "#version 330 core",
    "essl300": "#version 300 es\nprecision highp float;\nprecision highp int;",
}
"""First lines of a shader for each target."""

SWIZZLE = {"float": "r", "vec3": "rgb"}
"""What of a texel is the value of a parameter."""


@dataclasses.dataclass(frozen=True)
class Shader:
    """A printed material."""

    name: str
    stack: Stack
    functions: str
    """Structs, constants and functions, up to `vec3 lf_brdf(...)`; complete without anything else."""
    uniforms: dict[str, Any]
    """Values of the uniforms, by name; empty where values are constants."""
    maps: tuple[str, ...] = ()
    """Parameters that differ from place to place, such as "coat.thickness_um", and "tilt" for the slopes of the normal."""
    tangent: bool = False
    """Whether the slopes of the normal are along a tangent that is given, and across it."""

    @property
    def asks(self) -> frozenset[str]:
        """What the BRDF asks for beside a normal and two directions: a tangent, texture coordinates, a distance, a share of the sky."""
        told = {
            TANGENT: self.tangent,
            MAPS: bool(self.parameters),
            TILT: TILT in self.maps,
            AT_UV: bool(self.maps) or "uv" in self.stack.reads,
        }
        own = asks(self.stack) - ({FREE} if self.tangent else set())
        return own | {word for word, there in told.items() if there}

    @property
    def parameters(self) -> tuple[tuple[str, str, str], ...]:
        """Type, name and meaning of what the BRDF is given of its maps."""
        return tuple((number.kind, number.name, number.note) for number in mapped(self.stack, self.maps))

    def text(self, target: str = "glsl330", file: str = "material.frag") -> str:
        """The whole fragment shader: a template of `shaders/` with this material in its slots."""
        slots = {
            "header": HEADERS[target],
            "about": self._about(),
            "material": self.functions,
            "lights": template("lights.glsl", self.asks),
            "output": template("output.glsl", self.asks),
            "tilted": template("tilt.glsl", self.asks),
            "textures": "".join(f"uniform sampler2D u_{name};  // {note}\n" for _, name, note in self.parameters),
            "texels": "".join(
                f"    {kind} {name} = texture(u_{name}, v_uv).{SWIZZLE[kind]};\n" for kind, name, _ in self.parameters
            ),
            "given": "".join(f"in {kind} v_{name};\n" for kind, name, _ in self.parameters),
            "taken": "".join(f"    {kind} {name} = v_{name};\n" for kind, name, _ in self.parameters),
        }
        text = template(file, self.asks, self.parameters)
        return re.sub(r"^//@ (\w+)$", lambda slot: slots[slot[1]].rstrip("\n"), text, flags=re.M)

    def _about(self) -> str:
        called = "".join(
            c if c.isprintable() else " " for c in self.name
        )  # the end of a line would end the comment, and begin code
        if note := getattr(self.stack.base, "note", ""):
            return f"// {called}.\n// Printed by layerfit {__version__}. {note}"
        layers = " over ".join(type(layer).__name__ for layer in (*self.stack.layers, self.stack.base))
        lines = [
            f"{called}: {layers}.",
            f"Printed by layerfit {__version__} from its {model_name(self.stack)} form.",
            f"Left out, because this material does without: {', '.join(left_out(self.stack)) or 'nothing'}.",
        ]
        if weathering.grows(self.stack.layers):
            return "\n".join(f"// {line}" for line in [lines[0], f"Printed by layerfit {__version__}.", *lines[2:]])
        covered = (*self.stack.layers, self.stack.base)[1:]
        constants = not any(name.startswith("u_") for name in self.uniforms)
        if constants and any(name == "eta" for layer in covered for name, _ in params(layer)):
            lines += ["Indices of refraction are relative to the layer above: its own index divides those in the preset."]
        lines += approximations(self.stack)
        return "\n".join(f"// {line}" for line in lines)


def approximations(stack: Stack) -> list[str]:
    """What a shader says of its Fresnel reflectances where they are not those of the index alone."""
    lines, n = [], 1.0
    for layer in (*stack.layers, stack.base):
        if getattr(layer, "fresnel", "exact") == "lazanyi":
            error = float(np.max(fit_lazanyi(layer.eta / n, getattr(layer, "k", 0.0) / n).error))
            lines.append(
                f"{layer.name}: reflectance after Lazanyi and Szirmay-Kalos 2005, within {error:.1g} of the exact one."
            )
        if getattr(layer, "has_film", False):
            lines.append(
                f"{layer.name}: under a film of {float(layer.film_nm):g} nm, whose colour in daylight is in its constants."
            )
        n = getattr(layer, "eta", n)
    return lines


def print_material(
    stack: Stack,
    name: str,
    uniforms: bool | Literal["prepared"] = False,
    *,
    maps: Sequence[str] = (),
    tangent: bool = False,
) -> Shader:
    """Print a material: its values as constants, or as uniforms `u_LAYER_FIELD` from which the shader computes its constants.

    `uniforms="prepared"`: the constants themselves are uniforms, whose names they keep. The shader then costs what one with constants
    does, and its host computes them: `Shader.uniforms` has those of this material, `program.program` what gives those of another.

    `maps` are parameters that differ from place to place, such as "coat.thickness_um": they become parameters of `lf_brdf`, and the example
    entry point reads each from a texture `u_coat_thickness_um`; all others are constants. With "tilt" among them the entry point tilts the
    normal by the slopes in the texture `u_tilt`, along a tangent that it is given (`tangent`), else in a frame of the
    normal alone. Raises `InputError` for a parameter that the material does not have, or that a shader cannot compute its constants from.
    """
    stack = stack.astype(jnp.float32)
    check_maps(stack, maps, uniforms)
    printer = Printer(CHUNKS)
    shader = Shader(name, stack, "", {}, tuple(maps), tangent)
    inputs = _inputs(shader)
    if uniforms is True or shader.parameters:
        traced = _from_numbers(shader, uniforms)
        inputs += [(number.value, number.name, ANY) for number in mapped(stack, maps)]
    else:
        traced = _from_constants(shader, uniforms, printer, len(inputs))
    traced.brdf.__doc__ = FREELY if FREE in shader.asks else IN_FRAME
    cosines = COSINES in shader.asks
    printer.function(
        traced.brdf, f"{PREFIX}{'shade' if cosines else 'evaluate'}", traced.outside, inputs, constant=not uniforms
    )
    frame = template("cosines.glsl" if cosines else "brdf.glsl", shader.asks, shader.parameters)
    parts = printer.structs_text(), traced.declarations, printer.functions_text(), frame
    return dataclasses.replace(shader, functions="\n".join(part for part in parts if part), uniforms=traced.uniforms)


FREELY = "BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine."
IN_FRAME = "BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine."


def _inputs(shader: Shader) -> list[tuple[jax.Array, str, Bounds]]:
    """Parameters of the BRDF, but for what comes from maps: an example of each, its name, and what it can be."""
    within = Bounds(-1.0 - UNIT, 1.0 + UNIT)
    if COSINES in shader.asks:
        one = jnp.ones((), jnp.float32)
        return [(one, "NoL", within), (one, "NoV", within), (one, "lean2", Bounds(0.0, 4.0 + UNIT))]
    w: Any = jnp.array([0.0, 0.0, 1.0], jnp.float32)
    if FREE in shader.asks:
        w = FreeDirection(jnp.zeros(3, jnp.float32), jnp.ones((), jnp.float32))
    place = [(jnp.zeros(SIZES[name][1], jnp.float32), name, ANY) for name in shader.stack.reads]
    return [(w, "wi", within), (w, "wo", within), *place]


def _shade(shader: Shader, prepared: Any, wi: Any, wo: Any, *place: Any) -> Any:
    """BRDF (3,) of a prepared material and of what `_inputs` says."""
    if COSINES in shader.asks:
        (lean2,) = place
        return jnp.broadcast_to(prepared.shade(wi, wo, lean2), (3,))
    there = Place(**dict(zip(shader.stack.reads, place, strict=True))) if place else None
    return jnp.broadcast_to(evaluate(shader.stack.form, at(prepared, there), wi, wo), (3,))


@dataclasses.dataclass(frozen=True)
class _Traced:
    """A BRDF to be traced, and what stands outside of it in the shader."""

    brdf: Callable[..., Any]
    """Of what is outside, and of its parameters."""
    outside: list[tuple[Any, str]]
    """Numbers and structs, each with the expression that reaches it."""
    declarations: str
    uniforms: dict[str, Any]


def _from_numbers(shader: Shader, uniforms: bool | Literal["prepared"]) -> _Traced:
    """The material's own numbers outside: the shader computes its constants from them, and from those of the maps."""
    stack = shader.stack
    check_live(stack)
    rows, leaves, structure = numbers(stack), jax.tree.leaves(stack), jax.tree.structure(stack)
    of_maps = {name for _, name, _ in shader.parameters}
    given = [row for row in rows if row and row.name not in of_maps]
    held = held_constants(stack)

    def local(*args: Any) -> Any:
        fixed, there = iter(args[: len(given)]), iter(args[len(args) - len(of_maps) :])
        values = [
            leaf if not row else next(there) if row.name in of_maps else next(fixed)
            for row, leaf in zip(rows, leaves, strict=True)
        ]
        live: Stack = jax.tree.unflatten(structure, values)
        made = dataclasses.replace(live.prepare(), **held)
        return _shade(shader, made, *args[len(given) : len(args) - len(of_maps)])

    prefix = "u_" if uniforms else PREFIX
    outside = [(row.value, f"{prefix}{row.name}") for row in given]
    if uniforms:
        declarations = "".join(f"uniform {row.kind} u_{row.name};  // {row.note}\n" for row in given)
    else:
        declarations = "".join(f"const {row.kind} {PREFIX}{row.name} = {literal(row.value)};  // {row.note}\n" for row in given)
    return _Traced(local, outside, declarations, {name: np.asarray(value) for value, name in outside} if uniforms else {})


def _from_constants(shader: Shader, uniforms: bool | Literal["prepared"], printer: Printer, count: int) -> _Traced:
    """What is prepared once outside, as constants or as uniforms; the BRDF has `count` parameters."""
    made, outside = constants(shader.stack)
    structure = jax.tree.structure(made)

    def local(*args: Any) -> Any:
        live = jax.tree.unflatten(structure, jax.tree.leaves(args[:-count]))
        return _shade(shader, live, *args[-count:])

    if uniforms:
        declarations = "".join(printer.uniform(name, part) for part, name in outside)
    else:
        declarations = "\n".join(printer.constant(name, part) for part, name in outside)
    return _Traced(local, outside, declarations, named(outside) if uniforms else {})
