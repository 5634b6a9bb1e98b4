"""What accuracy costs in a fit: its error against its run time, for pixels, starts, precision and solver."""

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from scipy.optimize import least_squares

from ..capture.load import AnyView
from ..capture.measured.sphere import bare_sphere
from ..capture.scene import FitRequest, Scene
from ..errors import InputError
from ..fit.blocks import arrange, stratified, weighted
from ..fit.fit import fit
from ..fit.nuisances import of_a_scene
from ..fit.parameters import free_by_default, known_parameters, parametrise
from ..fit.residuals import Residuals, initial, scaled
from ..fit.starts import space_filling
from ..fit.weights import inverse_sigma
from ..render import predict
from ..stack import Stack

SIDE = 128
NOISE = 0.02
"""Of the image that is fitted where there is no scene, relative."""

PIXELS, STARTS = (256, 1024, 4096, 16384), (1, 2, 4, 8)
SOLVERS = ("layerfit", "trf", "dogbox")
"""The project's own Levenberg-Marquardt, and those of SciPy that know bounds (Branch, Coleman and Li 1999; Voglis and Lagaris 2004)."""

SOLVER_PIXELS = 1024
STEPS = 60


@dataclasses.dataclass(frozen=True)
class Task:
    """What is fitted, and what its result is held against."""

    views: Sequence[AnyView]
    start: Stack
    free: tuple[str, ...] | None
    fixed: dict[str, Any]
    truth: Sequence[np.ndarray]
    """Pixels (n, 3) of every view, without noise where it was added."""

    def error(self, stack: Stack) -> float:
        """Relative L2 over all pixels."""
        models = [predict(scaled(stack, view.scales(stack)), *view.samples().arrays) for view in self.views]
        pairs = list(zip(models, self.truth, strict=True))
        return float(np.sqrt(sum(np.sum((m - t) ** 2) for m, t in pairs) / sum(np.sum(t**2) for _, t in pairs)))


def check_alone(scene: Scene, stack: Stack, command: str) -> None:
    """Raise `InputError` where a scene asks to fit more than a material: `command` holds the rest as the scene says."""
    request, known = scene.fit, known_parameters(stack)
    of_scene = [name for name in (*(request.free or ()), *request.also) if name not in known and of_a_scene(name)]
    if beyond := [*(f"{name} in each reference" for name in request.each), *of_scene]:
        raise InputError(
            f"{scene.path}: fit asks for {beyond[0]}, which `layerfit fit` finds; {command} takes lights and thicknesses as the scene says, and "
            "one material for all references. Leave it out of [fit], and say its value in the scene"
        )


def free_in(request: FitRequest, stack: Stack) -> tuple[str, ...]:
    """What a scene frees of a material."""
    return (*(free_by_default(stack) if request.free is None else request.free), *request.also)


def drawn_task(stack: Stack, free: tuple[str, ...] | None = None, seed: int = 0) -> Task:
    """Finding a material again from a noisy picture of its sphere, from the middle of all ranges."""
    view = bare_sphere(Path("sphere"), SIDE)
    view.check(stack)
    truth = predict(stack, *view.samples().arrays)
    noisy = truth * (1.0 + NOISE * np.random.default_rng(seed).normal(size=truth.shape))
    wide, named = parametrise(stack, free, (), "tradeoff")
    middle = space_filling(named, 1, seed)[0]
    start = named.put(wide, named.fields(middle), np)
    return Task([dataclasses.replace(view, target=noisy)], start, free, {}, [truth])


def runs(task: Task) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """Everything that is tried: a name, and what runs it."""
    most = sum(len(view.index) for view in task.views)
    for pixels in PIXELS:
        if pixels < most:
            yield f"{pixels} pixels, 4 starts", lambda pixels=pixels: _fitted(task, pixels, 4)
    yield f"{most} pixels, 4 starts", lambda: _fitted(task, most, 4)
    for starts in STARTS:
        if starts != 4:
            yield f"{most} pixels, {starts} start{'s' if starts > 1 else ''}", lambda starts=starts: _fitted(task, most, starts)
    for precision in ("float32", "float64"):
        for solver in SOLVERS:
            name = f"{solver}, {precision}"
            yield name, lambda solver=solver, precision=precision: _solved(task, solver, precision)


def thinned(view: AnyView, pixels: int) -> AnyView:
    """So many of the pixels of a reference, stratified by half angle."""
    if len(view.index) <= pixels:
        return view
    return view.some(np.sort(stratified(view.samples(quadrature=1), 0)[:pixels]))


def _fitted(task: Task, pixels: int, starts: int) -> dict[str, Any]:
    """A fit as the command makes it; timed when all is compiled."""
    views = [thinned(view, max(32, pixels // len(task.views))) for view in task.views]

    def run() -> Any:
        return fit(views, task.start, free=task.free, fixed=task.fixed, starts=starts, where="tradeoff")

    run()
    began = time.perf_counter()
    found = run()
    seconds = time.perf_counter() - began
    return _row("fit", pixels, starts, "layerfit", "float32", seconds, found.steps, task.error(found.stack))


def _row(
    kind: str, pixels: int, starts: int, solver: str, precision: str, seconds: float, steps: int, error: float
) -> dict[str, Any]:
    return {
        "kind": kind,
        "pixels": pixels,
        "starts": starts,
        "solver": solver,
        "precision": precision,
        "seconds": float(f"{seconds:.4g}"),
        "steps": steps,
        "rel_l2": float(f"{error:.4g}"),
    }


def _solved(task: Task, solver: str, precision: str) -> dict[str, Any]:
    """One descent from the given start, on the same pixels with the same weights for every solver; timed when all is compiled."""
    dtype = np.dtype(precision)
    with jax.enable_x64(True):
        start, named = parametrise(task.start, task.free, tuple(task.fixed), "tradeoff")
        start = start.astype(dtype)
        views = [thinned(view, max(32, SOLVER_PIXELS // len(task.views))) for view in task.views]
        samples = [view.samples() for view in views]
        blocks, layout = arrange(samples, 0, start.needs)
        weights = [inverse_sigma(s.target, s.target, None, "law") for s in samples]
        cast = jax.tree.map(lambda a: a.astype(dtype) if a.dtype == np.float32 else a, weighted(blocks, layout, weights))
        residuals = Residuals(start, named, None, cast, len(layout.pixel))
        descend = _own if solver == "layerfit" else _scipy
        descend(solver, residuals)
        began = time.perf_counter()
        vector, steps = descend(solver, residuals)
        seconds = time.perf_counter() - began
        found = named.put(start, named.fields(vector), np)
    return _row("solver", sum(len(s.index) for s in samples), 1, solver, precision, seconds, steps, task.error(found))


def _own(solver: str, residuals: Residuals) -> tuple[np.ndarray, int]:
    u = residuals.free.pack(residuals.start)
    u, _, losses = residuals.steps(u, initial(u), residuals.free.bounds(), most=STEPS)
    return np.asarray(u), int(np.sum(~np.isnan(losses)))


def _scipy(solver: str, residuals: Residuals) -> tuple[np.ndarray, int]:
    kept: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def both(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if u.tobytes() not in kept:
            kept.clear()
            kept[u.tobytes()] = residuals.rows(u)
        return kept[u.tobytes()]

    lower, upper = residuals.free.bounds()
    first = np.clip(residuals.free.pack(residuals.start), lower + 1e-6 * (upper - lower), upper - 1e-6 * (upper - lower))
    solve: Any = least_squares  # its stub knows no function for `jac`
    found = solve(
        lambda u: both(u)[1].ravel(),
        first,
        jac=lambda u: both(u)[0].reshape(-1, len(u)),
        bounds=(lower, upper),
        method=solver,
        x_scale="jac",
        max_nfev=STEPS,
    )
    return found.x, int(found.nfev)
