"""The numbers of a material as its shader has them: constants that are prepared once, uniforms, and what may come from textures."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._fields import params
from ..documents import nearest
from ..errors import InputError
from ..forms.precise import BAKED, Precise, held
from ..stack import PREPARED, Stack, prepared
from .glsl import PREFIX
from .structs import named_leaves

TILT = "tilt"
"""What is mapped beside parameters: the slopes of the normal."""


class Number(NamedTuple):
    """A number of a material from which its shader can compute."""

    value: Any
    name: str
    """In the shader, without its prefix: `coat_alpha`."""
    kind: str
    """Its type."""
    note: str


def numbers(stack: Stack) -> list[Number | None]:
    """Every number of a material, in the order of its leaves; None for what is baked."""
    rows: list[Number | None] = []
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
                rows.append(Number(value, f"{layer.name}_{field}", "vec3" if np.ndim(value) else "float", note))
    return rows


def mapped(stack: Stack, maps: Sequence[str]) -> list[Number]:
    """The parameters of layers that come from maps, in the order of the layers."""
    asked = {_flat(name) for name in maps}
    return [row for row in numbers(stack) if row and row.name in asked]


def _flat(name: str) -> str:
    """A parameter's name as a shader can have it: `coat_thickness_um`."""
    return name.replace(".", "_")


def check_maps(stack: Stack, maps: Sequence[str], uniforms: Any) -> None:
    """Raise `InputError` for maps that a shader of the material cannot have."""
    layers = (*stack.layers, stack.base)
    known = [f"{layer.name}.{field}" for layer in layers for field, _ in params(layer) if getattr(layer, field) is not None]
    known.append(TILT)
    for name in maps:
        if name not in known:
            raise InputError(
                f"there is no parameter {name!r} to map{nearest(name, known)}. This material has {', '.join(known)}"
            )
        if name != TILT and not mapped(stack, [name]):
            raise InputError(
                f"{name} cannot come from a texture: the precise form looks up what follows from it once a material, which a shader cannot. "
                'Give the material model = "corrected", whose shader computes it at every place'
            )
    if maps and uniforms:
        raise InputError("a shader with maps has its other values as constants: leave uniforms out")
    if maps and of_curves(stack):
        raise InputError(
            "a compact material is made of curves, in which no parameter is left to map: print the material itself"
        )


def check_live(stack: Stack) -> None:
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


def uniforms_of(stack: Stack) -> dict[str, np.ndarray]:
    """Values of the uniforms of a shader that was printed with `uniforms="prepared"`, for a material of the same structure."""
    return named(constants(stack.astype(jnp.float32))[1])


def constants(stack: Stack) -> tuple[Any, list[tuple[Any, str]]]:
    """A prepared material, and its parts with their names in the shader."""
    with jax.enable_x64(False):
        made = jax.tree.map(np.asarray, prepared(stack))
    return made, [(part, f"{PREFIX}{name}") for name, part in _parts(stack, made)]


def named(parts: Sequence[tuple[Any, str]]) -> dict[str, np.ndarray]:
    """The numbers of constants by the expressions that reach them."""
    return {name: leaf for part, root in parts for name, leaf in named_leaves(root, part)}


def held_constants(stack: Stack) -> dict[str, Any]:
    """Parts of the prepared material that are constants also where its other numbers are uniforms."""
    if not isinstance(stack.form, Precise) or not stack.layers:
        return {}
    with jax.enable_x64(False):
        return jax.tree.map(np.asarray, held(prepared(stack)))


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
    if of_curves(stack):
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
                if item is not None:
                    own = isinstance(item, type(layer))
                    parts.append((layer.name if own else f"{layer.name}_{type(item).__name__.lower()}", item))
        elif field.name == "base" or isinstance(value, type(stack.base)):
            parts.append((stack.base.name if field.name == "base" else f"{stack.base.name}_{field.name}", value))
        elif dataclasses.is_dataclass(value):
            coat = stack.layers[0].name
            parts.append((coat if isinstance(value, type(stack.layers[0])) else f"{coat}_{field.name}", value))
        elif value is not None:
            parts.append((f"{stack.base.name}_{field.name}", value))
    return parts


def of_curves(stack: Stack) -> bool:
    """Whether it is a compact material, made of polynomials and a few numbers."""
    return not stack.layers and getattr(stack.base, "of_curves", False)
