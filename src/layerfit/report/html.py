"""The page of a fit: one file that holds everything it shows."""

import base64
import html
from collections.abc import Mapping
from typing import Any

from .text import lines, number

_STYLE = """
:root { color-scheme: light dark; --ink: #18181b; --paper: #fafafa; --line: #d4d4d8; --soft: #71717a; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e4e7; --paper: #18181b; --line: #3f3f46; --soft: #a1a1aa; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 64rem; margin: 2rem auto; padding: 0 1rem; }
img { max-width: 100%; image-rendering: pixelated; } table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; padding: .25rem .75rem .25rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td:nth-child(n+2) { font-variant-numeric: tabular-nums; } pre { overflow-x: auto; border: 1px solid var(--line); padding: .75rem; font-size: 13px; }
.soft { color: var(--soft); } summary { cursor: pointer; }
"""


def page(name: str, document: Mapping[str, Any], picture: bytes, convergence: bytes, shader: str) -> str:
    """The report as HTML with its pictures inside; it makes no request."""
    rows = "".join(
        f"<tr><th>{html.escape(key)}</th><td>{number(row['value'])}</td><td>&plusmn; {number(row['sigma'])}</td>"
        f"<td class=soft>{number(row['start']) if 'start' in row else ''}</td><td>{html.escape(_state(row))}</td></tr>"
        for key, row in document["parameters"].items()
    )
    text = html.escape("\n".join(lines(document)))
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{html.escape(name)}: fit</title><style>{_STYLE}</style>
<h1>{html.escape(name)}</h1>
<p><img alt="reference, fit, shader and difference side by side" src="data:image/png;base64,{base64.b64encode(picture).decode()}"></p>
<h2>Parameters</h2>
<table><tr><th>parameter</th><th>value</th><th>sigma</th><th>start</th><th></th></tr>{rows}</table>
<h2>Error against run time</h2>
<p><img alt="cost of the fit against seconds" src="data:image/png;base64,{base64.b64encode(convergence).decode()}"></p>
<h2>Report</h2><pre>{text}</pre>
<details><summary>Shader</summary><pre>{html.escape(shader)}</pre></details>
</html>
"""


def _state(row: Mapping[str, Any]) -> str:
    if row.get("at_bound"):
        return f"at its {row['at_bound']} bound"
    if row.get("identifiable") is False:
        return "not identifiable"
    return row.get("derived", "")
