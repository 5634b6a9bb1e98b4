"""MERL's binary tables (Matusik et al. 2003), of any size: half and difference angles of Rusinkiewicz 1998.

Three int32 say how many theta_h, theta_d and phi_d there are; then stand the float64 values of red, green and blue, one channel after the
other, phi_d fastest. theta_h is spaced by its square root. A value below 0 marks a cell that was not measured.
"""

from pathlib import Path

import numpy as np

from ...errors import InputError
from .data import MOST_BYTES, MeasuredBrdf, direction, measured, mirrored, read_file

SCALE = np.array([1.0, 1.15, 1.66]) / 1500.0
"""BRDF [1/sr] over stored value, a channel each: as in the reader that comes with the data."""

HEADER = 12
KIND = "MERL"


def read_merl(path: Path) -> MeasuredBrdf:
    """Read such a table; a sample stands in the middle of each cell. Raises `InputError`."""
    data = read_file(path)
    shape = _shape(path, data)
    stored = np.frombuffer(data, "<f8", offset=HEADER).reshape(3, -1).T
    wi, wo = cells(shape)
    layout = {"theta_h": shape[0], "theta_d": shape[1], "phi_d": shape[2]}
    valid = ~np.any(stored < 0.0, -1)
    return measured(path, KIND, "", wi, wo, stored * SCALE, isotropic=True, layout=layout, valid=valid)


def _shape(path: Path, data: bytes) -> tuple[int, int, int]:
    if len(data) < HEADER:
        raise InputError(f"{path}: is too short for a MERL table, which begins with three int32 sizes")
    shape = tuple(int(n) for n in np.frombuffer(data, "<i4", 3))
    # Python's integers: a product of three int32 does not overflow here.
    needed = HEADER + 24 * shape[0] * shape[1] * shape[2]
    if min(shape) < 1 or needed > MOST_BYTES or needed != len(data):
        sizes = " x ".join(str(n) for n in shape)
        raise InputError(
            f"{path}: is not a MERL table: {sizes} cells of three float64 take {needed} bytes, and it has {len(data)}"
        )
    return shape[0], shape[1], shape[2]


def cells(shape: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Directions wi and wo (cells, 3) in the middle of each cell, half vectors at azimuth 0."""
    k = [(np.arange(n) + 0.5) / n for n in shape]
    half, difference, turn = (a.ravel() for a in np.meshgrid(k[0] ** 2, k[1], k[2], indexing="ij"))
    theta_h = 0.5 * np.pi * half
    h = direction(theta_h, np.zeros_like(theta_h))
    d = direction(0.5 * np.pi * difference, np.pi * turn)
    cosine, sine = h[:, 2], h[:, 0]
    # From the frame of the half vector to that of the surface: a turn by theta_h about the bitangent.
    wi = np.stack([cosine * d[:, 0] + sine * d[:, 2], d[:, 1], cosine * d[:, 2] - sine * d[:, 0]], -1)
    return wi, mirrored(wi, h)
