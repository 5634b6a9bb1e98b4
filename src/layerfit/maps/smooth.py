"""Neighbours that are alike: a prior on the differences between texels that touch.

Texels are fitted apart; then all together. Each stands for its images by the normal equations at its place, and neighbours are coupled by
quadratic differences, a Gaussian Markov random field of first order (Rue and Held 2005, ch. 3):

    sum over texels of cost(u) / scatter + 1/2 sum over neighbours s, t of |(u_s - u_t) / smooth|^2

One step of Gauss and Newton for the whole map is a sparse system, solved by conjugate gradients with the blocks of the texels as preconditioner.
Unlike sweeps from neighbour to neighbour, it carries over any distance in few steps, and knows nothing of tiles.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, cg

from .descent import Found

STEPS = 4
"""Of Gauss and Newton at most: the images were met before."""

ACCURATE = 1e-4
"""Relative residual of the linear system: a step is taken anew."""

SETTLED = 1e-3
"""Part of `smooth` by which no texel has to move more."""


def smoothed(
    found: Found,
    index: np.ndarray,
    shape: tuple[int, int],
    smooth: np.ndarray,
    scatter: float,
    bounds: tuple[np.ndarray, np.ndarray],
    at: Callable[[np.ndarray], Found],
) -> Found:
    """Texels that agree with their images and their neighbours. `smooth` (P,) is how far neighbours differ, one standard deviation, in the
    coordinates of the fit; infinite for what is not coupled. `at` gives the normal equations of all texels at vectors (n, P)."""
    coupling = laplacian(index, shape)
    weight = scatter / smooth**2
    here, cost = found, _total(found, coupling, weight)
    for _ in range(STEPS):
        move = _step(here, coupling, weight)
        for _ in range(6):
            there = at(np.clip(here.u + move, *bounds))
            new = _total(there, coupling, weight)
            if new <= cost:
                break
            move = 0.25 * move
        else:
            return here
        settled = np.max(np.abs(there.u - here.u)[:, np.isfinite(smooth)] / smooth[np.isfinite(smooth)]) < SETTLED
        here, cost = there, new
        if settled:
            break
    return here


def laplacian(index: np.ndarray, shape: tuple[int, int]) -> csr_array:
    """(n, n): u^T L u is the sum of squared differences between texels that touch; `index` (n,) are their row-major places."""
    number = np.full(shape[0] * shape[1], -1)
    number[index] = np.arange(len(index))
    number = number.reshape(shape)
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:])]
    one, other = (np.concatenate([side.ravel() for side in sides]) for sides in zip(*pairs, strict=True))
    both = (one >= 0) & (other >= 0)
    one, other = one[both], other[both]
    links = csr_array((np.ones(2 * len(one)), (np.concatenate([one, other]), np.concatenate([other, one]))), (len(index),) * 2)
    degree = csr_array((links.sum(1), (np.arange(len(index)), np.arange(len(index)))), links.shape)
    return csr_array(degree - links)


def _total(found: Found, coupling: csr_array, weight: np.ndarray) -> float:
    cost = np.sum(found.cost) + 0.5 * np.sum(weight * found.u * (coupling @ found.u))
    return float(cost) if np.isfinite(cost) else np.inf


def _step(found: Found, coupling: csr_array, weight: np.ndarray) -> np.ndarray:
    """The step of Gauss and Newton for all texels, (n, P)."""
    n, size = found.u.shape
    # Blocks of the texels, each with its own links: what a texel would do if its neighbours stood still.
    blocks = found.gram + (coupling.diagonal()[:, None] * weight)[:, :, None] * np.eye(size)
    blocks = blocks + 1e-9 * np.mean(np.einsum("nii->ni", blocks), 0) * np.eye(size)
    inverse = np.linalg.inv(blocks)

    def apply(x: np.ndarray) -> np.ndarray:
        x = x.reshape(n, size)
        return (np.einsum("nij,nj->ni", found.gram, x) + weight * (coupling @ x)).ravel()

    downhill = -(found.gradient + weight * (coupling @ found.u)).ravel()
    operator: Any = LinearOperator  # its stub knows no keyword arguments
    system = operator((n * size, n * size), matvec=apply, dtype=float)
    before = operator(system.shape, matvec=lambda x: np.einsum("nij,nj->ni", inverse, x.reshape(n, size)).ravel(), dtype=float)
    return cg(system, downhill, rtol=ACCURATE, maxiter=500, M=before)[0].reshape(n, size)
