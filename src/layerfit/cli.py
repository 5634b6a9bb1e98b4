"""The command line. Heavy modules are imported where a command needs them: `layerfit --help` answers at once.

Data on standard output, tables and progress on standard error. Exit codes: 0 done and good; 1 done, with findings; 2 the input or
the machine is at fault, with a message that says what to do.
"""

import itertools
import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from .errors import LayerfitError

STARTED = time.perf_counter()

app = typer.Typer(
    name="layerfit",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
stderr = Console(stderr=True, highlight=False)

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Scene = Annotated[Path, typer.Argument(help="Scene file (TOML or JSON): reference, camera, lights, material, fit.")]
Preset = Annotated[Path, typer.Argument(help="Preset file (JSON): a material.")]


def main() -> None:
    """Run the command line; every fault of input or machine is one message and exit code 2."""
    try:
        app()
    except LayerfitError as error:
        stderr.print(f"[bold red]layerfit:[/] {_plain(error)}", soft_wrap=True)
        sys.exit(2)
    except SystemExit as end:
        if end.code == 130:  # what typer makes of an interrupt
            _say("layerfit: interrupted; every file that was written is whole")
        raise


def _plain(error: Exception) -> str:
    from rich.markup import escape

    return escape(str(error))


def _say(text: str) -> None:
    """A line on standard error, as it is: nothing in it is markup, and the terminal wraps it."""
    stderr.print(text, markup=False, soft_wrap=True)


def _emit(document: Any) -> None:
    json.dump(document, sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


def _show_version(asked: bool) -> None:
    if asked:
        from . import __version__

        typer.echo(f"layerfit {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Fit layered materials to reference renders and get a verified shader back."""


@app.command()
def fit(
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the results.")] = Path("out"),
    starts: Annotated[
        int | None, typer.Option(min=1, help="Starts that are tried; more find a global minimum more surely.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of starts and pixel choices.")] = None,
    metric: Annotated[str | None, typer.Option(help="law, uniform, relative, log or cube_root.")] = None,
    loss: Annotated[str | None, typer.Option(help="square, huber or cauchy.")] = None,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            "--profile",
            help="Parameter whose 95 % interval is found by fitting the others again, such as coat.tau; may be repeated.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Fit a material to a reference render or a measured BRDF.

    Leaves `fit.json`, `preset.json`, `material.frag`, `report.html`, `fit.png` and `trace.csv` in the output directory.

    Example: `layerfit fit examples/references/lacquered_copper.toml -o out/copper`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .capture.scene import LOSSES, METRICS
    from .job import fit_scene

    imported = time.perf_counter() - STARTED
    _check_choice(loss, LOSSES, "--loss")
    _check_choice(metric, METRICS, "--metric")
    with _progress() as report:
        outcome = fit_scene(
            scene,
            output,
            import_s=imported,
            progress=report,
            profile=profile or (),
            starts=starts,
            seed=seed,
            metric=metric,
            loss=loss,
        )
    _show_fit(outcome, as_json)
    raise typer.Exit(0 if outcome.good else 1)


def _check_choice(value: str | None, known: tuple[str, ...], option: str) -> None:
    if value is not None and value not in known:
        raise typer.BadParameter(f"{value!r} is not {', '.join(known[:-1])} or {known[-1]}", param_hint=option)


def _show_fit(outcome: Any, as_json: bool) -> None:
    from .report.text import lines

    for line in lines(outcome.document):
        _say(line)
    _say(f"Wrote fit.png, report.html, material.frag, preset.json, fit.json and trace.csv in {outcome.directory}/")
    if as_json:
        _emit(outcome.document)


class _progress:
    """A bar on standard error while a fit runs; nothing where that is not a terminal."""

    def __enter__(self) -> Any:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self.bar = Progress(
            TextColumn("{task.description:>8}"),
            BarColumn(),
            TimeElapsedColumn(),
            console=stderr,
            transient=True,
            disable=not stderr.is_terminal,
        )
        self.bar.start()
        self.task = self.bar.add_task("reading", total=1.0)
        return lambda stage, share: self.bar.update(self.task, description=stage, completed=share)

    def __exit__(self, *exc: object) -> None:
        self.bar.stop()


@app.command()
def structures(
    reference: Annotated[Path, typer.Argument(help="Scene file, or a measured BRDF: .brdf, .bsdf, .binary or .csv.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the results.")] = Path("out"),
    only: Annotated[str | None, typer.Option(help="Names of structures to try, with commas; left out, all.")] = None,
    metric: Annotated[str, typer.Option(help="law, uniform, relative, log or cube_root.")] = "log",
    min_half_deg: Annotated[
        float, typer.Option(min=0.0, max=89.0, help="Of a measured BRDF: leave out what is nearer to the mirror direction.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of starts and pixel choices.")] = 0,
    as_json: Json = False,
) -> None:
    """Find out which structure a reference supports: fit candidates, and choose the simplest that explains it.

    Leaves `structures.json` and `structures.png` in the output directory, beside what a fit of the chosen one leaves. Exit code 1: it
    does not explain the reference, or its fit has findings.

    Example: `layerfit structures paint.bsdf -o out/paint`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .capture.scene import METRICS
    from .report.structures import table
    from .structures import structures_of

    _check_choice(metric, METRICS, "--metric")
    names = None if only is None else [name.strip() for name in only.split(",")]
    with _progress() as report:
        outcome = structures_of(
            reference, output, structures=names, metric=metric, seed=seed, min_half_deg=min_half_deg, progress=report
        )
    stderr.print(table(outcome.document))
    for sentence in outcome.document["in_words"]:
        _say(sentence)
    _say(
        f"Wrote structures.png and structures.json in {output}/, and of the fit fit.png, report.html, preset.json and fit.json"
    )
    if as_json:
        _emit(outcome.document)
    raise typer.Exit(0 if outcome.good else 1)


@app.command()
def advise(
    scene: Scene,
    preset: Annotated[
        Path | None,
        typer.Option("--preset", help="The material to ask about, such as a fitted one; left out, the scene's start."),
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Directory for advice.json and advice.png.")] = None,
    as_json: Json = False,
) -> None:
    """Say what the images of a scene determine of its material, and which further light, camera or thickness would help most.

    Exit code 1: something that is free is not determined.

    Example: `layerfit advise examples/references/varnished_wood.toml -o out/advice`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .capture.scene import read_scene
    from .job import write_advice
    from .preset import read_preset
    from .report.advice import lines

    with _progress() as report:
        document = write_advice(read_scene(scene), None if preset is None else read_preset(preset), output, report)
    for line in lines(document):
        _say(line)
    if output is not None:
        _say(f"Wrote advice.png and advice.json in {output}/")
    if as_json:
        _emit(document)
    raise typer.Exit(0 if all(row["identifiable"] for row in document["parameters"].values()) else 1)


@app.command()
def render(
    preset: Preset,
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="Picture to write: .exr (linear) or .png.")],
) -> None:
    """Render a preset in place of a scene's reference: same camera and lights, wherever the object covers a pixel.

    Example: `layerfit render out/preset.json scene.toml -o copper.exr`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .capture.load import load
    from .capture.scene import read_scene
    from .job import write_render
    from .preset import read_preset

    written = write_render(read_preset(preset), load(read_scene(scene), 0.0), output)
    for path in written:
        typer.echo(str(path))


@app.command(name="eval")
def evaluate(
    preset: Preset,
    directions: Annotated[Path, typer.Argument(help="CSV with columns wi_x wi_y wi_z wo_x wo_y wo_z in the surface frame.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="CSV to write; left out, standard output.")] = None,
) -> None:
    """Evaluate the BRDF [1/sr] of a preset at pairs of directions, without the cosine: columns f_r, f_g, f_b.

    Example: `layerfit eval out/preset.json directions.csv -o values.csv`
    """
    from .documents import write_text
    from .preset import read_preset
    from .tabulate import evaluate_table

    text = evaluate_table(read_preset(preset), directions)
    if output is None:
        sys.stdout.write(text)
    else:
        write_text(output, text)
        _say(f"Wrote {output}")


@app.command()
def export(
    preset: Preset,
    target: Annotated[str, typer.Option(help="glsl330 or essl300.")] = "glsl330",
    uniforms: Annotated[
        bool, typer.Option("--uniforms", help="Parameters as uniforms, for live tuning, not as constants.")
    ] = False,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Shader to write; left out, standard output.")] = None,
) -> None:
    """Print the shader of a preset.

    Example: `layerfit export out/preset.json --target essl300 -o copper.frag`
    """
    from .documents import nearest, write_text
    from .errors import InputError
    from .preset import read_preset
    from .shader.export import HEADERS, print_material

    if target not in HEADERS:
        raise InputError(f"--target {target}: should be one of {', '.join(HEADERS)}{nearest(target, HEADERS)}")
    text = print_material(read_preset(preset), preset.stem, uniforms).text(target)
    if output is None:
        sys.stdout.write(text)
    else:
        write_text(output, text)
        _say(f"Wrote {output}")


@app.command()
def verify(
    preset: Preset,
    scene: Annotated[Path | None, typer.Argument(help="Scene file: also compare pixels with its references.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Directory for the picture strip.")] = None,
    as_json: Json = False,
    fail: Annotated[float | None, typer.Option(help="Relative difference from JAX that p99.9 of the values may have.")] = None,
    hardfail: Annotated[float | None, typer.Option(help="Relative difference from JAX that any value may have.")] = None,
) -> None:
    """Render the printed shader of a preset in OpenGL and compare it with JAX, number by number, and with references.

    Example: `layerfit verify out/preset.json scene.toml -o out`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .job import verify_preset
    from .preset import read_preset
    from .report.text import image_error, relative, verdict, worst

    document, picture = verify_preset(read_preset(preset), preset.stem, scene, output, fail, hardfail)
    parity = document["parity"]
    _say(f"Drawn by {document['renderer']}")
    most, usual = relative(parity["max_rel"]), relative(parity["p999_rel"])
    _say(f"shader against JAX: max {most}, p99.9 {usual} relative, {parity['values']} values")
    _say(f"worst value: {worst(parity['worst'])}")
    if document["image"]:
        _say(f"shader against reference: {image_error(document['image'])}")
    if picture:
        _say(f"Wrote {picture}")
    _say(verdict(document))
    if as_json:
        _emit(document)
    raise typer.Exit(0 if document["passed"] else 1)


@app.command()
def truth(
    preset: Preset,
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the results.")] = Path("out"),
    interface: Annotated[
        str | None, typer.Option(help="single or multi: what a rough interface does; left out, as in the preset, else single.")
    ] = None,
    paths: Annotated[
        int | None, typer.Option(min=100, max=10_000_000, help="Paths for every pair of directions; left out, for 0.5 % noise.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**31, help="Seed of the random walk.")] = 0,
    as_json: Json = False,
) -> None:
    """Compare the closed forms with a random walk through the layers: where each can be trusted, for this material.

    Leaves `truth.json` and `truth.png` in the output directory. Exit code 1: the preset's own form is more than 10 % off in the median.

    Example: `layerfit truth lacquered_copper -o out/copper`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .preset import read_preset
    from .report.truth import table
    from .truth import truth_of_preset

    stack = read_preset(preset)
    with _progress() as report:
        document = truth_of_preset(stack, preset.stem, output, interface=interface, paths=paths, seed=seed, progress=report)
    stderr.print(table(document))
    _say(document["in_a_sentence"])
    _say(f"Wrote truth.png and truth.json in {output}/")
    if as_json:
        _emit(document)
    raise typer.Exit(0 if document["trusted"] else 1)


@app.command()
def presets(
    word: Annotated[
        str,
        typer.Argument(help="Part of a name, group, structure or description: copper, wood, flakes. Left out: all of them."),
    ] = "",
    as_json: Json = False,
) -> None:
    """List the presets that ship: found by name wherever a preset is asked for.

    Example: `layerfit presets copper`
    """
    from .errors import InputError
    from .shipped import shipped_presets

    found = shipped_presets(word)
    if not found:
        raise InputError(f"no shipped preset has {word!r} in its name or description; `layerfit presets` lists all of them")
    if as_json:
        _emit([{**vars(preset), "path": str(preset.path)} for preset in found])
        return
    width = max(len(preset.name) for preset in found)
    for group, members in itertools.groupby(found, lambda preset: preset.group):
        typer.echo(group)
        for preset in members:
            typer.echo(f"  {preset.name:<{width}}  {preset.description}")


@app.command()
def metal(
    name: Annotated[
        str | None, typer.Argument(help="Name, symbol or page: copper, Cu, Cu/McPeak. Left out: a list of names.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Print `eta` and `k` of a metal in three channels, from its measured optical constants, for a preset or a scene.

    Example: `layerfit metal copper`
    """
    from .optics.metals import metal as find_metal, metal_names
    from .preset import rounded

    if name is None:
        names = metal_names()
        if as_json:
            _emit(names)
        else:
            typer.echo("".join(f"{word:<12} {page}\n" for word, page in names.items()), nl=False)
        return
    found = find_metal(name)
    document = {key: rounded(getattr(found, key)) for key in ("eta", "k", "f0")}
    if as_json:
        _emit({"name": name, **document, "source": found.source, "max_error": found.max_error, "delta_e": found.delta_e})
        return
    typer.echo("".join(f"{key} = {document[key]}\n" for key in ("eta", "k")), nl=False)
    _say(f"reflectance at normal incidence {document['f0']}, linear Rec.709 of the spectrum under D65")
    _say(f"three channels instead of the spectrum: off by at most {found.max_error:.2g}, delta E 2000 {found.delta_e:.2g}")
    _say(f"from {found.source}")


@app.command()
def inspect(
    file: Annotated[Path, typer.Argument(help="EXR file, or a measured BRDF: .brdf, .bsdf, .binary or .csv.")],
    as_json: Json = False,
) -> None:
    """Say what a file holds, what a fit would use of it and why, and what looks wrong: of an EXR, or of a measured BRDF.

    Example: `layerfit inspect render.exr`
    """
    from .capture.inspect import inspect as inspect_file

    found = inspect_file(file)
    if as_json:
        _emit(found.to_json())
    else:
        Console(highlight=False).print(found.render())
    raise typer.Exit(1 if any(finding.severity == "warning" for finding in found.findings) else 0)


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the results.")] = Path("out/demo"),
) -> None:
    """Fit the references that layerfit ships, verify their shaders, and say where the pictures are.

    Example: `layerfit demo -o out/demo`
    """
    from .cache import use_compilation_cache

    use_compilation_cache()
    from .demo import run

    with _progress() as report:
        good = run(output, stderr, report)
    raise typer.Exit(0 if good else 1)
