"""Functions compiled ahead of their calls, side by side, with the seconds that went into it."""

import dataclasses
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import jax


@dataclasses.dataclass
class Clock:
    """Seconds that this process has spent tracing, and waiting for compilers, apart from running."""

    trace_s: float = 0.0
    compile_s: float = 0.0

    def since(self, start: "Clock") -> "Clock":
        return Clock(self.trace_s - start.trace_s, self.compile_s - start.compile_s)


CLOCK = Clock()

FUSION: Any = "xla_cpu_use_fusion_emitters" if jax.__version_info__ < (0, 11) else None
"""XLA's option for its newer emitters of fused loops, where it is one: later versions have no others, and a name that XLA does
not know is an error."""

OPTIONS: Any = {"xla_disable_hlo_passes": "call-inliner"} | ({FUSION: False} if FUSION else {})
"""Shading functions stay functions: inlined, they are fused to loops of a thousand operations, which LLVM no longer vectorises (two
to four times slower). The newer emitters take up to twice as long to compile these."""

_POOL = ThreadPoolExecutor(2, "compile")


class Compiled:
    """A traced function with one executable for each structure and size of its arguments, made when it is first called."""

    def __init__(self, fn: Callable[..., Any], static: tuple[str, ...] = (), optimise: int = 3):
        """`optimise`: 3 for what runs over pixels, 1 for what runs once a step, 0 for what runs once: it compiles sooner."""
        self._jit = jax.jit(fn, static_argnames=static)
        self._options = OPTIONS | {"xla_backend_optimization_level": optimise}
        self._executables: dict[Any, tuple[Future[Any], Any]] = {}

    def begin(self, *args: Any, **static: Any) -> Any:
        """Trace a call and have it compiled while other work goes on. Arguments and result are arrays or their shapes."""
        return self._entry(args, static)[1]

    def __call__(self, *args: Any, **static: Any) -> Any:
        executable = self._entry(args, static)[0]
        if not executable.done():
            start = time.perf_counter()
            executable.result()
            CLOCK.compile_s += time.perf_counter() - start
        return executable.result()(*args)

    def _entry(self, args: Any, static: dict[str, Any]) -> tuple[Future[Any], Any]:
        leaves, structure = jax.tree.flatten(args)
        key = (structure, tuple((a.shape, a.dtype) for a in leaves), tuple(static.values()))
        if key not in self._executables:
            start = time.perf_counter()
            traced = self._jit.trace(*args, **static)
            lowered = traced.lower()
            CLOCK.trace_s += time.perf_counter() - start
            self._executables[key] = _POOL.submit(lowered.compile, compiler_options=self._options), traced.out_info
        return self._executables[key]
