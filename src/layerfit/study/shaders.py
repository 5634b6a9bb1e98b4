"""What each variant of a material costs as a shader, and how far it is from the material itself."""

import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.load import AnyView
from ..capture.measured.sphere import bare_sphere
from ..capture.samples import Samples
from ..render import brdf_values, predict
from ..shader.cost import Timing, instructions, phong
from ..shader.export import Shader, print_material
from ..shader.verify import FLOOR, random_pairs
from ..stack import Stack
from .errors import relative, seen

PAIRS = 16384
SIDE = 128
"""Pixels across the sphere on which variants are seen, where there is no scene."""
PIXELS = 20_000
"""Of a scene, at most."""


def shaders_of(ways: Mapping[str, Stack]) -> dict[str, Shader]:
    """The printed shader of every variant."""
    return {name: print_material(way, "m") for name, way in ways.items()}


def pixels_of(stack: Stack, views: Sequence[AnyView]) -> list[Samples]:
    """Pixels on which variants are seen: of the references, or of a sphere under one distant light."""
    views = views or [bare_sphere(Path("sphere"), SIDE)]
    some = np.random.default_rng(0)
    chosen = [some.permutation(len(view.index))[: PIXELS // len(views)] for view in views]
    for view in views:
        view.check(stack)
    return [view.samples(which) for view, which in zip(views, chosen, strict=True)]


def drawn(stack: Stack, pixels: Sequence[Samples]) -> np.ndarray:
    """Linear pixels (n, 3) of a material."""
    return np.concatenate([predict(stack, *samples.arrays) for samples in pixels])


def against_exact(ways: Mapping[str, Stack], pixels: Sequence[Samples]) -> dict[str, dict[str, float]]:
    """Errors of every variant against the first: relative over random and extreme pairs of directions, delta E 2000 over the pixels."""
    pairs = random_pairs(PAIRS, 0)
    values = {name: brdf_values(way, *pairs) for name, way in ways.items()}
    images = {name: drawn(way, pixels) for name, way in ways.items()}
    exact = next(iter(ways))
    return {
        name: relative(values[name], values[exact], FLOOR / np.pi) | {"delta_e": seen(images[name], images[exact])}
        for name in ways
    }


def counted(shaders: Mapping[str, Shader]) -> dict[str, dict[str, int]]:
    """Instructions under one light and for each further one, and bytes of tables."""
    counts = {name: [instructions(shader, lights).total for lights in (1, 2)] for name, shader in shaders.items()}
    return {
        name: {"instructions": one, "instructions_per_light": two - one, "table_bytes": table_bytes(shaders[name])}
        for name, (one, two) in counts.items()
    }


def of_phong() -> dict[str, int]:
    """The same of the shader that all are measured by."""
    return counted({"phong": phong()})["phong"]


def table_bytes(shader: Shader) -> int:
    """Of the tables that stand in a shader."""
    return getattr(shader.stack.base, "table_bytes", 0)


def timed(timing: Timing) -> dict[str, Any]:
    """A timing for a document."""
    low, high = timing.spread
    digits = lambda x: float(f"{x:.4g}")  # noqa: E731
    return {
        "x_phong": digits(timing.median),
        "x_phong_spread": [digits(low), digits(high)],
        "milliseconds": digits(timing.milliseconds),
    }


def machine() -> str:
    """The processor that this runs on, by name."""
    table = Path("/proc/cpuinfo")
    names = (
        [line.partition(":")[2].strip() for line in table.read_text().splitlines() if line.startswith("model name")]
        if table.exists()
        else []
    )
    return f"{names[0]}, {len(names)} cores" if names else platform.processor() or platform.machine()
