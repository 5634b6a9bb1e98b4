"""What a page needs to draw a material live: its shader, the program that computes the shader's constants, and its parameters."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..fit.parameters import known_parameters
from ..preset import preset_of
from ..shader.export import print_material
from ..shader.program import program
from ..stack import Stack


def live(stack: Stack, name: str, fitted: Mapping[str, Mapping[str, Any]] | None = None) -> dict[str, Any]:
    """The document of a live view; `fitted` are the rows of a fit's parameters, of which it takes the sigmas.

    `fragment` is the exported shader with its constants as uniforms, `values` these constants as [name, numbers]. `program` computes
    them from `parameters`, whose order is that of its inputs; each has its range, unit, scale and meaning.
    """
    stack = stack.astype(jnp.float32)
    shader = print_material(stack, name, "prepared")
    return {
        "name": name,
        "fragment": shader.text("essl300"),
        "values": [[uniform, _numbers(value)] for uniform, value in shader.uniforms.items()],
        "program": program(Stack.prepare, stack),
        "parameters": _parameters(stack, fitted or {}),
        "preset": preset_of(stack, name),
    }


def _parameters(stack: Stack, fitted: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Every number of the material, in the order of its leaves."""
    rows, layers = [], (*stack.layers, stack.base)
    for name, (k, field, spec) in known_parameters(stack).items():
        row = {key: getattr(spec, key) for key in ("doc", "unit", "lower", "upper", "scale", "soft")}
        row |= {"name": name, "value": _numbers(getattr(layers[k], field)), "fitted": name in fitted}
        sigma = fitted.get(name, {}).get("sigma")
        rows.append(row | ({} if sigma is None else {"sigma": sigma if isinstance(sigma, list) else [sigma]}))
    assert len(rows) == len(jax.tree.leaves(stack)), "a number of a layer is not one of its parameters"
    return rows


def _numbers(value: Any) -> list[float]:
    return [float(str(v)) for v in np.asarray(value, np.float32).ravel()]
