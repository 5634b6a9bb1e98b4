"""What a field of a layer says about itself: range, unit, default, scale and meaning, written once.

Fit bounds, preset keys, shader comments and the manual's tables are derived from these fields.
"""

import dataclasses
import functools
from collections.abc import Iterator
from typing import Any, Literal, TypeVar, dataclass_transform

import numpy as np

from ._chunk import static, struct

T = TypeVar("T")
Scale = Literal["linear", "log", "softlog"]


@dataclasses.dataclass(frozen=True)
class Param:
    """A number (or one a colour channel) of a layer.

    `scale` is the coordinate in which the fit steps: the value itself, its logarithm, or log(1 + value / `soft`), which is linear
    up to `soft` and reaches 0. `fitted` says whether a fit frees it where the scene file does not say. An `optional` field
    is absent (None) where its layer does without it.
    """

    default: float | None
    lower: float
    upper: float
    scale: Scale
    doc: str
    unit: str = "1"
    colour: bool = False
    fitted: bool = True
    soft: float = 1.0

    @property
    def optional(self) -> bool:
        return self.default is None


def param(
    *,
    default: float | None,
    lower: float,
    upper: float,
    scale: Scale,
    doc: str,
    unit: str = "1",
    colour: bool = False,
    fitted: bool = True,
    soft: float = 1.0,
) -> Any:
    """Declare a numeric field of a layer; see `Param`."""
    spec = Param(default, lower, upper, scale, doc, unit, colour, fitted, soft)
    return dataclasses.field(default=default, metadata={"param": spec})


def choice(*, default: str, others: tuple[str, ...], doc: str) -> Any:
    """Declare a field of a layer that selects one of several forms."""
    return static(default=default, choices=(default, *others), doc=doc)


def derived(comment: str) -> Any:
    """Declare a number of a layer that is not given but computed, once a material, from those that are: None until then."""
    return dataclasses.field(default=None, metadata={"derived": True, "comment": comment})


@functools.cache
def given(cls: Any) -> tuple[str, ...]:
    """Names of the fields that a user gives."""
    return tuple(field.name for field in dataclasses.fields(cls) if not field.metadata.get("derived"))


def params(layer: Any) -> Iterator[tuple[str, Param]]:
    """The declared numeric fields of a layer or its class, absent ones included, in order."""
    for field in dataclasses.fields(layer):
        if "param" in field.metadata:
            yield field.name, field.metadata["param"]


@dataclass_transform(frozen_default=True, field_specifiers=(param, choice, derived, static))
def layer(cls: type[T]) -> type[T]:
    """A struct that a user builds: a list of three numbers is a colour."""

    def __post_init__(self: Any) -> None:
        for name, _ in params(self):
            if isinstance(getattr(self, name), (list, tuple)):
                object.__setattr__(self, name, np.asarray(getattr(self, name), float))

    type.__setattr__(cls, "__post_init__", __post_init__)
    return struct(cls)
