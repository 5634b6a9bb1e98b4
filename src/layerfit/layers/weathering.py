"""What happens to a metal in the open, one step a layer, the latest step outermost: pigment comes on, wears off, is polished."""

from .._chunk import static
from .._fields import layer, param
from .._types import Number
from ..surfaces.microfacet import alpha_param
from .growing import Growing


def _thickness() -> Number:
    return param(default=20.0, lower=0.01, upper=5e3, scale="log", doc="thickness that comes on", unit="um")


def _coefficient(what: str, default: float) -> Number:
    doc = f"{what} of diffuse light (Kubelka and Munk 1931)"
    return param(default=default, lower=0.0, upper=1e4, scale="softlog", doc=doc, unit="1/mm", colour=True)


def _index() -> Number:
    return param(default=1.5, lower=1.0, upper=3.0, scale="linear", doc="index of refraction, against air")


@layer
class Deposit:
    """Pigment that comes on everywhere: paint, dust, tarnish."""

    name: str = static(default="deposit", doc="name of the layer")
    thickness_um: Number = _thickness()
    K_per_mm: Number = _coefficient("absorption", 10.0)
    S_per_mm: Number = _coefficient("scattering", 50.0)
    alpha: Number = alpha_param(default=0.4, which="")
    eta: Number = _index()


@layer
class Overgrowth(Growing):
    """Pigment that comes on where it has begun to grow: rust, verdigris, moss."""

    name: str = static(default="overgrowth", doc="name of the layer")
    thickness_um: Number = _thickness()
    K_per_mm: Number = _coefficient("absorption", 10.0)
    S_per_mm: Number = _coefficient("scattering", 50.0)
    alpha: Number = alpha_param(default=0.4, which="")
    eta: Number = _index()

    gauges = (("years", "onset_years", 1.0, "age and onset enter only as their ratio"),)
    """Pairs of fields that an image cannot tell apart: as the first grows, the second with it (1) or against it (-1); and why."""

    @property
    def lacks(self) -> list[str]:
        """What it does without, in words."""
        return ["soft edge"] if self.softness is None else []


@layer
class Erosion:
    """Wear: so much comes off, from the top down, and the metal does not."""

    name: str = static(default="erosion", doc="name of the layer")
    amount_um: Number = param(default=5.0, lower=0.0, upper=5e3, scale="softlog", doc="thickness that comes off", unit="um")


@layer
class Polish:
    """Polish: what lies open is levelled to a height and made smoother."""

    name: str = static(default="polish", doc="name of the layer")
    height_um: Number = param(
        default=5.0, lower=0.0, upper=5e3, scale="softlog", doc="thickness that is left of the open layer", unit="um"
    )
    strength: Number = param(default=0.5, lower=0.0, upper=0.99, scale="linear", doc="part that is taken from its width")


STEPS = (Deposit, Overgrowth, Erosion, Polish)
"""All that can happen."""
