"""Copper in the open: bright, then brown, then green (after Elek 2010 and Dorsey and Hanrahan 1996)."""

import math

import numpy as np

from ..forms.corrected import Corrected
from ..layers import Patina
from ..stack import Stack
from ..surfaces import Conductor

WAVELENGTH_UM = np.array([0.630, 0.532, 0.465])
"""Of red, green and blue."""

# Of copper and of its first oxide (Cu2O, cuprite), which is what colours it brown.
COPPER_ETA = [0.200, 0.924, 1.102]
COPPER_K = [3.912, 2.448, 2.137]
CUPRITE_ETA = 2.7
CUPRITE_K = np.array([0.02, 0.1, 0.3])


def copper_patina(years: float = 20.0, onset_years: float = 10.0, seed: int = 0, softness: float | None = 0.03) -> Stack:
    """Copper of an age [yr]: bare metal, a film of oxide, and on it green sulphates and carbonates, in a climate of some onset.

    Indices are measured values of three wavelengths. Thickness, crust and noise are chosen to look like roofs, not measured: the
    oxide is 1.5 um thick one onset time after it began.
    """
    layer = Patina(
        years=years,
        onset_years=onset_years,
        steepness=1.3,
        softness=softness,
        seed=float(seed),
        alpha=0.5,
        eta=CUPRITE_ETA,
        absorption_per_mm=np.round(4.0 * math.pi * CUPRITE_K / (WAVELENGTH_UM * 1e-3)),
        thickness_um=1.5,
        absorbed=[2.2, 0.28, 0.45],
        scattered=0.7,
        albedo=[0.2, 0.6, 0.5],
        depth=0.3,
    )
    return Stack((layer,), Conductor(alpha=0.25, eta=COPPER_ETA, k=COPPER_K), Corrected())
