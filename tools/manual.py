"""Write the tables of the manual from the source: layers from their fields, forms and the [fit] table from their options.

    python tools/manual.py          rewrites the marked blocks of docs/
    python tools/manual.py --check  says which are out of date, exit code 1 where one is

A block stands between `<!-- table: NAME -->` and `<!-- end -->`.
"""

import dataclasses
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from layerfit._fields import Param, params
from layerfit.capture.scene import FitRequest
from layerfit.layers import LAYERS
from layerfit.preset import MODELS
from layerfit.surfaces import BASES

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"^(<!-- table: (\w+) -->\n).*?^(<!-- end -->)$", re.MULTILINE | re.DOTALL)

STEPS = {"linear": "value", "log": "log(value)", "softlog": "log(1 + value / {soft:g})"}


def layer(cls: type) -> str:
    """The parameters of a layer, then what it can choose."""
    rows = [("`name`", "text", "", f"`{_field(cls, 'name').default}`", "", _field(cls, "name").metadata["doc"])]
    rows += [_parameter(name, spec) for name, spec in params(cls)]
    for field in dataclasses.fields(cls):
        if choices := field.metadata.get("choices"):
            words = ", ".join(f"`{choice}`" for choice in choices)
            rows.append((f"`{field.name}`", words, "", f"`{choices[0]}`", "", field.metadata["doc"]))
    return table(("key", "range", "unit", "default", "the fit steps in", "meaning"), rows)


def _field(cls: Any, name: str) -> Any:
    return next(field for field in dataclasses.fields(cls) if field.name == name)


def _parameter(name: str, spec: Param) -> tuple[str, ...]:
    default = "absent" if spec.default is None else f"{spec.default:g}"
    steps = STEPS[spec.scale].format(soft=spec.soft) + ("" if spec.fitted else "; fixed unless named")
    doc = spec.doc + (", a number or one a channel" if spec.colour else "")
    return f"`{name}`", f"{spec.lower:g} to {spec.upper:g}", spec.unit, default, steps, doc


def options(cls: Any) -> str:
    """Keys and defaults of a table of options."""
    return table(("key", "default"), [(f"`{f.name}`", _default(f)) for f in dataclasses.fields(cls)])


def _default(field: Any) -> str:
    if field.default is dataclasses.MISSING:
        return "none"
    if field.default is None:
        return "left out"
    value = str(field.default).lower() if isinstance(field.default, bool) else repr(field.default).replace("'", '"')
    return f"`{value}`"


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Markdown; columns without a word are left out."""
    rows = list(rows)
    kept = [k for k in range(len(head)) if any(row[k] for row in rows)]
    lines = [[row[k] for k in kept] for row in (head, ["---"] * len(head), *rows)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


TABLES: dict[str, Callable[[], str]] = {
    **{name: lambda cls=cls: layer(cls) for name, cls in (LAYERS | BASES).items()},
    **{name: lambda cls=cls: options(cls) for name, cls in MODELS.items()},
    "fit": lambda: options(FitRequest),
}


def updated(text: str) -> str:
    """A page with its blocks made anew."""

    def made(match: re.Match[str]) -> str:
        if match[2] not in TABLES:
            raise SystemExit(f"there is no table {match[2]!r}; there are {', '.join(TABLES)}")
        return f"{match[1]}{TABLES[match[2]]()}{match[3]}"

    return BLOCK.sub(made, text)


def main() -> None:
    stale = [page for page in sorted(DOCS.glob("*.md")) if updated(page.read_text()) != page.read_text()]
    if "--check" in sys.argv:
        sys.exit("".join(f"{page}: tables are out of date; run python tools/manual.py\n" for page in stale) or 0)
    for page in stale:
        page.write_text(updated(page.read_text()))
        print(f"wrote {page}")


if __name__ == "__main__":
    main()
