"""A shape of a material in a context of OpenGL: passes of its shader, each with other points of the lights, added up until still.

The stages, the lights, the camera and the shapes are those of the pages (`report/page`), so that a window and a page show the same.
"""

import json
import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..capture.geometry import normalise
from ..report import pages
from ..shader.export import Shader
from .shapes import mesh

PASSES = 768
LIGHTS = 4
"""In one pass: the key light, and a point of each soft box."""
ROBERTS = ((0.7548776662, 0.37), (0.5698402910, 0.61))
"""Of both coordinates: the step from pass to pass, and how many passes apart the lights are."""
HALF_FOV = math.radians(13.0)
SLOW_S = 0.1
"""A pass that takes longer keeps the hand waiting: it is drawn in fewer pixels."""
COARSEST = 0.25
"""Of the pixels along a side."""
STUDIO = json.loads(pages.text("studio.json"))


def toward(yaw: float, pitch: float) -> np.ndarray:
    """Unit vector (3,) of two angles [rad]."""
    return np.array([math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)])


def lights(k: int, yaw: float, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (4, 4) and irradiances (4, 3) of pass k: a point of the key light and of each soft box, by a sequence that fills a square
    evenly (Roberts 2018)."""

    def at(n: int) -> list[float]:
        return [2.0 * ((0.5 + step * (k + apart * n)) % 1.0) - 1.0 for step, apart in ROBERTS]

    key = toward(yaw, pitch)
    a, b = at(0)
    side = normalise(np.cross([0.0, 1.0, 0.0], key))
    places = [key + STUDIO["key"]["size"] * (a * side + b * np.cross(key, side))]
    colours = [[STUDIO["key"]["irradiance"]] * 3]
    for n, box in enumerate(STUDIO["boxes"], 1):
        s, t = at(n)
        places.append(normalise(np.add(box["to"], np.multiply(s, box["across"])) + np.multiply(t, box["along"])))
        colours.append(box["rgb"])
    return np.pad(np.array(places), ((0, 0), (0, 1))), np.array(colours)


class Camera:
    """It looks at the origin from a distance, 26 degrees across the shorter side; `shift` moves the picture by parts of a pixel."""

    def __init__(
        self, yaw: float, pitch: float, distance: float, size: tuple[int, int], shift: tuple[float, float] = (0.0, 0.0)
    ):
        self.distance, self.back = distance, toward(yaw, pitch)
        self.right = normalise(np.cross([0.0, 1.0, 0.0], self.back))
        self.up = np.cross(self.back, self.right)
        self.eye = distance * self.back
        near, far = distance - 2.0, distance + 2.0
        self.scale = min(size) / math.tan(HALF_FOV) / np.array(size)
        moved = 2.0 * np.array(shift) / size
        z = (far + near) / (far - near)
        self.matrix = np.array(
            [
                [*(self.scale[0] * self.right - moved[0] * self.back), moved[0] * distance],
                [*(self.scale[1] * self.up - moved[1] * self.back), moved[1] * distance],
                [*(-z * self.back), z * distance - 2.0 * far * near / (far - near)],
                [*(-self.back), distance],
            ]
        )

    def place(self, point: np.ndarray) -> np.ndarray:
        """Where a point (3,) is in the picture: across and up, -1 to 1."""
        return self.scale * np.array([self.right @ point, self.up @ point]) / (self.distance - self.back @ point)


def replaced(old: Any, new: Any) -> Any:
    """A framebuffer that takes the place of another, which is given back; None for the first."""
    new.use()  # before the old one goes: moderngl would bind the released one again
    if old is not None:
        for held in (*old.color_attachments, old.depth_attachment, old):
            if held is not None:
                held.release()
    return new


class Picture:
    """What is seen of a material, its numbers by the names of its uniforms."""

    def __init__(self, ctx: Any, shader: Shader):
        self.ctx = ctx
        stage = lambda name: pages.stage(name, "glsl330")  # noqa: E731
        fragment = shader.text("glsl330").replace("\n", f"\n#define LF_LIGHTS {LIGHTS}\n", 1)
        self.material = ctx.program(vertex_shader=stage("mesh.vert"), fragment_shader=fragment)
        self.shown = ctx.program(vertex_shader=stage("screen.vert"), fragment_shader=stage("show.frag"))
        self.added = ctx.program(vertex_shader=stage("screen.vert"), fragment_shader=stage("add.frag"))
        self.nothing = {program: ctx.vertex_array(program, []) for program in (self.shown, self.added)}
        self.meshes: dict[str, Any] = {}
        self.shape = "sphere"
        self.values: Mapping[str, np.ndarray] = shader.uniforms
        self.yaw, self.pitch, self.distance = 0.0, 0.17, 5.0
        self.light = (-0.65, 0.6)
        self.exposure, self.tone = 0.0, 0
        self.passes, self.fineness = 0, 1.0
        self.one: Any = None
        """The pass that is drawn, with its depths."""
        self.totals: list[Any] = [None, None]
        """Two sums of passes: each is written with the other before it."""
        self.resize((1, 1))
        self._draw()  # some drivers compile only then, which says nothing of their pace

    def _mesh(self) -> Any:
        """That of the shape, with as much of a vertex as the shader reads."""
        if self.shape not in self.meshes:
            vertices, triangles = mesh(self.shape)
            buffers = [
                (self.ctx.buffer(values.astype("f4").tobytes()), f"{values.shape[1]}f", name)
                for name, values in vertices.items()
                if name in self.material
            ]
            corners = self.ctx.buffer(triangles.astype("u4").tobytes())
            self.meshes[self.shape] = self.ctx.vertex_array(self.material, buffers, corners)
        return self.meshes[self.shape]

    @property
    def total(self) -> Any:
        """The sum of the passes: a framebuffer."""
        return self.totals[self.passes % 2]

    def resize(self, size: tuple[int, int]) -> None:
        """Take a size in pixels, and begin anew."""
        self.size = size
        fine = tuple(max(1, round(side * self.fineness)) for side in size)
        texture = lambda: [self.ctx.texture(fine, 4, dtype="f4")]  # noqa: E731
        self.one = replaced(self.one, self.ctx.framebuffer(texture(), self.ctx.depth_renderbuffer(fine)))
        self.totals = [replaced(total, self.ctx.framebuffer(texture())) for total in self.totals]
        self.restart()

    def change(self, **changes: Any) -> None:
        """Set some of its attributes, and begin anew."""
        for name, value in changes.items():
            setattr(self, name, value)
        self.restart()

    def restart(self) -> None:
        self.passes = 0

    @property
    def still(self) -> bool:
        return self.passes >= PASSES

    def advance(self) -> None:
        """Draw one pass more, added to those before it; where that takes long, all anew in fewer pixels."""
        while self._draw() > SLOW_S and self.passes <= 3 and self.fineness > COARSEST:
            self.fineness /= 2.0
            self.resize(self.size)

    def _draw(self) -> float:
        """A pass; returns how long it took [s]."""
        begun, k = time.perf_counter(), self.passes
        if k == 0:
            self.total.clear()
        self.one.use()
        self.one.clear()
        self.ctx.enable_only(self.ctx.DEPTH_TEST)
        self._set(k)
        self._mesh().render()
        self.ctx.enable_only(self.ctx.NOTHING)
        self._screen(self.added, self.totals[(k + 1) % 2], {"u_total": self.total, "u_pass": self.one})
        self.passes += 1
        self.ctx.finish()
        return time.perf_counter() - begun

    def _set(self, k: int) -> None:
        """The uniforms of pass k: every pass after the first is moved by a part of a pixel."""
        shift = ((k * 0.618034) % 1.0 - 0.5, (k * 0.754878) % 1.0 - 0.5) if k else (0.0, 0.0)
        camera = Camera(self.yaw, self.pitch, self.distance, self.total.size, shift)
        places, colours = lights(k, *self.light)
        host = {"u_view_projection": camera.matrix.T, "u_eye": camera.eye, "u_up": np.array([0.0, 1.0, 0.0])}
        host |= {"u_light": places, "u_light_rgb": colours}
        for name, value in (host | dict(self.values)).items():
            if (member := self.material.get(name, None)) is not None:  # its compiler drops what is not read
                member.write(np.asarray(value, "f4").tobytes())

    def present(self, target: Any) -> None:
        """The mean of the passes as a screen shows it, onto a framebuffer of this picture's own size; nothing is drawn behind it."""
        self.ctx.enable_only(self.ctx.NOTHING)
        numbers = {"u_passes": float(self.passes), "u_exposure": 2.0**self.exposure, "u_tone": self.tone}
        self._screen(self.shown, target, {"u_total": self.total}, numbers)

    def _screen(self, program: Any, target: Any, pictures: Mapping[str, Any], numbers: Mapping[str, Any] = {}) -> None:
        """Fill a framebuffer by a program that reads pictures of its size."""
        target.use()
        for k, (name, picture) in enumerate(pictures.items()):
            picture.color_attachments[0].use(k)
            program[name].value = k
        for name, value in numbers.items():
            program[name].value = value
        self.nothing[program].render(self.ctx.TRIANGLES, vertices=3)
