"""What values can be: guards that cannot act are not printed.

A formula is guarded for all materials: a root of what rounding may take below 0, a choice that only an index below 1 takes the other way.
Of one material the numbers are known, so that intervals of all that is computed from them are, too (Moore 1966). A limit or a choice
that is settled by them is left out; no value changes by it, to the last bit. What is not known is unbounded.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import Literal

from ..optics.directions import LEAST_COSINE

ROUNDING = 1e-6
"""A result may be off by it, relative: an operation of a GPU by some units in the last place."""
TRANSCENDENTAL = 1e-4
"""So may exponentials, logarithms and powers."""


class Bounds(NamedTuple):
    """Least and largest that a value, or each number of a vector, can be."""

    low: Any
    high: Any


ANY = Bounds(-np.inf, np.inf)
Settled = Mapping[Any, Any]
Calls = dict[tuple[Any, ...], Mapping[Any, Bounds]]
"""Bounds of the values of a function, by `call`: a function is called in many places, and each is looked at from all that are around it."""


def exactly(value: Any) -> Bounds:
    """Of a constant."""
    value = np.asarray(value, float)
    return _together(Bounds(value, value)) if value.size > 4 else Bounds(value, value)


def _together(bounds: Bounds) -> Bounds:
    """Of all numbers of an array at once."""
    return Bounds(np.min(bounds.low), np.max(bounds.high))


def call(jaxpr: Any, consts: Sequence[Any], given: Sequence[Bounds]) -> tuple[Any, ...]:
    """What calls of one function have in common whose inputs have the same bounds."""
    return (
        jaxpr,
        tuple(map(id, consts)),
        tuple((np.shape(end), np.asarray(end, float).tobytes()) for ends in given for end in ends),
    )


def known(jaxpr: Any, consts: Sequence[Any], given: Sequence[Bounds], calls: Calls) -> Mapping[Any, Bounds]:
    """Bounds of every value of a jaxpr, by those of its inputs; looked up where it is one of the `calls` before, else added to them."""
    key = call(jaxpr, consts, given)
    if key not in calls:
        of = dict(zip(jaxpr.constvars, map(exactly, consts), strict=True)) | dict(zip(jaxpr.invars, given, strict=True))
        with np.errstate(all="ignore"):
            for eqn in jaxpr.eqns:
                of.update(zip(eqn.outvars, _results(eqn, [read(of, v) for v in eqn.invars], calls), strict=True))
        calls[key] = of
    return calls[key]


def read(of: Mapping[Any, Bounds], var: Any) -> Bounds:
    """Bounds of a value or a literal."""
    return exactly(var.val) if isinstance(var, Literal) else of[var]


def settled(jaxpr: Any, of: Mapping[Any, Bounds]) -> dict[Any, Any]:
    """What is another value in any case: limits that are never reached, and choices that are always the same."""
    same: dict[Any, Any] = {}
    for eqn in jaxpr.eqns:
        if (choose := _CHOICES.get(eqn.primitive.name)) and (kept := choose(*(read(of, v) for v in eqn.invars))) is not None:
            same[eqn.outvars[0]] = resolved(same, eqn.invars[kept])
    return same


def resolved(same: Settled, var: Any) -> Any:
    """The value that stands for `var`."""
    return var if isinstance(var, Literal) else same.get(var, var)


def inner_of(eqn: Any) -> tuple[Any, Sequence[Any]] | None:
    """The jaxpr that an equation calls, and its constants."""
    called = eqn.params.get({"jit": "jaxpr", "pjit": "jaxpr", "custom_jvp_call": "call_jaxpr"}.get(eqn.primitive.name))
    return called and (called.jaxpr, called.consts)


def _results(eqn: Any, given: list[Bounds], calls: Calls) -> list[Bounds]:
    name = eqn.params.get("name") if eqn.primitive.name in ("jit", "pjit") else eqn.primitive.name
    if name == "above":  # used only where the direction's cosine, its last number, is above the least
        *along, last = given[-len(eqn.outvars) :]
        low, high = (np.broadcast_to(end, eqn.outvars[-1].aval.shape).copy() for end in last)
        low.flat[-1] = max(low.flat[-1], LEAST_COSINE)
        return [*along, Bounds(low, high)]
    if name == "half_cosine":  # of unit vectors
        return [Bounds(0.0, 1.0 + ROUNDING)]
    if name == "fetch":  # the least and the largest of the table
        return [_together(given[0])]
    if name == "dot":
        (a, b), (left, right) = given, eqn.invars
        return [_sum(_product(a, b, left is right), left.aval.shape[0])]
    if inner := inner_of(eqn):
        jaxpr, consts = inner
        of = known(jaxpr, consts, given, calls)
        return [read(of, v) for v in jaxpr.outvars]
    rule = _RULES.get(eqn.primitive.name)
    if rule is None:
        return [ANY] * len(eqn.outvars)
    return [_fitted(rule(eqn, *given), eqn.outvars[0].aval.shape)]


def _fitted(bounds: Bounds, shape: tuple[int, ...]) -> Bounds:
    """Without what says nothing, and of a shape that the value's own can take."""
    low, high = np.asarray(bounds.low, float), np.asarray(bounds.high, float)
    bounds = Bounds(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))
    # One number, or as many as the value has; tables, which are no values of a shader but of what is made for it, have one.
    return bounds if low.ndim == high.ndim == 1 and low.shape == shape and low.size <= 4 else _together(bounds)


def _rounded(low: Any, high: Any, by: float = ROUNDING) -> Bounds:
    return Bounds(low - by * np.abs(low), high + by * np.abs(high))


def _hull(*ends: Any) -> Bounds:
    """Of all products or quotients of ends: nothing times what has no bound is nothing."""
    ends = tuple(np.where(np.isnan(end), 0.0, end) for end in np.broadcast_arrays(*ends))
    return _rounded(np.min(ends, 0), np.max(ends, 0))


def _product(a: Bounds, b: Bounds, same: bool) -> Bounds:
    if not same:
        return _hull(a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high)
    passes = (a.low < 0.0) & (a.high > 0.0)
    least = np.where(passes, 0.0, np.minimum(np.abs(a.low), np.abs(a.high)))
    return _rounded(least * least, np.maximum(np.abs(a.low), np.abs(a.high)) ** 2)


def _quotient(a: Bounds, b: Bounds) -> Bounds:
    # Of what is on one side of 0; the sign of an end that is 0 is that of the other.
    low = np.where((b.low == 0.0) & (b.high > 0.0), 0.0, b.low)
    high = np.where((b.high == 0.0) & (b.low < 0.0), -0.0, b.high)
    inverse = Bounds(1.0 / high, 1.0 / low)
    whole = _product(a, inverse, same=False)
    through = (b.low < 0.0) & (b.high > 0.0) | (b.low == b.high) & (b.low == 0.0)
    return Bounds(np.where(through, -np.inf, whole.low), np.where(through, np.inf, whole.high))


def _sum(a: Bounds, size: int) -> Bounds:
    low, high = (np.sum(np.broadcast_to(end, (size,))) for end in a)
    return _rounded(low, high, size * ROUNDING)


def _increasing(fn: Callable[..., Any], least: float = -np.inf, by: float = ROUNDING) -> Callable[..., Bounds]:
    """A function that grows with its argument, defined from `least` on."""
    return lambda eqn, a: _rounded(fn(np.maximum(a.low, least)), fn(np.maximum(a.high, least)), by)


def _power(eqn: Any, a: Bounds) -> Bounds:
    y = eqn.params.get("y", 2)
    if y < 0:
        return _quotient(exactly(1.0), _raised(a, -y))
    return _raised(a, y)


def _raised(a: Bounds, y: int) -> Bounds:
    if y % 2:
        return _rounded(a.low**y, a.high**y, y * ROUNDING)
    square = _product(a, a, same=True)
    return _rounded(square.low ** (y // 2), square.high ** (y // 2), y * ROUNDING)


def _magnitude(eqn: Any, a: Bounds) -> Bounds:
    least = np.where((a.low < 0.0) & (a.high > 0.0), 0.0, np.minimum(np.abs(a.low), np.abs(a.high)))
    return Bounds(least, np.maximum(np.abs(a.low), np.abs(a.high)))


def _select(eqn: Any, which: Bounds, no: Bounds, yes: Bounds) -> Bounds:
    low = np.where(which.low == 1.0, yes.low, np.where(which.high == 0.0, no.low, np.minimum(no.low, yes.low)))
    return Bounds(
        low, np.where(which.low == 1.0, yes.high, np.where(which.high == 0.0, no.high, np.maximum(no.high, yes.high)))
    )


def _slice(eqn: Any, a: Bounds) -> Bounds:
    start, limit = eqn.params["start_indices"][0], eqn.params["limit_indices"][0]
    return Bounds(*(end[start:limit] if np.size(end) > 1 else end for end in a))


def _joined(eqn: Any, *parts: Bounds) -> Bounds:
    if any(v.aval.ndim > 1 for v in eqn.invars):
        each = [_together(part) for part in parts]
        return Bounds(np.min([part.low for part in each]), np.max([part.high for part in each]))
    whole = [
        [np.atleast_1d(np.broadcast_to(end, v.aval.shape)) for end in part] for part, v in zip(parts, eqn.invars, strict=True)
    ]
    lows, highs = zip(*whole, strict=True)
    return Bounds(np.concatenate(lows), np.concatenate(highs))


def _truth(is_so: Any, may_be: Any) -> Bounds:
    return Bounds(np.asarray(is_so, float), np.asarray(may_be, float))


def _passes(eqn: Any, a: Bounds) -> Bounds:
    return a


_RULES: dict[str, Callable[..., Bounds]] = {
    "add": lambda eqn, a, b: _rounded(a.low + b.low, a.high + b.high),
    "sub": lambda eqn, a, b: _rounded(a.low - b.high, a.high - b.low),
    "mul": lambda eqn, a, b: _product(a, b, eqn.invars[0] is eqn.invars[1]),
    "div": lambda eqn, a, b: _quotient(a, b),
    "neg": lambda eqn, a: Bounds(-a.high, -a.low),
    "max": lambda eqn, a, b: Bounds(np.maximum(a.low, b.low), np.maximum(a.high, b.high)),
    "min": lambda eqn, a, b: Bounds(np.minimum(a.low, b.low), np.minimum(a.high, b.high)),
    "clamp": lambda eqn, a, x, b: Bounds(np.clip(x.low, a.low, b.low), np.clip(x.high, a.high, b.high)),
    "abs": _magnitude,
    "sqrt": _increasing(np.sqrt, 0.0),
    "rsqrt": lambda eqn, a: _rounded(1.0 / np.sqrt(a.high), 1.0 / np.sqrt(np.maximum(a.low, 0.0))),
    "exp": _increasing(np.exp, by=TRANSCENDENTAL),
    "log": _increasing(np.log, 0.0, TRANSCENDENTAL),
    "power": lambda eqn, a: _increasing(lambda x: x ** eqn.params["exponent"], 0.0, TRANSCENDENTAL)(eqn, a),
    "integer_pow": _power,
    "square": _power,
    "reduce_sum": lambda eqn, a: _sum(a, eqn.invars[0].aval.size // eqn.outvars[0].aval.size),
    "select_n": _select,
    "slice": _slice,
    "concatenate": _joined,
    "stack": _joined,
    "gt": lambda eqn, a, b: _truth(a.low > b.high, a.high > b.low),
    "ge": lambda eqn, a, b: _truth(a.low >= b.high, a.high >= b.low),
    "lt": lambda eqn, a, b: _truth(a.high < b.low, a.low < b.high),
    "le": lambda eqn, a, b: _truth(a.high <= b.low, a.low <= b.high),
    "eq": lambda eqn, a, b: _truth((a.low == b.high) & (a.high == b.low), (a.low <= b.high) & (b.low <= a.high)),
    "ne": lambda eqn, a, b: _truth((a.low > b.high) | (b.low > a.high), (a.low != b.high) | (a.high != b.low)),
    **dict.fromkeys(("broadcast_in_dim", "reshape", "squeeze", "copy", "stop_gradient", "convert_element_type"), _passes),
}


def _largest(a: Bounds, b: Bounds) -> int | None:
    return 0 if np.all(a.low >= b.high) else 1 if np.all(b.low >= a.high) else None


def _least(a: Bounds, b: Bounds) -> int | None:
    return 0 if np.all(a.high <= b.low) else 1 if np.all(b.high <= a.low) else None


def _within(low: Bounds, x: Bounds, high: Bounds) -> int | None:
    return 1 if np.all(x.low >= low.high) and np.all(x.high <= high.low) else None


def _chosen(which: Bounds, *cases: Bounds) -> int | None:
    if len(cases) != 2:
        return None
    return 2 if np.all(which.low == 1.0) else 1 if np.all(which.high == 0.0) else None


_CHOICES: dict[str, Callable[..., int | None]] = {
    "max": _largest,
    "min": _least,
    "clamp": _within,
    "select_n": _chosen,
    "abs": lambda a: 0 if np.all(a.low >= 0.0) else None,
}
