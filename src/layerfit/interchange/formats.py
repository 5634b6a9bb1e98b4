"""What a material can be exported to and what a fit can start from: one row a format."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .. import preset as presets
from .._data import shaders
from ..documents import MAX_BYTES, nearest, read_bytes, read_document, write_text
from ..errors import InputError
from ..preset import SCHEMA as PRESET, preset_of, read_preset
from ..shipped import find_preset
from ..stack import Stack
from . import blender, gltf, materialx, openpbr, web
from .convert import Conversion, convert, mean_error
from .engine import Engine
from .mapping import stack_of
from .stage import samples, scene_views


@dataclasses.dataclass(frozen=True)
class Format:
    """One that is written."""

    dialect: str
    """Whose formula it is for."""
    ending: str
    """Of its files."""
    write: Callable[[Conversion], str]
    """The file's text."""
    drawn: Callable[[Conversion, str], dict[str, float] | None] = lambda found, text: None
    """The error of the program's own drawing of that text, where it is there to draw."""


def _by_materialx(found: Conversion, text: str) -> dict[str, float] | None:
    """That of the shader that MaterialX prints for a document, which it has validated; None without the extra."""
    if not materialx.is_here():
        return None
    fragment = materialx.shader(text)
    return mean_error(found.views, [materialx.radiance(fragment, samples(view)) for view in found.views])


FORMATS = {
    "mtlx": Format("openpbr", ".mtlx", openpbr.write, _by_materialx),
    "gltf": Format("gltf", ".gltf", gltf.write),
    "blender": Format("blender", ".py", blender.write),
    "three": Format("three", ".js", web.write_three),
    "babylon": Format("babylon", ".js", web.write_babylon),
}

MOST_BYTES = 16 * MAX_BYTES
"""Of a glTF file whose meshes are inside."""

READ = (".gltf", ".glb", ".mtlx", ".json")
"""Endings of what a fit can start from: materials of other programs, and presets."""


@dataclasses.dataclass(frozen=True)
class Export:
    """A material, exported."""

    text: str
    """The file."""
    conversion: Conversion
    drawn: dict[str, float] | None
    """The error of the other program's own drawing of it, where that could be had."""
    stored: bool
    """Whether the preset now says what was lost: a shipped one stays as it is."""

    def to_json(self) -> dict[str, Any]:
        """What a preset keeps of it."""
        return self.conversion.to_json() | ({} if self.drawn is None else {"error_drawn": self.drawn})


def export_to(preset: Path, name: str, scene: Path | None = None, output: Path | None = None) -> Export:
    """Convert the material of a preset file to a format, and store in that file what is lost: measured on a scene, or on a sphere.
    With an output, the file is written there, before the preset is told.

    Raises `InputError` for a format that is not there, and for what cannot be read, drawn or written.
    """
    if name not in FORMATS:
        raise InputError(f"--to {name}: should be one of {', '.join(FORMATS)}{nearest(name, FORMATS)}")
    chosen = FORMATS[name]
    if output is not None and output.suffix != chosen.ending and output.suffix in {other.ending for other in FORMATS.values()}:
        raise InputError(f"{output}: --to {name} writes a file that ends in {chosen.ending}")
    stack = read_preset(preset)
    found = convert(stack, identifier(preset.stem), chosen.dialect, None if scene is None else scene_views(scene))
    text = chosen.write(found)
    drawn = chosen.drawn(found, text)
    made = Export(text, found, drawn, False)
    if output is not None:
        write_text(output, text)
    return dataclasses.replace(made, stored=_store(find_preset(preset), name, made.to_json()))


def identifier(name: str) -> str:
    """A name that every format takes: letters, digits and underscores, the first a letter."""
    plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return plain if plain[:1].isalpha() else f"material_{plain}"


def _store(path: Path, name: str, loss: dict[str, Any]) -> bool:
    if path.resolve().is_relative_to(shaders().resolve()):
        return False
    document = read_document(path)
    losses = document.get("losses", {})
    document["losses"] = (losses if isinstance(losses, dict) else {}) | {name: loss}
    write_text(path, json.dumps(document, indent=2) + "\n")
    return True


def read_start(path: Path) -> Stack:
    """The layers nearest to somebody's material: of a glTF or MaterialX file, of Blender's inputs, or a preset as it is.

    Raises `InputError` for a file that is none of them, or whose material is not the same everywhere.
    """
    ending = path.suffix.lower()
    if not ending:
        return read_preset(path)
    if ending not in READ:
        raise InputError(
            f"{path}: a fit starts from {', '.join(READ[:-1])} or {READ[-1]}, not from {ending}. {_advice(ending)}"
        )
    if ending == ".json":
        document = read_document(path)
        return read_preset(path) if document.get("schema") == PRESET else _checked(blender.read(path, document), path)
    content = read_bytes(path, MOST_BYTES, "a material")
    if ending == ".mtlx":
        return _checked(openpbr.read(path, content.decode("utf-8", errors="replace")), path)
    return _checked(gltf.read(path, content), path)


def _checked(engine: Engine, path: Path) -> Stack:
    """The layers of somebody's material, read once more as a preset: a value out of its range is told by name."""
    document = preset_of(stack_of(engine), "start")
    return presets.stack_of(
        {key: document[key] for key in ("model", "interface", "layers", "base") if key in document}, str(path)
    )


def _advice(ending: str) -> str:
    if ending == ".blend":
        return "`layerfit blender-kit` writes a script that renders a reference in Blender and leaves its material beside it"
    return "Export it as one of them"


def blender_kit() -> str:
    """The script that renders a reference in Blender and leaves a scene file and its material beside it."""
    return (Path(__file__).parent / "kit" / "layerfit_kit.py").read_text(encoding="utf-8")


def said(export: Export, name: str) -> list[str]:
    """What is lost, in lines for people."""
    found = export.conversion
    lines = [
        f"{found.to_json()['formula']}, on {found.seen}: {_error(found.error)}",
        f"its values as they are: {_error(found.copied_error)}",
    ]
    if export.drawn is not None:
        lines.append(f"drawn by its own shader: {_error(export.drawn)}")
    lines += [f"lost: {sentence}" for sentence in found.lost]
    return lines + ([f'stored in the preset, losses["{name}"]'] if export.stored else [])


def _error(error: dict[str, Any]) -> str:
    measures = {"rel_l2": "{:.3g} relative L2", "psnr_db": "PSNR {:.1f} dB", "delta_e": "delta E 2000 {:.2f}"}
    return ", ".join(text.format(error[key]) for key, text in measures.items() if key in error)
