"""The hand-written part of a shader: files of `shaders/`, of which a material chooses the lines that it asks for."""

import re
from functools import cache

from .._data import shaders
from .._place import TANGENT, needs_tangent
from ..stack import Stack

SIZES = {"uv": ("vec2", (2,)), "distance": ("float", ()), "sky": ("float", ())}
"""What a material may read of a place: its type in the shader and in JAX."""

COSINES = "cosines"
FREE = "free"
"""How a shader holds directions where it has no frame: their cosines alone, or the part along the surface in any space and the cosine."""

MAPS, AT_UV = "maps", "at_uv"
"""What the example entry point does where values come from textures, beside tilting the normal: reads them, and is given texture coordinates."""


def asks(stack: Stack) -> frozenset[str]:
    """What the templates are to bring for a material, and whether it asks for cosines alone in place of two directions."""
    layers = (*stack.layers, stack.base)
    tangent = {TANGENT} if any(needs_tangent(layer) for layer in layers) else set()
    cosines = getattr(stack.base, "by_cosines", False) and not stack.layers
    directions = {COSINES} if cosines else tangent or {FREE}
    return frozenset(stack.reads) | directions


@cache
def template(file: str, asks: frozenset[str], maps: tuple[tuple[str, str, str], ...] = ()) -> str:
    """A file of `shaders/` with its conditional parts chosen, and what the material asks for in its lists of parameters."""
    text = (shaders() / file).read_text()
    names = [name for name in SIZES if name in asks]
    place = [(SIZES[name][0], name) for name in names] + [(kind, name) for kind, name, _ in maps]
    lists = {
        "@FRAME@": f"vec3 n, {'vec3 t, ' if TANGENT in asks else ''}vec3 v, vec3 l@PLACE@",
        "@ALONG@": ", v_tangent" if TANGENT in asks else "",
        "@PLACE@": "".join(f", {kind} {name}" for kind, name in place),
        "@THERE@": "".join(f", {name}" for _, name in place),
    }

    def choose(match: re.Match[str]) -> str:
        yes, _, no = match[2].partition("//@ else\n")
        return yes if match[1] in asks else no

    text = re.sub(r"^//@ if (\w+)\n(.*?)^//@ end\n", choose, text, flags=re.M | re.S)
    for word, parameters in lists.items():
        text = text.replace(word, parameters)
    return text
