"""BRDF values for a table of directions."""

import csv
import io
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np

from .capture.measured.table import DIRECTIONS, VALUES, read_columns, unit_pairs
from .render import brdf
from .stack import Stack
from .walk import Estimate

Truth = Callable[[np.ndarray, np.ndarray], Estimate]
"""What evaluates pairs of directions (n, 3) by the random walk."""

ERRORS = ("se_r", "se_g", "se_b")


def read_directions(path: Path) -> np.ndarray:
    """Rows (n, 6) of unit directions from a CSV with a header. Raises `InputError` with the line at fault."""
    return unit_pairs(path, read_columns(path, DIRECTIONS)).reshape(-1, 6)


def evaluate_table(stack: Stack, path: Path, truth: Truth | None = None) -> str:
    """The table with columns f_r, f_g, f_b [1/sr] added, as CSV text; with `truth` by the random walk, and standard errors se_r, se_g, se_b."""
    table = read_directions(path)
    names = VALUES if truth is None else (*VALUES, *ERRORS)
    values = np.zeros((0, len(names)))
    if len(table) and truth is not None:
        found = truth(table[:, :3], table[:, 3:])
        values = np.column_stack([found.mean, found.se])
    elif len(table):
        with jax.enable_x64(True):
            values = np.asarray(brdf(stack.astype(np.float64), table[:, :3], table[:, 3:]))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*DIRECTIONS, *names])
    for row, value in zip(table.tolist(), values.tolist(), strict=True):
        writer.writerow([*row, *(f"{v:.9g}" for v in value)])
    return out.getvalue()
