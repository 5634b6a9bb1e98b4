"""A material where references were seen: from JAX and from its shader, as pictures, and what sampling the lights costs in them."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .capture.exr import write_exr
from .capture.load import AnyView
from .capture.measured.sphere import sphere_of
from .capture.measured.view import MeasuredView
from .capture.samples import Samples, View
from .documents import check_directory, write_bytes
from .errors import InputError
from .fit.metrics import exposure, image_error
from .fit.residuals import scaled
from .fit.result import FitResult
from .render import predict
from .report import pictures
from .report.comparison import Pair
from .shader.export import Shader, print_material
from .shader.verify import FLOOR, Parity, check_image, compare, shade_samples, together
from .stack import Stack
from .tabulate import Truth

PICTURES = (".exr", ".png")
"""What a render is written as: linear, and for looking at."""

PICTURE_SAMPLES = 40_000_000
"""Light samples in one picture at most, where light is a quadrature."""

PORTION = 500_000
"""Light samples that are drawn at a time: what stands for them in memory is some 150 bytes each."""

QUADRATURE_PIXELS = 128
"""Pixels on which the error of a quadrature is measured: enough to say how large it is."""


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A material where a reference was seen, from JAX and from its shader."""

    compared: View
    """The pixels on which errors are taken."""
    drawn: View
    """All that can be drawn, grazing ones too."""
    model: np.ndarray
    shader: np.ndarray
    parity: Parity

    def row(self) -> list[pictures.Panel]:
        """Reference, fit (JAX), shader (OpenGL), and difference of the shader from the reference."""
        covered = self.compared.covered
        target = self.compared.image(self.compared.target)
        white = exposure(target, covered)
        image = self.drawn.image(self.shader)
        return [
            pictures.shown(f"reference {self.compared.reference.path.stem}", self.compared.picture, white),
            pictures.shown("fit (JAX)", self.drawn.image(self.model), white),
            pictures.shown("shader (OpenGL)", image, white),
            pictures.difference(image, target, white, covered),
        ]

    def pair(self) -> Pair:
        """Reference and shader, for a page that compares them."""
        covered, picture = self.compared.covered, self.compared.picture
        name = self.compared.reference.path.stem
        return Pair(
            name, picture, self.drawn.image(self.shader), covered, exposure(self.compared.image(self.compared.target), covered)
        )

    def error(self) -> dict[str, float]:
        """Image errors of the shader against the reference."""
        target = self.compared.image(self.compared.target)
        return image_error(self.drawn.image(self.shader), target, self.compared.covered)


def draw_all(
    compared: Sequence[AnyView], drawn: Sequence[AnyView], shader: Shader, stacks: Sequence[Stack] | None = None
) -> list[Drawing]:
    """Draw a material where references were seen, by JAX and by its shader in OpenGL. `stacks` is the material as it is in each; left out, as thick
    as the scene says."""
    drawings = []
    stacks = [scaled(shader.stack, view.scales(shader.stack)) for view in compared] if stacks is None else stacks
    for view, whole, stack in zip(compared, drawn, stacks, strict=True):
        view.check(stack)
        thick = shader if _same(stack, shader.stack) else print_material(stack, shader.name)
        if isinstance(view, View) and isinstance(whole, View):
            drawings.append(_draw(view, whole, thick))
        elif isinstance(view, MeasuredView):
            drawings.append(_draw_measured(view, thick))
    return drawings


def _same(one: Stack, other: Stack) -> bool:
    """Whether two materials of one structure are equal in all numbers."""
    return all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True))


def _draw(compared: View, drawn: View, shader: Shader) -> Drawing:
    """Draw a material where a reference was seen."""
    models, images = [], []
    for samples in _portions(drawn):
        models.append(predict(shader.stack, *samples.arrays))
        images.append(shade_samples(shader, *samples.arrays))
    model, image = np.concatenate(models), np.concatenate(images)
    return Drawing(compared, drawn, model, image, check_image(image, model, drawn.index, drawn.shape[1]))


@dataclasses.dataclass(frozen=True)
class MeasuredDrawing(Drawing):
    """A measured BRDF: a sphere of it, which is drawn to look at, and the samples, whose errors count."""

    samples_error: float

    def error(self) -> dict[str, float]:
        """`rel_l2` of the samples f cos(theta_i); what a viewer sees is that of the sphere."""
        return super().error() | {"rel_l2": self.samples_error}


def _draw_measured(view: MeasuredView, shader: Shader) -> MeasuredDrawing:
    """Draw a material beside a measured BRDF, and compare its shader with JAX at the samples too."""
    samples = view.samples()
    model, values = predict(shader.stack, *samples.arrays), shade_samples(shader, *samples.arrays)
    sphere = sphere_of(view)
    drawing = _draw(sphere, sphere, shader)
    describe = lambda row: {"wi": samples.wi[row, 0].tolist(), "wo": samples.wo[row].tolist()}  # noqa: E731
    floor = FLOOR * float(np.quantile(np.max(model, -1), 0.99))
    parity = together([drawing.parity, compare(values, model, floor, describe)])
    error = np.sqrt(np.sum((model - view.target) ** 2) / np.sum(view.target**2))
    return MeasuredDrawing(sphere, sphere, drawing.model, drawing.shader, parity, float(error))


def mean_error(drawings: Sequence[Drawing]) -> dict[str, float]:
    """Image errors, averaged over the references."""
    errors = [drawing.error() for drawing in drawings]
    return {key: float(np.mean([e[key] for e in errors])) for key in errors[0]}


def _directions(view: View) -> int:
    """Light samples of a pixel of a picture, for each light that is a quadrature."""
    return 1 if view.exact else int(np.clip(PICTURE_SAMPLES // len(view.index), 64, view.directions))


def _portions(view: View) -> Iterator[Samples]:
    """All usable pixels, a bounded number of light samples at a time."""
    size = max(1, PORTION // _directions(view))
    for start in range(0, len(view.index), size):
        yield view.samples(np.arange(start, min(start + size, len(view.index))), _directions(view))


def write_render(
    stack: Stack, views: Sequence[AnyView], output: Path, truth: Callable[[Stack], Truth] | None = None
) -> list[Path]:
    """Render a material in place of the references; one file a reference, numbered where there are several. With `truth` by the random walk."""
    if output.suffix not in PICTURES:
        raise InputError(f"{output}: a picture is written as .exr (linear) or .png; choose one of them with -o")
    check_directory(output.parent)
    written = []
    for k, any_view in enumerate(views):
        view = any_view if isinstance(any_view, View) else sphere_of(any_view)
        any_view.check(stack)
        path = output if len(views) == 1 else output.with_stem(f"{output.stem}_{k + 1}")
        thick = scaled(stack, view.scales(stack))
        drawn = _predicted(thick, view) if truth is None else _walked(truth(thick), view)
        image = view.image(drawn)
        if path.suffix == ".exr":
            path.parent.mkdir(parents=True, exist_ok=True)
            channels = {channel: image[..., c] for c, channel in enumerate("RGB")} | {"A": view.covered.astype(np.float32)}
            write_exr(path, channels)
        else:
            write_bytes(path, pictures.plain(image, exposure(image, view.covered)))
        written.append(path)
    return written


def _predicted(stack: Stack, view: View) -> np.ndarray:
    """Linear pixels (n, 3) of a material."""
    return np.concatenate([predict(stack, *samples.arrays) for samples in _portions(view)])


def _walked(truth: Truth, view: View) -> np.ndarray:
    """Linear pixels (n, 3) by the random walk, a pair of directions for every pixel and light."""
    if not view.exact:
        raise InputError(
            "the tier walk is drawn under point and distant lights: for each direction of another light there were a walk of its own"
        )
    samples = view.samples()
    pixels, lights, _ = samples.wi.shape
    values = truth(samples.wi.reshape(-1, 3), np.repeat(samples.wo, lights, 0)).mean
    return np.sum(values.reshape(pixels, lights, 3) * samples.weight, 1)


def quadrature(result: FitResult) -> dict[str, Any] | None:
    """What sampling the lights costs in accuracy; None where every light is exact."""
    every = zip(result.views, result.samples, result.materials, result.lights, strict=True)
    sampled = [(v.relit(lit), s, stack) for v, s, stack, lit in every if isinstance(v, View)]
    sampled = [(view, s, stack) for view, s, stack in sampled if not view.exact]
    if not sampled:
        return None
    directions = [(_directions(view), s.wi.shape[1]) for view, s, _ in sampled]
    errors = [
        [_quadrature_error(stack, view, count) for count in counts]
        for (view, _, stack), counts in zip(sampled, directions, strict=True)
    ]
    rms, fit_rms = np.max(errors, 0)
    picture, fitted = np.min(directions, 0)
    return {"directions": int(picture), "rms": float(rms), "fit_directions": int(fitted), "fit_rms": float(fit_rms)}


def _quadrature_error(stack: Stack, view: View, directions: int) -> float:
    """Error of one pixel's quadrature over the pixels' rms value: two draws, compared."""
    rng = np.random.default_rng(0)
    which = rng.choice(len(view.index), min(QUADRATURE_PIXELS, len(view.index)), replace=False)
    one, two = (predict(stack, *view.samples(which, directions, seed).arrays).astype(float) for seed in (1, 2))
    return float(np.sqrt(np.mean((one - two) ** 2) / 2.0 / np.maximum(np.mean(one * two), 1e-30)))
