"""Fits of a batch, one after the other or shared among processes."""

import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool

from ..cache import use_compilation_cache
from .rows import Row, failed, run
from .tasks import Task

TRIES = 2
"""Workers that one scene may take down before it is given up."""


def fitted(tasks: dict[str, Task], workers: int) -> Iterator[tuple[str, Row]]:
    """Rows as they are known."""
    if workers == 1:
        yield from ((key, run(task)) for key, task in tasks.items())
        return
    left, tries = dict(tasks), dict.fromkeys(tasks, 0)
    while left:
        # Spawned: a process that has run JAX cannot be forked.
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_begin_worker) as pool:
            futures: dict[Future[Row], str] = {pool.submit(run, task): key for key, task in left.items()}
            try:
                for future in as_completed(futures):
                    key = futures[future]
                    row = _row_of(future)
                    if row is None:
                        continue
                    del left[key]
                    yield key, row
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        for key in list(left):  # the pool broke: a worker was killed, and took along what had begun
            tries[key] += 1
            if tries[key] >= TRIES:
                task = left.pop(key)
                yield key, failed(task, "its worker was killed twice, as by a machine out of memory; try fewer --workers")


def _row_of(future: "Future[Row]") -> Row | None:
    try:
        return future.result()
    except BrokenProcessPool:
        return None


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the process that shares out the work
    use_compilation_cache()
