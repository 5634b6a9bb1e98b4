"""What the form of the model gets wrong, as an error of the fitted parameters.

No noise of the image tells of it, and no residual: a fit hides it in its parameters. The random walk does: at the fitted material it gives
what light really does between the layers, and the difference to the form, seen through the derivatives of the fit, is the
step from the fitted parameters to those that an exact form would have been fitted with.
"""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np

from .. import walk
from ..capture.load import AnyView
from ..capture.samples import Samples, View
from ..render import brdf_values, predict
from ..stack import Stack
from .pixels import directions
from .uncertainty import newton

PAIRS = 512
"""Pixels, drawn by how much they say of the parameters, at which the walk is asked: one light sample of each."""

PATHS = 2000
"""Of the walk, for each of them: its noise then stays below that of the draw."""

PLACES = (-0.375, -0.125, 0.125, 0.375)
"""Parts of a pixel, along each of its sides: light comes from all of it, and the fit looks at its centre."""

FEW_PLACES = (-0.5 / 3.0**0.5, 0.5 / 3.0**0.5)
"""The same where light is a quadrature, many directions a place: Gauss's two points, for light from everywhere changes slowly within a pixel."""


@dataclasses.dataclass(frozen=True)
class Discrepancy:
    """What an exact form would do to a fit, in the coordinates of the fit; both (parameters,)."""

    step: np.ndarray
    """From the fitted vector to where it would be."""
    error: np.ndarray
    """Standard error of that: few pixels, few paths."""
    cost: np.ndarray
    """(3,) what the form's error alone would cost: half its weighted sum of squares over all pixels, by channel. 0 where light is a quadrature,
    of which the walk sees one sample a pixel."""


def unmeasured(stack: Stack) -> str | None:
    """Why the random walk cannot tell the form's error for a material; None where it can, or where there is none."""
    return walk.refuses(stack, walk.interface_of(stack)) if stack.layers else None


def begin(stack: Stack) -> None:
    """Have what `measure` needs compiled, while other work goes on."""
    stack = jax.tree.map(np.asarray, stack)  # numbers of NumPy: a comparison is not worth a compiler's time
    if stack.layers and not unmeasured(stack):
        walk.begin(stack, walk.interface_of(stack), walk.hazes(stack))


def measure(
    stacks: Sequence[Stack],
    views: Sequence[AnyView],
    samples: Sequence[Samples],
    place: tuple[np.ndarray, np.ndarray],
    jacobian: np.ndarray,
    inverse_sigma: np.ndarray,
    gram: np.ndarray,
    seed: int,
) -> Discrepancy:
    """Ask the random walk what the form of a fitted material, as it is in each reference, is off by, and the fit what that makes of its parameters.

    `place` has the reference and the pixel of each row of `jacobian` (rows, channels, parameters) and `inverse_sigma` (rows, channels), -1
    for rows that do not count; `gram` is J^T J. A bare surface has no error: it is exact.
    """
    if not stacks[0].layers:
        return Discrepancy(np.zeros(len(gram)), np.zeros(len(gram)), np.zeros(3))
    rng = np.random.default_rng(seed)
    chance = _chance(jacobian, gram, place[0] >= 0)
    drawn = rng.choice(len(chance), PAIRS, p=chance)
    off, exact = np.zeros((PAIRS, 3)), np.zeros(PAIRS)
    for k, (view, seen) in enumerate(zip(views, samples, strict=True)):
        here = place[0][drawn] == k
        if here.any():
            off[here] = _off(stacks[k], view, seen, place[1][drawn[here]], rng)
            exact[here] = view.exact
    off *= inverse_sigma[drawn]
    pull = np.einsum("pci,pc->pi", jacobian[drawn], off) / chance[drawn, None]
    steps = newton(gram, pull)
    cost = 0.5 * np.mean((exact / chance[drawn])[:, None] * off**2, 0)
    return Discrepancy(steps.mean(0), steps.std(0, ddof=1) / np.sqrt(PAIRS), cost)


def _chance(jacobian: np.ndarray, gram: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Of each pixel to be drawn: half evenly, half by its leverage, its part in what determines the parameters."""
    rows = jacobian.reshape(-1, jacobian.shape[-1])
    leverage = np.sum(rows * newton(gram, rows), -1).reshape(len(jacobian), -1).sum(-1)
    leverage = np.where(counts, np.maximum(leverage, 0.0), 0.0)
    return 0.5 * counts / counts.sum() + 0.5 * leverage / leverage.sum()


def _off(stack: Stack, view: AnyView, samples: Samples, pixels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Radiance that the fit has less that of the reference, (pixels, 3): of one light sample each, in place of the sum over all."""
    bright = samples.weight[pixels].sum(-1)
    chance = bright / bright.sum(-1, keepdims=True)
    light = np.argmax(np.cumsum(chance, -1) > rng.random((len(pixels), 1)), -1)
    each = np.arange(len(pixels))
    wi, wo, weight = samples.wi[pixels, light], samples.wo[pixels], samples.weight[pixels, light]
    form = brdf_values(stack, wi, wo)
    walked = walk.walk(stack, wi, wo, paths=PATHS, interface=walk.interface_of(stack), haze=walk.hazes(stack))
    off = (form - _top(stack, wi, wo) - walked.mean) * weight / chance[each, light, None]
    return off + _extent(stack, view, samples.index[pixels]) if isinstance(view, View) else off


def _extent(stack: Stack, view: View, index: np.ndarray) -> np.ndarray:
    """Radiance at the centres of pixels less that of all of them, (pixels, 3). Quadratures draw the same numbers at all places of a pixel."""
    drawn, back = np.unique(index, return_inverse=True)
    which = np.searchsorted(view.index, drawn)

    def seen(dx: float, dy: float) -> np.ndarray:
        samples = view.moved(which, dx, dy).samples(quadrature=directions(view))
        return predict(stack, samples.wi, samples.wo, samples.weight)

    places = PLACES if view.exact else FEW_PLACES
    return (seen(0.0, 0.0) - np.mean([seen(dx, dy) for dx in places for dy in places], 0))[back]


def _top(stack: Stack, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """BRDF of the top interface alone, (n, 3): the same in every form and in the walk. Always of as many pairs, to be compiled once."""
    size = PAIRS - len(wi)
    wi, wo = (np.pad(w, ((0, size), (0, 0)), "edge") for w in (wi, wo))
    with jax.enable_x64(False):
        return walk.top_lobe(stack, wi, wo)[: PAIRS - size]
