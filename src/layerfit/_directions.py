"""Pairs of directions that say how alike two BRDFs are: everywhere, and where it is hard."""

import numpy as np

from ._place import Place

FLOOR = 1e-4
"""Values below this part of a lit white diffuse surface (for images: of white) are compared absolutely."""


def random_pairs(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of unit directions above the surface, float32: uniform ones, mirror and retro pairs with small offsets, grazing ones."""
    rng = np.random.default_rng(seed)
    sixth = count // 6

    def directions(n: int, cosine: np.ndarray) -> np.ndarray:
        phi = rng.uniform(0.0, 2.0 * np.pi, n)
        sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
        return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], -1)

    grazing = lambda n: 10.0 ** rng.uniform(-4.0, -1.0, n)  # noqa: E731
    uniform = lambda n: rng.uniform(1e-3, 1.0, n)  # noqa: E731
    wi = np.concatenate([directions(count - 2 * sixth, uniform(count - 2 * sixth)), directions(2 * sixth, grazing(2 * sixth))])
    wo = np.concatenate([directions(count - sixth, uniform(count - sixth)), directions(sixth, grazing(sixth))])
    near = slice(0, 2 * sixth)
    offset = rng.normal(size=(2 * sixth, 3)) * 10.0 ** rng.uniform(-3.0, -0.5, (2 * sixth, 1))
    flip = np.where(np.arange(2 * sixth) % 4 == 0, 1.0, -1.0)[:, None] * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, 1.0])
    wo[near] = wi[near] * flip + offset
    wo[:, 2] = np.maximum(np.abs(wo[:, 2]), 1e-4)
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    return wi.astype(np.float32), wo.astype(np.float32)


def random_places(count: int, seed: int) -> Place:
    """Texture coordinates over a few tiles, negative ones too, and distances from near to far, all shares of the sky; float32."""
    rng = np.random.default_rng((seed, 1))
    uv, distance = rng.uniform(-2.0, 2.0, (count, 2)), 10.0 ** rng.uniform(-2.0, 2.0, count)
    sky = rng.uniform(0.0, 1.0, count)
    return Place(*(a.astype(np.float32) for a in (uv, distance, sky)))
