"""Seconds of a fit against the size of its image, each size in its turn in one process: reading the file aside, and compiled.

    python benchmarks/image_size.py [--sides 512 1024 2048] [--runs 5]

The image is a sphere of lacquered copper with 5 % of noise. Prints the time over that of the first size, and the worst error of a parameter.
"""

import argparse
import dataclasses
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from layerfit.capture.exr import write_exr
from layerfit.capture.geometry import sphere_surface
from layerfit.capture.reference import load_reference
from layerfit.capture.samples import View
from layerfit.capture.scene import Camera, Directional, Reference, Sphere
from layerfit.fit.fit import fit
from layerfit.fit.result import FitResult
from layerfit.layers import Coat
from layerfit.render import predict
from layerfit.stack import Stack
from layerfit.surfaces import Conductor

COPPER = {"eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}
TRUTH = {"coat.alpha": 0.12, "coat.eta": 1.5, "coat.tau": [0.08, 0.25, 0.7], "base.alpha": 0.2}
MATERIAL = Stack((Coat(alpha=0.12, eta=1.5, tau=TRUTH["coat.tau"]),), Conductor(alpha=0.2, **COPPER))
START = Stack((Coat(alpha=0.3, eta=1.4, tau=[0.3, 0.3, 0.3]),), Conductor(alpha=0.4, **COPPER))
CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
SUN = Directional((0.46175709, 0.55410852, 0.69263564), (np.pi, np.pi, np.pi))


def view(side: int) -> View:
    """A noisy image of the material, `side` x `side`."""
    covered = sphere_surface(Sphere(), CAMERA, side, side).covered
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sphere.exr"
        write_exr(path, dict.fromkeys("RGB", np.where(covered, 0.5, 0.0)) | {"A": covered.astype(float)})
        seen = load_reference(Reference(path, CAMERA, (SUN,), Sphere(), {}, None, {}), 0.1)
    image = predict(MATERIAL, *seen.samples().arrays[:3])
    image = image * (1.0 + 0.05 * np.random.default_rng(0).normal(size=image.shape))
    return dataclasses.replace(seen, target=image.astype(np.float32))


def worst(result: FitResult) -> float:
    """Largest relative error of a parameter; optical depths with a floor of .3."""
    found = result.free.values(result.vector)
    off = [np.abs(found[n] - t) / np.maximum(t, 0.3 if n == "coat.tau" else 0.0) for n, t in TRUTH.items()]
    return float(max(np.max(x) for x in off))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sides", type=int, nargs="+", default=[512, 1024, 2048])
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    views = {side: view(side) for side in arguments.sides}
    seconds: dict[int, list[float]] = {side: [] for side in views}
    results: dict[int, FitResult] = {}
    for run in range(arguments.runs + 1):
        for side, seen in views.items():
            start = time.perf_counter()
            results[side] = fit([seen], START, free=tuple(TRUTH))
            if run:  # the first compiles
                seconds[side].append(time.perf_counter() - start)
    first = np.array(seconds[arguments.sides[0]])
    table = Table(
        "image", "usable pixels", f"time over that of {arguments.sides[0]} (median of runs)", "worst error of a parameter"
    )
    for side, seen in views.items():
        ratio = float(np.median(np.array(seconds[side]) / first))
        table.add_row(f"{side} x {side}", str(len(seen.index)), f"{ratio:.2f}", f"{100.0 * worst(results[side]):.2f} %")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
