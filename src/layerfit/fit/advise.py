"""What a capture can tell of a material before it is fitted, and which further image would tell most.

From derivatives at a material, no image is needed: J^T J of the images that there are, and of each that could be made (Fisher 1922). The best
is the one that shrinks the volume of the parameters' errors most (D-optimality, Wald 1943).
"""

import dataclasses
import functools
import operator
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np

from ..capture.geometry import normalise
from ..capture.reference import load_reference
from ..capture.samples import Samples, View
from ..capture.scene import Constant, Directional, Reference, Scene
from ..errors import InputError
from ..stack import Stack
from .blocks import STRATA, arrange, strata
from .nuisances import GREY, depths, of_references
from .parameters import LIGHT, Parametrisation, parametrise, with_fixed
from .residuals import Residuals
from .uncertainty import WEAK_SIGMA
from .weights import FLOOR_SHARE, MODEL_SHARE, brightness, noise_law

PIXELS = 1024
"""Of each image: what it tells is scaled to all that it has."""

LIGHTS, CAMERAS = 64, 24
"""Directions on the sphere that are tried: neighbours are 25 and 40 degrees apart."""

THICKNESSES = (0.5, 2.0, 4.0)
QUADRATURE = 496

SIDEWAYS = 0.3
"""Cosine between two cameras above which they see enough of the same points."""


@dataclasses.dataclass(frozen=True)
class Image:
    """An image that could be made: its kind ("light", "camera", "thickness" or "constant light") and in words what it is."""

    kind: str
    what: str
    reference: Reference
    direction: tuple[float, float, float] | None = None
    """To the light or the camera, where that is what is new."""


@dataclasses.dataclass(frozen=True)
class Told:
    """What images tell, in the coordinates of the fit: J^T J, and the scatter of the gradient by noise and by what the form gets wrong."""

    gram: np.ndarray
    scatter: np.ndarray

    def __add__(self, other: "Told") -> "Told":
        return Told(self.gram + other.gram, self.scatter + other.scatter)

    def covariance(self, free: Parametrisation) -> np.ndarray:
        """Of the parameters, which are known beforehand to lie in their ranges."""
        lower, upper = free.bounds()
        prior = np.diag(12.0 / (upper - lower) ** 2)
        inverse = np.linalg.inv(self.gram + prior)
        return inverse @ (self.scatter + prior) @ inverse


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A further image and what it would bring."""

    image: Image
    gain: float
    """Factor by which errors would shrink, the geometric mean over all directions of the parameters."""
    worst: float
    """Sigma of the parameter that would then be known least, in the coordinates of the fit."""


@dataclasses.dataclass(frozen=True)
class Advice:
    """What a capture determines, and the further images that were tried, best first."""

    stack: Stack
    free: Parametrisation
    vector: np.ndarray
    sigma: np.ndarray
    """Predicted, in the coordinates of the fit."""
    candidates: list[Candidate]
    as_told: tuple[str, ...] = ()
    """What a fit of the scene would find beside these, and is taken here as the scene says."""
    shared: tuple[str, ...] = ()
    """What a fit would find for each reference, and is taken here as the same in all."""

    @property
    def determined(self) -> dict[str, bool]:
        """Whether each parameter would be found, all of its channels, by its name."""
        return {f.name: bool(np.all(self.sigma[list(f.slots)] < WEAK_SIGMA)) for f in self.free.free}

    @property
    def least_known(self) -> str:
        """The parameter with the largest sigma, and its channel."""
        return self.free.names[int(np.argmax(self.sigma))]


def advise(
    scene: Scene,
    stack: Stack | None = None,
    *,
    seed: int = 0,
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> Advice:
    """What the images of a scene tell of its material, or of another `stack` of the same parameters, such as a fitted one.

    Tried are a distant light from all sides, other cameras, half, twice and four times each thickness, and light from everywhere; each alone,
    beside the images that there are, of the points of the first that can be seen. Raises `InputError` for a scene that cannot be fitted.
    """
    where = f"{scene.path}: fit"
    references = [r for r in scene.references if isinstance(r, Reference)]
    if not references:
        raise InputError(
            f"{scene.path}: advice is for renders, which have lights and a camera; this scene has measured BRDFs alone"
        )
    stack = with_fixed(scene.start if stack is None else stack, scene.fit.fixed, f"{where}.fixed")
    # Of these, the brightness of all lights alone is among what is told: an image that could be made has lights of its own.
    scenes = of_references(stack, references).keys() - {LIGHT, f"{LIGHT}.{GREY}"}
    request = scene.fit
    asked, also, each = (
        names and [name for name in names if name not in scenes] for names in (request.free, request.also, request.each)
    )
    as_told = tuple(name for name in (*(request.free or ()), *request.also, *request.each) if name in scenes)
    stack, free = parametrise(stack, asked, tuple(request.fixed), where, also=also or (), each=each or ())
    with jax.enable_x64(True):
        ask = _Asked(scene, stack, free, seed)
        capture = [ask.told(reference) for reference in references]
        there = functools.reduce(operator.add, capture)
        before = there.covariance(free)
        images, found = list(_images(references[0], stack)), []
        for k, image in enumerate(images):
            after = (there + ask.told(image.reference)).covariance(free)
            found.append(Candidate(image, _gain(before, after), float(np.sqrt(np.max(np.diag(after))))))
            progress("images", (k + 1) / len(images))
    found.sort(key=lambda candidate: -candidate.gain)
    return Advice(
        stack, free, ask.u, np.sqrt(np.diag(before)), found, as_told, tuple(each or ()) if len(references) > 1 else ()
    )


def _gain(before: np.ndarray, after: np.ndarray) -> float:
    return float(np.exp((np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]) / (2.0 * len(before))))


class _Asked:
    def __init__(self, scene: Scene, stack: Stack, free: Parametrisation, seed: int):
        self.least, self.seed, self.free = scene.fit.min_cosine, seed, free
        self.stack, self.u = stack.astype(np.float32), free.pack(stack)
        self.whole: dict[Any, View] = {}

    def told(self, reference: Reference) -> Told:
        """What an image tells: derivatives of a part of its pixels, for all of them."""
        view = self._seen(reference)
        view.check(self.stack)
        rng = np.random.default_rng(self.seed)
        which = np.sort(rng.permutation(len(view.index))[: PIXELS if view.exact else PIXELS // 4])
        samples = view.samples(which, QUADRATURE, self.seed)
        scale = view.scales(self.stack)
        scale = np.ones(len(self.stack.layers) + 1) if scale is None else scale
        dark = dataclasses.replace(samples, target=np.zeros_like(samples.target))
        blocks, layout = arrange([dark], self.seed, self.stack.needs)
        blocks = dataclasses.replace(blocks, inverse_sigma=np.ones_like(blocks.inverse_sigma))
        jacobian, model = Residuals(self.stack, self.free, scale[None], blocks, len(layout.pixel)).rows(self.u)
        pixel = layout.pixel.ravel()
        counts = (pixel >= 0) & self._lit(samples)[pixel]
        if not counts.any():
            return Told(np.zeros((self.free.size,) * 2), np.zeros((self.free.size,) * 2))
        share = len(view.index) / len(which)
        return _told(jacobian[counts], model[counts], strata(samples)[pixel[counts]], self._noise(view, model[counts]), share)

    def _seen(self, reference: Reference) -> View:
        """All points of the first image of an object, from another camera and under other light."""
        key = reference.exr
        if key not in self.whole:
            everywhere = dataclasses.replace(reference, lights=(Constant((1.0, 1.0, 1.0)),))
            self.whole[key] = load_reference(everywhere, self.least)
        whole = self.whole[key]
        view = normalise(np.subtract(reference.camera.position, whole.position))
        return dataclasses.replace(whole, reference=reference, view=view)

    def _lit(self, samples: Samples) -> np.ndarray:
        lit = np.any((samples.wi[..., 2] > self.least) & np.any(samples.weight > 0.0, -1), 1)
        return lit & (samples.wo[:, 2] > self.least)

    def _noise(self, view: View, model: np.ndarray) -> np.ndarray:
        """Standard error of pixels (pixels, 3), by the law of the noise that the file states: none where it states none."""
        if view.noise is None:
            return np.zeros_like(model)
        power = noise_law(np.maximum(view.target, 0.0), view.noise) / np.maximum(view.target, 1e-12) ** 0.7
        return np.median(power) * np.maximum(model, 0.0) ** 0.7


def _told(jacobian: np.ndarray, model: np.ndarray, stratum: np.ndarray, noise: np.ndarray, share: float) -> Told:
    """J^T J and scatter of pixels that count for `share` of them each; the form is off alike at alike half angles, a channel
    each: its error does not average out over them."""
    off = np.hypot(MODEL_SHARE * model, FLOOR_SHARE * brightness(model))
    inverse_sigma = 1.0 / np.hypot(off, noise)
    weighted = jacobian * inverse_sigma[..., None]
    gram = share * np.einsum("pci,pcj->ij", weighted, weighted)
    by_noise = weighted * (noise * inverse_sigma)[..., None]
    by_form = weighted * (off * inverse_sigma)[..., None]
    alike = np.stack([by_form[stratum == s].sum(0) for s in range(STRATA)]).reshape(-1, gram.shape[0])
    return Told(gram, share * np.einsum("pci,pcj->ij", by_noise, by_noise) + share**2 * alike.T @ alike)


def _images(reference: Reference, stack: Stack) -> Iterator[Image]:
    """Further images, each with one thing new."""
    for x, y, z in _sphere(LIGHTS).tolist():
        light = Directional((x, y, z), (np.pi, np.pi, np.pi))
        yield Image(
            "light", f"a distant light from {_vector((x, y, z))}", dataclasses.replace(reference, lights=(light,)), (x, y, z)
        )
    away = np.subtract(reference.camera.position, reference.camera.look_at)
    far = float(np.linalg.norm(away))
    for direction in _sphere(CAMERAS):
        if not SIDEWAYS < direction @ away / far < 0.99:
            continue
        x, y, z = (np.asarray(reference.camera.look_at) + far * direction).tolist()
        camera = dataclasses.replace(reference.camera, position=(x, y, z))
        yield Image("camera", f"a camera at {_vector((x, y, z))}", dataclasses.replace(reference, camera=camera), (x, y, z))
    for layer in (*stack.layers, stack.base):
        for times in THICKNESSES if depths(layer) else ():
            scale = {**reference.thickness_scale, layer.name: times * reference.thickness_scale.get(layer.name, 1.0)}
            what = f"{layer.name} {times:g} times as thick"
            yield Image("thickness", what, dataclasses.replace(reference, thickness_scale=scale))
    everywhere = dataclasses.replace(reference, lights=(Constant((1.0, 1.0, 1.0)),))
    yield Image("constant light", "light from everywhere", everywhere)


def _sphere(count: int) -> np.ndarray:
    """Directions spread evenly (Fibonacci lattice; Gonzalez 2010)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    phi = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)


def _vector(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in values) + ")"
