"""What property tests draw: places in ranges, with both ends of each."""

from typing import Any

import numpy as np
from hypothesis import settings, strategies as st
from hypothesis.extra.numpy import arrays

from layerfit._fields import Param
from layerfit.fit.parameters import Free

ROWS = 64
FEW = settings(max_examples=15, deadline=None, derandomize=True)
MANY = settings(max_examples=200, deadline=None, derandomize=True)


@st.composite
def shares(draw: Any, rows: int, columns: int) -> np.ndarray:
    """Places in ranges, from end to end: a half of the numbers at one of them."""
    inner = draw(arrays(float, (rows, columns), elements=st.floats(0.0, 1.0), fill=st.just(0.5)))
    ends = draw(arrays(np.int8, (rows, columns), elements=st.integers(-1, 1), fill=st.just(0)))
    return np.where(ends == 0, inner, 0.5 + 0.5 * ends)


def at(spec: Param, place: np.ndarray) -> np.ndarray:
    """Values at places of a range, evenly in the coordinate of a fit."""
    free = Free("", 0, "", spec, (0,))
    low, high = (float(free.to_steps(end)) for end in (spec.lower, spec.upper))
    return np.clip(np.asarray(free.from_steps(low + place * (high - low), np)), spec.lower, spec.upper)
