"""The truth as a tier: a material is evaluated by the random walk, which no shader does."""

from collections.abc import Callable

import jax
import numpy as np

from ..errors import InputError
from ..render import brdf
from ..stack import Stack
from ..tiers.tier import WALK
from ._material import hazes, interface_of, refuses
from ._walk import Estimate, top_lobe, walk

PATHS = 4096
"""For each pair of directions, where no number is asked for."""

MOST_STEPS = 10_000_000_000
"""Paths at most that one command walks: some hours."""


def walked(stack: Stack, name: str, paths: int = PATHS) -> Callable[[np.ndarray, np.ndarray], Estimate]:
    """What evaluates a material at pairs of unit directions (n, 3): its BRDF with its standard error, which the light that the
    outermost coat reflects has none of. What varies over the surface is taken in the mean.

    Raises `InputError` for a material that the walk does not know, and for more paths than a command may take.
    """
    interface = interface_of(stack)
    if stack.layers and (reason := refuses(stack, interface)):
        raise InputError(f"{name}: {reason}; so there is no tier {WALK}")

    def evaluate(wi: np.ndarray, wo: np.ndarray) -> Estimate:
        lit = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
        mean, se = np.zeros((2, len(wo), 3))
        if np.any(lit):
            found = above(wi[lit], wo[lit])
            mean[lit], se[lit] = found.mean, found.se
        return Estimate(mean, se)

    def above(wi: np.ndarray, wo: np.ndarray) -> Estimate:
        if paths * len(wo) > MOST_STEPS:
            raise InputError(
                f"{len(wo)} pairs of directions, {paths} paths each: too many for one command; ask for fewer --paths, or a smaller picture"
            )
        with jax.enable_x64(True):
            exact = top_lobe(stack, wi, wo) if stack.layers else np.asarray(brdf(stack.astype(np.float64), wi, wo))
        if not stack.layers:  # a bare surface is its own truth
            return Estimate(exact, np.zeros_like(exact))
        below = walk(stack, wi, wo, paths=paths, interface=interface, haze=hazes(stack))
        return Estimate(below.mean + exact, below.se)

    return evaluate
