"""One boundary each: what reflects light at the bottom of a stack, or on its own."""

from .car_paint import CarPaint as CarPaint
from .cosine import Blinn as Blinn, Phong as Phong
from .diffuse import Lambert as Lambert, OrenNayar as OrenNayar
from .flakes import Flakes as Flakes
from .grooves import CookTorrance as CookTorrance, TorranceSparrow as TorranceSparrow
from .lafortune import Lafortune as Lafortune
from .microfacet import Conductor as Conductor, Dielectric as Dielectric
from .pigment import KubelkaMunk as KubelkaMunk

BASES = {
    "conductor": Conductor,
    "dielectric": Dielectric,
    "lambert": Lambert,
    "oren_nayar": OrenNayar,
    "phong": Phong,
    "blinn": Blinn,
    "lafortune": Lafortune,
    "torrance_sparrow": TorranceSparrow,
    "cook_torrance": CookTorrance,
    "car_paint": CarPaint,
    "flakes": Flakes,
    "kubelka_munk": KubelkaMunk,
}
"""The surfaces by their name in a preset."""
