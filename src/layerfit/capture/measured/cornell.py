"""The text form of Cornell's gonioreflectometer: rows of four angles and a spectrum.

Comments begin with #. Then stand the number of wavelengths, the wavelengths [nm], and rows of theta_i, phi_i, theta_o, phi_o [rad] and a BRDF
[1/sr] for each wavelength. (Foo 1997; the files of the Cornell University Program of Computer Graphics.)
"""

import itertools
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...optics.spectra import covers, resampling, rgb_weights
from .data import MeasuredBrdf, direction, measured, read_file

MOST_WAVELENGTHS = 1000
LARGEST_ANGLE = 10.0
"""More than a turn and a half: a file in degrees is not read as if it were one in radians."""
KIND = "Cornell"


def read_cornell(path: Path, illuminant: str = "D65") -> MeasuredBrdf:
    """Read such a file; spectra become linear Rec.709 by the CIE 1931 observer under `illuminant`. Raises `InputError`."""
    text = read_file(path).decode("latin-1")
    wavelengths, rows = _numbers(path, text)
    if not np.all(np.abs(rows[:, :4]) <= LARGEST_ANGLE):
        raise InputError(f"{path}: an angle is not finite or above {LARGEST_ANGLE:g} rad; is the file damaged?")
    theta_i, phi_i, theta_o, phi_o = rows[:, :4].T
    f = rows[:, 4:] @ (resampling(wavelengths) @ rgb_weights(illuminant))
    layout = {
        "rows": len(rows),
        "wavelengths_nm": [float(wavelengths[0]), float(wavelengths[-1]), len(wavelengths)],
        "illuminant": illuminant,
        "theta_i_deg": sorted({round(float(angle), 1) for angle in np.degrees(theta_i)}),
    }
    wi, wo = direction(theta_i, phi_i), direction(theta_o, phi_o)
    isotropic = bool(np.ptp(phi_i) < 1e-6)
    return measured(path, KIND, _title(text), wi, wo, f, isotropic=isotropic, layout=layout)


def _title(text: str) -> str:
    """What the comments say of the sample, before those that say what the numbers are."""
    comments = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    words = [line.strip("# \t") for line in comments]
    return ", ".join(line for line in words if line and not line.startswith(("num wls", "wls", "theta")))


def _numbers(path: Path, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (w,) and rows (n, 4 + w)."""
    words = " ".join(line.partition("#")[0] for line in text.splitlines()).split()
    try:
        numbers = np.array(words, float)
    except ValueError:
        raise InputError(f"{path}: is not a BRDF of Cornell's gonioreflectometer: a word in it is no number") from None
    count = int(numbers[0]) if len(numbers) and np.isfinite(numbers[0]) else 0
    if not 2 <= count <= MOST_WAVELENGTHS or count != numbers[0]:
        raise InputError(f"{path}: its first number should be how many wavelengths there are, from 2 to {MOST_WAVELENGTHS}")
    wavelengths, rest = numbers[1 : 1 + count], numbers[1 + count :]
    if len(wavelengths) < count or not len(rest) or len(rest) % (4 + count):
        raise InputError(
            f"{path}: ends within a row: with {count} wavelengths a row is {4 + count} numbers, and {len(rest)} are there"
        )
    if not np.all(np.isfinite(wavelengths)) or not covers(wavelengths):
        raise InputError(f"{path}: its wavelengths should rise, in nm, and cover 400 to 700")
    return wavelengths, rest.reshape(-1, 4 + count)
