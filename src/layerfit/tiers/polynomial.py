"""Polynomials in one number, with as many coefficients as they need: what a compact material is made of."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._chunk import member, struct, vec2, vec3, vec4
from .._types import Scalar

MOST = 10
"""Highest degree."""

MIDDLE = 5
"""Degree at which arguments are compared."""

_CHEBYSHEV = np.polynomial.chebyshev
_VECTOR = {2: vec2, 3: vec3, 4: vec4}


@struct
class Polynomial:
    """Coefficients of the powers of one argument, numbers or vectors; those beyond the degree are absent."""

    c0: Any = member("coefficients of the powers of the argument")
    c1: Any = None
    c2: Any = None
    c3: Any = None
    c4: Any = None
    c5: Any = None
    c6: Any = None
    c7: Any = None
    c8: Any = None
    c9: Any = None
    c10: Any = None

    def __call__(self, x: Scalar) -> Any:
        """The value at x, by Horner's rule."""
        *lower, value = [c for c in dataclasses.astuple(self) if c is not None]
        # A vector times a number, and a sum with a vector, are two operations; of vectors alone they are one.
        if jnp.ndim(value) and not jnp.ndim(x):
            x = _VECTOR[len(value)](x)
        for c in reversed(lower):
            value = c + x * value
        return value

    @property
    def degree(self) -> int:
        """Highest power."""
        return sum(c is not None for c in dataclasses.astuple(self)) - 1


@dataclasses.dataclass(frozen=True)
class Curve:
    """What a polynomial is to run through: values (n,) or (n, k) at arguments x (n,), and how much each counts."""

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray | float = 1.0
    most: int = MOST
    """Highest degree that is tried."""

    @property
    def possible(self) -> bool:
        """Whether there is something to run through: more than one argument, and numbers that are finite."""
        return bool(np.ptp(self.x) > 0.0) and all(bool(np.all(np.isfinite(a))) for a in (self.x, self.y, self.weight))

    def fit(self, degree: int, length: int = 0) -> Polynomial:
        """Least squares over Chebyshev's polynomials; `length` pads with coefficients of 0, for polynomials of one shape."""
        low, high = float(self.x.min()), float(self.x.max())
        columns = []
        for fitted in self._series(degree)[1]:
            powers = _CHEBYSHEV.Chebyshev(fitted, [low, high]).convert(kind=np.polynomial.Polynomial).coef
            columns.append(np.pad(powers, (0, max(degree + 1, length) - len(powers))))
        coefficients = np.stack(columns, -1)
        return Polynomial(*(coefficients[:, 0] if self.y.ndim == 1 else coefficients))

    def off(self, degree: int) -> float:
        """How far such a polynomial stays from the values at most, weighted."""
        rows, fitted = self._series(degree)
        y, weight = self._columns()
        return float(np.max(np.abs((rows @ np.stack(fitted, -1) - y) * weight)))

    def _columns(self) -> tuple[np.ndarray, np.ndarray]:
        """Values and weights (n, k)."""
        y = self.y.reshape(len(self.x), -1)
        return y, np.broadcast_to(np.reshape(self.weight, (-1, 1)) if np.ndim(self.weight) == 1 else self.weight, y.shape)

    def _series(self, degree: int) -> tuple[np.ndarray, list[np.ndarray]]:
        """Chebyshev's polynomials (n, degree + 1) at the arguments, and the coefficients of each column of values."""
        low, high = float(self.x.min()), float(self.x.max())
        rows = _CHEBYSHEV.chebvander((2.0 * self.x - low - high) / (high - low), degree)
        y, weight = self._columns()
        solved = [np.linalg.lstsq(rows * w[:, None], v * w, rcond=None)[0] for v, w in zip(y.T, weight.T, strict=True)]
        return rows, solved
