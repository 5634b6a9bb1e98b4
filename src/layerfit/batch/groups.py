"""Fits of a batch, many in one process: those of one kind in groups, all others one by one."""

import time
from collections.abc import Callable, Iterator, Mapping

from ..fit import many
from ..fit.result import Fitted
from ..job import request_of
from .rows import Opened, Row, done, failed, message, opened, run, values_of
from .tasks import Task

KINDS = 8
"""Kinds of fits that wait at the same time for more of theirs, at most: they wait with all their pixels."""

Rows = Iterator[list[tuple[str, Row]]]
"""Of fits by their keys, as they are known: those of a group together."""


class Member:
    """A scene that goes in a group, or alone where it is of no group's kind."""

    def __init__(self, key: str, task: Task):
        began = time.perf_counter()
        self.key, self.task = key, task
        self.found: Opened | None = None
        self.candidate: many.Candidate | None = None
        self.error: str | None = None
        try:
            if task.quick and task.directory is None:
                self.found = opened(task)
                self.candidate = many.candidate(self.found.views, **request_of(self.found.scene))
        except Exception as error:
            self.error = message(error)
        self.seconds = time.perf_counter() - began

    def alone(self) -> Row:
        return run(self.task, self.found) if self.error is None else failed(self.task, self.error)

    def row(self, fitted: Fitted | None, seconds: float) -> Row:
        """Its row by what its group found, and alone where that is nothing."""
        return self.alone() if fitted is None else done(self.task, values_of(fitted), self.seconds + seconds)


def run_all(tasks: Mapping[str, Task]) -> Rows:
    """Fit scenes; a row with a message where one failed. While a group is fitted, the next one is read."""
    waiting: dict[object, list[Member]] = {}
    rows = _none
    for key, task in tasks.items():
        member = Member(key, task)
        if member.candidate is None:
            yield [(key, member.alone())]
            continue
        group = waiting.setdefault(member.candidate.kind, [])
        group.append(member)
        if len(group) == many.GROUP or len(waiting) > KINDS:
            largest = max(waiting, key=lambda kind: len(waiting[kind]))
            before, rows = rows, _begun(waiting.pop(largest))
            yield from before()
    for group in waiting.values():
        before, rows = rows, _begun(group)
        yield from before()
    yield from rows()


def _none() -> Rows:
    yield from ()


def _begun(group: list[Member]) -> Callable[[], Rows]:
    """Have a group fitted; its rows, when they are asked for."""
    began = time.perf_counter()
    ended = many.begin([member.candidate for member in group if member.candidate])

    def rows() -> Rows:
        found = ended()
        share = (time.perf_counter() - began) / len(group)
        yield [(member.key, member.row(fitted, share)) for member, fitted in zip(group, found, strict=True)]

    return rows
