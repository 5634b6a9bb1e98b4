"""What a scene does not need of a material: a table, what follows in words, and the page."""

import html
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .._html import table as html_table
from . import pages
from .truth import percent

if TYPE_CHECKING:
    from rich.table import Table

_HEADINGS = ("part", "error without it", "growth", "instructions saved", "numbers", "left out")


def _rows(document: Mapping[str, Any]) -> list[list[str]]:
    return [
        [
            row["what"],
            percent(row["error"]),
            f"{100.0 * row['growth']:+.2g} %",
            str(row["instructions_saved"]),
            str(row["numbers_saved"]),
            "yes" if row["removed"] else "",
        ]
        for row in document["tried"]
    ]


def table(document: Mapping[str, Any]) -> "Table":
    """The parts in the order in which they were tried, for the terminal."""
    from rich.table import Table

    made = Table(header_style="dim", box=None, pad_edge=False)
    for k, heading in enumerate(_HEADINGS):
        made.add_column(heading, justify="right" if k else "left", no_wrap=True)
    for row in _rows(document):
        made.add_row(*row)
    return made


def sentences(document: Mapping[str, Any]) -> list[str]:
    """What went, at what cost, and what it saved."""
    gone = [row["what"] for row in document["tried"] if row["removed"]]
    error, length, time = document["error"], document["instructions"], document["time"]
    if not gone:
        return [f"Nothing can go: every part is needed within {percent(document['tolerance'])} of this scene's pixels."]
    said = [
        f"Left out: {', '.join(gone)}.",
        f"Error on this scene {percent(error['specialised'])} instead of {percent(error['whole'])}; {length['specialised']} instructions "
        f"instead of {length['whole']}, {time['specialised']['x_phong']:.2f} x Phong instead of {time['whole']['x_phong']:.2f}.",
    ]
    return said if document["parity"]["passed"] else [*said, "The printed shader is NOT this material: see its parity."]


def page(document: Mapping[str, Any]) -> str:
    """The same as one HTML file that makes no request."""
    title = f"{document['name']}: what {document['scene']} does not need"
    body = f"""<h1>{html.escape(title)}</h1>
{"".join(f"<p>{html.escape(sentence)}</p>" for sentence in document["in_words"])}
{html_table(_HEADINGS, _rows(document))}
<p class=soft>Errors are relative L2 over the scene's pixels, after the rest was fitted again; each part is tried once, the one that saves most
instructions first. Times by {html.escape(document["renderer"])} on {html.escape(document["machine"])}.</p>"""
    return pages.page(title, body)
