"""What a file with a measured BRDF holds, and what to know before fitting it."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import Finding
from .data import MeasuredBrdf, half_angle

if TYPE_CHECKING:
    from rich.console import Group

SPIKE = 1.5
"""Half angle [degrees] below which an instrument of some degrees of aperture blurs the image of its own lamp."""

SHARP = 10.0
"""How much brighter the spike is than its surroundings where it is one."""

CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class MeasuredInspection:
    """A measured BRDF and what was found of it."""

    brdf: MeasuredBrdf
    findings: list[Finding]

    def to_json(self) -> dict[str, Any]:
        """Plain values only."""
        brdf = self.brdf
        return {
            "schema": "layerfit/inspect",
            "version": 1,
            "file": str(brdf.path),
            "kind": brdf.kind,
            "description": brdf.description,
            "layout": brdf.layout,
            "isotropic": brdf.isotropic,
            "samples": len(brdf.f),
            "dropped": brdf.dropped,
            "clipped_channels": brdf.clipped,
            "ranges": {name: list(ends) for name, ends in ranges(brdf).items()},
            "findings": [asdict(finding) for finding in self.findings],
        }

    def render(self) -> "Group":
        """Tables for a terminal: what is there, what to know."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        brdf = self.brdf
        there = Table(title=Text(f"{brdf.path.name}: {brdf.kind}", "bold"), title_justify="left", show_header=False, box=None)
        rows = {"sample": brdf.description} if brdf.description else {}
        rows |= {key.replace("_", " "): _listed(value) for key, value in brdf.layout.items()}
        rows |= {"azimuths": "a difference: isotropic" if brdf.isotropic else "of light and view: anisotropic"}
        rows |= {"samples": f"{len(brdf.f)}{''.join(f'; {n} {why}' for why, n in brdf.dropped.items())}"}
        rows |= {name: f"{low:.4g} to {high:.4g}" for name, (low, high) in ranges(brdf).items()}
        for name, value in rows.items():
            there.add_row(Text(name, "dim"), Text(value))
        if not self.findings:
            return Group(there)
        found = Table(title=Text("Findings", "bold"), title_justify="left", header_style="dim", box=None, pad_edge=False)
        for heading in ("", "what", "measured", "advice"):
            found.add_column(heading, overflow="fold")
        for finding in self.findings:
            style = "yellow" if finding.severity == "warning" else ""
            found.add_row(Text(finding.severity, style), Text(finding.what), Text(finding.detail), Text(finding.advice))
        return Group(there, Text(), found)


def _listed(value: Any) -> str:
    return ", ".join(f"{v:g}" for v in value) if isinstance(value, list) else str(value)


def ranges(brdf: MeasuredBrdf) -> dict[str, tuple[float, float]]:
    """Least and largest angle and value."""
    theta = {name: np.degrees(np.arccos(np.clip(w[:, 2], 0.0, 1.0))) for name, w in (("light", brdf.wi), ("view", brdf.wo))}
    found = {f"angle of {name} [deg]": values for name, values in theta.items()}
    found["half angle [deg]"] = np.degrees(half_angle(brdf.wi, brdf.wo))
    found |= {f"{name} [1/sr]": brdf.f[:, c] for c, name in enumerate(CHANNELS)}
    return {name: (float(f"{values.min():.5g}"), float(f"{values.max():.5g}")) for name, values in found.items()}


def inspect_brdf(brdf: MeasuredBrdf) -> MeasuredInspection:
    """All findings of a measured BRDF."""
    checks = (_spike, _colours, _dark)
    return MeasuredInspection(brdf, [finding for check in checks if (finding := check(brdf))])


def _spike(brdf: MeasuredBrdf) -> Finding | None:
    """The image of the lamp in a smooth surface: its width is that of the instrument."""
    half, grey = np.degrees(half_angle(brdf.wi, brdf.wo)), brdf.f.mean(-1)
    inside, around = half < SPIKE, (half >= SPIKE) & (half < 3.0 * SPIKE)
    if not inside.any() or not around.any():
        return None
    ratio = float(np.median(grey[inside]) / max(np.median(grey[around]), 1e-12))
    if ratio < SHARP:
        return None
    detail = (
        f"within {SPIKE:g} degrees of the mirror direction {ratio:.0f} times as bright as beside it, {inside.sum()} samples"
    )
    return Finding("mirror spike", "note", detail, f"leave it out where the instrument blurs it: min_half_deg = {SPIKE:g}")


def _colours(brdf: MeasuredBrdf) -> Finding | None:
    if not brdf.clipped:
        return None
    share = brdf.clipped / brdf.f.size
    detail = f"{brdf.clipped} of {brdf.f.size} channels ({100.0 * share:.2g} %) were below 0 and are taken as 0"
    return Finding("colour outside of Rec.709", "note", detail, "a channel of the material can then be no darker than black")


def _dark(brdf: MeasuredBrdf) -> Finding | None:
    lost = brdf.dropped.get("zero or less in all channels", 0)
    if lost < 0.01 * (len(brdf.f) + lost):
        return None
    advice = "below its noise the instrument says nothing; the metrics law, uniform and cube_root mind that least"
    return Finding("clipped at 0", "note", f"{lost} samples have no value in any channel and are left out", advice)
