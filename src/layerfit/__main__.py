"""The program: `layerfit`, or `python -m layerfit`."""

import gc
import os

from .cli import main

XLA_FLAGS = "--xla_backend_extra_options=xla_cpu_disable_loop_unrolling"
"""What compiles takes a fifth less time without unrolled loops, and runs no slower."""


def run() -> None:
    """Run the command line in a process of its own."""
    os.environ.setdefault("XLA_FLAGS", XLA_FLAGS)
    # Tracing makes many small objects that live on. Looking for garbage among them took a seventh of a fit's time.
    gc.set_threshold(100_000, 20, 100)
    try:
        main()
    finally:
        # Nor are they taken apart one by one when the process ends: that took half a second.
        gc.freeze()


if __name__ == "__main__":
    run()
