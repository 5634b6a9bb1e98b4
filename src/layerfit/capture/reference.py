"""From the file of a render to the pixels of it that can be compared, and where they lie."""

import dataclasses
import functools
from pathlib import Path

import numpy as np

from ..errors import InputError
from .channels import Channels, resolve
from .exr import read_exr
from .geometry import Surface, normalise, sphere_surface, sphere_tangent, sphere_uv
from .lights import is_exact, receive
from .png import read_png
from .samples import View
from .scene import Camera, Light, Reference, Sphere

PROBES = 256
"""Pixels, and directions of each, that are tried before a quadrature is said to receive no light."""

LEAST_SINE = 1e-3
"""Of the angle between tangent and normal, times the length of the tangent: below it rounding decides where the tangent points."""

LEAST_PIXELS = 32
"""Fewer usable pixels than this are a fault of the scene, not a reference."""

KEPT_PIXELS = 2**18
"""Of an image whose geometry is remembered for the next one: some 30 MB."""

UNLIT = "lit at a grazing angle or not at all (cosine below {:g})"
"""Why a pixel that is seen well is not used."""


@dataclasses.dataclass(frozen=True, eq=False)
class Usable:
    """The pixels of an image that can be compared, by their row-major places, and where they lie."""

    index: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray | None
    uv: np.ndarray | None
    view: np.ndarray
    dropped: dict[str, int]


def load_reference(reference: Reference, min_cosine: float) -> View:
    """Read a reference render and keep the pixels that can be compared: covered, finite, seen and lit at no grazing angle."""
    channels = resolve(read_exr(reference.exr), dict(reference.channels))
    beauty = channels.beauty
    usable = _usable(reference, channels, min_cosine)
    _check(reference, usable, beauty)
    pick = lambda image: image.reshape(-1, 3)[usable.index].astype(float)  # noqa: E731
    return View(
        reference=reference,
        target=pick(beauty),
        noise=None if channels.noise is None else pick(channels.noise),
        position=usable.position,
        normal=usable.normal,
        tangent=usable.tangent,
        uv=usable.uv,
        view=usable.view,
        index=usable.index,
        shape=beauty.shape[:2],
        dropped=usable.dropped,
        picture=beauty,
    )


def _usable(reference: Reference, channels: Channels, min_cosine: float) -> Usable:
    height, width = channels.beauty.shape[:2]
    finite, mask = np.all(np.isfinite(channels.beauty), -1), _mask(reference.mask, (height, width))
    eye = np.asarray(reference.camera.position)
    if reference.geometry is None:
        surface, tangent, uv, whole = _surface(reference, channels)
        return _compared(surface, tangent, uv, eye, reference.lights, min_cosine, finite & whole, mask)
    if np.linalg.norm(eye - reference.geometry.center) <= reference.geometry.radius:
        raise InputError(f"{reference.exr}: the camera stands inside the sphere; check camera.position and geometry.radius")
    where = (
        reference.geometry,
        reference.camera,
        reference.lights,
        min_cosine,
        height,
        width,
        finite.tobytes(),
        mask.tobytes(),
    )
    small = height * width <= KEPT_PIXELS and all(is_exact(light) for light in reference.lights)
    return _on_sphere(*where) if small else _on_sphere.__wrapped__(*where)


@functools.lru_cache(maxsize=4)
def _on_sphere(
    sphere: Sphere,
    camera: Camera,
    lights: tuple[Light, ...],
    min_cosine: float,
    height: int,
    width: int,
    finite: bytes,
    mask: bytes,
) -> Usable:
    """Many images of one sphere under the same light, as those of a study, differ in their colours alone."""
    surface = sphere_surface(sphere, camera, height, width)
    left = (np.frombuffer(of, bool).reshape(height, width) for of in (finite, mask))
    tangent, uv = sphere_tangent(surface.normal, camera.up), sphere_uv(surface.normal, camera.up)
    return _compared(surface, tangent, uv, np.asarray(camera.position), lights, min_cosine, *left)


def _compared(
    surface: Surface,
    tangent: np.ndarray | None,
    uv: np.ndarray | None,
    eye: np.ndarray,
    lights: tuple[Light, ...],
    min_cosine: float,
    finite: np.ndarray,
    mask: np.ndarray,
) -> Usable:
    """The pixels that can be compared, of those (H, W) that are finite in the file and not masked."""
    view = normalise(eye - surface.position)
    reasons = {
        "not covered by the object": surface.covered,
        "NaN or infinite": finite,
        "masked": mask,
        f"seen at a grazing angle (cosine below {min_cosine:g})": min_cosine < np.sum(surface.normal * view, -1),
    }
    if tangent is not None:
        # A surface without texture coordinates has zeros in the tangent channel: no frame can be made of them.
        reasons["without a tangent"] = np.linalg.norm(np.cross(tangent, surface.normal), axis=-1) > LEAST_SINE
    kept = np.ones(mask.shape, bool)
    dropped = {}
    for reason, passes in reasons.items():
        dropped[reason] = int(np.sum(kept & ~passes))
        kept &= passes
    index = np.flatnonzero(kept)
    if all(is_exact(light) for light in lights):
        args = (surface.position.reshape(-1, 3)[index], surface.normal.reshape(-1, 3)[index], view.reshape(-1, 3)[index])
        received = receive(lights, *args, samples=1, seed=0)
        NoL = np.einsum("nsj,nj->ns", received.to_light, args[1])
        lit = np.any((min_cosine < NoL) & np.any(received.weight > 0.0, -1), 1)
        # A pixel that a grazing light reaches and no other holds little but the model's weakest angle.
        dropped[UNLIT.format(min_cosine)] = int(np.sum(~lit))
        index = index[lit]
    pick = lambda image: image.reshape(-1, image.shape[-1])[index]  # noqa: E731
    left_out = {reason: count for reason, count in dropped.items() if count}
    return Usable(
        index=index,
        position=pick(surface.position),
        normal=pick(surface.normal),
        tangent=None if tangent is None else pick(tangent),
        uv=None if uv is None else pick(uv),
        view=pick(view),
        dropped=left_out,
    )


def _check(reference: Reference, usable: Usable, beauty: np.ndarray) -> None:
    """Raise `InputError` for an image of which too little can be compared."""
    size, exact = usable.index.size, all(is_exact(light) for light in reference.lights)
    if size < LEAST_PIXELS:
        if exact and size + sum(count for reason, count in usable.dropped.items() if reason.startswith(UNLIT[:3])):
            raise InputError(_unlit(reference))
        lost = ", ".join(f"{count} {reason}" for reason, count in usable.dropped.items())
        raise InputError(f"{reference.exr}: only {size} of {beauty.shape[0] * beauty.shape[1]} pixels can be compared ({lost})")
    if not np.any(beauty.reshape(-1, 3)[usable.index] > 0.0):
        raise InputError(
            f"{reference.exr}: the object is black in every usable pixel; check the beauty channels and the lights"
        )
    if not exact:
        some = slice(None, None, max(1, size // PROBES))
        args = (values[some] for values in (usable.position, usable.normal, usable.view))
        if not np.any(receive(reference.lights, *args, samples=PROBES, seed=0).weight > 0.0):
            raise InputError(_unlit(reference))


def _unlit(reference: Reference) -> str:
    return f"{reference.exr}: no light reaches the visible side of the object; check where the lights in [[light]] are, and how bright"


def _surface(reference: Reference, channels: Channels) -> tuple[Surface, np.ndarray | None, np.ndarray | None, np.ndarray]:
    """The surface as the file has it, its tangents and its texture coordinates; and where all of these are numbers, (H, W). Elsewhere they are 0."""
    if channels.normal is None or channels.position is None:
        missing = "normal" if channels.normal is None else "position"
        raise InputError(
            f'{reference.exr}: there is no {missing} channel and the scene gives no geometry. Render one, name it with {missing} = "..." '
            'under [reference], or give [geometry] kind = "sphere".'
        )
    found = [channels.normal, channels.position, channels.tangent, channels.uv]
    whole = np.all([np.isfinite(values).all(-1) for values in found if values is not None], 0)
    normal, position = _numbers(channels.normal), _numbers(channels.position)
    tangent, uv = (None if values is None else _numbers(values) for values in found[2:])
    covered = np.linalg.norm(normal, axis=-1) > 0.5
    if channels.alpha is not None:
        covered &= channels.alpha > 1.0 - 1e-4
    else:
        # Without coverage, a pixel at a silhouette shows in its neighbours: some of them are empty.
        covered = _eroded(covered)
    return Surface(position, normalise(normal), covered), tangent, uv, whole


def _numbers(image: np.ndarray) -> np.ndarray:
    """Vectors of an image, 0 where they are none; in double precision no square of one overflows."""
    return np.where(np.isfinite(image).all(-1, keepdims=True), image, 0.0).astype(float)


def _eroded(mask: np.ndarray) -> np.ndarray:
    padded = np.pad(mask, 1, constant_values=False)
    result = mask.copy()
    for dy in (0, 1, 2):
        for dx in (0, 1, 2):
            result &= padded[dy : dy + mask.shape[0], dx : dx + mask.shape[1]]
    return result


def _mask(path: Path | None, shape: tuple[int, int]) -> np.ndarray:
    if path is None:
        return np.ones(shape, bool)
    first = read_png(path) if path.suffix.lower() == ".png" else next(iter(read_exr(path).channels.values()))
    if first.shape != shape:
        raise InputError(
            f"{path}: the mask is {first.shape[1]} x {first.shape[0]}, the reference {shape[1]} x {shape[0]} pixels"
        )
    return first > 0.5
