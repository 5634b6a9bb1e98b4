"""How near each form is to the random walk: measured once, over random materials, and told beside every fit.

Relative error of light from below the coat, summed over directions of view, per material and direction of light. `tools/fit_precise.py`
measures it, on materials that no constant was fitted to.
"""

from typing import Any

from ..surfaces.microfacet import Conductor
from . import corrected, precise

NARROW = 0.2

MEASURED: dict[tuple[str, str, str], tuple[float, float]] = {
    ("precise", "single", "diffuse"): (0.002, 0.008),
    ("precise", "single", "conductor"): (0.015, 0.051),
    ("precise", "single", "narrow"): (0.020, 0.074),
    ("precise", "single", "beckmann, diffuse"): (0.011, 0.043),
    ("precise", "single", "beckmann, conductor"): (0.018, 0.098),
    ("precise", "single", "beckmann, anisotropic, diffuse"): (0.011, 0.030),
    ("precise", "single", "beckmann, anisotropic, conductor"): (0.033, 0.125),
    ("precise", "single", "anisotropic, diffuse"): (0.006, 0.028),
    ("precise", "single", "anisotropic, conductor"): (0.031, 0.112),
    ("precise", "multi", "diffuse"): (0.004, 0.008),
    ("precise", "multi", "conductor"): (0.015, 0.042),
    ("precise", "multi", "narrow"): (0.020, 0.046),
    ("precise", "multi", "beckmann, diffuse"): (0.005, 0.017),
    ("precise", "multi", "beckmann, conductor"): (0.016, 0.086),
    ("precise", "multi", "beckmann, anisotropic, diffuse"): (0.007, 0.024),
    ("precise", "multi", "beckmann, anisotropic, conductor"): (0.037, 0.154),
    ("precise", "multi", "anisotropic, diffuse"): (0.005, 0.021),
    ("precise", "multi", "anisotropic, conductor"): (0.035, 0.116),
    ("precise", "single", "two coats, denser below, diffuse"): (0.009, 0.056),
    ("precise", "single", "two coats, denser below, conductor"): (0.022, 0.089),
    ("precise", "single", "two coats, rarer below, diffuse"): (0.048, 0.356),
    ("precise", "single", "two coats, rarer below, conductor"): (0.037, 0.270),
    ("precise", "multi", "two coats, denser below, diffuse"): (0.009, 0.080),
    ("precise", "multi", "two coats, denser below, conductor"): (0.019, 0.063),
    ("precise", "multi", "two coats, rarer below, diffuse"): (0.024, 0.344),
    ("precise", "multi", "two coats, rarer below, conductor"): (0.044, 0.404),
}
"""(form, interface, base, with what is more than one isotropic GGX coat): median and 90th percentile over materials."""


def against_walk(layers: tuple[Any, ...], base: Any, form: Any) -> dict[str, Any] | None:
    """Median and 90th percentile of the form's error for this kind of material; None where it was not measured."""
    if not isinstance(form, (precise.Precise, corrected.Corrected)) or precise.refuses(layers, base):
        return None
    name = "precise" if isinstance(form, precise.Precise) else "corrected"
    interface = getattr(form, "interface", "single")
    kind = _kind(layers[0], base) if len(layers) == 1 else _kind_of_two(layers[0], layers[1], base)
    if (name, interface, kind) not in MEASURED:
        return None
    p50, p90 = MEASURED[name, interface, kind]
    return {"of": "light from below the coat, against the random walk", "interface": interface, "p50": p50, "p90": p90}


def _kind(coat: Any, base: Any) -> str:
    kind = "conductor" if isinstance(base, Conductor) else "diffuse"
    if any(isinstance(getattr(surface, "width", None), tuple) for surface in (coat, base)):
        kind = f"anisotropic, {kind}"
    elif kind == "conductor" and base.alpha < NARROW and coat.distribution == "ggx":
        kind = "narrow"
    return kind if coat.distribution == "ggx" else f"{coat.distribution}, {kind}"


def _kind_of_two(outer: Any, inner: Any, base: Any) -> str:
    order = "denser" if inner.eta >= outer.eta else "rarer"
    return f"two coats, {order} below, {'conductor' if isinstance(base, Conductor) else 'diffuse'}"
