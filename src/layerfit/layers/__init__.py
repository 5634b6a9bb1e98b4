"""What lies over something else."""

from .coat import Coat as Coat
from .patina import Patina as Patina
from .weathering import Deposit as Deposit, Erosion as Erosion, Overgrowth as Overgrowth, Polish as Polish

LAYERS = {
    "coat": Coat,
    "patina": Patina,
    "deposit": Deposit,
    "overgrowth": Overgrowth,
    "erosion": Erosion,
    "polish": Polish,
}
"""The layers by their name in a preset."""
