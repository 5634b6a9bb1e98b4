"""The maps of a fit, as arrays by the name of their parameter."""

import dataclasses
from typing import Any

import numpy as np

from ..fit.nuisances import THICKNESS, depths
from ..fit.parameters import Parametrisation
from ..stack import Stack
from .judge import FLAGS, UNTOLD, Judged
from .parameters import SLOPES, TILT
from .texels import Texels


@dataclasses.dataclass(frozen=True)
class MapFit:
    """What `fit_map` gives: arrays (H, W), or (H, W, 3) of a colour and of the slopes of the normal in its first two; row 0 is the top."""

    stack: Stack
    """The material: what all texels share, and what they start from."""
    values: dict[str, np.ndarray]
    """By the name of the parameter, in its unit; where nothing was seen, what the material says."""
    sigmas: dict[str, np.ndarray]
    """Of the texel's own images, one standard deviation, whatever neighbours add; infinite where they tell nothing."""
    flags: dict[str, np.ndarray]
    """Sums of what `layerfit.maps.judge.FLAGS` says; 0 for a value with nothing to say of it."""
    seen: np.ndarray
    """(H, W) observations of each texel; 0 where there is none."""
    misfit: np.ndarray
    """(H, W) relative L2 of the observations of each texel."""
    rel_l2: float
    """That of all of them."""
    normal: np.ndarray | None
    """(H, W, 3) the normal in world space, where it was mapped."""
    texels: Texels
    free: Parametrisation
    vector: np.ndarray
    """(n, P) in the coordinates of the fit."""
    document: dict[str, Any] | None = None
    """The content of `map.json`, where files were written."""

    @property
    def good(self) -> bool:
        """Whether a shader was written that draws what JAX computes, and every parameter is told in most texels."""
        parity = (self.document or {}).get("parity")
        return bool(parity and parity["passed"]) and all(row["told"] > 0.5 for row in self.summary().values())

    def fields(self) -> dict[str, np.ndarray]:
        """Maps of what a shader reads, the fields of layers alone: a scale of the thickness as the depths that it makes."""
        made = {}
        for f in self.free.free:
            if f.layer is None:
                continue
            layer = (*self.stack.layers, self.stack.base)[f.layer]
            if f.field == THICKNESS:
                scale = self.values[f.name]
                made |= {f"{layer.name}.{name}": _times(scale, getattr(layer, name)) for name in depths(layer)}
            else:
                made[f.name] = self.values[f.name]
        return made

    def summary(self) -> dict[str, Any]:
        """Of each parameter the quartiles of its values and of its sigmas, and how many texels have which flag."""
        there = self.seen > 0
        return {
            name: _summary(self.values[name][there], self.sigmas[name][there], self.flags[name][there]) for name in self.values
        }


def _times(scale: np.ndarray, depth: Any) -> np.ndarray:
    return scale * float(depth) if np.ndim(depth) == 0 else scale[..., None] * np.asarray(depth)


def _summary(values: np.ndarray, sigmas: np.ndarray, flags: np.ndarray) -> dict[str, Any]:
    finite = sigmas[np.isfinite(sigmas)]
    flagged = {words: int(np.sum(np.any((flags & bit > 0).reshape(len(flags), -1), 1))) for bit, words in FLAGS.items()}
    return {
        "quartiles": np.quantile(values, [0.25, 0.5, 0.75]).tolist(),
        "sigma_median": float(np.median(finite)) if finite.size else None,
        "told": float(np.mean(flags & UNTOLD == 0)),
        "flags": {words: count for words, count in flagged.items() if count},
    }


def result_of(texels: Texels, start: Stack, free: Parametrisation, u: np.ndarray, judged: Judged, misfit: np.ndarray) -> MapFit:
    """Put the rows of texels in their places."""
    values, sigmas, flags = {}, {}, {}
    for f in (f for f in free.free if f.layer is not None):
        first, *more = f.slots
        at: Any = [first, *more] if more else first
        shared = f.from_steps(free.pack(start)[at], np)
        rows = f.from_steps(u[:, at], np)
        values[f.name] = np.where(_there(texels, rows), texels.image(rows), shared)
        sigmas[f.name] = texels.image(judged.sigma[:, at] * f.slope(u[:, at]), np.inf)
        flags[f.name] = texels.image(judged.flags[:, at])
    tilted = {f.field: f.slots[0] for f in free.free if f.layer is None}
    normal = None
    if tilted:
        pick = lambda rows: np.stack([rows[:, tilted[n]] if n in tilted else np.zeros(len(u)) for n in SLOPES], -1)  # noqa: E731
        slopes = pick(u)
        values[TILT], sigmas[TILT] = texels.image(slopes), texels.image(pick(judged.sigma), np.inf)
        flags[TILT] = texels.image(pick(judged.flags).astype(np.int32))
        n = np.concatenate([slopes, np.ones((len(u), 1))], 1)
        normal = texels.image(np.einsum("ni,nij->nj", n / np.linalg.norm(n, axis=1, keepdims=True), texels.frame))
    off = np.sqrt(misfit[:, 0] / np.maximum(misfit[:, 1], 1e-30))
    total = float(np.sqrt(misfit[:, 0].sum() / max(misfit[:, 1].sum(), 1e-30)))
    return MapFit(start, values, sigmas, flags, texels.image(texels.seen), texels.image(off), total, normal, texels, free, u)


def _there(texels: Texels, rows: np.ndarray) -> np.ndarray:
    there = texels.image(np.ones(len(texels.index), bool))
    return there if rows.ndim == 1 else there[..., None]
