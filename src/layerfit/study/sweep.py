"""`layerfit study`: many trials of one material, by a design, as one labelled array. The only file that imports xarray.

Each trial is a line of a journal when it is known: what is interrupted goes on after the last, as a batch does.
"""

import csv
import dataclasses
import hashlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..batch.table import Journal
from ..documents import check_directory, check_keys, nearest, read_document, write_files
from ..errors import InputError, LayerfitError, MachineError
from ..preset import preset_of, read_preset, stack_of
from ..stack import Stack
from ..truth import below, check, forms_of, hemisphere, relative_error, walked
from ..walk import interface_of
from .design import Factor, designed, factor_of
from .trial import FIT, REFERENCE, Setting, at_point, refound

if TYPE_CHECKING:
    from xarray import Dataset  # pyright: ignore[reportMissingImports]  # an extra

Measure = Callable[[Stack, dict[str, Any]], Mapping[str, float]]
Progress = Callable[[int, int, int], None]

JOURNAL = "study.jsonl"
MEASURES = ("fit", "walk")
WALK_PATHS = 2000
"""Of each pair of directions, unless told otherwise."""
WALK_DEG = (0.0, 30.0, 60.0)
"""Incidence of the light in which forms are held against the walk."""
KEYS = ("material", "design", "points", "repeats", "seed", "measure", "free", "paths")


@dataclasses.dataclass(frozen=True)
class Plan:
    """A study, read and checked."""

    stack: Stack
    factors: tuple[Factor, ...]
    design: str
    points: list[dict[str, Any]]
    repeats: int
    seed: int
    measure: str
    free: tuple[str, ...] | None
    paths: int
    setting: Setting


def study(
    plan: str | Path | Mapping[str, Any],
    directory: str | Path | None = None,
    *,
    measure: Measure | None = None,
    progress: Progress = lambda done, failed, total: None,
) -> "Dataset":
    """Vary a material, its reference or its fit by a design, and measure each point: an xarray Dataset, and files in `directory`.

    `plan` is a study file (TOML or JSON), or the same as a mapping: `study` with material, design ("grid", "latin" or "sobol"), points,
    repeats, seed, measure ("fit": draw and find again; "walk": the forms against the random walk, with so many `paths`) and free; `vary`, a list of
    values or a range by name; `reference` and `fit`, what is the same in all points. `measure` is a function in place of that: it is given the
    material of a point and the point, and gives numbers by name. A grid has a dimension for each factor, another design one, `point`; several
    `repeats`, with noise of their own, are a dimension too. Trials that fail are NaN, with the message in the attribute `failures`. With a
    directory, trials that are done are kept there, the same call goes on after them, and it leaves `study.nc` and `study.csv`. Raises
    `InputError` for a plan at fault, and `MachineError` without the extra `study`.
    """
    xarray = _xarray()
    made = read_plan(plan)
    trials = [(k, repeat) for k in range(len(made.points)) for repeat in range(made.repeats)]
    where = "study" if isinstance(plan, Mapping) else str(plan)
    for point in made.points:
        at_point(made.stack, made.setting, point, f"{where}: vary")  # before any work is done
    if directory is not None:
        check_directory(Path(directory))
    kept = None if directory is None else Journal(Path(directory) / JOURNAL)
    rows, failed = [], 0
    for k, repeat in trials:
        rows.append(_kept_trial(made, k, repeat, measure, kept))
        failed += rows[-1]["error"] is not None
        progress(len(rows) - failed, failed, len(trials))
    dataset = _dataset(xarray, made, rows)
    if directory is not None:
        write_files(Path(directory), {"study.nc": _netcdf(dataset), "study.csv": _csv(made, trials, rows)})
    return dataset


def _xarray() -> Any:
    try:
        import xarray  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError:
        raise MachineError("a study gives an array of the package xarray: pip install 'layerfit[study]'") from None
    return xarray


def read_plan(plan: str | Path | Mapping[str, Any]) -> Plan:
    """A study file, or the same as a mapping. Raises `InputError` naming the key at fault."""
    document = plan if isinstance(plan, Mapping) else read_document(Path(plan))
    folder, where = (Path(), "study") if isinstance(plan, Mapping) else (Path(plan).parent, str(plan))
    check_keys(document, ("study", "vary", "reference", "fit"), where)
    asked = document.get("study", {})
    check_keys(asked, KEYS, f"{where}: study")
    if not isinstance(document.get("vary"), Mapping) or not document["vary"]:
        raise InputError(f'{where}: there is no [vary]; name what varies, such as "coat.alpha" = [0.05, 0.1, 0.2]')
    factors = tuple(factor_of(name, said, f"{where}: vary.{name}") for name, said in document["vary"].items())
    measure = asked.get("measure", "fit")
    if measure not in MEASURES:
        raise InputError(
            f"{where}: study.measure = {measure!r}: should be one of {', '.join(MEASURES)}{nearest(str(measure), MEASURES)}"
        )
    numbers = {key: asked.get(key, default) for key, default in (("repeats", 1), ("seed", 0), ("paths", WALK_PATHS))}
    for key, value in numbers.items():
        if not isinstance(value, int) or isinstance(value, bool) or not (0 if key == "seed" else 1) <= value <= 2**31:
            raise InputError(
                f"{where}: study.{key} = {value!r}: should be a whole number{'' if key == 'seed' else ', at least 1'}"
            )
    design = asked.get("design", "grid")
    points = designed(factors, str(design), asked.get("points"), numbers["seed"], f"{where}: study")
    stack = _material(asked.get("material"), folder, f"{where}: study.material")
    setting = Setting()
    for group, known in (("reference", REFERENCE), ("fit", FIT)):
        table = document.get(group, {})
        check_keys(table, known, f"{where}: {group}")
        setting = at_point(stack, setting, {f"{group}.{key}": value for key, value in table.items()}, f"{where}: {group}")[1]
    free = None if asked.get("free") is None else tuple(asked["free"])
    return Plan(
        stack, factors, str(design), points, numbers["repeats"], numbers["seed"], measure, free, numbers["paths"], setting
    )


def _material(said: Any, folder: Path, where: str) -> Stack:
    if isinstance(said, Stack):
        return said
    if isinstance(said, Mapping):
        return stack_of(said, where)
    if not isinstance(said, str):
        raise InputError(f"{where} = {said!r}: should be the name or the file of a preset, or a table of layers and base")
    return read_preset(folder / said)


def _key(plan: Plan, k: int, repeat: int, measure: Measure | None) -> str:
    """What a trial depends on."""
    from .. import __version__

    what = (
        __version__,
        json.dumps(preset_of(plan.stack, "study")),
        sorted(plan.points[k].items()),
        repeat,
        plan.seed,
        plan.measure if measure is None else f"{measure.__module__}.{measure.__qualname__}",
        plan.free,
        plan.paths,
        plan.setting,
    )
    return hashlib.sha256(repr(what).encode()).hexdigest()[:24]


def _kept_trial(plan: Plan, k: int, repeat: int, measure: Measure | None, kept: Journal | None) -> dict[str, Any]:
    """The row of a trial, from the journal where it is there."""
    if kept is None:
        return _trial(plan, plan.points[k], repeat, measure)
    key = _key(plan, k, repeat, measure)
    if not kept.done(key):
        kept.write([(key, _trial(plan, plan.points[k], repeat, measure))])
    return kept.rows([key])[0]


def _trial(plan: Plan, point: dict[str, Any], repeat: int, measure: Measure | None) -> dict[str, Any]:
    """What is measured at a point, with `error` None, or the message of what was at fault."""
    try:
        return {"error": None, **_measured(plan, point, repeat, measure)}
    except LayerfitError as error:
        return {"error": str(error)}


def _measured(plan: Plan, point: dict[str, Any], repeat: int, measure: Measure | None) -> dict[str, Any]:
    stack, setting = at_point(plan.stack, plan.setting, point, "study: vary")
    if measure is not None:
        return {name: float(value) for name, value in measure(stack, point).items()}
    if plan.measure == "walk":
        return _against_walk(stack, plan.paths, plan.seed + repeat)
    return refound(stack, setting, plan.free, plan.seed + repeat)


def _against_walk(stack: Stack, paths: int, seed: int) -> dict[str, float]:
    """Relative error of each form against the random walk, of light from below the coats: the median over directions of light and channels."""
    interface = interface_of(stack)
    check(stack, "the material of a point", interface)
    fans = [hemisphere(angle) for angle in WALK_DEG]
    walks = [walked(stack, fan, paths, interface, seed) for fan in fans]
    errors: dict[str, Any] = {}
    for name, form in forms_of(stack, interface).items():
        values = below(dataclasses.replace(stack, form=form), fans)
        rows = [relative_error(f, walk, fan) for f, walk, fan in zip(values, walks, fans, strict=True)]
        errors[name] = float(np.nanmedian(rows))
    return errors


def _dataset(xarray: Any, plan: Plan, rows: Sequence[Mapping[str, Any]]) -> "Dataset":
    """Rows of trials as arrays over the design, the repeats and, where there are any, the fitted parameters."""
    names = list(dict.fromkeys(name for row in rows for name in row if name not in ("rows", "error")))
    dims, coords, shape = _axes(plan)
    variables: dict[str, Any] = {}
    for name in names:
        values = np.array([_number(row.get(name)) for row in rows])
        variables[name] = (dims, values.reshape(shape))
    entries = list(dict.fromkeys(entry for row in rows for entry in row.get("rows", {})))
    for name in ("value", "sigma", "truth", "error") if entries else ():
        values = np.array([[_number(row.get("rows", {}).get(entry, {}).get(name)) for entry in entries] for row in rows])
        variables[name] = ((*dims, "parameter"), values.reshape(*shape, len(entries)))
    coords |= {"parameter": entries} if entries else {}
    failures = [f"{k}: {row['error']}" for k, row in enumerate(rows) if row["error"]]
    factors = " ".join(factor.name for factor in plan.factors)
    return xarray.Dataset(
        variables, coords, {"design": plan.design, "factors": factors, "measure": plan.measure, "failures": "\n".join(failures)}
    )


def _number(value: Any) -> float:
    """NaN for what is not there: a journal has no word for it."""
    return np.nan if value is None else float(value)


def _axes(plan: Plan) -> tuple[tuple[str, ...], dict[str, Any], tuple[int, ...]]:
    """Dimensions, coordinates and shape of the trials, the repeats last."""
    repeats = (("repeat",), (plan.repeats,)) if plan.repeats > 1 else ((), ())
    if plan.design == "grid":
        coords = {factor.name: [_label(level) for level in factor.levels] for factor in plan.factors}
        return (*coords, *repeats[0]), dict(coords), (*(len(levels) for levels in coords.values()), *repeats[1])
    coords = {factor.name: ("point", [_label(point[factor.name]) for point in plan.points]) for factor in plan.factors}
    return ("point", *repeats[0]), dict(coords), (len(plan.points), *repeats[1])


def _label(value: Any) -> Any:
    return " ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else value


def _netcdf(dataset: "Dataset") -> bytes:
    """The file that xarray reads again; by SciPy, which is there: names of dimensions hold no dots in it."""
    plain = dataset.rename({name: str(name).replace(".", "_") for name in dataset.coords if "." in str(name)})
    return bytes(plain.to_netcdf(engine="scipy"))


def _csv(plan: Plan, trials: Sequence[tuple[int, int]], rows: Sequence[Mapping[str, Any]]) -> str:
    """One line a trial, entries of the fit as columns such as `error coat.alpha`."""
    lines = [
        {**{name: _label(v) for name, v in plan.points[k].items()}, "repeat": repeat, **dict(_columns(row))}
        for (k, repeat), row in zip(trials, rows, strict=True)
    ]
    out = io.StringIO()
    table = csv.DictWriter(out, list(dict.fromkeys(name for line in lines for name in line)), lineterminator="\n")
    table.writeheader()
    table.writerows(lines)
    return out.getvalue()


def _columns(row: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    yield from ((name, value) for name, value in row.items() if name != "rows")
    for entry, numbers in row.get("rows", {}).items():
        yield from ((f"{name} {entry}", value) for name, value in numbers.items())
