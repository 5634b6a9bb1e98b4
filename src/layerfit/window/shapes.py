"""Shapes to look at a material on: those of the pages (`report/page/shapes.js`), each a function of (u, v) in [0, 1]^2."""

from collections.abc import Callable

import numpy as np

from ..capture.geometry import normalise

STEP = 1e-4
"""Of u and v, for derivatives."""


def _turned(x: np.ndarray, y: np.ndarray, z: np.ndarray, angle: float) -> np.ndarray:
    """Points (..., 3), turned around +X by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([x, c * y - s * z, s * y + c * z], -1)


def _sphere(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    phi, theta = 2.0 * np.pi * (u - 0.5), np.pi * v
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], -1)


def _torus(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    a, b = 2.0 * np.pi * u, 2.0 * np.pi * v
    r = 0.68 - 0.32 * np.cos(b)
    return _turned(r * np.sin(a), 0.32 * np.sin(b), r * np.cos(a), 0.5)


def _block(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A box with round edges: a superellipsoid."""
    d = _sphere(u, v)
    x, y, z = np.moveaxis(0.64 * d / np.sum(d**8, -1, keepdims=True) ** 0.125, -1, 0)
    return _turned(0.82 * x + 0.57 * z, y, 0.82 * z - 0.57 * x, 0.25)


def _vase(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    r = 0.42 + 0.22 * np.sin(6.1 * v + 3.6) + 0.05 * np.cos(12.0 * v)
    return np.stack([r * np.sin(2.0 * np.pi * u), 0.98 - 1.96 * v, r * np.cos(2.0 * np.pi * u)], -1)


def _cloth(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    x, z = 1.7 * (u - 0.5), 1.7 * (v - 0.5)
    return _turned(x, 0.12 * np.sin(4.1 * x + 1.6 * z) + 0.07 * np.cos(5.6 * z - 1.9 * x), z, 0.9)


SHAPES: dict[str, tuple[Callable[[np.ndarray, np.ndarray], np.ndarray], int, int]] = {
    "sphere": (_sphere, 96, 192),
    "torus": (_torus, 96, 192),
    "block": (_block, 192, 256),
    "vase": (_vase, 128, 192),
    "cloth": (_cloth, 128, 128),
}
"""The function of each, and in how many rows and columns it is cut."""


def mesh(shape: str) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Positions, normals, tangents (n, 3) and texture coordinates (n, 2) by their names in `mesh.vert`, and the corners (m, 3) of triangles."""
    at, rows, columns = SHAPES[shape]
    v, u = np.meshgrid(np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij")
    inside = np.clip(v, 2.0 * STEP, 1.0 - 2.0 * STEP)  # at a pole nothing has a direction
    along = normalise(at(u + STEP, inside) - at(u - STEP, inside))
    down = normalise(at(u, inside + STEP) - at(u, inside - STEP))
    vertices = {
        "a_position": at(u, v),
        "a_normal": normalise(np.cross(down, along)),
        "a_tangent": along,
        "a_uv": np.stack([u, v], -1),
    }
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1, 1)
    below = corner + columns + 1
    triangles = np.hstack([corner, below, corner + 1, corner + 1, below, below + 1]).reshape(-1, 3)
    return {name: values.reshape(-1, values.shape[-1]) for name, values in vertices.items()}, triangles
