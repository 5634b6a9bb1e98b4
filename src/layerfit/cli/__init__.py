"""The command line. Heavy modules are imported where a command needs them: `layerfit --help` answers at once."""

from . import fitting, mapping, evaluation, shaders, blender, judging, listing  # noqa: I001  in this order they stand in `layerfit --help`
from .app import app, main

__all__ = ["app", "blender", "evaluation", "fitting", "judging", "listing", "main", "mapping", "shaders"]
