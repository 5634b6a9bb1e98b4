"""The solver of the fit on NIST's nonlinear regression problems (Statistical Reference Datasets), from both of their starts.

    python benchmarks/nist.py [PROBLEM ...]

27 problems with values certified to eleven digits. Residuals are in double precision, parameters in units of their start, and there are no bounds;
all else is what a fit does: columns by forward-mode derivatives, normal equations, Levenberg-Marquardt. Digits are log relative errors
(McCullough 1998), -log10 |found - certified| / |certified|, the least over the parameters, eleven at most. `as in a fit` ends where
a fit ends; `tight` goes on until rounding stops it. The peer is MINPACK (`scipy.optimize.least_squares`, lm, the same exact derivatives, tight),
which works on J itself. The data in `strd/` are NIST's files, in the public domain (https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml).
"""

import argparse
import dataclasses
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

from layerfit.fit.residuals import initial
from layerfit.fit.solve import LONGEST, NormalLevenbergMarquardt, columns, descend, normal_equations, products, tangents

FOLDER = Path(__file__).parent / "strd"
DIGITS = 11.0
MOST_STEPS = 5000

AS_IN_A_FIT = NormalLevenbergMarquardt()
TIGHT = NormalLevenbergMarquardt(rtol=1e-14, atol=0.0, gain=1e-30, least=1e-30)


def _misra1a(b, x):
    return b[0] * (1.0 - jnp.exp(-b[1] * x))


def _chwirut(b, x):
    return jnp.exp(-b[0] * x) / (b[1] + b[2] * x)


def _lanczos(b, x):
    return b[0] * jnp.exp(-b[1] * x) + b[2] * jnp.exp(-b[3] * x) + b[4] * jnp.exp(-b[5] * x)


def _gauss(b, x):
    bell = lambda height, middle, width: height * jnp.exp(-(((x - middle) / width) ** 2))  # noqa: E731
    return b[0] * jnp.exp(-b[1] * x) + bell(*b[2:5]) + bell(*b[5:8])


def _cubic_over_cubic(b, x):
    return (b[0] + x * (b[1] + x * (b[2] + x * b[3]))) / (1.0 + x * (b[4] + x * (b[5] + x * b[6])))


def _enso(b, x):
    wave = lambda period, c, s: c * jnp.cos(2.0 * np.pi * x / period) + s * jnp.sin(2.0 * np.pi * x / period)  # noqa: E731
    return b[0] + wave(12.0, b[1], b[2]) + wave(b[3], b[4], b[5]) + wave(b[6], b[7], b[8])


MODELS: dict[str, Callable[[Sequence[Any], Any], Any]] = {
    "Misra1a": _misra1a,
    "Chwirut2": _chwirut,
    "Chwirut1": _chwirut,
    "Lanczos3": _lanczos,
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "Misra1b": lambda b, x: b[0] * (1.0 - (1.0 + b[1] * x / 2.0) ** -2),
    "Kirby2": lambda b, x: (b[0] + x * (b[1] + x * b[2])) / (1.0 + x * (b[3] + x * b[4])),
    "Hahn1": _cubic_over_cubic,
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * jnp.exp(-b[2] * x[1]),  # of the logarithm of y
    "MGH17": lambda b, x: b[0] + b[1] * jnp.exp(-x * b[3]) + b[2] * jnp.exp(-x * b[4]),
    "Lanczos1": _lanczos,
    "Lanczos2": _lanczos,
    "Gauss3": _gauss,
    "Misra1c": lambda b, x: b[0] * (1.0 - (1.0 + 2.0 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1.0 + b[1] * x),
    "Roszman1": lambda b, x: b[0] - b[1] * x - jnp.arctan(b[2] / (x - b[3])) / np.pi,
    "ENSO": _enso,
    "MGH09": lambda b, x: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "Thurber": _cubic_over_cubic,
    "BoxBOD": _misra1a,
    "Rat42": lambda b, x: b[0] / (1.0 + jnp.exp(b[1] - b[2] * x)),
    "MGH10": lambda b, x: b[0] * jnp.exp(b[1] / (x + b[2])),
    "Eckerle4": lambda b, x: b[0] / b[1] * jnp.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Rat43": lambda b, x: b[0] / (1.0 + jnp.exp(b[1] - b[2] * x)) ** (1.0 / b[3]),
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1.0 / b[2]),
}
"""Value of the response at the predictors `x` and the parameters `b`, in NIST's order of difficulty: lower, average, higher."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """A problem as its file states it."""

    name: str
    x: np.ndarray
    """(observations,) or (predictors, observations)."""
    y: np.ndarray
    starts: tuple[np.ndarray, np.ndarray]
    certified: np.ndarray
    rss: float
    """Certified sum of squared residuals."""
    level: str


def read(name: str) -> Problem:
    """A problem from NIST's file."""
    text = (FOLDER / f"{name}.dat").read_text()
    level = re.search(r"(Lower|Average|Higher) Level of Difficulty", text)
    rows = re.findall(r"^ +b\d+ = +(\S+) +(\S+) +(\S+) +\S+ *$", text, re.MULTILINE)
    one, two, certified = np.array(rows, float).T
    data = np.array([line.split() for line in text[text.rindex("Data:") :].splitlines()[1:] if line.strip()], float).T
    y, x = (np.log(data[0]) if name == "Nelson" else data[0]), data[1:]
    rss = float(text.partition("Residual Sum of Squares:")[2].split()[0])
    return Problem(name, x[0] if len(x) == 1 else x, y, (one, two), certified, rss, level[1].lower() if level else "")


def residual(problem: Problem) -> Callable[[Sequence[Any]], Any]:
    """Residuals (1, observations) of a problem: a material of plain numbers, seen in one channel."""
    return lambda b: (MODELS[problem.name](b, problem.x) - problem.y)[None]


def solve(problem: Problem, start: np.ndarray, solver: NormalLevenbergMarquardt) -> tuple[np.ndarray, int, bool]:
    """Where the solver of the fit ends, after how many steps, and whether it was satisfied."""
    slots = tuple((k,) for k in range(len(start)))
    unbounded = np.full(len(start), -np.inf), np.full(len(start), np.inf)

    def evaluate(u: Any, kept: Any) -> Any:
        made = tangents(lambda u: [a * b for a, b in zip(u, start, strict=True)], list(u))
        return normal_equations(products(columns(residual(problem), *made)), slots), kept

    run = jax.jit(lambda u, state: descend(solver, evaluate, u, state, unbounded, LONGEST, ()))
    u, state, steps = np.ones(len(start)), initial(np.ones(len(start)), solver=solver), 0
    while steps < MOST_STEPS and not bool(state.done):
        u, state, losses, _ = run(u, state)
        steps += int(np.sum(~np.isnan(losses)))
    return np.asarray(u) * start, steps, bool(state.done)


def peer(problem: Problem, start: np.ndarray) -> np.ndarray:
    """Where MINPACK ends."""
    fn = jax.jit(lambda b: residual(problem)(b)[0])
    slope = jax.jit(jax.jacfwd(lambda b: residual(problem)(b)[0]))
    ends = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 100_000}
    value = lambda b: np.nan_to_num(np.asarray(fn(b)), nan=1e100, posinf=1e100, neginf=-1e100)  # noqa: E731
    jacobian = lambda b: np.nan_to_num(np.asarray(slope(b)))  # noqa: E731
    return least_squares(value, start, jac=jacobian, method="lm", x_scale="jac", **ends).x


def digits(found: np.ndarray, certified: np.ndarray) -> float:
    """Digits that are right, of the parameter with the fewest."""
    error = np.abs(found - certified) / np.abs(certified)
    return float(np.clip(-np.log10(np.maximum(np.nan_to_num(error, nan=np.inf).max(), 1e-30)), 0.0, DIGITS))


HEADS = ("as in a fit", "tight", "MINPACK")
RIGHT = 4.0
"""Digits from which on a problem counts as solved."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("problems", nargs="*", help=f"left out: all of {', '.join(MODELS)}")
    asked = parser.parse_args().problems or list(MODELS)
    if unknown := set(asked) - set(MODELS):
        parser.error(f"unknown problem {', '.join(sorted(unknown))}; there are {', '.join(MODELS)}")
    console = Console(width=120)
    table = Table("problem", "level", "start", HEADS[0], "steps", HEADS[1], "steps", HEADS[2])
    found: dict[str, list[list[float]]] = {}
    with jax.enable_x64(True), np.errstate(over="ignore"):  # a trial may overflow: it is a step that failed
        for problem in map(read, asked):
            for k, start in enumerate(problem.starts):
                ends = [solve(problem, start, solver) for solver in (AS_IN_A_FIT, TIGHT)]
                row = [digits(u, problem.certified) for u in (ends[0][0], ends[1][0], peer(problem, start))]
                steps = [f"{count}" if done else f"{count}, no end" for _, count, done in ends]
                cells = (f"{row[0]:.1f}", steps[0], f"{row[1]:.1f}", steps[1], f"{row[2]:.1f}")
                table.add_row(problem.name, problem.level, str(k + 1), *cells)
                found.setdefault(problem.level, []).append(row)
    console.print(table)
    console.print(summary({**found, "all": [row for rows in found.values() for row in rows]}))


def summary(found: dict[str, list[list[float]]]) -> Table:
    """How many runs of each level came out right, and with how many digits."""
    table = Table("level", "runs", *(f"{head}: right, median digits" for head in HEADS))
    for level, rows in found.items():
        cells = [f"{np.sum(column >= RIGHT)}, {np.median(column):.1f}" for column in np.transpose(rows)]
        table.add_row(level, str(len(rows)), *cells)
    return table


if __name__ == "__main__":
    main()
