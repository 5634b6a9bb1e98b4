"""Array shapes of the shading code, by their names in the field.

Shading functions take scalars and 3-vectors; a batch is always added from outside by `jax.vmap`. A `Colour` is a scalar
(the same in every channel) or one value a channel: formulas treat the two alike and never mix channels.
"""

from typing import Annotated, Any

from jaxtyping import Array, Bool, Float, UInt32

from ._chunk import member, struct

Scalar = Float[Array, ""]
Flag = Bool[Array, ""]
Vec2 = Float[Array, "2"]
Vec3 = Float[Array, "3"]
Vec4 = Float[Array, "4"]


@struct
class FreeDirection:
    """A direction where no frame is asked for: what turns about the normal without a change needs none."""

    along: Vec3 = member("part along the surface, in any space")
    cosine: Scalar = member("cosine to its normal")

    def __getitem__(self, last: int) -> Any:
        """The cosine, as it is the last number of a direction in a frame."""
        if last != -1:
            raise IndexError("a direction without a frame has a cosine, and no other numbers of its own")
        return self.cosine

    def __add__(self, other: "FreeDirection") -> "FreeDirection":
        along = self.along + other.along
        cosine = self.cosine + other.cosine
        return FreeDirection(along, cosine)

    def __mul__(self, factor: Any) -> "FreeDirection":
        return FreeDirection(self.along * factor, self.cosine * factor)

    __rmul__ = __mul__


Direction = Annotated[Any, Vec3, FreeDirection]
"""Unit vector: in the surface's frame its part along the surface, two numbers, then its cosine."""
UInt = UInt32[Array, ""]
UVec3 = UInt32[Array, "3"]
Colour = Float[Array, ""] | Float[Array, "3"]

Number = Any
"""A field of a layer: a float, or three, where a user builds the layer; a traced array where it is evaluated; None where absent."""
