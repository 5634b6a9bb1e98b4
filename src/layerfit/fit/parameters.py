"""Which fields of a material are fitted, in which coordinates, between which bounds."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._fields import Param, params
from ..documents import is_number, nearest
from ..errors import InputError
from ..stack import Stack


@dataclasses.dataclass(frozen=True)
class Free:
    """One fitted field of a layer: a number, or one a channel."""

    name: str
    layer: int | None
    """Place in (*layers, base); None for what is of the lights."""
    field: str
    spec: Param
    slots: tuple[int, ...]
    """Places in the vector that the solver steps in: one, or three."""

    def to_steps(self, value: Any) -> np.ndarray:
        """Values in the coordinate of the fit."""
        value = np.asarray(value, float)
        if self.spec.scale == "log":
            return np.log(np.maximum(value, self.spec.lower))
        return np.log1p(value / self.spec.soft) if self.spec.scale == "softlog" else value

    def from_steps(self, u: Any, xp: Any = jnp) -> Any:
        """The inverse of `to_steps`, traced."""
        if self.spec.scale == "log":
            return xp.exp(u)
        return self.spec.soft * xp.expm1(u) if self.spec.scale == "softlog" else u

    def slope(self, u: np.ndarray) -> np.ndarray:
        """d value / d u, for the sigmas."""
        if self.spec.scale == "log":
            return np.exp(u)
        return self.spec.soft * np.exp(u) if self.spec.scale == "softlog" else np.ones_like(u)


@dataclasses.dataclass(frozen=True)
class Parametrisation:
    """The free fields of a material, as one vector: hashable, so that a compiled fit is found again."""

    free: tuple[Free, ...]

    @property
    def size(self) -> int:
        return sum(len(f.slots) for f in self.free)

    @property
    def names(self) -> list[str]:
        """Name of every slot: `coat.tau[1]` for the second channel of a colour."""
        return [f.name if len(f.slots) == 1 else f"{f.name}[{k}]" for f in self.free for k in range(len(f.slots))]

    def pack(self, stack: Stack) -> np.ndarray:
        """The vector of a material, inside the bounds."""
        u = np.empty(self.size)
        layers = (*stack.layers, stack.base)
        for f in self.free:
            u[list(f.slots)] = f.to_steps(1.0 if f.layer is None else getattr(layers[f.layer], f.field))
        return np.clip(u, *self.bounds())

    def fields(self, u: Any) -> list[Any]:
        """The vector as one scalar or (3,) array a field, still in the coordinate of the fit."""
        return [u[f.slots[0]] if len(f.slots) == 1 else u[f.slots[0] : f.slots[-1] + 1] for f in self.free]

    def put(self, stack: Stack, fields: Sequence[Any], xp: Any = jnp) -> Stack:
        """The material with its free fields replaced; `fields` as `fields` gives them."""
        layers = [*stack.layers, stack.base]
        for f, u in zip(self.free, fields, strict=True):
            if f.layer is None:
                continue
            layers[f.layer] = dataclasses.replace(layers[f.layer], **{f.field: f.from_steps(u, xp)})
        return stack.with_parts(layers)

    def light(self, fields: Sequence[Any], xp: Any = jnp) -> Any:
        """What the lights of the scene are multiplied by, one a channel; None where they are known."""
        found = (f.from_steps(u, xp) for f, u in zip(self.free, fields, strict=True) if f.layer is None)
        return next(found, None)

    def values(self, u: np.ndarray) -> dict[str, Any]:
        """Fitted values by name."""
        return {f.name: f.from_steps(v, np) for f, v in zip(self.free, self.fields(np.asarray(u)), strict=True)}

    def slopes(self, u: np.ndarray) -> np.ndarray:
        """d value / d u of every slot."""
        return np.concatenate([np.atleast_1d(f.slope(v)) for f, v in zip(self.free, self.fields(np.asarray(u)), strict=True)])

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the vector."""
        lower = [float(f.to_steps(f.spec.lower)) for f in self.free for _ in f.slots]
        upper = [float(f.to_steps(f.spec.upper)) for f in self.free for _ in f.slots]
        return np.array(lower), np.array(upper)


LIGHT = "light.scale"
"""All lights of a scene over what it says of them, by channel: a nuisance, fitted where it is named."""

_LIGHT = Param(1.0, 0.01, 100.0, "log", "all lights over what the scene says of them", colour=True, fitted=False)


def known_parameters(stack: Stack) -> dict[str, tuple[int, str, Param]]:
    """Every number of a material by its name, such as `coat.alpha`."""
    return {
        f"{layer.name}.{field}": (k, field, spec)
        for k, layer in enumerate((*stack.layers, stack.base))
        for field, spec in params(layer)
        if getattr(layer, field) is not None
    }


def free_by_default(stack: Stack) -> tuple[str, ...]:
    """What a fit frees when it is not told: what one image of the material can tell, but for the indices of metals."""
    return tuple(name for name, (_, _, spec) in known_parameters(stack).items() if spec.fitted)


def with_fixed(stack: Stack, fixed: Mapping[str, Any], where: str) -> Stack:
    """The material with some parameters set. Raises `InputError` for a name that it does not have or a value out of range."""
    known = known_parameters(stack)
    layers = [*stack.layers, stack.base]
    for name, value in fixed.items():
        if name not in known:
            raise InputError(f"{where}: unknown parameter {name!r}{nearest(name, known)}. This material has {', '.join(known)}")
        k, field, spec = known[name]
        array = np.asarray(value, float) if _is_number(value, spec) else None
        if array is None or np.any(array < spec.lower) or np.any(array > spec.upper):
            raise InputError(f"{where}: {name} = {value!r} should be a number from {spec.lower:g} to {spec.upper:g}")
        layers[k] = dataclasses.replace(layers[k], **{field: array})
    return stack.with_parts(layers)


def _is_number(value: Any, spec: Param) -> bool:
    values = value if isinstance(value, (list, tuple)) and spec.colour and len(value) == 3 else [value]
    return all(is_number(v) for v in values)


def parametrise(stack: Stack, free: Sequence[str] | None, fixed: Sequence[str], where: str) -> tuple[Stack, Parametrisation]:
    """Choose the free fields. Colours that a fit frees are widened to three channels, so the material is returned too."""
    known = {**known_parameters(stack), LIGHT: (None, "scale", _LIGHT)}
    names = free_by_default(stack) if free is None else tuple(free)
    for name in names:
        if name not in known:
            raise InputError(
                f"{where}.free: unknown parameter {name!r}{nearest(name, known)}. "
                f"This material has {', '.join(known_parameters(stack))}; of the scene there is {LIGHT}"
            )
    if free is not None and (both := set(free) & set(fixed)):
        raise InputError(f"{where}: {', '.join(sorted(both))} cannot be both free and fixed")
    names = tuple(name for name in known if name in names and name not in fixed)
    if not names:
        raise InputError(f"{where}.free: nothing is left to fit; this material has {', '.join(known_parameters(stack))}")
    chosen, slot = [], 0
    layers = [*stack.layers, stack.base]
    for name in names:
        k, field, spec = known[name]
        if k is not None and spec.colour:
            value = np.broadcast_to(np.asarray(getattr(layers[k], field), float), 3)
            layers[k] = dataclasses.replace(layers[k], **{field: value})
        width = 3 if spec.colour else 1
        chosen.append(Free(name, k, field, spec, tuple(range(slot, slot + width))))
        slot += width
    return stack.with_parts(layers), Parametrisation(tuple(chosen))
