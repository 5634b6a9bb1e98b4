"""Where each pixel of a reference lies: position, normal, view direction and tangent frame."""

import dataclasses

import numpy as np

from .scene import Camera, Sphere


@dataclasses.dataclass(frozen=True)
class Surface:
    """Geometry of an image: arrays of (H, W, 3), float64, and where there is any."""

    position: np.ndarray
    normal: np.ndarray
    covered: np.ndarray


def normalise(v: np.ndarray) -> np.ndarray:
    """Unit vectors; zero stays zero."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0.0, length, 1.0)


def camera_rays(camera: Camera, height: int, width: int) -> np.ndarray:
    """Unit directions through the pixel centres, (H, W, 3); row 0 is the top."""
    forward = normalise(np.subtract(camera.look_at, camera.position))
    right = normalise(np.cross(forward, camera.up))
    up = np.cross(right, forward)
    half = np.tan(0.5 * np.radians(camera.vfov_deg))
    y = (1.0 - (np.arange(height) + 0.5) / height * 2.0) * half
    x = ((np.arange(width) + 0.5) / width * 2.0 - 1.0) * half * width / height
    return normalise(forward + x[None, :, None] * right + y[:, None, None] * up)


def sphere_surface(sphere: Sphere, camera: Camera, height: int, width: int) -> Surface:
    """The sphere as the camera sees it. Pixels whose corners miss it are not covered: their means mix with the background."""
    d = camera_rays(camera, height, width)
    to_eye = np.subtract(camera.position, sphere.center)
    b = d @ to_eye
    closest2 = to_eye @ to_eye - b * b
    # A pixel at the silhouette mixes with the background: half a diagonal of a pixel, seen at the distance of the sphere.
    half_diagonal = np.tan(0.5 * np.radians(camera.vfov_deg)) / height * np.sqrt(2.0) * np.linalg.norm(to_eye)
    covered = (np.sqrt(np.maximum(closest2, 0.0)) + half_diagonal < sphere.radius) & (b < 0.0)
    t = -b - np.sqrt(np.maximum(sphere.radius**2 - closest2, 0.0))
    position = np.asarray(camera.position) + t[..., None] * d
    return Surface(position, normalise(position - sphere.center), covered)


def frames(normal: np.ndarray, tangent: np.ndarray | None) -> np.ndarray:
    """Rotation matrices (..., 3, 3) into the surface frame: rows are tangent, bitangent and normal."""
    if tangent is None:
        # Duff et al. 2017: a frame without a branch or a singularity but at one pole, where copysign decides.
        x, y, z = np.moveaxis(normal, -1, 0)
        sign = np.copysign(1.0, z)
        a = -1.0 / (sign + z)
        b = x * y * a
        tangent = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], -1)
    else:
        tangent = normalise(tangent - np.sum(tangent * normal, -1, keepdims=True) * normal)
    return np.stack([tangent, np.cross(normal, tangent), normal], -2)


def sphere_uv(normal: np.ndarray, up: tuple[float, float, float]) -> np.ndarray:
    """Texture coordinates (..., 2) of a sphere: u once around the axis `up`, along `sphere_tangent`, v from its pole to the other."""
    axis = normalise(np.asarray(up, float))
    start = normalise(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    x, y, z = normal @ start, normal @ np.cross(axis, start), normal @ axis
    return np.stack([np.arctan2(y, x) / (2.0 * np.pi) + 0.5, np.arctan2(np.hypot(x, y), z) / np.pi], -1)


def sphere_tangent(normal: np.ndarray, up: tuple[float, float, float]) -> np.ndarray:
    """Tangents along the circles of latitude around `up`: the direction in which a lathe brushes."""
    return normalise(np.cross(np.asarray(up, float), normal))


def sphere_mesh(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A unit sphere as triangles that face outwards: normals (n, 3), which are its positions, tangents (n, 3) along the circles of latitude around
    +Y, texture coordinates (n, 2), and corners (m, 3)."""
    v, u = np.meshgrid(np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij")
    theta, phi = np.pi * v, 2.0 * np.pi * (u - 0.5)
    normal = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], -1)
    tangent = np.stack([np.cos(phi), 0.0 * phi, -np.sin(phi)], -1)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    upper = np.stack([corner, below, corner + 1], -1)[columns:]  # one a segment at the poles, two between them
    lower = np.stack([corner + 1, below, below + 1], -1)[:-columns]
    uv = np.stack([u, v], -1)
    return normal.reshape(-1, 3), tangent.reshape(-1, 3), uv.reshape(-1, 2), np.concatenate([upper, lower])
