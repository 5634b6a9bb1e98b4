"""The main job: a scene file in; a preset, a verified shader, pictures and a report out."""

import csv
import dataclasses
import io
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .capture.exr import write_exr
from .capture.load import AnyView, load
from .capture.measured.sphere import sphere_of
from .capture.measured.view import MeasuredView
from .capture.samples import Samples, View
from .capture.scene import Scene, read_scene
from .documents import check_directory, finite, of_ours, write_bytes, write_files
from .errors import InputError
from .fit.advise import advise
from .fit.fit import fit
from .fit.metrics import exposure, image_error
from .fit.residuals import scaled
from .fit.result import FitResult, parameters, to_json
from .fit.weights import FLOOR_SHARE, MODEL_SHARE
from .fit.words import structure
from .forms.accuracy import against_walk
from .forms.precise import Precise, refuses
from .preset import model_name, preset_of
from .render import brdf_values, predict
from .report import advice, html, pictures, planes, viewer
from .report.comparison import Pair
from .shader.export import Shader, print_material
from .shader.gl import renderer
from .shader.verify import FLOOR, MAX_REL, P999_REL, Parity, check_image, check_pairs, compare, shade_samples, together
from .stack import Stack

Progress = Callable[[str, float], None]

PICTURE_SAMPLES = 40_000_000
"""Light samples in one picture at most, where light is a quadrature."""

PORTION = 500_000
"""Light samples that are drawn at a time: what stands for them in memory is some 150 bytes each."""

QUADRATURE_PIXELS = 128
"""Pixels on which the error of a quadrature is measured: enough to say how large it is."""


@dataclasses.dataclass
class Outcome:
    """What a fit job leaves behind."""

    document: dict[str, Any]
    """The content of `fit.json`."""
    directory: Path
    good: bool
    """Converged, shader verified."""
    written: list[str]
    """The files, by their names in the directory."""


def fit_scene(
    scene: str | Path | Scene,
    directory: str | Path,
    *,
    import_s: float = 0.0,
    progress: Progress = lambda stage, share: None,
    profile: Sequence[str] = (),
    model_error: bool = True,
    force: bool = False,
    **options: Any,
) -> Outcome:
    """Fit a scene, or its file, and write everything to `directory`: all files whole, or none.

    A shader that the driver draws otherwise than JAX computes it is not written, but by `force`.
    `profile` are parameters whose intervals are found by fitting the others again; without `model_error` sigmas are of the noise alone.
    `options` override the scene's [fit] table. Raises `LayerfitError` for input or a machine that is at fault.
    """
    began = time.perf_counter()
    scene = scene if isinstance(scene, Scene) else read_scene(scene)
    path, directory = scene.path, Path(directory)
    scene = asked(scene, options)
    views = load(scene)
    check_directory(directory)
    renderer()  # a machine that cannot verify is told so before the fit, not after it
    read_s = time.perf_counter() - began
    progress("fit", 0.0)
    result = fit_views(views, scene, model_error=model_error, profile=profile, progress=progress)
    progress("shader", 0.0)
    fitted = time.perf_counter()
    name = path.stem
    shader = print_material(result.stack, name)
    compared, drawn = (
        [view.relit(lit) for view, lit in zip(views, result.lights, strict=True)] for views in (result.views, load(scene, 0.0))
    )
    drawings = draw_all(compared, drawn, shader, result.materials)
    parity = together([*(drawing.parity for drawing in drawings), check_pairs(shader)])
    verified = time.perf_counter()
    picture = pictures.strip([drawing.row() for drawing in drawings])
    pairs = [drawing.pair() for drawing in drawings]
    live = viewer.live(result.stack, name, finite(parameters(result)))
    errors = mean_error(drawings)
    quadrature = _quadrature(result)
    now = time.perf_counter()
    seconds = {
        "total_s": import_s + now - began,
        "import_s": import_s,
        "read_s": read_s,
        "trace_s": result.clock.trace_s,
        "compile_s": result.clock.compile_s,
        "solve_s": result.solve_s,
        "verify_s": verified - fitted,
        "pictures_s": now - verified,
    }
    parity_document = parity.to_json() | {"passed": parity.passed, "renderer": parity.renderer}
    document = finite(to_json(result, errors, parity_document, seconds, "preset.json"))
    document["flags"] += [] if parity.passed else ["shader_differs"]
    document["model"] = _model(result.stack)
    document["model_error"] = against_walk(result.stack.layers, result.stack.base, result.stack.form) or {}
    document["pixels"]["usable"] = sum(len(view.index) for view in result.views)
    document["metric"] = scene.fit.metric
    document["weighting"] = {
        "kind": scene.fit.metric,
        "loss": scene.fit.loss,
        "model_share": MODEL_SHARE,
        "floor_share": FLOOR_SHARE,
        "noise": [view.noise is not None for view in result.views],
    }
    document["quadrature"] = quadrature
    in_planes = _planes(result, name)
    trace = [(row.time_s, row.stage, row.start, row.error) for row in result.trace]
    files = {
        "material.frag": shader.text() if parity.passed or force else None,
        "trace.csv": _trace(result),
        "fit.png": picture,
        "planes.png": in_planes,
        "preset.json": json.dumps(preset_of(result.stack, name, fit=_summary(document)), indent=2) + "\n",
        "report.html": html.page(name, document, pairs, picture, trace, shader.text(), live, in_planes),
        "fit.json": json.dumps(document, indent=2, allow_nan=False) + "\n",
    }
    write_files(directory, of_ours(directory, files, "fit.json", document["schema"]))
    written = [name for name, content in files.items() if content is not None]
    return Outcome(document, directory, result.converged and parity.passed, written)


def asked(scene: Scene, options: Mapping[str, Any]) -> Scene:
    """The scene with those of its [fit] table that are given otherwise; None is not given."""
    return dataclasses.replace(scene, fit=dataclasses.replace(scene.fit, **{k: v for k, v in options.items() if v is not None}))


def fit_views(views: Sequence[AnyView], scene: Scene, **options: Any) -> FitResult:
    """What a scene asks for, fitted to its references; `options` are further ones of `fit`."""
    request = scene.fit
    return fit(
        views,
        scene.start,
        free=request.free,
        also=request.also,
        each=request.each,
        fixed=dict(request.fixed),
        metric=request.metric,
        loss=request.loss,
        starts=request.starts,
        seed=request.seed,
        where=f"{scene.path}: fit",
        **options,
    )


def _planes(result: FitResult, name: str) -> bytes | None:
    """A measured BRDF and its fit in planes of incidence; None where there is none, or no samples lie in one."""
    for view, stack in zip(result.views, result.materials, strict=True):
        if not isinstance(view, MeasuredView):
            continue
        if found := planes.planes(view.brdf, lambda wi, wo, stack=stack: brdf_values(stack, wi, wo)):
            return planes.drawn(found, name)
    return None


def _model(stack: Stack) -> dict[str, Any]:
    """Which form of the model was fitted, and to what."""
    return {
        "name": model_name(stack),
        "options": preset_of(stack, "").get("options", {}),
        "layers": structure(stack),
        "why": _why(stack),
    } | ({"interface": stack.form.interface} if isinstance(stack.form, Precise) else {})


def _why(stack: Stack) -> str:
    """What speaks for the form of a material, and what against a nearer one."""
    if not stack.layers:
        return "a surface without a coat is evaluated on its own"
    reason = refuses(stack.layers, stack.base)
    if reason:
        return f"the precise form is not for this material: {reason}"
    nearest = f"the form nearest to the random walk for {'one coat' if len(stack.layers) == 1 else 'two coats'}"
    return nearest if isinstance(stack.form, Precise) else f"asked for; precise is {nearest}"


def _quadrature(result: FitResult) -> dict[str, Any] | None:
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
        thick = shader if same(stack, shader.stack) else print_material(stack, shader.name)
        if isinstance(view, View) and isinstance(whole, View):
            drawings.append(draw(view, whole, thick))
        elif isinstance(view, MeasuredView):
            drawings.append(draw_measured(view, thick))
    return drawings


def same(one: Stack, other: Stack) -> bool:
    """Whether two materials of one structure are equal in all numbers."""
    return all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True))


def draw(compared: View, drawn: View, shader: Shader) -> Drawing:
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


def draw_measured(view: MeasuredView, shader: Shader) -> MeasuredDrawing:
    """Draw a material beside a measured BRDF, and compare its shader with JAX at the samples too."""
    samples = view.samples()
    model, values = predict(shader.stack, *samples.arrays), shade_samples(shader, *samples.arrays)
    sphere = sphere_of(view)
    drawing = draw(sphere, sphere, shader)
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


def write_advice(scene: Scene, stack: Stack | None, directory: Path | None, progress: Progress) -> dict[str, Any]:
    """What the images of a scene tell and which further ones would; `advice.json` and `advice.png` in a directory, if there is one."""
    if directory is not None:
        check_directory(directory)
    found = advise(scene, stack, progress=progress)
    document = advice.document(found)
    if directory is not None:
        text = json.dumps(document, indent=2, allow_nan=False) + "\n"
        write_files(directory, {"advice.png": advice.light_map(found.candidates), "advice.json": text})
    return document


PICTURES = (".exr", ".png")
"""What a render is written as: linear, and for looking at."""


def write_render(stack: Stack, views: Sequence[AnyView], output: Path) -> list[Path]:
    """Render a material in place of the references; one file a reference, numbered where there are several."""
    if output.suffix not in PICTURES:
        raise InputError(f"{output}: a picture is written as .exr (linear) or .png; choose one of them with -o")
    check_directory(output.parent)
    written = []
    for k, any_view in enumerate(views):
        view = any_view if isinstance(any_view, View) else sphere_of(any_view)
        any_view.check(stack)
        path = output if len(views) == 1 else output.with_stem(f"{output.stem}_{k + 1}")
        thick = scaled(stack, view.scales(stack))
        image = view.image(np.concatenate([predict(thick, *samples.arrays) for samples in _portions(view)]))
        if path.suffix == ".exr":
            path.parent.mkdir(parents=True, exist_ok=True)
            channels = {channel: image[..., c] for c, channel in enumerate("RGB")} | {"A": view.covered.astype(np.float32)}
            write_exr(path, channels)
        else:
            write_bytes(path, pictures.plain(image, exposure(image, view.covered)))
        written.append(path)
    return written


def verify_preset(
    stack: Stack, name: str, scene: Path | None, output: Path | None, fail: float | None, hardfail: float | None
) -> tuple[dict[str, Any], Path | None]:
    """Verify the shader of a material; returns the document of `layerfit verify --json` and where the picture is."""
    if output is not None:
        if scene is None:
            raise InputError(f"{output}: there is no picture without a scene; name one after the preset, or leave -o out")
        check_directory(output)
    shader = print_material(stack, name)
    parities, drawings = [check_pairs(shader)], []
    if scene is not None:
        read = read_scene(scene)
        drawings = draw_all(load(read), load(read, 0.0), shader)
        parities += [drawing.parity for drawing in drawings]
    parity = together(parities)
    picture = None
    if drawings and output is not None:
        picture = output / "verify.png"
        write_bytes(picture, pictures.strip([drawing.row() for drawing in drawings]))
    most, usual = MAX_REL if hardfail is None else hardfail, P999_REL if fail is None else fail
    document = {
        "parity": parity.to_json(),
        "image": finite(mean_error(drawings)) if drawings else {},
        "passed": parity.max_rel <= most and parity.p999_rel <= usual,
        "renderer": parity.renderer,
    }
    return document, picture
