"""In what the coats and metals of other programs differ: one row each, read from their specifications and sources."""

import dataclasses
from typing import Literal


@dataclasses.dataclass(frozen=True)
class Dialect:
    """What a program makes of a coat over a base. What two of them do alike is in `engine`."""

    title: str
    """Name and version of the formula, for people."""
    exact: bool = False
    """Whether dielectrics reflect by Fresnel's equations; else by Schlick's formula."""
    coat_index: bool = False
    """Whether the coat has an index of its own; else it is `COAT_INDEX`."""
    coat_masking: Literal["smith", "kelemen"] = "smith"
    passes: Literal["view", "half", "albedo"] = "view"
    """The rest that reaches the base: 1 - F of the angle of view, 1 - F of the half angle, or 1 - the lobe's own albedo."""
    path: Literal["both", "view", "flat"] | None = None
    """Way through the absorbing coat: of both directions refracted, twice that of the viewer, twice its thickness; None where it cannot absorb."""
    edge_tint: bool = False
    """Whether a metal has a reflectance of its own at 82 degrees (Hoffman 2019)."""
    beside: Literal["half", "normal"] = "half"
    """What a dielectric lobe leaves to the diffuse part beside it: 1 - F of the half angle, or of normal incidence."""
    compensates: Literal["lobes", "base", "filmed"] | None = None
    """Which lobes are scaled for light that goes to and fro between facets (Turquin 2019, eq. 16): all, by their reflectance there, or that of
    the base alone, by its reflectance at normal incidence, or by that of its film."""
    metal_dims: bool = False
    """Whether the metal in a mixed base takes from its diffuse part what it reflects at grazing angles."""
    film: Literal["view", "half"] | None = None
    """Of which angle the reflectance of a film on a metal is: that of the view or the half angle; None where films are not written."""
    film_on: Literal["clear", "metal"] = "clear"
    """What lies below the film: a clear medium that reflects as the metal does, or one that absorbs."""
    film_coated: bool = True
    """Whether a film below a coat is as it is in air."""
    gaussian: bool = False
    """Whether the power of Schlick's formula is a spherical Gaussian (Lagarde 2012)."""
    masks_evenly: bool = False
    """Whether facets with a grain hide one another as those without do."""
    widens: float = 0.0
    """What of the coat's alpha^2 is added to that of the metal or dielectric below it."""
    darkens: bool = False
    """Whether light that the coat sends back to a diffuse base is counted."""


COAT_INDEX = 1.5
"""Of the coats of glTF and three.js."""

DIALECTS = {
    # MaterialX 1.39, libraries/bxdf/open_pbr_surface.mtlx and the GLSL of its pbrlib: its coat absorbs without regard to the angle.
    "openpbr": Dialect(
        "OpenPBR 1.1 as MaterialX 1.39 prints it",
        exact=True,
        coat_index=True,
        passes="albedo",
        path="flat",
        edge_tint=True,
        compensates="lobes",
        masks_evenly=True,
        widens=2.0,
        darkens=True,
    ),
    # glTF 2.0, appendix B, and the README of KHR_materials_clearcoat ("fresnel_coat").
    "gltf": Dialect(
        "glTF 2.0 with KHR_materials_clearcoat and KHR_materials_iridescence",
        film="half",
    ),
    # Cycles 5.0, kernel/svm/closure.h, with the distribution GGX: the light that leaves is taken to go as the viewer looks.
    "blender": Dialect(
        "Blender 4 and 5, Principled BSDF in Cycles",
        exact=True,
        coat_index=True,
        path="view",
        edge_tint=True,
        film="half",
        film_on="metal",
    ),
    # three.js, lights_physical_pars_fragment.glsl of release 187. Earlier ones compensated nothing, and did not dim the diffuse part.
    "three": Dialect("three.js r187, MeshPhysicalMaterial", compensates="base", metal_dims=True, gaussian=True, film="view"),
    # Babylon.js, pbrClearCoatFunctions and pbrDirectLightingFunctions of release 9.34.
    "babylon": Dialect(
        "Babylon.js 9, PBRMaterial with a clear coat",
        beside="normal",
        film="view",
        film_coated=False,
        compensates="filmed",
        coat_index=True,
        coat_masking="kelemen",
        passes="half",
        path="both",
    ),
}
