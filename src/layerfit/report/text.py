"""The report of a fit in the terminal: lmfit's blocks, with what an image can and cannot tell beside them."""

from collections.abc import Mapping
from typing import Any

import numpy as np


def lines(document: Mapping[str, Any]) -> list[str]:
    """The blocks of a `fit.json` document as text."""
    d = document
    error, seconds = d["error"], d["time"]
    out = ["[[Fit]]"]
    out += _rows(
        {
            "converged": "yes" if d["converged"] else "NO",
            "flags": ", ".join(d["flags"]) or "none",
            "error": f"{error['rel_l2']:.3g} relative L2, PSNR {error['psnr_db']:.1f} dB, SSIM {error['ssim']:.4f}, "
            f"delta E 2000 {error['delta_e']:.2f}",
            "pixels": f"{d['pixels']['used']} used{_dropped(d['pixels']['dropped'])}",
            "starts": f"{d['starts']}, of which {_same_minimum(d['minima'])} reached this minimum",
        }
    )
    out += ["[[Parameters]]"]
    for name, row in d["parameters"].items():
        notes = []
        if row.get("at_bound"):
            notes.append(f"at its {row['at_bound']} bound")
        if row.get("identifiable") is False:
            notes.append("not identifiable")
        if "derived" in row:
            notes.append(f"= {row['derived']}")
        start = f"  (start {number(row['start'])})" if "start" in row else ""
        unit = f" {row['unit']}" if row.get("unit", "1") != "1" else ""
        out.append(
            f"    {name + ':':<26} {number(row['value'])} +/- {number(row['sigma'])}{unit}{start}{'  ' * bool(notes)}{', '.join(notes)}"
        )
    if d["correlations"]:
        out += ["[[Correlations]] (below 0.5 are not listed)"]
        out += [f"    C({a}, {b}) = {r:+.3f}" for a, b, r in d["correlations"][:12]]
    if d["unidentified"] or d["notes"]:
        out += ["[[Identifiability]]"]
        out += [f"    {row['why']}" for row in d["unidentified"]]
        out += [f"    {note}" for note in d["notes"]]
    if d["left_out"]:
        out += ["[[Left out]]", f"    {', '.join(d['left_out'])}"]
    if d["parity"]:
        parity = d["parity"]
        out += ["[[Shader]]", f"    against JAX: max {parity['max_rel']:.1e}, p99.9 {parity['p999_rel']:.1e} relative"]
    out += ["[[Time]]"]
    total = seconds["total_s"]
    shares = ", ".join(f"{key[:-2]} {seconds[key]:.2f} s" for key in seconds if key != "total_s")
    out.append(f"    {total:.2f} s in all: {shares}; {d['steps']} steps")
    return out


def _rows(rows: Mapping[str, str]) -> list[str]:
    return [f"    {key + ':':<12} {value}" for key, value in rows.items()]


def number(value: Any) -> str:
    """A value, a colour or an unknown, in four digits."""
    if value is None:
        return "unknown"
    if isinstance(value, list):
        return "[" + ", ".join(number(v) for v in value) + "]"
    return f"{value:.4g}"


def _dropped(dropped: list[Mapping[str, int]]) -> str:
    total: dict[str, int] = {}
    for view in dropped:
        for reason, count in view.items():
            total[reason] = total.get(reason, 0) + count
    return "; left out: " + ", ".join(f"{count} {reason}" for reason, count in total.items()) if total else ""


def _same_minimum(minima: list[Mapping[str, float]]) -> int:
    costs = np.array([m["cost"] for m in minima])
    return int(np.sum(costs <= costs.min() * 1.02 + 1e-9))
