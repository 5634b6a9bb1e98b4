"""The truth: an unbiased random walk of light through rough layers, without positions (Guo, Hasan and Zhao 2018).

Every closed form of layerfit is judged by it. Layers are stacked as in `layerfit.stack`; what an interface does to light is one
of two models, `Interface`. Interfaces are GGX or Beckmann, isotropic or not; media absorb and may scatter (`Haze`); the
base is any surface of `layerfit.surfaces` and scatters once. float32, deterministic: the numbers depend on the seed alone, not on how
many threads share the work.
"""

from ._interface import Scattered as Scattered, scatter as scatter
from ._material import (
    Haze as Haze,
    Interface as Interface,
    check as check,
    hazes as hazes,
    interface_of as interface_of,
    refuses as refuses,
)
from ._tier import PATHS as PATHS, walked as walked
from ._walk import Estimate as Estimate, begin as begin, top_lobe as top_lobe, walk as walk, walk_rows as walk_rows
