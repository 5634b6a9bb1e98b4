"""How long `layerfit fit` takes as a process, from its start to its exit, and what share each part of it has.

    python benchmarks/process_time.py [--runs 5] [--side 128] [--model MODEL] [--scene SCENE]

The reference is rendered here: a shipped preset on a sphere, looked for from a poor start. Each run starts three processes, one after
the other: a fit on a machine that never compiled anything (an empty compilation cache), the same fit again, and, as the floor that no
program with these libraries gets below, `python -c 'import jax, scipy.optimize'` with one small function compiled. Prints medians, ratios
to the floor, the shares of `fit.json`, and the peak memory.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from renders import lacquer_scene
from rich.console import Console
from rich.table import Table

FLOOR = "import jax, scipy.optimize; jax.jit(lambda x: x + 1.0)(1.0).block_until_ready()"
FIT = "layerfit fit, first on this machine"
AGAIN = "layerfit fit, again"
PEER = "import jax and scipy.optimize, compile x + 1"


def reference(folder: Path, side: int, model: str) -> Path:
    """A scene of `side` x `side` pixels whose reference layerfit renders from a shipped preset."""
    scene = lacquer_scene(folder, side, model)
    subprocess.run(
        [sys.executable, "-m", "layerfit", "render", "lacquered_copper", scene, "-o", folder / "reference.exr"],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return scene


def timed(arguments: list[Any], cache: Path | str) -> tuple[float, float, str]:
    """Seconds and peak memory [MB] of a process, and what it printed."""
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(cache)}
    start = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
    ) as run:
        assert run.stdout is not None
        printed = run.stdout.read().decode()
        _, status, usage = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - start
    if run.returncode != 0:
        raise SystemExit(f"{arguments}: exit code {run.returncode}")
    return seconds, memory(usage), printed


def memory(usage: resource.struct_rusage) -> float:
    """Peak resident memory [MB] of one process; Linux counts in KiB, macOS in bytes."""
    return usage.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3 / 1.024)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--side", type=int, default=128)
    parser.add_argument("--model", default="precise", help="model of the material that is fitted")
    parser.add_argument("--scene", type=Path, help="another scene, in place of the one that is rendered here")
    arguments = parser.parse_args()
    seconds: dict[str, list[float]] = {name: [] for name in (FIT, AGAIN, PEER)}
    peak = dict.fromkeys(seconds, 0.0)
    shares: dict[str, list[dict[str, float]]] = {FIT: [], AGAIN: []}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        scene = arguments.scene or reference(folder, arguments.side, arguments.model)
        fit = ["-m", "layerfit", "fit", scene, "-o", folder / "out", "--json"]
        for run in range(arguments.runs):
            cache = folder / f"cache_{run}"
            for name, command in ((FIT, fit), (AGAIN, fit), (PEER, ["-c", FLOOR])):
                taken, most, printed = timed(command, cache)
                seconds[name].append(taken)
                peak[name] = max(peak[name], most)
                if name in shares:
                    shares[name].append(json.loads(printed)["time"])
    console = Console(width=140)
    table = Table("process", "over the floor (median of runs)", "seconds", "peak memory, MB")
    for name, values in seconds.items():
        ratio = np.median(np.array(values) / np.array(seconds[PEER]))
        table.add_row(name, f"{ratio:.1f}", f"{np.median(values):.1f}", f"{peak[name]:.0f}")
    console.print(table)
    for name, rows in shares.items():
        median = {key: np.median([row[key] / row["total_s"] for row in rows]) for key in rows[0] if key != "total_s"}
        console.print(f"{name}: " + ", ".join(f"{key[:-2]} {100.0 * share:.0f} %" for key, share in median.items()))


if __name__ == "__main__":
    main()
