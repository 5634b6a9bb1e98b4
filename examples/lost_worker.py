"""A batch on a cluster of two workers on this machine. One is killed midway, and in the end every fit is done.

    python examples/lost_worker.py [SCENES] [OUT]

Needs dask.distributed: pip install "layerfit[cluster]". On a real cluster only the address differs: `layerfit batch ... --scheduler tcp://HOST:8786`.
"""

import os
import signal
import sys
import tempfile
from pathlib import Path

from distributed import LocalCluster

import layerfit as lf

REFERENCES = Path(__file__).parent / "references"


def write_scenes(folder: Path, count: int) -> None:
    """One render, fitted over and over with other choices of pixels."""
    text = (REFERENCES / "brushed_steel.toml").read_text()
    text = text.replace('"brushed_steel.exr"', f'"{REFERENCES.resolve() / "brushed_steel.exr"}"')
    for seed in range(count):
        (folder / f"{seed:04d}.toml").write_text(text.replace("[fit]\n", f"[fit]\nseed = {seed}\n"))


def kill_a_busy_worker(cluster: LocalCluster) -> bool:
    """Kill a worker that has fits in hand, as a machine out of memory does; False where none has."""
    busy = {address for address, worker in cluster.scheduler.workers.items() if worker.processing}
    for nanny in cluster.workers.values():
        if nanny.worker_address in busy:
            os.kill(nanny.pid, signal.SIGKILL)
            print(f"killed worker {nanny.pid}")
            return True
    return False


def main(count: int, out: Path) -> int:
    killed = False
    with (
        tempfile.TemporaryDirectory() as folder,
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
    ):
        write_scenes(Path(folder), count)

        def progress(done: int, failed: int, total: int) -> None:
            nonlocal killed
            print(f"{done} of {total} done, {failed} failed", flush=True)
            killed = killed or (done > 0 and kill_a_busy_worker(cluster))

        batch = lf.fit_batch([folder], out, scheduler=cluster.scheduler_address, quick=True, progress=progress)
    print(f"{batch.document['done']} of {count} done, {batch.document['failed']} failed: {batch.document['table']}")
    return 0 if killed and batch.good and len(batch.rows) == count else 1


if __name__ == "__main__":  # workers are spawned: they read this file too
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200, Path(sys.argv[2] if len(sys.argv) > 2 else "out/cluster")))
