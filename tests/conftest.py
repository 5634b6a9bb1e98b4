"""What every test shares: double precision, shape checks, the GL context, and the folders of data outside the repository."""

import ctypes
import gc
import importlib.util
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import jax
import jaxtyping
import pytest
from jax.extend import source_info_util

from layerfit.__main__ import XLA_FLAGS
from layerfit._compiled import OPTIONS, fusion_emitters

if TYPE_CHECKING:
    import moderngl

# Tests compile much and compute little: all is compiled quickly rather than well, but for what is marked `optimised`.
# In one piece: what is cut up for threads takes a fifth more of the processor, and the tests have a process on each core.
_FLAGS = ["--xla_backend_optimization_level=0", "--xla_disable_hlo_passes=call-inliner", XLA_FLAGS]
_FLAGS += ["--xla_cpu_parallel_codegen_split_count=1"]
_FLAGS += [f"--{name}=false" for name in fusion_emitters(newer=False)]
os.environ.setdefault("XLA_FLAGS", " ".join(_FLAGS))
_LEVEL = "xla_backend_optimization_level"
_OPTIMISED = OPTIONS[_LEVEL]

# What is compiled for one test is read by all others of the run: those of another worker, and programs that tests start. The folder is made by
# the process that starts the workers, and is theirs too.
_COMPILED = None
if "PYTEST_XDIST_WORKER" not in os.environ:
    _COMPILED = os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp(prefix="layerfit-tests-")
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.1"  # what compiles sooner is not worth its file
jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
jax.config.update("jax_persistent_cache_min_compile_time_secs", float(os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"]))

REPOSITORY = Path(__file__).parents[1]

# Rounding is then out of the way of what is tested, and code that is meant for float32 has to say so.
jax.config.update("jax_enable_x64", True)

# The shapes in signatures are checked while the tests run. Without beartype, the package is tested as its users have it.
if importlib.util.find_spec("beartype"):
    jaxtyping.install_import_hook(["layerfit.optics"], "beartype.beartype")
    # The checks wrap every function; without this the printer would take their lines for the user's and name values after them.
    source_info_util.register_exclusion(os.path.dirname(jaxtyping.__file__))


# Traces make objects by the million, few of them rubbish.
gc.set_threshold(50_000, 20, 20)

WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
MOST_MEMORY = min(6.5e9, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / (WORKERS + 1))
"""Bytes in memory above which what JAX keeps compiled is thrown away, which takes seconds, and to make it again some more. At 6.3e9 a process
has 50,000 of the 65,530 mappings that Linux gives it by default."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> None:
    """What computes much, as some fits and the walk do, is compiled as its users have it or at the level that its mark names, for the
    fixtures too. All that runs in a program of its own is as its users have it."""
    mark = item.get_closest_marker("optimised")
    OPTIONS[_LEVEL] = next(iter(mark.args), _OPTIMISED) if mark else 0


@pytest.fixture(autouse=True)
def _memory() -> Iterator[None]:
    yield
    table = Path("/proc/self/statm")
    if table.exists() and int(table.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") > MOST_MEMORY:
        jax.clear_caches()
        gc.collect()
        # glibc keeps what was freed; without this the process would stay above, and throw all away after each test.
        if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
            trim(0)


def pytest_unconfigure() -> None:
    if _COMPILED:
        shutil.rmtree(_COMPILED, ignore_errors=True)  # a program that is still ending may write to it


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="rewrite the printed shaders in tests/golden")


def pytest_report_header() -> str:
    spec = importlib.util.find_spec("layerfit")
    return f"layerfit: {spec.origin if spec else 'not installed'}, JAX {jax.__version__}"


@pytest.fixture(scope="session")
def gl() -> "Iterator[moderngl.Context]":
    """The OpenGL context that shaders are rendered in. A test that needs it fails where there is no driver."""
    from layerfit.errors import MachineError
    from layerfit.shader.gl import context

    try:
        ctx = context()
    except MachineError as error:
        pytest.fail(str(error), pytrace=False)
    yield ctx
    assert ctx.error == "GL_NO_ERROR"


@pytest.fixture(scope="session")
def references() -> Path:
    """Renders of known materials by other renderers."""
    return _folder("references")


@pytest.fixture(scope="session")
def oracle() -> Path:
    """Values of the formulas in many digits, and of an independent random walk."""
    return _folder("oracle")


@pytest.fixture(scope="session")
def measured() -> Path:
    """Measured and published reflectances."""
    return _folder("measured")


def _folder(name: str) -> Path:
    variable = f"LAYERFIT_{name.upper()}"
    folder = Path(os.environ.get(variable) or REPOSITORY.parent / "shared" / name)
    if not folder.is_dir():
        pytest.skip(f"no folder {folder}: set {variable} to where the {name} data are")
    return folder
