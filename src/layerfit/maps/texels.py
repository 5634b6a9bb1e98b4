"""Texels and what was seen of each: every pixel of every reference is an observation of one texel."""

import dataclasses

import numpy as np

from ..capture.geometry import frames
from ..capture.reference import load_reference
from ..capture.samples import View
from ..capture.scene import MeasuredReference, Reference, Scene
from ..errors import InputError
from ..fit.pixels import directions
from ..fit.weights import NOISE_EXPONENT, brightness
from ..stack import Stack

MOST_SEEN = 64
"""Observations of one texel that are used at most: of more, as a fine picture on a coarse map has, some are drawn at random."""


@dataclasses.dataclass(frozen=True)
class Texels:
    """Observations of n texels, by reference to N pixels of all references; float32."""

    shape: tuple[int, int]
    """Of the map."""
    index: np.ndarray
    """(n,) row-major places in the map; row 0 is the top."""
    rows: np.ndarray
    """(n, K) which of the N pixels each observation is; -1 for none."""
    of: np.ndarray
    """(N,) reference that a pixel is of."""
    wi: np.ndarray
    """(N, s, 3) directions of s light samples, in the frame of the pixel."""
    wo: np.ndarray
    """(N, 3)"""
    weight: np.ndarray
    """(N, s, 3) what each light sample brings per unit of BRDF."""
    target: np.ndarray
    """(N, 3) the pixels."""
    bright: np.ndarray
    """(references, 3) brightness of each reference."""
    noise: np.ndarray
    """(references,) c of its noise law c f^.7; 0 where the file does not state its noise."""
    frame: np.ndarray
    """(n, 3, 3) tangent, bitangent and normal of each texel, in world space."""
    tangents: bool
    """Whether the references say which way the tangent runs; else the frame is made of the normal alone (Duff et al. 2017)."""

    @property
    def seen(self) -> np.ndarray:
        """Observations of each texel, (n,)."""
        return np.sum(self.rows >= 0, 1)

    def image(self, values: np.ndarray, fill: float = 0.0) -> np.ndarray:
        """Values (n, ...) put in their places of the map, (H, W, ...)."""
        image = np.full((self.shape[0] * self.shape[1], *values.shape[1:]), fill, values.dtype)
        image[self.index] = values
        return image.reshape(*self.shape, *values.shape[1:])


def observe(scene: Scene, stack: Stack, size: int | None) -> Texels:
    """Read the references of a scene one by one, and sort their pixels by texel.

    Without `size` a texel is a pixel, and all references are of one camera; with it the map has `size` x `size` texels of the references'
    texture coordinates. Raises `InputError` for references that cannot be laid over one another.
    """
    references = _renders(scene, size)
    parts, places, shape = [], [], (0, 0)
    for k, reference in enumerate(references):
        view = load_reference(reference, scene.fit.min_cosine)
        view.check(stack)
        shape = _shape(view, shape, size)
        parts.append(_Part.of(view, k, scene.fit.seed))
        places.append(_place(view, size))
    place = np.concatenate(places)
    index, rows = _sorted(place, scene.fit.seed)
    lights = max(part.wi.shape[1] for part in parts)
    joined = {name: np.concatenate([part.padded(name, lights) for part in parts]) for name in _Part.ARRAYS}
    frame = joined.pop("frame")[rows[:, 0]]
    return Texels(
        shape,
        index,
        rows,
        of=np.repeat(np.arange(len(parts), dtype=np.int16), [len(part.wo) for part in parts]),
        bright=np.stack([part.bright for part in parts]).astype(np.float32),
        noise=np.array([part.noise for part in parts], np.float32),
        frame=frame,
        tangents=all(part.tangents for part in parts),
        **joined,
    )


def _renders(scene: Scene, size: int | None) -> list[Reference]:
    references = []
    for reference in scene.references:
        if isinstance(reference, MeasuredReference):
            raise InputError(f"{reference.path}: is a measured BRDF; a map is of images")
        if any(scale != 1.0 for scale in reference.thickness_scale.values()):
            raise InputError(f"{reference.path}: thickness_scale has no place in a map, whose references are of one object")
        references.append(reference)
    first = references[0]
    for other in references[1:] if size is None else []:
        if (other.camera, other.geometry) != (first.camera, first.geometry):
            raise InputError(
                f"{other.path}: another camera or geometry than of {first.path}; a map of pixels is of one view. "
                "Give `size`, the texels of a map over texture coordinates, or one camera"
            )
    return references


def _shape(view: View, before: tuple[int, int], size: int | None) -> tuple[int, int]:
    if size is not None:
        if view.uv is None:
            raise InputError(
                f"{view.reference.exr}: a map of {size} x {size} texels is over texture coordinates, and there are none. Render a uv channel, "
                'name it with uv = "..." under [reference], or leave `size` out for a map of pixels'
            )
        return size, size
    if before not in ((0, 0), view.shape):
        raise InputError(
            f"{view.reference.exr}: is {view.shape[1]} x {view.shape[0]}, the one before {before[1]} x {before[0]} pixels"
        )
    return view.shape


def _place(view: View, size: int | None) -> np.ndarray:
    """Row-major place in the map of every usable pixel: v grows upwards, rows downwards."""
    if size is None or view.uv is None:
        return view.index
    u, v = np.moveaxis(view.uv % 1.0, -1, 0)
    column, row = (np.minimum((x * size).astype(int), size - 1) for x in (u, 1.0 - v))
    return row * size + column


@dataclasses.dataclass(frozen=True)
class _Part:
    """What is kept of one reference."""

    ARRAYS = ("wi", "wo", "weight", "target", "frame")

    wi: np.ndarray
    wo: np.ndarray
    weight: np.ndarray
    target: np.ndarray
    frame: np.ndarray
    bright: np.ndarray
    noise: float
    tangents: bool

    @staticmethod
    def of(view: View, k: int, seed: int) -> "_Part":
        samples = view.samples(None, directions(view), seed)
        frame = frames(view.normal, view.tangent).astype(np.float32)
        noise = 0.0 if samples.noise is None else _noise(samples.target, samples.noise)
        arrays = (samples.wi, samples.wo, samples.weight, samples.target, frame)
        return _Part(*arrays, brightness(samples.target), noise, view.tangent is not None)

    def padded(self, name: str, lights: int) -> np.ndarray:
        value = getattr(self, name)
        missing = lights - value.shape[1] if name in ("wi", "weight") else 0
        return np.pad(value, ((0, 0), (0, missing), (0, 0)), "edge" if name == "wi" else "constant") if missing else value


def _noise(target: np.ndarray, noise: np.ndarray) -> float:
    """c of the law c f^.7 by which a reference's noise grows, from the standard errors that its file states."""
    target, noise = target.astype(float), noise.astype(float)  # the quotient of two float32 may be none
    known = np.isfinite(noise) & (noise > 0.0) & (target > 0.0)
    return float(np.median(noise[known] / target[known] ** NOISE_EXPONENT)) if known.any() else 0.0


def _sorted(place: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Places that are seen, and the pixels that see each: (n,) and (n, K), -1 where there are fewer."""
    # At random within a texel, so that what is beyond the most is left out fairly; in order, where each reference sees it once.
    order = np.random.default_rng(seed).permutation(len(place))
    order = order[np.argsort(place[order], kind="stable")]
    index, first, count = np.unique(place[order], return_index=True, return_counts=True)
    most = min(int(count.max()), MOST_SEEN)
    rank = np.arange(len(place)) - np.repeat(first, count)
    texel = np.repeat(np.arange(len(index)), count)
    kept = rank < most
    rows = np.full((len(index), most), -1, np.int32)
    rows[texel[kept], rank[kept]] = order[kept]
    return index, np.sort(rows, 1)[:, ::-1]
