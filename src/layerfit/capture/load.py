"""From a scene to what a fit sees of each reference."""

from .measured.view import MeasuredView, load_measured
from .reference import load_reference
from .samples import View
from .scene import MeasuredReference, Scene

AnyView = View | MeasuredView
"""A render, or a measured BRDF."""


def load(scene: Scene, min_cosine: float | None = None) -> list[AnyView]:
    """Read every reference of a scene, down to its own least cosine or another. Raises `InputError` for one that cannot be fitted."""
    least = scene.fit.min_cosine if min_cosine is None else min_cosine
    return [
        load_measured(reference, least) if isinstance(reference, MeasuredReference) else load_reference(reference, least)
        for reference in scene.references
    ]
