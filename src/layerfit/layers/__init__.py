"""What lies over something else."""

from .coat import Coat as Coat
from .patina import Patina as Patina

LAYERS = {"coat": Coat, "patina": Patina}
"""The layers by their name in a preset."""
