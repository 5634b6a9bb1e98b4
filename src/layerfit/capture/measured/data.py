"""What every format of a measured BRDF is read to: pairs of directions and a value for each."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from ...documents import read_bytes
from ...errors import InputError

MOST_BYTES = 2**30
"""Largest file that is read: MERL's are 33 MB, the largest of RGL some hundred."""

HORIZON = 1e-4
"""Cosine below which a direction lies in the surface or below it."""


@dataclasses.dataclass(frozen=True)
class MeasuredBrdf:
    """A measured BRDF: f(wi, wo) at n pairs of directions, those with a value alone."""

    path: Path
    kind: str
    """The format: "Cornell", "RGL", "MERL" or "table"."""
    description: str
    """What the file says of the sample; may be empty."""
    wi: np.ndarray
    """(n, 3) unit directions to the light, in the surface frame."""
    wo: np.ndarray
    """(n, 3) unit directions to the viewer."""
    f: np.ndarray
    """(n, 3) BRDF [1/sr], linear Rec.709, without the cosine; nowhere negative."""
    isotropic: bool
    """Whether the azimuth was measured as a difference alone: a grain does not show."""
    layout: dict[str, Any]
    """How it was tabulated: sizes, angles, wavelengths, illuminant."""
    dropped: dict[str, int]
    """Entries of the file that are not used, by reason."""
    clipped: int
    """Single channels below 0, colours outside of Rec.709, that were set to 0."""


def measured(
    path: Path,
    kind: str,
    description: str,
    wi: np.ndarray,
    wo: np.ndarray,
    f: np.ndarray,
    *,
    isotropic: bool,
    layout: dict[str, Any],
    valid: np.ndarray | None = None,
) -> MeasuredBrdf:
    """The record of n entries of a file, wi, wo and f (n, 3): what has no value is left out and counted.

    A zero in all channels is where an instrument saw nothing, or less than nothing and was clipped: it is no measurement of black.
    """
    reasons = {
        "marked as invalid": np.ones(len(f), bool) if valid is None else valid,
        "NaN or infinite": np.all(np.isfinite(f), -1) & np.all(np.isfinite(wi), -1) & np.all(np.isfinite(wo), -1),
        "below the horizon": (wi[:, 2] > HORIZON) & (wo[:, 2] > HORIZON),
        "zero or less in all channels": np.any(f > 0.0, -1),
    }
    kept, dropped = sieve(reasons, len(f))
    if not len(kept):
        lost = ", ".join(f"{count} {reason}" for reason, count in dropped.items())
        raise InputError(f"{path}: none of its {len(f)} entries has a value ({lost})")
    f = f[kept]
    return MeasuredBrdf(
        path, kind, description, wi[kept], wo[kept], np.maximum(f, 0.0), isotropic, layout, dropped, int(np.sum(f < 0.0))
    )


def sieve(reasons: dict[str, np.ndarray], count: int) -> tuple[np.ndarray, dict[str, int]]:
    """Indices of what passes every reason, and how many of `count` fell to each, counted once."""
    kept = np.ones(count, bool)
    dropped = {}
    for reason, passes in reasons.items():
        if lost := int(np.sum(kept & ~passes)):
            dropped[reason] = lost
        kept &= passes
    return np.flatnonzero(kept), dropped


def direction(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Unit directions (n, 3) at polar and azimuthal angles (n,) [rad]."""
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)], -1)


def mirrored(w: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Directions w (n, 3) mirrored about half vectors h (n, 3)."""
    return 2.0 * np.sum(w * h, -1, keepdims=True) * h - w


def half_angle(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Angle (n,) [rad] between the normal and the half vector."""
    h = wi + wo
    return np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2])


def read_file(path: Path) -> bytes:
    """A file whose size is that of a measurement. Raises `InputError`."""
    return read_bytes(path, MOST_BYTES, "a measured BRDF")
