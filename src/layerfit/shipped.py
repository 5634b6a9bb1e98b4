"""The presets that ship: where they are, and what each says of itself. Their numbers are read by `preset`."""

import base64
import dataclasses
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from ._data import shaders
from .documents import nearest, read_document
from .errors import InputError

WORDS = ("group", "description", "source")
"""Keys of a preset that are for people: what it is listed under, what it is in a line, and where its values are from."""

GROUPS = ("car paint", "paint and enamel", "wood", "metal", "thin film", "patina and wear", "stone and ceramic")
"""What presets are listed under, in this order."""


@dataclasses.dataclass(frozen=True)
class Shipped:
    """A preset that ships, in words."""

    name: str
    group: str
    description: str
    source: str
    """Where its values are from, and which of them are chosen by eye."""
    structure: str
    """Its layers, outermost first, and the form that it is evaluated in."""
    path: Path
    """The JSON document. Beside it lie the printed shader, `.frag`, and its picture, `.png`."""

    @property
    def picture(self) -> str:
        """The picture beside the document, as HTML that holds it."""
        content = base64.b64encode(self.path.with_suffix(".png").read_bytes()).decode()
        return f'<img alt="" src="data:image/png;base64,{content}">'

    def _repr_html_(self) -> str:
        """For notebooks: its picture, and what it says of itself."""
        words = "<br>".join(escape(line) for line in (self.description, self.structure, self.source))
        return f"<p><b>{escape(self.name)}</b><br>{self.picture}<br>{words}</p>"


def shipped_presets(word: str = "") -> list[Shipped]:
    """The presets that ship, by group and name; with a `word`, those that have it, or all of several, in what
    they say of themselves.

    `read_preset(name)` gives the material of one.
    """
    found = [_described(path) for path in (shaders() / "presets").glob("*.json")]
    found = [one for one in found if all(part in _text(one).casefold() for part in word.casefold().split())]
    return sorted(found, key=lambda one: (GROUPS.index(one.group), one.name))


def find_preset(path: Path) -> Path:
    """Where a preset is: a name without an ending that is no file here may be that of a shipped one."""
    if path.suffix or path.exists():
        return path
    folder = shaders() / "presets"
    names = sorted(file.stem for file in folder.glob("*.json"))
    if path.name not in names:
        raise InputError(
            f"{path}: there is no such file, and no shipped preset of that name{nearest(path.name, names)}. "
            "`layerfit presets` lists those that ship."
        )
    return folder / f"{path.name}.json"


def check_not_preset(path: Path) -> None:
    """Raise `InputError` where the name of a shipped preset stands for a scene file."""
    if not path.suffix and not path.exists() and (shaders() / "presets" / f"{path.name}.json").is_file():
        raise InputError(
            f"{path}: is a preset that ships, not a scene file. A scene starts from it by `--start {path.name}`, or by a preset in its [material]."
        )


def _described(path: Path) -> Shipped:
    document = read_document(path)
    words = {key: document[key] for key in ("name", *WORDS)}
    return Shipped(**words, structure=_structure(document), path=path)


def _structure(document: Mapping[str, Any]) -> str:
    layers = " over ".join(_layer(layer) for layer in (*document["layers"], document["base"]))
    return f"{layers}, {document['model']}"


def _layer(document: Mapping[str, Any]) -> str:
    return f"{document['type']} with a film" if "film_nm" in document else document["type"]


def _text(preset: Shipped) -> str:
    return " ".join((preset.name, preset.group, preset.description, preset.structure))
