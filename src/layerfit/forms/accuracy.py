"""How near each form is to the random walk: measured once, over random materials, and told beside every fit.

Relative error of light from below the coat, summed over directions of view, per material and direction of light. `tools/fit_precise.py`
measures it, on materials that no constant was fitted to.
"""

from typing import Any

from ..surfaces.microfacet import Conductor
from . import corrected, precise

NARROW = 0.2

MEASURED: dict[tuple[str, str, str], tuple[float, float]] = {
    ("precise", "single", "diffuse"): (0.002, 0.006),
    ("precise", "single", "conductor"): (0.022, 0.080),
    ("precise", "single", "narrow"): (0.024, 0.102),
    ("precise", "multi", "diffuse"): (0.003, 0.009),
    ("precise", "multi", "conductor"): (0.017, 0.044),
    ("precise", "multi", "narrow"): (0.020, 0.053),
}
"""(form, interface, base): median and 90th percentile over materials."""


def against_walk(layers: tuple[Any, ...], base: Any, form: Any) -> dict[str, Any] | None:
    """Median and 90th percentile of the form's error for this kind of material; None where it was not measured."""
    if not isinstance(form, (precise.Precise, corrected.Corrected)) or precise.refuses(layers, base):
        return None
    name = "precise" if isinstance(form, precise.Precise) else "corrected"
    interface = getattr(form, "interface", "single")
    kind = "diffuse"
    if isinstance(base, Conductor):
        kind = "narrow" if base.alpha < NARROW else "conductor"
    if (name, interface, kind) not in MEASURED:
        return None
    p50, p90 = MEASURED[name, interface, kind]
    return {"of": "light from below the coat, against the random walk", "interface": interface, "p50": p50, "p90": p90}
