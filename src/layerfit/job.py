"""The main job: a scene file in; a preset, a verified shader, pictures and a report out."""

import csv
import dataclasses
import io
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from .capture.load import AnyView, load
from .capture.measured.view import MeasuredView
from .capture.scene import Scene
from .capture.scene_file import check_request, read_scene
from .documents import check_directory, finite, of_ours, write_bytes, write_files
from .drawings import draw_all, mean_error, quadrature
from .errors import InputError
from .fit.advise import advise
from .fit.fit import fit
from .fit.result import FitResult, parameters, to_json
from .fit.weights import FLOOR_SHARE, MODEL_SHARE
from .fit.words import structure
from .forms.accuracy import against_walk
from .forms.precise import Precise, refuses
from .preset import model_name, preset_of
from .render import brdf_values
from .report import advice, html, pictures, planes, viewer
from .shader.export import print_material
from .shader.gl import renderer
from .shader.verify import MAX_REL, P999_REL, check_pairs, together
from .stack import Stack

Progress = Callable[[str, float], None]


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
    sampling = quadrature(result)
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
    document["quadrature"] = sampling
    in_planes = _planes(result, name)
    trace = [(row.time_s, row.stage, row.start, row.error) for row in result.trace]
    materials = {"": result.stack} | {f"_{k}": stack for k, stack in _others(result)}
    document["presets"] = [f"preset{which}.json" for which in materials]
    shaders = {which: shader if which == "" else print_material(stack, name + which) for which, stack in materials.items()}
    files = {
        **{f"material{which}.frag": s.text() if parity.passed or force else None for which, s in shaders.items()},
        "trace.csv": _trace(result),
        "fit.png": picture,
        "planes.png": in_planes,
        **{f"preset{which}.json": _preset(stack, name + which, document) for which, stack in materials.items()},
        "report.html": html.page(name, document, pairs, picture, trace, shader.text(), live, in_planes),
    }
    written = document["files"] = [*(name for name, content in files.items() if content is not None), "fit.json"]
    files["fit.json"] = json.dumps(document, indent=2, allow_nan=False) + "\n"
    write_files(directory, of_ours(directory, files, "fit.json", document["schema"]))
    return Outcome(document, directory, result.converged and parity.passed, written)


def asked(scene: Scene, options: Mapping[str, Any]) -> Scene:
    """The scene with those of its [fit] table that are given otherwise; None is not given. Raises `InputError`."""
    given = {key: value for key, value in options.items() if value is not None}
    check_request(given, f"{scene.path}: fit")
    return dataclasses.replace(scene, fit=dataclasses.replace(scene.fit, **given))


def fit_views(views: Sequence[AnyView], scene: Scene, **options: Any) -> FitResult:
    """What a scene asks for, fitted to its references; `options` are further ones of `fit`."""
    return fit(views, **request_of(scene), **options)


def request_of(scene: Scene) -> dict[str, Any]:
    """What a scene asks for, as `fit` takes it."""
    asked = {field.name: getattr(scene.fit, field.name) for field in dataclasses.fields(scene.fit)}
    del asked["min_cosine"]  # of the references
    return asked | {"start": scene.start, "fixed": dict(scene.fit.fixed), "where": f"{scene.path}: fit"}


def _others(result: FitResult) -> list[tuple[int, Stack]]:
    """The material in the second reference and those after it, counted from 1, where references have some of it for themselves."""
    if not any(f.reference is not None and f.layer is not None for f in result.free.free):
        return []
    return list(enumerate(result.materials, 1))[1:]


def _preset(stack: Stack, name: str, document: dict[str, Any]) -> str:
    return json.dumps(preset_of(stack, name, fit=_summary(document)), indent=2) + "\n"


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


def verify_preset(
    stack: Stack, name: str, scene: Path | None, output: Path | None, fail: float | None, hardfail: float | None
) -> tuple[dict[str, Any], Path | None]:
    """Verify the shader of a material; returns the document of `layerfit verify --json` and where the picture is."""
    for option, limit in (("--fail", fail), ("--hardfail", hardfail)):
        if limit is not None and not limit >= 0.0:
            raise InputError(f"{option} {limit:g}: should be a relative difference of 0 or more, such as 1e-5")
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
