"""`layerfit map`: images of one object under several lights, and a fit for every texel of it.

What varies over the object (thickness, width, the normal) is fitted texel by texel; all else is shared: as the scene says, or fitted to all
images first. Texels are fitted in tiles, each kept as it is done: memory holds the images and one tile, and what is interrupted goes on.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jax
import numpy as np

from ..capture.load import load
from ..capture.scene import Scene
from ..capture.scene_file import check_request, read_scene
from ..documents import check_directory, nearest
from ..errors import InputError
from ..fit.fit import fit
from ..fit.nuisances import THICKNESS
from ..fit.parameters import Parametrisation, with_fixed
from ..shader.gl import renderer
from ..stack import Stack
from .descent import Descent, Found
from .files import written
from .judge import Judged, doubtful, judge, limit
from .kept import Tiles
from .model import Seen
from .parameters import TILT, mapped
from .result import MapFit, result_of
from .smooth import smoothed
from .texels import Texels, observe

TILE = 8192
"""Texels that are fitted and kept together."""

Progress = Callable[[str, float], None]


def fit_map(
    scene: str | Path | Scene,
    directory: str | Path | None = None,
    *,
    free: Sequence[str] | None = None,
    shared: Sequence[str] = (),
    smooth: float | Mapping[str, float] | None = None,
    size: int | None = None,
    starts: int | None = None,
    progress: Progress = lambda stage, share: None,
) -> MapFit:
    """Fit parameters of a material texel by texel to the references of a scene, and write the maps to `directory` where one is given.

    `free` are the parameters that vary, such as "coat.thickness_um", "coat.thickness_scale" or "tilt" (both slopes of the normal); left out,
    those of the scene's [map]. `shared` are parameters that are alike in all texels and fitted to all images first; all others are as the
    scene's [material] says. `smooth` is by how much neighbours differ, one standard deviation in the coordinates of the fit (a part of the value,
    for most), for all parameters or by name; left out, neighbours know nothing of one another. `size` makes the map one of texture coordinates,
    `size` x `size` texels; left out, a texel is a pixel. `starts` are tried in every texel. Raises `InputError` for a scene that cannot be
    mapped, and with a directory `MachineError` where there is no OpenGL.
    """
    scene = scene if isinstance(scene, Scene) else read_scene(scene)
    directory = None if directory is None else Path(directory)
    if directory is not None:
        check_directory(directory)
        renderer()  # a machine that cannot verify a shader is told so before the fits
    asked = scene.map
    free = asked.free if free is None else tuple(free)
    smooth, size = asked.smooth if smooth is None else smooth, asked.size if size is None else size
    starts = asked.starts if starts is None else starts
    where = f"{scene.path}: map"
    check_request({"starts": starts}, where)
    if both := set(free or ()).intersection(shared):
        raise InputError(f"{where}: {min(both)} is both free and shared: it varies over the object, or is one for all of it")
    scene = dataclasses.replace(scene, start=with_fixed(scene.start, scene.fit.fixed, f"{scene.path}: fit.fixed"))
    mapped(scene.start, free, f"{where}.free")  # before anything is read
    with jax.enable_x64(True):
        if shared:
            scene = _shared(scene, free, shared, progress)
        start, chosen = mapped(scene.start, free, f"{where}.free")
        if start.needs:
            raise InputError(
                f"{where}: the material varies over the surface by itself, by its {', '.join(start.needs)}; map one that does not"
            )
        widths = _widths(chosen, smooth, f"{where}.smooth")
        progress("reading", 0.0)
        texels = observe(scene, start, size)
        question = {"free": chosen.names, "size": size, "starts": starts, "loss": scene.fit.loss, "seed": scene.fit.seed}
        tiles = Tiles(directory, scene, question)
        work = _Map(texels, start, chosen, scene, starts, tiles, progress)
        result = work.run(widths)
        if directory is not None:
            progress("shader", 0.0)
            result = dataclasses.replace(result, document=written(result, work.descent, directory, scene.path.stem))
            tiles.done()
    return result


def _shared(scene: Scene, free: Sequence[str], shared: Sequence[str], progress: Progress) -> Scene:
    """The scene that starts at a fit of all images together, in which what is to vary is one number for all."""
    own = [name for name in free if name.partition(".")[0] != TILT and not name.endswith(THICKNESS)]
    found = fit(
        load(scene),
        scene.start,
        free=[*own, *(name for name in shared if name not in own)],
        metric=scene.fit.metric,
        loss=scene.fit.loss,
        starts=scene.fit.starts,
        seed=scene.fit.seed,
        where=f"{scene.path}: map.shared",
        progress=progress,
    )
    return dataclasses.replace(scene, start=found.stack)


def _widths(free: Parametrisation, smooth: float | Mapping[str, float] | None, where: str) -> np.ndarray:
    """How far neighbours differ in each entry of the vector; infinite where they are not coupled."""
    groups = {f.name: TILT if f.layer is None else f.name for f in free.free}
    by_name = smooth if isinstance(smooth, Mapping) else dict.fromkeys(groups.values(), smooth)
    if unknown := [name for name in by_name if name not in groups.values()]:
        raise InputError(
            f"{where}: {unknown[0]!r} is not mapped{nearest(unknown[0], groups.values())}; {', '.join(groups.values())} are"
        )
    widths = [by_name.get(groups[f.name]) for f in free.free for _ in f.slots]
    if any(width is not None and not width > 0.0 for width in widths):
        raise InputError(
            f"{where}: should be above 0: by how much neighbours differ. Leave it out for texels that are fitted apart"
        )
    return np.array([np.inf if width is None else width for width in widths])


class _Map:
    def __init__(
        self, texels: Texels, start: Stack, free: Parametrisation, scene: Scene, starts: int, tiles: Tiles, progress: Progress
    ) -> None:
        self.texels, self.start, self.free, self.tiles, self.progress = texels, start, free, tiles, progress
        self.descent = Descent(texels, start, free, scene.fit.loss, starts, scene.fit.seed)
        self.parts = np.array_split(np.arange(len(texels.index)), -(-len(texels.index) // TILE))

    def run(self, widths: np.ndarray) -> MapFit:
        found = self._fitted()
        judged = judge(found, self.texels.seen, self.free.bounds())
        told = found
        if np.any(np.isfinite(widths)):
            self.progress("smooth", 0.0)
            at = lambda u: self._at(u, found.u)  # noqa: E731
            told = smoothed(found, self.texels.index, self.texels.shape, widths, judged.scatter, self.free.bounds(), at)
        told = self._limited(told, found, judged, np.isfinite(widths))
        return result_of(self.texels, self.start, self.free, told.u, judged, self._misfit(told.u))

    def _fitted(self) -> Found:
        """Every texel by itself, tile by tile."""
        parts = []
        for k, which in enumerate(self.parts):
            self.progress("texels", k / len(self.parts))
            part = self.tiles.get(k)
            if part is None:
                part, _ = self.descent.solve(which)
                self.tiles.put(k, part)
            parts.append(part)
        return Found.together(parts)

    def _seen(self, which: np.ndarray, u: np.ndarray) -> Seen:
        """Observations as they were weighted in the end, by the models at `u`."""
        return self.descent.weighed(u, self.descent.seen(which), which)

    def _at(self, u: np.ndarray, weighed: np.ndarray) -> Found:
        return Found.together([self.descent.at(u[which], self._seen(which, weighed[which])) for which in self.parts])

    def _limited(self, told: Found, found: Found, judged: Judged, coupled: np.ndarray) -> Found:
        """Limits for what single texels do not tell; what neighbours tell is left to them."""
        shared, u = self.free.pack(self.start), np.array(told.u)
        for slot in range(self.free.size):
            texels = doubtful(judged, slot)
            for which in np.array_split(texels, -(-len(texels) // TILE)) if len(texels) else []:
                self.progress("limits", slot / self.free.size)
                ends = limit(
                    self.descent, found.some(which), self._seen(which, found.u[which]), slot, judged.scatter, shared[slot]
                )
                judged.flags[which, slot] |= ends[1]
                if not coupled.any():
                    u[which] = ends[0]
        return dataclasses.replace(told, u=u)

    def _misfit(self, u: np.ndarray) -> np.ndarray:
        """Sums of squares of residuals and of pixels, (n, 2), unweighted."""
        rows = []
        for which in self.parts:
            seen = self.descent.seen(which)
            there = seen.inverse_sigma > 0.0
            off = (self.descent.values(u[which], seen) - seen.target) * there
            rows.append(np.stack([np.sum(off**2, (1, 2)), np.sum((seen.target * there) ** 2, (1, 2))], -1))
        return np.concatenate(rows)
