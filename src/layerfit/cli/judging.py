"""Commands that judge models: `truth` by the random walk, `tradeoff` what accuracy costs, `specialise` what a scene does not need,
`stability` float32 at every corner."""

from pathlib import Path
from typing import Annotated

import typer

from ..stability.effort import Effort
from .app import Force, Output, Preset, Scene, command
from .talk import Done, progress, say, show

CORNERS = 65536
"""Corners of a structure's ranges that are tried at most."""


@command()
def truth(
    preset: Preset,
    output: Output = Path("out"),
    interface: Annotated[
        str | None, typer.Option(help="single or multi: what a rough interface does; left out, as in the preset, else single.")
    ] = None,
    paths: Annotated[
        int | None, typer.Option(min=100, max=10_000_000, help="Paths for every pair of directions; left out, for 0.5 % noise.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**31, help="Seed of the random walk.")] = 0,
) -> Done:
    """Compare a preset's form with the random walk.

    Paths of light through its layers are the truth; each closed form is held against them.

    Leaves `truth.json` and `truth.png` in the output directory. Exit code 1: the preset's own form is more than 10 % off in the median.

    Examples:
        layerfit truth lacquered_copper -o out/copper
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..preset import read_preset
    from ..report.truth import table
    from ..truth import truth_of_preset

    stack = read_preset(preset)
    with progress() as report:
        document = truth_of_preset(stack, preset.stem, output, interface=interface, paths=paths, seed=seed, progress=report)
    show(table(document))
    say(document["in_a_sentence"])
    say(f"Wrote truth.png and truth.json in {output}/")
    return Done(document, ("tradeoff", preset, "-o", output), document["trusted"])


@command()
def tradeoff(
    preset: Preset,
    scene: Annotated[
        Path | None, typer.Argument(help="Scene file: errors are seen on its pixels, and fits are to its references.")
    ] = None,
    output: Output = Path("out"),
    lights: Annotated[int, typer.Option(min=1, max=8, help="Lights under which shaders are timed.")] = 1,
    rounds: Annotated[int, typer.Option(min=3, help="Rounds in which all shaders, and Phong, are timed.")] = 30,
    paths: Annotated[
        int | None,
        typer.Option(min=100, max=10_000_000, help="Paths of the random walk for every pair; left out, for 0.5 % noise."),
    ] = None,
    fits: Annotated[bool, typer.Option("--fits/--no-fits", help="Whether fits are timed too: minutes.")] = True,
) -> Done:
    """Measure error against run time, of shaders and of fits.

    Of the shaders that a preset can have, against itself and the random walk; and of fits of it.

    Leaves `tradeoff.json`, `tradeoff.csv`, `tradeoff.png` and `tradeoff.html` in the output directory. Interrupted, it
    goes on from there when it is asked again.

    Examples:
        layerfit tradeoff lacquered_copper --no-fits -o out/copper
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..report.tradeoff import tables
    from ..tradeoffs import tradeoff as measure

    with progress() as report:
        document = measure(preset, scene, output, lights=lights, rounds=rounds, paths=paths, fit=fits, progress=report)
    for table in tables(document):
        show(table)
    for sentence in document["in_words"]:
        say(sentence)
    say(f"Wrote tradeoff.html, tradeoff.png, tradeoff.csv and tradeoff.json in {output}/")
    return Done(document, ("export", preset, "--max-error", "0.01"))


def _part(given: str | float) -> float:
    """0.005, or 0.5%; typer sends what the option has by default here too."""
    text = str(given)
    try:
        return float(text[:-1]) / 100.0 if text.endswith("%") else float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a part, such as 0.5% or 0.005") from None


@command()
def specialise(
    preset: Preset,
    scene: Scene,
    output: Output = Path("out"),
    tolerance: Annotated[
        float, typer.Option(parser=_part, metavar="PART", help="By how much the error of the image may grow: 0.5% or 0.005.")
    ] = 0.005,
    force: Force = False,
) -> Done:
    """Leave out what one scene does not need of a material.

    Part by part, and the rest is fitted again. Leaves `preset.json`, `material.frag`, `specialise.json` and `specialise.html` in the output
    directory. Exit code 1: the shader is not the material.

    Examples:
        layerfit specialise lacquered_copper examples/references/lacquered_copper.toml --tolerance 0.5% -o out/copper
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..report.specialise import table
    from ..report.text import not_written
    from ..specialising import specialise as reduce

    with progress() as report:
        document = reduce(preset, scene, output, tolerance=tolerance, force=force, progress=report)
    show(table(document))
    for sentence in document["in_words"]:
        say(sentence)
    shader = document["parity"]["passed"] or force
    say(f"Wrote preset.json, {'material.frag, ' if shader else ''}specialise.html and specialise.json in {output}/")
    if not shader:
        say(not_written(document["parity"]))
    return Done(document, ("verify", output / "preset.json", scene), document["parity"]["passed"])


@command()
def stability(
    word: Annotated[
        str, typer.Argument(help="Part of the name of structures: precise, conductor, patina. Left out: all of them.")
    ] = "",
    output: Output = Path("out"),
    corners: Annotated[
        int, typer.Option(min=2, max=CORNERS, help="Corners of the ranges of a structure, at most.")
    ] = Effort.corners,
    seed: Annotated[int, typer.Option(min=0, max=2**31, help="Seed of the corners that are drawn.")] = Effort.seed,
    shaders: Annotated[bool, typer.Option(help="Draw the printed shaders too.")] = Effort.shaders,
    digits: Annotated[
        int, typer.Option(min=0, max=1000, help="Materials of a structure that are compared with 50 digits (they need mpmath).")
    ] = Effort.digits,
    tiers: Annotated[
        int, typer.Option(min=0, max=2, help="Materials of a structure whose compact tier and tables are made.")
    ] = Effort.tiers,
) -> Done:
    """Try every structure at the corners of its ranges, in float32.

    Directions are grazing, normal, mirror and retro. Values and derivatives in float32 are compared with float64, with 50 digits and with
    the printed shader. Leaves `stability.json`, `stability.md` and a heat map for each structure in the output directory. Interrupted, it
    goes on from there when it is asked again. Exit code 1: something is not finite, jumps, or has lost its digits.

    Examples:
        layerfit stability "form qualitative" -o out/stability
    """
    from ..report.stability import table
    from ..stability.sweep import stability_of

    effort = Effort(corners, shaders, digits, tiers, seed)
    with progress() as report:
        document = stability_of(output, word, effort=effort, progress=report)
    show(table(document))
    say(f"Wrote stability.json, stability.md and heat/ in {output}/")
    words = (word,) if word else ()
    return Done(document, ("stability", *words, "--corners", min(8 * corners, CORNERS), "-o", output), document["good"])
