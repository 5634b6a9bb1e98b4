"""Array shapes of the shading code, by their names in the field.

Shading functions take scalars and 3-vectors; a batch is always added from outside by `jax.vmap`. A `Colour` is a scalar
(the same in every channel) or one value a channel: formulas treat the two alike and never mix channels.
"""

from typing import Any

from jaxtyping import Array, Bool, Float, UInt32

Scalar = Float[Array, ""]
Flag = Bool[Array, ""]
Vec2 = Float[Array, "2"]
Vec3 = Float[Array, "3"]
Vec4 = Float[Array, "4"]
Direction = Float[Array, "3"] | Float[Array, "4"]
"""Unit vector: its part along the surface, two numbers in the surface's frame or three in any space, then its cosine."""
UInt = UInt32[Array, ""]
UVec3 = UInt32[Array, "3"]
Colour = Float[Array, ""] | Float[Array, "3"]

Number = Any
"""A field of a layer: a float, or three, where a user builds the layer; a traced array where it is evaluated; None where absent."""
