"""The main job: a scene file in; a preset, a verified shader, pictures and a report out."""

import csv
import dataclasses
import io
import json
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .capture.exr import write_exr
from .capture.samples import QUADRATURE, Samples, View, load
from .capture.scene import read_scene
from .documents import ensure_directory, write_bytes, write_text
from .errors import InputError
from .fit.fit import FitResult, fit
from .fit.metrics import exposure, image_error
from .fit.residuals import scaled
from .fit.result import to_json
from .preset import preset_of
from .render import radiance
from .report import html, pictures
from .shader.export import Shader, print_material
from .shader.verify import MAX_REL, P999_REL, Parity, check_image, check_pairs, shade_samples
from .stack import Stack

Progress = Callable[[str, float], None]

PICTURE_SAMPLES = 40_000_000
"""Light samples in one picture at most, where light is a quadrature."""


@dataclasses.dataclass
class Outcome:
    """What a fit job leaves behind."""

    document: dict[str, Any]
    """The content of `fit.json`."""
    directory: Path
    good: bool
    """Converged, shader verified."""


def fit_scene(
    path: Path, directory: Path, *, import_s: float = 0.0, progress: Progress = lambda stage, share: None, **options: Any
) -> Outcome:
    """Fit a scene and write everything to `directory`; each file whole or not at all, `fit.json` last.

    `options` override the scene's [fit] table. Raises `LayerfitError` for input or a machine that is at fault.
    """
    began = time.perf_counter()
    ensure_directory(directory)
    scene = read_scene(path)
    request = dataclasses.replace(scene.fit, **{k: v for k, v in options.items() if v is not None})
    views = load(scene)
    read_s = time.perf_counter() - began
    progress("fit", 0.0)
    result = fit(
        views,
        scene.start,
        free=request.free,
        fixed=dict(request.fixed),
        weights=request.weights,
        loss=request.loss,
        starts=request.starts,
        seed=request.seed,
        where=f"{path}: fit",
        progress=progress,
    )
    progress("shader", 0.0)
    after_fit = time.perf_counter()
    name = path.stem
    shader = print_material(result.stack, name)
    parity, rows, errors = _verify(shader, result)
    pairs = check_pairs(shader)
    verify_s = time.perf_counter() - after_fit
    parity_document = {"max_rel": max(parity.max_rel, pairs.max_rel), "p999_rel": max(parity.p999_rel, pairs.p999_rel)}
    seconds = {
        "total_s": 0.0,
        "import_s": import_s,
        "read_s": read_s,
        "trace_s": result.clock.trace_s,
        "compile_s": result.clock.compile_s,
        "solve_s": result.solve_s,
        "verify_s": verify_s,
    }
    picture = pictures.strip(rows)
    convergence = pictures.convergence([(row.time_s, row.stage, row.error) for row in result.trace])
    seconds["total_s"] = import_s + time.perf_counter() - began
    document = to_json(result, errors, parity_document, seconds, "preset.json")
    write_text(directory / "material.frag", shader.text())
    write_text(directory / "trace.csv", _trace(result))
    write_bytes(directory / "fit.png", picture)
    write_text(directory / "preset.json", json.dumps(preset_of(result.stack, name, fit=_summary(document)), indent=2) + "\n")
    write_text(directory / "report.html", html.page(name, document, picture, convergence, shader.text()))
    write_text(directory / "fit.json", json.dumps(document, indent=2) + "\n")
    return Outcome(document, directory, result.converged and parity.passed and pairs.passed)


def _verify(shader: Shader, result: FitResult) -> tuple[Parity, list[list[pictures.Panel]], dict[str, float]]:
    """The shader's pixels against JAX and against the references: worst parity, picture rows, mean image errors."""
    parities, rows, errors = [], [], []
    for view in result.views:
        drawing = draw(view, scaled(result.stack, view.scales(result.stack)), shader.name)
        parities.append(drawing.parity)
        rows.append(drawing.row())
        errors.append(drawing.error())
    worst = max(parities, key=lambda p: p.max_rel)
    return worst, rows, {key: float(np.mean([e[key] for e in errors])) for key in errors[0]}


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A material at all usable pixels of a reference, from JAX and from its shader."""

    view: View
    model: np.ndarray
    shader: np.ndarray
    parity: Parity

    def row(self) -> list[pictures.Panel]:
        """Reference, fit (JAX), shader (OpenGL), and difference of the shader from the reference."""
        view = self.view
        white = exposure(view.image(view.target), view.covered)
        panels = [
            pictures.shown(f"reference {view.reference.exr.name}", view.picture, white),
            pictures.shown("fit (JAX)", view.image(self.model), white),
            pictures.shown("shader (OpenGL)", view.image(self.shader), white),
        ]
        return pictures.compare(panels, view.image(self.shader), view.image(view.target), white, view.covered)

    def error(self) -> dict[str, float]:
        """Image errors of the shader against the reference."""
        return image_error(self.view.image(self.shader), self.view.image(self.view.target), self.view.covered)


def draw(view: View, stack: Stack, name: str) -> Drawing:
    """Draw a material where a reference was seen, by JAX and by its shader in OpenGL."""
    shader = print_material(stack, name)
    models, images = [], []
    for samples in _portions(view):
        models.append(predict(stack, samples))
        images.append(shade_samples(shader, samples.wi, samples.wo, samples.weight))
    model, image = np.concatenate(models), np.concatenate(images)
    return Drawing(view, model, image, check_image(image, model, view.index, view.shape[1]))


def _portions(view: View) -> Iterator[Samples]:
    """All usable pixels, a bounded number of light samples at a time."""
    directions = 1 if view.exact else int(np.clip(PICTURE_SAMPLES // len(view.index), 64, QUADRATURE))
    size = max(1, 2_000_000 // directions)
    for start in range(0, len(view.index), size):
        yield view.samples(np.arange(start, min(start + size, len(view.index))), directions)


_radiance = jax.jit(radiance)


def predict(stack: Stack, samples: Samples) -> np.ndarray:
    """Radiance (n, 3) of a material at samples, in float32."""
    return np.asarray(_radiance(stack.astype(np.float32), samples.wi, samples.wo, samples.weight))


def _trace(result: FitResult) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["time_s", "stage", "start", "step", "error"])
    for row in result.trace:
        writer.writerow([f"{row.time_s:.4f}", row.stage, row.start, row.step, f"{row.error:.6g}"])
    return out.getvalue()


def _summary(document: dict[str, Any]) -> dict[str, Any]:
    """What a preset keeps of its fit."""
    return {
        "sigma": {name: row["sigma"] for name, row in document["parameters"].items()},
        "flags": document["flags"],
        "error": document["error"],
        "parity": document["parity"],
    }


def write_render(stack: Stack, views: Sequence[View], output: Path) -> list[Path]:
    """Render a material in place of the references; one file a reference, numbered where there are several."""
    written = []
    for k, view in enumerate(views):
        path = output if len(views) == 1 else output.with_stem(f"{output.stem}_{k + 1}")
        thick = scaled(stack, view.scales(stack))
        image = view.image(np.concatenate([predict(thick, samples) for samples in _portions(view)]))
        if path.suffix == ".exr":
            channels = {channel: image[..., c] for c, channel in enumerate("RGB")} | {"A": view.covered.astype(np.float32)}
            write_exr(path, channels)
        elif path.suffix == ".png":
            write_bytes(path, pictures.plain(image, exposure(image, view.covered)))
        else:
            raise InputError(f"{path}: a picture is written as .exr (linear) or .png")
        written.append(path)
    return written


def verify_preset(
    stack: Stack, name: str, scene: Path | None, output: Path | None, fail: float | None, hardfail: float | None
) -> tuple[dict[str, Any], Path | None]:
    """Verify the shader of a material; returns the document of `layerfit verify --json` and where the picture is."""
    shader = print_material(stack, name)
    parities = [check_pairs(shader)]
    image: dict[str, float] = {}
    picture = None
    if scene is not None:
        drawings = [draw(view, scaled(stack, view.scales(stack)), name) for view in load(read_scene(scene))]
        parities += [drawing.parity for drawing in drawings]
        errors = [drawing.error() for drawing in drawings]
        image = {key: float(np.mean([e[key] for e in errors])) for key in errors[0]}
        if output is not None:
            picture = output / "verify.png"
            write_bytes(picture, pictures.strip([drawing.row() for drawing in drawings]))
    worst = max(parities, key=lambda p: p.max_rel)
    p999 = max(p.p999_rel for p in parities)
    passed = worst.max_rel <= (MAX_REL if hardfail is None else hardfail) and p999 <= (P999_REL if fail is None else fail)
    document = {
        "parity": worst.to_json() | {"p999_rel": p999},
        "image": image,
        "passed": passed,
        "renderer": worst.renderer,
    }
    return document, picture
