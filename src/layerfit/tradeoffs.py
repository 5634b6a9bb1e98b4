"""`layerfit tradeoff`: error against run time, of the shaders that one material can have, and of fits of it."""

import csv
import dataclasses
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from . import truth
from .capture.load import AnyView, load
from .capture.scene import Scene
from .capture.scene_file import read_scene
from .documents import check_directory, write_files
from .errors import InputError
from .fit.words import structure
from .preset import model_name, preset_of, read_preset
from .report import tradeoff as report
from .report.told import Told
from .shader.cost import ROUNDS, times, tools
from .shader.gl import renderer
from .stack import Stack
from .study import fits, shaders
from .study.errors import relative, seen
from .study.kept import Kept
from .study.variants import variants
from .walk import interface_of, refuses, top_lobe

SCHEMA, VERSION = "layerfit/tradeoff", 1
FILES = ("tradeoff.json", "tradeoff.csv", "tradeoff.png", "tradeoff.html")
PARTS = "tradeoff.parts.json"
"""What is done so far, while it runs."""

Progress = Callable[[str, float], None]


def tradeoff(
    preset: str | Path | Stack,
    scene: str | Path | Scene | None = None,
    directory: str | Path = "out",
    *,
    lights: int = 1,
    rounds: int = ROUNDS,
    paths: int | None = None,
    fit: bool = True,
    name: str | None = None,
    progress: Progress = lambda stage, share: None,
) -> dict[str, Any]:
    """Measure what accuracy costs for a material, and write `FILES` to a directory; returns the content of `tradeoff.json`.

    `preset` is a file, the name of one that ships, or a material. With a `scene`, variants are seen on its pixels, and fits are to its references;
    without one, on a sphere. Shaders are timed under 1 to 8 `lights`, in so many `rounds`; `paths` are of the random walk, for each pair of
    directions, by default as many as its noise asks for. What is interrupted goes on from there when it is asked for again. Raises `LayerfitError`
    for input or a machine that is at fault.
    """
    stack = preset if isinstance(preset, Stack) else read_preset(Path(preset))
    name = name or ("material" if isinstance(preset, Stack) else Path(preset).stem)
    read = scene if scene is None or isinstance(scene, Scene) else read_scene(scene)
    directory = Path(directory)
    if read and fit:
        fits.check_alone(read, read.start, "tradeoff")
    check_directory(directory)
    views = load(read) if read else []
    device = {"renderer": renderer(), "machine": shaders.machine(), "tools": tools()}
    asked = [preset_of(stack, name), str(read and read.path), lights, rounds, paths, device]
    kept = Kept(directory / PARTS, asked)
    document = {
        "schema": SCHEMA,
        "version": VERSION,
        "name": name,
        "material": structure(stack),
        "model": model_name(stack),
        "scene": str(read.path) if read else None,
        "device": device["renderer"],
        "machine": device["machine"],
        "counted_by": device["tools"],
        "lights": lights,
        "rounds": rounds,
        **_shaders(stack, name, views, lights, rounds, paths, kept, progress),
        "fits": _fits(stack, read, views, kept, progress) if fit else [],
    }
    document["in_words"] = report.sentences(document)
    picture = report.picture(document)
    files = {
        "tradeoff.csv": _csv(document["tiers"]),
        "tradeoff.png": picture,
        "tradeoff.html": report.page(document, picture),
        "tradeoff.json": json.dumps(document, indent=2, allow_nan=False) + "\n",
    }
    write_files(directory, files)
    kept.done()
    return Told(document, *report.tables(document), *document["in_words"])


def _shaders(
    stack: Stack,
    name: str,
    views: Sequence[AnyView],
    lights: int,
    rounds: int,
    paths: int | None,
    kept: Kept,
    progress: Progress,
) -> dict[str, Any]:
    progress("print", 0.0)
    ways = variants(stack)
    printed = shaders.shaders_of(ways)
    pixels = shaders.pixels_of(stack, views)
    counts = kept.part("instructions", lambda: shaders.counted(printed))
    progress("time", 0.1)
    timings = kept.part("times", lambda: {key: shaders.timed(t) for key, t in times(printed, lights, rounds).items()})
    progress("errors", 0.3)
    errors = kept.part("errors", lambda: shaders.against_exact(ways, pixels))
    progress("walk", 0.4)
    walks = kept.part("walk", lambda: against_walk(stack, name, ways, paths))
    rows = [
        {"tier": key, "model": model_name(way), **timings[key], **counts[key], **errors[key], "walk": walks["tiers"].get(key)}
        for key, way in ways.items()
    ]
    for error in ("exact", "walk"):
        front = report.front(rows, error)
        for row in rows:
            row[f"pareto_{error}"] = row["tier"] in front
    return {"phong": shaders.of_phong(), "walk": walks["walk"], "tiers": rows}


def against_walk(stack: Stack, name: str, ways: Mapping[str, Stack], paths: int | None = None) -> dict[str, Any]:
    """Errors of every variant against the random walk; empty, with the reason, for a material that has none.

    `median` and `p90` are over directions of light and channels, of the difference over the light from below the coats; the others over single pairs
    of directions, of all light, where the noise of the walk is part of them.
    """
    interface = interface_of(stack)
    if reason := (refuses(stack, interface) if stack.layers else "there is no coat: every form is the base alone"):
        return {"walk": {"absent": reason}, "tiers": {}}
    truth.check(stack, name, interface)
    fans = [truth.hemisphere(angle) for angle in truth.INCIDENCE_DEG]
    counts = truth.path_counts(stack, fans, interface, paths, 0, lambda stage, share: None)
    walks = [truth.walked(stack, fan, count, interface, 0) for fan, count in zip(fans, counts, strict=True)]
    with jax.enable_x64(True):
        top = np.concatenate([top_lobe(stack, fan.wi, fan.wo) for fan in fans])
    cosine = np.concatenate([fan.wo[:, 2:] for fan in fans])
    whole = np.concatenate([walk.mean for walk in walks]) + top
    tiers = {}
    for key, way in ways.items():
        form = way.form
        under = (
            dataclasses.replace(way, form=dataclasses.replace(form, interface=interface)) if hasattr(form, "interface") else way
        )
        values = truth.below(under, fans, stack)
        off = np.array([truth.relative_error(f, t, fan) for f, t, fan in zip(values, walks, fans, strict=True)])
        all_light = np.concatenate(values) + top
        tiers[key] = {
            "median": float(np.nanmedian(off)),
            "p90": float(np.nanquantile(off, 0.9)),
            **relative(all_light, whole, shaders.FLOOR / np.pi),
            "delta_e": seen(all_light * cosine, whole * cosine),
        }
    noise = [truth.mean_of(truth.noise(walk, fan)) for walk, fan in zip(walks, fans, strict=True)]
    return {"walk": {"interface": interface, "paths": counts, "noise_rel": float(np.nanmedian(noise))}, "tiers": tiers}


def _fits(stack: Stack, scene: Scene | None, views: Sequence[AnyView], kept: Kept, progress: Progress) -> list[dict[str, Any]]:
    if scene is None:
        try:
            task = fits.drawn_task(stack)
        except InputError as error:
            return [{"name": "fit", "absent": str(error)}]
    else:
        targets = [view.samples().target for view in views]
        task = fits.Task(views, scene.start, fits.free_in(scene.fit, scene.start), dict(scene.fit.fixed), targets)
    rows, everything = [], list(fits.runs(task))
    for k, (name, run) in enumerate(everything):
        progress(name, 0.5 + 0.5 * k / len(everything))
        rows.append({"name": name, **kept.part(f"fit: {name}", run)})
    for row in rows:
        row["pareto"] = row["name"] in report.fit_front([r for r in rows if r["kind"] == row["kind"]])
    return rows


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """A tier a row; what is nested gets a column a value."""
    flat = [_flat(row) for row in rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(flat[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    low, high = row["x_phong_spread"]
    made = {key: value for key, value in row.items() if key not in ("walk", "x_phong_spread")}
    made |= {"x_phong_low": low, "x_phong_high": high}
    return made | {f"walk_{key}": value for key, value in (row["walk"] or {}).items()}
