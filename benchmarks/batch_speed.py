"""How many fits a second `layerfit batch` makes: of scenes of one structure, six parameters each, from files to a table.

    python benchmarks/batch_speed.py [--side 85] [--scenes 1000] [--workers 2] [--form corrected] [--quick] [--cluster]

Each scene is a sphere of another coat over copper, with 1 % of noise, as an EXR of `side` x `side` pixels; --side 85 has 4 thousand usable pixels,
--side 170 has 16 thousand. Fits a second are counted from the tenth part of the rows to the last, so without imports and compilers; beside
them stand the memory of the largest process and how far off the parameters are. With --cluster the workers are those of a local cluster of dask.
Of quick fits it also tells what a process is busy with, in milliseconds of its own time for each: keys, which this process makes; reading, from a
file to arrays; fits, from arrays to values; rows. SciPy's fit of the same six parameters (trf, 2-point, the same
model in NumPy; see fit_speed.py), alone and from pixels in memory, is the peer.
"""

import argparse
import contextlib
import json
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
from fit_speed import Scipy
from renders import lacquer_scene
from rich.console import Console

from layerfit import fit_batch, load, predict, read_scene, use_compilation_cache
from layerfit.batch.groups import Member
from layerfit.batch.tasks import tasks_of
from layerfit.capture.exr import write_exr
from layerfit.fit import many
from layerfit.fit.many import GROUP
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


@contextlib.contextmanager
def cluster(workers: int) -> Iterator[str]:
    """The address of the scheduler of a local cluster."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as found:
        yield found.scheduler_address


def busy_with(scenes: list[Path], runs: int = 5) -> dict[str, float]:
    """Milliseconds of the processor that each part of a fit takes, the least of some runs."""
    tasks = tasks_of(scenes, Path(), False, {"quick": True})
    taken: dict[str, list[float]] = {"key_ms": [], "read_ms": [], "fit_ms": [], "row_ms": []}

    def timed(name: str, of: Callable[[], Any]) -> Any:
        began = time.process_time()
        found = of()
        taken[name].append(1e3 * (time.process_time() - began) / len(tasks))
        return found

    for _ in range(runs):
        timed("key_ms", lambda: [task.key() for task in tasks])
        members = timed("read_ms", lambda: [Member(str(task.scene), task) for task in tasks])
        found = timed("fit_ms", lambda: many.begin([member.candidate for member in members])())  # noqa: B023
        timed("row_ms", lambda: [member.row(one, 0.0) for member, one in zip(members, found, strict=True)])  # noqa: B023
    return {name: round(min(times), 2) for name, times in taken.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=85)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--form", default="corrected", choices=["corrected", "precise"])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--cluster", action="store_true")
    arguments = parser.parse_args()
    use_compilation_cache()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with jax.enable_x64(False):
            truths = make(folder, arguments.scenes, arguments.side, arguments.form)
        pixels = len(load(read_scene(folder / "00000" / "scene.toml"))[0].index)
        times: list[tuple[int, float]] = []
        scenes = sorted(folder.glob("*/scene.toml"))
        with cluster(arguments.workers) if arguments.cluster else contextlib.nullcontext() as scheduler:
            batch = fit_batch(
                scenes,
                folder / "out",
                workers=arguments.workers,
                scheduler=scheduler,
                quick=arguments.quick,
                progress=lambda done, failed, total: times.append((done + failed, time.perf_counter())),
            )
        rows = list(batch.rows)
        busy = busy_with(scenes[:GROUP]) if arguments.quick else {}
        seconds = scipy_seconds(folder)
    off = [
        abs(row[key] / truth[key] - 1.0) for row, truth in zip(rows, truths, strict=True) for key in ("coat.alpha", "coat.eta")
    ]
    (first, began), (last, ended) = next(at for at in times if at[0] >= len(rows) / 10), times[-1]
    per_second = (last - first) / (ended - began)
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    told = {
        "pixels": pixels,
        "fits_per_s": round(per_second, 1),
        "over_scipy": round(per_second * seconds, 1),
        "failed": sum(row["error"] is not None for row in rows),
        "worst_off": float(np.max(off)),
        "worker_mb": round(memory),
        **busy,
    }
    Console().print_json(json.dumps(told))


if __name__ == "__main__":
    main()
