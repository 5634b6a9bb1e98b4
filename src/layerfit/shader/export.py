"""A material as a shader: the traced functions in the template of `shaders/`, with the fitted values as constants or uniforms."""

import dataclasses
import re
from collections.abc import Sequence
from functools import cache
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from .. import __version__
from .._chunk import CHUNKS, where
from .._data import shaders
from .._fields import params
from .._place import TANGENT, Place, needs_tangent
from ..documents import nearest
from ..errors import InputError
from ..forms import weathering
from ..forms.precise import BAKED, Precise, held
from ..optics.lazanyi import fit_lazanyi
from ..preset import left_out, model_name
from ..stack import PREPARED, Stack, at, evaluate, prepared
from .bounds import ANY, Bounds
from .glsl import literal
from .printer import PREFIX, Printer
from .structs import named_leaves

SIZES = {"uv": ("vec2", (2,)), "distance": ("float", ()), "sky": ("float", ())}
"""What a material may read of a place: its type in the shader and in JAX."""

UNIT = 1e-5
"""What a direction's length may be off 1."""

COSINES = "cosines"
FREE = "free"
"""How a shader holds directions where it has no frame: their cosines alone, or the part along the surface in any space and the cosine."""

MAPS, TILT, AT_UV = "maps", "tilt", "at_uv"
"""What the example entry point does where values come from textures: reads them, tilts the normal, and is given texture coordinates."""

HEADERS = {
    "glsl330": "#version 330 core",
    "essl300": "#version 300 es\nprecision highp float;\nprecision highp int;",
}
"""First lines of a shader for each target."""


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
        told = {TANGENT} if self.tangent else set()
        told |= {MAPS} if self.parameters else set()
        told |= {TILT} if TILT in self.maps else set()
        return (
            (asks(self.stack) - ({FREE} if self.tangent else set()))
            | told
            | ({AT_UV} if self.maps or "uv" in self.stack.reads else set())
        )

    @property
    def parameters(self) -> tuple[tuple[str, str, str], ...]:
        """Type, name and meaning of what the BRDF is given of its maps."""
        return map_parameters(self.stack, self.maps)

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


SWIZZLE = {"float": "r", "vec3": "rgb"}
"""What of a texel is the value of a parameter."""


def map_parameters(stack: Stack, maps: Sequence[str]) -> tuple[tuple[str, str, str], ...]:
    """Type, name in the shader and meaning of the mapped parameters of layers, in the order of the layers."""
    return tuple((kind, name, note) for _, name, kind, note in _live(stack) if name in {_flat(m) for m in maps})


def _flat(name: str) -> str:
    """A parameter's name as a shader can have it: `coat_thickness_um`."""
    return name.replace(".", "_")


def asks(stack: Stack) -> frozenset[str]:
    """What the templates are to bring for a material, and whether it asks for cosines alone in place of two directions."""
    layers = (*stack.layers, stack.base)
    tangent = {TANGENT} if any(needs_tangent(layer) for layer in layers) else set()
    cosines = getattr(stack.base, "by_cosines", False) and not stack.layers
    directions = {COSINES} if cosines else tangent or {FREE}
    return frozenset(stack.reads) | directions


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
    _check_maps(stack, maps, uniforms)
    printer = Printer(CHUNKS)
    free = FREE in asks(stack) and not tangent
    w = jnp.array([0.0, 0.0, 0.0, 1.0] if free else [0.0, 0.0, 1.0], jnp.float32)
    within = Bounds(-1.0 - UNIT, 1.0 + UNIT)
    inputs = [(w, "wi", within), (w, "wo", within)]
    inputs += [(jnp.zeros(SIZES[name][1], jnp.float32), name, ANY) for name in stack.reads]
    cosines = COSINES in asks(stack)
    if cosines:
        one = jnp.ones((), jnp.float32)
        inputs = [(one, "NoL", within), (one, "NoV", within), (one, "lean2", Bounds(0.0, 4.0 + UNIT))]

    def shade(prepared: Any, wi: Any, wo: Any, *place: Any) -> Any:
        if cosines:
            (lean2,) = place
            return jnp.broadcast_to(where(jnp.minimum(wi, wo) > 0.0, prepared.shade(wi, wo, lean2), 0.0), (3,))
        there = Place(**dict(zip(stack.reads, place, strict=True))) if place else None
        return jnp.broadcast_to(evaluate(stack.form, at(prepared, there), wi, wo), (3,))

    mapped = [name for _, name, _ in map_parameters(stack, maps)]
    if uniforms is True or mapped:
        _check_live(stack)
        rows, leaves = _uniforms(stack), jax.tree.leaves(stack)
        given = [row for row in rows if row and row[1] not in mapped]
        prefix = "u_" if uniforms else PREFIX
        if uniforms:
            declarations = "".join(f"uniform {kind} u_{name};  // {note}\n" for _, name, kind, note in given)
        else:
            declarations = "".join(
                f"const {kind} {PREFIX}{name} = {literal(leaf)};  // {note}\n" for leaf, name, kind, note in given
            )
        values = {f"u_{name}": np.asarray(leaf) for leaf, name, _, _ in given} if uniforms else {}
        structure = jax.tree.structure(stack)
        constants = _held(stack)
        inputs += [(row[0], row[1], ANY) for row in rows if row and row[1] in mapped]

        def local(*args: Any) -> Any:
            fixed, there = iter(args[: len(given)]), iter(args[len(args) - len(mapped) :])
            values = [
                leaf if not row else next(there) if row[1] in mapped else next(fixed)
                for row, leaf in zip(rows, leaves, strict=True)
            ]
            live: Stack = jax.tree.unflatten(structure, values)
            made = dataclasses.replace(live.prepare(), **constants)
            return shade(made, *args[len(given) : len(args) - len(mapped)])

        outside = [(leaf, f"{prefix}{name}") for leaf, name, _, _ in given]
    else:
        made, outside = _constants(stack)
        if uniforms:
            declarations = "".join(printer.uniform(name, part) for part, name in outside)
            values = _named(outside)
        else:
            declarations = "\n".join(printer.constant(name, part) for part, name in outside)
            values = {}
        structure = jax.tree.structure(made)

        def local(*args: Any) -> Any:
            live = jax.tree.unflatten(structure, jax.tree.leaves(args[: -len(inputs)]))
            return shade(live, *args[-len(inputs) :])

    local.__doc__ = (
        "BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine."
        if free
        else "BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine."
    )
    printer.function(local, f"{PREFIX}{'shade' if cosines else 'evaluate'}", outside, inputs, constant=not uniforms)
    shader = Shader(name, stack, "", values, tuple(maps), tangent)
    frame = template("cosines.glsl" if cosines else "brdf.glsl", shader.asks, shader.parameters)
    functions = "\n".join(part for part in (printer.structs_text(), declarations, printer.functions_text(), frame) if part)
    return dataclasses.replace(shader, functions=functions)


def uniforms_of(stack: Stack) -> dict[str, np.ndarray]:
    """Values of the uniforms of a shader that was printed with `uniforms="prepared"`, for a material of the same structure."""
    return _named(_constants(stack.astype(jnp.float32))[1])


def _constants(stack: Stack) -> tuple[Any, list[tuple[Any, str]]]:
    """A prepared material, and its parts with their names in the shader."""
    with jax.enable_x64(False):
        made = jax.tree.map(np.asarray, prepared(stack))
    return made, [(part, f"{PREFIX}{name}") for name, part in _parts(stack, made)]


def _named(parts: Sequence[tuple[Any, str]]) -> dict[str, np.ndarray]:
    return {name: leaf for part, root in parts for name, leaf in named_leaves(root, part)}


def _check_maps(stack: Stack, maps: Sequence[str], uniforms: Any) -> None:
    layers = (*stack.layers, stack.base)
    known = [f"{layer.name}.{field}" for layer in layers for field, _ in params(layer) if getattr(layer, field) is not None]
    known.append(TILT)
    for name in maps:
        if name not in known:
            raise InputError(
                f"there is no parameter {name!r} to map{nearest(name, known)}. This material has {', '.join(known)}"
            )
        if name != TILT and _flat(name) not in {row[1] for row in _live(stack)}:
            raise InputError(
                f"{name} cannot come from a texture: the precise form looks up what follows from it once a material, which a shader cannot. "
                'Give the material model = "corrected", whose shader computes it at every place'
            )
    if maps and uniforms:
        raise InputError("a shader with maps has its other values as constants: leave uniforms out")
    if maps and _of_curves(stack):
        raise InputError(
            "a compact material is made of curves, in which no parameter is left to map: print the material itself"
        )


def _check_live(stack: Stack) -> None:
    """Raise `InputError` where a shader could not compute its constants from its uniforms."""
    for layer in (*stack.layers, stack.base):
        if getattr(layer, "fresnel", None) == "lazanyi":
            raise InputError(
                f'{layer.name}.fresnel = "lazanyi" is fitted to the index once a material, which a shader cannot do from uniforms: '
                'print the material with constants, or give it fresnel = "schlick" or "exact"'
            )
        if getattr(layer, "has_film", False):
            raise InputError(
                f"{layer.name}.film_nm: a film is integrated over the spectrum once a material, which a shader cannot do from uniforms: "
                "print the material with constants"
            )


def _of_curves(stack: Stack) -> bool:
    """Whether it is a compact material, made of polynomials and a few numbers."""
    return not stack.layers and getattr(stack.base, "of_curves", False)


def _by_field(name: str, value: Any) -> list[tuple[str, Any]]:
    """The fields of a struct by their names, of structs of structs all, each a constant of its own."""
    fields = [field.name for field in dataclasses.fields(value) if not field.metadata.get("static")]
    parts: list[tuple[str, Any]] = []
    for field in fields:
        part = getattr(value, field)
        nested = dataclasses.is_dataclass(part) and any(
            dataclasses.is_dataclass(getattr(part, inner.name)) for inner in dataclasses.fields(part)
        )
        parts += _by_field(f"{name}_{field}", part) if nested else [(f"{name}_{field}", part)]
    return [(name, part) for name, part in parts if part is not None]


def _parts(stack: Stack, prepared: Any) -> list[tuple[str, Any]]:
    """The constants of a prepared material, by the names of the layers that they belong to, in the order of its leaves."""
    if _of_curves(stack):
        return _by_field(stack.base.name, prepared)
    if prepared is None or not stack.layers:
        return [(stack.base.name, prepared)]
    parts: list[tuple[str, Any]] = []
    for field in dataclasses.fields(prepared):
        value = getattr(prepared, field.name)
        if isinstance(value, PREPARED):
            parts += _parts(stack, value)
        elif isinstance(value, tuple):
            for layer, item in zip(stack.layers, value, strict=True):
                own = isinstance(item, type(layer))
                if item is None:
                    continue
                parts.append((layer.name if own else f"{layer.name}_{type(item).__name__.lower()}", item))
        elif field.name == "base" or isinstance(value, type(stack.base)):
            parts.append((stack.base.name if field.name == "base" else f"{stack.base.name}_{field.name}", value))
        elif dataclasses.is_dataclass(value):
            coat = stack.layers[0].name
            parts.append((coat if isinstance(value, type(stack.layers[0])) else f"{coat}_{field.name}", value))
        elif value is not None:
            parts.append((f"{stack.base.name}_{field.name}", value))
    return parts


def _held(stack: Stack) -> dict[str, Any]:
    """Parts of the prepared material that are constants also where its other numbers are uniforms."""
    if not isinstance(stack.form, Precise) or not stack.layers:
        return {}
    with jax.enable_x64(False):
        return jax.tree.map(np.asarray, held(prepared(stack)))


def _live(stack: Stack) -> list[tuple[Any, str, str, str]]:
    """Every number of the material from which its shader can compute: (value, name, type, comment)."""
    return [row for row in _uniforms(stack) if row]


def _uniforms(stack: Stack) -> list[tuple[Any, str, str, str] | None]:
    """Every number of the material as (value, name, type, comment), in the order of its leaves; None for what is baked."""
    rows: list[tuple[Any, str, str, str] | None] = []
    baked = stack.layers if isinstance(stack.form, Precise) else ()
    for layer in (*stack.layers, stack.base):
        for field, spec in params(layer):
            value = getattr(layer, field)
            if value is None:
                continue
            if field in BAKED and any(layer is coat for coat in baked):
                rows.append(None)
            else:
                note = f"{spec.doc}, {spec.lower:g} to {spec.upper:g} {'' if spec.unit == '1' else spec.unit}".rstrip()
                rows.append((value, f"{layer.name}_{field}", "vec3" if np.ndim(value) else "float", note))
    return rows


@cache
def template(file: str, asks: frozenset[str], maps: tuple[tuple[str, str, str], ...] = ()) -> str:
    """A file of `shaders/` with its conditional parts chosen, and what the material asks for in its lists of parameters."""
    text = (shaders() / file).read_text()
    names = [name for name in SIZES if name in asks]
    place = [(SIZES[name][0], name) for name in names] + [(kind, name) for kind, name, _ in maps]
    lists = {
        "@FRAME@": f"vec3 n, {'vec3 t, ' if TANGENT in asks else ''}vec3 v, vec3 l@PLACE@",
        "@ALONG@": ", v_tangent" if TANGENT in asks else "",
        "@PLACE@": "".join(f", {kind} {name}" for kind, name in place),
        "@THERE@": "".join(f", {name}" for _, name in place),
    }

    def choose(match: re.Match[str]) -> str:
        yes, _, no = match[2].partition("//@ else\n")
        return yes if match[1] in asks else no

    text = re.sub(r"^//@ if (\w+)\n(.*?)^//@ end\n", choose, text, flags=re.M | re.S)
    for word, parameters in lists.items():
        text = text.replace(word, parameters)
    return text
