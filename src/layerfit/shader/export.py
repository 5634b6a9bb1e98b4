"""A material as a shader: the traced functions in the template of `shaders/`, with the fitted values as constants or uniforms."""

import dataclasses
import re
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
from ..errors import InputError
from ..forms import weathering
from ..forms.precise import BAKED, Precise, held
from ..optics.lazanyi import fit_lazanyi
from ..preset import left_out, model_name
from ..stack import PREPARED, Stack, at, evaluate, prepared
from .printer import PREFIX, Printer, named_leaves

SIZES = {"uv": ("vec2", (2,)), "distance": ("float", ()), "sky": ("float", ())}
"""What a material may read of a place: its type in the shader and in JAX."""

COSINES = "cosines"

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

    @property
    def asks(self) -> frozenset[str]:
        """What the BRDF asks for beside a normal and two directions: a tangent, texture coordinates, a distance, a share of the sky."""
        return asks(self.stack)

    def text(self, target: str = "glsl330", file: str = "material.frag") -> str:
        """The whole fragment shader: a template of `shaders/` with this material in its slots."""
        slots = {
            "header": HEADERS[target],
            "about": self._about(),
            "material": self.functions,
            "lights": template("lights.glsl", self.asks),
            "output": template("output.glsl", self.asks),
        }
        text = template(file, self.asks)
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


def asks(stack: Stack) -> frozenset[str]:
    """What the templates are to bring for a material, and whether it asks for cosines alone in place of two directions."""
    layers = (*stack.layers, stack.base)
    tangent = {TANGENT} if any(needs_tangent(layer) for layer in layers) else set()
    cosines = {COSINES} if getattr(stack.base, "by_cosines", False) and not stack.layers else set()
    return frozenset(stack.reads) | tangent | cosines


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


def print_material(stack: Stack, name: str, uniforms: bool | Literal["prepared"] = False) -> Shader:
    """Print a material: its values as constants, or as uniforms `u_LAYER_FIELD` from which the shader computes its constants.

    `uniforms="prepared"`: the constants themselves are uniforms, whose names they keep. The shader then costs what one with constants
    does, and its host computes them: `Shader.uniforms` has those of this material, `program.program` what gives those of another.
    """
    stack = stack.astype(jnp.float32)
    printer = Printer(CHUNKS)
    w = jnp.array([0.0, 0.0, 1.0], jnp.float32)
    inputs = [(w, "wi"), (w, "wo"), *((jnp.zeros(SIZES[name][1], jnp.float32), name) for name in stack.reads)]
    cosines = COSINES in asks(stack)
    if cosines:
        inputs = [(jnp.ones((), jnp.float32), name) for name in ("NoL", "NoV", "lean2")]

    def shade(prepared: Any, wi: Any, wo: Any, *place: Any) -> Any:
        if cosines:
            (lean2,) = place
            return jnp.broadcast_to(where((wi > 0.0) & (wo > 0.0), prepared.shade(wi, wo, lean2), 0.0), (3,))
        there = Place(**dict(zip(stack.reads, place, strict=True))) if place else None
        return jnp.broadcast_to(evaluate(stack.form, at(prepared, there), wi, wo), (3,))

    if uniforms is True:
        _check_live(stack)
        rows, leaves = _uniforms(stack), jax.tree.leaves(stack)
        given = [row for row in rows if row]
        declarations = "".join(f"uniform {kind} {name};  // {note}\n" for _, name, kind, note in given)
        values = {name: np.asarray(leaf) for leaf, name, _, _ in given}
        structure = jax.tree.structure(stack)
        constants = _held(stack)

        def local(*args: Any) -> Any:
            free = iter(args[: -len(inputs)])
            values = [next(free) if row else leaf for row, leaf in zip(rows, leaves, strict=True)]
            live: Stack = jax.tree.unflatten(structure, values)
            return shade(dataclasses.replace(live.prepare(), **constants), *args[-len(inputs) :])

        outside = [(leaf, name) for leaf, name, _, _ in given]
    else:
        with jax.enable_x64(False):
            made = jax.tree.map(np.asarray, prepared(stack))
        outside = [(part, f"{PREFIX}{name}") for name, part in _parts(stack, made)]
        if uniforms:
            declarations = "".join(printer.uniform(name, part) for part, name in outside)
            values = {name: leaf for part, root in outside for name, leaf in named_leaves(root, part)}
        else:
            declarations = "\n".join(printer.constant(name, part) for part, name in outside)
            values = {}
        structure = jax.tree.structure(made)

        def local(*args: Any) -> Any:
            live = jax.tree.unflatten(structure, jax.tree.leaves(args[: -len(inputs)]))
            return shade(live, *args[-len(inputs) :])

    local.__doc__ = "BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine."
    printer.function(local, f"{PREFIX}{'shade' if cosines else 'evaluate'}", outside, inputs)
    shader = Shader(name, stack, "", values)
    frame = template("cosines.glsl" if cosines else "brdf.glsl", shader.asks)
    functions = "\n".join(part for part in (printer.structs_text(), declarations, printer.functions_text(), frame) if part)
    return dataclasses.replace(shader, functions=functions)


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


def _parts(stack: Stack, prepared: Any) -> list[tuple[str, Any]]:
    """The constants of a prepared material, by the names of the layers that they belong to, in the order of its leaves."""
    if COSINES in asks(stack):
        fields = [
            (field.name, getattr(prepared, field.name))
            for field in dataclasses.fields(prepared)
            if not field.metadata.get("static")
        ]
        return [(f"{stack.base.name}_{name}", value) for name, value in fields if value is not None]
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


def _uniforms(stack: Stack) -> list[tuple[Any, str, str, str] | None]:
    """Every number of the material as (value, uniform, type, comment), in the order of its leaves; None for what is baked."""
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
                rows.append((value, f"u_{layer.name}_{field}", "vec3" if value.ndim else "float", note))
    return rows


@cache
def template(file: str, asks: frozenset[str]) -> str:
    """A file of `shaders/` with its conditional parts chosen, and what the material asks for in its lists of parameters."""
    text = (shaders() / file).read_text()
    names = [name for name in SIZES if name in asks]
    lists = {
        "@FRAME@": f"vec3 n, {'vec3 t, ' if TANGENT in asks else ''}vec3 v, vec3 l@PLACE@",
        "@PLACE@": "".join(f", {SIZES[name][0]} {name}" for name in names),
        "@THERE@": "".join(f", {name}" for name in names),
    }

    def choose(match: re.Match[str]) -> str:
        yes, _, no = match[2].partition("//@ else\n")
        return yes if match[1] in asks else no

    text = re.sub(r"^//@ if (\w+)\n(.*?)^//@ end\n", choose, text, flags=re.M | re.S)
    for word, parameters in lists.items():
        text = text.replace(word, parameters)
    return text
