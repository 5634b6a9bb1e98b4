"""Materials live in a notebook: the viewer of the report page, whose parameters are Python's too."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import MachineError
from ..fit.result import FitResult, parameters
from ..preset import read_preset
from ..stack import Stack

if TYPE_CHECKING:
    from .widget import Widget


def live(material: Stack | FitResult | str | Path, name: str | None = None) -> "Widget":
    """A material live in a notebook, drawn by its exported shader, with a slider for every parameter.

    `material` is a stack, the result of a fit (its sigmas are marked) or a preset, by file or name. What is returned shows itself in
    JupyterLab, VS Code and what else shows widgets. `widget.values` are the numbers of the sliders, by "layer.field": move a slider, and
    they change; set them, or one as `widget["lacquer.alpha"] = 0.3`, and the picture does. `widget.observe(f, "values")` calls `f` then;
    `widget.material` is the stack with these values. Raises `InputError` for a name or a value that the material does not have, and
    `MachineError` without the extra `notebook`.
    """
    try:
        from .widget import Widget
    except ModuleNotFoundError as error:
        if error.name != "anywidget":
            raise
        raise MachineError("a live material needs the package anywidget: pip install 'layerfit[notebook]'") from None
    if isinstance(material, FitResult):
        return Widget(material.stack, name or "fit", parameters(material))
    if isinstance(material, Stack):
        return Widget(material, name or "material")
    return Widget(read_preset(material), name or Path(material).stem)
