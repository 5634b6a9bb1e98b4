"""How many fits a second `layerfit batch` makes: of scenes of one structure, six parameters each, from files to a table.

    python benchmarks/batch_speed.py [--side 85] [--scenes 400] [--workers 2] [--form corrected] [--quick]

Each scene is a sphere of another coat over copper, with 1 % of noise, as an EXR of `side` x `side` pixels; --side 85 has 4 thousand usable pixels,
--side 170 has 16 thousand. Fits a second are counted from the tenth part of the rows to the last, so without imports and compilers; beside
them stand the memory of the largest process and how far off the parameters are. SciPy's fit of the same six parameters (trf, 2-point, the same
model in NumPy; see fit_speed.py), alone and from pixels in memory, is the peer.
"""

import argparse
import json
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import jax
import numpy as np
from fit_speed import Scipy
from renders import lacquer_scene
from rich.console import Console

from layerfit import fit_batch, load, predict, read_scene, use_compilation_cache
from layerfit.capture.exr import write_exr
from layerfit.fit.parameters import with_fixed
from layerfit.fit.weights import inverse_sigma


def make(folder: Path, count: int, side: int, form: str) -> list[dict[str, Any]]:
    """Scenes with their references; returns the true parameters."""
    rng = np.random.default_rng(0)
    truths = []
    for k in range(count):
        place = folder / f"{k:05d}"
        place.mkdir()
        path = lacquer_scene(place, side, form)
        if k == 0:  # where the pixels lie is the same for all
            view = load(scene := read_scene(path))[0]
            samples = view.samples()
        truths.append(
            {
                "coat.alpha": rng.uniform(0.06, 0.2),
                "coat.eta": rng.uniform(1.4, 1.9),
                "coat.tau": rng.uniform(0.05, 1.0, 3).tolist(),
                "base.alpha": rng.uniform(0.15, 0.4),
            }
        )
        model = predict(with_fixed(scene.start, truths[-1], "truth"), samples.wi, samples.wo, samples.weight)
        image = np.zeros((side * side, 3), np.float32)
        image[samples.index] = model * (1.0 + 0.01 * rng.normal(size=model.shape))
        channels = image.reshape(side, side, 3)
        write_exr(place / "reference.exr", {name: channels[..., c] for c, name in enumerate("RGB")})
    return truths


def scipy_seconds(folder: Path, runs: int = 3) -> float:
    """Seconds of one fit by the peer."""
    samples = load(read_scene(folder / "00000" / "scene.toml"))[0].samples()
    fit = Scipy(samples, inverse_sigma(samples.target, samples.target, None, "law")).fit
    taken = []
    for _ in range(runs):
        began = time.perf_counter()
        fit()
        taken.append(time.perf_counter() - began)
    return float(np.median(taken))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=85)
    parser.add_argument("--scenes", type=int, default=400)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--form", default="corrected", choices=["corrected", "precise"])
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    use_compilation_cache()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with jax.enable_x64(False):
            truths = make(folder, arguments.scenes, arguments.side, arguments.form)
        pixels = len(load(read_scene(folder / "00000" / "scene.toml"))[0].index)
        times: list[float] = []
        batch = fit_batch(
            sorted(folder.glob("*/scene.toml")),
            folder / "out",
            workers=arguments.workers,
            quick=arguments.quick,
            progress=lambda *told: times.append(time.perf_counter()),
        )
        seconds = scipy_seconds(folder)
    rows = batch.rows
    off = [
        abs(row[key] / truth[key] - 1.0) for row, truth in zip(rows, truths, strict=True) for key in ("coat.alpha", "coat.eta")
    ]
    ends = np.array(times)[1 + len(rows) // 10 :]
    per_second = (len(ends) - 1) / (ends[-1] - ends[0])
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    told = {
        "pixels": pixels,
        "fits_per_s": round(per_second, 1),
        "over_scipy": round(per_second * seconds, 1),
        "failed": sum(row["error"] is not None for row in rows),
        "worst_off": float(np.max(off)),
        "worker_mb": round(memory),
    }
    Console().print_json(json.dumps(told))


if __name__ == "__main__":
    main()
