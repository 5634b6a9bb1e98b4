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

FOLDER = Path(__file__).parent / "page"
SCRIPTS = ("program.js", "shapes.js", "renderer.js", "view.js", "controls.js", "compare.js", "gallery.js", "page.js")


def text(name: str) -> str:
    """A file of `page/`."""
    return (FOLDER / name).read_text(encoding="utf-8")


def filled(name: str, /, **slots: str) -> str:
    """An HTML file of `page/` with its `$slots` filled in; what fills them is HTML already."""
    return Template(text(name)).substitute(slots)


def page(title: str, body: str, data: Mapping[str, bytes] | None = None) -> str:
    """A whole page; `data` are read by its scripts, by their names. Without data there are no scripts."""
    packed = (
        f'<script type="text/plain" id="{escape(name)}">{_packed(content)}</script>' for name, content in (data or {}).items()
    )
    script = "\n".join(map(text, SCRIPTS)) if data else ""
    return filled("frame.html", title=escape(title), style=text("page.css"), body=body, data="\n".join(packed), script=script)


def as_json(document: Any) -> bytes:
    """A document as the bytes that a page holds."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()


def _packed(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 9)).decode()
