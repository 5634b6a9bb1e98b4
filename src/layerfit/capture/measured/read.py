"""Which format a measured BRDF is in, and its reader."""

from pathlib import Path

from ...errors import InputError
from .cornell import read_cornell
from .data import MeasuredBrdf
from .merl import read_merl
from .rgl import read_rgl
from .table import read_table

SUFFIXES = (".brdf", ".bsdf", ".binary", ".csv")
"""Cornell, RGL, MERL, table."""


def is_measured(path: Path) -> bool:
    """Whether a file, by its name, is a measured BRDF."""
    return path.suffix.lower() in SUFFIXES


def read_brdf(path: str | Path, illuminant: str = "D65") -> MeasuredBrdf:
    """Read a measured BRDF, in the format that its name ends in: `.brdf` Cornell, `.bsdf` RGL, `.binary` MERL, `.csv` a table.

    Spectra, which of these Cornell's files alone hold, become linear Rec.709 by the CIE 1931 observer in the light of `illuminant`. Raises
    `InputError` for a file that is none of them, or a broken one.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".brdf":
        return read_cornell(path, illuminant)
    readers = {".bsdf": read_rgl, ".binary": read_merl, ".csv": read_table}
    if suffix not in readers:
        raise InputError(f"{path}: a measured BRDF ends in {', '.join(SUFFIXES)}; which one says its format")
    return readers[suffix](path)
