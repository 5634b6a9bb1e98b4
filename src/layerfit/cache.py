"""The compilation cache: a model structure is traced and compiled once on a machine, not once a run."""

import os
from pathlib import Path


def use_compilation_cache() -> Path | None:
    """Keep traced and compiled functions in the user's cache directory. JAX_COMPILATION_CACHE_DIR chooses another, LAYERFIT_NO_CACHE=1 none."""
    if os.environ.get("LAYERFIT_NO_CACHE") == "1":
        return None
    from platformdirs import user_cache_path

    directory = Path(os.environ.get("JAX_COMPILATION_CACHE_DIR") or user_cache_path("layerfit") / "jax")
    import jax

    from ._compiled import KEPT

    KEPT[:] = [directory / "traced"]
    jax.config.update("jax_compilation_cache_dir", str(directory))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    return directory
