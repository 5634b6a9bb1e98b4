"""The structures that a material may have: what each is made of, where its fit starts, and what is free."""

import dataclasses
from typing import Any

import numpy as np

from .._fields import params
from ..forms.corrected import Corrected
from ..forms.precise import Precise
from ..layers import Coat
from ..stack import Stack
from ..surfaces import CarPaint, Conductor, Dielectric, Flakes, Lambert, OrenNayar


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A structure, with the start of its fit."""

    name: str
    words: str
    stack: Stack
    free: tuple[str, ...]
    after: str | None = None
    """The simpler structure that it holds: its fit starts from where that one ended."""

    def started_from(self, fitted: Stack) -> "Candidate":
        """The same structure, with its base as it was found without what is over it."""
        base = self.stack.base
        if type(base) is not type(fitted.base):
            return self
        values = {name: _between(getattr(base, name), getattr(fitted.base, name)) for name, _ in params(base)}
        base = dataclasses.replace(base, **{name: value for name, value in values.items() if value is not None})
        return dataclasses.replace(self, stack=dataclasses.replace(self.stack, base=base))


def _between(start: Any, found: Any) -> Any:
    """A tenth of the way back from what was found: at the end of its range a value may have no effect, nor others beside it."""
    return None if start is None or found is None else 0.9 * np.asarray(found, float) + 0.1 * np.asarray(start, float)


def candidates(colour: np.ndarray) -> list[Candidate]:
    """All structures, simpler ones first; `colour` (3,) is the start of what is diffuse.

    A metal is an index of 1 and an extinction in each channel, which gives any reflectance at the normal: nothing else of its index shows.
    """
    coat = Coat(alpha=0.1, eta=1.5)
    tinted = Coat(alpha=0.1, eta=1.5, tau=[0.1] * 3)
    under = Coat(name="under", alpha=0.3, eta=1.8)
    diffuse = Lambert(albedo=colour)
    metal = Conductor(alpha=0.2, eta=[1.0] * 3, k=[3.0] * 3)
    paint = CarPaint(kd=colour, ks=[0.1] * 3, f0=0.5, alpha=0.3)
    paint_2 = CarPaint(kd=colour, ks=[0.1] * 3, f0=0.5, alpha=0.3, ks_2=[0.1] * 3, f0_2=0.5, alpha_2=0.1)
    flakes = Flakes(alpha=0.2, sigma=0.01, eta=[1.0] * 3, k=[3.0] * 3, coverage=0.3, albedo=colour)
    on_top, of_paint = ("coat.alpha", "coat.eta"), ("base.kd", "base.ks", "base.f0", "base.alpha")
    of_metal, of_flakes = ("base.alpha", "base.k"), ("base.alpha", "base.coverage", "base.albedo", "base.k")
    bare = lambda base: Stack((), base, Corrected())  # noqa: E731
    one = lambda coat, base: Stack((coat,), base, Precise())  # noqa: E731
    any_ = lambda coat, base: Stack((coat,), base, Corrected())  # noqa: E731
    return [
        Candidate("diffuse", "diffuse", bare(diffuse), ("base.albedo",)),
        Candidate("rough_diffuse", "diffuse grooves", bare(OrenNayar(albedo=colour, sigma=0.3)), ("base.albedo", "base.sigma")),
        Candidate("dielectric", "dielectric, black below", bare(Dielectric(alpha=0.2, eta=1.5)), ("base.alpha", "base.eta")),
        Candidate("metal", "metal", bare(metal), of_metal),
        Candidate("lobe", "diffuse and a lobe", bare(paint), of_paint),
        Candidate(
            "two_lobes", "diffuse and two lobes", bare(paint_2), (*of_paint, "base.ks_2", "base.f0_2", "base.alpha_2"), "lobe"
        ),
        Candidate("coat_diffuse", "coat over diffuse", one(coat, diffuse), (*on_top, "base.albedo"), "diffuse"),
        Candidate(
            "tinted_diffuse",
            "tinted coat over diffuse",
            one(tinted, diffuse),
            (*on_top, "coat.tau", "base.albedo"),
            "coat_diffuse",
        ),
        Candidate("coat_metal", "coat over metal", one(coat, metal), (*on_top, *of_metal), "metal"),
        Candidate("tinted_metal", "tinted coat over metal", one(tinted, metal), (*on_top, "coat.tau", *of_metal), "coat_metal"),
        Candidate("coat_flakes", "coat over flakes in pigment", any_(coat, flakes), (*on_top, *of_flakes)),
        Candidate("coat_paint", "coat over car paint", any_(coat, paint), (*on_top, *of_paint), "lobe"),
        Candidate(
            "tinted_paint", "tinted coat over car paint", any_(tinted, paint), (*on_top, "coat.tau", *of_paint), "coat_paint"
        ),
        Candidate(
            "two_coats",
            "two coats over diffuse",
            Stack((coat, under), diffuse, Precise()),
            (*on_top, "under.alpha", "under.eta", "base.albedo"),
            "coat_diffuse",
        ),
    ]
