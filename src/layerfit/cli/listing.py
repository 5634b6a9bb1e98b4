"""Commands that look things up: `presets`, `gallery`, `metal` and `inspect`; `demo`, which shows what the program does, and `doctor`."""

import itertools
from pathlib import Path
from typing import Annotated, Any

import typer

from .._data import references
from .app import Output, command
from .talk import Done, progress, say, tell, tell_table


@command()
def presets(
    word: Annotated[
        str,
        typer.Argument(
            help="Part of a name, group, structure or description, or several in quotes: copper, 'clear coat'. Left out: all of them."
        ),
    ] = "",
) -> Done:
    """List the presets that ship.

    Each is found by its name wherever a preset is asked for.

    Examples:
        layerfit presets copper
    """
    found = _found(word)
    width = max(len(preset.name) for preset in found)
    for group, members in itertools.groupby(found, lambda preset: preset.group):
        tell(f"{group}\n")
        for preset in members:
            tell(f"  {preset.name:<{width}}  {preset.description}\n")
    return Done([{**vars(preset), "path": str(preset.path)} for preset in found], ("view", found[0].name))


def _found(word: str) -> list[Any]:
    from ..documents import nearest
    from ..errors import InputError
    from ..shipped import shipped_presets

    if found := shipped_presets(word):
        return found
    words = {word for preset in shipped_presets() for word in preset.name.split("_")}
    raise InputError(
        f"no shipped preset has {word!r} in its name or description{nearest(word, words)}; `layerfit presets` lists all of them"
    )


@command()
def gallery(
    word: Annotated[str, typer.Argument(help="Part of a name, group, structure or description. Left out: all of them.")] = "",
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the page.")] = Path("out/gallery"),
) -> Done:
    """Show the presets that ship as a page of live previews.

    Leaves `index.html` in the output directory: one file that makes no request.

    Examples:
        layerfit gallery wood -o out/gallery
    """
    from ..documents import check_directory, write_text
    from ..report.gallery import page

    found = _found(word)
    check_directory(output)
    write_text(output / "index.html", page(found))
    say(f"Wrote {output / 'index.html'}: {len(found)} materials; open it in a browser")
    names = [preset.name for preset in found]
    return Done({"written": str(output / "index.html"), "presets": names}, ("view", names[0]))


@command()
def metal(
    name: Annotated[
        str | None, typer.Argument(help="Name, symbol or page: copper, Cu, Cu/McPeak. Left out: a list of names.")
    ] = None,
) -> Done:
    """Print `eta` and `k` of a metal in three channels.

    From its measured optical constants, for a preset or a scene.

    Examples:
        layerfit metal copper
        layerfit metal Cu/McPeak
    """
    from ..optics.metals import metal as find_metal, metal_names
    from ..preset import rounded

    if name is None:
        names = metal_names()
        tell("".join(f"{word:<12} {page}\n" for word, page in names.items()))
        return Done(names, ("metal", "copper"))
    found = find_metal(name)
    document = {key: rounded(getattr(found, key)) for key in ("eta", "k", "f0")}
    tell("".join(f"{key} = {document[key]}\n" for key in ("eta", "k")))
    say(f"reflectance at normal incidence {document['f0']}, linear Rec.709 of the spectrum under D65")
    say(f"three channels instead of the spectrum: off by at most {found.max_error:.2g}, delta E 2000 {found.delta_e:.2g}")
    say(f"from {found.source}")
    document |= {"source": found.source, "max_error": found.max_error, "delta_e": found.delta_e}
    return Done({"name": name, **document}, ("presets", "metal"))


@command()
def inspect(
    file: Annotated[Path, typer.Argument(help="EXR file, or a measured BRDF: .brdf, .bsdf, .binary or .csv.")],
) -> Done:
    """Say what a file holds, what a fit would use, what is wrong.

    Of an EXR, or of a measured BRDF. Exit code 1: something looks wrong.

    Examples:
        layerfit inspect render.exr
    """
    from ..capture.inspect import inspect as inspect_file

    found = inspect_file(file)
    tell_table(found.render())
    measured = file.suffix.lower() != ".exr"
    good = not any(finding.severity == "warning" for finding in found.findings)
    if not measured and not file.with_suffix(".toml").exists():
        say(
            f"A fit needs a scene file, which says camera, lights and material, such as {references() / 'lacquered_copper.toml'}"
        )
    return Done(found.to_json(), ("structures", file) if measured else ("fit", file.with_suffix(".toml")), good)


@command()
def demo(
    output: Output = Path("out/demo"),
) -> Done:
    """Fit the references that ship, and verify their shaders.

    Says where the pictures are.

    Examples:
        layerfit demo -o out/demo
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..demo import run

    with progress() as report:
        outcomes = run(output, say, report)
    documents = {name: outcome.document for name, outcome in outcomes.items()}
    first = next(iter(outcomes.values())).directory
    return Done(documents, ("view", first / "preset.json"), all(outcome.good for outcome in outcomes.values()))


@command()
def doctor() -> Done:
    """Say what is installed and what this machine can do.

    And what each missing thing would give, with the command that gets it. Exit code 0: the main job can be done: fit, print, verify. 1:
    something that it needs is missing.

    Examples:
        layerfit doctor
    """
    from ..doctor import examine

    found = examine()
    for line in found.lines():
        tell(f"{line}\n")
    then = ("demo",) if found.good else ()  # else its lines name the commands that get what is missing
    return Done(found.to_json(), then, found.good)
