"""Tables of plain words as HTML: in pages, and what results show of themselves in notebooks."""

from collections.abc import Sequence
from html import escape


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Headings, and a line for each row."""
    return f"<table>{_line(headings, 'th')}{''.join(_line(row, 'td') for row in rows)}</table>"


def _line(cells: Sequence[str], kind: str) -> str:
    return "<tr>" + "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in cells) + "</tr>"
