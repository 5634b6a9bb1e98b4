"""Commands that fit: `fit`, `structures`, and `advise`, which is asked before a fit."""

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from . import complete
from .app import Force, Loss, Metric, Output, Scene, Seed, Starts, command
from .talk import STARTED, Done, many, progress, say, show

TIMES_MORE = 4
"""Starts for a fit that did not converge, over those that it had."""


@command()
def fit(
    scene: Scene,
    output: Output = Path("out"),
    starts: Starts = None,
    seed: Seed = None,
    metric: Metric = None,
    loss: Loss = None,
    start: Annotated[
        Path | None,
        typer.Option(
            help="Material to start from in place of the scene's: .gltf, .glb, .mtlx, a preset, or Blender's inputs (.json)."
        ),
    ] = None,
    also: Annotated[
        list[str] | None,
        typer.Option(
            "--also",
            metavar="PARAMETER",
            help="Parameter to fit beside [fit].free, such as light.ambient, in place of the scene's [fit].also; may be repeated.",
        ),
    ] = None,
    each: Annotated[
        list[str] | None,
        typer.Option(
            "--each",
            metavar="PARAMETER",
            help="Parameter that every reference has for itself, such as base.alpha, in place of the scene's [fit].each; may be repeated.",
        ),
    ] = None,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            "--profile",
            metavar="PARAMETER",
            help="Parameter whose 95 % interval is found by fitting the others again, such as coat.tau; may be repeated.",
        ),
    ] = None,
    force: Force = False,
) -> Done:
    """Fit a material to a reference render or a measured BRDF.

    Leaves `fit.json`, `preset.json`, `material.frag`, `report.html`, `fit.png` and `trace.csv` in the output directory; no `material.frag`
    where the driver draws the shader otherwise than JAX computes it.

    Examples:
        layerfit fit examples/references/lacquered_copper.toml -o out/copper
        layerfit fit scene.toml --starts 12 --profile coat.eta -o out
        layerfit fit scene.toml --start out/preset.json --also light.ambient -o out/again
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..capture.scene_file import MOST_STARTS, read_scene
    from ..job import fit_scene

    imported = time.perf_counter() - STARTED
    with progress() as report:
        read = read_scene(scene) if start is None else _starting(scene, start)
        outcome = fit_scene(
            read,
            output,
            import_s=imported,
            progress=report,
            profile=profile or (),
            force=force,
            also=tuple(also) if also else None,
            each=tuple(each) if each else None,
            starts=starts,
            seed=seed,
            metric=metric,
            loss=loss,
        )
    _show_fit(outcome)
    given = {"--start": start, "--also": also, "--each": each, "--metric": metric, "--loss": loss, "--seed": seed}
    more = min(TIMES_MORE * (starts or read.fit.starts), MOST_STARTS)
    again = ("fit", scene, "--starts", more, *_words(given), "-o", output)
    return Done(outcome.document, _after_fit(outcome.document["flags"], scene, output, again), outcome.good)


def _starting(scene: Path, start: Path) -> Any:
    """A scene whose fit starts from another material."""
    import dataclasses

    from ..capture.scene_file import read_scene
    from ..interchange.formats import read_start

    stack = read_start(start)
    return dataclasses.replace(read_scene(scene, stack), start=stack)


def _show_fit(outcome: Any) -> None:
    from ..report.text import lines, not_written

    for line in lines(outcome.document):
        say(line)
    say(f"Wrote {', '.join(outcome.written[:-1])} and {outcome.written[-1]} in {outcome.directory}/")
    if "material.frag" not in outcome.written:
        say(not_written(outcome.document["parity"]))


def _words(given: Mapping[str, Any]) -> list[Any]:
    """Options as they were given: one that may be repeated as often as it was."""
    every = [(option, value if isinstance(value, list) else [value]) for option, value in given.items() if value is not None]
    return [word for option, values in every for value in values for word in (option, value)]


def _after_fit(flags: Sequence[str], scene: Path, output: Path, again: tuple[Any, ...]) -> tuple[Any, ...]:
    """What the gravest flag of a fit asks for, such as the same fit with more starts (`again`); without one, a look at the material."""
    found, preset = {flag.partition(":")[0] for flag in flags}, output / "preset.json"
    if "shader_differs" in found:
        return ("doctor",)
    if "not_converged" in found:
        return again
    if "poor_fit" in found:
        return "structures", scene, "-o", output / "structures"
    if found & {"not_identifiable", "undetermined_direction", "correlated", "other_minimum", "lower_limit"}:
        return "advise", scene, "--preset", preset
    return "view", preset


@command()
def structures(
    reference: Annotated[Path, typer.Argument(help="Scene file, or a measured BRDF: .brdf, .bsdf, .binary or .csv.")],
    output: Output = Path("out"),
    only: Annotated[str | None, typer.Option(help="Names of structures to try, with commas; left out, all.")] = None,
    metric: Annotated[
        str, typer.Option(help="law, uniform, relative, log or cube_root.", autocompletion=complete.metrics)
    ] = "log",
    min_half_deg: Annotated[
        float, typer.Option(min=0.0, max=89.0, help="Degrees, of a measured BRDF: leave out half vectors nearer to the normal.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of starts and pixel choices.")] = 0,
) -> Done:
    """Find the simplest structure that explains a reference.

    Fits candidates, from a diffuse surface to two coats.

    Leaves `structures.json` and `structures.png` in the output directory, beside what a fit of the chosen one leaves. Exit code 1: it
    does not explain the reference, or its fit has findings.

    Examples:
        layerfit structures paint.bsdf -o out/paint
        layerfit structures scene.toml --only metal,coat_metal -o out
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..report.structures import table
    from ..structures import structures_of

    names = None if only is None else [name.strip() for name in only.split(",")]
    with progress() as report:
        outcome = structures_of(
            reference, output, structures=names, metric=metric, seed=seed, min_half_deg=min_half_deg, progress=report
        )
    show(table(outcome.document))
    for sentence in outcome.document["in_words"]:
        say(sentence)
    say(f"Wrote structures.png and structures.json in {output}/, and of the fit fit.png, report.html, preset.json and fit.json")
    return Done(outcome.document, ("view", output / "preset.json"), outcome.good)


@command()
def batch(
    scenes: Annotated[
        list[str],
        typer.Argument(
            help="Scene files, patterns in quotes, directories of scenes, or manifests (.csv with a column `scene`)."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the table.")] = Path("out"),
    workers: Annotated[int, typer.Option(min=1, help="Processes that share the work.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a cluster of dask that shares it instead, such as tcp://node1:8786.")
    ] = None,
    each: Annotated[
        bool, typer.Option("--each", help="A directory of each fit too, with all that `layerfit fit` leaves.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="One start, and sigmas of the noise alone.")] = False,
    starts: Starts = None,
    seed: Seed = None,
    metric: Metric = None,
    loss: Loss = None,
) -> Done:
    """Fit many scenes into one table.

    Leaves `results.csv`, `results.parquet` (where pyarrow is installed) and `batch.json`. What is interrupted goes on where it was when the
    same command is given again. Exit code 1: some failed; their rows say why.

    Examples:
        layerfit batch "examples/references/*.toml" -o out/batch
        layerfit batch captures/ --workers 4 --each -o out/captures
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..batch import fit_batch

    with many() as report:
        done = fit_batch(
            scenes,
            output,
            workers=workers,
            scheduler=scheduler,
            each=each,
            quick=quick,
            progress=report,
            starts=starts,
            seed=seed,
            metric=metric,
            loss=loss,
        )
    for row in done.rows:
        if row["error"]:
            scene = "" if str(row["scene"]) in row["error"] else f"{row['scene']}: "
            say(f"failed: {scene}{row['error']}")
    document = done.document
    say(f"{document['done']} done ({document['kept']} of them before), {document['failed']} failed: {document['table']}")
    given = {"--starts": starts, "--metric": metric, "--loss": loss, "--seed": seed}
    return Done(document, (*_after_batch(done.rows, output), *_words(given)), done.good)


def _after_batch(rows: Sequence[Any], output: Path) -> tuple[Any, ...]:
    """A closer look at a scene that failed, else at the one that is fitted worst."""
    row = next((row for row in rows if row["error"]), None) or max(
        rows, key=lambda row: math.inf if row["misfit"] is None else row["misfit"]
    )
    return "fit", row["scene"], "-o", output / Path(row["scene"]).stem


@command()
def advise(
    scene: Scene,
    preset: Annotated[
        Path | None,
        typer.Option(
            "--preset",
            help="The material to ask about, such as a fitted one; left out, the scene's start.",
            autocompletion=complete.presets,
        ),
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Directory for advice.json and advice.png.")] = None,
) -> Done:
    """Say what the images of a scene tell of its material.

    And which further light, camera or thickness would tell most. Exit code 1: something that is free is not determined.

    Examples:
        layerfit advise examples/references/varnished_wood.toml -o out/advice
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..capture.scene_file import read_scene
    from ..job import write_advice
    from ..preset import read_preset
    from ..report.advice import lines

    with progress() as report:
        document = write_advice(read_scene(scene), None if preset is None else read_preset(preset), output, report)
    for line in lines(document):
        say(line)
    if output is not None:
        say(f"Wrote advice.png and advice.json in {output}/")
    return Done(document, ("fit", scene), all(row["identifiable"] for row in document["parameters"].values()))
