"""The compilation cache: a model structure is traced and compiled once on a machine, not once a run."""

import contextlib
import os
import re
import warnings
from pathlib import Path
from typing import Any


def cache_directory() -> Path | None:
    """Where traced and compiled functions are kept: JAX_COMPILATION_CACHE_DIR, else the user's cache; None with LAYERFIT_NO_CACHE=1."""
    if os.environ.get("LAYERFIT_NO_CACHE") == "1":
        return None
    from platformdirs import user_cache_path

    return Path(os.environ.get("JAX_COMPILATION_CACHE_DIR") or user_cache_path("layerfit") / "jax")


def use_compilation_cache() -> Path | None:
    """Keep traced and compiled functions in the user's cache directory. JAX_COMPILATION_CACHE_DIR chooses another, LAYERFIT_NO_CACHE=1 none.

    Processes may share it. What was left half written in it, by a process that was killed or on a full disk, is thrown away and made again; a
    directory that cannot be written to costs time and nothing else.
    """
    directory = cache_directory()
    if directory is None:
        return None
    import jax

    from ._compiled import KEPT

    KEPT[:] = [directory / "traced"]
    jax.config.update("jax_compilation_cache_dir", str(directory))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    _mend(directory)
    return directory


_UNUSABLE = re.compile(r"Error (?:reading|writing) persistent compilation cache entry for '([\w.<>-]+)'")


def _mend(directory: Path) -> None:
    """Throw away the entries of a function whose entry JAX finds half written. JAX itself warns of it, compiles anew, and leaves it there: it would
    for ever."""
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *args: Any, **options: Any) -> None:
        if found := _UNUSABLE.match(str(message)):
            for entry in directory.glob(f"{found[1]}-*"):
                with contextlib.suppress(OSError):  # of a disk that is read alone: nothing is lost but time
                    entry.unlink()
        else:
            shown(message, category, *args, **options)

    if shown.__module__ != __name__:
        warnings.filterwarnings("always", _UNUSABLE.pattern, UserWarning)
        warnings.showwarning = show
