"""A traced function in as many digits as are asked for: its jaxpr, evaluated with the numbers of mpmath.

What is traced is the program itself, in float64, with all its branches; only rounding is taken away. So a difference to it is rounding, and
a derivative that differs from its differences is wrong. Whether the formulas are the right ones is for other tests to say.

Arrays of real numbers are numpy arrays of mpmath's; integers and truth values are numpy's own.
"""

import operator
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.extend import core

from ..errors import MachineError

DIGITS = 50


def numbers() -> Any:
    """mpmath, an extra."""
    try:
        import mpmath
    except ImportError:
        raise MachineError(
            "values in 50 digits need the package mpmath: pip install 'layerfit[digits]'. Or leave them out with --digits 0"
        ) from None
    return mpmath


def reals(x: Any) -> np.ndarray:
    """The numbers of an array, exactly, as mpmath's."""
    mpf = numbers().mpf
    return _each(lambda value: mpf(float(value)), x)


def in_digits(fn: Callable[..., Any], *example: Any) -> Callable[..., Any]:
    """`fn` for pytrees of `reals` of the structure and shapes of `example`, in the digits of mpmath's context."""
    with jax.enable_x64(True):
        like = jax.tree.map(lambda x: jax.ShapeDtypeStruct(np.shape(x), np.float64), example)
        closed, shape = jax.make_jaxpr(fn, return_shape=True)(*like)
    structure = jax.tree.structure(shape)

    def evaluate(*args: Any) -> Any:
        return jax.tree.unflatten(structure, _run(closed.jaxpr, closed.consts, jax.tree.leaves(args)))

    return evaluate


def _each(fn: Callable[..., Any], *arrays: Any) -> np.ndarray:
    return np.asarray(np.frompyfunc(fn, len(arrays), 1)(*arrays), object)


def _held(value: Any) -> np.ndarray:
    """A constant of a jaxpr, or what an operation gave."""
    array = np.asarray(value)
    return reals(array) if array.dtype.kind == "f" else array


def _run(jaxpr: Any, consts: Any, args: Any) -> list[Any]:
    known = dict(zip(jaxpr.constvars, map(_held, consts), strict=True)) | dict(zip(jaxpr.invars, args, strict=True))
    read = lambda atom: _held(atom.val) if isinstance(atom, core.Literal) else known[atom]  # noqa: E731
    for eqn in jaxpr.eqns:
        found = _apply(eqn, [read(atom) for atom in eqn.invars])
        known.update(zip(eqn.outvars, found, strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _apply(eqn: Any, args: list[Any]) -> Any:
    name, given = eqn.primitive.name, eqn.params
    if name in ("jit", "pjit", "custom_jvp_call"):
        inner = given["jaxpr" if "jaxpr" in given else "call_jaxpr"]
        return _run(inner.jaxpr, inner.consts, args)
    if name in _WHOLE:
        return _WHOLE[name](eqn, *args)
    if name in _BY_ELEMENT:
        return [_held(_BY_ELEMENT[name](*args))]
    if name in _MP:
        return [_each(getattr(numbers(), _MP[name]), *args)]
    if name in _MOVES or not any(arg.dtype == object for arg in args):
        return _moved(eqn, args)
    # A primitive that a new form brings: without a rule there are no digits of it, and none are better than those of float64.
    raise NotImplementedError(f"no digits of the JAX primitive {name!r}")


def _moved(eqn: Any, args: list[Any]) -> list[Any]:
    """An operation that only moves numbers: done to their places. Of integers and truth values it is JAX's own."""
    real = [arg.dtype == object for arg in args]
    pool = [number for arg, moved in zip(args, real, strict=True) if moved for number in arg.flat]
    places, start = [], 0
    for arg, moved in zip(args, real, strict=True):
        places.append(start + np.arange(arg.size).reshape(arg.shape) if moved else arg)
        start += arg.size if moved else 0
    # What lies outside is filled with a place that no number has: an error, not a wrong number.
    given = eqn.params | ({"fill_value": np.iinfo(np.int64).max} if any(real) and "fill_value" in eqn.params else {})
    with jax.enable_x64(True):
        out = eqn.primitive.bind(*map(jax.numpy.asarray, places), **given)
    out = [np.asarray(x) for x in (out if eqn.primitive.multiple_results else [out])]
    taken = np.array(pool, object)
    return [np.asarray(taken[x], object) for x in out] if any(real) else out


def _convert(eqn: Any, x: Any) -> list[Any]:
    to = np.dtype(eqn.params["new_dtype"])
    if x.dtype == object:
        return [x if to.kind == "f" else _each(int, x).astype(to)]
    return [reals(x) if to.kind == "f" else x.astype(to)]


def _select(eqn: Any, which: Any, *cases: Any) -> list[Any]:
    return [np.asarray(np.choose(which.astype(int), cases) if len(cases) != 2 else np.where(which, cases[1], cases[0]))]


def _dot(eqn: Any, a: Any, b: Any) -> list[Any]:
    (over_a, over_b), (batch_a, batch_b) = eqn.params["dimension_numbers"]
    names_a, names_b = list(range(a.ndim)), [a.ndim + k for k in range(b.ndim)]
    for j, k in zip((*over_a, *batch_a), (*over_b, *batch_b), strict=True):
        names_b[k] = names_a[j]
    out = [names_a[j] for j in batch_a]
    out += [n for j, n in enumerate(names_a) if j not in (*over_a, *batch_a)]
    out += [n for k, n in enumerate(names_b) if k not in (*over_b, *batch_b)]
    return [np.asarray(np.einsum(a, names_a, b, names_b, out), object)]


def _scan(eqn: Any, *args: Any) -> list[Any]:
    given = eqn.params
    n_consts, n_carry = given["num_consts"], given["num_carry"]
    consts, carry, columns = args[:n_consts], args[n_consts : n_consts + n_carry], args[n_consts + n_carry :]
    rows, steps = [], range(given["length"])
    for k in reversed(steps) if given["reverse"] else steps:
        found = _run(given["jaxpr"].jaxpr, given["jaxpr"].consts, [*consts, *carry, *(np.asarray(x[k]) for x in columns)])
        carry = found[:n_carry]
        rows.append(found[n_carry:])
    ordered = rows[::-1] if given["reverse"] else rows
    return [*carry, *(np.stack(column) for column in zip(*ordered, strict=True))]


def _sort(eqn: Any, *args: Any) -> list[Any]:
    order = np.argsort(args[0], eqn.params["dimension"], kind="stable")
    return [np.take_along_axis(x, order, eqn.params["dimension"]) for x in args]


def _reduced(fn: Any) -> Callable[..., list[Any]]:
    return lambda eqn, x: [_held(fn(x, axis=tuple(int(axis) for axis in eqn.params["axes"])))]


def _argmax(eqn: Any, x: Any) -> list[Any]:
    return [np.asarray(np.argmax(x, axis=eqn.params["axes"][0]), eqn.params["index_dtype"])]


_WHOLE: dict[str, Callable[..., list[Any]]] = {
    "convert_element_type": _convert,
    "select_n": _select,
    "dot_general": _dot,
    "scan": _scan,
    "sort": _sort,
    "reduce_sum": _reduced(np.sum),
    "reduce_max": _reduced(np.max),
    "argmax": _argmax,
    "power": lambda eqn, x: [_each(lambda base: base ** numbers().mpf(eqn.params["exponent"]), x)],
    "rsqrt": lambda eqn, x: [_each(lambda square: _divided(1, numbers().sqrt(square)), x)],
    "integer_pow": lambda eqn, x: [np.asarray(x ** eqn.params["y"], object)],
    "slice": lambda eqn, x: (
        [x[tuple(map(slice, eqn.params["start_indices"], eqn.params["limit_indices"]))]]
        if eqn.params["strides"] is None
        else _moved(eqn, [x])
    ),
    "squeeze": lambda eqn, x: [np.squeeze(x, tuple(int(d) for d in eqn.params["dimensions"]))],
}
"""By the whole equation."""


def _truth(compare: Any) -> Callable[..., np.ndarray]:
    return lambda a, b: np.asarray(compare(a, b), bool)


def _divided(x: Any, y: Any) -> Any:
    """As numbers of a machine: what is divided by 0 is not finite, and no error, where a guard does not take it."""
    mp = numbers()
    if y != 0:
        return x / y
    return mp.nan if x == 0 or mp.isnan(x) else mp.inf * mp.sign(x)


_BY_ELEMENT: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": lambda x, y: _each(_divided, x, y),
    "neg": operator.neg,
    "abs": np.abs,
    "max": np.maximum,
    "min": np.minimum,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "eq": _truth(operator.eq),
    "lt": _truth(operator.lt),
    "le": _truth(operator.le),
    "gt": _truth(operator.gt),
    "ge": _truth(operator.ge),
}
"""As numpy does it to whatever numbers an array holds."""

_MOVES = {
    "broadcast_in_dim",
    "concatenate",
    "copy",
    "dynamic_slice",
    "gather",
    "reshape",
    "rev",
    "slice",
    "split",
    "stack",
    "transpose",
}
"""What puts numbers elsewhere and changes none."""

_MP = {
    "sqrt": "sqrt",
    "exp": "exp",
    "expm1": "expm1",
    "log": "log",
    "log1p": "log1p",
    "pow": "power",
    "sin": "sin",
    "cos": "cos",
    "erf": "erf",
    "atan2": "atan2",
    "floor": "floor",
    "sign": "sign",
}
"""By their names in mpmath."""
