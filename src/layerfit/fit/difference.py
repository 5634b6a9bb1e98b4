"""In what the difference between a model and a reference is taken: the metric of a fit.

A pixel is f cos(theta_i) times irradiance, for a measured BRDF irradiance 1. So every metric here is weighted by the cosine, as those that BRDFs
are compared by in the field are.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import struct

LOG_FLOOR = 0.02
"""Part of the image's brightness at which the logarithm turns linear: what is darker says little (as in `weights.FLOOR_SHARE`)."""

ROOT_FLOOR = 1e-3
"""The same of the cube root, whose slope at 0 is infinite."""


@struct
class Log:
    """log(1 + x / floor): relative differences above the floor, absolute ones below (after Loew et al. 2012, and Nielsen et al. 2015)."""

    floor: Any
    """(3,), or beside channels that come first (3, 1)."""

    def __call__(self, values: Any) -> Any:
        return jnp.log1p(jnp.maximum(values, 0.0) / self.floor)


@struct
class CubeRoot:
    """(x / white + floor)^(1/3): what a viewer sees of a BRDF more evenly than its values (Fores et al. 2012)."""

    white: Any
    """(3,), or beside channels that come first (3, 1)."""

    def __call__(self, values: Any) -> Any:
        return jnp.cbrt(jnp.maximum(values, 0.0) / self.white + ROOT_FLOOR)


Curve = Log | CubeRoot
CURVED = ("log", "cube_root")
"""Metrics that bring values to something else before they are compared."""


def curve(metric: str, white: np.ndarray) -> Curve | None:
    """What values are brought to before they are compared, for a reference this bright (3,); None where they are as they are."""
    if metric == "log":
        return Log((LOG_FLOOR * white).astype(np.float32))
    return CubeRoot(white.astype(np.float32)) if metric == "cube_root" else None


def compared(values: Any, by: Curve | None) -> np.ndarray:
    """Values (pixels, 3) as they are compared."""
    return np.asarray(values if by is None else by(np.asarray(values)))


def slope(values: np.ndarray, by: Curve | None) -> np.ndarray:
    """How much a small difference of values (pixels, 3) counts when they are compared."""
    return np.ones_like(values) if by is None else np.asarray(jax.jvp(by, (values,), (np.ones_like(values),))[1])
