"""Figures for notebooks. Each draws into the axes that it is given, or into new ones, and returns them. The only file with matplotlib."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .documents import nearest
from .errors import InputError, MachineError
from .fit.result import FitResult
from .render import brdf_values
from .report.tradeoff import error_of, front
from .stack import Stack

if TYPE_CHECKING:
    from matplotlib.axes import Axes  # pyright: ignore[reportMissingImports]  # an extra

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear Rec.709."""


def plot_plane(materials: Stack | Mapping[str, Stack], theta_deg: float = 45.0, *, ax: "Axes | None" = None) -> "Axes":
    """BRDF times the cosine to the light [1/sr], its luminance, in the plane of incidence; one line for each of the named materials.

    Light comes from `theta_deg` degrees, 0 to 89; the viewer goes from -85 to 85 degrees, the mirror side positive. Raises `InputError` for
    another angle, and `MachineError` without the extra `plot`.
    """
    if not 0.0 <= theta_deg < 90.0:
        raise InputError(f"theta_deg = {theta_deg}: should be an angle from 0 to 89 degrees, from the normal")
    ax = _axes(ax)
    angle = np.linspace(-85.0, 85.0, 341)
    wi = np.broadcast_to(_direction(np.array(-theta_deg)), (len(angle), 3))
    named = {"": materials} if isinstance(materials, Stack) else materials
    for name, stack in named.items():
        values = brdf_values(stack, wi.astype(np.float32), _direction(angle).astype(np.float32)) @ LUMINANCE
        ax.plot(angle, values * np.cos(np.radians(theta_deg)), label=name or None)
    ax.set(xlabel="angle of the viewer [degrees]", ylabel="BRDF x cosine [1/sr]", yscale="log")
    ax.set_title(f"in the plane of incidence, light from {theta_deg:g} degrees")
    if any(named):
        ax.legend()
    return ax


def _direction(degrees: np.ndarray) -> np.ndarray:
    """Unit directions (..., 3) in the plane of incidence."""
    t = np.radians(degrees)
    return np.stack([np.sin(t), np.zeros_like(t), np.cos(t)], -1)


def plot_convergence(result: FitResult, *, ax: "Axes | None" = None) -> "Axes":
    """Error of a fit against its run time [s], a line for each start in each stage. Raises `MachineError` without the extra `plot`."""
    ax = _axes(ax)
    lines: dict[tuple[str, int], list[Any]] = {}
    for row in result.trace:
        lines.setdefault((row.stage.split()[0], row.start), []).append(row)
    stages = list(dict.fromkeys(stage for stage, _ in lines))
    for (stage, start), rows in lines.items():
        first = start == min(s for other, s in lines if other == stage)
        style = {"color": f"C{stages.index(stage)}", "marker": ".", "linewidth": 1.0, "label": stage if first else None}
        ax.plot([row.time_s for row in rows], [row.error for row in rows], **style)
    ax.set(xlabel="seconds since the fit began", ylabel="error of the pixels in use, relative", yscale="log")
    ax.legend()
    return ax


def plot_tradeoff(document: Mapping[str, Any], against: str = "exact", *, ax: "Axes | None" = None) -> "Axes":
    """Error against run time of the shaders of a material, as `tradeoff` gives them: named points, and the Pareto front as a line.

    Errors are the 99.9th percentile `against` the "exact" form, or the median against the random "walk". Raises `InputError` for
    another word, and `MachineError` without the extra `plot`.
    """
    if against not in ("exact", "walk"):
        raise InputError(f"against = {against!r}: should be 'exact' or 'walk'")
    ax = _axes(ax)
    points = {row["tier"]: (row["x_phong"], error) for row in document["tiers"] if (error := error_of(row, against))}
    for name, (x, y) in points.items():
        ax.plot(x, y, "o", color="C0")
        ax.annotate(name, (x, y), xytext=(4, 4), textcoords="offset points")
    best = sorted(points[name] for name in front(document["tiers"], against) if name in points)
    ax.plot(*zip(*best, strict=True), color="C1", linewidth=1.0)
    ax.set(xlabel="time, in times of Phong", ylabel=f"relative error against the {against}", xscale="log", yscale="log")
    return ax


def plot_study(
    dataset: Any,
    variable: str = "error",
    against: Sequence[str] = (),
    parameter: str | None = None,
    *,
    ax: "Axes | None" = None,
) -> "Axes":
    """A variable of a `dataset` that `study` gave, `against` one factor (a profile: median and quartiles over all else), two of a grid (a heat map
    of medians), or another variable such as "seconds" (points). Left out, the first two factors of a grid, or the first of another design.

    `parameter` is the fitted entry that is meant, of a variable that has one for each; left out, the worst. Raises `InputError` for names that the
    study does not have, and `MachineError` without the extra `plot`.
    """
    factors = str(dataset.attrs["factors"]).split()
    against = tuple(against) or tuple(factors[: 2 if dataset.attrs["design"] == "grid" else 1])
    known = [*map(str, dataset.data_vars), *factors]
    if unknown := [name for name in (variable, *against) if name not in known]:
        raise InputError(f"plot_study: the study has no {unknown[0]!r}{nearest(unknown[0], known)}; it has {', '.join(known)}")
    values = dataset[variable]
    if "parameter" in values.dims:
        if parameter is not None and parameter not in values["parameter"]:
            raise InputError(f"plot_study: {parameter!r} is not fitted; {', '.join(map(str, values['parameter'].values))} are")
        values = values.max("parameter") if parameter is None else values.sel(parameter=parameter)
    ax = _axes(ax)
    named = f"{variable} of {parameter or 'the worst parameter'}" if "parameter" in dataset[variable].dims else variable
    if len(against) == 2:
        return _heat_map(values, against, named, ax)
    (name,) = against
    if name in factors:
        return _profile(dataset, values, name, named, ax)
    other = dataset[name].max("parameter") if "parameter" in dataset[name].dims else dataset[name]
    ax.plot(np.ravel(other), np.ravel(values), ".")
    ax.set(xlabel=name, ylabel=named, xscale="log", yscale="log")
    return ax


def _heat_map(values: Any, against: Sequence[str], named: str, ax: "Axes") -> "Axes":
    x, y = against
    table = values.median([d for d in values.dims if d not in against]).transpose(y, x)
    image = ax.imshow(np.asarray(table), origin="lower", aspect="auto")
    for name, axis in ((x, ax.xaxis), (y, ax.yaxis)):
        axis.set_ticks(
            range(table.sizes[name]), [f"{v:.3g}" if isinstance(v, float) else str(v) for v in table[name].values.tolist()]
        )
    ax.set(xlabel=x, ylabel=y)
    bar: Any = ax.figure
    bar.colorbar(image, ax=ax, label=named)
    return ax


def _profile(dataset: Any, values: Any, name: str, named: str, ax: "Axes") -> "Axes":
    if name in values.dims:
        rest = [d for d in values.dims if d != name]
        low, middle, high = (np.asarray(values.quantile(q, rest)) for q in (0.25, 0.5, 0.75))
        at = dataset[name].values
        x = at if np.issubdtype(at.dtype, np.number) else np.arange(len(at))
        ax.plot(x, middle, "o-")
        ax.fill_between(x, low, high, alpha=0.25)
        if x is not at:
            ax.set_xticks(x, list(map(str, at)))
    else:
        rest = [d for d in values.dims if d != "point"]
        ax.plot(dataset[name].values, np.asarray(values.median(rest)), ".")
    ax.set(xlabel=name, ylabel=named)
    return ax


def _axes(ax: "Axes | None") -> "Axes":
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        if error.name != "matplotlib":  # one that matplotlib itself needs: another fault
            raise
        raise MachineError("figures need the package matplotlib: pip install 'layerfit[plot]'") from None
    return pyplot.subplots(figsize=(6.0, 4.0), layout="constrained")[1]
