"""Lights as directions and weights: what each pixel receives, per unit of BRDF.

A pixel is the sum over samples of f(wi, wo) times weight. Directional and point lights are one sample each, exact. Constant,
spherical, flat and environment light is a quadrature: directions drawn for each pixel from a mixture of a cosine lobe, half vectors of
three widths and (all but the constant one) the light itself, weighted by the balance heuristic (Veach and Guibas 1995).
"""

import dataclasses
import functools
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .exr import read_exr
from .geometry import frames
from .scene import Constant, Directional, Disk, EnvironmentMap, FlatLight, Light, Point, SphereLight

if TYPE_CHECKING:
    from typing_extensions import TypeIs

HALF_VECTOR_WIDTHS = (0.06, 0.18, 0.5)
"""GGX widths of the half vectors: between them they follow lobes from a polished coat to a rough base."""


CACHED = 2**16
"""Directions that are worked on at a time: as many as stay in a processor's cache."""


@dataclasses.dataclass(frozen=True)
class Received:
    """Light at n points: unit directions to it and weights (radiance per unit of BRDF), each (n, samples, 3), world frame."""

    to_light: np.ndarray
    weight: np.ndarray
    source: np.ndarray
    """(samples,) which of the lights each is of."""


def is_exact(light: Light) -> "TypeIs[Directional | Point]":
    """Whether one sample is all there is to it."""
    return isinstance(light, (Directional, Point))


def receive(
    lights: tuple[Light, ...],
    position: np.ndarray,
    normal: np.ndarray,
    view: np.ndarray,
    samples: int,
    seed: int,
    widths: tuple[float, ...] = HALF_VECTOR_WIDTHS,
) -> Received:
    """Light at points (n, 3): one sample for each exact light, and `samples` for each of the others.

    `widths` are of the half vectors: those of the lobes that are looked at.
    """
    # Each light its own numbers, and the same: two that are the same light everywhere then show as one.
    rngs = [np.random.default_rng(seed) for _ in lights]
    size = max(1, CACHED // samples)
    blocks = [slice(start, start + size) for start in range(0, max(len(position), 1), size)]
    rows = [_receive(lights, position[b], normal[b], view[b], samples, rngs, widths) for b in blocks]
    return Received(np.concatenate([r.to_light for r in rows]), np.concatenate([r.weight for r in rows]), rows[0].source)


def _receive(lights, position, normal, view, samples, rngs, widths) -> Received:
    parts = [
        _exact(light, position, normal) if is_exact(light) else _quadrature(light, position, normal, view, samples, rng, widths)
        for light, rng in zip(lights, rngs, strict=True)
    ]
    source = np.repeat(np.arange(len(parts)), [to_light.shape[1] for to_light, _ in parts])
    to_light, weight = (np.concatenate(arrays, 1) for arrays in zip(*parts, strict=True))
    return Received(to_light, weight, source)


def _exact(light: Directional | Point, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(light, Directional):
        to_light = np.broadcast_to(light.to_light, position.shape)
        intensity = np.broadcast_to(light.irradiance_rgb, position.shape)
    else:
        away = np.subtract(light.position, position)
        distance2 = np.sum(away * away, -1, keepdims=True)
        to_light = away / np.sqrt(distance2)
        intensity = np.asarray(light.intensity_rgb) / distance2
    cosine = np.maximum(np.sum(normal * to_light, -1, keepdims=True), 0.0)
    return to_light[:, None], (intensity * cosine)[:, None]


def _quadrature(
    light: Constant | SphereLight | FlatLight | EnvironmentMap,
    position: np.ndarray,
    normal: np.ndarray,
    view: np.ndarray,
    samples: int,
    rng: np.random.Generator,
    widths: tuple[float, ...],
) -> tuple[np.ndarray, np.ndarray]:
    n = len(position)
    own = None if isinstance(light, Constant) else _sampler(light, position)
    # Directions to a lamp are spread over it: to what scatters everywhere they are as good as a cosine lobe.
    wide = not isinstance(light, (SphereLight, FlatLight))
    each = max(1, samples // (wide + len(widths) + (own is not None)))
    to_surface = frames(normal, None)
    wo = np.einsum("nij,nj->ni", to_surface, view)
    drawn = [_cosine_lobe(_points(n, each, rng))] if wide else []
    for alpha in widths:
        h = _ggx_normals(_points(n, each, rng), alpha)
        drawn.append(2.0 * np.sum(h * wo[:, None], -1, keepdims=True) * h - wo[:, None])
    directions = [w @ to_surface for w in drawn]
    if own:
        directions.append(own.draw(_points(n, each, rng)))
    to_light = np.concatenate(directions, 1)
    wi = to_light @ to_surface.swapaxes(1, 2)
    mixture = _half_vector_pdf(wi, wo, widths)
    if wide:
        mixture = mixture + _cosine_pdf(wi)
    if own:
        density, radiance = own.seen(to_light)
        mixture = mixture + density
    else:
        assert isinstance(light, Constant)
        radiance = np.broadcast_to(light.radiance_rgb, to_light.shape)
    cosine = wi[..., 2]
    scale = np.where((cosine > 0.0) & (mixture > 0.0), cosine / np.where(mixture > 0.0, mixture * each, 1.0), 0.0)
    return to_light, radiance * scale[..., None]


def _points(n: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """The R2 sequence (Roberts 2018) of `count` points in the unit square, shifted at random for each of n pixels."""
    g = 1.32471795724474602596
    base = (0.5 + np.arange(1, count + 1)[:, None] * np.array([1.0 / g, 1.0 / g**2])) % 1.0
    return (base[None] + rng.random((n, 1, 2))) % 1.0


def _cosine_lobe(u: np.ndarray) -> np.ndarray:
    r, phi = np.sqrt(u[..., 0]), 2.0 * np.pi * u[..., 1]
    return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1.0 - u[..., 0])], -1)


def _cosine_pdf(w: np.ndarray) -> np.ndarray:
    return np.maximum(w[..., 2], 0.0) / np.pi


def _ggx_normals(u: np.ndarray, alpha: float) -> np.ndarray:
    """Normals with density D h.z (Walter et al. 2007, eqs. 35 and 36)."""
    tan2 = alpha * alpha * u[..., 0] / (1.0 - u[..., 0])
    z = 1.0 / np.sqrt(1.0 + tan2)
    r, phi = np.sqrt(np.maximum(1.0 - z * z, 0.0)), 2.0 * np.pi * u[..., 1]
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)


def _half_vector_pdf(wi: np.ndarray, wo: np.ndarray, widths: tuple[float, ...]) -> np.ndarray:
    """Density of directions reflected at such normals, summed over the widths."""
    h = wi + wo[:, None]
    h2, side2 = np.einsum("nsi,nsi->ns", h, h), h[..., 0] ** 2 + h[..., 1] ** 2
    length = np.sqrt(np.where(h2 > 0.0, h2, 1.0))
    c, z = (h @ wo[..., None])[..., 0] / length, h[..., 2] / length
    tan2 = side2 / np.maximum(h[..., 2], 1e-30) ** 2
    # D z / (4 c), with D = 1 / (pi alpha^2 z^4 (1 + tan^2 / alpha^2)^2)
    lobes = sum(1.0 / (alpha * (1.0 + tan2 / alpha**2)) ** 2 for alpha in widths)
    there = (c > 0.0) & (z > 0.0)
    return np.where(there, lobes / (4.0 * np.pi * np.maximum(c, 1e-9) * np.where(there, z, 1.0) ** 3), 0.0)


def _sampler(
    light: SphereLight | FlatLight | EnvironmentMap, position: np.ndarray
) -> "_SphereSampler | _FlatSampler | _MapSampler":
    if isinstance(light, SphereLight):
        return _SphereSampler(light, position)
    if isinstance(light, FlatLight):
        return _FlatSampler(light, position)
    return _map_sampler(light)


class _SphereSampler:
    """Directions to a sphere, uniform in the cone that it fills."""

    def __init__(self, light: SphereLight, position: np.ndarray):
        away = np.subtract(light.center, position)
        distance = np.linalg.norm(away, axis=-1)
        if np.any(distance <= light.radius):
            raise InputError("a spherical light holds part of the surface that it lights: make its radius smaller or move it")
        self.axis = away / distance[:, None]
        self.rise = 1.0 - np.sqrt(1.0 - (light.radius / distance) ** 2)  # 1 - cos of the half angle
        self.radiance = np.asarray(light.radiance_rgb)

    def draw(self, u: np.ndarray) -> np.ndarray:
        z = 1.0 - u[..., 0] * self.rise[:, None]
        r, phi = np.sqrt(np.maximum(1.0 - z * z, 0.0)), 2.0 * np.pi * u[..., 1]
        local = np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)
        return np.einsum("nji,nsj->nsi", frames(self.axis, None), local)

    def seen(self, to_light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Density [1/sr] of directions (n, samples, 3) in what is drawn, and radiance from there."""
        there = np.einsum("nsi,ni->ns", to_light, self.axis) >= (1.0 - self.rise)[:, None]
        return there / (2.0 * np.pi * self.rise[:, None]), there[..., None] * self.radiance


class _FlatSampler:
    """Directions to a rectangle or a disk, uniform in its area."""

    def __init__(self, light: FlatLight, position: np.ndarray):
        self.round = isinstance(light, Disk)
        self.away = np.subtract(light.center, position)
        self.halves = np.array([light.half_u, light.half_v])
        across = np.cross(light.half_u, light.half_v)
        self.normal = across / np.linalg.norm(across)
        self.area = (np.pi if self.round else 4.0) * np.linalg.norm(across)
        self.within = np.linalg.pinv(self.halves)  # (3, 2): a point of its plane, in half widths
        self.radiance = np.asarray(light.radiance_rgb)

    def draw(self, u: np.ndarray) -> np.ndarray:
        if self.round:
            r, phi = np.sqrt(u[..., 0]), 2.0 * np.pi * u[..., 1]
            place = np.stack([r * np.cos(phi), r * np.sin(phi)], -1)
        else:
            place = 2.0 * u - 1.0
        away = self.away[:, None] + place @ self.halves
        return away / np.linalg.norm(away, axis=-1, keepdims=True)

    def seen(self, to_light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Density [1/sr] and radiance; both 0 where a direction misses the light, or comes to its back."""
        facing = -(to_light @ self.normal)
        distance = -(self.away @ self.normal)[:, None] / np.where(facing > 0.0, facing, 1.0)
        place = (distance[..., None] * to_light - self.away[:, None]) @ self.within
        inside = np.sum(place**2, -1) <= 1.0 if self.round else np.max(np.abs(place), -1) <= 1.0
        there = inside & (facing > 0.0) & (distance > 0.0)
        density = np.where(there, distance**2 / (self.area * np.where(there, facing, 1.0)), 0.0)
        return density, there[..., None] * self.radiance


class _MapSampler:
    """Directions of a lat-long map, by the luminance of its texels."""

    def __init__(self, image: np.ndarray, scale: np.ndarray, up: str, rows: str):
        self.image = image * scale
        self.up = up
        self.on_poles = rows == "on poles"
        height, _ = image.shape[:2]
        sine = np.sin((np.arange(height) + 0.5) / height * np.pi)
        # A little for every texel: interpolation spreads light to the neighbours of a bright one.
        power = (np.mean(self.image, -1) + 0.05 * np.mean(self.image)) * sine[:, None]
        self.texel = power / np.sum(power)
        self.cumulative = np.cumsum(self.texel.ravel())
        self.sine = sine

    def draw(self, u: np.ndarray) -> np.ndarray:
        height, width = self.texel.shape
        index = np.minimum(np.searchsorted(self.cumulative, u[..., 0]), self.texel.size - 1)
        below = self.cumulative[index] - self.texel.ravel()[index]
        within = np.clip((u[..., 0] - below) / self.texel.ravel()[index], 0.0, 1.0)
        row, column = np.divmod(index, width)
        phi = 2.0 * np.pi * (column + within) / width
        theta = np.pi * (row + u[..., 1]) / height
        d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1)
        return _from_map(d, self.up)

    def seen(self, to_light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Density [1/sr] of the texel, and radiance between the texels."""
        height, width = self.texel.shape
        d = _to_map(to_light, self.up)
        u = (np.arctan2(d[..., 0], -d[..., 2]) / (2.0 * np.pi)) % 1.0
        v = np.arccos(np.clip(d[..., 1], -1.0, 1.0)) / np.pi
        row = np.minimum((v * height).astype(int), height - 1)
        column = np.minimum((u * width).astype(int), width - 1)
        sine = np.maximum(np.sin(np.pi * v), 1e-6)
        return self.texel[row, column] * height * width / (2.0 * np.pi**2 * sine), self._between(u, v)

    def _between(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        height, width = self.texel.shape
        x = u * width - 0.5
        y = v * (height - 1) if self.on_poles else np.clip(v * height - 0.5, 0.0, height - 1.0)
        x0, y0 = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), max(height - 2, 0))
        fx, fy = (x - x0)[..., None], (y - y0)[..., None]
        left, right, low = x0 % width, (x0 + 1) % width, np.minimum(y0 + 1, height - 1)
        texels = self.image.reshape(-1, 3)
        at = lambda row, column: texels.take(row * width + column, 0)  # noqa: E731  several times faster than [row, column]
        top = at(y0, left) * (1.0 - fx) + at(y0, right) * fx
        bottom = at(low, left) * (1.0 - fx) + at(low, right) * fx
        return top * (1.0 - fy) + bottom * fy


def _to_map(d: np.ndarray, up: str) -> np.ndarray:
    return d if up == "y" else np.stack([d[..., 0], d[..., 2], -d[..., 1]], -1)


def _from_map(d: np.ndarray, up: str) -> np.ndarray:
    return d if up == "y" else np.stack([d[..., 0], -d[..., 2], d[..., 1]], -1)


@functools.lru_cache(maxsize=4)
def _map_sampler(light: EnvironmentMap) -> _MapSampler:
    from .channels import resolve

    image = resolve(read_exr(light.file), {}).beauty.astype(float)
    if not np.all(np.isfinite(image)) or np.any(image < 0.0) or not np.any(image > 0.0):
        raise InputError(f"{light.file}: an environment map holds finite radiance, nowhere negative and somewhere above 0")
    return _MapSampler(image, np.asarray(light.scale), light.up, light.rows)
