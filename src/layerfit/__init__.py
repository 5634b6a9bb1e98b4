"""Fit layered materials to reference renders, and print them as shaders.

Names are loaded when they are first used (see `__init__.pyi` for all of them): importing the package costs nothing.

Conventions throughout. Directions `wi` (to the light) and `wo` (to the viewer) are unit vectors that point away from the surface, in
its frame: tangent, bitangent, normal (0, 0, 1). A BRDF is in 1/sr and holds no cosine. Colours are linear Rec.709.
"""

import lazy_loader as _lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
