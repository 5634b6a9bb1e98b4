"""How near a fit comes to materials that are known, from a poor start.

    python benchmarks/recovery.py FOLDER [FOLDER ...] [--only NAME] [--model MODEL]

Folders of renders with known materials, such as examples/references; see `renders.py`. Prints one row a render and the
median and 90th percentile over all parameters; optical depths are compared with a floor of .3.
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


def fitted(render: Render) -> tuple[Any, dict[str, Any], float]:
    """Fit a render; the result, its values by name, and the seconds it took."""
    request = render.scene.fit
    start = time.perf_counter()
    result = fit(
        load(render.scene),
        render.scene.start,
        free=request.free,
        fixed=dict(request.fixed),
        metric=request.metric,
        loss=request.loss,
    )
    return result, result.free.values(result.vector), time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--only", default="", help="part of the names of the renders to fit")
    parser.add_argument("--model", help="model of the material, where the scene is made here")
    arguments = parser.parse_args()
    table = Table("render", "found (true)", "worst error", "residual", "seconds")
    every: list[float] = []
    with tempfile.TemporaryDirectory() as scratch:
        for folder in arguments.folders:
            for render in renders(folder, Path(scratch), arguments.model):
                if arguments.only not in render.name:
                    continue
                result, values, seconds = fitted(render)
                found = errors(render, values)
                every += found.values()
                cells = [f"{name} {_text(value)}" + _true(render, name) for name, value in values.items()]
                residual = result.trace[-1].error
                worst = f"{max(found.values()):.3f}" if found else "not known"
                table.add_row(render.name, "\n".join(cells), worst, f"{residual:.2e}", f"{seconds:.1f}")
    console = Console(width=140)
    console.print(table)
    if every:
        console.print(f"{len(every)} parameters: median error {np.median(every):.3f}, p90 {np.quantile(every, 0.9):.3f}")


def _text(value: Any) -> str:
    return " ".join(f"{v:.4g}" for v in np.atleast_1d(value))


def _true(render: Render, name: str) -> str:
    return f"  ({_text(render.truth[name])})" if name in render.truth else ""


if __name__ == "__main__":
    main()
