"""How much a pixel counts: the inverse of what its residual may be, as a smooth law of the MODEL's value.

Never the noise of the pixel itself: in a path-traced image a pixel that is too bright by chance also shows a large standard error,
so that weights made from it, and robust losses on it, pull the fit down. The law has three parts: noise, fitted to the file's
standard errors where it has them; a share of the value, for what no closed form gets right; and a share of the image's brightness.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..capture.samples import Samples

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


def inverse_sigma(model: np.ndarray, target: np.ndarray, noise: np.ndarray | None, metric: str) -> np.ndarray:
    """Weight of each residual, (pixels, 3), from the model's values there; `metric` is one of `difference.METRICS`."""
    bright = brightness(target)
    if metric in ("log", "cube_root"):
        return np.ones(target.shape, np.float32)
    if metric == "uniform":
        return np.broadcast_to(1.0 / bright, target.shape).astype(np.float32)
    model = np.maximum(model, 0.0)
    if metric == "relative":
        return (1.0 / (model + RELATIVE_FLOOR * bright)).astype(np.float32)
    variance = (MODEL_SHARE * model) ** 2 + (FLOOR_SHARE * bright) ** 2
    if noise is not None:
        variance = variance + noise_law(model, noise) ** 2
    return (1.0 / np.sqrt(variance)).astype(np.float32)


def noise_law(model: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Standard error of a pixel of this model value, c f^.7, with c the median over the pixels."""
    power = np.maximum(model, 1e-12) ** NOISE_EXPONENT
    known = np.isfinite(noise) & (noise > 0.0)
    if not known.any():
        return np.zeros_like(model)
    return np.median((noise / power)[known]) * power


def robust(residual: np.ndarray, loss: str) -> np.ndarray:
    """Factor on the weights of one round of iteratively reweighted least squares; residuals (pixels, channels) in units of sigma.

    "square" is not quite: a path tracer's fireflies are a handful of pixels, and squared they outweigh all others. Beyond `FIREFLY`
    scatters of its channel, and two sigma, a residual counts as that many. A lower cap would pull a fit down, because such noise is skewed.
    """
    scatter = 1.4826 * np.median(np.abs(residual), axis=0)
    if loss == "square":
        cap = np.maximum(FIREFLY * scatter, 2.0)
        return np.sqrt(cap / np.maximum(np.abs(residual), cap)).astype(np.float32)
    size = np.abs(residual) / (scatter + 1e-12)
    if loss == "huber":
        return np.sqrt(1.345 / np.maximum(size, 1.345)).astype(np.float32)
    return (1.0 / np.sqrt(1.0 + (size / 2.385) ** 2)).astype(np.float32)


@dataclasses.dataclass(frozen=True)
class Lost:
    """Light that a cap takes from fireflies, as it is missing from every pixel; both (pixels, 3) radiances."""

    mean: np.ndarray
    error: np.ndarray
    """Standard error: one number a channel, alike in all pixels."""


def lost(residual: np.ndarray, factor: np.ndarray, weight: np.ndarray, law: np.ndarray) -> Lost:
    """What a robust loss takes from an image (pixels, 3), by its noise `law`; `residual` is weighted, `factor` as `robust` gives it.

    A path tracer's noise is skewed: the few pixels that are far too bright make up for the many that are a little too dark. Capped and
    nothing else, an image has lost that light, and a coat seems more absorbing than it is. So it is given back, to each pixel by the noise that is
    expected of it. Few fireflies tell little of those that there should be: of the mean counts the part that is
    more than chance (James and Stein 1961), nothing of one firefly, half of two alike.
    """
    excess = residual * (factor**2 - 1.0)
    expected = np.maximum((law * weight).sum(0), 1e-30)
    total, squares = excess.sum(0), (excess**2).sum(0)
    sure = np.maximum(1.0 - squares / np.maximum(total**2, 1e-30), 0.0)
    return Lost(law * (sure * total / expected), law * (np.sqrt(sure * squares) / expected))


def misfit(models: Sequence[np.ndarray], samples: Sequence[Samples], weights: Sequence[np.ndarray]) -> float:
    """Weighted residual over the weighted image, roots of sums of squares, without the noise that the files state.

    The noise of each pixel as its file has it, where weights take a law: a sum over the image needs the fireflies, which no law knows.
    """
    residual = noise = image = 0.0
    for model, seen, weight in zip(models, samples, weights, strict=True):
        residual += np.sum(((model - seen.target) * weight).astype(float) ** 2)
        image += np.sum((seen.target * weight).astype(float) ** 2)
        if seen.noise is not None:
            noise += np.sum((np.nan_to_num(seen.noise, posinf=0.0) * weight).astype(float) ** 2)
    return float(np.sqrt(max(residual - noise, 0.0) / max(image, 1e-30)))
