"""Pieces of GLSL: types, literals, names and expressions."""

import dataclasses
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

PREFIX = "lf_"
ATOM, UNARY, PRODUCT, SUM, SHIFT, COMPARISON, XOR, LOGIC, CHOICE = range(9)
"""How tightly an expression binds, tightest first."""

SCALAR_TYPES = {"f": "float", "b": "bool", "i": "int", "u": "uint"}
VECTOR_TYPES = {"float": "vec", "bool": "bvec", "int": "ivec", "uint": "uvec"}
RESERVED = frozenset(
    """
    active asm attribute break buffer case cast centroid class coherent common const continue default discard do double
    else enum extern external filter fixed flat float for goto half highp if image in inline inout input int interface
    invariant layout lowp main mediump namespace noinline noperspective out output packed partition patch precise
    precision public readonly resource restrict return sample sampler shared sizeof smooth static struct subroutine superp
    switch template texture this true false typedef uint uniform union unsigned using varying vec void volatile while
    writeonly
    """.split()  # noqa: SIM905 (eighty quoted words are not easier to read)
)


class PrintError(Exception):
    """A traced function holds something that has no GLSL form."""


@dataclasses.dataclass(frozen=True)
class Value:
    """A piece of GLSL: its text, its type, how tightly it binds, and the locals that it reads."""

    text: str
    type: str
    binds: int = ATOM
    reads: frozenset[str] = frozenset()


@dataclasses.dataclass(frozen=True)
class StructType:
    """A GLSL struct: its name and its fields as (name, type, comment)."""

    name: str
    fields: tuple[tuple[str, str, str], ...]

    def declaration(self) -> str:
        """What says what it is, a field a line with its unit and meaning."""
        texts = [f"{kind} {name};" for name, kind, _ in self.fields]
        notes = [comment for _, _, comment in self.fields]
        return f"struct {self.name} {{\n{_commented(texts, notes)}}};\n"

    def constant(self, name: str, values: Sequence[str]) -> str:
        """A constant of it, a value a line with what its field says."""
        texts = [*(f"{value}," for value in values[:-1]), f"{values[-1]} "]  # the last as wide as with a comma
        notes = [f"{field}: {comment}" if comment else field for field, _, comment in self.fields]
        return f"const {self.name} {name} = {self.name}(\n{_commented(texts, notes)});\n"


def _commented(texts: Sequence[str], notes: Sequence[str]) -> str:
    """Lines of code, with the comments that they have one below the other."""
    width = max(map(len, texts))
    rows = zip(texts, notes, strict=True)
    return "".join(f"    {text:<{width}}  // {note}\n" if note else f"    {text}\n" for text, note in rows)


def base_type(kind: str) -> str:
    return re.sub(r"\d", "", {"vec": "float", "bvec": "bool", "ivec": "int", "uvec": "uint"}.get(kind[:-1], kind))


def glsl_type(aval: Any) -> str:
    """GLSL type of an abstract value."""
    scalar = SCALAR_TYPES[np.dtype(aval.dtype).kind]
    if aval.shape in ((), (1,)):  # one number, also while it is being sliced out of a vector
        return scalar
    if aval.shape in ((2,), (3,), (4,)):
        return f"{VECTOR_TYPES[scalar]}{aval.shape[0]}"
    raise PrintError(f"a value of shape {aval.shape} has no GLSL type: shading code is made of scalars and 3-vectors")


def literal(value: Any) -> str:
    """A constant, in the fewest digits that read back as the same float32."""
    value = np.asarray(value)
    if value.ndim:
        parts = [literal(v) for v in value]
        kind = glsl_type(value)
        return f"{kind}({parts[0] if len(set(parts)) == 1 else ', '.join(parts)})"
    if value.dtype.kind == "b":
        return "true" if value else "false"
    if value.dtype.kind == "u":
        return f"{int(value)}u"
    if value.dtype.kind == "i":
        return str(int(value))
    text = str(np.float32(value))
    if not np.isfinite(np.float32(value)):
        raise PrintError(f"{text} has no GLSL literal")
    return text if "." in text or "e" in text else text + ".0"


def indent(text: str) -> str:
    return "".join(f"    {line}\n" if line else "\n" for line in text.splitlines())


def safe(name: str) -> str:
    return f"{name}_" if name in RESERVED or name.startswith("gl_") else name


def lift(value: Value, kind: str) -> Value:
    """Broadcasts stay scalar until a vector is needed: here it is."""
    if value.type == kind:
        return value
    return Value(f"{kind}({value.text})", kind, reads=value.reads)


def bracketed(value: Value, binds: int, right: bool) -> str:
    loose = value.binds > binds or (right and value.binds in (binds, UNARY))
    return f"({value.text})" if loose else value.text


def reads(*values: Value) -> frozenset[str]:
    return frozenset().union(*(v.reads for v in values))


def wider(*values: Value) -> str:
    return max((v.type for v in values), key=lambda kind: (kind[-1].isdigit(), kind))
