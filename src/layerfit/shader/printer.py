"""Print a traced function as GLSL.

`Printer.function` traces a Python function, walks its jaxpr and writes one GLSL function; each chunk that it calls becomes a
function of its own, each struct a GLSL struct. Values keep their Python names, formulas their grouping. Only JAX is imported here.
"""

import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.core import Literal

from .bounds import ANY, Bounds, Calls, call, exactly, known, read, resolved, settled
from .glsl import ATOM, PREFIX, UNARY, PrintError, StructType, Value, glsl_type, indent, lift, literal, reads, safe
from .names import name_of, source_of
from .primitives import BUILTINS, GUARDS, PRIMITIVES
from .structs import comment_lines, comments_of, grouped, leaves_of, result_paths, struct_of, struct_value

Parameter = tuple[str, str, StructType | None]
"""Of a chunk: its name, its type, and the struct that it is."""


class Printer:
    """Collects the functions and structs of one shader."""

    def __init__(self, chunks: Mapping[str, Callable[..., Any]]):
        self.chunks = chunks
        self.functions: dict[Any, tuple[str, str]] = {}
        self.structs: dict[tuple[Any, ...], StructType] = {}
        self.helpers: dict[str, str] = {}
        self.arrays: dict[str, str] = {}
        self.calls: Calls = {}
        self.printed: dict[tuple[Any, ...], tuple[str, list[Parameter], StructType | None]] = {}

    def structs_text(self) -> str:
        """Declarations of the structs."""
        return "\n".join(s.declaration() for s in self.structs.values())

    def functions_text(self) -> str:
        """Tables, helpers and functions, each before its first use."""
        return "\n".join([*self.arrays.values(), *self.helpers.values(), *(text for _, text in self.functions.values())])

    def array(self, value: np.ndarray) -> str:
        """Declare a table, numbers or vectors, as a constant; returns its name."""
        kind, rows = glsl_type(value[0]), ", ".join(literal(v) for v in value)
        key = f"{kind}[{len(value)}]({rows})"
        if key not in self.arrays:
            self.arrays[key] = f"const {kind} {PREFIX}row{len(self.arrays) + 1}[{len(value)}] = {key};\n"
        return self.arrays[key].split("[")[0].split()[-1]

    def struct(self, example: Any, leaves: Sequence[tuple[str, str]]) -> StructType:
        """The GLSL struct of a Python one (an instance or its class), given its leaves as (name, type)."""
        cls: Any = example if inspect.isclass(example) else type(example)
        key = (cls.__name__, tuple(leaves))
        if key not in self.structs:
            taken = sum(name == cls.__name__ for name, _ in self.structs)
            comments = comments_of(cls)
            fields = tuple((name, kind, comments.get(name, "")) for name, kind in leaves)
            self.structs[key] = StructType(cls.__name__ + (str(taken + 1) if taken else ""), fields)
        return self.structs[key]

    def constant(self, name: str, value: Any) -> str:
        """Declare a struct or a number as a constant, a field a line with its unit and meaning."""
        leaves = [(key, np.asarray(leaf, np.float32)) for key, leaf in leaves_of(value)]
        if not dataclasses.is_dataclass(value):
            return f"const {glsl_type(leaves[0][1])} {name} = {literal(leaves[0][1])};\n"
        struct = self.struct(value, [(key, glsl_type(leaf)) for key, leaf in leaves])
        return struct.constant(name, [literal(leaf) for _, leaf in leaves])

    def uniform(self, name: str, value: Any) -> str:
        """Declare a struct or a number as a uniform."""
        leaves = [(key, glsl_type(np.asarray(leaf, np.float32))) for key, leaf in leaves_of(value)]
        kind = self.struct(value, leaves).name if dataclasses.is_dataclass(value) else leaves[0][1]
        return f"uniform {kind} {name};\n"

    def function(
        self,
        fn: Callable[..., Any],
        name: str,
        given: Sequence[tuple[Any, str]],
        params: Sequence[tuple[Any, str, Bounds]],
        constant: bool = False,
    ) -> None:
        """Print `fn(*given, *params)` as the GLSL function `name`.

        `given` are pytrees that stand outside the function (constants, uniforms), each with the expression to reach it, its leaves by
        field; `params` are arrays or structs that become parameters, each with what its numbers can be. Numbers that are `constant` are
        those of `given`.
        """
        closed = jax.make_jaxpr(fn)(*(tree for tree, _ in given), *(array for array, _, _ in params))
        numbers = [leaf for tree, _ in given for leaf in jax.tree.leaves(tree)]
        bounds = [exactly(leaf) if constant else ANY for leaf in numbers]
        bounds += [limits for value, _, limits in params for _ in jax.tree.leaves(value)]
        body = Body(self, closed.jaxpr, closed.consts, bounds)
        names: list[str] = []
        for tree, text in given:
            for path, leaf in leaves_of(tree):
                names.append(f"{text}.{path}" if path else text)
                kind = glsl_type(jax.numpy.asarray(leaf).aval if not hasattr(leaf, "aval") else leaf.aval)
                body.bind_next(Value(names[-1], kind))
            if dataclasses.is_dataclass(tree):
                self.struct(tree, [(path, glsl_type(np.asarray(leaf, np.float32))) for path, leaf in leaves_of(tree)])
        declared = []
        for value, param, _ in params:
            leaves = [(path, glsl_type(leaf)) for path, leaf in leaves_of(value)]
            kind = self.struct(value, leaves).name if dataclasses.is_dataclass(value) else leaves[0][1]
            declared.append(f"{kind} {param}")
            body.parameter(param, kind)
            for path, leaf_kind in leaves:
                body.bind_next(Value(f"{param}.{path}" if path else param, leaf_kind, reads=frozenset({param})))
        (result,) = body.run()
        kind = glsl_type(closed.out_avals[0])
        doc = comment_lines(fn)
        text = f"{doc}{kind} {name}({', '.join(declared)}) {{\n{indent(body.text(lift(result, kind)))}}}\n"
        self.functions[name] = (name, text)

    def chunk(self, name: str, closed: Any, bounds: Sequence[Bounds]) -> tuple[str, list[Parameter], StructType | None]:
        """Print a chunk once; returns its GLSL name, its parameters and the struct that it returns.

        `bounds` are what its arguments can be, here: where they make another text of it, that is a function of its own.
        """
        key = name, *call(closed.jaxpr, closed.consts, bounds)
        if key not in self.printed:
            self.printed[key] = self._chunk(name, closed, bounds)
        return self.printed[key]

    def _chunk(self, name: str, closed: Any, bounds: Sequence[Bounds]) -> tuple[str, list[Parameter], StructType | None]:
        jaxpr, fn = closed.jaxpr, self.chunks[name]
        info = jaxpr.debug_info
        notes = inspect.get_annotations(fn)
        groups = grouped(info.arg_names, [v.aval for v in jaxpr.invars])
        params = [
            (
                root,
                leaves[0][1] if leaves[0][0] == "" else "",
                self.struct(struct_of(notes[root]), leaves) if leaves[0][0] else None,
            )
            for root, leaves in groups
        ]
        returned = None
        if len(jaxpr.outvars) > 1:
            if not dataclasses.is_dataclass(cls := struct_of(notes.get("return"))):
                raise PrintError(
                    f"the chunk {name} returns several values: give them a struct, and the function its annotation"
                )
            ((_, leaves),) = grouped(result_paths(info, cls), [v.aval for v in jaxpr.outvars])
            returned = self.struct(cls, leaves)
        body = Body(self, jaxpr, closed.consts, bounds)
        for (root, kind, struct), (_, leaves) in zip(params, groups, strict=True):
            root = safe(root)
            for leaf, leaf_kind in leaves:
                body.bind_next(Value(f"{root}.{leaf}" if struct else root, leaf_kind, reads=frozenset({root})))
            body.parameter(root, struct.name if struct else kind)
        results = [lift(r, glsl_type(v.aval)) for r, v in zip(body.run(), jaxpr.outvars, strict=True)]
        kind = returned.name if returned else glsl_type(jaxpr.outvars[0].aval)
        result = Value(f"{kind}({', '.join(r.text for r in results)})", kind) if returned else results[0]
        signature = ", ".join(f"{struct.name if struct else kind} {safe(root)}" for root, kind, struct in params)
        printed = f"({signature}) {{\n{indent(body.text(result))}}}\n"
        same_types = (name, tuple(struct.name if struct else kind for _, kind, struct in params))
        for (key, _), (glsl_name, text) in ((k, v) for k, v in self.functions.items() if isinstance(k, tuple)):
            if key == same_types and text.endswith(printed):
                return glsl_name, params, returned
        # Other parameter types overload the name; the same types with another body (other structure) need a name of their own.
        variants = sum(isinstance(k, tuple) and k[0] == same_types for k in self.functions)
        glsl_name = PREFIX + name + (str(variants + 1) if variants else "")
        text = f"{comment_lines(fn)}{kind} {glsl_name}{printed}"
        self.functions[same_types, variants] = (glsl_name, text)
        return glsl_name, params, returned


class _Frame:
    """The values of one jaxpr while it is printed, what they can be, and how often each is still needed."""

    def __init__(self, printer: Printer, jaxpr: Any, consts: Sequence[Any], bounds: Sequence[Bounds]):
        self.values: dict[Any, Value] = {}
        self.bounds = known(jaxpr, consts, bounds, printer.calls)
        self.same = settled(jaxpr, self.bounds)
        self.left: dict[Any, int] = {}
        self.named_by = {kept: eqn for eqn in jaxpr.eqns if not isinstance(kept := self.same.get(eqn.outvars[0]), Literal)}
        self.live = []
        for v in jaxpr.outvars:
            self._need(v)
        for eqn in reversed(jaxpr.eqns):
            if any(v in self.left for v in eqn.outvars):
                self.live.append(eqn)
                for v in eqn.invars:
                    self._need(v)
        self.live.reverse()
        for var, value in zip(jaxpr.constvars, consts, strict=True):
            if var not in self.left:
                continue
            row = var.aval.ndim == 2 or (var.aval.ndim == 1 and var.aval.size > 4)
            self.values[var] = (
                Value(printer.array(np.asarray(value)), "row") if row else Value(literal(value), glsl_type(var.aval))
            )

    def _need(self, var: Any) -> None:
        var = resolved(self.same, var)
        if not isinstance(var, Literal):
            self.left[var] = self.left.get(var, 0) + 1

    def name(self, eqn: Any) -> str | None:
        """What the value of an equation is called in the source: it, or what it is in any case."""
        later = self.named_by.get(eqn.outvars[0])
        return name_of(eqn) or (name_of(later) if later else None)

    def limits(self, eqn: Any) -> list[Bounds]:
        """What the operands of an equation can be."""
        return [read(self.bounds, v) for v in eqn.invars]

    def read(self, var: Any) -> Value:
        var = resolved(self.same, var)
        if isinstance(var, Literal):
            text = literal(var.val)
            return Value(text, glsl_type(var.aval), UNARY if text.startswith("-") else ATOM)
        self.left[var] -= 1
        return self.values[var]

    def needs(self, name: str) -> bool:
        return any(count > 0 and var in self.values and name in self.values[var].reads for var, count in self.left.items())


class Body:
    """The statements of one function."""

    def __init__(self, printer: Printer, jaxpr: Any, consts: Sequence[Any], bounds: Sequence[Bounds]):
        self.printer = printer
        self.jaxpr = jaxpr
        self.lines: list[str] = []
        self.taken: set[str] = set()
        self.declared: dict[str, str] = {}
        self.enclosing: list[Any] = []
        self.frames = [_Frame(printer, jaxpr, consts, bounds)]
        self._params = iter(jaxpr.invars)

    def parameter(self, name: str, kind: str) -> None:
        """A parameter is a local that is already declared: GLSL passes by value."""
        self.declared[name] = kind

    def bind_next(self, value: Value) -> None:
        self.frames[0].values[next(self._params)] = value

    def run(self) -> list[Value]:
        return self._walk(self.frames[0], self.jaxpr, named=True)

    def text(self, result: Value) -> str:
        return "\n".join([*self.lines, f"return {result.text};"])

    def _walk(self, frame: _Frame, jaxpr: Any, named: bool) -> list[Value]:
        for eqn in frame.live:
            operands = [frame.read(v) for v in eqn.invars]
            name = frame.name(eqn) if named else None
            results = self._translate(eqn, operands, name)
            if len(results) == 1:
                (var,) = eqn.outvars
                value = results[0]
                simple = re.fullmatch(r"-?[\w.]+", value.text)
                if not simple and (name or frame.left[var] > 1):
                    value = self.local(name or "t", value)
                results = [value]
            frame.values.update(zip(eqn.outvars, results, strict=True))
        return [frame.read(v) for v in jaxpr.outvars]

    def local(self, name: str, value: Value) -> Value:
        """Give a value a name; a name whose old value is no longer read is assigned again."""
        base = name = safe(name)
        k = 2
        while name in self.taken or (name in self.declared and not self._free(name, value.type)):
            name, k = f"{base}{k}", k + 1
        declaration = "" if name in self.declared else f"{value.type} "
        self.declared[name] = value.type
        self.lines.append(f"{declaration}{name} = {value.text};")
        return Value(name, value.type, reads=frozenset({name}))

    def locals(self, name: str, *values: Value) -> list[Value]:
        """The same values, those that are more than a name or a number as locals, none of which takes the name of another."""
        named: list[Value] = []
        before = set(self.taken)
        for value in values:
            plain = re.fullmatch(r"-?[\w.]+|[biu]?vec\d\(-?[\w.]+\)", value.text)
            named.append(value if plain else self.local(name, value))
            self.taken.update(named[-1].reads)
        self.taken = before
        return named

    def _free(self, name: str, kind: str) -> bool:
        return self.declared[name] == kind and not any(frame.needs(name) for frame in self.frames)

    def _inline(self, eqn: Any, closed: Any, operands: Sequence[Value]) -> list[Value]:
        frame = _Frame(self.printer, closed.jaxpr, closed.consts, self.frames[-1].limits(eqn))
        frame.values.update(zip(closed.jaxpr.invars, operands, strict=True))
        self.frames.append(frame)
        self.enclosing.append(eqn)
        results = self._walk(frame, closed.jaxpr, named=False)
        self.enclosing.pop()
        self.frames.pop()
        return results

    def _where(self, eqn: Any) -> str:
        """The user's line: inside a function of JAX that was traced before, only the call of it has one."""
        return next((line for e in (eqn, *reversed(self.enclosing)) if (line := source_of(e))), "an unknown line")

    def _translate(self, eqn: Any, operands: list[Value], name: str | None) -> list[Value]:
        primitive = eqn.primitive.name
        if primitive in ("jit", "pjit"):
            closed, called = eqn.params["jaxpr"], eqn.params["name"]
            if called in GUARDS:
                return operands[-len(eqn.outvars) :]
            if called == "fetch":
                table, row = operands
                return [Value(f"{table.text}[{row.text}]", glsl_type(eqn.outvars[0].aval), reads=reads(*operands))]
            if called in BUILTINS:
                kind = glsl_type(eqn.outvars[0].aval)
                return [Value(f"{called}({', '.join(a.text for a in operands)})", kind, reads=reads(*operands))]
            if called in self.printer.chunks:
                return self._call(eqn, closed, called, operands, name)
            return self._inline(eqn, closed, operands)
        if primitive == "custom_jvp_call":
            return self._inline(eqn, eqn.params["call_jaxpr"], operands)
        if primitive == "scan":
            return self._loop(eqn, operands)
        if primitive not in PRIMITIVES:
            raise PrintError(f"{self._where(eqn)}: the printer knows no GLSL for the JAX primitive {primitive!r}")
        try:
            glsl_type(eqn.outvars[0].aval)
            if primitive == "abs" and np.all(self.frames[-1].limits(eqn)[0].high <= 0.0):
                primitive = "neg"
            return [PRIMITIVES[primitive](self, eqn, *operands)]
        except PrintError as error:
            raise PrintError(f"{self._where(eqn)}: {primitive}: {error}") from None

    def _call(self, eqn: Any, closed: Any, called: str, operands: list[Value], name: str | None) -> list[Value]:
        glsl_name, params, returned = self.printer.chunk(called, closed, self.frames[-1].limits(eqn))
        rest = list(operands)
        arguments = []
        for _, kind, struct in params:
            taken, rest = (rest[: len(struct.fields)], rest[len(struct.fields) :]) if struct else (rest[:1], rest[1:])
            arguments.append(struct_value(taken, struct) if struct else lift(taken[0], kind))
        text = f"{glsl_name}({', '.join(a.text for a in arguments)})"
        reads = frozenset().union(*(a.reads for a in arguments))
        if returned is None:
            return [Value(text, glsl_type(closed.out_avals[0]), reads=reads)]
        whole = self.local(
            name or re.findall("[A-Z][a-z]*", returned.name)[-1].lower(), Value(text, returned.name, reads=reads)
        )
        return [Value(f"{whole.text}.{field}", kind, reads=whole.reads) for field, kind, _ in returned.fields]

    def _loop(self, eqn: Any, operands: list[Value]) -> list[Value]:
        """A scan of fixed length over constant rows of numbers, as a counted loop."""
        p = eqn.params
        closed, (constants, carries) = p["jaxpr"], scan_sizes(p)
        if len(closed.jaxpr.outvars) != carries or p["reverse"]:
            raise PrintError(f"{self._where(eqn)}: only a forward scan without stacked outputs prints as a loop")
        outer, carry, rows = (
            operands[:constants],
            operands[constants : constants + carries],
            operands[constants + carries :],
        )
        kinds = [glsl_type(v.aval) for v in closed.jaxpr.outvars]
        state = []
        for value, kind in zip(carry, kinds, strict=True):
            lifted = lift(value, kind)
            state.append(self.local("total", lifted))
            self.taken.add(state[-1].text)  # written in the loop: never to be reused for anything else
        counter = self.local("k", Value("0", "int"))
        self.lines[-1] = f"for (int {counter.text} = 0; {counter.text} < {p['length']}; ++{counter.text}) {{"
        self.taken.add(counter.text)
        start = len(self.lines)
        known, taken = dict(self.declared), set(self.taken)
        self.taken.update(*(value.reads for value in outer))  # read again in the next turn, however early in this one
        # What is carried changes from turn to turn.
        frame = _Frame(self.printer, closed.jaxpr, closed.consts, [ANY] * len(closed.jaxpr.invars))
        items = [Value(f"{row.text}[{counter.text}]", "float", reads=row.reads) for row in rows]
        frame.values.update(zip(closed.jaxpr.invars, [*outer, *state, *items], strict=True))
        self.frames.append(frame)
        results = self._walk(frame, closed.jaxpr, named=True)
        self.frames.pop()
        for target, result, kind in zip(state, results, kinds, strict=True):
            self.lines.append(f"{target.text} = {lift(result, kind).text};")
        self.lines[start:] = [f"    {line}" for line in self.lines[start:]] + ["}"]
        self.declared, self.taken = known, taken
        return state


def scan_sizes(params: Mapping[str, Any]) -> tuple[int, int]:
    """How many operands of a scan are constants and how many are carried: two numbers in JAX 0.10, a tree in 0.12."""
    if "num_carry" in params:
        return params["num_consts"], params["num_carry"]
    constants, carried, _ = params["ft_in"].unpack()
    return len(constants.vals), len(carried.vals)
