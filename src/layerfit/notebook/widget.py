"""The viewer of the pages as an anywidget (https://anywidget.dev), one module for every kind of notebook. The only file that imports it."""

from collections.abc import Mapping
from typing import Any

import anywidget  # pyright: ignore[reportMissingImports]  # an extra
import numpy as np
import traitlets  # pyright: ignore[reportMissingImports]  # comes with it

from ..errors import InputError
from ..fit.parameters import with_fixed
from ..report import pages, viewer
from ..stack import Stack


class Widget(anywidget.AnyWidget):
    """A live material; `live` makes one."""

    _esm = pages.module("widget.js")
    _material = traitlets.Bytes().tag(sync=True)
    values = traitlets.Dict().tag(sync=True)
    """Numbers by "layer.field": one, or three of a colour."""

    def __init__(self, stack: Stack, name: str, fitted: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        data = viewer.live(stack, name, fitted)
        self._stack = stack
        self._channels = {row["name"]: len(row["value"]) for row in data["parameters"]}
        values = {row["name"]: row["value"] if len(row["value"]) > 1 else row["value"][0] for row in data["parameters"]}
        super().__init__(_material=pages.packed(pages.as_json(data)), values=values)

    @property
    def material(self) -> Stack:
        """The material with the numbers of the sliders."""
        return with_fixed(self._stack, self.values, "live")

    def _repr_html_(self) -> str:
        """For what shows no widgets, beside the widget: notebooks read where they are not run."""
        return self.material._repr_html_()

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def __setitem__(self, name: str, value: Any) -> None:
        self.values = self.values | {name: value}

    @traitlets.validate("values")
    def _known(self, proposal: Mapping[str, Any]) -> dict[str, Any]:
        """All numbers, as lists and floats; those that are not given stay. Raises `InputError` for what the material does not have."""
        asked = {name: np.asarray(value).tolist() for name, value in proposal["value"].items()}
        with_fixed(self._stack, asked, "live")
        return self.values | {name: self._spread(name, value) for name, value in asked.items()}

    def _spread(self, name: str, value: Any) -> Any:
        """A number for all channels that the picture has of it."""
        channels = self._channels[name]
        if isinstance(value, list):
            if channels == 1:
                raise InputError(f"live: {name} = {value}: is one number here, as it is in the material that was given")
            return value
        return value if channels == 1 else [value] * channels
