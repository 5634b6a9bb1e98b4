"""What the data determine: sigmas, correlations, and the directions in which the parameters can move without being seen."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from .parameters import Parametrisation

BLIND = 1e-6
"""Eigenvalue of the scaled J^T J below which a direction is not seen: float32 columns cannot tell it from 0."""

WEAK_SIGMA = 0.5
"""Sigma in the coordinate of the fit (a relative error, for most) above which a parameter is called not identifiable."""

GROUPS = 12
"""Parts of the image that the jackknife leaves out in turn."""


@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Spread of the fitted vector, in the coordinates of the fit."""

    covariance: np.ndarray
    blind: list[np.ndarray]
    """Unit directions of parameters (scaled to equal effect) that the data do not see."""

    @property
    def sigma(self) -> np.ndarray:
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def correlation(self) -> np.ndarray:
        scale = np.where(self.sigma > 0.0, self.sigma, 1.0)
        return self.covariance / scale[:, None] / scale[None, :]


def estimate(
    gram: np.ndarray, loss: float, residuals: int, held: np.ndarray, groups: Sequence[tuple[np.ndarray, np.ndarray]]
) -> Uncertainty:
    """Covariance of the parameters that are not held on a bound.

    The larger of two, parameter by parameter: residual scatter through J^T J, as if residuals were independent; and a jackknife over
    parts of the image, `groups` of (gradient, J^T J) at the solution, one Newton step each: systematic misfit, which a closed form always
    has, pulls the parts apart and shows there only.
    """
    n = len(gram)
    free = np.flatnonzero(~held)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    usable = free[scale[free] > 1e-12 * scale.max()] if n else free
    covariance = np.zeros((n, n))
    blind: list[np.ndarray] = []
    for i in np.setdiff1d(free, usable):
        covariance[i, i] = np.inf
        blind.append(np.eye(n)[i])
    if usable.size:
        at = np.ix_(usable, usable)
        scaled = gram[at] / np.outer(scale[usable], scale[usable])
        values, vectors = np.linalg.eigh(scaled)
        for value, vector in zip(values, vectors.T, strict=True):
            if value < BLIND:
                full = np.zeros(n)
                full[usable] = vector
                blind.append(full)
        inverse = (vectors / np.maximum(values, BLIND)) @ vectors.T / np.outer(scale[usable], scale[usable])
        scatter = 2.0 * loss / max(residuals - len(usable), 1)
        moves = np.array([_newton(gram[at] - part_gram[at], -part[usable]) for part, part_gram in groups])
        spread = (len(groups) - 1) / max(len(groups), 1) * (moves - moves.mean(0)).T @ (moves - moves.mean(0))
        factor = np.sqrt(np.maximum(np.diag(spread) / np.maximum(np.diag(scatter * inverse), 1e-300), 1.0))
        covariance[at] = scatter * inverse * np.outer(factor, factor)
    return Uncertainty(covariance, blind)


def _newton(gram: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram * np.outer(scale, scale) + 1e-9 * np.eye(len(gram))
    return -scale * np.linalg.solve(scaled, gradient * scale)


def in_words(direction: np.ndarray, free: Parametrisation, scale: np.ndarray) -> tuple[dict[str, float], str]:
    """A blind direction as parameter shares and as a sentence."""
    move = direction / np.maximum(scale, 1e-300)
    move = move / np.abs(move).max()
    parts = {name: round(float(v), 3) for name, v in zip(free.names, move, strict=True) if abs(v) > 0.05}
    names = " and ".join(sorted({name.partition("[")[0] for name in parts}))
    if len(parts) == 1:
        return parts, f"{names} does not change the image"
    return parts, f"{names} can change together without changing the image"
