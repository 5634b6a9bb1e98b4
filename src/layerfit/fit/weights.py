"""How much a pixel counts: the inverse of what its residual may be, as a smooth law of the MODEL's value.

Never the noise of the pixel itself: in a path-traced image a pixel that is too bright by chance also shows a large standard error,
so that weights made from it, and robust losses on it, pull the fit down. The law has three parts: noise, fitted to the file's
standard errors where it has them; a share of the value, for what no closed form gets right; and a share of the image's brightness.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..capture.samples import Samples
from .difference import CURVED

MODEL_SHARE = 0.05
"""Relative error that is expected of any closed form below a coat."""

FLOOR_SHARE = 0.02
"""Part of the 98th percentile below which a pixel says little: bounces and leaks that no form models live there."""

NOISE_EXPONENT = 0.7
"""Monte Carlo noise of a radiance f grows like f^.7 in renders of coated spheres."""


FIREFLY = 8.0
"""Scatters (1.48 median absolute residuals) from which on a residual is called a firefly."""


RELATIVE_FLOOR = 1e-3
"""Part of the same percentile at which the relative metric turns absolute."""


def brightness(target: np.ndarray) -> np.ndarray:
    """(3,) 98th percentile of each channel of a reference (pixels, 3), never 0."""
    return np.maximum(np.quantile(target, 0.98, axis=0), 1e-12 + 1e-3 * np.quantile(target, 0.98))


class Columns:
    """What weights ask of all pixels of a channel at once, of arrays (pixels, channels)."""

    xp: Any = np

    def total(self, values: Any) -> Any:
        """Sum over the pixels, beside which values of each channel stand."""
        return values.sum(0)

    def middle(self, values: Any) -> Any:
        """Median over the pixels of values that are nowhere negative."""
        return np.median(values, axis=0)

    def level(self, values: Any, known: Any) -> Any:
        """Median of those known, over pixels and channels; 0 where none are."""
        return np.median(values[known]) if known.any() else values.dtype.type(0.0)


COLUMNS = Columns()


def inverse_sigma(model: np.ndarray, target: np.ndarray, noise: np.ndarray | None, metric: str) -> np.ndarray:
    """Weight of each residual, (pixels, 3), from the model's values there; `metric` is one of `difference.METRICS`."""
    law = None if noise is None or metric != "law" else noise_law(np.maximum(model, 0.0), noise)
    return np.broadcast_to(weight(model, brightness(target), law, metric), target.shape).astype(np.float32)


def weight(model: Any, bright: Any, law: Any, metric: str, xp: Any = np) -> Any:
    """The same from the brightness of the image and the law of its noise; all broadcast to the model's shape."""
    if metric in CURVED:
        return xp.ones_like(model)
    if metric == "uniform":
        return 1.0 / bright
    model = xp.maximum(model, 0.0)
    if metric == "relative":
        return 1.0 / (model + RELATIVE_FLOOR * bright)
    variance = (MODEL_SHARE * model) ** 2 + (FLOOR_SHARE * bright) ** 2
    return 1.0 / xp.sqrt(variance if law is None else variance + law**2)


def noise_law(model: Any, noise: Any, over: Columns = COLUMNS) -> Any:
    """Standard error of a pixel of this model value, c f^.7, with c the median over the pixels."""
    power = over.xp.maximum(model, 1e-12) ** NOISE_EXPONENT
    return over.level(noise / power, over.xp.isfinite(noise) & (noise > 0.0)) * power


def robust(residual: Any, loss: str, over: Columns = COLUMNS) -> Any:
    """Factor on the weights of one round of iteratively reweighted least squares; residuals (pixels, channels) in units of sigma.

    "square" is not quite: a path tracer's fireflies are a handful of pixels, and squared they outweigh all others. Beyond `FIREFLY`
    scatters of its channel, and two sigma, a residual counts as that many. A lower cap would pull a fit down, because such noise is skewed.
    """
    xp, size = over.xp, abs(residual)
    scatter = 1.4826 * over.middle(size)
    if loss == "square":
        cap = xp.maximum(FIREFLY * scatter, 2.0)
        return xp.sqrt(cap / xp.maximum(size, cap)).astype(np.float32)
    size = size / (scatter + 1e-12)
    if loss == "huber":
        return xp.sqrt(1.345 / xp.maximum(size, 1.345)).astype(np.float32)
    return (1.0 / xp.sqrt(1.0 + (size / 2.385) ** 2)).astype(np.float32)


@dataclasses.dataclass(frozen=True)
class Lost:
    """Light that a cap takes from fireflies, as it is missing from every pixel; both (pixels, 3) radiances."""

    mean: Any
    error: Any
    """Standard error: one number a channel, alike in all pixels."""


def lost(residual: Any, factor: Any, weight: Any, law: Any, over: Columns = COLUMNS) -> Lost:
    """What a robust loss takes from an image (pixels, 3), by its noise `law`; `residual` is weighted, `factor` as `robust` gives it.

    A path tracer's noise is skewed: the few pixels that are far too bright make up for the many that are a little too dark. Capped and
    nothing else, an image has lost that light, and a coat seems more absorbing than it is. So it is given back, to each pixel by the noise that is
    expected of it. Few fireflies tell little of those that there should be: of the mean counts the part that is
    more than chance (James and Stein 1961), nothing of one firefly, half of two alike.
    """
    xp, excess = over.xp, residual * (factor**2 - 1.0)
    expected = xp.maximum(over.total(law * weight), 1e-30)
    total, squares = over.total(excess), over.total(excess**2)
    sure = xp.maximum(1.0 - squares / xp.maximum(total**2, 1e-30), 0.0)
    return Lost(law * (sure * total / expected), law * (xp.sqrt(sure * squares) / expected))


def misfit(models: Sequence[np.ndarray], samples: Sequence[Samples], weights: Sequence[np.ndarray]) -> float:
    """Weighted residual over the weighted image, roots of sums of squares, without the noise that the files state.

    The noise of each pixel as its file has it, where weights take a law: a sum over the image needs the fireflies, which no law knows.
    """
    sums = [
        squares(model, seen.target, seen.noise, weight) for model, seen, weight in zip(models, samples, weights, strict=True)
    ]
    return unexplained(*np.sum(sums, 0))


def squares(model: Any, target: Any, noise: Any, weight: Any, xp: Any = np) -> tuple[Any, Any, Any]:
    """Sums of squares of the weighted residual, of the noise that a file states, and of the image."""
    stated = 0.0 if noise is None else xp.sum((xp.nan_to_num(noise, posinf=0.0) * weight).astype(float) ** 2)
    return xp.sum(((model - target) * weight).astype(float) ** 2), stated, xp.sum((target * weight).astype(float) ** 2)


def unexplained(residual: float, noise: float, image: float) -> float:
    """Root of what of the residual no noise explains, over the image, from their sums of squares."""
    return float(np.sqrt(max(residual - noise, 0.0) / max(image, 1e-30)))
