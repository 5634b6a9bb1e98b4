"""Fits of a batch, one after the other or shared among processes."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
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
            yield from _shared(pool, left, tries, workers)


def _shared(pool: Executor, left: dict[str, Task], tries: dict[str, int], workers: int) -> Iterator[tuple[str, Row]]:
    """Rows until all are known, or a worker is killed: what was in hand then was tried. What was tried before goes first, and alone, so
    that no scene is given up for what another does to its worker."""
    waiting = deque(sorted(left, key=lambda key: -tries[key]))
    running: dict[Future[Row], str] = {}
    try:
        while waiting or running:
            alone = any(tries[key] for key in (*running.values(), *list(waiting)[:1]))
            while waiting and len(running) < (1 if alone else workers):
                key = waiting.popleft()
                running[pool.submit(run, left[key])] = key
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                row = future.result()
                key = running.pop(future)
                del left[key]
                yield key, row
    except BrokenProcessPool:
        for key in running.values():
            tries[key] += 1
            if tries[key] == TRIES:
                yield (
                    key,
                    failed(left.pop(key), "its worker was killed twice, as by a machine out of memory; try fewer --workers"),
                )


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the process that shares out the work
    threading.Thread(target=_end_with_parent, daemon=True).start()
    use_compilation_cache()


def _end_with_parent() -> None:
    """A killed batch leaves no workers that wait for it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
