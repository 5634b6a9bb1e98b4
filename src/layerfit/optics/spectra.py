"""Spectra to the three channels of a renderer, linear Rec.709, and what is lost on the way.

The only file that imports colour-science, and only where it is used: that takes seconds. Spectra are sampled at `WAVELENGTHS_NM`.
A spectrum that is 1 everywhere is (1, 1, 1): colours are those of a surface or a filter, relative to a white one in the same light.
"""

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError

WAVELENGTHS_NM = np.arange(380.0, 781.0, 5.0)
"""81 samples, as ASTM E308 has them for 5 nm tables."""

NEEDED_NM = 400.0, 700.0
"""What a measured spectrum has to cover; beyond its ends it is held. Light outside is less than .002 of white."""

DAYLIGHT = Path(__file__).with_name("daylight.csv")
"""`rgb_weights()` as numbers, by `tools/make_daylight.py`."""

THICKNESSES = 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0
"""Parts of the thickness at which the error of three channels is stated."""

DARKEST = 1e-4
"""A channel of a filter that is darker, or negative because the colour lies outside of Rec.709, is taken for this."""


def _colour() -> Any:
    with (
        np.printoptions()
    ):  # colour changes, for everybody, with how many digits numpy prints; shaders and presets need all of them
        import colour
    return colour


def covers(wavelength_nm: np.ndarray) -> bool:
    """Whether wavelengths (n,) rise and reach from one end of `NEEDED_NM` to the other, but for rounding."""
    reach = wavelength_nm[0] < NEEDED_NM[0] + 1e-3 and wavelength_nm[-1] > NEEDED_NM[1] - 1e-3
    return bool(reach and np.all(np.diff(wavelength_nm) > 0.0))


def resample(wavelength_nm: Any, values: Any, where: str = "spectrum") -> np.ndarray:
    """Values (81,) at `WAVELENGTHS_NM` of samples (n,) at rising wavelengths, linear between them."""
    wavelength_nm, values = np.asarray(wavelength_nm, float), np.asarray(values, float)
    if wavelength_nm.ndim != 1 or wavelength_nm.shape != values.shape or len(values) < 2:
        raise InputError(f"{where}: a spectrum is two lists of equal length, wavelengths and values, of two numbers at least")
    if not np.all(np.isfinite(values)):
        raise InputError(f"{where}: a value is not finite")
    if not covers(wavelength_nm):
        reach = f"from {wavelength_nm[0]:g} to {wavelength_nm[-1]:g} nm"
        raise InputError(f"{where}: {reach}; wavelengths should rise, in nm, and cover {NEEDED_NM[0]:g} to {NEEDED_NM[1]:g} nm")
    return np.interp(WAVELENGTHS_NM, wavelength_nm, values)


def resampling(wavelength_nm: np.ndarray) -> np.ndarray:
    """Matrix (n, 81) that takes many spectra (m, n) at rising wavelengths (n,) to `WAVELENGTHS_NM`: `spectra @ resampling(...)`."""
    return np.stack([np.interp(WAVELENGTHS_NM, wavelength_nm, one) for one in np.eye(len(wavelength_nm))])


@functools.cache
def rgb_weights(illuminant: str = "D65") -> np.ndarray:
    """Weights (81, 3): `spectrum @ rgb_weights()` is the linear Rec.709 colour of a reflectance or transmittance in this light.

    CIE 1931 2 degree observer; for other light than D65, what is white in it is adapted to white by Bradford's transform.
    """
    colour = _colour()
    known = colour.SDS_ILLUMINANTS
    if illuminant not in known:
        raise InputError(f"illuminant = {illuminant!r} is not one of {', '.join(sorted(known))}")
    shape = colour.SpectralShape(WAVELENGTHS_NM[0], WAVELENGTHS_NM[-1], 5.0)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    light = known[illuminant].copy().align(shape).values
    xyz = observer * light[:, None]
    xyz = xyz / np.sum(xyz[:, 1])
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    adapted = colour.adaptation.matrix_chromatic_adaptation_VonKries(
        np.sum(xyz, 0), space.matrix_RGB_to_XYZ @ np.ones(3), transform="Bradford"
    )
    return xyz @ (space.matrix_XYZ_to_RGB @ adapted).T


@functools.cache
def daylight_weights() -> np.ndarray:
    """`rgb_weights()` (81, 3) without colour-science: for what a material is prepared with."""
    return np.loadtxt(DAYLIGHT, delimiter=",")[:, 1:]


def delta_e(rgb: Any, other: Any) -> np.ndarray:
    """CIE delta E 2000 (n,) between linear Rec.709 colours (n, 3), white being (1, 1, 1). About 1 can just be seen."""
    colour = _colour()
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    lab = [colour.XYZ_to_Lab(np.asarray(c) @ space.matrix_RGB_to_XYZ.T, space.whitepoint) for c in (rgb, other)]
    return np.atleast_1d(colour.delta_E(*lab, method="CIE 2000"))


@dataclasses.dataclass(frozen=True)
class Absorption:
    """An absorption spectrum as three channels, and how far off that is."""

    absorption_per_mm: np.ndarray
    """(3,) [1/mm], for a coat together with its thickness."""
    thickness_um: float
    """Where the colour is exact."""
    thicknesses_um: np.ndarray
    """(n,), at which the error is stated."""
    delta_e: np.ndarray
    """(n,) CIE delta E 2000 of light that went down to a white base and back, three channels against the spectrum."""
    limited: tuple[str, ...]
    """Channels of a colour outside of Rec.709, which no absorption gives: it is not exact there."""

    @property
    def tau(self) -> np.ndarray:
        """(3,) optical depth, one way at normal incidence, at `thickness_um`."""
        return self.absorption_per_mm * (self.thickness_um * 1e-3)


def absorption_rgb(wavelength_nm: Any, absorption_per_mm: Any, thickness_um: float, illuminant: str = "D65") -> Absorption:
    """Absorption of a coat in three channels, from its spectrum: samples (n,) in nm and in 1/mm, for a coat of this thickness.

    Light goes through a coat twice. The colour after both ways, at normal incidence, is that of the spectrum at `thickness_um`;
    thinner and thicker coats, and slanting light, are off by what is stated: a mean of exponentials is no exponential.
    """
    spectrum = resample(wavelength_nm, absorption_per_mm, "absorption spectrum")
    if np.any(spectrum < 0.0):
        raise InputError("absorption spectrum: an absorption is negative; a medium that absorbs does not amplify")
    if not thickness_um > 0.0:
        raise InputError(f"thickness_um = {thickness_um!r} should be above 0")
    weights = rgb_weights(illuminant)
    rgb = np.exp(-2e-3 * thickness_um * spectrum) @ weights
    reached = np.clip(rgb, DARKEST, 1.0)
    channels = -np.log(reached) / (2e-3 * thickness_um)
    thicknesses = thickness_um * np.array(THICKNESSES)
    both_ways = 2e-3 * thicknesses[:, None]
    error = delta_e(np.exp(-both_ways * channels), np.exp(-both_ways * spectrum) @ weights)
    # Rounding of a clear channel is no limit.
    limited = tuple(c for c, a, b in zip("rgb", rgb, reached, strict=True) if abs(a - b) > 1e-9)
    return Absorption(channels, float(thickness_um), thicknesses, error, limited)
