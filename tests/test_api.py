"""The names that users import: what the stub says, what the loader gives, and what they say of themselves."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import layerfit

STUB = Path(layerfit.__file__).with_suffix(".pyi")

ARRAYS = re.compile(r"Float\[|ndarray")
SHAPE = re.compile(r"\((n|H), ")


def stub_names() -> dict[str, str]:
    """Public names of the stub, with the module that each comes from."""
    names = {}
    for node in ast.parse(STUB.read_text()).body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                assert alias.name == alias.asname, f"{alias.name}: a stub re-exports by `{alias.name} as {alias.name}`"
                names[alias.name] = f"layerfit.{node.module}"
    return names


NAMES = stub_names()


def python(code: str) -> str:
    """What a fresh interpreter prints."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.wheel
def test_stub_and_loader_agree():
    assert sorted(NAMES) == sorted(layerfit.__all__) == sorted(dir(layerfit))
    assert isinstance(layerfit.__version__, str)


@pytest.mark.wheel
@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_name_is_what_its_module_defines(name):
    assert getattr(layerfit, name) is getattr(importlib.import_module(NAMES[name]), name)


@pytest.mark.wheel
def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="stacks"):
        _ = layerfit.stacks  # pyright: ignore


@pytest.mark.wheel
def test_importing_the_package_imports_nothing_heavy():
    heavy = "{'jax', 'numpy', 'optimistix', 'moderngl', 'OpenEXR', 'skimage', 'typer'}"
    assert python(f"import sys, layerfit; print(sorted({heavy} & sys.modules.keys()))") == "[]"


@pytest.mark.wheel
@pytest.mark.parametrize("first", ["import layerfit.job", "from layerfit.fit import solve"])
def test_fit_is_the_function_whatever_was_imported_before(first):
    """It shares its name with the folder that it lives in."""
    assert python(f"{first}\nimport layerfit\nprint(type(layerfit.fit).__name__)") == "function"


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_name_explains_itself(name):
    doc = inspect.getdoc(getattr(layerfit, name))
    assert doc
    assert not doc.startswith(f"{name}("), "a dataclass without a docstring of its own"
    assert doc[0].isupper()


@pytest.mark.parametrize("name", [n for n in sorted(NAMES) if inspect.isfunction(getattr(layerfit, n))])
def test_a_function_of_arrays_states_their_shapes(name):
    function = getattr(layerfit, name)
    doc = inspect.getdoc(function) or ""
    taken = [
        k for k, p in inspect.signature(function).parameters.items() if ARRAYS.search(inspect.formatannotation(p.annotation))
    ]
    if taken:
        assert SHAPE.search(doc), f"{name} takes {', '.join(taken)}"


def test_units_of_reflectance_and_layers_are_stated():
    assert "1/sr" in (inspect.getdoc(layerfit.brdf) or "")
    assert "1/sr" in (inspect.getdoc(layerfit) or "")


def test_the_package_tells_of_every_name():
    told = set(re.findall(r"\w+", inspect.getdoc(layerfit) or ""))
    assert not NAMES.keys() - told


def test_a_brdf_of_plain_numbers():
    """A stack as a user writes it, and directions as whole numbers."""
    stack = layerfit.Stack((layerfit.Coat(tau=0.2),), layerfit.Lambert(albedo=0.5))
    up = np.array([[0, 0, 1]])
    value = np.asarray(layerfit.brdf(stack, up, up))
    np.testing.assert_allclose(value, layerfit.brdf(stack, up.astype(float), up.astype(float)), rtol=1e-5)
    assert np.all(value > 0.0)
