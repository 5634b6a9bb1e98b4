"""A table of directions and values as CSV: what `layerfit eval` writes, and any instrument's data can be brought to."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...documents import unreadable
from ...errors import InputError
from .data import MeasuredBrdf, measured

DIRECTIONS = ("wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z")
VALUES = ("f_r", "f_g", "f_b")
MOST_ROWS = 10_000_000
KIND = "table"


def read_table(path: Path) -> MeasuredBrdf:
    """Read a CSV with columns wi_x wi_y wi_z wo_x wo_y wo_z and f_r f_g f_b: BRDF [1/sr], linear Rec.709. Raises `InputError`."""
    rows = read_columns(path, (*DIRECTIONS, *VALUES))
    pairs = unit_pairs(path, rows[:, :6])
    wi, wo = pairs[:, 0], pairs[:, 1]
    # All light from one azimuth: what turning the sample would show was not asked.
    azimuths = np.arctan2(wi[:, 1], wi[:, 0])[wi[:, 2] < 0.9999]
    isotropic = not len(azimuths) or bool(np.ptp(azimuths) < 1e-6)
    return measured(path, KIND, "", wi, wo, rows[:, 6:], isotropic=isotropic, layout={"rows": len(rows)})


def read_columns(path: Path, columns: Sequence[str]) -> np.ndarray:
    """Rows (n, columns) of numbers from a CSV with a header; other columns are not read. Raises `InputError` with the line at fault."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [c for c in columns if c not in (reader.fieldnames or ())]
            if missing:
                raise InputError(f"{path}: the header lacks {', '.join(missing)}; it needs {' '.join(columns)}")
            rows = []
            for row in reader:
                if len(rows) >= MOST_ROWS:
                    raise InputError(f"{path}: more than {MOST_ROWS} rows; split the file")
                try:
                    rows.append([float(row[c]) for c in columns])
                except (TypeError, ValueError):
                    raise InputError(f"{path}: line {reader.line_num}: a number is missing or is none") from None
    except OSError as error:
        raise unreadable(path, error) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is not a CSV file in UTF-8 ({error})") from None
    return np.array(rows, float).reshape(-1, len(columns))


def unit_pairs(path: Path, table: np.ndarray) -> np.ndarray:
    """Pairs (n, 2, 3) of unit directions of rows (n, 6). Raises `InputError` for a row that holds none."""
    if not np.all(np.isfinite(table)):
        raise InputError(f"{path}: row {int(np.argmin(np.isfinite(table).all(1))) + 1} holds a number that is not finite")
    lengths = np.linalg.norm(table.reshape(-1, 2, 3), axis=-1)
    if np.any(np.abs(lengths - 1.0) > 1e-3):
        row = int(np.argmax(np.abs(lengths - 1.0).max(1)))
        raise InputError(f"{path}: row {row + 1}: a direction has length {lengths[row].max():.4g}; directions are unit vectors")
    return table.reshape(-1, 2, 3) / lengths[..., None]
