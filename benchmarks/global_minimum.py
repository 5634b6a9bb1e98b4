"""How often a fit finds the global minimum from a start that says nothing: a material drawn evenly inside the full bounds.

    python benchmarks/global_minimum.py [FOLDER] [--only NAME] [--trials 100] [--starts 8]
    python benchmarks/global_minimum.py --models [--only NAME] [--trials 100]

Every trial gives a random material as the scene's start, and a seed of its own for the starts that the fit draws and for its choice of pixels;
all else is the default fit. The first form is of renders, as in `recovery.py`: there the global minimum is that of a fit with 64 starts, or of a
trial that found a lower one. The second is of the models' own images of a sphere, with a little noise, as in `sigma_coverage.py`: there it is
where the truth leads. A trial has found it where the way to it, by the curvature there, would cost less than a quarter of its own cost:
other pixels and other noise move it by less.
"""

import argparse
import dataclasses
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from renders import renders
from rich.console import Console
from rich.table import Table
from sigma_coverage import HARD, MODELS, noisy, view_of

from layerfit import View, load
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.parameters import parametrise
from layerfit.fit.result import FitResult
from layerfit.fit.starts import LEVEL
from layerfit.stack import Stack

FOLDER = Path(__file__).parents[1] / "examples" / "references"
NEAR = 0.25
NOISE = 0.005
"""Of white at white, in the models' own images: minima that far apart are told apart."""


@dataclasses.dataclass(frozen=True)
class Case:
    """What is fitted, and a start from which the global minimum is found with so many starts."""

    name: str
    views: Sequence[View]
    start: Stack
    free: tuple[str, ...] | None
    starts: int

    def fit(self, start: Stack, seed: int, starts: int) -> FitResult:
        return fit(self.views, start, free=self.free, starts=starts, seed=seed, where=self.name)

    def anywhere(self, seed: int) -> Stack:
        """The material with its free parameters drawn evenly between their bounds, in the coordinates of the fit."""
        stack, free = parametrise(self.start, self.free, (), self.name)
        u = np.random.default_rng(seed).uniform(*free.bounds())
        return free.put(stack, free.fields(u), np)


def of_renders(folder: Path, only: str) -> Iterator[Case]:
    with tempfile.TemporaryDirectory() as scratch:
        for render in renders(folder, Path(scratch)):
            if only in render.name:
                yield Case(render.name, load(render.scene), render.scene.start, render.scene.fit.free, 64)


def of_models(only: str) -> Iterator[Case]:
    for name, case in (MODELS | HARD).items():
        if only in name:
            with tempfile.TemporaryDirectory() as scratch:
                view = noisy(view_of(case, Path(scratch)), NOISE, 0.7, 0)
            yield Case(name, [view], case.stack, case.free, 1)


def missed(best: FitResult, found: FitResult) -> bool:
    """Whether a fit came to another minimum, or to none."""
    if len(found.vector) != len(best.vector):
        return True
    away = found.vector - best.vector
    white = LEVEL * sum(np.sum(np.square(s.target, dtype=float)) for s in best.samples)
    return bool(0.5 * away @ best.gram @ away > NEAR * best.cost + white)


def trials(case: Case, count: int, starts: int) -> tuple[FitResult, list[FitResult | None], float]:
    """The global minimum, what each trial found (None: refused), and the seconds of a trial in the median."""
    best, found, seconds = case.fit(case.start, 0, case.starts), [], []
    for k in range(count):
        began = time.perf_counter()
        try:
            found.append(case.fit(case.anywhere(k), k, starts))
        except InputError as error:
            print(f"{case.name}, trial {k}: {error}", flush=True)
            found.append(None)
        seconds.append(time.perf_counter() - began)
        if found[-1] and case.starts > 1 and missed(best, found[-1]) and found[-1].misfit < best.misfit:
            best = found[-1]
    return best, found, float(np.median(seconds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--models", action="store_true", help="the models' own images, not renders")
    parser.add_argument("--only", default="", help="part of the names to run")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--starts", type=int, default=8)
    asked = parser.parse_args()
    table = Table("name", "found", "steps", "seconds", "misfit", "misfit of the trials that missed it")
    for case in of_models(asked.only) if asked.models else of_renders(asked.folder, asked.only):
        best, found, seconds = trials(case, asked.trials, asked.starts)
        lost = ["refused" if f is None else f"{f.misfit:.3g}" for f in found if f is None or missed(best, f)]
        steps = np.median([f.steps for f in found if f])
        row = (
            f"{len(found) - len(lost)} of {len(found)}",
            f"{steps:.0f}",
            f"{seconds:.2f}",
            f"{best.misfit:.3g}",
            ", ".join(lost[:8]),
        )
        table.add_row(case.name, *row)
        print(case.name, *row, flush=True)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
