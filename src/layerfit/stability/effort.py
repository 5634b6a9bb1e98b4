"""How much a sweep tries: apart from what tries it, so that the command line has its defaults without JAX."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Effort:
    """How much is tried of one structure."""

    corners: int = 128
    """Of the ranges, of as many as there are."""
    shaders: bool = True
    digits: int = 4
    """Materials that are compared with 50 digits; none at 0."""
    tiers: int = 2
    """Materials whose compact tier and tables are made."""
    seed: int = 0


USUAL = Effort()
