"""The printed shader of one structure, at corners of its ranges and on the pairs of directions that parity is checked with."""

import dataclasses
from typing import Any

import jax
import numpy as np

from ..errors import InputError
from ..render import predict
from ..shader.export import Shader, print_material
from ..shader.verify import FLOOR, compare, random_pairs, random_places, shade_samples
from ..stack import Stack
from .grid import Grid

PAIRS = 2048
MATERIALS = 6
"""Corners that are printed where numbers are constants, and drawn where they are uniforms."""


def printed(stack: Stack, tried: Grid, seed: int = 0) -> dict[str, Any]:
    """Shader against JAX: the defaults, the two ends of all ranges, and corners between."""
    rows = [tried.default, 0, 1, *range(2, len(tried.values))][:MATERIALS]
    shared = _with_uniforms(stack)
    wi, wo = random_pairs(PAIRS, seed)
    samples = wi[:, None], wo, np.ones_like(wi)[:, None], random_places(PAIRS, seed)
    errors, lost = [], 0
    for row in rows:
        material = tried.material(stack, row)
        shader = print_material(material, "stability") if shared is None else _set(shared, material)
        values, model = shade_samples(shader, *samples), predict(material, *samples)
        lost += int(np.sum(~np.isfinite(values)))
        errors.append(compare(values, model, FLOOR / np.pi))
    return {
        "materials": len(rows),
        "uniforms": shared is not None,
        "values": sum(e.count for e in errors),
        "not_finite": lost,
        "max_rel": max(e.max_rel for e in errors),
        "p999_rel": max(e.p999_rel for e in errors),
    }


def _with_uniforms(stack: Stack) -> Shader | None:
    """One shader for all materials, where its numbers can all be set."""
    try:
        shader = print_material(stack, "stability", uniforms=True)
    except InputError:  # a fitted approximation or a film, which a shader cannot prepare
        return None
    return shader if len(shader.uniforms) == len(jax.tree.leaves(stack)) else None


def _set(shader: Shader, material: Stack) -> Shader:
    leaves = (np.asarray(leaf) for leaf in jax.tree.leaves(material))
    return dataclasses.replace(shader, stack=material, uniforms=dict(zip(shader.uniforms, leaves, strict=True)))
