"""The fit: from a scene to a material with its uncertainties."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from .. import render
from .._compiled import CLOCK
from .._place import narrowed
from ..capture.load import AnyView
from ..capture.samples import QUADRATURE, Samples, View
from ..capture.scene import METRICS
from ..documents import nearest
from ..errors import InputError
from ..stack import Stack
from . import discrepancy
from .blocks import Block, arrange, channels_first
from .difference import Curve, compared, curve, slope
from .parameters import LIGHT, parametrise, with_fixed
from .profile import ABSORBING, Profile, along, deep, lower_limit, scatter, threshold
from .residuals import NEAR, begin, begin_solver, depths, initial, rows, scaled, step
from .result import FitResult, Held, Row
from .solve import NormalLevenbergMarquardt
from .starts import FINE_STEPS, LEVEL, SCREENED, Minimum, distinct, in_sight, ranked, search, space_filling
from .uncertainty import GROUPS, Uncertainty, estimate
from .weights import Lost, brightness, inverse_sigma, lost, misfit, noise_law, robust

PIXELS = 65536
"""Pixels that a fit uses at most, all references together: more of them do not change the answer by what it can be wrong by."""

EVALUATIONS = 250_000
"""BRDF evaluations that a step may take where light is a quadrature: it decides how many pixels are used."""

DIRECTIONS = QUADRATURE // 2
"""Light samples a pixel of a quadrature: its error is drawn anew for each pixel, so that few hundred of them average it out."""

COARSE_BLOCKS = 2
"""Blocks of pixels for the search, and at least one of each reference: enough to tell minima apart."""

ROUNDS = 3
"""Reweightings: the weights follow the model's values, which follow the weights."""


def fit(
    views: Sequence[AnyView],
    start: Stack,
    *,
    free: Sequence[str] | None = None,
    fixed: dict[str, Any] | None = None,
    metric: str = "law",
    loss: str = "square",
    starts: int = 8,
    seed: int = 0,
    model_error: bool = False,
    profile: Sequence[str] = (),
    where: str = "fit",
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> FitResult:
    """Fit the free parameters of `start` to the references.

    `free` are names such as "coat.alpha" (left out: what an image can tell), `fixed` are values by name. `metric` is "law", "uniform",
    "relative", "log" or "cube_root" (see `difference`), `loss` "square", "huber" or "cauchy". `starts` space-filling starts are tried beside
    the given one, all coarsely on few pixels, the best places that they reach to the end. With `model_error` sigmas hold what the form of the
    model gets wrong, too: a random walk tells it, at the fitted material (see `discrepancy`). `profile` are names of parameters whose intervals
    are found by fitting the others again (see `profile`). Raises `InputError` for what cannot be fitted.
    """
    if metric not in METRICS:
        raise InputError(f"{where}.metric = {metric!r}: should be one of {', '.join(METRICS)}{nearest(metric, METRICS)}")
    with jax.enable_x64(True):
        return _Fit(views, start, free, fixed or {}, metric, loss, starts, seed, model_error, profile, where, progress).run()


class _Fit:
    def __init__(self, views, start, free, fixed, metric, loss, starts, seed, model_error, profile, where, progress):
        start = with_fixed(start, fixed, f"{where}.fixed")
        free, self.held = _without_gauge(start, free, views)
        start, self.free = parametrise(start, free, tuple(fixed), where)
        self.explicit = free is not None
        names = [f.name for f in self.free.free]
        if unknown := [name for name in profile if name not in names]:
            raise InputError(
                f"{where}: there is no profile of {unknown[0]!r}{nearest(unknown[0], names)}: it is not fitted; {', '.join(names)} are"
            )
        self.notes: list[str] = []
        self.start = start.astype(np.float32)
        for view in views:
            view.check(start)
            if LIGHT in [f.name for f in self.free.free] and not isinstance(view, View):
                raise InputError(f"{where}.free: {view.reference.path} is a measured BRDF and has no lights; leave {LIGHT} out")
        self.views, self.metric, self.loss, self.starts, self.seed, self.where = views, metric, loss, starts, seed, where
        self.model_error, self.profile, self.progress = model_error, profile, progress
        self.trace: list[Row] = []
        self.clock = dataclasses.replace(CLOCK)
        self.began = time.perf_counter()
        self.samples = [view.samples(_chosen(view, len(views), seed), DIRECTIONS, seed) for view in views]
        blocks, self.layout = arrange(self.samples, _scales(views, start), seed, start.needs)
        self.curves = [curve(metric, brightness(s.target)) for s in self.samples]
        self.blocks = [_compared_by(self.curves[of[0]], block) for of, block in zip(self.layout.reference, blocks, strict=True)]
        first = self.layout.pixel[: len(views)]  # a block of each reference, in their order
        self.few = [s.some(block[block >= 0]) for s, block in zip(self.samples, first, strict=True)]
        self.solver = NormalLevenbergMarquardt()
        self._set_bounds()

    def _set_bounds(self) -> None:
        self.bounds = self.free.bounds()

    def run(self) -> FitResult:
        origin = self.free.pack(self.start)
        begin_solver(origin, self.bounds, self.blocks, free=self.free, solver=self.solver)
        if self.model_error:
            discrepancy.begin(self.start)
        begin(origin, self.start, self.blocks, free=self.free)
        for view, samples in zip(self.views, self.samples, strict=True):
            stack = scaled(self.start, view.scales(self.start))
            render.begin(stack, samples.wi.shape[1], narrowed(samples.place, stack.needs))
        self._weigh(None)
        minima = self._settled(self._search())
        origin = self.free.pack(self.start)
        best, converged = minima[0], False
        for k in range(ROUNDS):
            self._weigh(best.vector)
            best, converged = self._descend(best, self.blocks, FINE_STEPS, f"fine {k + 1}")
            self.progress("fine", (k + 1) / ROUNDS)
        u, cost, gram = best.vector, best.cost, best.gram
        jacobian, residual = rows(u, self.start, self.blocks, free=self.free)
        uncertainty = estimate(gram, jacobian, residual, self._sectors(), self._alike())
        models = self._models(u, self.samples)
        off = self._discrepancy(u, models, jacobian, gram) if self.model_error else None
        beyond = misfit(models, self.samples, self._weights(models, "law"))
        profiles, hidden = self._profiles(best, beyond, uncertainty, np.zeros(3) if off is None else off.cost)
        clock = CLOCK.since(self.clock)
        return FitResult(
            stack=self._material(u),
            light=self._light(u),
            start=self.start,
            free=self.free,
            vector=u,
            start_vector=origin,
            gram=gram,
            uncertainty=uncertainty,
            discrepancy=off,
            held=self.held,
            converged=converged,
            cost=cost,
            steps=len(self.trace),
            minima=minima,
            notes=self.notes,
            trace=self.trace,
            models=models,
            misfit=beyond,
            profiles=profiles,
            hidden=hidden,
            samples=self.samples,
            views=self.views,
            clock=clock,
            solve_s=time.perf_counter() - self.began - clock.trace_s - clock.compile_s,
        )

    def _profiles(
        self, best: Minimum, misfit: float, uncertainty: Uncertainty, form: np.ndarray
    ) -> tuple[list[Profile], list[str]]:
        """Profiles of the parameters that were asked for, and of depths that are but lower limits; and what those hide altogether.

        `form` (3,) is what the form gets wrong, by channel: that of one channel can hide a depth of that channel only.
        """
        residuals = sum(s.target.size for s in self.samples)
        unexplained, even = 0.5 * misfit**2 * self._brightness(self.blocks), 2.0 * best.cost / residuals
        asked = [slot for f in self.free.free if f.name in self.profile for slot in f.slots]
        deeper = [slot for slot in deep(self.free.free, self._material(best.vector)) if slot not in asked]
        hides = {slot: form[k] if len(f.slots) == 3 else form.sum() for f in self.free.free for k, slot in enumerate(f.slots)}
        widest = max([even, *(scatter(best.gram, uncertainty.covariance, slot) for slot in deeper)])
        found: list[Profile] = []
        for slot in (*asked, *deeper):
            lower, upper = self.bounds[0][slot], self.bounds[1][slot]
            first = float(np.clip(uncertainty.sigma[slot], 1e-3 * (upper - lower), 0.03 * (upper - lower)))
            run = along if slot in asked else lower_limit
            limit = threshold(max(even, scatter(best.gram, uncertainty.covariance, slot)), unexplained, hides[slot]) + 1e-30
            profile = run(self._refit, best.vector, best.cost, slot, first, limit, (lower, upper))
            found += [profile] if profile else []
        return found, self._hidden(best, found, threshold(widest, unexplained, form.sum(), 3) + 1e-30)

    def _hidden(self, best: Minimum, profiles: Sequence[Profile], limit: float) -> list[str]:
        """Parameters of what lies below a coat that may be opaque in all channels at once: whatever they are, the images can be the same."""
        limits = {p.slot for p in profiles if p.rise[-1] < 1.0 and p.at[-1] == self.bounds[1][p.slot]}
        for f in self.free.free:
            if f.field in ABSORBING and f.layer is not None and limits.issuperset(f.slots):
                opaque = np.array(best.vector)
                opaque[list(f.slots)] = self.bounds[1][list(f.slots)]
                if self._refit(opaque, f.slots)[1] - best.cost < limit:
                    return [below.name for below in self.free.free if below.layer is not None and below.layer > f.layer]
        return []

    def _refit(self, u: np.ndarray, slots: int | Sequence[int]) -> tuple[np.ndarray, float]:
        """Where all but some entries of the vector go from there, and the cost."""
        kept = self.bounds
        still = np.isin(np.arange(len(u)), slots)
        self.bounds = np.where(still, u, kept[0]), np.where(still, u, kept[1])
        steps = len(self.trace)
        reached, _ = self._descend(Minimum((0,), u, np.inf, np.eye(len(u))), self.blocks, FINE_STEPS, "profile")
        self.bounds = kept
        del self.trace[steps:]  # the fit had ended
        return reached.vector, reached.cost

    def _weigh(self, u: np.ndarray | None) -> None:
        """Set the residual weights from the model at `u`, or equal ones before there is a model."""
        if u is None:
            values = self._even(self.samples)
        else:
            models = self._models(u, self.samples)
            values = self._weights(models, self.metric)
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

    def _alike(self) -> list[np.ndarray]:
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

    def _weights(self, models: Sequence[np.ndarray], metric: str) -> list[np.ndarray]:
        """Weights of the residuals of these models, a reference each."""
        values = []
        for model, samples in zip(models, self.samples, strict=True):
            weight = inverse_sigma(model, samples.target, samples.noise, metric)
            by = curve(metric, brightness(samples.target))
            difference = compared(model, by) - compared(samples.target, by)
            values.append(weight * robust(difference * weight, self.loss))
        return values

    def _models(self, u: np.ndarray, samples: Sequence[Samples]) -> list[np.ndarray]:
        stack, light = self._material(u), self._light(u)
        return [
            light * render.predict(scaled(stack, view.scales(stack)), s.wi, s.wo, s.weight, narrowed(s.place, stack.needs))
            for view, s in zip(self.views, samples, strict=True)
        ]

    def _material(self, u: np.ndarray) -> Stack:
        stack = self.free.put(self.start, self.free.fields(u), np)
        return jax.tree.map(lambda a: np.asarray(a, np.float32), stack)

    def _light(self, u: np.ndarray) -> np.ndarray:
        """All lights over what the scene says of them, (3,)."""
        found = self.free.light(self.free.fields(u), np)
        return np.ones(3, np.float32) if found is None else found.astype(np.float32)

    def _step(self, u: Any, state: Any, blocks: Sequence[Block]) -> Any:
        return step(u, state, self.bounds, self.start, blocks, free=self.free, solver=self.solver)

    def _descend(
        self, at: Minimum, blocks: Sequence[Block], most: int, stage: str, trust: float = NEAR
    ) -> tuple[Minimum, bool]:
        """Run the solver from a point on some blocks; returns where it came to, and whether it converged."""
        u = np.asarray(at.vector, float)
        state = initial(u, self.solver, trust)
        scale = max(self._brightness(blocks), 1e-30)
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

    def _brightness(self, blocks: Sequence[Block]) -> float:
        return sum(self.brightness[: len(blocks)])

    def _points(self, blocks: Sequence[Block]) -> list[np.ndarray]:
        """Starts: the given one, and the best of many space-filling ones. What has no effect at any of them is held."""
        drawn = space_filling(self.free, SCREENED * (self.starts - 1), self.seed)
        order = np.argsort([self._glance(point) for point in drawn], kind="stable")
        points = [self.free.pack(self.start), *(drawn[k] for k in order[: self.starts - 1])]
        effects = [self._effect(point, blocks) for point in points]
        seen = [effect > 1e-7 * effect.max() for effect in effects if effect is not None]
        if not seen:
            raise InputError(f"{self.where}: the start gives no finite image; choose other values in [material]")
        if effects[0] is None:
            self.notes.append("the start gives no finite image; the fit began from others")
        told = np.any(seen, 0)
        kept = [f for f in self.free.free if np.any(told[list(f.slots)])]
        slots = [slot for f in kept for slot in f.slots]
        self._hold([f.name for f in self.free.free if f not in kept])
        return [point[slots] for point in points]

    def _glance(self, u: np.ndarray) -> float:
        """Cost of the first block of each reference at a point, without derivatives."""
        models, weights = self._models(u, self.few), self._even(self.few)
        residual = [
            w * (compared(model, by) - compared(seen.target, by))
            for model, seen, by, w in zip(models, self.few, self.curves, weights, strict=True)
        ]
        cost = sum(np.sum(np.square(r, dtype=float)) for r in residual)
        return float(cost) if np.isfinite(cost) else np.inf

    def _effect(self, u: np.ndarray, blocks: Sequence[Block]) -> np.ndarray | None:
        """How much the images change with each parameter; None where they are not finite."""
        _, state = self._step(u, initial(u, self.solver), blocks)
        return np.sqrt(np.diag(np.asarray(state.gram))) if np.isfinite(float(state.loss)) else None

    def _hold(self, blind: Sequence[str]) -> None:
        """Hold what has no effect on these images, with a reason; a parameter that the user asked for by name is an error."""
        if not blind:
            return
        if self.explicit:
            raise InputError(
                f"{self.where}.free: {_have_no_effect(blind)} at {'the start' if self.starts == 1 else 'any start'}; leave "
                f"{'it' if len(blind) == 1 else 'them'} out, or start where there is one (a base below an opaque coat has none)"
            )
        self.notes.append(f"{_have_no_effect(blind)} and {'was' if len(blind) == 1 else 'were'} held at the start")
        left = [f.name for f in self.free.free if f.name not in blind]
        self.start, self.free = parametrise(self.start, left, (), self.where)
        self._set_bounds()

    def _search(self) -> list[Minimum]:
        """Minima of the coarse fit, best first."""
        sample = self.blocks[: max(COARSE_BLOCKS, len(self.views))]

        def descend(at: Minimum, most: int, stage: str) -> Minimum:
            return self._descend(at, sample, most, stage, 1.0 if stage == "coarse" else NEAR)[0]

        level = LEVEL * self._brightness(sample)
        return search(
            self._points(self.blocks[: len(self.views)]), descend, level, lambda share: self.progress("coarse", share)
        )

    def _settled(self, minima: list[Minimum]) -> list[Minimum]:
        """The same where it takes all pixels, and weights that follow the model, to say which is best."""
        near = in_sight(minima)
        if len(near) == 1:
            return minima
        self._weigh(near[0].vector)
        level = LEVEL * self._brightness(self.blocks)
        ends = distinct([self._descend(m, self.blocks, FINE_STEPS, "compare")[0] for m in near], level)
        return [*ranked(ends, level), *(m for m in minima if not any(m is other for other in near))]

    def _discrepancy(
        self, u: np.ndarray, models: Sequence[np.ndarray], jacobian: np.ndarray, gram: np.ndarray
    ) -> discrepancy.Discrepancy | None:
        """What the form gets wrong; None, with a note, where no random walk can tell."""
        stack = self._material(u)
        if reason := discrepancy.unmeasured(stack):
            self.notes.append(f"what the form of the model gets wrong is in no sigma: {reason}")
            return None
        self.progress("walk", 0.0)
        place = self.layout.reference.ravel(), self.layout.pixel.ravel()
        slopes = self.layout.scatter([slope(m, by) for m, by in zip(models, self.curves, strict=True)], 0.0).reshape(-1, 3)
        weights = np.concatenate([np.asarray(block.inverse_sigma).T for block in self.blocks])
        return discrepancy.measure(
            stack, self.views, self.samples, place, jacobian, slopes * weights * self._light(u), gram, self.seed
        )

    def _sectors(self) -> np.ndarray:
        """Sector of the image that each pixel of the blocks is in, around the highlight: each has its share of every half angle."""
        return self.layout.scatter([_sectors(samples, GROUPS) for samples in self.samples], -1.0).ravel()


def _have_no_effect(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no effect on this image"


def _compared_by(by: Curve | None, block: Block) -> Block:
    """A block that is compared in other values than its own; they stand beside channels that come first."""
    return block if by is None else dataclasses.replace(block, curve=jax.device_put(jax.tree.map(lambda a: a[:, None], by)))


def _weighted(block: Block, inverse_sigma: np.ndarray) -> Block:
    return dataclasses.replace(block, inverse_sigma=jax.device_put(inverse_sigma))


def _without_gauge(
    start: Stack, free: Sequence[str] | None, views: Sequence[AnyView]
) -> tuple[Sequence[str] | None, list[Held]]:
    """Hold one of two fields that enter only together, such as the thickness of a coat whose absorption is fitted too.

    What a base does with light is another matter at another thickness: there the images tell.
    """
    held = []
    told = len({view.reference.thickness_scale.get(start.base.name, 1.0) for view in views}) > 1
    for layer in start.layers if told else (*start.layers, start.base):
        for kept, other, sign, why in getattr(layer, "gauges", ()):
            first, second = f"{layer.name}.{kept}", f"{layer.name}.{other}"
            if free is not None and first in free and second in free:
                free = [name for name in free if name != second]
                held.append(Held({first: 1.0, second: sign}, f"{why}; {second} was held at its start"))
    return free, held


def _chosen(view: AnyView, views: int, seed: int) -> np.ndarray:
    """Pixels of a reference that the fit uses: all, or as many as it can afford, at random."""
    most = max(128, (PIXELS if view.exact else EVALUATIONS // DIRECTIONS) // views)
    total = len(view.index)
    if total <= most:
        return np.arange(total)
    return np.sort(np.random.default_rng(seed).choice(total, most, replace=False))


def _sectors(samples: Samples, count: int) -> np.ndarray:
    """Sector of each pixel, of equal numbers of pixels, however the highlight lies."""
    rank = np.argsort(np.argsort(samples.turn))
    return (rank * count // len(rank)).astype(np.float32)


def _scales(views: Sequence[AnyView], start: Stack) -> np.ndarray | None:
    names = [layer.name for layer in start.layers] + ([start.base.name] if depths(start.base) else [])
    for view in views:
        for name in view.reference.thickness_scale:
            if name not in names:
                raise InputError(
                    f"{view.reference.path}: thickness_scale names {name!r}; layers with a thickness are {', '.join(names) or 'none'}"
                )
    scales = [view.scales(start) for view in views]
    if all(scale is None for scale in scales):
        return None
    return np.array([np.ones(len(start.layers) + 1) if scale is None else scale for scale in scales])
