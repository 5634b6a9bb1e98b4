"""What one rough isotropic GGX interface does to light, tabulated from the random walk (physics of the `precise` form).

`tools/make_interface_tables.py` makes the file beside this module; loading takes numpy alone.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

FILE = Path(__file__).with_name("interface_tables.npz")

Kind = Literal["single", "multi"]
"""What light does at a rough boundary: it meets one facet, or as many as it takes to leave."""


@dataclass(frozen=True, eq=False)
class InterfaceTables:
    """Tables over nodes `eta` (E,), `alpha` (A,), `mu` (M,); float32, nodes ascending in `eta` and `alpha`.

    `eta`: index below over index above; `alpha`: width of the facets; `mu`: cosine of the light above the interface, ascending
    from grazing to 1. Of the light that is refracted, w' its directions below, u = 1 / w'.z their paths in thicknesses of the medium:

    - `dT` (E, A, M): energy that passes is clip(T + dT, 0, 1), T = `optics.interface.rough_transmittance` (S5.2.2);
    - `rx`: median of the component of w' in the plane of incidence, over its value sin / eta at a smooth interface;
    - `w`: spread of w', the root of the product of sqrt(3)/2 IQR / alpha in the plane and across it; |mu' - mu / eta| as alpha -> 0 in it;
    - `kt`, `lt`: k theta and ln theta of u - 1 ~ Gamma(k, theta), from the mean of exp(-tau u) at tau = 0.25 and 2; theta >= 0.001;
    - `Rb` (E, A, B): energy that is reflected back of light from below, at the cosines `mu_below` (E, B), ascending: their nodes
      are the same parts of the way from the edge of total reflection, sqrt(1 - 1 / eta^2), which is the middle one, so that
      interpolation over eta at one node does not smear that edge.

    Standard errors, from a second seed: `dT` 2e-4, `Rb` 1e-4 (single) and 4e-4 (multi), `rx`, `w` and `kt` at most 7e-4 of their
    value, `lt` 8e-3. A cubic spline through the nodes is nearer than 1e-3 to values between them at nine points in ten; except for `kt`
    (multi, 4e-3), and for `rx` where rough facets send grazing light two ways (1.5e-2) and `Rb` (single) below mu = 0.05 (3e-2).
    """

    eta: np.ndarray
    alpha: np.ndarray
    mu: np.ndarray
    dT: np.ndarray
    rx: np.ndarray
    w: np.ndarray
    kt: np.ndarray
    lt: np.ndarray
    mu_below: np.ndarray
    Rb: np.ndarray


@dataclass(frozen=True)
class Origin:
    """How the file was made: its version, the sha256 of the script, the seed and the samples of a node from above and from below."""

    version: int
    script_sha256: str
    seed: int
    count: int
    count_below: int


@cache
def load(interface: Kind) -> InterfaceTables:
    """The tables of one model of the interface: scattered once, or as often as it takes."""
    with _open() as data:
        nodes = {name: _read_only(data[name]) for name in ("eta", "alpha", "mu", "mu_below")}
        values = {name: _read_only(data[f"{interface}_{name}"]) for name in ("dT", "rx", "w", "kt", "lt", "Rb")}
    return InterfaceTables(**nodes, **values)


def origin() -> Origin:
    """Where the tables come from."""
    with _open() as data:
        numbers = {name: int(data[name]) for name in ("version", "seed", "count", "count_below")}
        return Origin(script_sha256=str(data["script_sha256"]), **numbers)


def _open() -> np.lib.npyio.NpzFile:
    return np.load(FILE)


def _read_only(x: np.ndarray) -> np.ndarray:
    x.flags.writeable = False
    return x
