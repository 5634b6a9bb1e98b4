"""Fits of a batch on a cluster of dask.distributed. The only file that imports it.

What goes to a worker is names of files, which it reads itself, and what comes back is rows. Of a worker that is lost the scheduler gives what
it had in hand to others. Portions are handed over as they are needed: the scheduler never knows of a million fits at once.
"""

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from . import sharing
from .groups import Rows
from .rows import Row, failed, message
from .tasks import Task
from .worker import begin

if TYPE_CHECKING:
    from distributed import Client, Future  # pyright: ignore[reportMissingImports]

AHEAD = 2
"""Portions for each thread of the cluster that are handed over before one is back: none waits for the next."""


def fitted(tasks: Mapping[str, Task], scheduler: str) -> Rows:
    """Rows as they are known. Raises `InputError` where there is no such scheduler."""
    running: dict[Future, dict[str, Task]] = {}
    with _client(scheduler) as client:
        from distributed import KilledWorker, as_completed  # pyright: ignore[reportMissingImports]

        waiting = sharing.portions(tasks, max(1, _threads(client)))
        ended = as_completed(loop=client.loop)

        def hand_over(some: Iterator[dict[str, Task]]) -> None:
            for portion in some:
                away = {key: _away(task) for key, task in portion.items()}
                future = client.submit(run_portion, away, pure=False)
                running[future] = portion
                ended.add(future)
                if len(running) >= AHEAD * max(1, _threads(client)):
                    return

        hand_over(waiting)
        for future in ended:
            portion, error = running.pop(future), future.exception()
            if error is None:
                yield future.result()
            elif isinstance(error, KilledWorker) and len(portion) > 1:  # by one of them: no other is given up for it
                for key, task in portion.items():
                    hand_over(iter([{key: task}]))
            else:
                why = _KILLED if isinstance(error, KilledWorker) else message(error)
                yield [(key, failed(task, why)) for key, task in portion.items()]
            if len(running) < AHEAD * max(1, _threads(client)):
                hand_over(waiting)


_KILLED = "its worker was killed again and again, as by a machine out of memory; give the workers of the cluster more of it"


def run_portion(tasks: dict[str, Task]) -> list[tuple[str, Row]]:
    """What a worker of the cluster does at a time."""
    _begin_once()
    return sharing.run_portion(tasks)


@functools.cache
def _begin_once() -> None:
    begin()


def _away(task: Task) -> Task:
    """The task for a process that stands elsewhere."""
    directory = None if task.directory is None else task.directory.resolve()
    return dataclasses.replace(task, scene=task.scene.resolve(), directory=directory)


def _client(scheduler: str) -> "Client":
    try:
        from distributed import Client  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            "a scheduler is one of dask.distributed, which is not installed: pip install 'layerfit[cluster]'"
        ) from None
    try:
        return Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--scheduler {scheduler}: no scheduler of dask answers there ({error}). `dask scheduler` prints the address of the one that it starts"
        ) from None


CONNECT_S = 10.0
"""Until a scheduler has answered."""


def _threads(client: Any) -> int:
    return sum(client.nthreads().values())
