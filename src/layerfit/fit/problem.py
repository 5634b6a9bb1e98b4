"""What a fit is of: references as weighted blocks of pixels, the free parameters, and the ways down from a point."""

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from .. import render
from .._place import narrowed
from ..capture.load import AnyView
from ..capture.samples import Samples
from ..stack import Stack
from . import discrepancy
from .blocks import Block, arrange, channels_first
from .difference import Curve, compared, curve, slope
from .parameters import Parametrisation
from .pixels import DIRECTIONS, chosen, scales, sectors
from .residuals import NEAR, begin, begin_solver, initial, scaled, step
from .result import Row
from .solve import NormalLevenbergMarquardt
from .starts import FINE_STEPS, Minimum
from .uncertainty import GROUPS
from .weights import Lost, brightness, inverse_sigma, lost, noise_law, robust


class Problem:
    """Residuals of a material against references, with weights that follow a model; vectors are in the coordinates of the fit."""

    def __init__(self, views: Sequence[AnyView], start: Stack, free: Parametrisation, metric: str, loss: str, seed: int):
        self.views, self.metric, self.loss = views, metric, loss
        self.trace: list[Row] = []
        self.began = time.perf_counter()
        self.samples = [view.samples(chosen(view, len(views), seed), DIRECTIONS, seed) for view in views]
        blocks, self.layout = arrange(self.samples, scales(views, start), seed, start.needs)
        self.curves = [curve(metric, brightness(s.target)) for s in self.samples]
        self.blocks = [_compared_by(self.curves[of[0]], block) for of, block in zip(self.layout.reference, blocks, strict=True)]
        first = self.layout.pixel[: len(views)]  # a block of each reference, in their order
        self.few = [s.some(block[block >= 0]) for s, block in zip(self.samples, first, strict=True)]
        self.solver = NormalLevenbergMarquardt()
        self.release(start, free)

    def release(self, start: Stack, free: Parametrisation) -> None:
        """Set what is fitted, from where."""
        self.start, self.free = start.astype(np.float32), free
        self.bounds = free.bounds()

    def begin(self, model_error: bool) -> None:
        """Have what steps, pictures and, if asked for, the random walk need compiled, while other work goes on."""
        origin = self.free.pack(self.start)
        begin_solver(origin, self.bounds, self.blocks, free=self.free, solver=self.solver)
        if model_error:
            discrepancy.begin(self.start)
        begin(origin, self.start, self.blocks, free=self.free)
        for view, samples in zip(self.views, self.samples, strict=True):
            stack = scaled(self.start, view.scales(self.start))
            render.begin(stack, samples.wi.shape[1], narrowed(samples.place, stack.needs))

    def weigh(self, u: np.ndarray | None) -> None:
        """Set the residual weights from the model at `u`, or equal ones before there is a model."""
        if u is None:
            values = self._even(self.samples)
        else:
            models = self.models(u, self.samples)
            values = self.weights(models, self.metric)
            self._give_back(models)
        weight = channels_first(self.layout.scatter(values, 0.0))
        self.brightness = [
            float(np.sum((w * compared(block.target, block.curve)).astype(float) ** 2))
            for w, block in zip(weight, self.blocks, strict=True)
        ]
        self.blocks = [_weighted(block, w) for block, w in zip(self.blocks, weight, strict=True)]

    def _give_back(self, models: Sequence[np.ndarray]) -> None:
        """Set the targets to what the references are without fireflies, but for their light: that is everywhere."""
        self.lost = [self._lost(model, samples) for model, samples in zip(models, self.samples, strict=True)]
        targets = [
            samples.target if off is None else samples.target + off.mean
            for off, samples in zip(self.lost, self.samples, strict=True)
        ]
        target = channels_first(self.layout.scatter(targets, 0.0))
        self.blocks = [
            dataclasses.replace(block, target=jax.device_put(t)) for block, t in zip(self.blocks, target, strict=True)
        ]

    def _lost(self, model: np.ndarray, samples: Samples) -> Lost | None:
        """Light that the loss takes from fireflies, where a file says that it has any."""
        if samples.noise is None or curve(self.metric, brightness(samples.target)):
            return None
        weight = inverse_sigma(model, samples.target, samples.noise, self.metric)
        residual = (model - samples.target) * weight
        return lost(residual, robust(residual, self.loss), weight, noise_law(np.maximum(model, 0.0), samples.noise))

    def alike(self) -> list[np.ndarray]:
        """Errors of the weighted residuals that all pixels of a channel of a reference have together."""
        found = []
        for k, off in enumerate(self.lost):
            if off is not None:
                error = self.layout.scatter(
                    [off.error if j == k else np.zeros_like(s.target) for j, s in enumerate(self.samples)], 0.0
                )
                weights = np.stack([np.asarray(block.inverse_sigma).T for block in self.blocks])
                found += [(error * weights * one).reshape(-1, 3) for one in np.eye(3) if np.any(error * one)]
        return found

    def _even(self, samples: Sequence[Samples]) -> list[np.ndarray]:
        """Weights before there is a model. A measurement has no noise to speak of, and a highlight a thousand times as bright as all else:
        there the law holds from the first."""
        plain = ["law" if s.shape is None else "uniform" for s in samples]
        first = plain if self.curves[0] is None else [self.metric] * len(samples)
        return [inverse_sigma(s.target, s.target, None, metric) for s, metric in zip(samples, first, strict=True)]

    def weights(self, models: Sequence[np.ndarray], metric: str) -> list[np.ndarray]:
        """Weights of the residuals of these models, a reference each."""
        values = []
        for model, samples in zip(models, self.samples, strict=True):
            weight = inverse_sigma(model, samples.target, samples.noise, metric)
            by = curve(metric, brightness(samples.target))
            difference = compared(model, by) - compared(samples.target, by)
            values.append(weight * robust(difference * weight, self.loss))
        return values

    def models(self, u: np.ndarray, samples: Sequence[Samples]) -> list[np.ndarray]:
        stack, light = self.material(u), self.light(u)
        return [
            light * render.predict(scaled(stack, view.scales(stack)), s.wi, s.wo, s.weight, narrowed(s.place, stack.needs))
            for view, s in zip(self.views, samples, strict=True)
        ]

    def material(self, u: np.ndarray) -> Stack:
        stack = self.free.put(self.start, self.free.fields(u), np)
        return jax.tree.map(lambda a: np.asarray(a, np.float32), stack)

    def light(self, u: np.ndarray) -> np.ndarray:
        """All lights over what the scene says of them, (3,)."""
        found = self.free.light(self.free.fields(u), np)
        return np.ones(3, np.float32) if found is None else found.astype(np.float32)

    def _step(self, u: Any, state: Any, blocks: Sequence[Block]) -> Any:
        return step(u, state, self.bounds, self.start, blocks, free=self.free, solver=self.solver)

    def descend(self, at: Minimum, blocks: Sequence[Block], most: int, stage: str, trust: float = NEAR) -> tuple[Minimum, bool]:
        """Run the solver from a point on some blocks; returns where it came to, and whether it converged."""
        u = np.asarray(at.vector, float)
        state = initial(u, self.solver, trust)
        scale = max(self.shine(blocks), 1e-30)
        for k in range(most):
            u, state = self._step(u, state, blocks)
            error = float(np.sqrt(2.0 * float(state.loss) / scale))
            self.trace.append(Row(time.perf_counter() - self.began, stage, at.starts[0], k, error))
            if bool(state.done):
                break
        finite = bool(np.isfinite(float(state.loss)))
        cost = float(state.loss) if finite else np.inf
        reached = dataclasses.replace(at, vector=np.asarray(u), cost=cost, gram=np.asarray(state.gram))
        return reached, bool(state.done) and finite

    def shine(self, blocks: Sequence[Block]) -> float:
        return sum(self.brightness[: len(blocks)])

    def refit(self, u: np.ndarray, slots: int | Sequence[int]) -> Minimum:
        """Where all but some entries of the vector go from there."""
        kept = self.bounds
        still = np.isin(np.arange(len(u)), slots)
        self.bounds = np.where(still, u, kept[0]), np.where(still, u, kept[1])
        steps = len(self.trace)
        reached, _ = self.descend(Minimum((0,), u, np.inf, np.eye(len(u))), self.blocks, FINE_STEPS, "profile")
        self.bounds = kept
        del self.trace[steps:]  # the fit had ended
        return reached

    def glance(self, u: np.ndarray) -> float:
        """Cost of the first block of each reference at a point, without derivatives."""
        models, weights = self.models(u, self.few), self._even(self.few)
        residual = [
            w * (compared(model, by) - compared(seen.target, by))
            for model, seen, by, w in zip(models, self.few, self.curves, weights, strict=True)
        ]
        cost = sum(np.sum(np.square(r, dtype=float)) for r in residual)
        return float(cost) if np.isfinite(cost) else np.inf

    def effect(self, u: np.ndarray, blocks: Sequence[Block]) -> np.ndarray | None:
        """How much the images change with each parameter; None where they are not finite."""
        _, state = self._step(u, initial(u, self.solver), blocks)
        return np.sqrt(np.diag(np.asarray(state.gram))) if np.isfinite(float(state.loss)) else None

    def discrepancy(
        self, u: np.ndarray, models: Sequence[np.ndarray], jacobian: np.ndarray, gram: np.ndarray, seed: int
    ) -> discrepancy.Discrepancy:
        """What the form gets wrong at a point, and what that makes of the parameters."""
        place = self.layout.reference.ravel(), self.layout.pixel.ravel()
        slopes = self.layout.scatter([slope(m, by) for m, by in zip(models, self.curves, strict=True)], 0.0).reshape(-1, 3)
        weights = np.concatenate([np.asarray(block.inverse_sigma).T for block in self.blocks])
        return discrepancy.measure(
            self.material(u), self.views, self.samples, place, jacobian, slopes * weights * self.light(u), gram, seed
        )

    def sectors(self) -> np.ndarray:
        """Sector of the image that each pixel of the blocks is in, around the highlight: each has its share of every half angle."""
        return self.layout.scatter([sectors(samples, GROUPS) for samples in self.samples], -1.0).ravel()


def _compared_by(by: Curve | None, block: Block) -> Block:
    """A block that is compared in other values than its own; they stand beside channels that come first."""
    return block if by is None else dataclasses.replace(block, curve=jax.device_put(jax.tree.map(lambda a: a[:, None], by)))


def _weighted(block: Block, inverse_sigma: np.ndarray) -> Block:
    return dataclasses.replace(block, inverse_sigma=jax.device_put(inverse_sigma))
