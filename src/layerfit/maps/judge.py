"""What the images of a texel tell of it: sigmas, flags, and limits in place of numbers that are chance."""

import dataclasses

import numpy as np

from ..fit.uncertainty import BLIND, WEAK_SIGMA
from .descent import Descent, Found
from .model import Seen

PRIOR_FREEDOM = 10.0
"""Degrees of freedom for which the scatter of all texels counts beside that of one (Smyth 2004, eq. 2): a texel has a few dozen residuals, and
from so few a scatter is known to a fifth."""

FEW, LOWER, UPPER, LOWER_LIMIT, UPPER_LIMIT, UNTOLD, UNSETTLED = 1, 2, 4, 8, 16, 32, 64
FLAGS = {
    FEW: "fewer numbers were seen of the texel than are fitted",
    LOWER: "at the lower end of its range",
    UPPER: "at the upper end of its range",
    LOWER_LIMIT: "a lower limit: it may be anything above",
    UPPER_LIMIT: "an upper limit: it may be anything below",
    UNTOLD: "its images do not tell it",
    UNSETTLED: "did not converge",
}
"""Flags of a parameter of a texel; several add up."""

RISE = 3.84
"""Of twice the cost over its scatter, up to which a value is within a 95 % interval: chi^2 of one degree of freedom."""

HALVINGS, REFIT = 7, 6
"""Of the way to a limit, and steps of the other parameters at each."""


@dataclasses.dataclass
class Judged:
    """Rows of texels, columns of the vector."""

    sigma: np.ndarray
    """In the coordinates of the fit; infinite where nothing is told."""
    flags: np.ndarray
    """Sums of `FLAGS`."""
    scatter: float
    """Mean square of a weighted residual: that of the median texel."""


def judge(found: Found, seen: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> Judged:
    """Sigmas and flags of texels that have `seen` (n,) observations, three numbers each."""
    size = found.u.shape[1]
    freedom = np.maximum(3.0 * seen - size, 0.0)
    own = 2.0 * found.cost / np.maximum(freedom, 1.0)
    scatter = float(np.median(own[freedom > 0.0])) if np.any(freedom > 0.0) else 1.0
    moderate = (freedom * own + PRIOR_FREEDOM * scatter) / (freedom + PRIOR_FREEDOM)
    sigma = np.sqrt(moderate[:, None] * _variances(found.gram))
    flags = np.zeros(found.u.shape, np.int32)
    few = 3 * seen < size
    sigma[few] = np.inf
    reach = 1e-6 * (bounds[1] - bounds[0])
    flags |= np.where(few[:, None], FEW | UNTOLD, 0)
    flags |= np.where(found.u <= bounds[0] + reach, LOWER, 0) | np.where(found.u >= bounds[1] - reach, UPPER, 0)
    flags |= np.where(found.done[:, None], 0, UNSETTLED)
    return Judged(sigma, flags, scatter)


def _variances(gram: np.ndarray) -> np.ndarray:
    """Diagonals of the inverses of matrices (n, P, P); infinite along what is not seen."""
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / scale[:, :, None] / scale[:, None, :])
    blind = values < BLIND
    parts = vectors**2 / np.where(blind, 1.0, values)[:, None, :]
    hidden = np.any(blind[:, None, :] & (vectors**2 > BLIND), -1) | (scale <= 1e-6 * np.max(scale, -1, keepdims=True))
    return np.where(hidden, np.inf, np.sum(np.where(blind[:, None, :], 0.0, parts), -1) / scale**2)


def doubtful(judged: Judged, slot: int) -> np.ndarray:
    """Numbers of the texels whose value of a parameter may be a mere limit: of an unlikely sigma, or at an end of its range."""
    flags = judged.flags[:, slot]
    weak = ~(judged.sigma[:, slot] <= WEAK_SIGMA) | (flags & (LOWER | UPPER) > 0)
    return np.flatnonzero(weak & (flags & FEW == 0))


def limit(
    descent: Descent, found: Found, seen: Seen, slot: int, scatter: float, shared: float
) -> tuple[np.ndarray, np.ndarray]:
    """Vectors of doubtful texels with the end of the interval of one parameter in place of a number that is chance, and further flags.

    An interval that is open at one end is a limit: its other end is the value. Open at both, the images tell nothing, and the value is the
    `shared` one.
    """
    lower, upper = descent.bounds[0][slot], descent.bounds[1][slot]
    rise = found.cost + 0.5 * RISE * scatter
    ends = [_end(descent, found, seen, slot, np.full(len(found.u), end), rise) for end in (lower, upper)]
    open_below, open_above = ends[0] <= lower, ends[1] >= upper
    u = np.array(found.u)
    u[:, slot] = np.select(
        [open_below & open_above, open_above, open_below], [np.full(len(u), shared), ends[0], ends[1]], u[:, slot]
    )
    flags = np.select([open_below & open_above, open_above, open_below], [UNTOLD, LOWER_LIMIT, UPPER_LIMIT], 0)
    moved = flags > 0
    u[moved] = descent.pinned(u[moved], _some(seen, moved), slot, REFIT).u if moved.any() else u[moved]
    return u, flags


def _end(descent: Descent, found: Found, seen: Seen, slot: int, end: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Where the cost has risen so far on the way to an end of the range, the others fitted again; that end itself, where it has not."""

    def high(at: np.ndarray) -> np.ndarray:
        u = np.array(found.u)
        u[:, slot] = at
        return ~(descent.pinned(u, seen, slot, REFIT).cost <= rise)

    inside, outside = found.u[:, slot], end
    closed = high(end)
    for _ in range(HALVINGS if closed.any() else 0):
        middle = 0.5 * (inside + outside)
        beyond = high(middle)
        inside, outside = np.where(beyond, inside, middle), np.where(beyond, middle, outside)
    return np.where(closed, inside, end)


def _some(seen: Seen, which: np.ndarray) -> Seen:
    return Seen(*(getattr(seen, f.name)[which] for f in dataclasses.fields(seen)))
