"""The RGL material database: adaptive tables of Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition".

For each direction of light the outgoing directions are those that the visible normals of the material send it to: the unit square, warped
by their density (section 3). What is stored at a point of the square is f cos(theta_o), times 4 sigma / D.
"""

from pathlib import Path

import numpy as np

from ...errors import InputError
from .data import MeasuredBrdf, direction, measured, mirrored
from .tensor import read_tensors

KIND = "RGL"
LARGEST = 1e15
"""Of densities: sums of their squares stay within a double."""
_RANGES = {"theta_i": (0.0, 1.6), "phi_i": (-6.3, 6.3)}
"""Of angles: the quarter turn and the turn, as they are rounded."""
_DIMENSIONS = {"theta_i": 1, "phi_i": 1, "sigma": 2, "ndf": 2, "vndf": 4, "rgb": 5}


def read_rgl(path: Path) -> MeasuredBrdf:
    """Read such a file, in its RGB variant, isotropic or anisotropic: the samples are the points of its tables. Raises `InputError`."""
    fields = read_tensors(path)
    _check(path, fields)
    theta_i, phi_i = (fields[name].astype(float) for name in ("theta_i", "phi_i"))
    isotropic = len(phi_i) <= 2
    points = [_slice(fields, p, t, isotropic) for p in range(1 if isotropic else len(phi_i)) for t in range(len(theta_i))]
    wi, wo, f = (np.concatenate(part) for part in zip(*points, strict=True))
    layout = {
        "theta_i_deg": [round(float(angle), 1) for angle in np.degrees(theta_i)],
        "phi_i": 1 if isotropic else len(phi_i),
        "square": list(fields["rgb"].shape[3:]),
    }
    description = bytes(fields["description"]).decode("utf-8", "replace") if "description" in fields else ""
    return measured(path, KIND, description, wi, wo, f, isotropic=isotropic, layout=layout)


def _check(path: Path, fields: dict[str, np.ndarray]) -> None:
    if "rgb" not in fields and "spectra" in fields:
        raise InputError(f"{path}: holds spectra; the database has an RGB variant of every material, NAME_rgb.bsdf")
    for name, dimensions in _DIMENSIONS.items():
        if name not in fields:
            raise InputError(f"{path}: is not a BRDF of the RGL database: it has no field {name!r}")
        if fields[name].ndim != dimensions or fields[name].dtype.kind != "f":
            raise InputError(f"{path}: field {name!r} should be {dimensions} dimensions of floating-point numbers")
        least, most = _RANGES.get(name, (0.0, LARGEST))
        if name != "rgb" and not np.all((fields[name] >= least) & (fields[name] <= most)):
            raise InputError(
                f"{path}: field {name!r} holds numbers that are not from {least:g} to {most:g}; is the file damaged?"
            )
    slices = (len(fields["phi_i"]), len(fields["theta_i"]))
    if fields["vndf"].shape[:2] != slices or fields["rgb"].shape[:3] != (*slices, 3):
        raise InputError(f"{path}: vndf and rgb should have a table for each of phi_i and theta_i")
    if min(min(fields[name].shape[-2:]) for name in ("sigma", "ndf", "vndf", "rgb")) < 2:
        raise InputError(f"{path}: a table of it is less than two points wide")


def _slice(fields: dict[str, np.ndarray], p: int, t: int, isotropic: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """wi, wo and f (n, 3) of the points of one table, that of one direction of light."""
    theta_i, phi_i = float(fields["theta_i"][t]), float(fields["phi_i"][p])
    with np.errstate(invalid="ignore"):  # a NaN that signals is one that is left out, as any other
        values = fields["rgb"][p, t].astype(float)
    height, width = values.shape[1:]
    v, u = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, height), np.linspace(0, 1, width), indexing="ij"))
    # Across the table runs the polar angle of the half vector, down it the azimuth.
    x, y = warped(fields["vndf"][p, t].astype(float), u, v)
    theta_h, phi_h = 0.5 * np.pi * x * x, (2.0 * y - 1.0) * np.pi
    wi = np.broadcast_to(direction(np.array(theta_i), np.array(phi_i)), (len(u), 3))
    wo = mirrored(wi, direction(theta_h, phi_h + phi_i if isotropic else phi_h))
    incident = np.sqrt(theta_i * 2.0 / np.pi), (phi_i + np.pi) / (2.0 * np.pi)
    sigma = bilinear(fields["sigma"].astype(float), *(np.array([a]) for a in incident))
    jacobian = bilinear(fields["ndf"].astype(float), x, y) / (4.0 * np.maximum(sigma, 1e-12))
    cosine = np.maximum(wo[:, 2], 1e-12)
    return wi, wo, values.reshape(3, -1).T * (jacobian / cosine)[:, None]


def bilinear(table: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values (n,) of a table (h, w) over the unit square at points (n,), linear between its entries."""
    size = np.array(table.shape) - 1
    row, column = np.clip(y, 0.0, 1.0) * size[0], np.clip(x, 0.0, 1.0) * size[1]
    r, c = np.minimum(row.astype(int), size[0] - 1), np.minimum(column.astype(int), size[1] - 1)
    s, t = row - r, column - c
    upper = (1.0 - t) * table[r, c] + t * table[r, c + 1]
    lower = (1.0 - t) * table[r + 1, c] + t * table[r + 1, c + 1]
    return (1.0 - s) * upper + s * lower


def warped(density: np.ndarray, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points x and y (n,) that a density (h, w), bilinear over the unit square, sends uniform u and v (n,) to: first its rows, then along one."""
    rows = _cumulated(density)
    total = rows[:, -1]
    r, s = _inverted(np.broadcast_to(total, (len(v), len(total))), v)
    across = (1.0 - s)[:, None] * density[r] + s[:, None] * density[r + 1]
    c, t = _inverted(across, u)
    return (c + t) / (density.shape[1] - 1), (r + s) / (density.shape[0] - 1)


def _cumulated(values: np.ndarray) -> np.ndarray:
    """Integrals (m, k) from the start to each entry of functions (m, k) that are linear between entries one apart."""
    steps = 0.5 * (values[:, 1:] + values[:, :-1])
    return np.concatenate([np.zeros((len(values), 1)), np.cumsum(steps, -1)], -1)


def _inverted(density: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interval (n,) and place in it, 0 to 1, where the integral of each linear density (n, k) reaches the part u (n,) of the whole."""
    integral = _cumulated(density)
    wanted = np.clip(u, 0.0, 1.0) * integral[:, -1]
    k = np.clip(np.sum(integral <= wanted[:, None], -1) - 1, 0, density.shape[1] - 2)
    n = np.arange(len(u))
    a, b, rest = density[n, k], density[n, k + 1], wanted - integral[n, k]
    # a t + (b - a) t^2 / 2 = rest, solved without a difference of like numbers.
    root = np.sqrt(np.maximum(a * a + 2.0 * (b - a) * rest, 0.0))
    return k, np.clip(2.0 * rest / np.maximum(a + root, 1e-30), 0.0, 1.0)
