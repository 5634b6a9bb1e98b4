"""What a fit has to bring back from path-traced renders of known materials, each with its limit and what was reached.

    python benchmarks/targets.py FOLDER [--only NAME]

A folder of renders with everything that is known of them in `NAME.json`; see `renders.py`. Renders whose names end in _t1, _t2, ... are one
material at so many times the thickness, fitted together: their optical depths within 3 %, below .05 within 10 %. Of a diffuse base under a
coat of known depth: its albedo within 1 %. Of a coat of a width of .25 or more: its index within .15. Of depths of 4 or more: a lower limit
below the truth.
"""

import argparse
import dataclasses
import itertools
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from renders import Render, renders

import layerfit as lf

WIDE = 0.25
DEEP = 4.0


@dataclasses.dataclass(frozen=True)
class Target:
    """One demand: how far off the value is, and the corrected value, over how far they may be."""

    render: str
    what: str
    value: float
    corrected: float
    told: str

    def __str__(self) -> str:
        met = "met" if self.value <= 1.0 else "met when corrected" if self.corrected <= 1.0 else "MISSED"
        return f"| {self.render} | {self.what} | {self.told} | {self.value:.2f} | {self.corrected:.2f} | {met} |"


def fitted(group: Sequence[Render], thickness: Sequence[float], fixed: dict[str, Any] | None = None) -> dict[str, Any]:
    """Parameters of a fit of one render, or of several at so many times the thickness."""
    views = [view for render in group for view in lf.load(render.scene)]
    views = [
        dataclasses.replace(view, reference=dataclasses.replace(view.reference, thickness_scale={"coat": scale}))
        for view, scale in zip(views, thickness, strict=True)
    ]
    return lf.parameters(lf.fit(views, group[0].scene.start, fixed=fixed, model_error=True))


def demand(render: str, what: str, row: dict[str, Any], wanted: Any, allowed: Any) -> Target:
    """A demand on all channels of a parameter: the worst of them counts."""
    off = [float(np.max(np.abs(np.subtract(row[key], wanted)) / allowed)) for key in ("value", "corrected")]
    told = ", ".join(f"{v:.4g} ({w:.4g})" for v, w in zip(np.atleast_1d(row["value"]), np.atleast_1d(wanted), strict=True))
    return Target(render, what, *off, told)


def targets(cases: Sequence[Render]) -> Iterator[Target]:
    """The demands on some renders, and how they are met."""
    series = lambda render: re.sub(r"_t[0-9]+$", "", render.name)  # noqa: E731
    for name, members in itertools.groupby(sorted(cases, key=series), series):
        group = list(members)
        if len(group) > 1:
            times = [int(render.name.rpartition("_t")[2]) for render in group]
            wanted = np.asarray(group[0].truth["coat.tau"]) / times[0]
            allowed = np.where(wanted < 0.05, 0.1, 0.03) * wanted
            yield demand(name, f"depth, {len(group)} thicknesses", fitted(group, times)["coat.tau"], wanted, allowed)
    for case in cases:
        truth = case.truth
        if "base.albedo" in truth and max(truth.get("coat.tau", [DEEP])) < DEEP:
            row = fitted([case], [1.0], {"coat.tau": truth["coat.tau"]})["base.albedo"]
            yield demand(case.name, "albedo, depth known", row, truth["base.albedo"], 0.01 * np.asarray(truth["base.albedo"]))
        if "coat.eta" in truth and truth["coat.alpha"] >= WIDE:
            yield demand(case.name, "index of a wide coat", fitted([case], [1.0])["coat.eta"], truth["coat.eta"], 0.15)
        if min(truth.get("coat.tau", [0.0])) >= DEEP:
            yield limit(case, fitted([case], [1.0])["coat.tau"])


def limit(case: Render, row: dict[str, Any]) -> Target:
    """Whether every depth is told as a lower limit below the truth."""
    ends = row.get("interval_95") or [None] * 3
    held = [
        end is not None and end[1] is None and 0.0 < (end[0] or 0.0) <= w
        for end, w in zip(ends, case.truth["coat.tau"], strict=True)
    ]
    told = ", ".join("none" if end is None else f"{end[0]} to {end[1] or 'any'}" for end in ends)
    return Target(case.name, "a lower limit", *2 * [0.0 if all(held) else 9.99], told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="part of the names of the renders")
    asked = parser.parse_args()
    lf.use_compilation_cache()
    print("| render | what | found (true) | off, of what is allowed | corrected | |\n| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as scratch:
        cases = [
            case for case in renders(asked.folder, Path(scratch)) if asked.only in case.name and "coat.alpha" in case.truth
        ]
        for target in targets([case for case in cases if "coat.tau" in case.truth]):
            print(target, flush=True)


if __name__ == "__main__":
    main()
