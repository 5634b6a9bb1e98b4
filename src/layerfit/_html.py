"""Tables of plain words as HTML: in pages, and what results show of themselves in notebooks."""

from collections.abc import Sequence
from html import escape


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Headings, and a line for each row."""
    return f"<table>{_line(headings, 'th')}{''.join(_line(row, 'td') for row in rows)}</table>"


def cell(kind: str, content: str) -> str:
    """A cell of HTML: words, which notebooks would set to the right."""
    return f'<{kind} style="text-align: left">{content}</{kind}>'


def _line(cells: Sequence[str], kind: str) -> str:
    return "<tr>" + "".join(cell(kind, escape(text)) for text in cells) + "</tr>"
