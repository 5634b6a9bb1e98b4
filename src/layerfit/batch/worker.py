"""What a process that shares the work of a batch begins with."""

import os

from ..cache import use_compilation_cache


def begin() -> None:
    """One thread for JAX, before it begins: the cores are shared among the workers, not by each of them. And what others have compiled."""
    os.environ.setdefault("NPROC", "1")  # XLA's own name for the threads that it may use
    use_compilation_cache()
