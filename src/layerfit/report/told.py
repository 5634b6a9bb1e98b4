"""Documents that show themselves."""

import io
from collections.abc import Mapping
from typing import Any

WIDTH = 120
"""Letters in a line."""


class Told(dict[str, Any]):
    """The document of a study: a dictionary that shows itself in a notebook as its command does in a terminal."""

    def __init__(self, document: Mapping[str, Any], *shown: Any) -> None:
        super().__init__(document)
        self._shown = shown
        """Tables and sentences, of rich."""

    def _repr_html_(self) -> str:
        from rich.console import Console

        console = Console(record=True, file=io.StringIO(), width=WIDTH, highlight=False)
        for part in self._shown:
            console.print(part, markup=False)
        return console.export_html(inline_styles=True, code_format="<pre>{code}</pre>")
