"""The numbered examples run, as they stand, and leave the picture that they promise."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(gl, path, tmp_path):
    out = tmp_path / "out.png"
    ran = subprocess.run([sys.executable, str(path), str(out)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert np.asarray(Image.open(out)).std() > 10.0  # a picture, not one colour
