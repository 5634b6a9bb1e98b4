"""Commands about the shader of a material: `export` and `verify`."""

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from . import complete
from .app import Preset, command
from .talk import Done, finish, say, tell


@command()
def export(
    preset: Preset,
    target: Annotated[
        str | None,
        typer.Option(help="glsl330 or essl300, of WebGL2; left out, glsl330.", autocompletion=complete.targets),
    ] = None,
    uniforms: Annotated[
        bool, typer.Option("--uniforms", help="Parameters as uniforms, for live tuning, not as constants.")
    ] = False,
    tier: Annotated[
        str | None,
        typer.Option(help="exact (the default), compact, lazanyi, schlick, faithful or tables.", autocompletion=complete.tiers),
    ] = None,
    max_error: Annotated[
        float | None, typer.Option(help="Relative error against the exact form that is allowed: takes the cheapest tier.")
    ] = None,
    max_cost: Annotated[
        float | None, typer.Option(help="Instructions in times of Phong: takes the nearest tier within.")
    ] = None,
    entries: Annotated[
        int | None, typer.Option(help="Of the tables of --tier tables; left out, as many as --max-error takes, or 256.")
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(
            help="Another program's material in place of the shader: mtlx, gltf, blender, three or babylon.",
            autocompletion=complete.formats,
        ),
    ] = None,
    scene: Annotated[
        Path | None, typer.Option(help="With --to: scene file on whose references the loss is measured; left out, a sphere.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write; left out, standard output.")] = None,
) -> Done:
    """Print the shader of a preset, or another program's material.

    With `--to` the values are found with which that program comes nearest to the preset. What is lost is measured, said, and stored in
    the preset.

    Examples:
        layerfit export out/preset.json --target essl300 -o copper.frag
        layerfit export out/preset.json --max-error 0.01 -o cheap.frag
        layerfit export out/preset.json --to gltf -o copper.gltf
    """
    from ..documents import nearest
    from ..errors import InputError

    if to is not None:
        if uniforms or any(option is not None for option in (target, tier, max_error, max_cost, entries)):
            raise InputError(
                "--target, --uniforms, --tier, --max-error, --max-cost and --entries are of the shader: leave them out, or --to"
            )
        return _export_to(preset, to, scene, output)
    if scene is not None:
        raise InputError("--scene is for --to: a shader is the material, wherever it is seen")
    from ..preset import read_preset
    from ..shader.export import HEADERS, print_material

    target = target or "glsl330"
    if target not in HEADERS:
        raise InputError(f"--target {target}: should be one of {', '.join(HEADERS)}{nearest(target, HEADERS)}")
    stack = read_preset(preset)
    asked = tier is not None or max_error is not None or max_cost is not None
    if entries is not None and tier != "tables":
        raise InputError("--entries is for --tier tables, which alone has tables")
    if uniforms and asked:
        raise InputError("--uniforms goes with the exact form alone: leave out --tier, --max-error and --max-cost")
    if asked:
        shader, name, told = _tier(stack, preset.stem, tier, max_error, max_cost, entries)
        say(told)
    else:
        shader, name = print_material(stack, preset.stem, uniforms), "exact"
    text = shader.text(target)
    _write(text, output)
    document = {"name": shader.name, "target": target, "tier": name, "shader": text}
    return Done(document, ("verify", preset))


def _export_to(preset: Path, to: str, scene: Path | None, output: Path | None) -> Done:
    from ..cache import use_compilation_cache
    from ..documents import check_directory
    from ..interchange.formats import export_to, said

    use_compilation_cache()
    if output is not None:
        check_directory(output.parent)  # before the work
    made = export_to(preset, to, scene, output)
    for line in said(made, to):
        say(line)
    if output is None:
        tell(made.text)
    else:
        say(f"Wrote {output}")
    return Done(made.to_json() | {"to": to, "text": made.text}, ("view", preset))


def _write(text: str, output: Path | None) -> None:
    from ..documents import write_text

    if output is None:
        tell(text)
    else:
        write_text(output, text)
        say(f"Wrote {output}")


def _tier(stack: Any, name: str, tier: str | None, max_error: float | None, max_cost: float | None, entries: int | None) -> Any:
    """The shader of the tier that is asked for, its name, and what is said of it."""
    from ..errors import InputError
    from ..shader.choose import choose_tier
    from ..shader.export import print_material
    from ..tiers.tier import make_tier

    if tier is None:
        choice = choose_tier(stack, name, max_error, max_cost)
        return choice.shader, choice.tier.name, str(choice)
    if max_cost is not None:
        raise InputError("--max-cost chooses a tier: leave out --tier")
    made = make_tier(stack, cast(Any, tier), max_error, entries)
    told = f"{made.name}: within {made.error:.1e} of the exact form"
    if made.table_bytes:
        told += f", with tables of {made.table_bytes / 1000:.1f} kB"
    return print_material(made.stack, name), made.name, told


@command()
def verify(
    preset: Preset,
    scene: Annotated[Path | None, typer.Argument(help="Scene file: also compare pixels with its references.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Directory for the picture strip.")] = None,
    fail: Annotated[
        float | None,
        typer.Option(help="Relative difference from JAX that p99.9 of the values may have; left out, 1e-5."),
    ] = None,
    hardfail: Annotated[
        float | None, typer.Option(help="Relative difference from JAX that any value may have; left out, 5e-5.")
    ] = None,
) -> Done:
    """Render a preset's shader in OpenGL and compare it with JAX.

    Number by number; with a scene, pixels are compared with its references too. Exit code 1: the shader is not the material.

    Examples:
        layerfit verify out/preset.json scene.toml -o out
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..job import verify_preset
    from ..preset import read_preset
    from ..report.text import image_error, relative, verdict, worst

    document, picture = verify_preset(read_preset(preset), preset.stem, scene, output, fail, hardfail)
    parity = document["parity"]
    say(f"Drawn by {document['renderer']}")
    most, usual = relative(parity["max_rel"]), relative(parity["p999_rel"])
    say(f"shader against JAX: max {most}, p99.9 {usual} relative, {parity['values']} values")
    say(f"worst value: {worst(parity['worst'])}")
    if document["image"]:
        say(f"shader against reference: {image_error(document['image'])}")
    if picture:
        say(f"Wrote {picture}")
    say(verdict(document))
    then = ("export", preset, "-o", f"{preset.stem}.frag") if document["passed"] else ("doctor",)
    return Done(document, then, document["passed"])


@command()
def view(
    preset: Preset,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the page to this HTML file instead.")] = None,
    open_browser: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = True,
    window: Annotated[bool, typer.Option("--window", help="In a window of its own, without a browser.")] = False,
) -> Done:
    """Look at a preset live, with a slider for every parameter.

    Its exported shader draws in the browser. The page is served to this machine alone, until Ctrl+C; with `-o` it is a file to keep or to
    send. It can save the tuned preset. With `--window` (pip install 'layerfit[window]') a window has the same: drag, or move the sliders by
    keys.

    Examples:
        layerfit view lacquered_copper
        layerfit view out/preset.json -o copper.html
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..documents import write_text
    from ..errors import InputError
    from ..preset import read_preset
    from ..view import page, serve
    from ..window import show

    def ready(address: str) -> None:
        say(f"{preset.stem} is at {address} (Ctrl+C ends)")
        finish(Done({"address": address}, ("export", f"{preset.stem}.json")))

    if window:
        if output is not None:
            raise InputError("--output is for the page: leave it out, or --window")
        saved = show(read_preset(preset), preset.stem)
        return Done({"saved": [str(path) for path in saved]}, ("export", saved[-1]) if saved else ())
    text = page(read_preset(preset), preset.stem)
    if output is None:
        serve(text, ready, open_browser)
        return Done()
    write_text(output, text)
    say(f"Wrote {output}; open it in a browser")
    return Done({"written": str(output)}, ("export", preset))
