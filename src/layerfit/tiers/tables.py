"""The paper's precomputed form: reflectances and densities are read from tables (Elek 2010, section 4.1).

What a facet does depends on one cosine, so that the reflectances of coat and metal are rows of one table. The density of facet normals is one
table for every width: with u = tan(theta_h) / alpha and y = u / (1 + u), D = (q(y) / (alpha (cos(theta_h) + sin(theta_h) / alpha)^2))^2 / pi, where
q = 1 / (y^2 + (1 - y)^2) for GGX lies between 1 and 2. Rows are read by linear interpolation, from arrays that stand in the shader. It is there
to be compared with: arithmetic is quicker.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import fetch, safe_sqrt, static, struct, where
from .._types import Colour, Flag, Scalar
from ..forms import faithful
from ..layers import Coat
from .faithful import FaithfulWay, way_in
from .surface import Compact, colour_of
from .top import hidden_cosine

ENTRIES = 256
"""Of a table, where no error is asked for."""
FEWEST, MOST = 16, 1024


@struct
class Precomputed(Compact):
    """Coat and metal of the faithful form, and their tables."""

    coat: Coat
    alpha: Scalar
    """Width of the metal."""
    facets: tuple[float, ...] = static()
    """By the half cosine: what the metal reflects, a colour or a number, then what the coat does; row by row."""
    density: tuple[float, ...] = static()
    """q by y."""
    name: str = static(default="material")
    note: str = static(default="")

    @property
    def table_bytes(self) -> int:
        """Size of the tables, of single precision."""
        return 4 * (len(self.facets) + len(self.density))

    def way(self, NoW: Scalar) -> FaithfulWay:
        return way_in(self.coat, NoW)

    def meet(self, i: FaithfulWay, o: FaithfulWay, lean2: Scalar, lit: Flag) -> Colour:
        M = i.NoW + o.NoW
        s2 = lean2 + M * M
        c = 0.5 * jnp.sqrt(s2)
        row = looked_up(np.reshape(self.facets, (len(self.density), -1)), c)
        metal, F = colour_of(row), row[-1]
        V = 0.5 / (o.NoW * i.hidden + i.NoW * o.hidden)
        lean = safe_sqrt(lean2)
        top = F * V * self.facing(lean, M, s2, self.coat.alpha)
        left = (1.0 - F) * (1.0 - 4.0 * i.NoW * o.NoW * V * F)
        g = jnp.sqrt((self.coat.eta - 1.0) * (self.coat.eta + 1.0) + c * c)
        turn = (g - c) * (0.5 / self.coat.eta) * M / c
        inverse = 1.0 / self.coat.eta
        z_i, z_o = i.NoW * inverse + turn, o.NoW * inverse + turn
        alpha2 = self.alpha * self.alpha
        hidden_i, hidden_o = hidden_cosine(z_i, alpha2), hidden_cosine(z_o, alpha2)
        lobe = self.facing(lean, M, s2, self.alpha) * 0.5 / (z_o * hidden_i + z_i * hidden_o)
        rest: Any = metal * (left * lobe)
        if self.coat.tau is not None:
            rest = rest * jnp.exp(-self.coat.tau * ((z_i + z_o) / (z_i * z_o)))
        f = top + rest
        return where(lit, where(jnp.minimum(z_i, z_o) > 0.0, f, top), 0.0)

    def facing(self, lean: Scalar, M: Scalar, s2: Scalar, alpha: Scalar) -> Scalar:
        """D [1/sr] of facets of a width, about a sum of directions whose parts are `lean` along the surface and `M` upwards."""
        whole = lean + alpha * M
        root = looked_up(np.asarray(self.density), lean / whole) * (alpha * s2 / (whole * whole))
        return root * root * (1.0 / math.pi)


def looked_up(rows: np.ndarray, x: Scalar) -> Any:
    """A table (n,) or (n, k) over [0, 1], read at x by linear interpolation."""
    place = x * (len(rows) - 1.0)
    before = jnp.clip(jnp.floor(place), 0.0, len(rows) - 2.0)
    k = before.astype(jnp.int32)
    table = jnp.asarray(rows, x.dtype)
    lower, upper = fetch(table, k), fetch(table, k + 1)
    return lower + (place - before) * (upper - lower)


def made(prepared: faithful.Prepared, name: str, entries: int) -> Precomputed:
    """The tables of a prepared material of one isotropic GGX coat over such a metal."""
    (coat,), base = prepared.coats, prepared.base
    c = jnp.linspace(0.0, 1.0, entries)
    below = jnp.sqrt((coat.eta - 1.0) * (coat.eta + 1.0) + c * c) / coat.eta
    metal, top = jax.vmap(base.reflectance)(below), jax.vmap(coat.reflectance)(c)
    facets = np.column_stack([np.asarray(metal), np.asarray(top)])
    y = np.linspace(0.0, 1.0, entries)
    density = 1.0 / (y * y + (1.0 - y) ** 2)
    rows = tuple(facets.ravel().tolist()), tuple(density.tolist())
    return Precomputed(coat, base.width, *rows, name=name)
