"""What the shading code is made of: chunks, structs and the guards of its derivatives.

A *chunk* is a function that is traced as one unit, so that the printer can write it as one GLSL function of the same name.
A *struct* is a dataclass that JAX sees through and the printer writes as a GLSL struct, field by field, with its comments.
A *guard* is an operation whose value or derivative is infinite at the edge of its domain. Its value is the plain
operation clamped to the domain, which is what a shader needs; its derivative is the plain one inside the domain and zero on the edge.
"""

import dataclasses
import json
import operator
from collections.abc import Callable
from functools import partial, reduce
from typing import Any, TypeVar, cast, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np
from jax import export, lax
from jax.extend.core import Primitive
from jax.interpreters import batching, mlir

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])

CHUNKS: dict[str, Callable[..., Any]] = {}
"""Every chunk by its name: the printer takes docstrings and annotations from here."""


def chunk(fn: F) -> F:
    """Mark a shading function of scalars, 3-vectors and structs as one printed function (it is `jax.jit` with a name)."""
    if fn.__name__ in CHUNKS:
        raise ValueError(f"two chunks are called {fn.__name__}; shader functions need names of their own")
    CHUNKS[fn.__name__] = fn
    return cast(F, jax.jit(fn))


def static(default: Any = dataclasses.MISSING, **metadata: Any) -> Any:
    """A field of a struct that is structure, not a number: it selects code and is never traced."""
    return dataclasses.field(default=default, metadata={"static": True, **metadata})


def member(comment: str) -> Any:
    """A field of a prepared struct, with the comment that stands beside it in the printed shader."""
    return dataclasses.field(metadata={"comment": comment})


def _getter(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Of several attributes at once: a fit flattens a material thousands of times a second."""
    return operator.attrgetter(*names) if len(names) > 1 else lambda x: tuple(getattr(x, name) for name in names)


@dataclass_transform(frozen_default=True, field_specifiers=(static, member, dataclasses.field))
def struct(cls: type[T]) -> type[T]:
    """A frozen dataclass that JAX maps over: fields made by `static` are structure, all others are leaves."""
    made: Any = dataclasses.dataclass(frozen=True, eq=False)(cls)
    fields = dataclasses.fields(made)
    meta = [f.name for f in fields if f.metadata.get("static")]
    data = [f.name for f in fields if f.name not in meta]
    keys = [jax.tree_util.GetAttrKey(name) for name in data]
    data_of, meta_of = _getter(data), _getter(meta)

    def flatten(x: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        return data_of(x), meta_of(x)

    def with_keys(x: Any) -> Any:
        leaves, aux = flatten(x)
        return list(zip(keys, leaves, strict=True)), aux

    def unflatten(aux: tuple[Any, ...], leaves: Any) -> Any:
        return made(**dict(zip(meta, aux, strict=True)), **dict(zip(data, leaves, strict=True)))

    # Not `register_dataclass`: to it structures of two classes with fields alike are equal, and where their hashes happen to be so
    # too, one class is given what was compiled for the other.
    jax.tree_util.register_pytree_with_keys(made, with_keys, unflatten, flatten)
    export.register_pytree_node_serialization(
        made,
        serialized_name=f"{made.__module__}.{made.__qualname__}",
        serialize_auxdata=lambda aux: json.dumps(aux).encode(),
        deserialize_auxdata=lambda aux: tuple(json.loads(aux)),
    )
    return made


@jax.jit
def dot(a: jax.Array, b: jax.Array) -> jax.Array:
    """Dot product of two vectors, GLSL's `dot`. Written out: for `jnp.dot` the compiler calls a library, for three products."""
    return reduce(operator.add, (a[k] * b[k] for k in range(len(a))))


@jax.jit
def vec2(x: jax.Array) -> jax.Array:
    """Twice the same number, GLSL's `vec2`: for arithmetic that fuses a product with a sum where both are vectors."""
    return jnp.full(2, x)


@jax.jit
def vec3(x: jax.Array) -> jax.Array:
    """Likewise."""
    return jnp.full(3, x)


@jax.jit
def vec4(x: jax.Array) -> jax.Array:
    """Likewise."""
    return jnp.full(4, x)


@jax.jit
def fetch(table: jax.Array, k: jax.Array) -> jax.Array:
    """A row of a table, GLSL's `table[k]`."""
    return table[k]


def where(condition: Any, x: Any, y: Any) -> jax.Array:
    """`jnp.where`, but no function of its own: compiled code keeps calls, and one for each choice costs more than the choice."""
    shape = jnp.broadcast_shapes(jnp.shape(condition), jnp.shape(x), jnp.shape(y))
    dtype = jnp.result_type(x, y)

    def full(value: Any, dtype: Any) -> jax.Array:
        value = jnp.asarray(value, dtype)
        return lax.broadcast_in_dim(value, shape, range(len(shape) - value.ndim, len(shape)))

    return lax.select(full(condition, bool), full(x, dtype), full(y, dtype))


def clip(x: jax.Array, lower: Any, upper: Any) -> jax.Array:
    """`jnp.clip`, likewise."""
    return jnp.minimum(jnp.maximum(x, lower), upper)


def _tiny(x: jax.Array) -> float:
    """The smallest number whose reciprocal square root is still harmless in the precision of `x`."""
    return 1e-14 if x.dtype == np.float32 else 1e-30


@jax.custom_jvp
def safe_sqrt(x: jax.Array) -> jax.Array:
    """sqrt(max(x, 0)); its derivative is 0 where x <= 0, where the plain one is infinite."""
    return jnp.sqrt(jnp.maximum(x, 0.0))


@safe_sqrt.defjvp
def _(primals: Any, tangents: Any) -> Any:
    (x,), (dx,) = primals, tangents
    root = safe_sqrt(x)
    inside = x > _tiny(x)
    return root, where(inside, 0.5 / where(inside, root, 1.0), 0.0) * dx


@jax.custom_jvp
def safe_divide(x: jax.Array, y: jax.Array) -> jax.Array:
    """x / max(y, tiny) for y >= 0; derivative 0 in y where y <= tiny."""
    return x / jnp.maximum(y, _tiny(y))


@safe_divide.defjvp
def _(primals: Any, tangents: Any) -> Any:
    (x, y), (dx, dy) = primals, tangents
    inside = y > _tiny(y)
    quotient = safe_divide(x, y)
    inverse = 1.0 / where(inside, y, 1.0)
    return quotient, where(inside, (dx - quotient * dy) * inverse, 0.0)


@jax.custom_jvp
def divide(x: jax.Array, y: jax.Array) -> jax.Array:
    """x / y, whose derivative holds no square of y: that is 0 in single precision long before y is."""
    return x / y


@divide.defjvp
def _(primals: Any, tangents: Any) -> Any:
    (x, y), (dx, dy) = primals, tangents
    quotient = divide(x, y)
    return quotient, (dx - quotient * dy) / y


_power_p = Primitive("power")
"""x ** exponent of positive numbers and a constant exponent: `pow` in a shader. The library function that `lax.pow` becomes on a CPU takes
one number at a time; exponential and logarithm, of which GLSL makes its own too, take a vector of them."""
_power_p.def_impl(jax.jit(lambda x, *, exponent: _power_p.bind(x, exponent=exponent), static_argnames="exponent"))
_power_p.def_abstract_eval(lambda x, *, exponent: x)
batching.defvectorized(_power_p)


def _power(x: jax.Array, *, exponent: float) -> jax.Array:
    # In float32 it is a few units in the last place off; float64 is for truth.
    return jnp.exp(exponent * jnp.log(x)) if x.dtype == np.float32 else jnp.power(x, exponent)


mlir.register_lowering(_power_p, mlir.lower_fun(_power, multiple_results=False))


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def safe_power(x: jax.Array, exponent: float) -> jax.Array:
    """x ** exponent for x >= 0 and a constant exponent > 0; value and derivative 0 at and below 0."""
    return _power_p.bind(jnp.maximum(x, 1e-30), exponent=float(exponent))


@safe_power.defjvp
def _(exponent: float, primals: Any, tangents: Any) -> Any:
    (x,), (dx,) = primals, tangents
    y = safe_power(x, exponent)
    inside = x > 1e-30
    # From the power itself, not by another one: powers are what a step of a fit takes longest for.
    return y, where(inside, exponent * y / where(inside, x, 1.0), 0.0) * dx
