"""A traced function as data, for a host that has no JAX, such as a web page.

A shader holds as constants what is computed once a material. Where a slider changes the material, they have to be computed anew; so
`Stack.prepare` is traced, like all else, and its equations are written here as steps of a few kinds: one for each function of numbers,
and for arrays `view` (another shape over the same numbers), `join`, `matmul`, `sum` and `loop`. `report/page/program.js` runs them.
There is no second definition of the model: what it has learnt is arithmetic. Only JAX is imported here.
"""

import base64
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.extend.core import Literal

from .glsl import PrintError
from .names import source_of
from .printer import scan_sizes

ELEMENTWISE = frozenset(
    """
    abs add and cos div eq exp expm1 floor ge gt le log log1p lt max min mul ne neg not or pow select_n sign sin sqrt sub tanh
    """.split()  # noqa: SIM905 (as in glsl.RESERVED)
)
"""Functions of numbers, by their names in JAX: applied element by element. Numbers are all of one kind; true is 1."""

SAID_OTHERWISE = {"lt_to": "lt", "le_to": "le"}
"""What JAX has further names for: these order NaN too, which a program does not meet."""

POWERS = {"integer_pow": "y", "power": "exponent"}
"""Powers with constant exponents, and the parameter that has them."""

UNCHANGED = ("convert_element_type", "copy", "expand_dims", "reshape", "squeeze")
"""What changes neither numbers nor their order."""


class Place(NamedTuple):
    """An array in the memory of a program: where it is, and its shape, which the host need not know."""

    index: int
    shape: tuple[int, ...]


def program(fn: Callable[..., Any], *args: Any) -> dict[str, Any]:
    """`fn(*args)` as a program whose inputs and outputs are the leaves of its arguments and results.

    `size` is that of its memory, `inputs` and `outputs` are places in it, `arrays` its constants as [place, length, number or base64 of
    little-endian float32], `steps` rows of [kind, place of the result, places of the operands, parameters].
    Raises `PrintError` for an operation that has no step, with the line of the Python source.
    """
    closed = jax.make_jaxpr(fn)(*args)
    return _Program().write(closed.jaxpr, closed.consts)


class _Program:
    """The steps of one function while they are written."""

    def __init__(self) -> None:
        self.size = 0
        self.steps: list[list[Any]] = []
        self.known: dict[int, np.ndarray] = {}

    def write(self, jaxpr: Any, consts: Sequence[Any]) -> dict[str, Any]:
        inputs = [self.place(v.aval.shape) for v in jaxpr.invars]
        outputs = [place.index for place in self.walk(jaxpr, consts, inputs)]
        steps = _needed(self.steps, outputs)
        used = {k for step in steps for k in step[2]} | set(outputs)
        arrays = [[k, value.size, _encoded(value)] for k, value in self.known.items() if k in used]
        return {"size": self.size, "inputs": [p.index for p in inputs], "outputs": outputs, "arrays": arrays, "steps": steps}

    def place(self, shape: Sequence[int]) -> Place:
        self.size += 1
        return Place(self.size - 1, tuple(shape))

    def constant(self, value: Any) -> Place:
        place = self.place(np.shape(value))
        self.known[place.index] = np.asarray(value)
        return place

    def value(self, place: Place) -> np.ndarray:
        return self.known[place.index].reshape(place.shape)

    def step(self, kind: str, shape: Sequence[int], operands: Sequence[Place], *parameters: Any) -> Place:
        result = self.place(shape)
        self.steps.append([kind, result.index, [p.index for p in operands], *parameters])
        return result

    def view(self, operand: Place, of: Callable[[np.ndarray], np.ndarray]) -> Place:
        """What numpy does to an array without a copy, by the strides that come of it."""
        if operand.index in self.known:
            return self.constant(of(self.value(operand)))
        base = np.empty(operand.shape, np.float32)
        seen = of(base)
        start = (seen.__array_interface__["data"][0] - base.__array_interface__["data"][0]) // 4
        strides = [stride // 4 for stride in seen.strides]
        if seen.size == base.size and start == 0 and seen.flags.c_contiguous:
            return Place(operand.index, seen.shape)
        return self.step("view", seen.shape, [operand], list(seen.shape), strides, start)

    def walk(self, jaxpr: Any, consts: Sequence[Any], inputs: Sequence[Place]) -> list[Place]:
        """Write the steps of a jaxpr; returns where its results are."""
        at = dict(zip(jaxpr.invars, inputs, strict=True))
        at.update((var, self.constant(value)) for var, value in zip(jaxpr.constvars, consts, strict=True))
        read = lambda v: self.constant(v.val) if isinstance(v, Literal) else at[v]  # noqa: E731
        for eqn in jaxpr.eqns:
            at.update(zip(eqn.outvars, self.equation(eqn, [read(v) for v in eqn.invars]), strict=True))
        return [read(v) for v in jaxpr.outvars]

    def equation(self, eqn: Any, operands: list[Place]) -> list[Place]:
        kind, p = eqn.primitive.name, eqn.params
        inner = p.get("call_jaxpr" if kind == "custom_jvp_call" else "jaxpr")
        if kind == "scan":
            return self.loop(eqn, operands)
        if inner is not None:
            return self.walk(inner.jaxpr, inner.consts, operands)
        if kind == "split":
            return [self.view(operands[0], cut) for cut in _cuts(p["axis"], p["sizes"])]
        if kind == "unstack":
            return [self.view(operands[0], row) for row in _rows(p["axis"], len(eqn.outvars))]
        shape = eqn.outvars[0].aval.shape
        # A constant that is spread over an array is a view of it: JAX would compile a function for each shape.
        if kind != "broadcast_in_dim" and all(place.index in self.known for place in operands):
            return [self.constant(eqn.primitive.bind(*(self.value(place) for place in operands), **p))]
        if kind in UNCHANGED:
            return [Place(operands[0].index, shape)]
        if kind in POWERS:
            return [self.step("pow", shape, [*operands, self.constant(np.full(shape, p[POWERS[kind]], float))])]
        kind = SAID_OTHERWISE.get(kind, kind)
        if kind == "div" and np.issubdtype(eqn.outvars[0].aval.dtype, np.integer):
            kind = "whole_div"
        if kind == "sort":
            return self.sort(eqn, operands)
        if kind in ELEMENTWISE or kind == "whole_div":
            # Literals, and what selects between whole arrays, may be single numbers.
            return [self.step(kind, shape, [self.view(place, lambda a: np.broadcast_to(a, shape)) for place in operands])]
        if kind not in _ARRAYS:
            raise PrintError(f"{source_of(eqn)}: a program has no step for the JAX primitive {kind!r}")
        return [_ARRAYS[kind](self, operands, shape, p)]

    def loop(self, eqn: Any, operands: list[Place]) -> list[Place]:
        """A scan: a program of its own, run once for each row of arrays, with what is carried from one run to the next."""
        p = eqn.params
        if p["reverse"]:
            raise PrintError(f"{source_of(eqn)}: only a forward scan is a loop")
        body = _Program().write(p["jaxpr"].jaxpr, p["jaxpr"].consts)
        places = [self.place(v.aval.shape) for v in eqn.outvars]
        results = [place.index for place in places]
        self.steps.append(["loop", results, [k.index for k in operands], body, p["length"], *scan_sizes(p)])
        return places

    def sort(self, eqn: Any, operands: list[Place]) -> list[Place]:
        """Rows of numbers in the order of the first."""
        if len(operands[0].shape) != 1 or eqn.params["num_keys"] != 1:
            raise PrintError(f"{source_of(eqn)}: only single rows are sorted, by one of them")
        places = [self.place(place.shape) for place in operands]
        self.steps.append(["sort", [place.index for place in places], [place.index for place in operands]])
        return places


def _needed(steps: Sequence[list[Any]], outputs: Sequence[int]) -> list[list[Any]]:
    """The steps whose results are read."""
    wanted, kept = set(outputs), []
    for step in reversed(steps):
        made = step[1] if isinstance(step[1], list) else [step[1]]
        if wanted.intersection(made):
            wanted.update(step[2])
            kept.append(step)
    return kept[::-1]


def _cuts(axis: int, sizes: Sequence[int]) -> Iterator[Callable[[np.ndarray], np.ndarray]]:
    start = 0
    for size in sizes:
        part = (*[slice(None)] * axis, slice(start, start + size))
        yield lambda a, part=part: a[part]
        start += size


def _rows(axis: int, count: int) -> Iterator[Callable[[np.ndarray], np.ndarray]]:
    for k in range(count):
        yield lambda a, at=(*[slice(None)] * axis, k): a[at]


def _broadcast(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    full = [1] * len(shape)
    for dimension, size in zip(p["broadcast_dimensions"], operands[0].shape, strict=True):
        full[dimension] = size
    return to.view(operands[0], lambda a: np.broadcast_to(a.reshape(full), shape))


def _sliced(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    steps = p["strides"] or (1,) * len(shape)
    part = tuple(slice(*row) for row in zip(p["start_indices"], p["limit_indices"], steps, strict=True))
    return to.view(operands[0], lambda a: a[part])


def _transposed(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    return to.view(operands[0], lambda a: a.transpose(p["permutation"]))


def _joined(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    """One after the other, in each of so many rows."""
    return to.step("join", shape, operands, int(np.prod(shape[: p.get("dimension", p.get("axis"))])))


def _product(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    """Products of matrices: (batch, rows, inner) with (batch, inner, columns)."""
    (inner_a, inner_b), (batch_a, batch_b) = p["dimension_numbers"]
    a, b = (place.shape for place in operands)
    rows = [k for k in range(len(a)) if k not in (*inner_a, *batch_a)]
    columns = [k for k in range(len(b)) if k not in (*inner_b, *batch_b)]
    left = to.view(operands[0], lambda x: x.transpose(*batch_a, *rows, *inner_a))
    right = to.view(operands[1], lambda x: x.transpose(*batch_b, *inner_b, *columns))
    sizes = [[a[k] for k in batch_a], [a[k] for k in rows], [a[k] for k in inner_a], [b[k] for k in columns]]
    return to.step("matmul", shape, [left, right], *(int(np.prod(size)) for size in sizes))


def _reduced(kind: str) -> "_Array":
    """Rows of what is reduced, each to one number."""

    def reduce(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
        size, axes = operands[0].shape, p["axes"]
        kept = [k for k in range(len(size)) if k not in axes]
        rows = to.view(operands[0], lambda a: a.transpose(*kept, *axes))
        return to.step(kind, shape, [rows], int(np.prod([size[k] for k in axes])))

    return reduce


def _gathered(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    """Slices of an array that start where rows of indices say; these are held inside of it."""
    numbers, sizes = p["dimension_numbers"], p["slice_sizes"]
    source, rows = operands[0].shape, operands[1].shape
    gone = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    strides = np.cumprod([1, *source[:0:-1]])[::-1]
    at = np.indices(shape).reshape(len(shape), -1)
    batch = [k for k in range(len(shape)) if k not in numbers.offset_dims]
    row = np.zeros(at.shape[1], int)
    for k, size in zip(batch, rows[:-1], strict=True):
        row = row * size + at[k]
    kept = [k for k in range(len(source)) if k not in gone]
    offset = sum((at[a] * strides[k] for a, k in zip(numbers.offset_dims, kept, strict=True)), np.zeros_like(row))
    for k, index in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
        offset = offset + at[batch[index]] * strides[k]
    starts = [[int(strides[k]), source[k] - sizes[k]] for k in numbers.start_index_map]
    return to.step("pick", shape, operands, row.tolist(), offset.tolist(), starts)


def _sliced_from(to: _Program, operands: list[Place], shape: tuple[int, ...], p: Mapping[str, Any]) -> Place:
    """One slice, which starts at indices that are operands each."""
    source = operands[0].shape
    strides = np.cumprod([1, *source[:0:-1]])[::-1]
    offset = np.tensordot(strides, np.indices(shape).reshape(len(shape), -1), 1)
    index = to.step("join", (len(source),), operands[1:], 1)
    starts = [[int(stride), size - part] for stride, size, part in zip(strides, source, shape, strict=True)]
    return to.step("pick", shape, [operands[0], index], [0] * offset.size, offset.tolist(), starts)


_Array = Callable[[_Program, list[Place], tuple[int, ...], Mapping[str, Any]], Place]
_ARRAYS: dict[str, _Array] = {
    "argmax": _reduced("place"),
    "broadcast_in_dim": _broadcast,
    "concatenate": _joined,
    "dot_general": _product,
    "dynamic_slice": _sliced_from,
    "gather": _gathered,
    "reduce_max": _reduced("largest"),
    "reduce_sum": _reduced("sum"),
    "slice": _sliced,
    "stack": _joined,
    "transpose": _transposed,
}


def _encoded(value: np.ndarray) -> float | str:
    """One number for an array that is the same everywhere, else the base64 of its float32."""
    flat = np.asarray(value, "<f4").ravel()
    if np.all(flat == flat[0]):
        return float(str(flat[0]))
    return base64.b64encode(flat.tobytes()).decode()
