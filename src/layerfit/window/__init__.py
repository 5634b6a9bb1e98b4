"""A preset to look at and tune in a window of its own: the picture of the pages, drawn by the machine's OpenGL."""

from pathlib import Path

from ..stack import Stack
from .screen import Screen


def show(stack: Stack, name: str, saves: Path = Path()) -> list[Path]:
    """Open a window with a material and a slider for every number of it, until it is closed. Returns the tuned presets that were saved in
    the folder `saves`.

    Raises `MachineError` without the extra `window`, or where no window can be opened.
    """
    screen = Screen(stack, name, saves)
    screen.run()
    return screen.saved
