"""The program, the options that commands share, and how a command becomes one of it."""

import functools
import inspect
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.markup import escape
from typer.exceptions import TyperException

from ..errors import INTERRUPT_CODE, INTERRUPTED, InputError, LayerfitError
from . import complete
from .talk import Done, detail, finish, manner, say, stderr

KEPT = "\b\n"
"""Before a paragraph of help: its lines stay as they are, so that commands can be copied."""

EPILOG = f"""\
{KEPT}A first hour:
  layerfit doctor                    # is all there?
  layerfit demo                      # fits what ships
  layerfit inspect render.exr        # what a fit would use of a render
  layerfit fit scene.toml -o out     # fits it
  layerfit view out/preset.json      # the material live, with a slider for every parameter

Each command ends by naming the next one; `layerfit COMMAND --help` has examples of each.
"""

app = typer.Typer(
    name="layerfit",
    rich_markup_mode=None,  # no boxes: they leave a narrow terminal a few letters a line, and are read aloud
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
Starts = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Starts that are tried; more find a global minimum more surely. Left out, the scene's, else 8 (of a map, 4).",
    ),
]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of starts and pixel choices; left out, the scene's, else 0.")]
Metric = Annotated[
    str | None,
    typer.Option(
        help="law, uniform, relative, log or cube_root; left out, the scene's, else law.", autocompletion=complete.metrics
    ),
]
Loss = Annotated[
    str | None,
    typer.Option(help="square, huber or cauchy; left out, the scene's, else square.", autocompletion=complete.losses),
]

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

        more = {key: Annotated[bool, typer.Option(*flags, help=text)] for key, (flags, text) in _COMMON.items()}
        signature = inspect.signature(function)
        extra = [inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=more[key]) for key in more]
        run.__signature__ = signature.replace(parameters=[*signature.parameters.values(), *extra])  # pyright: ignore
        run.__annotations__ = {**function.__annotations__, **more}
        app.command(name, help=_help(function))(run)
        return function

    return register


def _help(function: Callable[..., Done]) -> str:
    """A docstring as help: plain text, its examples a line each."""
    text, _, examples = inspect.cleandoc(function.__doc__ or "").partition("\n\nExamples:\n")
    return f"{text.replace('`', '')}\n\n{KEPT}Examples:\n{textwrap.indent(textwrap.dedent(examples), '  ')}"


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
        if "" in sys.argv[1:]:  # as a path it would be the directory that one is in
            raise InputError(
                "an argument is empty: has a variable of the shell no value? Give it one, or leave the argument out."
            )
        code = app(prog_name="layerfit", standalone_mode=False)
        if code == INTERRUPT_CODE:  # what typer makes of an interrupt
            say(INTERRUPTED)
        sys.exit(code)
    except LayerfitError as error:
        _refuse(error)
    except TyperException as error:
        _refuse(_misused(error))
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


def _misused(error: TyperException) -> InputError:
    """What is wrong with the words of a command line, and where to look them up."""
    context: typer.Context | None = getattr(error, "ctx", None)
    name = "" if context is None or context.parent is None else f"{context.info_name} "
    option = getattr(error, "option_name", None)
    if context is not None and not name and any(option in flags for flags, _ in _COMMON.values()):
        return InputError(f"{option} is of a command: put it after, as in `layerfit presets {option}`.")
    text = f"{name.replace(' ', ': ')}{error.format_message()}"
    stop = "" if text.endswith((".", "?")) else "."
    return InputError(f"{text}{stop} `layerfit {name}--help` says what there is, with examples.")


def _show_version(asked: bool) -> None:
    if asked:
        from .. import __version__

        typer.echo(f"layerfit {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Fit layered materials to reference renders and get a verified shader back."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), err=True)
        raise typer.Exit(2)
