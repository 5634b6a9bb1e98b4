"""How every command talks: what it prints where, `--json`, `--quiet` and `--verbose`, progress, and the command that it names next.

Data on standard output; tables, words and progress on standard error. Exit codes: 0 done and good; 1 done, with findings; 2 the input
or the machine is at fault, with a message that says what to do.
"""

import dataclasses
import io
import json
import os
import shlex
import sys
import time
from abc import ABC, abstractmethod
from typing import Any

from rich.console import Console

from ..errors import PIPE_CODE, InputError

STARTED = time.perf_counter()

COLOURS = None if os.environ.get("NO_COLOR") else "auto"
"""None: no styles at all, as <https://no-color.org> asks; where the output is not a terminal there are none anyway."""

stdout = Console(highlight=False, color_system=COLOURS)
stderr = Console(stderr=True, highlight=False, color_system=COLOURS)


@dataclasses.dataclass
class Manner:
    """How the command that runs was asked to talk."""

    json: bool = False
    quiet: bool = False
    verbose: bool = False


manner = Manner()


@dataclasses.dataclass(frozen=True)
class Done:
    """What a command came to."""

    document: Any = None
    """What `--json` prints; None where it was printed on the way."""
    then: tuple[Any, ...] = ()
    """Words after `layerfit` of the command that is likely to be wanted next."""
    good: bool = True


def finish(done: Done) -> int:
    """Print what is left to print; returns the exit code."""
    if manner.json and done.document is not None:
        _put(json.dumps(done.document, indent=2, allow_nan=False) + "\n")
    detail(f"Done after {time.perf_counter() - STARTED:.2f} s")
    if done.then:
        say(f"Next: layerfit {shlex.join(map(str, done.then))}")
    return 0 if done.good else 1


def tell(text: str) -> None:
    """A result, on standard output; with `--json` the document stands in its place."""
    if not manner.json:
        _put(text)


def tell_table(table: Any) -> None:
    """`tell` of what rich draws."""
    text = io.StringIO()
    Console(highlight=False, color_system=COLOURS, file=text, force_terminal=stdout.is_terminal, width=stdout.width).print(
        table
    )
    tell(text.getvalue())


def _put(text: str) -> None:
    """Data on standard output. Ends the program where nobody reads on; raises `InputError` where that is closed, or a file on a full disk."""
    if sys.stdout is None:  # closed, as by >&-
        raise InputError(
            "standard output is closed: there is nowhere to write the result to. Send it to a file, or to /dev/null."
        )
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left of it would be tried again at the exit
        if isinstance(error, BrokenPipeError):  # whoever reads has read enough, as `head` has
            raise SystemExit(PIPE_CODE) from None
        raise InputError(f"standard output: cannot be written: {error.strerror}. Send it to another place.") from None


def say(text: str) -> None:
    """A line on standard error, as it is: nothing in it is markup, and the terminal wraps it."""
    if not manner.quiet:
        stderr.print(text, markup=False, soft_wrap=True)


def show(table: Any) -> None:
    """A table on standard error."""
    if not manner.quiet:
        stderr.print(table)


def detail(text: str) -> None:
    """A line that `--verbose` alone has."""
    if manner.verbose:
        say(text)


class _Bar(ABC):
    """A bar on standard error while something runs; nothing where that is not a terminal, or is to be quiet."""

    def __enter__(self) -> Any:
        from rich.progress import Progress

        hidden = manner.quiet or manner.verbose or not stderr.is_terminal
        self.bar = Progress(*self.columns(), console=stderr, transient=True, disable=hidden)
        self.bar.start()
        self.began = time.perf_counter()
        self.stage = ""
        return self.update

    @abstractmethod
    def columns(self) -> tuple[Any, ...]:
        """What stands in it."""

    @abstractmethod
    def update(self, *told: Any) -> None:
        """Say how far the work is."""

    def at(self, stage: str) -> None:
        """With `--verbose`, a line where a stage begins."""
        if stage != self.stage:
            self.stage = stage
            detail(f"{time.perf_counter() - self.began:8.2f} s  {stage}")

    def __exit__(self, *exc: object) -> None:
        self.bar.stop()


class progress(_Bar):
    """How far one fit, or a measurement, is: it is told of the stage and of the share that is done."""

    def columns(self) -> tuple[Any, ...]:
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

        return TextColumn("{task.description:>8}"), BarColumn(), TimeElapsedColumn()

    def __enter__(self) -> Any:
        update = super().__enter__()
        self.task = self.bar.add_task("reading", total=1.0)
        return update

    def update(self, stage: str, share: float) -> None:
        self.at(stage)
        self.bar.update(self.task, description=stage, completed=share)


class many(_Bar):
    """How many fits are done and failed, how fast, and how long the rest takes."""

    def columns(self) -> tuple[Any, ...]:
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

        return (
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[failed]} failed, {task.fields[rate]}"),
            TimeRemainingColumn(),
        )

    def __enter__(self) -> Any:
        update = super().__enter__()
        self.task = self.bar.add_task("fits", total=None, failed=0, rate="")
        return update

    def update(self, done: int, failed: int, total: int) -> None:
        self.at(f"{done} of {total} done, {failed} failed")
        speed = self.bar.tasks[0].speed
        rate = f"{speed:.2f} fits/s" if speed else ""
        self.bar.update(self.task, completed=done + failed, total=total, failed=failed, rate=rate)
