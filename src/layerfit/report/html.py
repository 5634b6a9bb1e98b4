"""The page of a fit: one file that holds everything it shows, also its shader, live."""

import base64
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from ..fit import words
from . import charts, pages
from .comparison import Pair, comparisons
from .text import image_error, lines, relative, worst


def page(
    name: str,
    document: Mapping[str, Any],
    pairs: Sequence[Pair],
    strip: bytes,
    trace: Sequence[tuple[float, str, int, float]],
    shader: str,
    live: Mapping[str, Any],
    planes: bytes | None = None,
) -> str:
    """The report as HTML with its data inside; it makes no request.

    `pairs` are the references and their fits, `strip` the same as a picture for a browser without scripts, `trace` the steps of the
    fit, `live` what `viewer.live` gives; `planes` is of a measured BRDF.
    """
    pictures, data = comparisons(pairs)
    body = pages.filled(
        "report.html",
        name=escape(name),
        verdict=escape(_verdict(document)),
        pictures=pictures,
        strip=_source(strip),
        planes="" if planes is None else figure(planes, "measured values and the fit in planes of incidence", _PLANES),
        parameters=words.table(document["parameters"]),
        sigma_is=escape(document["sigma_is"]),
        correlations=f"<h3>Correlations</h3>{charts.correlations(document['correlations'])}",
        profiles=charts.profiles(document["profiles"]),
        convergence=charts.convergence(trace),
        left_out=escape(", ".join(document["left_out"]) or "nothing"),
        report=escape("\n".join(lines(document))),
        shader=escape(shader),
    )
    return pages.page(f"{name}: fit", body, {"material": pages.as_json(live)} | data)


def _source(picture: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"


def figure(picture: bytes, alt: str, caption: str) -> str:
    """A PNG inside a page, with words below."""
    return f'<figure><img alt="{alt}" src="{_source(picture)}">\n<figcaption>{caption}</figcaption></figure>'


_PLANES = "In the plane of incidence; the mirror side is positive."


def _verdict(document: Mapping[str, Any]) -> str:
    """The result in a sentence."""
    parity = document["parity"]
    poor = f" {words.poor(document['misfit'])}" if "poor_fit" in document["flags"] else ""
    return (
        f"The fit {'converged' if document['converged'] else 'did NOT converge'}; its error is {image_error(document['error'])}.{poor} "
        f"The shader {'is' if parity['passed'] else 'is NOT'} the fitted material: "
        f"the largest relative difference from JAX is {relative(parity['max_rel'])}, {worst(parity['worst'])}."
    )
