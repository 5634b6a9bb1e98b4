"""From a reference image to flat samples: what the fit, the picture and the shader check are all computed from."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from .._place import Place, grain
from ..errors import InputError
from ..stack import Stack
from .geometry import frames, normalise
from .lights import is_exact, receive
from .scene import Constant, Lit, Reference, brighter, factor

QUADRATURE = 992
"""Directions a pixel for light that is not a point: a pixel is off by 1 % (rms) under the studio map of the examples, with a coat of width .1."""


@dataclasses.dataclass(frozen=True)
class Samples:
    """Pixels of one reference that a material is compared on, in their surface frames, float32.

    `wi` and `weight` are (pixels, samples, 3), `wo` and `target` (pixels, 3): pixel = sum over samples of f(wi, wo) weight.
    """

    wi: np.ndarray
    wo: np.ndarray
    weight: np.ndarray
    target: np.ndarray
    noise: np.ndarray | None
    """Standard error of the target where the file has it: its law, never its value at one pixel, informs the weights."""
    index: np.ndarray
    """Row-major place of each pixel in the image."""
    shape: tuple[int, int] | None
    """Of the image; None for a measured BRDF, where `index` is the place in the file."""
    place: Place | None = None
    """Where on the surface each pixel is: texture coordinates (pixels, 2) where there are any, distance to the camera
    and part of the sky that is seen, both (pixels,)."""
    lights: tuple[str, ...] = ()
    """Name of the light that each sample is of, (samples,); empty for a measured BRDF."""

    def relit(self, lit: Lit) -> "Samples":
        """The same under lights that are as bright."""
        if not lit:
            return self
        scale = np.stack([factor(name, lit) for name in self.lights]).astype(np.float32)
        return dataclasses.replace(self, weight=self.weight * scale)

    @property
    def turn(self) -> np.ndarray:
        """A number (pixels,) by which parts of the reference are told apart that each hold every half angle: in an image the angle around
        the highlight, in a measurement the difference angle."""
        wi = self.wi[np.arange(len(self.index)), np.argmax(self.weight.sum(-1), 1)]
        h = wi + self.wo
        if self.shape is None:
            return -np.linalg.norm(h, axis=-1)
        peak = self.index[np.argmin(np.hypot(h[:, 0], h[:, 1]) / np.maximum(h[:, 2], 1e-6))]
        y, x = np.divmod(self.index, self.shape[1])
        y0, x0 = divmod(int(peak), self.shape[1])
        return np.arctan2(y - y0, x - x0)

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, Place | None]:
        """wi, wo, weight and place: what a material is evaluated at."""
        return self.wi, self.wo, self.weight, self.place

    def some(self, which: np.ndarray) -> "Samples":
        """Those of some of the pixels, by their places among these."""
        place = self.place
        if place is not None:
            given = {f.name: getattr(place, f.name) for f in dataclasses.fields(place)}
            place = Place(**{name: value if value is None else value[which] for name, value in given.items()})
        arrays = {name: getattr(self, name)[which] for name in ("wi", "wo", "weight", "target", "index")}
        noise = None if self.noise is None else self.noise[which]
        return dataclasses.replace(self, **arrays, noise=noise, place=place)


@dataclasses.dataclass(frozen=True)
class View:
    """A reference, read: the geometry of its usable pixels, from which samples are drawn at any quality."""

    reference: Reference
    target: np.ndarray
    noise: np.ndarray | None
    position: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray | None
    uv: np.ndarray | None
    view: np.ndarray
    index: np.ndarray
    shape: tuple[int, int]
    dropped: dict[str, int]
    """Pixels that are not used, by reason."""
    picture: np.ndarray
    """The whole image, (H, W, 3), for looking at."""

    @property
    def exact(self) -> bool:
        """Whether every light is a point: no quadrature."""
        return all(is_exact(light) for light in self.reference.lights)

    @property
    def covered(self) -> np.ndarray:
        """Where the usable pixels are, (H, W)."""
        return self.image(np.ones(len(self.index), bool))

    def image(self, values: np.ndarray) -> np.ndarray:
        """Values (pixels, ...) put back in their places, (H, W, ...); elsewhere 0."""
        image = np.zeros((self.shape[0] * self.shape[1], *values.shape[1:]), values.dtype)
        image[self.index] = values
        return image.reshape(*self.shape, *values.shape[1:])

    def some(self, which: np.ndarray) -> "View":
        """The view of some of its usable pixels alone: their places (n,), or a mask of them all."""
        fields = ("target", "noise", "position", "normal", "tangent", "uv", "view", "index")
        kept = {name: getattr(self, name)[which] for name in fields if getattr(self, name) is not None}
        return dataclasses.replace(self, **kept)

    def check(self, stack: Stack) -> None:
        """Raise `InputError` for a material that cannot be drawn here: one with a grain, where nothing says which way it runs."""
        oriented = [f"{layer.name}.{grain(layer)}" for layer in (*stack.layers, stack.base) if grain(layer)]
        if oriented and self.tangent is None:
            raise InputError(
                f"{self.reference.exr}: {oriented[0]} is measured along a tangent, and there is none. Render a tangent channel, name it "
                f'with tangent = "..." under [reference], give [geometry] kind = "sphere", or leave {oriented[0]} out for an isotropic one'
            )

        if "uv" in stack.reads and self.uv is None:
            raise InputError(
                f"{self.reference.exr}: the material varies over the surface, and there are no texture coordinates. Render a uv channel, name "
                'it with uv = "..." under [reference], or give [geometry] kind = "sphere"'
            )

    def scales(self, stack: Stack) -> np.ndarray | None:
        """Thickness of each layer in this image over that of the material, the base last, or None where all are 1."""
        return layer_scales(self.reference.thickness_scale, stack)

    @property
    def directions(self) -> int:
        """Light samples a pixel of a quadrature: the same radiance from everywhere takes an eighth of what a map does."""
        plain = all(is_exact(light) or isinstance(light, Constant) for light in self.reference.lights)
        return QUADRATURE // 8 if plain else QUADRATURE

    def relit(self, lit: Lit) -> "View":
        """The same view under lights that are as bright, and the ambient one that there may be."""
        return dataclasses.replace(
            self, reference=dataclasses.replace(self.reference, lights=brighter(self.reference.lights, lit))
        )

    def moved(self, which: np.ndarray, dx: float, dy: float) -> "View":
        """Some pixels, seen at a place beside their centres: `dx`, `dy` in pixels, along the surface that their neighbours show."""
        y, x = np.divmod(self.index[which], self.shape[1])
        covered = np.pad(self.covered, 1)

        def at(values: np.ndarray) -> np.ndarray:
            image = np.pad(self.image(values), ((1, 1), (1, 1), (0, 0)))
            here = image[y + 1, x + 1]
            moved = here
            for step, (sy, sx) in ((dx, (0, 1)), (dy, (1, 0))):
                after, before = (y + 1 + sy, x + 1 + sx), (y + 1 - sy, x + 1 - sx)
                there = [np.where(covered[place][:, None], image[place], here) for place in (after, before)]
                steps = covered[after].astype(float) + covered[before]
                moved = moved + step * (there[0] - there[1]) / np.maximum(steps, 1.0)[:, None]
            return moved

        position = at(self.position)
        view = normalise(np.asarray(self.reference.camera.position) - position)
        return dataclasses.replace(self.some(which), normal=normalise(at(self.normal)), position=position, view=view)

    def samples(self, which: np.ndarray | None = None, quadrature: int = QUADRATURE, seed: int = 0) -> Samples:
        """Samples of all usable pixels, or of some."""
        which = np.arange(len(self.index)) if which is None else which
        normal, view = self.normal[which], self.view[which]
        received = receive(self.reference.lights, self.position[which], normal, view, quadrature, seed)
        to_surface = frames(normal, None if self.tangent is None else self.tangent[which])
        return Samples(
            wi=(received.to_light @ to_surface.swapaxes(1, 2)).astype(np.float32),
            wo=np.einsum("nij,nj->ni", to_surface, view).astype(np.float32),
            weight=received.weight.astype(np.float32),
            target=self.target[which].astype(np.float32),
            noise=None if self.noise is None else self.noise[which].astype(np.float32),
            index=self.index[which],
            shape=self.shape,
            place=self._place(which),
            lights=tuple(self.reference.lights[k].name for k in received.source),
        )

    def _place(self, which: np.ndarray) -> Place:
        away = np.asarray(self.reference.camera.position) - self.position[which]
        uv = None if self.uv is None else self.uv[which].astype(np.float32)
        up = normalise(np.asarray(self.reference.camera.up, float))
        sky = 0.5 * (1.0 + self.normal[which] @ up)
        return Place(uv, np.linalg.norm(away, axis=-1).astype(np.float32), sky.astype(np.float32))


def layer_scales(scales: Mapping[str, float], stack: Stack) -> np.ndarray | None:
    """Scale of the thickness of each layer of a material, the base last, or None where all are 1."""
    scale = [scales.get(layer.name, 1.0) for layer in (*stack.layers, stack.base)]
    return None if all(s == 1.0 for s in scale) else np.array(scale, np.float32)
