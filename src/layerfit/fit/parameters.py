"""Which fields of a material are fitted, in which coordinates, between which bounds."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._fields import Param, params
from ..capture.load import AnyView
from ..capture.scene import WHOLE
from ..documents import is_number, nearest
from ..errors import InputError
from ..stack import Stack
from .nuisances import LIGHTS, THICKNESS, check, of_the_scene, told


@dataclasses.dataclass(frozen=True)
class Free:
    """One fitted field of a layer, or of the scene: a number, or one a channel."""

    name: str
    layer: int | None
    """Place in (*layers, base); None for what is of the lights."""
    field: str
    spec: Param
    slots: tuple[int, ...]
    """Places in the vector that the solver steps in: one, or three; none for what is held in a reference that others are fitted in."""
    reference: int | None = None
    """Whose it is alone; None for what all references share."""
    told: float | tuple[float, ...] = ()
    """Where it starts, where that is not the material's."""

    @property
    def of_scene(self) -> bool:
        """Whether it is of the scene, not of the material."""
        return self.layer is None or self.field == THICKNESS

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

    def start(self, stack: Stack) -> Any:
        """Its value before the fit."""
        if self.layer is None or self.told != ():
            return self.told
        return getattr((*stack.layers, stack.base)[self.layer], self.field)


@dataclasses.dataclass(frozen=True)
class Parametrisation:
    """The free fields of a material and its scene, as one vector: hashable, so that a compiled fit is found again.

    Fields that each reference has for itself are entries of their own, `coat.alpha@0` and so on. `part` is the parametrisation of one reference:
    the same structure for all of them, so that they share what is compiled.
    """

    free: tuple[Free, ...]
    held: tuple[Free, ...] = ()
    """Of single references, and not fitted in them: at the start that is told."""

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
        for f in self.free:
            u[list(f.slots)] = f.to_steps(f.start(stack))
        return np.clip(u, *self.bounds())

    def fields(self, u: Any) -> list[Any]:
        """The vector as one scalar or (3,) array a field, still in the coordinate of the fit."""
        return [u[f.slots[0]] if len(f.slots) == 1 else u[f.slots[0] : f.slots[-1] + 1] for f in self.free]

    def put(self, stack: Stack, fields: Sequence[Any], xp: Any = jnp) -> Stack:
        """The material with its free fields replaced; `fields` as `fields` gives them. Of what is of one reference, that of the first."""
        layers = [*stack.layers, stack.base]
        for f, u in zip(self.free, fields, strict=True):
            if f.layer is not None and f.field != THICKNESS and not f.reference:
                layers[f.layer] = dataclasses.replace(layers[f.layer], **{f.field: f.from_steps(u, xp)})
        return stack.with_parts(layers)

    def light(self, fields: Sequence[Any], xp: Any = jnp) -> dict[str, Any]:
        """How bright the lights are, as `capture.scene.Lit`: empty where they are known."""
        found = [(f, u) for f, u in zip(self.free, fields, strict=True) if f.layer is None]
        return {f.field: xp.broadcast_to(f.from_steps(u, xp), (3,)) for f, u in found}

    def thickness(self, fields: Sequence[Any], scale: Any, layers: int, xp: Any = jnp) -> Any:
        """Thickness of each layer over that of the material, where it is fitted, else `scale`: (layers,) or None."""
        found = {f.layer: f.from_steps(u, xp) for f, u in zip(self.free, fields, strict=True) if f.field == THICKNESS}
        if not found:
            return scale
        return [found[k] if k in found else 1.0 if scale is None else scale[k] for k in range(layers)]

    @functools.cached_property
    def apart(self) -> bool:
        """Whether references have something for themselves."""
        return any(f.reference is not None for f in (*self.free, *self.held))

    @functools.cached_property
    def parts(self) -> tuple[tuple[Free, ...], ...]:
        """The fields of each reference, in one order; of one for all where they share everything."""
        if not self.apart:
            return (self.free,)
        every = sorted((*self.free, *self.held), key=lambda f: f.name)
        count = 1 + max(f.reference or 0 for f in every)
        return tuple(tuple(f for f in every if f.reference in (None, k)) for k in range(count))

    def of(self, reference: int) -> tuple[Free, ...]:
        """The fields of one reference."""
        return self.parts[reference if self.apart else 0]

    @functools.cached_property
    def part(self) -> "Parametrisation":
        """That of one reference alone."""
        if not self.apart:
            return self
        chosen, slot = [], 0
        for f in self.parts[0]:
            width = 3 if f.spec.colour else 1
            name = f.name.partition(OF)[0]
            chosen.append(dataclasses.replace(f, name=name, slots=tuple(range(slot, slot + width)), reference=None, told=()))
            slot += width
        return Parametrisation(tuple(chosen))

    @property
    def slots(self) -> tuple[tuple[tuple[int, ...], ...], ...]:
        """Places in the vector of the fields of each reference."""
        return tuple(tuple(f.slots for f in fields) for fields in self.parts)

    def taken(self, u: Any, reference: int, xp: Any = jnp) -> Any:
        """The vector of one reference."""
        if not self.apart:
            return u
        rows = [
            u[np.array(f.slots)] if f.slots else np.broadcast_to(f.to_steps(f.told), 3 if f.spec.colour else 1)
            for f in self.of(reference)
        ]
        return xp.concatenate(rows).astype(u.dtype)

    def without(self, names: Sequence[str], u: np.ndarray) -> "Parametrisation":
        """The same with some fields held: what is of one reference at its place in `u`."""
        kept, held, slot = [], list(self.held), 0
        for f, value in zip(self.free, self.fields(u), strict=True):
            if f.name not in names:
                kept.append(dataclasses.replace(f, slots=tuple(range(slot, slot + len(f.slots)))))
                slot += len(f.slots)
            elif f.reference is not None:
                held.append(dataclasses.replace(f, slots=(), told=tuple(np.atleast_1d(f.from_steps(value, np)).tolist())))
        return Parametrisation(tuple(kept), tuple(held))

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


LIGHT = f"{LIGHTS}.{WHOLE}"
"""All lights of a scene over what it says of them, by channel: a nuisance, fitted where it is named."""

OF = "@"
"""Between the name of a parameter and the number of the reference that it is of, from 0."""


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


def parametrise(
    stack: Stack,
    free: Sequence[str] | None,
    fixed: Sequence[str],
    where: str,
    views: Sequence[AnyView] = (),
    also: Sequence[str] = (),
    each: Sequence[str] = (),
) -> tuple[Stack, Parametrisation]:
    """Choose the free fields, and `also` some others; those in `each` are fitted for each of the `views` apart.

    Colours that a fit frees are widened to three channels, so the material is returned too.
    """
    known = {**known_parameters(stack), **of_the_scene(stack, views)}
    names = (*(free_by_default(stack) if free is None else free), *also, *each)
    for key, asked in (("free", free or ()), ("also", also), ("each", each)):
        for name in asked:
            if name not in known:
                raise InputError(
                    f"{where}.{key}: unknown parameter {name!r}{nearest(name, known)}. "
                    f"This material has {', '.join(known_parameters(stack))}; of the scene there is {', '.join(of_the_scene(stack, views))}"
                )
    if both := {*(free or ()), *also, *each} & set(fixed):
        raise InputError(f"{where}: {', '.join(sorted(both))} cannot be both free and fixed")
    names = tuple(name for name in known if name in names and name not in fixed)
    if not names:
        raise InputError(f"{where}.free: nothing is left to fit; this material has {', '.join(known_parameters(stack))}")
    check(names, views, where)
    chosen, held, slot = [], [], 0
    layers = [*stack.layers, stack.base]
    for name in names:
        k, field, spec = known[name]
        if k is not None and spec.colour:
            value = np.broadcast_to(np.asarray(getattr(layers[k], field), float), 3)
            layers[k] = dataclasses.replace(layers[k], **{field: value})
        width = 3 if spec.colour else 1
        apart = (name in each or field == THICKNESS) and len(views) > 1
        for reference in range(len(views)) if apart else [None]:
            at = told(k, field, spec, stack, views, reference or 0) if k is None or field == THICKNESS else ()
            f = Free(name if reference is None else f"{name}{OF}{reference}", k, field, spec, (), reference, at)
            if field == THICKNESS and reference == 0:  # ratios are all that images know
                held.append(f)
                continue
            chosen.append(dataclasses.replace(f, slots=tuple(range(slot, slot + width))))
            slot += width
    return stack.with_parts(layers), Parametrisation(tuple(chosen), tuple(held))
