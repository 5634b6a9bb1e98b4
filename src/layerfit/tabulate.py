"""BRDF values for a table of directions."""

import csv
import io
from pathlib import Path

import jax
import numpy as np

from .errors import InputError
from .render import brdf
from .stack import Stack

COLUMNS = ("wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z")
MOST_ROWS = 10_000_000


def read_directions(path: Path) -> np.ndarray:
    """Rows (n, 6) of unit directions from a CSV with a header. Raises `InputError` with the line at fault."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [c for c in COLUMNS if c not in (reader.fieldnames or ())]
            if missing:
                raise InputError(f"{path}: the header lacks {', '.join(missing)}; it needs {' '.join(COLUMNS)}")
            rows = []
            for row in reader:
                if len(rows) >= MOST_ROWS:
                    raise InputError(f"{path}: more than {MOST_ROWS} rows; split the file")
                try:
                    rows.append([float(row[c]) for c in COLUMNS])
                except (TypeError, ValueError):
                    raise InputError(f"{path}: line {reader.line_num}: a number is missing or is none") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is not a CSV file in UTF-8 ({error})") from None
    table = np.array(rows, float).reshape(-1, 6)
    if not np.all(np.isfinite(table)):
        raise InputError(f"{path}: row {int(np.argmin(np.isfinite(table).all(1))) + 1} holds a number that is not finite")
    lengths = np.linalg.norm(table.reshape(-1, 2, 3), axis=-1)
    if np.any(np.abs(lengths - 1.0) > 1e-3):
        row = int(np.argmax(np.abs(lengths - 1.0).max(1)))
        raise InputError(f"{path}: row {row + 1}: a direction has length {lengths[row].max():.4g}; directions are unit vectors")
    return (table.reshape(-1, 2, 3) / lengths[..., None]).reshape(-1, 6)


def evaluate_table(stack: Stack, path: Path) -> str:
    """The table with columns f_r, f_g, f_b [1/sr] added, as CSV text."""
    table = read_directions(path)
    values = np.zeros((0, 3))
    if len(table):
        with jax.enable_x64(True):
            values = np.asarray(jax.jit(brdf)(stack.astype(np.float64), table[:, :3], table[:, 3:]))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*COLUMNS, "f_r", "f_g", "f_b"])
    for row, value in zip(table.tolist(), values.tolist(), strict=True):
        writer.writerow([*row, *(f"{v:.9g}" for v in value)])
    return out.getvalue()
