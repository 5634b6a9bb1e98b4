"""A measured BRDF as a reference of a fit: each pair of directions is a pixel, lit by a distant light of irradiance 1."""

import dataclasses

import numpy as np

from ..._place import grain
from ...errors import InputError
from ...stack import Stack
from ..reference import LEAST_PIXELS
from ..samples import Samples, layer_scales
from ..scene import Lit, MeasuredReference
from .data import MeasuredBrdf, half_angle, sieve
from .read import read_brdf


@dataclasses.dataclass(frozen=True)
class MeasuredView:
    """A measured BRDF, read, with the pairs of directions that are compared: f cos(theta_i) is what a fit sees."""

    reference: MeasuredReference
    brdf: MeasuredBrdf
    index: np.ndarray
    """Which samples of the file are compared, (n,)."""
    dropped: dict[str, int]
    """Those that are not, by reason."""

    exact = True
    """There is no quadrature."""
    directions = 1
    noise = None
    """None of the formats states its noise."""

    @property
    def target(self) -> np.ndarray:
        """(n, 3) BRDF times cosine [1/sr]."""
        return self.brdf.f[self.index] * self.brdf.wi[self.index, 2:]

    def some(self, which: np.ndarray) -> "MeasuredView":
        """The view of some of its samples alone: their places (n,), or a mask of them all."""
        return dataclasses.replace(self, index=self.index[which])

    def check(self, stack: Stack) -> None:
        """Raise `InputError` for a material that this measurement says nothing of."""
        oriented = [f"{layer.name}.{grain(layer)}" for layer in (*stack.layers, stack.base) if grain(layer)]
        if oriented and self.brdf.isotropic:
            raise InputError(
                f"{self.reference.path}: {oriented[0]} is measured along a tangent, and the sample was not turned: the measurement is "
                "isotropic. Start from an isotropic material"
            )
        if stack.needs:
            raise InputError(
                f"{self.reference.path}: the material varies over the surface by {', '.join(stack.needs)}, and one place of it was "
                "measured. Start from a material that is the same everywhere"
            )

    def relit(self, lit: Lit) -> "MeasuredView":
        """The same: a measured BRDF has no lights."""
        del lit
        return self

    def scales(self, stack: Stack) -> np.ndarray | None:
        """Thickness of each layer of this sample over that of the material, the base last, or None where all are 1."""
        return layer_scales(self.reference.thickness_scale, stack)

    def samples(self, which: np.ndarray | None = None, quadrature: int = 1, seed: int = 0) -> Samples:
        """Samples of all usable pairs, or of some; there is no quadrature to choose."""
        del quadrature, seed
        which = np.arange(len(self.index)) if which is None else which
        at = self.index[which]
        wi = self.brdf.wi[at].astype(np.float32)
        return Samples(
            wi=wi[:, None],
            wo=self.brdf.wo[at].astype(np.float32),
            weight=np.repeat(wi[:, None, 2:], 3, -1),
            target=self.target[which].astype(np.float32),
            noise=None,
            index=at,
            shape=None,
        )


def load_measured(reference: MeasuredReference, min_cosine: float) -> MeasuredView:
    """Read a measured BRDF and keep the pairs that can be compared: none at grazing angles, none in the spike of the mirror."""
    brdf = read_brdf(reference.brdf, reference.illuminant)
    reasons = {
        f"lit or seen at a grazing angle (cosine below {min_cosine:g})": np.minimum(brdf.wi[:, 2], brdf.wo[:, 2]) > min_cosine,
        f"half vector within {reference.min_half_deg:g} degrees of the normal": half_angle(brdf.wi, brdf.wo)
        >= np.radians(reference.min_half_deg),
    }
    index, dropped = sieve(reasons, len(brdf.f))
    dropped = brdf.dropped | dropped
    if len(index) < LEAST_PIXELS:
        lost = ", ".join(f"{count} {reason}" for reason, count in dropped.items())
        raise InputError(f"{reference.path}: only {len(index)} of its samples can be compared ({lost})")
    return MeasuredView(reference, brdf, index, dropped)
