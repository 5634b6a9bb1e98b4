"""Render printed shaders in a real OpenGL context, off screen, to float32. The only file that imports moderngl."""

import functools
import math
from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np

from ..errors import MachineError

MARKER = -7.0
"""Alpha of a pixel that nothing was drawn to: an unbound framebuffer or a shader that discards would return zeros and no error."""

_POINT_VERTEX = """\
{version}
in vec2 a_pixel;
{inputs}
{outputs}
void main() {{
    gl_Position = vec4(a_pixel, 0.0, 1.0);
    gl_PointSize = 1.0;
{copies}}}
"""


@functools.cache
def context() -> moderngl.Context:
    """A standalone OpenGL 3.3 context: EGL where it is found (no display needed), else the window system's.

    Raises `MachineError` with what to install where there is neither.
    """
    reasons = []
    attempts: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for settings in attempts:
        try:
            ctx = moderngl.create_context(standalone=True, require=330, **settings)
        except Exception as error:  # moderngl raises bare Exception, and glcontext ImportError, for every missing piece
            reasons.append(f"{settings.get('backend', 'window system')}: {error}")
            continue
        ctx.enable_only(moderngl.PROGRAM_POINT_SIZE)
        return ctx
    raise MachineError(
        f"no OpenGL 3.3 driver was found ({'; '.join(reasons)}). A shader can only be verified where it can be rendered. "
        "On Debian or Ubuntu: apt-get install -y --no-install-recommends libegl1 libgl1-mesa-dri (a software driver, no GPU needed)."
    )


def renderer() -> str:
    """Name and version of the driver, for reports."""
    info = context().info
    return f"{info['GL_RENDERER']}, OpenGL {info['GL_VERSION']}"


SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader")
"""What drivers call themselves that draw on the processor, in threads of this process."""


def in_software() -> bool:
    """Whether the driver draws on the processor."""
    return any(name in renderer().lower() for name in SOFTWARE)


def compile_points(fragment: str, attributes: Mapping[str, int]) -> moderngl.Program:
    """Compile a fragment shader whose inputs come from one point a pixel: `attributes` are input names with their sizes."""
    kinds = {1: "float", 2: "vec2", 3: "vec3", 4: "vec4"}
    vertex = _POINT_VERTEX.format(
        version=fragment.partition("\n")[0],  # one language for both stages: GLSL ES is drawn through ARB_ES3_compatibility
        inputs="\n".join(f"in {kinds[size]} a_{name};" for name, size in attributes.items()),
        outputs="\n".join(f"out {kinds[size]} {name};" for name, size in attributes.items()),
        copies="".join(f"    {name} = a_{name};\n" for name in attributes),
    )
    try:
        return context().program(vertex_shader=vertex, fragment_shader=fragment)
    except moderngl.Error as error:
        raise MachineError(f"the GL driver ({renderer()}) does not compile the shader:\n{error}") from None


def set_uniforms(program: moderngl.Program, uniforms: Mapping[str, object]) -> None:
    """Give a program its uniforms; those that its compiler dropped are left out."""
    for name, value in uniforms.items():
        if isinstance(member := program.get(name, None), moderngl.Uniform):
            member.value = value


def shade_points(
    fragment: str,
    attributes: Mapping[str, np.ndarray],
    uniforms: Mapping[str, object] | None = None,
    textures: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """Run a fragment shader once for each row of `attributes` and return what it wrote, (n, 3) float32.

    Each row is one pixel of its own, drawn as a point with the row as the shader's inputs: geometry from any source reaches the
    shader as an engine's varyings would. An attribute of three axes (passes, n, k) makes as many passes, which are added up. `textures` are
    arrays (H, W, channels) by the names of their samplers, row 0 at the top (v = 1), read by linear filtering.

    Raises `MachineError` when a pixel was not drawn, or one that should have stayed empty was.
    """
    ctx = context()
    passes = max((a.shape[0] for a in attributes.values() if a.ndim == 3), default=1)
    n = next(a.shape[-2] for a in attributes.values())
    width = min(1024, max(2, math.ceil(math.sqrt(n + 1))))
    height = (n + 1 + width - 1) // width  # at least one pixel more than rows: the sentinel
    program = compile_points(fragment, {name: a.shape[-1] for name, a in attributes.items()})
    set_uniforms(program, uniforms or {})
    row, column = np.divmod(np.arange(n), width)
    pixel = np.stack([(column + 0.5) / width * 2.0 - 1.0, (row + 0.5) / height * 2.0 - 1.0], -1).astype("f4")
    used = {name: a for name, a in attributes.items() if f"a_{name}" in program}
    target = float_target((width, height))
    buffers = {name: ctx.buffer(reserve=n * a.shape[-1] * 4) for name, a in used.items()}
    pixels = ctx.buffer(pixel.tobytes())
    samplers = _bound(program, textures or {})
    content = [(pixels, "2f", "a_pixel")] + [(buffers[name], f"{a.shape[-1]}f", f"a_{name}") for name, a in used.items()]
    array = ctx.vertex_array(program, content)
    total = np.zeros((n, 3), np.float64)
    try:
        for k in range(passes):
            for name, a in used.items():
                if k == 0 or a.ndim == 3:
                    buffers[name].write(np.ascontiguousarray(a[k] if a.ndim == 3 else a, dtype="f4").tobytes())
            target.clear(0.0, 0.0, 0.0, MARKER)
            array.render(moderngl.POINTS)
            image = np.frombuffer(target.read(components=4, dtype="f4"), "f4").reshape(height * width, 4)
            _check_drawn(image[:, 3], n)
            total += image[:n, :3]
        if (error := ctx.error) != "GL_NO_ERROR":
            raise MachineError(f"the GL driver ({renderer()}) reports {error} after drawing")
    finally:
        for resource in (array, pixels, *buffers.values(), *samplers, program):
            resource.release()
    return total.astype(np.float32)


def _bound(program: moderngl.Program, textures: Mapping[str, np.ndarray]) -> list[moderngl.Texture]:
    """Float textures in the units of their samplers; without mipmaps."""
    made = []
    for unit, (name, values) in enumerate(textures.items()):
        height, width, channels = values.shape
        rows = np.ascontiguousarray(values[::-1], "f4")  # GL counts rows from the bottom
        texture = context().texture((width, height), channels, rows.tobytes(), dtype="f4", alignment=4)
        texture.filter = moderngl.LINEAR, moderngl.LINEAR
        texture.use(unit)
        set_uniforms(program, {name: unit})
        made.append(texture)
    return made


_targets: list[moderngl.Framebuffer] = []


def float_target(size: tuple[int, int]) -> moderngl.Framebuffer:
    """A float32 framebuffer of this size, in use; the previous one is kept where it fits and released where not."""
    if _targets and _targets[0].size == size:
        return _targets[0]
    try:
        new = context().framebuffer([context().texture(size, 4, dtype="f4")])
    except moderngl.Error as error:
        raise MachineError(
            f"the GL driver ({renderer()}) does not draw to float32 images of {size[0]} x {size[1]} pixels ({error}), without which no shader "
            "can be verified. Use another driver: LIBGL_ALWAYS_SOFTWARE=1 chooses Mesa's own."
        ) from None
    new.use()  # before the old one goes: moderngl would bind the released one again
    for old in _targets:
        old.color_attachments[0].release()
        old.release()
    _targets[:] = [new]
    return new


def _check_drawn(alpha: np.ndarray, n: int) -> None:
    missing = np.flatnonzero(alpha[:n] == MARKER)
    if missing.size:
        raise MachineError(
            f"the GL driver ({renderer()}) left {missing.size} of {n} pixels undrawn, the first is number {missing[0]}"
        )
    if not np.all(alpha[n:] == MARKER):
        raise MachineError(f"the GL driver ({renderer()}) drew to pixels outside the image: its float target cannot be trusted")
