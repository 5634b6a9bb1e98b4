"""The fit: from a scene to a material with its uncertainties."""

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np

from .._compiled import CLOCK
from ..capture.load import AnyView
from ..capture.scene import METRICS
from ..documents import nearest
from ..errors import InputError
from ..stack import Stack
from . import discrepancy
from .asked import what_is_asked
from .nuisances import THICKNESS
from .problem import Problem
from .profile import ABSORBING, Profile, along, deep, lower_limit, scatter, threshold
from .residuals import NEAR, SEARCHED
from .result import FitResult
from .starts import (
    COARSE_STEPS,
    FINE_STEPS,
    LEVEL,
    LOOK_STEPS,
    SCREENED,
    Minimum,
    distinct,
    in_sight,
    ranked,
    search,
    space_filling,
)
from .together import ROUNDS
from .uncertainty import Uncertainty, estimate
from .weights import misfit

COARSE_BLOCKS = 2
"""Blocks of pixels for the search, and at least one of each reference: enough to tell minima apart."""


def fit(
    views: Sequence[AnyView],
    start: Stack,
    *,
    free: Sequence[str] | None = None,
    also: Sequence[str] = (),
    each: Sequence[str] = (),
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

    `free` are names such as "coat.alpha" (left out: what an image can tell), `also` are further ones, such as "light.ambient", `each` those that
    every reference has for itself, `fixed` are values by name. `metric` is "law", "uniform",
    "relative", "log" or "cube_root" (see `difference`), `loss` "square", "huber" or "cauchy". `starts` space-filling starts are tried beside
    the given one, all coarsely on few pixels, the best places that they reach to the end. With `model_error` sigmas hold what the form of the
    model gets wrong, too: a random walk tells it, at the fitted material (see `discrepancy`). `profile` are names of parameters whose intervals
    are found by fitting the others again (see `profile`). Raises `InputError` for what cannot be fitted.
    """
    if metric not in METRICS:
        raise InputError(f"{where}.metric = {metric!r}: should be one of {', '.join(METRICS)}{nearest(metric, METRICS)}")
    with jax.enable_x64(True):
        return _Fit(
            views, start, free, also, each, fixed or {}, metric, loss, starts, seed, model_error, profile, where, progress
        ).run()


class _Fit:
    def __init__(
        self, views, start, free, also, each, fixed, metric, loss, starts, seed, model_error, profile, where, progress
    ):
        wanted = what_is_asked(views, start, free, also, each, fixed, where)
        names = [f.name for f in wanted.free.free]
        if unknown := [name for name in profile if name not in names]:
            raise InputError(
                f"{where}: there is no profile of {unknown[0]!r}{nearest(unknown[0], names)}: it is not fitted; {', '.join(names)} are"
            )
        self.explicit, self.held = free is not None, wanted.held
        self.starts, self.seed, self.where = starts, seed, where
        self.model_error, self.profile, self.progress = model_error, profile, progress
        self.notes: list[str] = [
            f"only ratios of thickness show: {f.name} was held at {f.told:g}, and the others are over it"
            for f in wanted.free.held
            if f.field == THICKNESS
        ]
        self.clock = dataclasses.replace(CLOCK)
        self.problem = Problem(views, wanted.start, wanted.free, metric, loss, seed)

    def run(self) -> FitResult:
        problem = self.problem
        problem.begin(self.model_error)
        problem.weigh(None)
        minima = self._settled(self._search())
        origin = problem.free.pack(problem.start)
        best, converged = minima[0], False
        for k in range(ROUNDS):
            problem.weigh(best.vector)
            best, converged = next(problem.descend([best], f"fine {k + 1}", FINE_STEPS))
            self.progress("fine", (k + 1) / ROUNDS)
        u, cost, gram = best.vector, best.cost, best.gram
        jacobian, residual = problem.residuals.rows(u)
        uncertainty = estimate(gram, jacobian, residual, problem.sectors(), problem.alike())
        models = problem.models(u, problem.samples)
        off = self._discrepancy(u, models, jacobian, gram) if self.model_error else None
        beyond = misfit(models, problem.samples, problem.weights(models, "law"))
        profiles, hidden = self._profiles(best, beyond, uncertainty, np.zeros(3) if off is None else off.cost)
        clock = CLOCK.since(self.clock)
        return FitResult(
            stack=problem.material(u),
            materials=problem.materials(u),
            lights=problem.lights(u),
            start=problem.start,
            free=problem.free,
            vector=u,
            start_vector=origin,
            gram=gram,
            uncertainty=uncertainty,
            discrepancy=off,
            held=self.held,
            converged=converged,
            cost=cost,
            steps=len(problem.trace),
            minima=minima,
            notes=self.notes,
            trace=sorted(problem.trace, key=lambda row: row.time_s),
            models=models,
            misfit=beyond,
            profiles=profiles,
            hidden=hidden,
            samples=problem.samples,
            views=problem.views,
            clock=clock,
            solve_s=time.perf_counter() - problem.began - clock.trace_s - clock.compile_s,
        )

    def _search(self) -> list[Minimum]:
        """Minima of the coarse fit, best first."""
        problem = self.problem
        views = len(problem.views)
        few = min(max(COARSE_BLOCKS, views), problem.count)

        def descend(at: Sequence[Minimum], stage: str) -> Iterator[Minimum]:
            coarse = stage == "coarse"
            most, trust = (COARSE_STEPS, 1.0) if coarse else (FINE_STEPS, NEAR)
            return (reached for reached, _ in problem.descend(at, stage, most, few, trust, SEARCHED))

        level = LEVEL * problem.shine(few)
        return search(self._points(views), descend, level, lambda share: self.progress("coarse", share))

    def _points(self, count: int) -> list[np.ndarray]:
        """Starts: the given one, and the best of many space-filling ones. What has no effect at any of them is held."""
        problem = self.problem
        drawn = space_filling(problem.free, SCREENED * (self.starts - 1), self.seed)
        first = problem.free.pack(problem.start)
        looked = sorted(problem.look(drawn, count, LOOK_STEPS), key=lambda place: place[1])
        begun = [*problem.look([first], count, 1), *looked[: self.starts - 1]]
        points, effects = [first, *(place for place, _, _ in begun[1:])], [effect for _, _, effect in begun]
        seen = [effect > 1e-7 * effect.max() for effect in effects if effect is not None]
        if not seen:
            raise InputError(f"{self.where}: the start gives no finite image; choose other values in [material]")
        if effects[0] is None:
            self.notes.append("the start gives no finite image; the fit began from others")
        told = np.any(seen, 0)
        kept = [f for f in problem.free.free if np.any(told[list(f.slots)])]
        slots = [slot for f in kept for slot in f.slots]
        self._hold([f.name for f in problem.free.free if f not in kept], first)
        return [point[slots] for point in points]

    def _hold(self, blind: Sequence[str], first: np.ndarray) -> None:
        """Hold what has no effect on these images, with a reason; a parameter that the user asked for by name is an error."""
        if not blind:
            return
        if self.explicit:
            raise InputError(
                f"{self.where}.free: {_have_no_effect(blind)} at {'the start' if self.starts == 1 else 'any start'}; leave "
                f"{'it' if len(blind) == 1 else 'them'} out, or start where there is one (a base below an opaque coat has none)"
            )
        self.notes.append(f"{_have_no_effect(blind)} and {'was' if len(blind) == 1 else 'were'} held at the start")
        if len(blind) == len(self.problem.free.free):
            raise InputError(f"{self.where}.free: nothing is left to fit")
        self.problem.release(self.problem.start, self.problem.free.without(blind, first))

    def _settled(self, minima: list[Minimum]) -> list[Minimum]:
        """The same where it takes all pixels, and weights that follow the model, to say which is best."""
        problem = self.problem
        near = in_sight(minima)
        if len(near) == 1:
            return minima
        problem.weigh(near[0].vector)
        level = LEVEL * problem.shine()
        ends = distinct([reached for reached, _ in problem.descend(near, "compare", FINE_STEPS)], level)
        return [*ranked(ends, level), *(m for m in minima if not any(m is other for other in near))]

    def _discrepancy(
        self, u: np.ndarray, models: Sequence[np.ndarray], jacobian: np.ndarray, gram: np.ndarray
    ) -> discrepancy.Discrepancy | None:
        """What the form gets wrong; None, with a note, where no random walk can tell."""
        stack = self.problem.material(u)
        if reason := discrepancy.unmeasured(stack):
            self.notes.append(f"what the form of the model gets wrong is in no sigma: {reason}")
            return None
        self.progress("walk", 0.0)
        return self.problem.discrepancy(u, models, jacobian, gram, self.seed)

    def _profiles(
        self, best: Minimum, misfit: float, uncertainty: Uncertainty, form: np.ndarray
    ) -> tuple[list[Profile], list[str]]:
        """Profiles of the parameters that were asked for, and of depths that are but lower limits; and what those hide altogether.

        `form` (3,) is what the form gets wrong, by channel: that of one channel can hide a depth of that channel only.
        """
        problem = self.problem
        residuals = sum(s.target.size for s in problem.samples)
        unexplained, even = 0.5 * misfit**2 * problem.shine(), 2.0 * best.cost / residuals
        asked = [slot for f in problem.free.free if f.name in self.profile for slot in f.slots]
        deeper = [
            slot for slot in deep(problem.free.free, problem.materials(best.vector), uncertainty.sigma) if slot not in asked
        ]
        hides = {
            slot: form[k] if len(f.slots) == 3 else form.sum() for f in problem.free.free for k, slot in enumerate(f.slots)
        }
        widest = max([even, *(scatter(best.gram, uncertainty.covariance, slot) for slot in deeper)])
        found: list[Profile] = []
        for slot in (*asked, *deeper):
            lower, upper = problem.bounds[0][slot], problem.bounds[1][slot]
            first = float(np.clip(uncertainty.sigma[slot], 1e-3 * (upper - lower), 0.03 * (upper - lower)))
            limit = threshold(max(even, scatter(best.gram, uncertainty.covariance, slot)), unexplained, hides[slot]) + 1e-30
            how = (problem.refit, best, slot, first, limit, (lower, upper))
            profile = along(*how) if slot in asked else lower_limit(*how, problem.bounds[1] - problem.bounds[0])
            found += [profile] if profile else []
        names = {
            f.name for f in problem.free.free for p in found if p.integrated and p.slot in f.slots and p.interval[0] is not None
        }
        self.notes += [
            f"{name} is a lower limit if what lies below is not black: that would look alike at any depth"
            for name in sorted(names)
        ]
        return found, self._hidden(best, found, threshold(widest, unexplained, form.sum(), 3) + 1e-30)

    def _hidden(self, best: Minimum, profiles: Sequence[Profile], limit: float) -> list[str]:
        """Parameters of what lies below a coat that may be opaque in all channels at once: whatever they are, the images can be the same."""
        problem = self.problem
        limits = {p.slot for p in profiles if p.rise[-1] < 1.0 and p.at[-1] == problem.bounds[1][p.slot]}
        for f in problem.free.free:
            if f.field in ABSORBING and f.layer is not None and limits.issuperset(f.slots):
                opaque = np.array(best.vector)
                opaque[list(f.slots)] = problem.bounds[1][list(f.slots)]
                if problem.refit(opaque, f.slots).cost - best.cost < limit:
                    hidden = [g for g in problem.free.free if g.layer is not None and g.layer > f.layer]
                    return [g.name for g in hidden if f.reference is None or g.reference == f.reference]
        return []


def _have_no_effect(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no effect on this image"
