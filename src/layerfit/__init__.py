"""layerfit."""
