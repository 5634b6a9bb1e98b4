"""A sphere of a measured BRDF, to look at: values between the samples, where there are samples near enough."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..geometry import normalise, sphere_surface, sphere_tangent, sphere_uv
from ..samples import View
from ..scene import Camera, Directional, Reference, Sphere
from .data import MeasuredBrdf
from .view import MeasuredView

SIDE = 128
DISTANCE = 200.0
"""Of the camera, in radii: no perspective, and what a material shows at one place alone is seen in the mean."""

TO_LIGHT = (0.55, 0.6, 0.58)
NEIGHBOURS = 8
HIGHLIGHT = 0.1
"""Half angle [rad] above which distances of half angles are told less and less apart."""

REACH = 3.0
"""Distances between neighbours in the data within which a value is taken from them."""


def sphere_of(view: MeasuredView) -> View:
    """The sphere under one distant light, as a reference render of `SIDE` pixels. Pixels far from all samples are not covered."""
    seen = bare_sphere(view.reference.path, SIDE, view.reference.thickness_scale)
    samples = seen.samples()
    f, near = interpolated(view.brdf, samples.wi[:, 0].astype(float), samples.wo.astype(float))
    target = np.where(near[:, None], f * samples.weight[:, 0], 0.0)
    return dataclasses.replace(seen, target=target, picture=seen.image(target)).some(near)


def bare_sphere(
    path: Path,
    side: int,
    thickness_scale: Mapping[str, float] | None = None,
    to_light: Sequence[float] = TO_LIGHT,
) -> View:
    """A sphere under one distant light as if a file held it: what is lit of `side` x `side` pixels, to be given its target; the camera
    looks along -z."""
    camera = Camera((0.0, 0.0, DISTANCE), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), float(2.0 * np.degrees(np.arctan(1.04 / DISTANCE))))
    light = Directional(tuple(normalise(np.array(to_light)).tolist()), (np.pi, np.pi, np.pi))
    surface = sphere_surface(Sphere(), camera, side, side)
    index = np.flatnonzero(surface.covered & (surface.normal @ light.to_light > 0.0))
    position, normal = (a.reshape(-1, 3)[index] for a in (surface.position, surface.normal))
    return View(
        reference=Reference(path, camera, (light,), Sphere(), {}, None, thickness_scale or {}),
        target=np.zeros((len(index), 3)),
        noise=None,
        position=position,
        normal=normal,
        tangent=sphere_tangent(normal, camera.up),
        uv=sphere_uv(normal, camera.up),
        view=normalise(np.asarray(camera.position) - position),
        index=index,
        shape=(side, side),
        dropped={},
        picture=np.zeros((side, side, 3)),
    )


def interpolated(brdf: MeasuredBrdf, wi: np.ndarray, wo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """BRDF (n, 3) at pairs of directions (n, 3) from the nearest samples, by inverse squared distance, and whether they are near (n,)."""
    from scipy.spatial import KDTree  # late: a fit of renders starts a tenth of a second sooner

    known = coordinates(brdf.wi, brdf.wo)
    tree = KDTree(known)
    spacing = np.quantile(tree.query(known, NEIGHBOURS + 1)[0][:, -1], 0.9)
    distance, which = tree.query(coordinates(wi, wo), NEIGHBOURS)
    weight = 1.0 / (distance**2 + (1e-3 * spacing) ** 2)
    values = np.sum(brdf.f[which] * weight[..., None], 1) / np.sum(weight, 1)[:, None]
    return values, distance[:, 0] < REACH * spacing


def coordinates(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Pairs of directions (n, 3) as points (n, 4): alike for pairs that an isotropic BRDF cannot tell apart, dense in the highlight.

    Half and difference angle (Rusinkiewicz 1998), the first finer near 0, and twice the azimuth of the difference: to exchange the directions
    turns it by half a circle, to mirror them reverses it.
    """
    h = normalise(wi + wo)
    sine_h = np.hypot(h[:, 0], h[:, 1])
    along = np.where(sine_h[:, None] > 1e-9, h[:, :2] / np.maximum(sine_h, 1e-9)[:, None], np.array([1.0, 0.0]))
    cosine_d = np.sum(wi * h, -1)
    # The difference vector in the frame of the half vector: x towards the normal's side, y beside it.
    x = (along[:, 0] * wi[:, 0] + along[:, 1] * wi[:, 1]) * h[:, 2] - wi[:, 2] * sine_h
    y = -along[:, 1] * wi[:, 0] + along[:, 0] * wi[:, 1]
    theta_d = np.arctan2(np.hypot(x, y), cosine_d)
    turn = 2.0 * np.arctan2(y, x)
    theta_h = np.arctan2(sine_h, h[:, 2])
    # Where the half vector is the normal, there is no azimuth.
    spread = theta_d * np.minimum(theta_h / 0.1, 1.0)
    return np.stack([np.log1p(theta_h / HIGHLIGHT), theta_d, spread * np.cos(turn), spread * np.abs(np.sin(turn))], -1)
