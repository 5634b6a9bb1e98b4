"""The window itself: a picture beside its sliders, and what hands do to them. The only file that imports moderngl-window."""

import json
import math
import time
from itertools import count
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from ..documents import write_text
from ..errors import LayerfitError, MachineError
from ..preset import preset_of
from ..report import pages
from ..shader.export import HEADERS, print_material
from ..shader.values import uniforms_of
from ..stack import Stack
from .panel import LEAP, STEP, WIDTH, Panel
from .picture import Camera, Picture, replaced, toward
from .shapes import SHAPES

SIZE = (1040, 700)
SUN = 9
"""Radius of the mark of the light."""
BEYOND = 1.12
"""How far from the middle that mark is."""
STAGE = (0.059, 0.059, 0.067)
NEAREST, FARTHEST = 2.6, 12.0
REST_S = 0.02
"""Between two looks at what hands do, where there is nothing to draw."""
WAIT_S, AGAIN_S = 0.35, 0.05
"""Until a key that stays down counts again, and from then on."""
TONES = ("none", "neutral", "filmic")
"""As `show.frag` counts them."""

TEXTURE = """
uniform sampler2D u_texture;
uniform vec4 u_place;
out vec4 color;
void main() { color = texture(u_texture, (gl_FragCoord.xy - u_place.xy) / u_place.zw); }
"""


class Screen:
    """A material in a window."""

    def __init__(self, stack: Stack, name: str, saves: Path):
        self.name, self.saves = name, saves
        self.panel = Panel(stack)
        self.window = _opened(f"{name} - layerfit")
        self.ctx = self.window.ctx
        self.picture = Picture(self.ctx, print_material(stack, name, "prepared"))
        fragment = f"{HEADERS['glsl330']}\n{TEXTURE}"
        self.paste = self.ctx.program(vertex_shader=pages.stage("screen.vert", "glsl330"), fragment_shader=fragment)
        self.nothing = self.ctx.vertex_array(self.paste, [])
        self.sun = self._texture(_disc(round(2 * SUN * self.window.pixel_ratio)))
        self.sliders = None
        self.seen: Any = None
        self.held = ""
        """What the mouse has hold of: "bar", "light" or "view"."""
        self.stale = True
        self.saved: list[Path] = []
        self.pointer, self.since = 0, math.inf
        self._listen()

    def _listen(self) -> None:
        window = self.window
        window.resize_func = lambda width, height: self.resized()
        window.mouse_press_event_func = self.pressed
        window.mouse_release_event_func = lambda x, y, button: setattr(self, "held", "")
        window.mouse_drag_event_func = self.dragged
        window.mouse_position_event_func = self.moved
        window.mouse_scroll_event_func = self.scrolled
        window.key_event_func = self.key
        self.resized()

    # Sizes: the picture is what the panel leaves of the window.

    @property
    def room(self) -> tuple[int, int]:
        """Of the picture, in the window's pixels."""
        return max(1, self.window.width - WIDTH), max(1, self.window.height)

    def resized(self) -> None:
        ratio = self.window.pixel_ratio
        width, height = self.room
        self.picture.resize((round(width * ratio), round(height * ratio)))
        self.stale = True

    def camera(self) -> Camera:
        """Of the picture, unmoved."""
        return Camera(self.picture.yaw, self.picture.pitch, self.picture.distance, self.room)

    def sun_at(self) -> tuple[float, float]:
        """Where the mark of the light is, from the upper left corner."""
        x, y = self.camera().place(BEYOND * toward(*self.picture.light))
        width, height = self.room
        inside = lambda at, size: float(min(max(at, SUN), size - SUN))  # noqa: E731
        return inside(0.5 * width * (1.0 + x), width), inside(0.5 * height * (1.0 - y), height)

    # Hands.

    def pressed(self, x: int, y: int, button: int) -> None:
        width, _ = self.room
        if x < width:
            self.held = "light" if math.dist((x, y), self.sun_at()) < 1.5 * SUN else "view"
        elif y < self.panel.room(self.window.height) and (bar := self.panel.at(y)) is not None:
            self.held, self.panel.chosen = "bar", bar
            self.dragged(x, y, 0, 0)

    def dragged(self, x: int, y: int, dx: int, dy: int) -> None:
        if self.held == "bar":
            self.panel.drag(x - self.room[0])
            self.tuned()
        elif self.held == "light" or (self.held and self.window.modifiers.shift):
            yaw, pitch = self.picture.light
            self.picture.change(light=(yaw + dx / 100.0, min(max(pitch - dy / 100.0, -1.5), 1.5)))
        elif self.held:
            pitch = min(max(self.picture.pitch + dy / 100.0, -1.5), 1.5)
            self.picture.change(yaw=self.picture.yaw - dx / 100.0, pitch=pitch)

    def moved(self, x: int, y: int, dx: int, dy: int) -> None:
        self.pointer = x

    def scrolled(self, dx: float, dy: float) -> None:
        if self.pointer >= self.room[0]:
            self.panel.scroll(round(-30.0 * dy), self.window.height)
            self.stale = True
        else:
            self.picture.change(distance=self._near(math.exp(-dy / 10.0)))

    def _near(self, by: float) -> float:
        return min(max(self.picture.distance * by, NEAREST), FARTHEST)

    def key(self, key: Any, action: Any, modifiers: Any) -> None:
        keys = self.window.keys
        if action != keys.ACTION_PRESS:
            return
        self.since = time.perf_counter()
        self.step()
        if key in (keys.HOME, keys.R):
            self.panel.reset(every=key == keys.R)
            self.tuned()
        elif key == keys.S:
            self.save()
        elif key == keys.T:
            self.picture.tone = (self.picture.tone + 1) % len(TONES)
            self.told(f"tone: {TONES[self.picture.tone]}")
        elif key == keys.M:
            shapes = list(SHAPES)
            self.picture.change(shape=shapes[(shapes.index(self.picture.shape) + 1) % len(shapes)])
            self.told(f"shape: {self.picture.shape}")
        elif key in (keys.COMMA, keys.PERIOD):
            self.picture.exposure += 0.25 if key == keys.PERIOD else -0.25
            self.told(f"exposure: {self.picture.exposure:+.2f}")

    def step(self) -> None:
        """What arrow keys do that are down."""
        keys, down = self.window.keys, self.window.is_key_pressed
        across = down(keys.RIGHT) - down(keys.LEFT)
        if by := down(keys.DOWN) - down(keys.UP):
            self.panel.choose(by, self.window.height)
            self.stale = True
        if across:
            bar = self.panel.bars[self.panel.chosen]
            bar.move(bar.place + across * (LEAP if self.window.modifiers.shift else STEP))
            self.tuned()

    def repeat(self) -> None:
        """Again and again, while they stay down."""
        if time.perf_counter() - self.since > WAIT_S:
            self.since += AGAIN_S
            self.step()

    def tuned(self) -> None:
        """A number has another value."""
        self.panel.said, self.stale = "", True
        self.picture.change(values=uniforms_of(self.panel.material))

    def told(self, text: str) -> None:
        self.panel.said, self.stale = text, True

    def save(self) -> None:
        """Write the preset beside those that were saved before."""
        taken = (self.saves / f"{self.name}{f'_{k}' if k else ''}.json" for k in count())
        path = next(path for path in taken if not path.exists())
        try:
            write_text(path, json.dumps(preset_of(self.panel.material, path.stem), indent=2) + "\n")
        except LayerfitError as error:
            self.told(str(error))
        else:
            self.saved.append(path)
            self.told(f"saved {path}")

    # What is seen.

    def run(self) -> None:
        """Until the window is closed."""
        while not self.window.is_closing:
            if self.picture.still:
                time.sleep(REST_S)
            else:
                self.picture.advance()
            self.draw()
            self.window.swap_buffers()
            self.repeat()
        self.window.destroy()

    def draw(self) -> None:
        """The window as it is now: picture, mark of the light, sliders."""
        self.picture.present(self._target())
        ratio, (width, height) = self.window.pixel_ratio, self.room
        if self.stale:
            self.sliders = self._texture(self.panel.image(self.window.height, ratio), self.sliders)
            self.stale = False
        self.window.use()
        self.ctx.clear(*STAGE, 1.0)
        self.ctx.enable_only(self.ctx.BLEND)
        self.ctx.blend_func = self.ctx.ONE, self.ctx.ONE_MINUS_SRC_ALPHA
        self._paste(self.seen.color_attachments[0], (0.0, 0.0, width, height))
        x, y = self.sun_at()
        self._paste(self.sun, (x - SUN, height - y - SUN, 2.0 * SUN, 2.0 * SUN))
        self._paste(self.sliders, (width, 0.0, WIDTH, height))

    def _paste(self, texture: Any, place: tuple[float, ...]) -> None:
        """A texture at a place (x, y, width, height) from the lower left corner."""
        at = tuple(self.window.pixel_ratio * v for v in place)
        self.ctx.viewport = tuple(round(v) for v in at)
        texture.use(0)
        self.paste["u_place"].value = tuple(float(round(v)) for v in at)
        self.nothing.render(self.ctx.TRIANGLES, vertices=3)

    def _target(self) -> Any:
        """Of the picture as a screen shows it, of its size."""
        size = self.picture.total.size
        if self.seen is None or self.seen.size != size:
            self.seen = replaced(self.seen, self.ctx.framebuffer([self.ctx.texture(size, 4)]))
        return self.seen

    def _texture(self, image: Image.Image, old: Any = None) -> Any:
        """A picture with its first row at the bottom; the one that it replaces is given back."""
        if old is not None:
            old.release()
        image = image.convert("RGBa").transpose(Image.Transpose.FLIP_TOP_BOTTOM)
        return self.ctx.texture(image.size, 4, image.tobytes())


def _opened(title: str) -> Any:
    """A window of pyglet's, which runs on every system."""
    without = "Without --window a preset is shown in the browser, and with -o written as a page."
    try:
        from moderngl_window.context.pyglet.window import Window  # pyright: ignore[reportMissingImports]  # an extra

        return Window(title=title, size=SIZE, gl_version=(3, 3))
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("moderngl_window"):
            raise
        raise MachineError(f"a window needs the package moderngl-window: pip install 'layerfit[window]'. {without}") from None
    except Exception as error:  # pyglet and moderngl raise what each system calls its faults, pyglet as it is imported
        raise MachineError(
            f"no window can be opened ({type(error).__name__}: {error}). It needs a display with OpenGL 3.3. {without}"
        ) from None


def _disc(size: int) -> Image.Image:
    """The mark of the light."""
    disc = Image.new("RGBA", (4 * size, 4 * size))
    ImageDraw.Draw(disc).ellipse((2, 2, 4 * size - 3, 4 * size - 3), (253, 230, 138, 255), (0, 0, 0, 255), size // 3)
    return disc.resize((size, size), Image.Resampling.LANCZOS)
