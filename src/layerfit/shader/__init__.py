"""From the traced model to a verified shader: print, export, render, compare."""
