"""What the data determine: sigmas, correlations, and the directions in which the parameters can move without being seen."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from .parameters import Parametrisation

BLIND = 1e-6
"""Eigenvalue of the scaled J^T J below which a direction is not seen: float32 columns cannot tell it from 0."""

WEAK_SIGMA = 0.5
"""Sigma in the coordinate of the fit (a relative error, for most) above which a parameter is called not identifiable."""

AGREEMENT = 3e-5
"""In the coordinate of the fit: no sigma is below it. So near are two renderers that compute in float32, and no scatter of pixels tells of what
all of them have in common."""

GROUPS = 12
"""Parts of the image that the jackknife leaves out in turn."""

CHANCE = 2.25
"""Variance by twelve parts over that by pixels which an image without misfit exceeds one time in a hundred: chi^2 of 11 degrees of
freedom, over 11. The larger of two estimates, without such a bound, would on average be a tenth too wide."""


@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Spread of the fitted vector, in the coordinates of the fit."""

    covariance: np.ndarray
    blind: list[np.ndarray]
    """Unit directions of parameters (scaled to equal effect) that the data do not see."""
    outside: np.ndarray
    """Step to where the minimum would be without bounds; 0 but where a value stands at one."""

    @property
    def sigma(self) -> np.ndarray:
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def correlation(self) -> np.ndarray:
        scale = np.where((self.sigma > 0.0) & np.isfinite(self.sigma), self.sigma, 1.0)
        return self.covariance / scale[:, None] / scale[None, :]


@dataclasses.dataclass(frozen=True)
class Sums:
    """What the pixels say of n parameters, added up: all that their spread is made of."""

    gram: Any
    """(n, n) J^T J, as the fit left it."""
    scatter: Any
    """(n, n) products of the gradients of each pixel."""
    part_grams: Any
    """(GROUPS, n, n) J^T J of each part of the image."""
    part_gradients: Any
    """(GROUPS, n)"""
    alike: Any
    """(k, n) J^T of errors that all pixels have together."""
    residuals: int


def estimate(
    gram: np.ndarray, jacobian: np.ndarray, residual: np.ndarray, part: np.ndarray, alike: Sequence[np.ndarray] = ()
) -> Uncertainty:
    """`spread` of what was not added up yet.

    `jacobian` (pixels, channels, parameters) and `residual` (pixels, channels) are weighted; pixels that do not count have `part` -1, others
    that of the image that they are in. `alike` are errors of the residuals (pixels, channels) that all pixels have together, one standard
    deviation of each.
    """
    gradients = np.einsum("pci,pc->pi", jacobian, residual)
    groups = [_normal(jacobian[part == k], gradients[part == k]) for k in range(GROUPS)]
    return spread(
        Sums(
            gram=gram,
            scatter=gradients.T @ gradients,
            part_grams=np.array([of_part for _, of_part in groups]),
            part_gradients=np.array([of_part for of_part, _ in groups]),
            alike=[np.einsum("pci,pc->i", jacobian, error) for error in alike],
            residuals=int(np.sum(part >= 0)) * residual.shape[1],
        )
    )


def spread(sums: Sums) -> Uncertainty:
    """Covariance of the parameters, as if there were no bounds.

    A value that stands at its bound is not known to be there: noise has pushed it out, and the truth is somewhere inside. Taken as known, it
    would lend its partners a certainty that nobody has.

    The gradients of the pixels scatter as their errors do, whatever the weights expected: the sum of their products, between two
    inverses of J^T J (Huber 1967; White 1980), over the degrees of freedom. By pixels, not by residuals: errors of the channels of one
    pixel are of the same light paths, and alike. That takes pixels as independent. Systematic misfit, which a closed form always has, is
    alike in neighbours, and pulls parts of the image apart: a jackknife over the parts, one Newton step each, widens what it finds to be wider
    than chance makes it.
    """
    gram = sums.gram
    n = len(gram)
    free = np.arange(n)
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    usable = free[scale > 1e-12 * scale.max()] if n else free
    covariance = np.zeros((n, n))
    blind: list[np.ndarray] = []
    for i in np.setdiff1d(free, usable):
        covariance[i, i] = np.inf
        blind.append(np.eye(n)[i])
    if usable.size:
        at = np.ix_(usable, usable)
        unit = np.outer(scale[usable], scale[usable])
        values, vectors = np.linalg.eigh(gram[at] / unit)
        for vector in vectors.T[values < BLIND]:
            full = np.zeros(n)
            full[usable] = vector
            blind.append(full)
        freedom = sums.residuals / max(sums.residuals - len(usable), 1)
        spread = freedom * _sandwich(values, vectors, sums.scatter[at] / unit) / unit
        moves = newton(gram - sums.part_grams, sums.part_gradients)[:, usable]
        apart = (GROUPS - 1) / GROUPS * np.sum((moves - moves.mean(0)) ** 2, 0)
        ratio = apart / np.maximum(np.diag(spread), 1e-300)
        factor = np.sqrt(np.maximum(ratio - (CHANCE - 1.0), 1.0))
        covariance[at] = spread * np.outer(factor, factor)
    for gradient in sums.alike:
        step = newton(gram, gradient)
        covariance += np.outer(step, step)
    return Uncertainty(_not_below(AGREEMENT, covariance), blind, -newton(gram, np.sum(sums.part_gradients, 0)))


def _not_below(least: float, covariance: np.ndarray) -> np.ndarray:
    """The same correlations, of sigmas to whose squares that of the least is added."""
    sigma = np.sqrt(np.diag(covariance))
    known = (sigma > 0.0) & np.isfinite(sigma)
    wider = np.where(known, np.hypot(1.0, least / np.where(known, sigma, 1.0)), 1.0)
    return covariance * np.outer(wider, wider) + np.diag(np.where(sigma > 0.0, 0.0, least**2))


def _normal(jacobian: np.ndarray, gradients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and J^T J of some pixels."""
    rows = jacobian.reshape(-1, jacobian.shape[-1])
    return gradients.sum(0), rows.T @ rows


def _sandwich(values: np.ndarray, vectors: np.ndarray, scatter: np.ndarray) -> np.ndarray:
    """Scatter between two inverses of the scaled J^T J, by its eigenvalues and eigenvectors.

    Along a direction that is not seen no gradient scatters: there it is taken for what it is on average, at the least eigenvalue.
    """
    seen = values >= BLIND
    inside = np.where(np.outer(seen, seen), vectors.T @ scatter @ vectors, 0.0)
    inside += np.diag(np.where(seen, 0.0, BLIND * np.mean(np.diag(scatter))))
    inverse = vectors / np.maximum(values, BLIND)
    return inverse @ inside @ inverse.T


def newton(gram: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """(J^T J)^-1 times gradients (..., parameters), along what the data see; of one J^T J, or of one for each."""
    diagonal = np.diagonal(gram, axis1=-2, axis2=-1)
    still = diagonal <= 1e-24 * diagonal.max(-1, keepdims=True)
    scale = np.where(still, 0.0, 1.0 / np.sqrt(np.where(still, 1.0, diagonal)))
    values, vectors = np.linalg.eigh(gram * scale[..., :, None] * scale[..., None, :])
    seen = values >= BLIND
    inverse = vectors * np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)[..., None, :] @ vectors.swapaxes(-1, -2)
    return ((gradient * scale)[..., None, :] @ inverse)[..., 0, :] * scale


def in_words(direction: np.ndarray, free: Parametrisation, scale: np.ndarray) -> tuple[dict[str, float], str]:
    """A blind direction as parameter shares and as a sentence."""
    move = direction / np.maximum(scale, 1e-300)
    move = move / np.abs(move).max()
    parts = {name: round(float(v), 3) for name, v in zip(free.names, move, strict=True) if abs(v) > 0.05}
    names = " and ".join(sorted({name.partition("[")[0] for name in parts}))
    if len(parts) == 1:
        return parts, f"{names} does not change the image"
    return parts, f"{names} can change together without changing the image"
