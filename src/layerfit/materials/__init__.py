"""Materials of the literature as functions that return a `Stack`."""
