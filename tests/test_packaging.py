"""What is built and shipped: the same wheel from the same sources, to the bit; types of every public name."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("build")

ROOT = Path(__file__).parents[1]
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "src", "shaders", "examples")


def wheel(folder: Path, age: float) -> Path:
    """Build a copy of the sources, whose files were all written at another time."""
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder)
    for path in folder.rglob("*"):
        os.utime(path, (age, age))
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder / "dist", folder]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    (built,) = (folder / "dist").glob("*.whl")
    return built


def test_two_wheels_of_the_same_sources_are_the_same(tmp_path):
    built = []
    for name, age in (("one", 1.0e9), ("two", 1.6e9)):
        (tmp_path / name).mkdir()
        built.append(wheel(tmp_path / name, age))
    assert built[0].name == built[1].name
    names = zipfile.ZipFile(built[0]).namelist()
    assert {"layerfit/py.typed", "layerfit/__init__.pyi"} <= set(names)
    assert not [name for name in names if "__pycache__" in name or name.startswith("tests")]
    assert built[0].read_bytes() == built[1].read_bytes()
