"""The JAX primitives that print, each as the GLSL that computes the same."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from .glsl import (
    ATOM,
    CHOICE,
    COMPARISON,
    LOGIC,
    PREFIX,
    PRODUCT,
    SCALAR_TYPES,
    SHIFT,
    SUM,
    UNARY,
    VECTOR_TYPES,
    XOR,
    PrintError,
    Value,
    base_type,
    bracketed,
    glsl_type,
    lift,
    literal,
    reads,
    wider,
)
from .helpers import HELPERS


def _operator(symbol: str, binds: int, neutral: str | None = None, neutral_left: bool = False, within: int | None = None):
    """An infix operator. Brackets stand where they must, or round all that binds looser than `within`: who knows whether ^ or >> goes first?"""
    within = binds if within is None else within

    def write(body: Any, eqn: Any, a: Value, b: Value) -> Value:
        if b.text == neutral:
            return a
        if a.text == neutral and neutral_left:
            return b
        text = f"{bracketed(a, within, False)} {symbol} {bracketed(b, within, True)}"
        return Value(text, wider(a, b), binds, reads(a, b))

    return write


def _sum_or_difference(write: Callable[..., Value], of_negative: Callable[..., Value]):
    """One of them; of a negative number it is the other."""

    def either(body: Any, eqn: Any, a: Value, b: Value) -> Value:
        if a.text != "0.0" and b.binds == UNARY and b.text.startswith("-"):
            return of_negative(body, eqn, a, Value(b.text[1:], b.type, ATOM, b.reads))
        return write(body, eqn, a, b)

    return either


_plus, _minus = _operator("+", SUM, "0.0", neutral_left=True), _operator("-", SUM, "0.0")


def _function(name: str, lifted: bool = False):
    def write(body: Any, eqn: Any, *args: Value) -> Value:
        kind = wider(*args)
        if lifted:
            args = tuple(lift(a, kind) for a in args)
        elif len(args) > 1 and args[0].type != kind:  # max(float, vec3) does not exist; max(vec3, float) does
            args = (args[1], args[0])
        return Value(f"{name}({', '.join(a.text for a in args)})", kind, reads=reads(*args))

    return write


def _helper(name: str):
    def write(body: Any, eqn: Any, *args: Value) -> Value:
        body.printer.helpers[name] = HELPERS[name]
        return Value(f"{PREFIX}{name}({', '.join(a.text for a in args)})", wider(*args), reads=reads(*args))

    return write


def _comparison(symbol: str, vector_name: str):
    def write(body: Any, eqn: Any, a: Value, b: Value) -> Value:
        kind = wider(a, b)
        if not kind[-1].isdigit():
            text = f"{bracketed(a, COMPARISON, False)} {symbol} {bracketed(b, COMPARISON, True)}"
            return Value(text, "bool", COMPARISON, reads(a, b))
        a, b = lift(a, kind), lift(b, kind)
        return Value(f"{vector_name}({a.text}, {b.text})", f"bvec{kind[-1]}", reads=reads(a, b))

    return write


def _select(body: Any, eqn: Any, which: Value, *cases: Value) -> Value:
    if len(cases) != 2:
        raise PrintError("a choice between more than two values")
    kind = wider(*cases)
    if which.type != "bool" and not kind[-1].isdigit():
        kind = f"vec{which.type[-1]}"
    no, yes = (lift(case, kind) for case in cases)
    if which.type == "bool":
        # Both are computed before the choice: a compiler makes a branch of a choice between expressions that are not.
        no, yes = body.locals("value", no, yes)
        parts = [bracketed(v, CHOICE, True) for v in (which, yes, no)]
        return Value(f"{parts[0]} ? {parts[1]} : {parts[2]}", kind, CHOICE, reads(which, no, yes))
    return Value(f"mix({no.text}, {yes.text}, {which.text})", kind, reads=reads(which, no, yes))


def _passes(body: Any, eqn: Any, a: Value) -> Value:
    return a


def _convert(body: Any, eqn: Any, a: Value) -> Value:
    kind = SCALAR_TYPES[np.dtype(eqn.params["new_dtype"]).kind]
    kind = kind if not a.type[-1].isdigit() else f"{VECTOR_TYPES[kind]}{a.type[-1]}"
    return a if kind == a.type else Value(f"{kind}({a.text})", kind, reads=a.reads)


def _bits(body: Any, eqn: Any, a: Value) -> Value:
    if (a.type, np.dtype(eqn.params["new_dtype"])) != ("float", np.uint32):
        raise PrintError("bits are those of a float, as an unsigned number")
    return Value(f"floatBitsToUint({a.text})", "uint", reads=a.reads)


def _by_kind(of_truths: str, of_bits: str):
    """An infix operator of truths, and of the bits of numbers."""

    def write(body: Any, eqn: Any, a: Value, b: Value) -> Value:
        operator = _operator(of_truths, LOGIC) if a.type == "bool" else _operator(of_bits, XOR, within=UNARY)
        return operator(body, eqn, a, b)

    return write


def _negate(body: Any, eqn: Any, a: Value) -> Value:
    return Value(f"-{bracketed(a, UNARY, True)}", a.type, UNARY, a.reads)


def _slice(body: Any, eqn: Any, a: Value) -> Value:
    start, limit = eqn.params["start_indices"][0], eqn.params["limit_indices"][0]
    if not a.type[-1].isdigit():
        return a
    size = limit - start
    kind = base_type(a.type) if size == 1 else f"{a.type[:-1]}{size}"
    return Value(f"{bracketed(a, ATOM, False)}.{'xyzw'[start:limit]}", kind, reads=a.reads)


def _build(body: Any, eqn: Any, *parts: Value) -> Value:
    kind = glsl_type(eqn.outvars[0].aval)
    return Value(f"{kind}({', '.join(p.text for p in parts)})", kind, reads=reads(*parts))


def _sum(body: Any, eqn: Any, a: Value) -> Value:
    size = eqn.invars[0].aval.shape[0]
    kind = f"vec{size}"
    return Value(f"dot({lift(a, kind).text}, {kind}(1.0))", "float", reads=a.reads)


def _integer_power(body: Any, eqn: Any, a: Value) -> Value:
    y = eqn.params.get("y", 2)
    if not re.fullmatch(r"[\w.]+", a.text):
        a = body.local("t", a)
    product = " * ".join([a.text] * abs(y))
    if y < 0:
        return Value(f"1.0 / ({product})" if y < -1 else f"1.0 / {product}", a.type, PRODUCT, a.reads)
    return Value(product, a.type, PRODUCT if y > 1 else ATOM, a.reads)


def _power(body: Any, eqn: Any, a: Value) -> Value:
    exponent = Value(literal(eqn.params["exponent"]), "float")
    return _function("pow", lifted=True)(body, eqn, a, exponent)


def _clamp(body: Any, eqn: Any, low: Value, x: Value, high: Value) -> Value:
    kind = wider(low, x, high)
    low, x, high = (lift(v, kind) for v in (low, x, high))
    return Value(f"clamp({x.text}, {low.text}, {high.text})", kind, reads=reads(low, x, high))


BUILTINS = {"dot", "vec2", "vec3", "vec4"}
"""Traced functions that GLSL has by the same name."""

GUARDS = {"above"}
"""Traced functions that keep derivatives finite where a value is not used: in a shader, their last operand."""

PRIMITIVES: dict[str, Callable[..., Value]] = {
    "add": _sum_or_difference(_plus, _minus),
    "sub": _sum_or_difference(_minus, _plus),
    "mul": _operator("*", PRODUCT, "1.0", neutral_left=True),
    "div": _operator("/", PRODUCT, "1.0"),
    "neg": _negate,
    "max": _function("max"),
    "min": _function("min"),
    "pow": _function("pow", lifted=True),
    **{name: _function(name) for name in ("exp", "exp2", "log", "sqrt", "sin", "cos", "tan", "abs", "sign", "floor", "ceil")},
    "rsqrt": _function("inversesqrt"),
    **{name: _helper(name) for name in ("erf", "expm1", "log1p", "atan2")},
    "power": _power,
    "integer_pow": _integer_power,
    "square": _integer_power,
    "clamp": _clamp,
    "gt": _comparison(">", "greaterThan"),
    "ge": _comparison(">=", "greaterThanEqual"),
    "lt": _comparison("<", "lessThan"),
    "le": _comparison("<=", "lessThanEqual"),
    "eq": _comparison("==", "equal"),
    "ne": _comparison("!=", "notEqual"),
    "and": _by_kind("&&", "&"),
    "or": _by_kind("||", "|"),
    "xor": _operator("^", XOR, within=UNARY),
    "shift_right_logical": _operator(">>", SHIFT, within=UNARY),
    "shift_left": _operator("<<", SHIFT, within=UNARY),
    "bitcast_convert_type": _bits,
    "not": lambda body, eqn, a: Value(f"{'!' if a.type == 'bool' else '~'}{bracketed(a, UNARY, True)}", a.type, UNARY, a.reads),
    "select_n": _select,
    "broadcast_in_dim": _passes,
    "reshape": _passes,
    "squeeze": _passes,
    "copy": _passes,
    "stop_gradient": _passes,
    "convert_element_type": _convert,
    "slice": _slice,
    "concatenate": _build,
    "stack": _build,
    "reduce_sum": _sum,
}
