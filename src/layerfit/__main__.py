"""The program: `layerfit`, or `python -m layerfit`."""

import gc
import os
import signal
import sys
from typing import Any

from .errors import INTERRUPT_CODE, INTERRUPTED

XLA_FLAGS = "--xla_backend_extra_options=xla_cpu_disable_loop_unrolling"
"""What compiles takes a fifth less time without unrolled loops, and runs no slower."""


def run() -> None:
    """Run the command line in a process of its own."""
    signal.signal(signal.SIGINT, _interrupted)
    os.environ.setdefault("XLA_FLAGS", XLA_FLAGS)
    from .cli import main

    # Tracing makes many small objects that live on. Looking for garbage among them took a seventh of a fit's time.
    gc.set_threshold(100_000, 20, 100)
    try:
        main()
    finally:
        # Nor are they taken apart one by one when the process ends: that took half a second.
        gc.freeze()


def _interrupted(*_: Any) -> None:
    """End at once, as all files are whole at any time. An exception would wait for the compiler's threads, and be lost in a library's callback."""
    cursor = "\x1b[?25h" if sys.stderr.isatty() else ""  # a progress bar hides it
    os.write(2, f"{cursor}{INTERRUPTED}\n".encode())
    os._exit(INTERRUPT_CODE)


if __name__ == "__main__":
    run()
