"""Fits of a batch, one after the other or shared among processes."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import groupby, islice

from ..fit.many import GROUP
from .groups import Rows, run_all
from .rows import Row, failed
from .tasks import Task
from .worker import begin

PORTION = 2 * GROUP
"""Quick fits that a worker is given at a time: a second of its work is lost with it."""

TRIES = 2
"""Workers that one scene may take down before it is given up."""


def fitted(tasks: Mapping[str, Task], workers: int) -> Rows:
    """Rows as they are known."""
    if workers == 1:
        yield from run_all(tasks)
        return
    left, tries = dict(tasks), dict.fromkeys(tasks, 0)
    others = set(multiprocessing.active_children())
    while left:
        # Spawned: a process that has run JAX cannot be forked.
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_begin_worker) as pool:
            try:
                yield from _shared(pool, left, tries, workers)
            except BrokenProcessPool:
                # It ends its workers, but not one that was being started as another was killed, for which it would wait for ever.
                for worker in set(multiprocessing.active_children()) - others:
                    worker.terminate()


def run_portion(tasks: dict[str, Task]) -> list[tuple[str, Row]]:
    """What a worker does at a time."""
    return [row for rows in run_all(tasks) for row in rows]


def portions(tasks: Mapping[str, Task], workers: int) -> Iterator[dict[str, Task]]:
    """Tasks by as many as a worker is given at a time: quick ones by the group, others take long enough alone."""
    size = max(1, min(PORTION, -(-len(tasks) // (2 * workers))))
    for quick, some in groupby(tasks.items(), lambda item: item[1].quick and item[1].directory is None):
        while portion := dict(islice(some, size if quick else 1)):
            yield portion


def _shared(pool: Executor, left: dict[str, Task], tries: dict[str, int], workers: int) -> Rows:
    """Rows until all are known, or a worker is killed, which is raised again: what was in hand then was tried. What was tried before goes first,
    and alone, so that no scene is given up for what another does to its worker."""
    again = [{key: left[key]} for key in left if tries[key]]
    waiting = deque([*again, *portions({key: left[key] for key in left if not tries[key]}, workers)])
    running: dict[Future[list[tuple[str, Row]]], dict[str, Task]] = {}
    try:
        while waiting or running:
            alone = any(tries[key] for portion in (*running.values(), *list(waiting)[:1]) for key in portion)
            while waiting and len(running) < (1 if alone else workers + 1):  # none waits for the next to be handed over
                portion = waiting.popleft()
                running[pool.submit(run_portion, portion)] = portion
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                rows = future.result()
                del running[future]
                for key, _ in rows:
                    del left[key]
                yield rows
    except BrokenProcessPool:
        for key in (key for portion in running.values() for key in portion):
            tries[key] += 1
            if tries[key] == TRIES:
                why = "its worker was killed twice, as by a machine out of memory; try fewer --workers"
                yield [(key, failed(left.pop(key), why))]
        raise


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the process that shares out the work
    threading.Thread(target=_end_with_parent, daemon=True).start()
    begin()


def _end_with_parent() -> None:
    """A killed batch leaves no workers that wait for it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
