"""Commands that evaluate a material: `render` and `eval`."""

import csv
import io
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from . import complete
from .app import Preset, Scene, command
from .talk import Done, say, tell

Tier = Annotated[
    str,
    typer.Option(
        help="exact, compact, lazanyi, schlick, faithful or tables; or walk, the random walk.",
        autocompletion=complete.evaluated,
    ),
]
MaxError = Annotated[
    float | None, typer.Option(help="Of --tier compact or tables: relative error against the exact form that is allowed.")
]
Paths = Annotated[int | None, typer.Option(min=1, help="Of --tier walk, for each pair of directions: 4096 if left out.")]


def _tier(stack: Any, name: str, tier: str, max_error: float | None, paths: int | None) -> tuple[Any, Any]:
    """The material of a tier, and what evaluates it by the random walk; None where it evaluates itself."""
    from ..errors import InputError
    from ..tiers.tier import WALK, make_tier
    from ..walk import PATHS, walked

    if max_error is not None and tier == "exact":
        raise InputError("--max-error is for --tier compact or tables: the exact form has no error against itself")
    if tier != WALK:
        if paths is not None:
            raise InputError("--paths is for --tier walk: the other tiers walk none")
        return (stack if tier == "exact" else make_tier(stack, cast(Any, tier), max_error).stack), None
    if max_error is not None:
        raise InputError("--max-error is not for --tier walk, whose noise falls as --paths grow")
    return stack, lambda thick: walked(thick, name, PATHS if paths is None else paths)


@command()
def render(
    preset: Preset,
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="Picture to write: .exr (linear) or .png.")],
    tier: Tier = "exact",
    max_error: MaxError = None,
    paths: Paths = None,
) -> Done:
    """Render a preset with the camera and lights of a scene.

    The picture stands in place of the scene's reference, wherever its object covers a pixel.

    With `--tier` by another tier of the material; `walk` is the random walk through its layers, the truth, under point and distant lights.

    Examples:
        layerfit render out/preset.json scene.toml -o copper.exr
        layerfit render lacquered_copper scene.toml --tier walk -o truth.png
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..capture.load import load
    from ..capture.scene_file import read_scene
    from ..drawings import write_render
    from ..preset import read_preset

    stack, truth = _tier(read_preset(preset), preset.stem, tier, max_error, paths)
    written = write_render(stack, load(read_scene(scene), 0.0), output, truth)
    tell("".join(f"{path}\n" for path in written))
    names = [str(path) for path in written]
    return Done({"written": names}, ("inspect", names[0]) if written[0].suffix == ".exr" else ("view", preset))


@command("eval")
def evaluate(
    preset: Preset,
    directions: Annotated[Path, typer.Argument(help="CSV with columns wi_x wi_y wi_z wo_x wo_y wo_z in the surface frame.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="CSV to write; left out, standard output.")] = None,
    tier: Tier = "exact",
    max_error: MaxError = None,
    paths: Paths = None,
) -> Done:
    """Evaluate the BRDF of a preset at pairs of directions.

    Values are in 1/sr, without the cosine, in columns f_r, f_g, f_b.

    With `--tier walk` by the random walk through its layers, the truth, with standard errors in columns se_r, se_g, se_b.

    Examples:
        layerfit eval out/preset.json directions.csv -o values.csv
    """
    from ..documents import write_text
    from ..preset import read_preset
    from ..tabulate import evaluate_table

    stack, truth = _tier(read_preset(preset), preset.stem, tier, max_error, paths)
    text = evaluate_table(stack, directions, truth and truth(stack))
    if output is None:
        tell(text)
    else:
        write_text(output, text)
        say(f"Wrote {output}")
    columns, *rows = csv.reader(io.StringIO(text))
    return Done({"columns": columns, "rows": [[float(value) for value in row] for row in rows]}, ("truth", preset))
