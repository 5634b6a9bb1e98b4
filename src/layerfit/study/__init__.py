"""Studies of a material: what accuracy costs, in its shader and in its fit."""
