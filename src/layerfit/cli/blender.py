"""The command for users of Blender: `blender-kit`."""

from pathlib import Path
from typing import Annotated

import typer

from .app import command
from .talk import Done, say


@command("blender-kit")
def blender_kit(
    output: Annotated[Path, typer.Option("--output", "-o", help="Script to write.")] = Path("layerfit_kit.py"),
) -> Done:
    """Write a script by which Blender renders a reference.

    It renders what a .blend holds, and writes its camera, lights and material to files beside the picture.
    `blender scene.blend --background --python layerfit_kit.py` then renders the active object, and says with which command it is fitted.

    Examples:
        layerfit blender-kit -o layerfit_kit.py
    """
    from ..documents import write_text
    from ..interchange.formats import blender_kit as script

    write_text(output, script())
    say(f"Wrote {output}")
    say(f"In Blender: blender scene.blend --background --python {output}")
    return Done({"script": str(output)}, ("fit", "NAME.toml", "--start", "NAME.principled.json"))
