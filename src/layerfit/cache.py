"""The compilation cache: a model structure is traced and compiled once on a machine, not once a run."""

import os
from pathlib import Path


def cache_directory() -> Path | None:
    """Where traced and compiled functions are kept: JAX_COMPILATION_CACHE_DIR, else the user's cache; None with LAYERFIT_NO_CACHE=1."""
    if os.environ.get("LAYERFIT_NO_CACHE") == "1":
        return None
    from platformdirs import user_cache_path

    return Path(os.environ.get("JAX_COMPILATION_CACHE_DIR") or user_cache_path("layerfit") / "jax")


def use_compilation_cache() -> Path | None:
    """Keep traced and compiled functions in the user's cache directory. JAX_COMPILATION_CACHE_DIR chooses another, LAYERFIT_NO_CACHE=1 none."""
    directory = cache_directory()
    if directory is None:
        return None
    import jax

    from ._compiled import KEPT

    KEPT[:] = [directory / "traced"]
    jax.config.update("jax_compilation_cache_dir", str(directory))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    return directory
