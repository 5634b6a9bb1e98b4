"""Write the tables of the manual from the source: layers from their fields, forms and the [fit] table from their options.

    python tools/manual.py          rewrites the marked blocks of docs/
    python tools/manual.py --check  says which are out of date, exit code 1 where one is
    python tools/manual.py --draw   draws the models that no preset shows, where what is printed for them has changed

A block stands between `<!-- table: NAME -->` and `<!-- end -->`. Above the table of a layer is a picture: that of a preset, or one drawn here.
"""

import dataclasses
import json
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import gallery

import layerfit as lf
from layerfit._fields import Param, params
from layerfit.capture.scene import FitRequest, MapRequest
from layerfit.layers import LAYERS
from layerfit.preset import MODELS, preset_of
from layerfit.surfaces import BASES

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"^(<!-- table: (\w+) -->\n).*?^(<!-- end -->)$", re.MULTILINE | re.DOTALL)

SHOWN = {
    "coat": "lacquered_copper",
    "patina": "patinated_copper",
    "deposit": "polished_weathered_brass",
    "overgrowth": "rusted_iron",
    "polish": "polished_weathered_brass",
    "conductor": "brushed_steel",
    "lambert": "clear_coated_red_paint",
    "oren_nayar": "dry_sandstone",
    "car_paint": "car_paint_polaris_silver",
    "flakes": "candy_apple_red",
    "kubelka_munk": "cerulean_blue_enamel",
}
"""A preset of each model."""

COPPER: dict[str, Any] = {"eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}
WOOD = [0.5, 0.28, 0.13]
RUST = lf.read_preset("rusted_iron")
EXAMPLES = {
    "dielectric": lf.Stack((), lf.Dielectric(alpha=0.1, eta=1.5)),
    "phong": lf.Stack((), lf.Phong(kd=WOOD, ks=0.1, exponent=80.0)),
    "blinn": lf.Stack((), lf.Blinn(kd=WOOD, ks=0.1, exponent=300.0)),
    "lafortune": lf.Stack((), lf.Lafortune(kd=WOOD, ks=0.6, cx=-1.0, cz=0.97, exponent=30.0)),
    "torrance_sparrow": lf.Stack((), lf.TorranceSparrow(ks=12.0, kappa=7.0, kd=[0.05, 0.02, 0.01], **COPPER)),
    "cook_torrance": lf.Stack((), lf.CookTorrance(alpha=0.25, ks=0.9, kd=[0.05, 0.02, 0.01], **COPPER)),
    "erosion": dataclasses.replace(RUST, layers=(lf.Erosion(amount_um=15.0), *RUST.layers)),
}
"""A material of each model that no preset shows. Their printed shaders lie in tests/golden, their pictures in docs/images."""

STEPS = {"linear": "value", "log": "log(value)", "softlog": "log(1 + value / {soft:g})"}


def layer(kind: str, cls: type) -> str:
    """A picture, the parameters of a layer, then what it can choose."""
    rows = [("`name`", "text", "", f"`{_field(cls, 'name').default}`", "", _field(cls, "name").metadata["doc"])]
    rows += [_parameter(name, spec) for name, spec in params(cls)]
    for field in dataclasses.fields(cls):
        if choices := field.metadata.get("choices"):
            words = ", ".join(f"`{choice}`" for choice in choices)
            rows.append((f"`{field.name}`", words, "", f"`{choices[0]}`", "", field.metadata["doc"]))
    return f"{_picture(kind)}\n\n{table(('key', 'range', 'unit', 'default', 'the fit steps in', 'meaning'), rows)}"


def _picture(kind: str) -> str:
    """A sphere of a model, and what it is of: a preset, or the layer as a preset has it."""
    if preset := SHOWN.get(kind):
        beside = f"../shaders/presets/{preset}"
        return f"![{preset}]({beside}.png) [{preset}]({beside}.json)"
    document = preset_of(EXAMPLES[kind], kind)
    words = next(part for part in (*document["layers"], document["base"]) if part["type"] == kind)
    return f"![{kind}](images/{kind}.png) `{json.dumps({key: value for key, value in words.items() if key != 'name'})}`"


def draw() -> None:
    """Draw the examples that are printed otherwise than when they were drawn."""
    for kind, stack in EXAMPLES.items():
        shader, path = lf.print_material(stack, kind), DOCS / "images" / f"{kind}.png"
        mark = gallery.stamp(shader.text(gallery.TARGET))
        if gallery.drawn_by(path) != mark:
            path.write_bytes(gallery.picture(shader, mark))
            print(f"drew {path}")


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
    if field.default is dataclasses.MISSING or field.default == ():
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
    **{name: lambda name=name, cls=cls: layer(name, cls) for name, cls in (LAYERS | BASES).items()},
    **{name: lambda cls=cls: options(cls) for name, cls in MODELS.items()},
    "fit": lambda: options(FitRequest),
    "map": lambda: options(MapRequest),
}


def updated(text: str) -> str:
    """A page with its blocks made anew."""

    def made(match: re.Match[str]) -> str:
        if match[2] not in TABLES:
            raise SystemExit(f"there is no table {match[2]!r}; there are {', '.join(TABLES)}")
        return f"{match[1]}{TABLES[match[2]]()}{match[3]}"

    return BLOCK.sub(made, text)


def main() -> None:
    if "--draw" in sys.argv:
        draw()
    stale = [page for page in sorted(DOCS.glob("*.md")) if updated(page.read_text()) != page.read_text()]
    if "--check" in sys.argv:
        sys.exit("".join(f"{page}: tables are out of date; run python tools/manual.py\n" for page in stale) or 0)
    for page in stale:
        page.write_text(updated(page.read_text()))
        print(f"wrote {page}")


if __name__ == "__main__":
    main()
