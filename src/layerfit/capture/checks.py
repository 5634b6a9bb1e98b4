"""What can be wrong with a reference: measured on its pixels, said with advice, never corrected in silence."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .channels import ROLES, Channels
from .exr import HALF_MAX, Exr

COVERED = 0.999
"""Least alpha of a fully covered pixel (renderers round filter weights): below it, normals and positions mix with nothing."""

_FEW = 16  # pixels: fewer say nothing of a picture
_UNIT = 0.02  # error of a normal's length: means over a pixel of a curved surface and half floats stay within
_TURNED = 3.0  # degrees between normals and positions: a half-float position on 128 pixels makes one
_UNLIKE = 25.0  # degrees: more than bump mapping or coarse meshes make in the middle of a picture
_SAME_DEPTH = 0.005  # rms over the mean depth: half floats and Mitsuba's near plane stay within
_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
_PRIMARIES = {
    "ACEScg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),
    "ACES2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
    "Rec.2020": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "P3-D65": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),
}


@dataclass(frozen=True)
class Finding:
    """What is not as a fit takes it to be. A note needs nothing, or only knowing; a warning needs someone to act."""

    what: str
    severity: Literal["note", "warning"]
    detail: str
    advice: str


def check(channels: Channels, exr: Exr, eye: Sequence[float] | np.ndarray | None = None) -> list[Finding]:
    """All findings. `eye` is the camera's position, by default from the header; where neither says it, depth goes unchecked."""
    where = _header_eye(exr) if eye is None else np.asarray(eye, np.float64)
    covered = _covered(channels)
    return [
        *_windows(exr),
        *_beauty(channels, exr),
        *_not_finite(channels, covered),
        *_half(channels, exr),
        *_coverage(channels, covered),
        *_normals(channels, covered, where),
        *_depth(channels, covered, where),
    ]


def _covered(channels: Channels) -> np.ndarray:
    """The fully covered pixels: by alpha, else where there is geometry, else all."""
    if channels.alpha is not None:
        return channels.alpha >= COVERED
    for vectors in (channels.normal, channels.position):
        if vectors is not None:
            return np.any(vectors != 0, -1)
    return np.ones(channels.beauty.shape[:2], bool)


def _header_eye(exr: Exr) -> np.ndarray | None:
    """The camera's position from `worldToCamera`, which acts on row vectors."""
    matrix = np.asarray(exr.header.get("worldToCamera", ()))
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-30:
        return None
    eye = np.linalg.inv(matrix)[3]
    return eye[:3] / eye[3] if eye[3] else None


def _windows(exr: Exr) -> Iterator[Finding]:
    x0, y0, x1, y1 = exr.display_window
    for window in dict.fromkeys(part.data_window for part in exr.parts if part.data_window != exr.display_window):
        parts = ", ".join(part.name for part in exr.parts if part.name and part.data_window == window)
        where = f"pixels of {parts}" if parts else "pixels"
        detail = f"{where} from {window[:2]} to {window[2:]}, the picture from {(x0, y0)} to {(x1, y1)}"
        inside = window[0] <= x1 and window[2] >= x0 and window[1] <= y1 and window[3] >= y0
        if inside:
            advice = "None needed: pixels outside the picture (overscan) are cropped, and where there are none it is black."
            yield Finding("data window differs from display window", "note", detail, advice)
        else:
            advice = "Nothing of it can be seen; render again with the region inside the picture."
            yield Finding("data window lies outside the display window", "warning", detail, advice)


def _beauty(channels: Channels, exr: Exr) -> Iterator[Finding]:
    if not np.any(channels.beauty[np.isfinite(channels.beauty)] > 0):
        detail = f"no value of {', '.join(channels.names['beauty'])} is above 0"
        yield Finding("the beauty is black", "warning", detail, "Check the lights, or name another layer as beauty.")
    header = next((part.header for part in exr.parts if channels.names["beauty"][0] in part.channels), {})
    chromaticities = header.get("chromaticities")
    space = header.get("colorInteropID")
    advice = "Save the render in linear Rec.709: colours of the fit are in these primaries."
    if isinstance(chromaticities, tuple) and len(chromaticities) == 8 and not _alike(chromaticities, _REC709):
        name = next((f", which is {name}" for name, values in _PRIMARIES.items() if _alike(chromaticities, values)), "")
        detail = f"chromaticities are {', '.join(f'{value:.4g}' for value in chromaticities)}{name}"
        yield Finding("primaries are not Rec.709", "warning", detail, advice)
    elif isinstance(space, str) and space not in ("lin_rec709_scene", "data", "unknown"):
        yield Finding("colour space is not linear Rec.709", "warning", f"colorInteropID is {space!a}", advice)


def _alike(a: Sequence[float], b: Sequence[float]) -> bool:
    return bool(np.allclose(a, b, rtol=0, atol=2e-3))


def _not_finite(channels: Channels, covered: np.ndarray) -> Iterator[Finding]:
    for role in ROLES:
        values = getattr(channels, role)
        if values is None or np.isfinite(values).all():
            continue
        pixels = ~np.isfinite(values.reshape(*covered.shape, -1)).all(-1)
        row, column = np.argwhere(pixels)[0]
        inside = int(np.count_nonzero(pixels & covered))
        detail = (
            f"{np.isnan(values).sum()} NaN and {np.isinf(values).sum()} infinite numbers in {pixels.sum()} pixels, "
            f"{inside} of them fully covered; the first is row {row}, column {column}"
        )
        # beyond the geometry, an infinite depth is what some renderers write
        matters = inside > 0 or role in ("beauty", "alpha")
        advice = "Find what the renderer does there; such pixels can only be left out." if matters else "None needed."
        yield Finding(f"{role} is not finite", "warning" if matters else "note", detail, advice)


def _half(channels: Channels, exr: Exr) -> Iterator[Finding]:
    half = [role for role, names in channels.names.items() if any(name in exr.half for name in names)]
    if "beauty" in half:
        detail = "stored as half floats: relative step 2^-11 (0.05 %), largest value 65504"
        yield Finding("beauty in half floats", "note", detail, "Save 32-bit floats where a fit should be better than 0.1 %.")
    if geometry := [role for role in half if role in ("normal", "position", "depth")]:
        detail = f"{', '.join(geometry)} stored as half floats: relative step 2^-11"
        yield Finding(
            "geometry in half floats", "note", detail, "Save 32-bit floats: narrow highlights see errors of a normal."
        )
    # also in float files, which may have been half floats before
    clipped = channels.beauty >= HALF_MAX if "beauty" in half else channels.beauty == HALF_MAX
    if count := np.count_nonzero(clipped):
        detail = f"{count} numbers are at 65504 or above, the end of half floats"
        yield Finding(
            "beauty is clipped", "warning", detail, "Save 32-bit floats, or lower the lights: clipped pixels mislead a fit."
        )


def _coverage(channels: Channels, covered: np.ndarray) -> Iterator[Finding]:
    if channels.alpha is None:
        return
    if partly := np.count_nonzero((channels.alpha > 0) & ~covered):
        detail = f"{partly} pixels with alpha between 0 and {COVERED}, {np.count_nonzero(covered)} above"
        advice = "Leave them out of a fit: beauty, normal and position mix there with the background."
        yield Finding("partly covered pixels", "note", detail, advice)
    if not covered.any():
        largest = np.max(channels.alpha, where=np.isfinite(channels.alpha), initial=0.0)
        detail = f"the largest alpha is {largest:.4g}"
        advice = 'Render with a transparent background, or say alpha = "none" and give a mask.'
        yield Finding("no pixel is fully covered", "warning", detail, advice)


def _normals(channels: Channels, covered: np.ndarray, eye: np.ndarray | None) -> Iterator[Finding]:
    if channels.normal is None:
        return
    there = covered & np.any(channels.normal != 0, -1)
    if (without := np.count_nonzero(covered & ~there) / max(1, np.count_nonzero(covered))) > 0.001:
        advice = 'Give a mask, or say alpha = "none": these pixels are background, or surfaces without normals.'
        yield Finding("covered pixels without a normal", "warning", f"{without:.1%} of the fully covered pixels", advice)
    there &= np.isfinite(channels.normal).all(-1)
    normals = channels.normal.astype(np.float64)
    if np.count_nonzero(there) < _FEW:
        return
    decoded = 2.0 * normals - 1.0
    length = np.linalg.norm(normals[there], axis=-1)
    off = np.abs(length - 1) > _UNIT
    in_range = normals[there].min() > -_UNIT and normals[there].max() < 1 + _UNIT
    if in_range and np.mean(off) > 0.5 and np.mean(np.abs(np.linalg.norm(decoded[there], axis=-1) - 1) > _UNIT) < 0.1:
        advice = "Render them as they are, from -1 to 1: as a data pass, without display transform."
        yield Finding("normals are encoded to 0..1", "warning", "2 N - 1 has unit length, N has not", advice)
        normals = decoded
    elif np.mean(off) > 0.01:
        severity = "warning" if abs(np.median(length) - 1) > _UNIT else "note"
        detail = f"{np.mean(off):.1%} of the covered pixels are off by more than {_UNIT}; the median is {np.median(length):.3f}"
        advice = "Save unfiltered normals, or a finer picture: a mean over directions is no normal."
        yield Finding("normals are not of unit length", severity, detail, advice)
    if channels.position is None:
        advice = "Render a position channel too, or make sure that normals are in world space."
        yield Finding("space of the normals is unchecked", "note", "there are no positions to compare them with", advice)
        return
    yield from _normal_space(normals, channels.position.astype(np.float64), there, eye)


def _normal_space(normals: np.ndarray, position: np.ndarray, there: np.ndarray, eye: np.ndarray | None) -> Iterator[Finding]:
    """Compare normals with the surface that the positions make, as they are and in the frame that suits them best."""
    surface, inner = _surface(position, there)
    if len(surface) < _FEW:
        return
    length = np.linalg.norm(normals[inner], axis=-1, keepdims=True)
    n = normals[inner] / np.maximum(length, 1e-30)
    # the gradients give the surface's side only up to one sign, which is that of the handedness of space and picture
    apart = min(_angle(n, surface), _angle(n, -surface))
    turned = _angle(n @ _frame(n, surface), surface)
    if apart > _TURNED and turned < apart / 3:
        detail = f"{apart:.1f} degrees from the surface of the positions, {turned:.1f} once turned or mirrored as a whole"
        advice = "Render normals in world space: these are in camera space, or have other axes than the positions."
        yield Finding("normals are not in the space of the positions", "warning", detail, advice)
    elif apart > _UNLIKE:
        detail = f"half of them are more than {apart:.0f} degrees from the surface that the positions make"
        advice = "Check that both channels are of the same surface, in world space, and not displaced after."
        yield Finding("normals do not follow the positions", "warning", detail, advice)
    elif eye is not None:
        away = float(np.mean(np.sum(n * (eye - position[inner]), -1) < 0))
        if away > 0.02:
            advice = "Turn them round in the renderer." if away > 0.5 else "Leave these pixels out: they see no front side."
            yield Finding("normals point away from the camera", "warning", f"{away:.1%} of the covered pixels", advice)


def _surface(position: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals by central differences of the positions, and the mask of the pixels that have all neighbours."""
    there = there & np.isfinite(position).all(-1)
    inner = np.zeros_like(there)
    inner[1:-1, 1:-1] = there[1:-1, 1:-1] & there[:-2, 1:-1] & there[2:, 1:-1] & there[1:-1, :-2] & there[1:-1, 2:]
    row, column = np.nonzero(inner)
    across = position[row, column + 1] - position[row, column - 1]
    down = position[row + 1, column] - position[row - 1, column]
    normal = np.cross(down, across)
    length = np.linalg.norm(normal, axis=-1)
    inner[row, column] = length > 0
    return normal[length > 0] / length[length > 0, None], inner


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Median angle between unit vectors, in degrees."""
    return float(np.degrees(np.median(np.arccos(np.clip(np.sum(a * b, -1), -1, 1)))))


def _frame(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation or mirroring R for which a R is nearest to b (Schoenemann 1966)."""
    u, _, vt = np.linalg.svd(a.T @ b)
    return u @ vt


def _depth(channels: Channels, covered: np.ndarray, eye: np.ndarray | None) -> Iterator[Finding]:
    if channels.depth is None or channels.position is None or eye is None:
        return
    there = covered & np.isfinite(channels.depth) & np.isfinite(channels.position).all(-1)
    there &= np.any(channels.position != 0, -1)  # a background that alpha counts
    z, p = channels.depth[there].astype(np.float64), channels.position[there].astype(np.float64)
    if len(z) < _FEW or not np.any(z):
        return
    ray = p - eye
    distance = np.linalg.norm(ray, axis=-1)
    axis = np.linalg.lstsq(ray, z, rcond=None)[0]
    scale = np.mean(distance)

    def apart(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.sqrt(np.mean((a - b) ** 2)) / scale)

    offset = float(np.median(distance - z))  # a renderer may count from the near plane
    as_distance = apart(z + offset, distance)
    as_planar = apart(z, ray @ axis) if abs(np.linalg.norm(axis) - 1) < 0.02 else np.inf
    in_camera = min(apart(np.abs(z), np.abs(p[:, 2])), apart(z, np.linalg.norm(p, axis=-1)))
    if in_camera < _SAME_DEPTH and np.linalg.norm(eye) > 0.02 * scale and min(as_distance, as_planar) > in_camera:
        detail = "the depth is that of the positions seen from the origin, where the camera is not"
        yield Finding("positions are in camera space", "warning", detail, "Render positions in world space.")
    elif min(as_distance, as_planar) > _SAME_DEPTH:
        detail = f"it differs from the distance by {as_distance:.1%}, from a planar depth by more than {_SAME_DEPTH:.1%}"
        advice = "Do not use it: it may be scaled, inverted, or of another camera than the scene's."
        yield Finding("depth does not fit positions and camera", "warning", detail, advice)
    elif as_distance < as_planar:
        detail = f"depth = |P - eye| to {as_distance:.1e} of it" + (
            f", less {offset:.4g}" if abs(offset) > 1e-4 * scale else ""
        )
        yield Finding("depth is the distance from the camera", "note", detail, "None needed, but it is no planar depth.")
    else:
        detail = f"depth = (P - eye) on the axis ({', '.join(f'{a:.3f}' for a in axis)}), to {as_planar:.1e} of it"
        yield Finding("depth is planar", "note", detail, "None needed, but it is no distance from the camera.")
