"""Commands that evaluate a material: `render` and `eval`."""

import csv
import io
from pathlib import Path
from typing import Annotated

import typer

from .app import Preset, Scene, command
from .talk import Done, say, tell


@command()
def render(
    preset: Preset,
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="Picture to write: .exr (linear) or .png.")],
) -> Done:
    """Render a preset in place of a scene's reference: same camera and lights, wherever the object covers a pixel.

    Example: `layerfit render out/preset.json scene.toml -o copper.exr`
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..capture.load import load
    from ..capture.scene_file import read_scene
    from ..drawings import write_render
    from ..preset import read_preset

    written = write_render(read_preset(preset), load(read_scene(scene), 0.0), output)
    tell("".join(f"{path}\n" for path in written))
    names = [str(path) for path in written]
    return Done({"written": names}, ("inspect", names[0]) if written[0].suffix == ".exr" else ("view", preset))


@command("eval")
def evaluate(
    preset: Preset,
    directions: Annotated[Path, typer.Argument(help="CSV with columns wi_x wi_y wi_z wo_x wo_y wo_z in the surface frame.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="CSV to write; left out, standard output.")] = None,
) -> Done:
    """Evaluate the BRDF [1/sr] of a preset at pairs of directions, without the cosine: columns f_r, f_g, f_b.

    Example: `layerfit eval out/preset.json directions.csv -o values.csv`
    """
    from ..documents import write_text
    from ..preset import read_preset
    from ..tabulate import evaluate_table

    text = evaluate_table(read_preset(preset), directions)
    if output is None:
        tell(text)
    else:
        write_text(output, text)
        say(f"Wrote {output}")
    columns, *rows = csv.reader(io.StringIO(text))
    return Done({"columns": columns, "rows": [[float(value) for value in row] for row in rows]}, ("truth", preset))
