"""A stack as the walk reads it: relative indices, widths and media by the number of their boundary, each colour channel apart."""

from collections.abc import Callable, Mapping
from typing import Any, Literal

import jax
import numpy as np

from .._chunk import static, struct
from .._types import Number, Scalar
from ..forms.precise import Precise
from ..optics.microfacet import Distribution
from ..stack import IN_TIME, Stack
from ..surfaces.microfacet import Microfacets
from ._facets import Widths

Interface = Literal["single", "multi"]
"""What one rough boundary does to light.

`single`: a facet sends it on once and what goes to the wrong side is lost (Walter et al. 2007), with height-correlated masking
of what is reflected and separable masking of what is refracted: Mitsuba, Cycles and pbrt.
`multi`: it goes on from facet to facet until it leaves; no energy is lost (Heitz et al. 2016).
"""


@struct
class Haze:
    """Scattering in the medium of a coat, beside its absorption.

    `tau` [1] is the optical depth of scattering, one way at normal incidence, the same in every channel: with the optical depth
    tau_a of the coat's absorption, the single-scattering albedo is tau / (tau + tau_a). `g` in (-1, 1) is the mean cosine of the
    phase function (Henyey and Greenstein 1941, eq. 2): 0 scatters evenly, positive values forwards.
    """

    tau: Number
    g: Number = 0.0


@struct
class Boundary:
    """One rough interface: `eta` is the index below over the index above."""

    eta: Scalar
    widths: Widths
    kind: Distribution = static()
    separable: bool = static()


@struct
class Medium:
    """What lies below one interface: `tau` of absorption by channel, or None; `haze`, or None."""

    tau: tuple[Scalar, ...] | None
    haze: Haze | None


@struct
class Material:
    """Interfaces from the top, the medium below each, and the base relative to the medium above it.

    `channels` is 3 for a material of any colour, else 1; `base` has as many members or, where it has no colour itself, one.
    """

    boundaries: tuple[Boundary, ...]
    media: tuple[Medium, ...]
    base: tuple[Any, ...]
    channels: int = static()
    interface: Interface = static()

    def by_channel(self, of: Callable[[Any], Any]) -> tuple[Any, ...]:
        """What `of` says of the base, for every channel."""
        found = tuple(of(base) for base in self.base)
        return found * (self.channels // len(found))


def read(stack: Stack, interface: Interface, haze: Mapping[str, Haze]) -> Material:
    """The material of every row: numbers of the stack have shape (rows,) or, where they are colours, (rows, 3)."""
    check(stack, interface, haze)
    channels = [_channel(stack, k) for k in range(3 if _has_colour(stack) else 1)]
    boundaries: list[Boundary] = []
    media: list[Medium] = []
    above = np.ones(1, np.float32)
    for k, coat in enumerate(channels[0].layers):
        depths: list[Any] = [channel.layers[k].optical_depth for channel in channels]
        tau = None if depths[0] is None else tuple(depths)
        scatter = haze.get(coat.name)
        if boundaries and np.all(coat.eta == above):
            # No boundary is left between media of one index, not even one that masks: their depths add.
            if scatter or media[-1].haze:
                raise ValueError(f"haze in layers of equal index ({coat.name!r} and the one above): give one layer all of it")
            media[-1] = Medium(_sum(media[-1].tau, tau), None)
            continue
        kind = coat.distribution
        boundaries.append(Boundary(coat.eta / above, widths(coat), kind, coat.masking == "smith_separable"))
        media.append(Medium(tau, scatter))
        above = coat.eta
    bases = [channel.base for channel in channels[: 3 if _has_colour(stack.base) else 1]]
    return Material(tuple(boundaries), tuple(media), tuple(_relative(b, above) for b in bases), len(channels), interface)


def hazes(stack: Stack) -> dict[str, Haze]:
    """The coats of a material that scatter, as the walk knows them."""
    scatters = [coat for coat in stack.layers if coat.tau_s is not None]
    return {coat.name: Haze(coat.tau_s, 0.0 if coat.g is None else coat.g) for coat in scatters}


def interface_of(stack: Stack) -> Interface:
    """What the rough boundaries of a material do to light, by the form that it is in."""
    return stack.form.interface if isinstance(stack.form, Precise) else "single"


def refuses(stack: Stack, interface: Interface) -> str | None:
    """Why the walk cannot judge the forms of a material with coats, or None."""
    if any(kind.grows(stack.layers) for kind in IN_TIME):
        return "it changes in time, from place to place; the random walk is through coats"
    coloured = next((coat.name for coat in stack.layers if np.ndim(coat.tau_s)), None)
    if coloured:
        return f"{coloured}.tau_s is a colour: the random walk scatters all channels alike; give one number"
    try:
        check(stack, interface, {})
    except ValueError as error:
        return f"the random walk is not for this material: {error}"
    return None


def _relative(base: Any, above: Any) -> Any:
    """A base of rows under media of indices `above`, row by row: shading functions know no batches."""
    rows = max(x.shape[0] for x in jax.tree.leaves((base, above)))
    base, above = jax.tree.map(lambda x: np.broadcast_to(x, rows), (base, above))
    return jax.vmap(lambda one, n: one.below(n))(base, above)


def widths(surface: Microfacets) -> Widths:
    """(alpha_x, alpha_y), equal on an isotropic surface."""
    return surface.width if isinstance(surface.width, tuple) else (surface.width, surface.width)


def check(stack: Stack, interface: Interface, haze: Mapping[str, Haze]) -> None:
    """Refuse what cannot be walked through, and say what to do instead."""
    if interface not in ("single", "multi"):
        raise ValueError(f"no interface model {interface!r}: 'single' or 'multi'")
    if not stack.layers:
        raise ValueError("no coat to walk through: the base alone is its own closed form, stack.base.evaluate(wi, wo)")
    for coat in stack.layers:
        if coat.masking == "vcavity":
            raise ValueError(f"coat {coat.name!r} has V-cavities, which say nothing of refracted light: set masking='smith'")
        if coat.fresnel != "exact":
            raise ValueError(
                f"coat {coat.name!r}: the walk knows the exact reflectance, not {coat.fresnel}: set fresnel='exact'"
            )
        if coat.has_film:
            raise ValueError(
                f"coat {coat.name!r} has a thin film, which the walk does not know: set film_nm and film_eta to None"
            )
        if np.ndim(coat.eta) > 1:
            raise ValueError(f"coat {coat.name!r} has an index for every channel; a path has one direction: walk by channel")
    if getattr(stack.base, "has_film", False):
        raise ValueError(
            f"base {stack.base.name!r} has a thin film, which the walk does not know: set film_nm and film_eta to None"
        )
    if np.any(stack.layers[0].eta == 1.0):
        raise ValueError(
            "the top coat has the index of air, so no interface: leave it out, multiply by exp(-tau (1/NoL + 1/NoV))"
        )
    unknown = set(haze) - {coat.name for coat in stack.layers}
    if unknown:
        raise KeyError(f"haze in {sorted(unknown)}, which are no coats; there are {[coat.name for coat in stack.layers]}")


def _has_colour(part: Any) -> bool:
    return any(np.ndim(x) > 1 for x in jax.tree.leaves(part))


def _channel(stack: Stack, k: int) -> Stack:
    return jax.tree.map(lambda x: x[:, k] if np.ndim(x) > 1 else x, stack)


def _sum(a: Any, b: Any) -> Any:
    if a is None or b is None:
        return b if a is None else a
    return tuple(x + y for x, y in zip(a, b, strict=True))
