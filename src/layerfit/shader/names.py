"""What a value is called in the Python source: the target of the assignment whose right-hand side computed it.

The only use of JAX's internals (where in the source an equation came from). Without it names are plainer and the text is as valid.
"""

import ast
import functools
from pathlib import Path

try:
    from jax._src.source_info_util import user_frames
except ImportError:  # an internal that may move; every name then comes from the printer's fall-back
    user_frames = None

Span = tuple[int, int, int | None, int | None]

GUARDS = "_chunk.py"
"""Guards print as the plain operation: their own local names say nothing about the formula."""


def source_of(eqn) -> str:
    """file:line of the user's code that made an equation, for error messages; empty where it is not known."""
    frame = next(_frames(eqn), None)
    return f"{frame.file_name}:{frame.start_line}" if frame else ""


def name_of(eqn) -> str | None:
    """The Python name that the value of `eqn` was given, or None for a part of a larger expression."""
    for frame in _frames(eqn):
        if frame.file_name.endswith(GUARDS):
            continue
        name = _spans(frame.file_name).get((frame.start_line, frame.start_column, frame.end_line, frame.end_column))
        if name is None:
            return None
        if name != RETURNED:
            return name
    return None


RETURNED = "return"


def _frames(eqn):
    return user_frames(eqn.source_info.traceback) if user_frames else iter(())


@functools.cache
def _spans(file_name: str) -> dict[Span, str]:
    """Every expression of a file that is the value of a name, or is returned and so named by the caller."""
    path = Path(file_name)
    spans: dict[Span, str] = {}
    if not path.is_file():  # a cell of a notebook, or `python -c`
        return spans

    def mark(value: ast.expr | None, name: str) -> None:
        if isinstance(value, ast.IfExp):
            mark(value.body, name)
            mark(value.orelse, name)
        elif value is not None:
            spans[value.lineno, value.col_offset, value.end_lineno, value.end_col_offset] = name

    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Assign):
            target = node.targets[0]
            if isinstance(target, ast.Name):
                mark(node.value, target.id)
            elif isinstance(target, ast.Tuple):
                values = [node.value.body, node.value.orelse] if isinstance(node.value, ast.IfExp) else [node.value]
                for value in values:
                    for element, item in zip(target.elts, getattr(value, "elts", ()), strict=False):
                        if isinstance(element, ast.Name):
                            mark(item, element.id)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            mark(node.value, node.target.id)
        elif isinstance(node, ast.keyword) and node.arg:
            mark(node.value, node.arg)
        elif isinstance(node, ast.Return):
            mark(node.value, RETURNED)
    return spans
