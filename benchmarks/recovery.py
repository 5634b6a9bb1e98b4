"""How near a fit comes to materials that are known, from a poor start.

    python benchmarks/recovery.py FOLDER [FOLDER ...] [--only NAME] [--model MODEL]

Folders of renders with known materials, such as examples/references; see `renders.py`. Prints one row a render, and for the values and for those
without the error of their form the median and 90th percentile over all parameters that have a sigma; optical depths are compared with a floor
of .3. And how many truths are within one, two and three sigma of the value, how many lower limits are below the truth, and how much was said
to be undetermined.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from renders import Render, errors, renders
from rich.console import Console
from rich.table import Table

from layerfit.capture.load import load
from layerfit.fit.fit import fit
from layerfit.fit.result import FitResult, parameters
from layerfit.fit.words import NONE


def fitted(render: Render) -> tuple[FitResult, float]:
    """Fit a render; the result, and the seconds it took."""
    request = render.scene.fit
    start = time.perf_counter()
    result = fit(
        load(render.scene),
        render.scene.start,
        free=request.free,
        fixed=dict(request.fixed),
        metric=request.metric,
        loss=request.loss,
        model_error=True,
    )
    return result, time.perf_counter() - start


def pulls(rows: dict[str, Any], truth: dict[str, Any]) -> list[float]:
    """(value - truth) / sigma of each number whose truth and sigma are known."""
    found = []
    for name in rows.keys() & truth.keys():
        value, sigma, wanted = (
            np.atleast_1d(np.array(x, float)) for x in (rows[name]["value"], rows[name]["sigma"], truth[name])
        )
        found += ((value - wanted) / sigma)[np.isfinite(sigma)].tolist()
    return found


def limits(rows: dict[str, Any], truth: dict[str, Any]) -> list[bool]:
    """Whether the truth is above each lower limit."""
    found = []
    for name in rows.keys() & truth.keys():
        if rows[name].get("lower_limit"):
            wanted, ends = np.atleast_1d(truth[name]), rows[name]["interval_95"]
            found += [w >= end[0] for w, end in zip(wanted, ends, strict=True) if end is not None and end[0] and end[1] is None]
    return found


def known(rows: dict[str, Any]) -> set[str]:
    """Names of the numbers that have a sigma; channels apart."""
    found = set()
    for name, row in rows.items():
        sigma = np.atleast_1d(np.array(row["sigma"], float))
        found |= {name if len(sigma) == 1 else f"{name}[{k}]" for k in np.flatnonzero(np.isfinite(sigma))}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--only", default="", help="part of the names of the renders to fit")
    parser.add_argument("--model", help="model of the material, where the scene is made here")
    arguments = parser.parse_args()
    table = Table("render", "found", "corrected", "true", "worst error", "corrected", "residual", "seconds")
    every: dict[str, list[float]] = {"value": [], "corrected": []}
    pulled: list[float] = []
    limited: list[bool] = []
    unknown = 0
    with tempfile.TemporaryDirectory() as scratch:
        for folder in arguments.folders:
            for render in renders(folder, Path(scratch), arguments.model):
                if arguments.only not in render.name:
                    continue
                result, seconds = fitted(render)
                rows = parameters(result)
                off = {key: errors(render, {name: row.get(key, row["value"]) for name, row in rows.items()}) for key in every}
                said = known(rows)
                for key, values in off.items():
                    every[key] += [error for name, error in values.items() if name in said]
                limited += limits(rows, render.truth)
                unknown += len(off["value"].keys() - said)
                pulled += pulls(rows, render.truth)
                columns = [
                    [f"{name} {_text(row['value'])} +/- {_text(row['sigma'])}" for name, row in rows.items()],
                    [_text(row.get("corrected")) for row in rows.values()],
                    [_text(render.truth.get(name)) for name in rows],
                ]
                worst = [f"{max(values.values()):.3f}" if values else "not known" for values in off.values()]
                table.add_row(
                    render.name,
                    *("\n".join(cells) for cells in columns),
                    *worst,
                    f"{result.trace[-1].error:.2e}",
                    f"{seconds:.1f}",
                )
    console = Console(width=190)
    console.print(table)
    for key, values in every.items():
        if values:
            console.print(
                f"{len(values)} parameters, {key}: median error {np.median(values):.3f}, p90 {np.quantile(values, 0.9):.3f}"
            )
    if pulled:
        within = (f"{np.mean(np.abs(pulled) <= k):.3f}" for k in (1, 2, 3))
        console.print(f"{len(pulled)} with a sigma: within one, two, three sigma {', '.join(within)}")
    console.print(
        f"{unknown} without: {len(limited)} lower limits, {sum(limited)} of them below the truth; the others undetermined"
    )


def _text(value: Any) -> str:
    return (
        "" if value is None else " ".join(f"{NONE if v is None else format(v, '.4g')}" for v in np.atleast_1d(value).tolist())
    )


if __name__ == "__main__":
    main()
