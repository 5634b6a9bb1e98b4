"""The program, the options that commands share, and how a command becomes one of it."""

import functools
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.markup import escape

from ..errors import INTERRUPT_CODE, INTERRUPTED, LayerfitError
from . import complete
from .talk import Done, detail, finish, manner, say, stderr

EPILOG = """\
A first hour: `layerfit doctor` says whether all is there, `layerfit demo` fits what ships. Then, of a render of your own:
`layerfit inspect render.exr`, `layerfit fit scene.toml -o out`, `layerfit view out/preset.json`. Each command ends by naming the next one.
"""

app = typer.Typer(
    name="layerfit",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=EPILOG,
)

Scene = Annotated[
    Path,
    typer.Argument(help="Scene file (TOML or JSON): reference, camera, lights, material, fit.", autocompletion=complete.files),
]
Preset = Annotated[
    Path, typer.Argument(help="Preset file (JSON), or the name of one that ships: a material.", autocompletion=complete.presets)
]
Output = Annotated[Path, typer.Option("--output", "-o", help="Directory for the results.")]
Starts = Annotated[int | None, typer.Option(min=1, help="Starts that are tried; more find a global minimum more surely.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of starts and pixel choices.")]
Metric = Annotated[str | None, typer.Option(help="law, uniform, relative, log or cube_root.", autocompletion=complete.metrics)]
Loss = Annotated[str | None, typer.Option(help="square, huber or cauchy.", autocompletion=complete.losses)]

Force = Annotated[
    bool, typer.Option("--force", help="Write the shader even where the driver draws it otherwise than JAX computes it.")
]

_COMMON = {
    "as_json": (("--json",), "Print the result as JSON on standard output."),
    "quiet": (("--quiet", "-q"), "Say nothing but the result and faults."),
    "verbose": (("--verbose", "-v"), "Say what is being done and for how long, and of a fault where it arose."),
}
"""What every command has."""


def command(name: str | None = None) -> Callable[[Callable[..., Done]], Callable[..., Done]]:
    """Make a function a command of the program: its parameters are its arguments, what it returns is printed as `--json` asks."""

    def register(function: Callable[..., Done]) -> Callable[..., Done]:
        @functools.wraps(function)
        def run(*, as_json: bool, quiet: bool, verbose: bool, **options: Any) -> None:
            manner.json, manner.quiet, manner.verbose = as_json, quiet, verbose
            _begin()
            raise typer.Exit(finish(function(**options)))

        more = {
            key: Annotated[bool, typer.Option(*flags, help=text, rich_help_panel="What is printed")]
            for key, (flags, text) in _COMMON.items()
        }
        signature = inspect.signature(function)
        extra = [inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=more[key]) for key in more]
        run.__signature__ = signature.replace(parameters=[*signature.parameters.values(), *extra])  # pyright: ignore
        run.__annotations__ = {**function.__annotations__, **more}
        app.command(name)(run)
        return function

    return register


def _begin() -> None:
    """With `--verbose`, what runs."""
    if manner.verbose:
        from ..cache import cache_directory
        from ..doctor import machine

        detail(f"{machine()}; compilation cache: {cache_directory() or 'none'}")


def main() -> None:
    """Run the command line; every fault of input or machine is one message and exit code 2."""
    manner.json = manner.quiet = manner.verbose = False
    try:
        app()
    except LayerfitError as error:
        _refuse(error)
    except SystemExit as end:
        if end.code == INTERRUPT_CODE:  # what typer makes of an interrupt
            say(INTERRUPTED)
        raise
    except Exception as error:
        from ..doctor import at_fault

        machine = at_fault(error)
        if machine is None:
            raise
        _refuse(machine)


def _refuse(error: LayerfitError) -> NoReturn:
    if manner.verbose:
        stderr.print_exception(width=stderr.width)
    stderr.print(f"[bold red]layerfit:[/] {escape(str(error))}", soft_wrap=True)
    sys.exit(2)


def check_choice(value: str | None, known: tuple[str, ...], option: str) -> None:
    if value is not None and value not in known:
        raise typer.BadParameter(f"{value!r} is not {', '.join(known[:-1])} or {known[-1]}", param_hint=option)


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
