"""Pages that hold all they show: text, style, scripts and packed data in one file that makes no request.

The files of `page/` are put together here. Scripts are plain and share one scope, in the order of `SCRIPTS`.
"""

import base64
import json
import zlib
from collections.abc import Mapping
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from ..shader.export import HEADERS

FOLDER = Path(__file__).parent / "page"
VIEWER = ("packed.js", "program.js", "shapes.js", "renderer.js", "view.js", "run.js", "controls.js")
STAGES = ("mesh.vert", "screen.vert", "add.frag", "show.frag")
SCRIPTS = (*VIEWER, "compare.js", "gallery.js", "page.js")


def text(name: str) -> str:
    """A file of `page/`."""
    return (FOLDER / name).read_text(encoding="utf-8")


def filled(name: str, /, **slots: str) -> str:
    """An HTML file of `page/` with its `$slots` filled in; what fills them is HTML already."""
    return Template(text(name)).substitute(slots)


def broken(name: str) -> str:
    """A name as HTML that may be broken behind its underscores, and nowhere else where that is enough."""
    return escape(name).replace("_", "_<wbr>")


def page(title: str, body: str, data: Mapping[str, bytes] | None = None) -> str:
    """A whole page; `data` are read by its scripts, by their names. Without data there are no scripts."""
    held = (
        f'<script type="text/plain" id="{escape(key)}">{_as_text(content)}</script>' for key, content in (data or {}).items()
    )
    script = "\n".join([shared(), *map(text, SCRIPTS)]) if data else ""
    return filled("frame.html", title=escape(title), style=text("page.css"), body=body, data="\n".join(held), script=script)


def module(name: str) -> str:
    """The scripts of a viewer and a last one as an ES module; `STYLE` is theirs."""
    return "\n".join([f"const STYLE = {json.dumps(text('page.css'))};", shared(), *map(text, (*VIEWER, name))])


def stage(name: str, target: str) -> str:
    """A stage of a picture for a target of shaders."""
    return f"{HEADERS[target]}\n{text(name)}"


def shared() -> str:
    """What windows draw with too, as a script: the stages of a picture as `GLSL`, by their files, and its lights as `STUDIO`."""
    stages = {name: stage(name, "essl300") for name in STAGES}
    return f"const GLSL = {json.dumps(stages)};\nconst STUDIO = {json.dumps(json.loads(text('studio.json')))};"


def as_json(document: Any) -> bytes:
    """A document as the bytes that a page holds."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()


def packed(content: bytes) -> bytes:
    """Data as `packed.js` reads them."""
    return zlib.compress(content, 9)


def _as_text(content: bytes) -> str:
    return base64.b64encode(packed(content)).decode()
