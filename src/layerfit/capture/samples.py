"""From a reference image to flat samples: what the fit, the picture and the shader check are all computed from."""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .._place import Place, grain
from ..errors import InputError
from ..stack import Stack
from .channels import Channels, resolve
from .exr import read_exr
from .geometry import Surface, frames, normalise, sphere_surface, sphere_tangent, sphere_uv
from .lights import is_exact, receive
from .png import read_png
from .scene import Camera, Constant, Light, Lit, Reference, Sphere, brighter, factor

QUADRATURE = 992
"""Directions a pixel for light that is not a point: a pixel is off by 1 % (rms) under the studio map of the examples, with a coat of width .1."""

PROBES = 256
"""Pixels, and directions of each, that are tried before a quadrature is said to receive no light."""

LEAST_SINE = 1e-3
"""Of the angle between tangent and normal, times the length of the tangent: below it rounding decides where the tangent points."""

LEAST_PIXELS = 32
"""Fewer usable pixels than this are a fault of the scene, not a reference."""

KEPT_PIXELS = 2**18
"""Of an image whose geometry is remembered for the next one: some 30 MB."""

UNLIT = "lit at a grazing angle or not at all (cosine below {:g})"
"""Why a pixel that is seen well is not used."""


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


@dataclasses.dataclass(frozen=True, eq=False)
class Usable:
    """The pixels of an image that can be compared, by their row-major places, and where they lie."""

    index: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray | None
    uv: np.ndarray | None
    view: np.ndarray
    dropped: dict[str, int]


def load_reference(reference: Reference, min_cosine: float) -> View:
    """Read a reference render and keep the pixels that can be compared: covered, finite, seen and lit at no grazing angle."""
    channels = resolve(read_exr(reference.exr), dict(reference.channels))
    beauty = channels.beauty
    usable = _usable(reference, channels, min_cosine)
    _check(reference, usable, beauty)
    pick = lambda image: image.reshape(-1, 3)[usable.index].astype(float)  # noqa: E731
    return View(
        reference=reference,
        target=pick(beauty),
        noise=None if channels.noise is None else pick(channels.noise),
        position=usable.position,
        normal=usable.normal,
        tangent=usable.tangent,
        uv=usable.uv,
        view=usable.view,
        index=usable.index,
        shape=beauty.shape[:2],
        dropped=usable.dropped,
        picture=beauty,
    )


def _usable(reference: Reference, channels: Channels, min_cosine: float) -> Usable:
    height, width = channels.beauty.shape[:2]
    finite, mask = np.all(np.isfinite(channels.beauty), -1), _mask(reference.mask, (height, width))
    eye = np.asarray(reference.camera.position)
    if reference.geometry is None:
        surface, tangent, uv = _surface(reference, channels)
        return _compared(surface, tangent, uv, eye, reference.lights, min_cosine, finite, mask)
    if np.linalg.norm(eye - reference.geometry.center) <= reference.geometry.radius:
        raise InputError(f"{reference.exr}: the camera stands inside the sphere; check camera.position and geometry.radius")
    where = (
        reference.geometry,
        reference.camera,
        reference.lights,
        min_cosine,
        height,
        width,
        finite.tobytes(),
        mask.tobytes(),
    )
    small = height * width <= KEPT_PIXELS and all(is_exact(light) for light in reference.lights)
    return _on_sphere(*where) if small else _on_sphere.__wrapped__(*where)


@functools.lru_cache(maxsize=4)
def _on_sphere(
    sphere: Sphere,
    camera: Camera,
    lights: tuple[Light, ...],
    min_cosine: float,
    height: int,
    width: int,
    finite: bytes,
    mask: bytes,
) -> Usable:
    """Many images of one sphere under the same light, as those of a study, differ in their colours alone."""
    surface = sphere_surface(sphere, camera, height, width)
    left = (np.frombuffer(of, bool).reshape(height, width) for of in (finite, mask))
    tangent, uv = sphere_tangent(surface.normal, camera.up), sphere_uv(surface.normal, camera.up)
    return _compared(surface, tangent, uv, np.asarray(camera.position), lights, min_cosine, *left)


def _compared(
    surface: Surface,
    tangent: np.ndarray | None,
    uv: np.ndarray | None,
    eye: np.ndarray,
    lights: tuple[Light, ...],
    min_cosine: float,
    finite: np.ndarray,
    mask: np.ndarray,
) -> Usable:
    """The pixels that can be compared, of those (H, W) that are finite in the file and not masked."""
    view = normalise(eye - surface.position)
    reasons = {
        "not covered by the object": surface.covered,
        "NaN or infinite": finite & np.all(np.isfinite(surface.normal), -1),
        "masked": mask,
        f"seen at a grazing angle (cosine below {min_cosine:g})": min_cosine < np.sum(surface.normal * view, -1),
    }
    if tangent is not None:
        # A surface without texture coordinates has zeros in the tangent channel: no frame can be made of them.
        reasons["without a tangent"] = np.linalg.norm(np.cross(tangent, surface.normal), axis=-1) > LEAST_SINE
    kept = np.ones(mask.shape, bool)
    dropped = {}
    for reason, passes in reasons.items():
        dropped[reason] = int(np.sum(kept & ~passes))
        kept &= passes
    index = np.flatnonzero(kept)
    if all(is_exact(light) for light in lights):
        args = (surface.position.reshape(-1, 3)[index], surface.normal.reshape(-1, 3)[index], view.reshape(-1, 3)[index])
        received = receive(lights, *args, samples=1, seed=0)
        NoL = np.einsum("nsj,nj->ns", received.to_light, args[1])
        lit = np.any((min_cosine < NoL) & np.any(received.weight > 0.0, -1), 1)
        # A pixel that a grazing light reaches and no other holds little but the model's weakest angle.
        dropped[UNLIT.format(min_cosine)] = int(np.sum(~lit))
        index = index[lit]
    pick = lambda image: image.reshape(-1, image.shape[-1])[index]  # noqa: E731
    left_out = {reason: count for reason, count in dropped.items() if count}
    return Usable(
        index=index,
        position=pick(surface.position),
        normal=pick(surface.normal),
        tangent=None if tangent is None else pick(tangent),
        uv=None if uv is None else pick(uv),
        view=pick(view),
        dropped=left_out,
    )


def _check(reference: Reference, usable: Usable, beauty: np.ndarray) -> None:
    """Raise `InputError` for an image of which too little can be compared."""
    size, exact = usable.index.size, all(is_exact(light) for light in reference.lights)
    if size < LEAST_PIXELS:
        if exact and size + sum(count for reason, count in usable.dropped.items() if reason.startswith(UNLIT[:3])):
            raise InputError(_unlit(reference))
        lost = ", ".join(f"{count} {reason}" for reason, count in usable.dropped.items())
        raise InputError(f"{reference.exr}: only {size} of {beauty.shape[0] * beauty.shape[1]} pixels can be compared ({lost})")
    if not np.any(beauty.reshape(-1, 3)[usable.index] > 0.0):
        raise InputError(
            f"{reference.exr}: the object is black in every usable pixel; check the beauty channels and the lights"
        )
    if not exact:
        some = slice(None, None, max(1, size // PROBES))
        args = (values[some] for values in (usable.position, usable.normal, usable.view))
        if not np.any(receive(reference.lights, *args, samples=PROBES, seed=0).weight > 0.0):
            raise InputError(_unlit(reference))


def _unlit(reference: Reference) -> str:
    return f"{reference.exr}: no light reaches the visible side of the object; check where the lights in [[light]] are, and how bright"


def _surface(reference: Reference, channels: Channels) -> tuple[Surface, np.ndarray | None, np.ndarray | None]:
    """The surface as the file has it, its tangents and its texture coordinates."""
    if channels.normal is None or channels.position is None:
        missing = "normal" if channels.normal is None else "position"
        raise InputError(
            f'{reference.exr}: there is no {missing} channel and the scene gives no geometry. Render one, name it with {missing} = "..." '
            'under [reference], or give [geometry] kind = "sphere".'
        )
    length = np.linalg.norm(channels.normal, axis=-1)
    covered = length > 0.5
    if channels.alpha is not None:
        covered &= channels.alpha > 1.0 - 1e-4
    else:
        # Without coverage, a pixel at a silhouette shows in its neighbours: some of them are empty.
        covered = _eroded(covered)
    tangent = None if channels.tangent is None else channels.tangent.astype(float)
    surface = Surface(channels.position.astype(float), normalise(channels.normal.astype(float)), covered)
    return surface, tangent, None if channels.uv is None else channels.uv.astype(float)


def _eroded(mask: np.ndarray) -> np.ndarray:
    padded = np.pad(mask, 1, constant_values=False)
    result = mask.copy()
    for dy in (0, 1, 2):
        for dx in (0, 1, 2):
            result &= padded[dy : dy + mask.shape[0], dx : dx + mask.shape[1]]
    return result


def _mask(path: Path | None, shape: tuple[int, int]) -> np.ndarray:
    if path is None:
        return np.ones(shape, bool)
    first = read_png(path) if path.suffix.lower() == ".png" else next(iter(read_exr(path).channels.values()))
    if first.shape != shape:
        raise InputError(
            f"{path}: the mask is {first.shape[1]} x {first.shape[0]}, the reference {shape[1]} x {shape[0]} pixels"
        )
    return first > 0.5
