"""One boundary each: what reflects light at the bottom of a stack, or on its own."""

from .diffuse import Lambert as Lambert, OrenNayar as OrenNayar
from .microfacet import Conductor as Conductor, Dielectric as Dielectric

BASES = {"conductor": Conductor, "dielectric": Dielectric, "lambert": Lambert, "oren_nayar": OrenNayar}
"""The surfaces by their name in a preset."""
