"""The compilation cache, when what stands in it cannot be used."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMPILED = """
import jax, jax.numpy as jnp
from layerfit._compiled import Compiled
from layerfit.cache import use_compilation_cache

use_compilation_cache()
twice = Compiled(lambda x: 2.0 * jnp.sin(x) / jnp.sin(x))
print(float(twice(jnp.float32(21.0))) + float(jax.jit(jnp.tanh)(0.0)))
"""


def run(directory: Path) -> None:
    """Use the cache in a process of its own."""
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(directory)}
    environment.pop("LAYERFIT_NO_CACHE", None)
    ran = subprocess.run([sys.executable, "-c", COMPILED], capture_output=True, text=True, check=False, env=environment)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "2.0\n", "")


def entries(directory: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def spoilt(content: bytes) -> dict[str, bytes]:
    middle = len(content) // 2
    return {
        "cut off": content[:middle],
        "empty": b"",
        "one bit turned": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
    }


def test_entries_that_are_spoilt_are_made_again(tmp_path):
    run(tmp_path)
    made = entries(tmp_path)
    assert any(path.parent.name == "traced" for path in made)
    assert any(path.name.startswith("jit_call") for path in made)
    for way in spoilt(bytes(10)):
        broken = {path: spoilt(content)[way] for path, content in made.items()}
        for path, content in broken.items():
            path.write_bytes(content)
        run(tmp_path)
        now = entries(tmp_path)
        assert now.keys() == made.keys()
        assert not [path for path, content in broken.items() if now[path] == content], "left as they were"


@pytest.mark.parametrize("where", ["/proc/nowhere", "/dev/full"])
def test_a_cache_that_cannot_be_written_costs_nothing_but_time(where):
    run(Path(where))
