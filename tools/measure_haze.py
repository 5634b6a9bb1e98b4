"""Measure how near the corrected form is to the random walk where a coat scatters.

    python tools/measure_haze.py make ROWS.npz [--count 240] [--paths 12000] [--seed 1] [--interface multi]
    python tools/measure_haze.py check ROWS.npz [ROWS.npz ...]

`make` walks through random materials (GGX coat .03 to .6 wide, index 1.25 to 2; optical depth 0 to 4, of which a part from 0 to 1 scatters, of
mean cosine -.5 to .9; over a Lambert base or a conductor .05 to .8 wide) at random angles. `check` prints, as median and 90th percentile
over materials, the sum of |f - truth| cos over that of truth cos, of light from below the coat's top, and the noise in it.
"""

import argparse
from pathlib import Path
from typing import Any

import jax
import numpy as np
from fit_precise import directions

from layerfit.forms.corrected import Corrected
from layerfit.layers import Coat
from layerfit.render import brdf
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert
from layerfit.walk import Haze, walk_rows

VIEWS = 8
BASES: dict[str, type] = {"lambert": Lambert, "conductor": Conductor}
COAT = ("alpha", "eta", "tau", "tau_s", "g")


def make(path: Path, count: int, paths: int, seed: int, interface: Any) -> None:
    """Half of the materials over each base."""
    rng = np.random.default_rng(seed)
    log = lambda low, high, n: np.exp(rng.uniform(np.log(low), np.log(high), n))  # noqa: E731
    saved: dict[str, np.ndarray] = {}
    for kind, cls in BASES.items():
        n = count // 2
        depth, albedo = rng.uniform(0.0, 4.0, n), rng.uniform(0.0, 1.0, n)
        coat = {"alpha": log(0.03, 0.6, n), "eta": rng.uniform(1.25, 2.0, n), "tau": depth * (1.0 - albedo)}
        haze = {"tau": depth * albedo, "g": rng.uniform(-0.5, 0.9, n)}
        base = {"albedo": rng.uniform(0.0, 0.95, n)}
        if kind == "conductor":
            base = {"alpha": log(0.05, 0.8, n), "eta": rng.uniform(0.2, 3.0, n), "k": rng.uniform(1.5, 6.0, n)}
        wi, wo = directions(rng, n, VIEWS)
        flat = lambda table: {key: value.repeat(VIEWS) for key, value in table.items()}  # noqa: E731
        stack = Stack((Coat(**flat(coat), masking="smith_separable"),), cls(**flat(base)))
        scatters = {"coat": Haze(**flat(haze))}
        found = walk_rows(
            stack, wi.reshape(-1, 3), wo.reshape(-1, 3), paths=paths, seed=seed, interface=interface, haze=scatters
        )
        columns = coat | {"tau_s": haze["tau"], "g": haze["g"]} | {f"base_{key}": value for key, value in base.items()}
        columns |= {"wi": wi, "wo": wo, "f": found.mean[:, 0].reshape(n, VIEWS), "se": found.se[:, 0].reshape(n, VIEWS)}
        saved |= {f"{kind}_{key}": value for key, value in columns.items()}
    np.savez_compressed(path, **saved)


def rows(paths: list[Path], kind: str) -> dict[str, np.ndarray]:
    """All rows over one base."""
    files = [np.load(path) for path in paths]
    keys = [key.removeprefix(f"{kind}_") for key in files[0] if key.startswith(f"{kind}_")]
    return {key: np.concatenate([file[f"{kind}_{key}"] for file in files]) for key in keys}


def form(row: dict[str, Any], kind: str, options: Corrected) -> np.ndarray:
    """Light from below the coat's top, (rows, views)."""
    coat = Coat(**{key: row[key] for key in COAT})
    base = BASES[kind](**{key.removeprefix("base_"): row[key] for key in row if key.startswith("base_")})

    def one(stack: Stack, wi: Any, wo: Any) -> Any:
        top = jax.vmap(stack.layers[0].evaluate)(wi, wo)
        return brdf(stack, wi, wo)[:, 0] - top

    return np.asarray(jax.jit(jax.vmap(one))(Stack((coat,), base, options), row["wi"], row["wo"]))


def relative(difference: np.ndarray, row: dict[str, Any]) -> np.ndarray:
    """Summed over the views of every row, over the light there."""
    cosine = row["wo"][..., 2]
    return np.sum(np.abs(difference) * cosine, 1) / np.sum(row["f"] * cosine, 1)


def check(paths: list[Path]) -> None:
    """The form with and without what it does beyond single scattering."""
    print(f"{'':<34}{'rows':>6}{'p50':>8}{'p90':>8}")
    for kind in BASES:
        row = rows(paths, kind)
        lines = {"noise": np.sqrt(2.0 / np.pi) * row["se"]}
        lines |= {name: form(row, kind, options) - row["f"] for name, options in FORMS.items()}
        kept = {
            "": row["g"] > -1.0,
            ", g < .7": row["g"] < 0.7,
            ", g < .7, alpha < .15": (row["g"] < 0.7) & (row["alpha"] < 0.15),
        }
        for name, difference in lines.items():
            for which, some in kept.items():
                error = relative(difference, row)[some]
                print(f"{kind + ', ' + name + which:<42}{len(error):>6}{np.median(error):8.3f}{np.quantile(error, 0.9):8.3f}")


FORMS = {"corrected": Corrected(), "single scattering": Corrected(multiple=False)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make")
    making.add_argument("path", type=Path)
    making.add_argument("--count", type=int, default=240)
    making.add_argument("--paths", type=int, default=12000)
    making.add_argument("--seed", type=int, default=1)
    making.add_argument("--interface", choices=("single", "multi"), default="multi")
    commands.add_parser("check").add_argument("paths", type=Path, nargs="+")
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", given.command == "check")
    if given.command == "make":
        make(given.path, given.count, given.paths, given.seed, given.interface)
    else:
        check(given.paths)


if __name__ == "__main__":
    main()
