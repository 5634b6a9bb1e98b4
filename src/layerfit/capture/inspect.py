"""What a file holds, what is taken of it and why, and what is wrong with it: for people and for programs."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..documents import finite
from ..errors import InputError
from .channels import ROLES, Channels, resolve
from .checks import Finding, check
from .exr import Exr, read_exr
from .measured.inspect import MeasuredInspection, inspect_brdf
from .measured.read import is_measured, read_brdf

if TYPE_CHECKING:
    from rich.console import Group


@dataclass(frozen=True)
class Inspection:
    """A file, its roles (None where the resolver refuses, which is then the first finding) and the findings."""

    exr: Exr
    channels: Channels | None
    findings: list[Finding]

    def to_json(self) -> dict[str, Any]:
        """Plain values only; numbers that JSON has no word for (NaN, infinity) are None."""
        exr = self.exr
        return {
            "schema": "layerfit/inspect",
            "version": 1,
            "file": str(exr.path),
            "display_window": list(exr.display_window),
            "data_window": list(exr.data_window),
            "parts": [
                {"name": part.name, "kind": part.kind, "compression": part.compression, "data_window": list(part.data_window)}
                for part in exr.parts
            ],
            "channels": [
                {"name": name, "part": part, "type": kind, "min": low, "max": high, "not_finite": bad}
                for part, name, kind, low, high, bad in self._rows()
            ],
            "left_out": exr.left_out,
            "roles": None if self.channels is None else {role: self._role(self.channels, role) for role in ROLES},
            "findings": [asdict(finding) for finding in self.findings],
            "header": finite(exr.header),
        }

    def render(self) -> "Group":
        """Tables for a terminal: what is there, what is taken, what to know."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        # names are Text everywhere: as plain strings, rich would take brackets in them for markup
        def table(title: str, *headings: str) -> Table:
            made = Table(
                title=Text(title), title_justify="left", title_style="bold", header_style="dim", box=None, pad_edge=False
            )
            for heading in headings:
                made.add_column(
                    heading, overflow="fold", justify="right" if heading in ("min", "max", "not finite") else "left"
                )
            return made

        x0, y0, x1, y1 = self.exr.display_window
        parts = {part.name: f"{part.name} ({part.kind}, {part.compression})".strip() for part in self.exr.parts}
        there = table(
            f"{self.exr.path.name}: {x1 - x0 + 1} x {y1 - y0 + 1}", "channel", "part", "type", "min", "max", "not finite"
        )
        for part, name, kind, low, high, bad in self._rows():
            numbers = ["-" if value is None else f"{value:.5g}" for value in (low, high)]
            there.add_row(Text(name), Text(parts[part]), kind, *numbers, str(bad or ""))
        for name, why in self.exr.left_out.items():
            there.add_row(Text(name), Text("left out"), Text(why))
        blocks = [there]
        if self.channels is not None:
            taken = table("Taken", "role", "channels and why")
            for role in ROLES:
                taken.add_row(role, Text(self.channels.chosen[role]))
            blocks.append(taken)
        if self.findings:
            found = table("Findings", "", "what", "measured", "advice")
            for finding in self.findings:
                style = "yellow" if finding.severity == "warning" else ""
                found.add_row(Text(finding.severity, style), Text(finding.what), Text(finding.detail), Text(finding.advice))
            blocks.append(found)
        spaced = [item for block in blocks for item in (block, Text())]
        return Group(*spaced[:-1])

    def _rows(self) -> list[tuple[str, str, str, float | None, float | None, int]]:
        """Part, name, stored type, least and largest finite value and number of others, of each channel in the file's order."""
        rows = []
        for part in self.exr.parts:
            for name in part.channels:
                if name in self.exr.left_out:
                    continue
                values = self.exr.channels[name]
                finite = values[np.isfinite(values)]
                low, high = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
                rows.append((part.name, name, part.types[name], low, high, values.size - finite.size))
        return rows

    @staticmethod
    def _role(channels: Channels, role: str) -> dict[str, Any]:
        names = channels.names.get(role)
        return {"channels": None if names is None else list(names), "why": channels.chosen[role]}


def inspect(
    path: str | os.PathLike[str], overrides: Mapping[str, str] | None = None, eye: Sequence[float] | None = None
) -> Inspection | MeasuredInspection:
    """Read a file, resolve its channels and check them. `eye`, the camera's position, lets depth and facing be checked as well.

    What ends as a measured BRDF does is read as one, and has neither. Raises `InputError` for a file that cannot be read, and for
    overrides that it does not fit.
    """
    if is_measured(Path(path)):
        return inspect_brdf(read_brdf(Path(path)))
    exr = read_exr(path)
    try:
        channels = resolve(exr, overrides)
    except InputError as error:
        if overrides:
            raise
        # what the file holds is shown all the same: it is what the reader needs to say which channels are meant
        advice = "Say in the scene's [reference] which channels are meant."
        return Inspection(exr, None, [Finding("channels cannot be told", "warning", str(error), advice)])
    return Inspection(exr, channels, check(channels, exr, eye))
