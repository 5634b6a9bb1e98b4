"""Fit the constants of the precise form to the random walk.

    python tools/fit_precise.py make ROWS.npz [--count 600] [--paths 30000] [--seed 1] [--facets beckmann] [--axes] [--two-coats]
    python tools/fit_precise.py fit ROWS.npz [ROWS.npz ...]
    python tools/fit_precise.py check ROWS.npz [ROWS.npz ...] [--model corrected]

`make` walks through random materials (GGX coat .03 to .6 wide, index 1.25 to 2.2, optical depth 0 to 2, over a conductor .05 to .8 wide or
a Lambert base) at random angles, with `--axes` of a width for each axis, with `--two-coats` below a second coat; `fit` prints the constants
of the form; `check` prints how near it is: per row the
sum of |f - truth| cos over that of truth cos, light from below the coat only, as median and 90th percentile over the rows.
"""

import argparse
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from layerfit.forms import bounces, corrected, curves, one_coat, precise, two_coats
from layerfit.layers import Coat
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert
from layerfit.walk import walk_rows

VIEWS = 6
NARROW = 0.2


def make(path: Path, count: int, paths: int, seed: int, facets: str, axes: bool, two_coats: bool) -> None:
    """Half of the rows for each interface; three of four over a conductor."""
    rng = np.random.default_rng(seed)
    log = lambda low, high, n: np.exp(rng.uniform(np.log(low), np.log(high), n))  # noqa: E731
    width = lambda low, high, n: {f"alpha{axis}": log(low, high, n) for axis in (("_x", "_y") if axes else ("",))}  # noqa: E731
    saved: dict[str, np.ndarray] = {}
    for interface in ("single", "multi"):
        for kind, n in (("conductor", count * 3 // 8), ("lambert", count // 8)):
            lacquer = lambda n=n: (  # noqa: E731
                width(0.03, 0.6, n) | {"eta": rng.uniform(1.25, 2.2, n), "tau": rng.uniform(0, 2, n) * (rng.random(n) > 0.25)}
            )
            coats = [lacquer() for _ in range(2 if two_coats else 1)]
            base = {"albedo": rng.uniform(0.2, 0.95, n)}
            if kind == "conductor":
                base = width(0.05, 0.8, n) | {"eta": rng.uniform(0.2, 3.0, n), "k": rng.uniform(1.5, 6.0, n)}
            wi, wo = directions(rng, n, VIEWS)
            flat = lambda table: {key: value.repeat(VIEWS) for key, value in table.items()}  # noqa: E731
            surface = Lambert if kind == "lambert" else Conductor
            layers = [
                layer(Coat, flat(coat), name=name, masking="smith_separable", distribution=facets)
                for name, coat in named(coats)
            ]
            stack = Stack(tuple(layers), layer(surface, flat(base)))
            found = walk_rows(stack, wi.reshape(-1, 3), wo.reshape(-1, 3), paths=paths, seed=seed, interface=interface)
            name = f"{interface}_{kind}"
            columns = {f"{part}_{key}": value for part, of in (*named(coats), ("base", base)) for key, value in of.items()}
            columns |= {"wi": wi[:, 0], "wo": wo}
            saved |= {f"{name}_{key}": value for key, value in columns.items()}
            saved |= {f"{name}_f": found.mean.mean(-1).reshape(n, VIEWS), f"{name}_se": found.se.mean(-1).reshape(n, VIEWS)}
    np.savez_compressed(path, facets=facets, **saved)


NAMES = "coat", "primer"
"""Of the coats, outermost first."""


def named(coats: list[Any]) -> list[tuple[str, Any]]:
    return list(zip(NAMES, coats, strict=False))


def layer(kind: Any, values: dict[str, Any], **choices: Any) -> Any:
    """A layer of these numbers, with one width or two."""
    return kind(**({"alpha": None} if "alpha_x" in values else {}) | values, **choices)


def directions(rng: np.random.Generator, n: int, views: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, views, 3) each: of n lights up to 80 degrees, and of views, half of them about the mirror direction, where the light is."""
    wi = _directions(rng, rng.uniform(0.0, np.radians(80.0), n))[:, None].repeat(views, 1)
    wo = _directions(rng, np.arccos(rng.uniform(0.15, 1.0, (n, views))))
    near = wi[:, : views // 2] * [-1.0, -1.0, 1.0] + 0.25 * rng.normal(size=(n, views // 2, 3))
    near[..., 2] = np.maximum(np.abs(near[..., 2]), 0.15)
    wo[:, : views // 2] = near / np.linalg.norm(near, axis=-1, keepdims=True)
    return wi, wo


def _directions(rng: np.random.Generator, theta: np.ndarray) -> np.ndarray:
    phi = rng.uniform(0.0, 2.0 * np.pi, theta.shape)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def facets_of(paths: list[Path]) -> str:
    """Distribution of the facets of the coats, of all files the same."""
    (found,) = {str(np.load(path).get("facets", "ggx")) for path in paths}
    return found


def rows(paths: list[Path], interface: str, kind: str) -> dict[str, np.ndarray]:
    """All rows of one kind."""
    files = [np.load(path) for path in paths]
    prefix = f"{interface}_{kind}_"
    keys = [key.removeprefix(prefix) for key in files[0] if key.startswith(prefix)]
    return {key: np.concatenate([file[prefix + key] for file in files]).astype(np.float32) for key in keys}


def form(row: dict[str, Any], interface: str, kind: str, facets: str = "ggx", model: str = "precise") -> Any:
    """Light from below the coat, (rows, views)."""
    part = lambda name: {key.removeprefix(f"{name}_"): value for key, value in row.items() if key.startswith(f"{name}_")}  # noqa: E731
    coats = tuple(layer(Coat, part(name), name=name, distribution=facets) for name in NAMES if part(name))

    def one(coats: tuple[Coat, ...], base: Any, wi: Any, wo: Any) -> Any:
        options: Any = precise.Precise(interface) if model == "precise" else corrected.Corrected()
        p: Any = (precise if model == "precise" else corrected).prepare(coats, base, options)

        def pair(wo: Any) -> Any:
            if model == "corrected":
                return corrected.evaluate(p, wi, wo, options) - coats[0].evaluate(wi, wo)
            if len(coats) == 2:
                return two_coats.below(p, wi, wo)
            return one_coat.below(one_coat.cross(p, wi), one_coat.cross(p, wo), p)

        return jax.vmap(pair)(wo)

    surface = Lambert if kind == "lambert" else Conductor
    return jax.vmap(one)(coats, layer(surface, part("base")), row["wi"], row["wo"])


def error(f: np.ndarray, row: dict[str, np.ndarray]) -> np.ndarray:
    mu = row["wo"][..., 2]
    return np.sum(np.abs(f - row["f"]) * mu, -1) / np.sum(row["f"] * mu, -1)


def check(paths: list[Path], model: str) -> None:
    value = jax.jit(form, static_argnums=(1, 2, 3, 4))
    for interface in ("single", "multi"):
        for kind in ("lambert", "conductor"):
            row = rows(paths, interface, kind)
            # Of the corrected form the top lobe is taken off, which may be far more than what is left: too much for float32.
            with jax.enable_x64(model == "corrected"):
                exact = {key: column.astype(float) for key, column in row.items()}
                errors = error(np.asarray(value(exact, interface, kind, facets_of(paths), model)), row)
            noise = np.median(np.sum(row["se"] * row["wo"][..., 2], -1) / np.sum(row["f"] * row["wo"][..., 2], -1))
            parts = {"all": errors}
            if "base_alpha" in row:
                parts["narrow bases"] = errors[row["base_alpha"] < NARROW]
            if "primer_eta" in row:
                denser = row["primer_eta"] >= row["coat_eta"]
                parts |= {"denser below": errors[denser], "rarer below": errors[~denser]}
            for name, values in parts.items():
                p50, p90 = np.quantile(values, [0.5, 0.9])
                print(
                    f"{interface:7} {kind:10} {name:13} {len(values):5} rows  p50 {p50:.3f}  p90 {p90:.3f}  (noise {noise:.3f})"
                )


CONSTANTS = {
    "WIDTH": (curves,),
    "BOTH": (curves,),
    "AGAIN": (bounces,),
    "CONDENSE": (one_coat,),
    "RISE": (one_coat,),
    "RATIO": (one_coat,),
    "TAIL": (one_coat,),
    "DIRECT": (one_coat,),
}
"""By name, with the modules that read them."""


def fit(paths: list[Path]) -> None:
    """Levenberg-Marquardt on a smooth form of the error, constants scaled by their present values."""
    start = {name: getattr(modules[0], name) for name, modules in CONSTANTS.items()}
    names, origin = list(start), np.array(list(start.values()))
    _loosen()
    sets = [(i, {key: jnp.asarray(x) for key, x in rows(paths, i, "conductor").items()}) for i in ("single", "multi")]

    def residual(x: Any) -> Any:
        _set(dict(zip(names, x * jnp.asarray(origin, jnp.float32), strict=True)))
        parts = []
        for interface, row in sets:
            mu = row["wo"][..., 2]
            r = (form(row, interface, "conductor") - row["f"]) * mu / np.sum(row["f"] * mu, -1, keepdims=True)
            parts.append(r.ravel())
        return jnp.concatenate(parts) * VIEWS

    value = jax.jit(residual)
    column = jax.jit(lambda x, along: jax.jvp(residual, (x,), (along,))[1])
    # A column at a time: all at once take more memory than there is.
    jacobian = lambda x: np.stack([np.asarray(column(x, along)) for along in np.eye(len(names), dtype=np.float32)], 1)  # noqa: E731
    found = least_squares(
        lambda x: np.asarray(value(jnp.asarray(x, jnp.float32)), float),
        np.ones(len(names)),
        jac=lambda x: np.asarray(jacobian(jnp.asarray(x, jnp.float32)), float),
        loss="soft_l1",
        f_scale=0.2,
        bounds=(0.3, 3.0),
        max_nfev=60,
    )
    for name, old, new in zip(names, origin, found.x * origin, strict=True):
        print(f"{name:16} {old:10.5g} -> {new:.5g}")
    print(f"cost {found.cost:.4g}")


def _loosen() -> None:
    """Let constants be traced: functions without their caches."""
    for module in (one_coat, two_coats, bounces, curves):
        for name, value in vars(module).items():
            if hasattr(value, "__wrapped__") and hasattr(value, "lower"):
                setattr(module, name, value.__wrapped__)


def _set(values: dict[str, Any]) -> None:
    for name, modules in CONSTANTS.items():
        for module in modules:
            setattr(module, name, values[name])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", choices=("make", "fit", "check"))
    parser.add_argument("rows", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--paths", type=int, default=30000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--facets", choices=("ggx", "beckmann"), default="ggx", help="of the coat")
    parser.add_argument("--axes", action="store_true", help="widths along the tangent and across it")
    parser.add_argument("--two-coats", action="store_true", help="a second coat below the first")
    parser.add_argument("--model", choices=("precise", "corrected"), default="precise", help="form to check")
    arguments = parser.parse_args()
    if arguments.command == "make":
        make(
            arguments.rows[0],
            arguments.count,
            arguments.paths,
            arguments.seed,
            arguments.facets,
            arguments.axes,
            arguments.two_coats,
        )
    elif arguments.command == "fit":
        fit(arguments.rows)
    else:
        check(arguments.rows, arguments.model)


if __name__ == "__main__":
    main()
