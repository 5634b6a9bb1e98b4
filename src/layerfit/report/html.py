"""The page of a fit: one file that holds everything it shows."""

import base64
import html
from collections.abc import Mapping
from typing import Any

from ..fit import words
from .text import image_error, lines, relative

STYLE = """
:root { color-scheme: light dark; --ink: #18181b; --paper: #fafafa; --line: #d4d4d8; --soft: #71717a; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e4e7; --paper: #18181b; --line: #3f3f46; --soft: #a1a1aa; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 64rem; margin: 2rem auto; padding: 0 1rem; }
figure { margin: 1rem 0; } img { max-width: 100%; } table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; padding: .25rem .75rem .25rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td:nth-child(n+2) { font-variant-numeric: tabular-nums; } pre { overflow-x: auto; border: 1px solid var(--line); padding: .75rem; font-size: 13px; }
.soft { color: var(--soft); } summary { cursor: pointer; }
"""


_STRIP = """All at one exposure: the 99th percentile of the reference is white. The difference is that of the shader from the
reference, where pixels are compared."""
_CONVERGENCE = "One line a start. Coarse and polish use few pixels, fine all of them with weights that follow the model."
_PLANES = "In the plane of incidence; the mirror side is positive."


def page(
    name: str, document: Mapping[str, Any], picture: bytes, convergence: bytes, shader: str, planes: bytes | None = None
) -> str:
    """The report as HTML with its pictures inside; it makes no request. `planes` is of a measured BRDF."""
    text = html.escape("\n".join(lines(document)))
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{html.escape(name)}: fit</title><style>{STYLE}</style>
<h1>{html.escape(name)}</h1>
<p>{html.escape(_verdict(document))}</p>
{figure(picture, "reference, fit, shader and difference side by side", _STRIP)}
{"" if planes is None else figure(planes, "measured values and the fit in planes of incidence", _PLANES)}
<h2>Parameters</h2>
{words.table(document["parameters"])}
<p class=soft>Sigmas are {html.escape(document["sigma_is"])}.</p>
<h2>Error against run time</h2>
{figure(convergence, "error of the fit against seconds", _CONVERGENCE)}
<h2>Report</h2><pre>{text}</pre>
<details><summary>Shader</summary><pre>{html.escape(shader)}</pre></details>
</html>
"""


def figure(picture: bytes, alt: str, caption: str) -> str:
    """A PNG inside the page, with words below."""
    encoded = base64.b64encode(picture).decode()
    return f'<figure><img alt="{alt}" src="data:image/png;base64,{encoded}">\n<figcaption class=soft>{caption}</figcaption></figure>'


def _verdict(document: Mapping[str, Any]) -> str:
    """The result in a sentence."""
    parity = document["parity"]
    poor = f" {words.poor(document['misfit'])}" if "poor_fit" in document["flags"] else ""
    return (
        f"The fit {'converged' if document['converged'] else 'did NOT converge'}; its error is {image_error(document['error'])}.{poor} "
        f"The shader {'is' if parity['passed'] else 'is NOT'} the fitted material: "
        f"the largest relative difference from JAX is {relative(parity['max_rel'])}."
    )
