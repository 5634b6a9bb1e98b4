"""What all layers have in common that grow in time, place by place."""

from .._chunk import static
from .._fields import layer, param
from .._types import Number


@layer
class Growing:
    """A layer that covers a surface in time, where a field of noise over its texture coordinates says.

    At the age `years` the field is passed up to 1 - exp(-(years / onset_years) ^ steepness). A layer without `softness` has a hard edge:
    of a picture made of such edges the age has hardly a derivative, so give it a softness to fit it.
    """

    name: str = static(default="growth", doc="name of the layer")
    years: Number = param(default=20.0, lower=0.0, upper=1e4, scale="softlog", doc="age", unit="yr")
    onset_years: Number = param(
        default=10.0,
        lower=0.01,
        upper=1e4,
        scale="log",
        doc="age at which 1 - 1/e of the field is passed",
        unit="yr",
        fitted=False,
    )
    steepness: Number = param(default=2.0, lower=0.3, upper=6.0, scale="log", doc="exponent of the age", fitted=False)
    softness: Number = param(
        default=None,
        lower=1e-3,
        upper=0.5,
        scale="log",
        doc="width of the edge, in the unit of the field; absent for a hard one",
    )
    cells: Number = param(
        default=8.0, lower=0.01, upper=1e4, scale="log", doc="cells of the coarsest noise in a unit of texture", fitted=False
    )
    seed: Number = param(default=0.0, lower=0.0, upper=65535.0, scale="linear", doc="which noise: a whole number", fitted=False)
    exposure: Number = param(
        default=None,
        lower=0.0,
        upper=1.0,
        scale="linear",
        fitted=False,
        doc="part of the growth that needs the open sky: rain and light; absent: every place grows alike",
    )

    @property
    def reads(self) -> tuple[str, ...]:
        """What it needs to know of a place of the surface."""
        return ("uv",) if self.exposure is None else ("uv", "sky")
