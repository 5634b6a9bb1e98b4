"""Structs of GLSL for those of Python: their fields, their comments, and values that are made of leaves or taken apart."""

import dataclasses
import inspect
from collections.abc import Callable, Sequence
from typing import Any, get_args

import jax
import numpy as np

from .glsl import StructType, Value, glsl_type, lift, safe


def struct_value(leaves: Sequence[Value], struct: StructType) -> Value:
    """The struct that these leaves are all of, or a new one made of them."""
    reads = frozenset().union(*(v.reads for v in leaves))
    roots = {v.text.rpartition(".")[0] for v in leaves}
    root = roots.pop() if len(roots) == 1 else ""
    if root and all(v.text == f"{root}.{name}" for v, (name, _, _) in zip(leaves, struct.fields, strict=True)):
        return Value(root, struct.name, reads=reads)
    lifted = [lift(v, kind).text for v, (_, kind, _) in zip(leaves, struct.fields, strict=True)]
    return Value(f"{struct.name}({', '.join(lifted)})", struct.name, reads=reads)


def leaves_of(tree: Any) -> list[tuple[str, Any]]:
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return [(_joined(jax.tree_util.keystr(path, simple=True, separator=".")), leaf) for path, leaf in leaves]


def _joined(path: str) -> str:
    """The field of a struct that stands for one of a struct in it: GLSL's are flat here."""
    return safe(path.replace(".", "_"))


def named_leaves(root: str, value: Any) -> list[tuple[str, np.ndarray]]:
    """The numbers of a struct by the expressions that reach them, such as `lf_coat.eta`; of a number, that alone."""
    return [(f"{root}.{path}" if path else root, np.asarray(leaf, np.float32)) for path, leaf in leaves_of(value)]


def grouped(paths: Sequence[str], avals: Sequence[Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Leaves such as `coat.alpha`, `coat.eta`, `c` by their argument: coat with two fields, c with none."""
    groups: list[tuple[str, list[tuple[str, str]]]] = []
    for path, aval in zip(paths, avals, strict=True):
        root, _, leaf = path.partition(".")
        if not groups or groups[-1][0] != root:
            groups.append((root, []))
        groups[-1][1].append((_joined(leaf), glsl_type(aval)))
    return groups


def result_paths(info: Any, cls: Any) -> list[str]:
    """Leaves of the struct that a chunk returns, as `result.field`."""
    if all("." in path for path in info.result_paths):
        return info.result_paths
    # JAX finds the fields by building a struct of placeholders, which one that checks its arguments does not take.
    return [f"result.{field.name}" for field in dataclasses.fields(cls)]


def struct_of(note: Any) -> Any:
    """The struct that an annotation allows, if any: `Direction` is one of them or an array."""
    return next((kind for kind in get_args(note) if dataclasses.is_dataclass(kind)), note)


def comments_of(cls: Any) -> dict[str, str]:
    """What stands beside the fields of a struct, and beside those of structs in it."""
    comments = {}
    for field in dataclasses.fields(cls):
        comments[safe(field.name)] = comment_of(field)
        if dataclasses.is_dataclass(inner := struct_of(field.type)):
            parts = dataclasses.fields(inner)
            comments |= {_joined(f"{field.name}.{part.name}"): f"{comment_of(field)}: {comment_of(part)}" for part in parts}
    return comments


def comment_of(field: dataclasses.Field[Any]) -> str:
    spec = field.metadata.get("param")
    if spec is not None:
        return spec.doc + (f" [{spec.unit}]" if spec.unit != "1" else "")
    return field.metadata.get("comment", "")


def comment_lines(fn: Callable[..., Any]) -> str:
    first = (inspect.getdoc(fn) or "").split("\n\n")[0]
    return "".join(f"// {line}\n" for line in first.splitlines())
