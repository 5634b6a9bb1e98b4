"""Commands that look things up: `presets`, `metal` and `inspect`; and `demo`, which shows what the program does."""

import itertools
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from .app import Json, Output, app, emit, progress, say, stderr


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
    found = _found(word)
    if as_json:
        emit([{**vars(preset), "path": str(preset.path)} for preset in found])
        return
    width = max(len(preset.name) for preset in found)
    for group, members in itertools.groupby(found, lambda preset: preset.group):
        typer.echo(group)
        for preset in members:
            typer.echo(f"  {preset.name:<{width}}  {preset.description}")


def _found(word: str) -> list[Any]:
    from ..errors import InputError
    from ..shipped import shipped_presets

    if found := shipped_presets(word):
        return found
    raise InputError(f"no shipped preset has {word!r} in its name or description; `layerfit presets` lists all of them")


@app.command()
def gallery(
    word: Annotated[str, typer.Argument(help="Part of a name, group, structure or description. Left out: all of them.")] = "",
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the page.")] = Path("out/gallery"),
) -> None:
    """Show the presets that ship as a page of live previews, drawn by their shaders.

    Leaves `index.html` in the output directory: one file that makes no request.

    Example: `layerfit gallery wood -o out/gallery`
    """
    from ..documents import check_directory, write_text
    from ..report.gallery import page

    found = _found(word)
    check_directory(output)
    write_text(output / "index.html", page(found))
    say(
        f"Wrote {output / 'index.html'}: {len(found)} materials; open it in a browser, and one of them with `layerfit view {found[0].name}`"
    )


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
    from ..optics.metals import metal as find_metal, metal_names
    from ..preset import rounded

    if name is None:
        names = metal_names()
        if as_json:
            emit(names)
        else:
            typer.echo("".join(f"{word:<12} {page}\n" for word, page in names.items()), nl=False)
        return
    found = find_metal(name)
    document = {key: rounded(getattr(found, key)) for key in ("eta", "k", "f0")}
    if as_json:
        emit({"name": name, **document, "source": found.source, "max_error": found.max_error, "delta_e": found.delta_e})
        return
    typer.echo("".join(f"{key} = {document[key]}\n" for key in ("eta", "k")), nl=False)
    say(f"reflectance at normal incidence {document['f0']}, linear Rec.709 of the spectrum under D65")
    say(f"three channels instead of the spectrum: off by at most {found.max_error:.2g}, delta E 2000 {found.delta_e:.2g}")
    say(f"from {found.source}")


@app.command()
def inspect(
    file: Annotated[Path, typer.Argument(help="EXR file, or a measured BRDF: .brdf, .bsdf, .binary or .csv.")],
    as_json: Json = False,
) -> None:
    """Say what a file holds, what a fit would use of it and why, and what looks wrong: of an EXR, or of a measured BRDF.

    Example: `layerfit inspect render.exr`
    """
    from ..capture.inspect import inspect as inspect_file

    found = inspect_file(file)
    if as_json:
        emit(found.to_json())
    else:
        Console(highlight=False).print(found.render())
    raise typer.Exit(1 if any(finding.severity == "warning" for finding in found.findings) else 0)


@app.command()
def demo(
    output: Output = Path("out/demo"),
) -> None:
    """Fit the references that layerfit ships, verify their shaders, and say where the pictures are.

    Example: `layerfit demo -o out/demo`
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..demo import run

    with progress() as report:
        good = run(output, stderr, report)
    raise typer.Exit(0 if good else 1)
