"""What a printed shader costs: instructions after an optimiser, which are the same everywhere, and time on the machine at hand.

Both are of `shaders/cost.frag`: a normal and a view for each pixel, distant lights, one after the other without a loop, so that what they share
is counted once. Times are ratios to a Phong shader of the same template, drawn in the same round: what else the machine does weighs on both.
"""

import dataclasses
import re
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np

from ..errors import InputError, MachineError
from ..forms.corrected import Corrected
from ..stack import Stack
from ..surfaces import Phong
from .export import Shader
from .gl import compile_points, context, float_target, in_software, renderer, set_uniforms
from .template import template

MOST_LIGHTS = 8
SIDE = 1024
"""Pixels on a side of the float target that is drawn to."""
ROUNDS = 30
LEAST_MS = 10.0
"""One measurement spans as many draws as take this long: a GPU draws a million pixels in less than its timer tells."""
MOST_DRAWS = 256
CELLS = 32
"""Of the grid that covers the target: few triangles, on which a normal still changes from pixel to pixel."""

_TOOLS = "On Debian or Ubuntu: apt-get install -y --no-install-recommends glslang-tools spirv-tools."
_UNCOUNTED = {"OpFunction", "OpFunctionEnd", "OpLabel", "OpVariable"}
"""What stands in a function's body and does nothing."""


@dataclasses.dataclass(frozen=True)
class Instructions:
    """SPIR-V instructions of a fragment shader, in the bodies of its functions."""

    total: int
    kinds: Mapping[str, int]
    """How many of each, the most frequent first: `OpFMul`, and by their names those of GLSL (`Exp`, `Sqrt`)."""


@dataclasses.dataclass(frozen=True)
class Timing:
    """Time of a shader over that of Phong, of each round."""

    ratios: np.ndarray
    """(rounds,)"""
    milliseconds: float
    """Of one draw, the median; it says little without the name of the machine."""
    renderer: str

    @property
    def median(self) -> float:
        return float(np.median(self.ratios))

    @property
    def spread(self) -> tuple[float, float]:
        """Quarter and three quarters of the rounds lie below these."""
        low, high = np.quantile(self.ratios, [0.25, 0.75])
        return float(low), float(high)


def cost_text(shader: Shader, lights: int = 1) -> str:
    """The fragment shader that is counted and timed: a material under 1 to 8 distant lights. Raises `InputError` for other counts."""
    if not 1 <= lights <= MOST_LIGHTS:
        raise InputError(f"{lights} lights: costs are measured for 1 to {MOST_LIGHTS}")
    text = shader.text(file="cost.frag").replace("LF_LIGHTS", str(lights))
    found = re.search(r"^ *//@ light\n(.*\n)", text, flags=re.M)
    assert found
    return text.replace(found[0], "".join(found[1].replace("@LIGHT@", str(k)) for k in range(lights)))


@cache
def phong() -> Shader:
    """What costs are measured by: Phong 1975, written by hand in the fewest operations."""
    return Shader("phong", Stack((), Phong(), Corrected()), template("phong.glsl", frozenset()), {})


def instructions(shader: Shader, lights: int = 1) -> Instructions:
    """Count the instructions of a material's shader: glslangValidator, then spirv-opt -O. Deterministic for one version of these tools.

    Raises `MachineError` where the tools are absent, or do not take the shader.
    """
    with tempfile.TemporaryDirectory() as folder:
        source, binary, optimised = (str(Path(folder) / name) for name in ("cost.frag", "cost.spv", "optimised.spv"))
        Path(source).write_text(cost_text(shader, lights))
        _run("glslangValidator", "-G", "--aml", "--amb", "-o", binary, source)
        _run("spirv-opt", "-O", binary, "-o", optimised)
        return _count(_run("spirv-dis", "--raw-id", "--no-header", optimised))


def tools() -> str:
    """Names and versions of what counts, for reports. Raises `MachineError` where it is absent."""
    glslang = re.search(r"(?m)^Glslang Version: (\S+)", _run("glslangValidator", "--version"))
    spirv = re.search(r"SPIRV-Tools \S+", _run("spirv-dis", "--version"))
    return f"glslang {glslang[1] if glslang else 'unknown'}, {spirv[0] if spirv else 'SPIRV-Tools unknown'}"


def _run(*command: str) -> str:
    try:
        ran = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise MachineError(f"{command[0]} was not found, which instructions are counted with. {_TOOLS}") from None
    if ran.returncode:
        raise MachineError(f"{command[0]} does not take the shader:\n{ran.stdout}{ran.stderr}")
    return ran.stdout


def _count(disassembly: str) -> Instructions:
    bodies = "\n".join(re.findall(r"OpFunction .*?OpFunctionEnd", disassembly, flags=re.S))
    kinds = Counter(_kind(line) for line in re.findall(r"(Op[A-Z].*)", bodies))
    counted = {kind: n for kind, n in kinds.most_common() if kind not in _UNCOUNTED}
    return Instructions(sum(counted.values()), counted)


def _kind(instruction: str) -> str:
    words = instruction.split()
    return words[3] if words[0] == "OpExtInst" else words[0]


def times(shaders: Mapping[str, Shader], lights: int = 1, rounds: int = ROUNDS, seed: int = 0) -> dict[str, Timing]:
    """Time shaders by timer queries, or processor time where the driver is software, each round all of them and Phong in an order of its own.

    Raises `MachineError` where there is no driver, or it does not compile one of them.
    """
    drawings = [_Drawing(shader, lights) for shader in (phong(), *shaders.values())]
    rng = np.random.default_rng(seed)
    taken = np.empty((rounds, len(drawings)))
    try:
        for round_ in range(rounds):
            for k in rng.permutation(len(drawings)):
                taken[round_, k] = drawings[k].milliseconds()
    finally:
        for drawing in drawings:
            drawing.release()
    columns = zip(shaders, taken.T[1:], strict=True)
    return {name: Timing(column / taken[:, 0], float(np.median(column)), renderer()) for name, column in columns}


class _Drawing:
    """A shader ready to be drawn over a whole float target."""

    def __init__(self, shader: Shader, lights: int) -> None:
        ctx = context()
        attributes = _attributes()
        self.program = compile_points(cost_text(shader, lights), {name: a.shape[1] for name, a in attributes.items()})
        set_uniforms(self.program, {**shader.uniforms, **_lights(lights)})
        used = {name: a for name, a in {"pixel": _grid(), **attributes}.items() if f"a_{name}" in self.program}
        self.buffers = [ctx.buffer(a.astype("f4").tobytes()) for a in used.values()]
        content = [
            (buffer, f"{a.shape[1]}f", f"a_{name}") for buffer, (name, a) in zip(self.buffers, used.items(), strict=True)
        ]
        self.array = ctx.vertex_array(self.program, content)
        self.size = SIDE, SIDE
        # What the timer queries of software tell holds the waiting for other programs: a tenth to twice the work on a busy machine.
        self.clock = _processor_time if in_software() else _timer_query
        self.draws = 1
        self.milliseconds()  # the driver compiles when it first draws
        while self.draws < MOST_DRAWS and self.draws * self.milliseconds() < LEAST_MS:
            self.draws *= 2

    def milliseconds(self) -> float:
        """Of one draw."""
        float_target(self.size)
        return self.clock(lambda: [self.array.render() for _ in range(self.draws)]) / self.draws

    def release(self) -> None:
        """Give back what the driver holds."""
        for resource in (self.array, *self.buffers, self.program):
            resource.release()


def _timer_query(draw: Callable[[], object]) -> float:
    """Milliseconds by the driver's own timer."""
    query = context().query(time=True)
    with query:
        draw()
    return query.elapsed * 1e-6


def _processor_time(draw: Callable[[], object]) -> float:
    """Milliseconds of all threads of this process, until what was drawn is there."""
    context().finish()
    began = time.process_time_ns()
    draw()
    context().finish()
    return (time.process_time_ns() - began) * 1e-6


def _lights(count: int) -> dict[str, object]:
    """Distant lights around the viewer's side, no two alike."""
    turn = 2.4 * np.arange(count)
    to_light = np.stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), np.full(count, 0.75**0.5)], -1)
    rgb = np.tile([3.0, 2.5, 2.0], (count, 1)) / (1.0 + np.arange(count))[:, None]
    rows = lambda a: tuple(map(tuple, a.tolist())) if count > 1 else tuple(a[0].tolist())  # noqa: E731
    return {"u_to_light": rows(to_light), "u_irradiance": rows(rgb)}


@cache
def _grid() -> np.ndarray:
    """Corners (n, 2) of the triangles that cover the target."""
    x, y = np.meshgrid(np.arange(CELLS), np.arange(CELLS))
    corner = np.stack([x.ravel(), y.ravel()], -1)[:, None] + np.array([[0, 0], [1, 0], [0, 1], [0, 1], [1, 0], [1, 1]])
    return corner.reshape(-1, 2) / CELLS * 2.0 - 1.0


@cache
def _attributes() -> dict[str, np.ndarray]:
    """What varies over the target at those corners: half a sphere, seen from afar, up to 84 degrees."""
    square = _grid()
    length = np.linalg.norm(square, axis=-1, keepdims=True)
    disc = 0.995 * square * np.max(np.abs(square), -1, keepdims=True) / np.maximum(length, 1e-9)
    normal = np.concatenate([disc, np.sqrt(1.0 - np.sum(disc**2, -1, keepdims=True))], -1)
    view = np.array([0.8, 0.6, 4.9]) - normal
    tangent = np.stack([normal[:, 2], np.zeros(len(normal)), -normal[:, 0]], -1)
    ones = np.ones((len(normal), 1))
    places = {"v_uv": 3.0 * square, "v_distance": 5.0 * ones, "v_sky": 0.5 * ones}
    return {"v_normal": normal, "v_view": view, "v_tangent": tangent, **places}
