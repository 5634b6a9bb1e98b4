"""What all commands share: the program, its options, and how it talks.

Data on standard output, tables and progress on standard error. Exit codes: 0 done and good; 1 done, with findings; 2 the input or
the machine is at fault, with a message that says what to do.
"""

import gc
import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from ..errors import LayerfitError

STARTED = time.perf_counter()

app = typer.Typer(
    name="layerfit",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
stderr = Console(stderr=True, highlight=False)

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Scene = Annotated[Path, typer.Argument(help="Scene file (TOML or JSON): reference, camera, lights, material, fit.")]
Preset = Annotated[Path, typer.Argument(help="Preset file (JSON): a material.")]
Output = Annotated[Path, typer.Option("--output", "-o", help="Directory for the results.")]
Starts = Annotated[int | None, typer.Option(min=1, help="Starts that are tried; more find a global minimum more surely.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of starts and pixel choices.")]
Metric = Annotated[str | None, typer.Option(help="law, uniform, relative, log or cube_root.")]
Loss = Annotated[str | None, typer.Option(help="square, huber or cauchy.")]


def main() -> None:
    """Run the command line; every fault of input or machine is one message and exit code 2."""
    # A trace makes objects by the million, few of them rubbish: looking for it was a tenth of its time.
    gc.set_threshold(50_000, 20, 20)
    try:
        app()
    except LayerfitError as error:
        stderr.print(f"[bold red]layerfit:[/] {_plain(error)}", soft_wrap=True)
        sys.exit(2)
    except SystemExit as end:
        if end.code == 130:  # what typer makes of an interrupt
            say("layerfit: interrupted; every file that was written is whole")
        raise


def _plain(error: Exception) -> str:
    from rich.markup import escape

    return escape(str(error))


def say(text: str) -> None:
    """A line on standard error, as it is: nothing in it is markup, and the terminal wraps it."""
    stderr.print(text, markup=False, soft_wrap=True)


def emit(document: Any) -> None:
    json.dump(document, sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


def check_choice(value: str | None, known: tuple[str, ...], option: str) -> None:
    if value is not None and value not in known:
        raise typer.BadParameter(f"{value!r} is not {', '.join(known[:-1])} or {known[-1]}", param_hint=option)


class progress:
    """A bar on standard error while a fit runs; nothing where that is not a terminal."""

    def __enter__(self) -> Any:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self.bar = Progress(
            TextColumn("{task.description:>8}"),
            BarColumn(),
            TimeElapsedColumn(),
            console=stderr,
            transient=True,
            disable=not stderr.is_terminal,
        )
        self.bar.start()
        self.task = self.bar.add_task("reading", total=1.0)
        return lambda stage, share: self.bar.update(self.task, description=stage, completed=share)

    def __exit__(self, *exc: object) -> None:
        self.bar.stop()


class many:
    """A bar on standard error for many fits: how many are done and failed, how fast, and how long the rest takes."""

    def __enter__(self) -> Any:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        text = TextColumn("{task.fields[failed]} failed, {task.fields[rate]}")
        self.bar = Progress(
            BarColumn(),
            MofNCompleteColumn(),
            text,
            TimeRemainingColumn(),
            console=stderr,
            transient=True,
            disable=not stderr.is_terminal,
        )
        self.bar.start()
        self.task = self.bar.add_task("fits", total=None, failed=0, rate="")
        return self.update

    def update(self, done: int, failed: int, total: int) -> None:
        speed = self.bar.tasks[0].speed
        rate = f"{speed:.2f} fits/s" if speed else ""
        self.bar.update(self.task, completed=done + failed, total=total, failed=failed, rate=rate)

    def __exit__(self, *exc: object) -> None:
        self.bar.stop()


def _show_version(asked: bool) -> None:
    if asked:
        from .. import __version__

        typer.echo(f"layerfit {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Fit layered materials to reference renders and get a verified shader back."""
