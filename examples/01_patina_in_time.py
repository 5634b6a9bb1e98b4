"""A hundred years of copper as a picture strip, drawn by one printed shader whose only change is the age.

    python examples/01_patina_in_time.py [OUT.png]

The shader is printed once, with its values as uniforms; a game sets `u_patina_years` from frame to frame in the same way.
"""

import dataclasses
import sys

import numpy as np
from PIL import Image

import layerfit as lf

YEARS = (0, 2, 5, 10, 20, 50, 100)
SIDE = 96
SUN = np.array([0.5, 0.6, 0.62])


def sphere(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Where a unit sphere covers a square picture, (side, side), and its normals there, (n, 3)."""
    x, y = np.meshgrid(*2 * [(np.arange(side) + 0.5) / side * 2.1 - 1.05])
    covered = x * x + y * y < 0.998
    x, y = x[covered], -y[covered]
    return covered, np.stack([x, y, np.sqrt(1.0 - x * x - y * y)], -1)


def frames(normal: np.ndarray) -> np.ndarray:
    """Tangent, bitangent and normal as rows, (n, 3, 3): what turns a direction into the frame of the surface."""
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), 1e-9)
    return np.stack([tangent, np.cross(normal, tangent), normal], 1)


def sky(count: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Directions of light (count, 3) and what each brings: an even spiral over the sphere, bright above, and a sun."""
    z = 1.0 - (np.arange(count) + 0.5) * 2.0 / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    to_light = np.stack([ring * np.cos(turn), z, ring * np.sin(turn)], -1)
    irradiance = 4.0 * np.pi / count * np.where(z > 0.0, 0.35 + 0.5 * z, 0.12)
    return np.vstack([to_light, SUN / np.linalg.norm(SUN)]), np.append(irradiance, 2.0)


def main(path: str) -> None:
    covered, normal = sphere(SIDE)
    to_surface = frames(normal)
    to_light, irradiance = sky()
    wi = np.einsum("nij,lj->nli", to_surface, to_light)
    wo = to_surface @ np.array([0.0, 0.0, 1.0])
    weight = np.repeat((irradiance * np.maximum(wi[..., 2], 0.0))[..., None], 3, -1)
    uv = np.stack([np.arctan2(normal[:, 0], normal[:, 2]) / (2.0 * np.pi), np.arccos(normal[:, 1]) / np.pi], -1)

    shader = lf.print_material(lf.read_preset("patinated_copper"), "patinated_copper", uniforms=True)
    pictures = []
    for years in YEARS:
        aged = dataclasses.replace(shader, uniforms=shader.uniforms | {"u_patina_years": float(years)})
        radiance = lf.shade_samples(aged, wi, wo, weight, lf.Place(uv))
        picture = np.full((SIDE, SIDE, 3), 0.03)
        picture[covered] = radiance
        pictures.append(picture)
        print(f"{years:3d} years: mean colour {np.round(radiance.mean(0), 3)}")
    strip = np.clip(np.hstack(pictures), 0.0, 1.0) ** (1.0 / 2.2)
    Image.fromarray(np.round(255.0 * strip).astype(np.uint8)).save(path)
    print(f"wrote {path}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "patina_in_time.png")
