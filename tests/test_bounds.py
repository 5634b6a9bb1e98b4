"""Guards that cannot act: intervals hold what is computed, and a limit is left out only where nothing changes by it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, STACKS, varnish
from layerfit._chunk import CHUNKS, dot, safe_divide, safe_sqrt, where
from layerfit.forms.faithful import Faithful
from layerfit.shader.bounds import ANY, Bounds, known, read, settled
from layerfit.shader.export import print_material
from layerfit.shader.printer import Printer
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Dielectric

WITHIN = Bounds(-2.0, 3.0)
FORMULAS = {
    "sum and product": lambda a, b: (a + b) * (a - 2.0 * b) - a,
    "square": lambda a, b: a * a - b * b,
    "quotient": lambda a, b: a / (b * b + 0.5),
    "quotient by what is below 0": lambda a, b: a / (-1.0 - b * b),
    "root": lambda a, b: safe_sqrt(a) - jnp.sqrt(b * b),
    "one over a root": lambda a, b: jax.lax.rsqrt(0.1 + a * a) * b,
    "exponential": lambda a, b: jnp.exp(-a) + b,
    "powers": lambda a, b: a**3 - b**2 + 1.0 / (1.0 + b * b) ** 2,
    "limits": lambda a, b: jnp.maximum(a, 0.5 * b) + jnp.minimum(b, -a) + jnp.clip(a, -1.0, 1.0),
    "magnitude": lambda a, b: jnp.abs(a) - jnp.abs(b - 5.0),
    "choice": lambda a, b: where(a > b, a, -b) + where(a < 4.0, b, 100.0),
    "vectors": lambda a, b: (
        dot(jnp.stack([a, b, 1.0 + a]), jnp.stack([b, b, a])) + jnp.sum(jnp.stack([a, b]) * jnp.stack([b, a]))
    ),
    "tables": lambda a, b: jnp.sum((a * np.arange(6.0))[:, None] * (b + np.arange(9.0))[None]) + a,
    "parts of tables": lambda a, b: jnp.concatenate([a * jnp.ones((7, 2)), b * jnp.ones((3, 2))])[4:8, 1][1] - b,
    "parts of vectors": lambda a, b: jnp.concatenate([jnp.stack([a, b]), jnp.ones(1)])[1:][0] * a,
}


@pytest.mark.parametrize("name", FORMULAS)
def test_what_is_computed_lies_within(name):
    fn = FORMULAS[name]
    closed = jax.make_jaxpr(fn)(jnp.float32(1.0), jnp.float32(1.0))
    of = known(closed.jaxpr, closed.consts, [WITHIN, WITHIN], {})
    low, high = read(of, closed.jaxpr.outvars[0])
    a, b = np.random.default_rng(0).uniform(-2.0, 3.0, (2, 4000)).astype(np.float32)
    values = np.asarray(jax.vmap(fn)(a, b))
    assert np.isfinite(low)
    assert np.isfinite(high)
    assert low <= values.min()
    assert values.max() <= high


def text(fn, bounds):
    printer = Printer(CHUNKS)
    printer.function(fn, "lf_test", [], [(jnp.zeros((), jnp.float32), "a", bounds)])
    return printer.functions_text()


@pytest.mark.parametrize(
    ("fn", "guard"),
    [
        (lambda a: safe_sqrt(a), "max"),
        (lambda a: safe_divide(2.0, a), "max"),
        (lambda a: jnp.minimum(a, 4.0), "min"),
        (lambda a: jnp.abs(a), "abs"),
        (lambda a: where(a > 0.0, a, 1.0), "?"),
        (lambda a: jnp.clip(a, 0.0, 4.0), "max"),
    ],
)
def test_a_guard_is_printed_where_it_can_act(fn, guard):
    assert guard in text(fn, ANY)
    assert guard in text(fn, Bounds(-1.0, 5.0))
    assert guard not in text(fn, Bounds(0.5, 3.0))


def test_what_only_a_dropped_choice_reads_is_not_printed():
    assert "exp" not in text(lambda a: where(a > 0.0, a, jnp.exp(a)), Bounds(0.5, 3.0))


def test_an_interval_that_begins_at_0_keeps_the_guard_of_a_quotient():
    assert "max" in text(lambda a: safe_divide(1.0, a), Bounds(0.0, 1.0))


def test_a_value_below_0_is_negated():
    assert "return -a;" in text(lambda a: jnp.abs(a), Bounds(-3.0, -1.0))


def test_what_may_be_anything_settles_nothing():
    closed = jax.make_jaxpr(lambda a: where(jnp.abs(a) > 1.0, jnp.maximum(a, 2.0), safe_sqrt(a)))(1.0)
    assert not settled(closed.jaxpr, known(closed.jaxpr, closed.consts, [ANY], {}))


def test_a_material_has_the_guards_that_its_numbers_ask_for():
    """Copper absorbs in all channels, chromium's like in some only; an index below 1 reflects all light of some directions."""
    conductor = lambda **metal: print_material(Stack((), Conductor(**metal), Faithful()), "m").functions  # noqa: E731
    assert "mix(" not in conductor(**COPPER)
    assert "mix(" in conductor(eta=[3.0, 0.9, 1.1], k=[2.0, 2.5, 2.1])
    total = "refracts"
    assert total not in print_material(Stack((), Dielectric(eta=1.5)), "m").functions
    assert total in print_material(Stack((), Dielectric(eta=0.7)), "m").functions


def test_uniforms_may_be_anything():
    stack = Stack((varnish(),), Conductor(**COPPER), Faithful())
    assert "refracts" not in print_material(stack, "m").functions
    assert "refracts" in print_material(stack, "m", "prepared").functions
    assert "refracts" in print_material(STACKS["corrected over conductor"], "m", uniforms=True).functions
