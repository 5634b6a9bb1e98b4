"""Samples of all references as equal blocks of pixels: one compiled step serves a thousand pixels and a million.

Pixels are dealt to the blocks in an order stratified by half angle, so that the first blocks are a fair sample of the image:
a fit starts on one block and ends on all of them. Blocks are padded with pixels of weight 0.
"""

import dataclasses
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from .._chunk import struct
from .._place import Place
from ..capture.samples import Samples
from ..render import block_size


@struct
class Blocks:
    """Pixels of all references, block by block, channels before pixels where there are any."""

    wi: Float[Array, "b n s 3"]
    wo: Float[Array, "b n 3"]
    weight: Float[Array, "b 3 n s"]
    target: Float[Array, "b 3 n"]
    inverse_sigma: Float[Array, "b 3 n"]
    of: Int[Array, " b"]
    """Reference that the pixels of a block are from."""
    place: Place | None = None
    """Where the pixels are on the surface; absent where the material is the same everywhere, or is fitted by its mean."""
    curve: Any = None
    """What model and target are brought to before they are compared; absent where their values are."""
    lights: Any = None
    """(blocks, s) by the name of a light: 1 where a sample is of it; absent where they are known, or known but for one scale."""


@dataclasses.dataclass(frozen=True)
class Layout:
    """Which pixel of which reference stands where: (blocks, pixels) arrays; -1 for padding."""

    reference: np.ndarray
    pixel: np.ndarray

    def scatter(self, values: list[np.ndarray], fill: float) -> np.ndarray:
        """Values (pixels, ...) a reference as (blocks, pixels, ...)."""
        shape = (*self.pixel.shape, *values[0].shape[1:])
        out = np.full(shape, fill, np.float32)
        for k, value in enumerate(values):
            at = self.reference == k
            out[at] = value[self.pixel[at]]
        return out


STRATA = 16
"""Classes of half angles."""


def strata(samples: Samples) -> np.ndarray:
    """Class of each pixel by its half angle, even in log(.05 + tan): about equal numbers for lobes of any width."""
    strongest = np.argmax(samples.weight.sum(-1), 1)
    wi = samples.wi[np.arange(len(strongest)), strongest]
    h = wi + samples.wo
    tan = np.hypot(h[:, 0], h[:, 1]) / np.maximum(h[:, 2], 1e-6)
    return np.minimum((np.log1p(tan / 0.05) * 4.0).astype(int), STRATA - 1)


def stratified(samples: Samples, seed: int) -> np.ndarray:
    """An order of the pixels in which every prefix has its share of each half angle.

    A highlight covers few pixels: of a thousand drawn at random, too few lie in it, and the fit finds a minimum without it.
    """
    stratum = strata(samples)
    rng = np.random.default_rng(seed)
    key = np.empty(len(stratum))
    for s in np.unique(stratum):
        members = rng.permutation(np.flatnonzero(stratum == s))
        key[members] = (np.arange(len(members)) + rng.random()) / len(members) ** 0.75
    return np.argsort(key)


LARGEST, SAMPLES = 1024, 16384
"""Pixels of a block of a fit, and light samples of all of them, at most: its steps hold their derivatives beside their values."""
LEAST = 16
"""Blocks that there is room for at least. Room for a power of two of them: a compiled step serves all images up to the same."""


def arrange(
    references: list[Samples], seed: int, needs: tuple[str, ...] = (), names: tuple[str, ...] = (), largest: int = LARGEST
) -> tuple[Blocks, Layout]:
    """Blocks of all references, of `largest` pixels at most, with weights of 0; `needs` is what the material has to know of the place of a pixel,
    `names` are all those of the lights, where their samples have to be known.

    The references take turns, block by block.
    """
    lights = max(s.wi.shape[1] for s in references)
    longest = max(len(s.index) for s in references)
    size = min(block_size(lights, SAMPLES, largest), power_of_two(longest, 32))
    rows: list[tuple[int, np.ndarray]] = []
    for k, samples in enumerate(references):
        order = stratified(samples, seed + k)
        rows += [(k, order[start : start + size]) for start in range(0, len(order), size)]
    # Sorted by place within their reference: the first blocks hold some of each.
    place = [sum(other == k for other, _ in rows[:i]) for i, (k, _) in enumerate(rows)]
    rows = [rows[i] for i in np.argsort(place, kind="stable")]
    reference = np.full((len(rows), size), -1)
    pixel = np.full((len(rows), size), -1)
    for b, (k, members) in enumerate(rows):
        reference[b, : len(members)] = k
        pixel[b, : len(members)] = members
    layout = Layout(reference, pixel)
    up = np.array([0.0, 0.0, 1.0], np.float32)

    def padded(field: str, samples: Samples) -> np.ndarray:
        value = getattr(samples, field)
        missing = lights - value.shape[1]
        return np.pad(value, ((0, 0), (0, missing), (0, 0)), "edge" if field == "wi" else "constant") if missing else value

    wi = layout.scatter([padded("wi", s) for s in references], 0.0)
    wo = layout.scatter([s.wo for s in references], 0.0)
    empty = pixel < 0
    wi[empty] = up
    wo[empty] = up
    weight = channels_first(layout.scatter([padded("weight", s) for s in references], 0.0))
    target = channels_first(layout.scatter([s.target for s in references], 0.0))
    where = {name: layout.scatter([getattr(s.place, name) for s in references], 0.0) for name in needs}
    of = np.array([k for k, _ in rows], np.int32)
    place = Place(**{name: held(values) for name, values in where.items()}) if where else None
    even = held(np.zeros_like(target))
    source = {name: held(np.stack([_of(name, references[k], lights) for k in of])) for name in names} or None
    return Blocks(held(wi), held(wo), held(weight), held(target), even, held(of), place, lights=source), layout


def _of(name: str, samples: Samples, count: int) -> np.ndarray:
    """1 for those of `count` light samples that are of this light."""
    here = np.array([light == name for light in samples.lights], np.float32)
    return np.pad(here, (0, count - len(here)))


def weighted(blocks: Blocks, layout: Layout, weights: list[np.ndarray]) -> Blocks:
    """The blocks with weights (pixels, channels) of the residuals of each reference."""
    return dataclasses.replace(blocks, inverse_sigma=held(channels_first(layout.scatter(weights, 0.0))))


def held(values: np.ndarray) -> Any:
    """An array (blocks, ...) where JAX has its own, with room for more blocks."""
    missing = power_of_two(len(values), LEAST) - len(values)
    return jax.device_put(np.pad(values, [(0, missing)] + [(0, 0)] * (np.ndim(values) - 1)))


def channels_first(values: np.ndarray) -> np.ndarray:
    """(blocks, pixels, ..., channels) as (blocks, channels, pixels, ...)."""
    return np.ascontiguousarray(np.moveaxis(values, -1, 1))


def power_of_two(n: int, least: int) -> int:
    """The smallest power of two that is not below n, and not below the least."""
    return max(least, 2 ** (n - 1).bit_length())
