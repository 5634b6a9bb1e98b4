"""What lies over something else."""

from .coat import Coat as Coat

LAYERS = {"coat": Coat}
"""The layers by their name in a preset."""
