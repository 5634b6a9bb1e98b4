"""`python -m layerfit`."""

from .cli import main

main()
