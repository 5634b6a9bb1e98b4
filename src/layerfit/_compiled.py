"""Functions compiled ahead of their calls, with the seconds that went into it."""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import jax


@dataclasses.dataclass
class Clock:
    """Seconds that this process has spent tracing and compiling, apart from running."""

    trace_s: float = 0.0
    compile_s: float = 0.0

    def since(self, start: "Clock") -> "Clock":
        return Clock(self.trace_s - start.trace_s, self.compile_s - start.compile_s)


CLOCK = Clock()

OPTIONS: Any = {"xla_disable_hlo_passes": "call-inliner"}
"""Shading functions stay functions: inlined, they are fused to loops of a thousand operations, which LLVM no longer vectorises (two
to four times slower)."""


class Compiled:
    """A traced function with one executable for each structure and size of its arguments, made when it is first called."""

    def __init__(self, fn: Callable[..., Any], static: tuple[str, ...] = ()):
        self._jit = jax.jit(fn, static_argnames=static)
        self._executables: dict[Any, Any] = {}

    def __call__(self, *args: Any, **static: Any) -> Any:
        leaves, structure = jax.tree.flatten(args)
        key = (structure, tuple((a.shape, a.dtype) for a in leaves), tuple(static.values()))
        if key not in self._executables:
            start = time.perf_counter()
            lowered = self._jit.trace(*args, **static).lower()
            traced = time.perf_counter()
            self._executables[key] = lowered.compile(compiler_options=OPTIONS)
            CLOCK.trace_s += traced - start
            CLOCK.compile_s += time.perf_counter() - traced
        return self._executables[key](*args)
