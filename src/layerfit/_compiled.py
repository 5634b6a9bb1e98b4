"""Functions compiled ahead of their calls, side by side, with the seconds that went into it."""

import contextlib
import dataclasses
import hashlib
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
from jax import export

from .documents import write_bytes
from .errors import InputError


@dataclasses.dataclass
class Clock:
    """Seconds that this process has spent tracing, and waiting for compilers, apart from running."""

    trace_s: float = 0.0
    compile_s: float = 0.0

    def since(self, start: "Clock") -> "Clock":
        return Clock(self.trace_s - start.trace_s, self.compile_s - start.compile_s)


CLOCK = Clock()


def fusion_emitters(newer: bool) -> dict[str, Any]:
    """XLA's option for its newer emitters of fused loops, where it is one: later versions have no others, and a name that XLA does
    not know is an error."""
    return {"xla_cpu_use_fusion_emitters": newer} if jax.__version_info__ < (0, 11) else {}


OPTIONS: Any = {"xla_backend_optimization_level": 3, "xla_disable_hlo_passes": "call-inliner"} | fusion_emitters(newer=False)
"""XLA's, where a function has none of its own. Shading functions stay functions: inlined, they are fused to loops of a thousand operations,
which LLVM no longer vectorises (two to four times slower). The newer emitters take up to twice as long to compile these."""

_POOL = ThreadPoolExecutor(2, "compile")
_CORES = ThreadPoolExecutor(os.cpu_count(), "compute")

KEPT: list[Path] = []
"""The folder where traced functions are kept from run to run; empty for none. Tracing them anew was half of a second run's time."""


@cache
def sources() -> bytes:
    """What a trace depends on beside its arguments: this package, and the ones that trace."""
    digest = hashlib.sha256(" ".join(version(name) for name in ("jax", "jaxlib", "equinox", "lineax", "optimistix")).encode())
    package = Path(__file__).parent
    for path in sorted(p for p in package.rglob("*") if p.suffix in (".py", ".npz")):
        digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return digest.digest()


def _spelled(structure: Any) -> Any:
    """A structure in full: classes of one name in two modules are two."""
    kind, aux = structure.node_data() or (None, None)
    return kind and (kind.__module__, kind.__qualname__, aux, [_spelled(child) for child in structure.children()])


def _kept(path: Path) -> export.Exported | None:
    """A traced function of an earlier run; None where there is none, or not a whole one."""
    stored = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(stored[32:]).digest() != stored[:32]:
        return None
    return export.deserialize(bytearray(stored[32:]))


def side_by_side(compute: Callable[[int], Any], parts: Iterable[int]) -> list[Any]:
    """What a function that calls executables gives for each part, computed on all cores: begun one after the other by one thread, each
    waits for the last. What it calls is compiled before, or every thread would wait for it."""
    return list(_CORES.map(compute, parts))


class Compiled:
    """A traced function with one executable for each structure and size of its arguments, made when it is first called."""

    def __init__(self, fn: Callable[..., Any], optimise: int | None = None, **options: Any):
        """Keyword arguments of `fn` are structure, not numbers.

        `optimise`: 1 for what runs once a step, 0 for what runs once, as it compiles sooner; what runs over pixels has the level of `OPTIONS`.
        `options` are XLA's, beside these.
        """
        self._fn = fn
        self._options = ({} if optimise is None else {"xla_backend_optimization_level": optimise}) | options
        self._executables: dict[Any, tuple[Future[Any], Any]] = {}

    def begin(self, *args: Any, **static: Any) -> Any:
        """Trace a call and have it compiled while other work goes on. Arguments and result are arrays or their shapes."""
        return self._entry(*jax.tree.flatten(args), static)[1]

    def __call__(self, *args: Any, **static: Any) -> Any:
        leaves, structure = jax.tree.flatten(args)
        return self._ready(leaves, structure, static)(*leaves)

    def ready(self, *args: Any, **static: Any) -> Any:
        """The executable of a call, when it is compiled: a function of the leaves of the arguments."""
        return self._ready(*jax.tree.flatten(args), static)

    def _ready(self, leaves: list[Any], structure: Any, static: dict[str, Any]) -> Any:
        executable = self._entry(leaves, structure, static)[0]
        if not executable.done():
            start = time.perf_counter()
            executable.result()
            CLOCK.compile_s += time.perf_counter() - start
        return executable.result()

    def _entry(self, leaves: list[Any], structure: Any, static: dict[str, Any]) -> tuple[Future[Any], Any]:
        key = (structure, tuple([(a.shape, a.dtype) for a in leaves]), tuple(static.values()))
        entry = self._executables.get(key)
        # What failed to compile, as for want of memory, is tried again.
        if entry is None or (entry[0].done() and entry[0].exception()):
            start = time.perf_counter()
            traced = self._traced(leaves, structure, static).trace(*leaves)
            lowered = traced.lower()
            CLOCK.trace_s += time.perf_counter() - start
            entry = _POOL.submit(lowered.compile, compiler_options=OPTIONS | self._options), traced.out_info
            self._executables[key] = entry
        return entry

    def _traced(self, leaves: list[Any], structure: Any, static: dict[str, Any]) -> Any:
        """The function of the leaves of its arguments: as it was kept by an earlier run, or traced and kept."""

        def of_leaves(*leaves: Any) -> Any:
            return self._fn(*jax.tree.unflatten(structure, leaves), **static)

        of_leaves.__name__ = self._fn.__name__
        if not KEPT:
            return jax.jit(of_leaves)
        shapes = [(a.shape, str(a.dtype)) for a in leaves]
        machine = jax.dtypes.canonicalize_dtype(float).name, jax.default_backend()
        what = repr((self._fn.__qualname__, _spelled(structure), shapes, static, machine))
        path = KEPT[0] / hashlib.sha256(sources() + what.encode()).hexdigest()
        exported = _kept(path)
        if exported is None:
            exported = export.export(jax.jit(of_leaves))(*leaves)
            stored = bytes(exported.serialize())
            with contextlib.suppress(InputError):  # a cache that cannot be written to costs time, no fit
                write_bytes(path, hashlib.sha256(stored).digest() + stored)
        return jax.jit(exported.call)
