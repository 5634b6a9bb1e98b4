"""Which pixels of the references a fit uses, and how they lie."""

from collections.abc import Sequence

import numpy as np

from ..capture.load import AnyView
from ..capture.samples import Samples
from ..errors import InputError
from ..stack import Stack
from .nuisances import depths

PIXELS = 65536
"""Pixels that a fit uses at most, all references together: more of them do not change the answer by what it can be wrong by."""

EVALUATIONS = 250_000
"""BRDF evaluations that a step may take where light is a quadrature: it decides how many pixels are used."""


def directions(view: AnyView) -> int:
    """Light samples a pixel of a quadrature: half of a picture's. Its error is drawn anew for each pixel, so that it averages out."""
    return view.directions // 2


def chosen(view: AnyView, views: int, seed: int) -> np.ndarray:
    """Pixels of a reference that the fit uses: all, or as many as it can afford, at random."""
    most = max(128, (PIXELS if view.exact else EVALUATIONS // directions(view)) // views)
    total = len(view.index)
    if total <= most:
        return np.arange(total)
    return np.sort(np.random.default_rng(seed).choice(total, most, replace=False))


def sectors(samples: Samples, count: int) -> np.ndarray:
    """Sector of each pixel, of equal numbers of pixels, however the highlight lies."""
    rank = np.argsort(np.argsort(samples.turn))
    return (rank * count // len(rank)).astype(np.float32)


def scales(views: Sequence[AnyView], start: Stack) -> np.ndarray | None:
    """(references, layers) thickness over that of the material, the base last; None where it is 1 everywhere."""
    names = [layer.name for layer in start.layers] + ([start.base.name] if depths(start.base) else [])
    for view in views:
        for name in view.reference.thickness_scale:
            if name not in names:
                raise InputError(
                    f"{view.reference.path}: thickness_scale names {name!r}; layers with a thickness are {', '.join(names) or 'none'}"
                )
    each = [view.scales(start) for view in views]
    if all(scale is None for scale in each):
        return None
    return np.array([np.ones(len(start.layers) + 1) if scale is None else scale for scale in each])
