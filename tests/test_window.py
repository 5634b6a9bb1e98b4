"""The window of a preset: its picture is that of the page, its bars are the material's numbers; and a real one on a display of its own."""

import json
import os
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np
import pytest
from PIL import Image, ImageGrab

from browser import chromium, evaluated, opened
from commands import layerfit
from layerfit import view
from layerfit.documents import read_document
from layerfit.errors import MachineError
from layerfit.fit.metrics import display
from layerfit.preset import read_preset, stack_of
from layerfit.shader import gl as gl_module
from layerfit.shader.export import print_material
from layerfit.shader.values import uniforms_of
from layerfit.window import picture, show
from layerfit.window.panel import BAR, HEAD, LEAP, ROW, WIDTH, Panel
from layerfit.window.picture import Camera, Picture, lights
from layerfit.window.shapes import SHAPES, mesh

NAME = "lacquered_copper"
SAME, MOVED = 5e-5, 1.0 / 16.0
"""Pixels of two drivers, relative to the brightest, and of the step to the next pixel: each lays the corners of triangles on a grid of its own,
SwiftShader on one of a sixteenth of a pixel."""
SIDE = 48
TURNED = {"yaw": 0.3, "pitch": 0.2, "distance": 5.0}


@pytest.fixture(scope="module")
def stack():
    return read_preset(NAME)


@pytest.fixture
def ctx(gl, monkeypatch) -> Iterator[Any]:
    """The context of the tests, left as it was; every pass is quick enough."""
    monkeypatch.setattr(picture, "SLOW_S", np.inf)
    yield gl
    gl.enable_only(gl.PROGRAM_POINT_SIZE)
    for target in gl_module._targets:
        target.use()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as one:
        yield one


@pytest.mark.parametrize("shape", SHAPES)
def test_the_picture_is_that_of_the_page(ctx, browser, stack, tmp_path, shape):
    """The first pass, turned: same mesh, camera, lights and shader."""
    path = tmp_path / "view.html"
    path.write_text(view.page(stack, NAME))
    snapshot = f"""() => {{
        const view = Object.assign(layerfit.views[0], {{ orbit: {json.dumps(TURNED)}, limit: 0, shape: "{shape}" }});
        return Array.from(view.snapshot({SIDE}, {SIDE}, view.lights(0)).pixels);
    }}"""
    with opened(browser, path.as_uri()) as page:
        wanted = np.reshape(evaluated(page, snapshot), (SIDE, SIDE, 4))
    made = Picture(ctx, print_material(stack, NAME, "prepared"))
    made.change(**TURNED, shape=shape)
    made.resize((SIDE, SIDE))
    made.advance()
    drawn = np.frombuffer(made.total.read(components=4, dtype="f4"), "f4").reshape(SIDE, SIDE, 4)
    both = (drawn[..., 3] == 1.0) & (wanted[..., 3] == 1.0)
    assert np.count_nonzero(both != (drawn[..., 3] + wanted[..., 3] > 0.0)) < 0.02 * SIDE * SIDE, "not the same silhouette"
    assert np.count_nonzero(both) > 0.3 * SIDE * SIDE  # of the torus a third
    steps = [np.abs(np.roll(wanted, 1, axis) - wanted).max(-1) for axis in (0, 1)]
    step = np.maximum.reduce([*steps, np.roll(steps[0], -1, 0), np.roll(steps[1], -1, 1)])
    assert np.all((np.abs(drawn - wanted).max(-1) <= SAME * wanted[..., :3].max() + MOVED * step)[both])


def test_shapes_are_those_of_the_page(browser, tmp_path):
    path = tmp_path / "view.html"
    path.write_text(view.page(read_preset("bare_concrete"), "bare_concrete"))
    told = (
        "() => Object.entries(SHAPES).map(([name, s]) => [name, Array.from(mesh(s).vertices), Array.from(mesh(s).triangles)])"
    )
    with opened(browser, path.as_uri()) as page:
        wanted = {name: (np.reshape(vertices, (-1, 11)), corners) for name, vertices, corners in evaluated(page, told)}
    assert list(wanted) == list(SHAPES)
    for name, (vertices, corners) in wanted.items():
        made, triangles = mesh(name)
        np.testing.assert_allclose(
            np.hstack(list(made.values())), vertices, atol=1e-6, err_msg=name
        )  # the page rounds to float32
        np.testing.assert_array_equal(triangles.ravel(), corners)


@pytest.mark.parametrize("k", [0, 1, 700])
def test_passes_have_the_lights_of_the_page(browser, k, tmp_path):
    path = tmp_path / "view.html"
    path.write_text(view.page(read_preset("bare_concrete"), "bare_concrete"))
    with opened(browser, path.as_uri()) as page:
        wanted = evaluated(page, f"() => Object.assign(layerfit.views[0], {{ limit: 0 }}).lights({k})")
    places, colours = lights(k, -0.65, 0.6)
    np.testing.assert_allclose(places, [place for place, _ in wanted], atol=1e-12)
    np.testing.assert_allclose(colours, [rgb for _, rgb in wanted])


def test_a_screen_shows_the_mean_of_the_passes(ctx, stack):
    made = Picture(ctx, print_material(stack, NAME, "prepared"))
    made.resize((SIDE, SIDE))
    for _ in range(3):
        made.advance()
    total = np.frombuffer(made.total.read(components=4, dtype="f4"), "f4").reshape(SIDE, SIDE, 4)
    target = ctx.framebuffer([ctx.texture((SIDE, SIDE), 4)])
    made.present(target)
    shown = np.frombuffer(target.read(components=4), "u1").reshape(SIDE, SIDE, 4)
    covered = total[..., 3] == 3.0
    mean = total[covered][:, :3] / 3.0
    np.testing.assert_allclose(shown[covered][:, :3] / 255.0, display(mean, 1.0), atol=1.5 / 255.0)
    assert not shown[0, 0].any(), "the background shows through"
    made.exposure = 1.0
    made.present(target)
    brighter = np.frombuffer(target.read(components=4), "u1").reshape(SIDE, SIDE, 4)
    np.testing.assert_allclose(brighter[covered][:, :3] / 255.0, display(2.0 * mean, 1.0), atol=1.5 / 255.0)


def test_a_camera_sees_the_middle_in_the_middle():
    camera = Camera(0.7, 0.4, 5.0, (300, 200))
    ahead = camera.matrix @ [0.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(ahead[:2], 0.0, atol=1e-12)
    corner = camera.matrix @ [*(0.3 * camera.right + 0.2 * camera.up), 1.0]
    np.testing.assert_allclose(corner[:2] / corner[3], camera.place(0.3 * camera.right + 0.2 * camera.up))


@pytest.mark.parametrize("name", [NAME, "brushed_steel", "anodised_titanium", "metallic_blue_car_paint", "patinated_copper"])
def test_every_number_has_a_bar_within_its_bounds(name):
    """That leads to the constants of a shader printed anew."""
    panel = Panel(read_preset(name))
    assert len(panel.bars) == sum(leaf.size for leaf in jax.tree.leaves(panel.stack.astype(float)))
    for bar in panel.bars:
        np.testing.assert_allclose(bar.value, bar.start)
        for place, bound in ((0.0, bar.of.spec.lower), (1.0, bar.of.spec.upper), (-1.0, bar.of.spec.lower)):
            bar.move(place)
            np.testing.assert_allclose(bar.value, bound, rtol=1e-9, atol=1e-12)
        bar.value = bar.start
    panel.bars[0].move(panel.bars[0].place + LEAP)
    wanted = print_material(panel.material, name, "prepared").uniforms
    moved = uniforms_of(panel.material)
    assert moved.keys() == wanted.keys()
    for key, value in wanted.items():
        np.testing.assert_array_equal(moved[key], value)
    was = uniforms_of(panel.stack)
    assert any(np.any(moved[key] != was[key]) for key in was)


def test_a_bar_is_where_the_mouse_finds_it(stack):
    panel = Panel(stack)
    assert panel.at(0) is None, "the name of a layer"
    assert panel.at(HEAD + ROW + 1) == 1
    panel.chosen = 1
    panel.drag((BAR[0] + BAR[1]) // 2)
    assert panel.bars[1].place == pytest.approx(0.5)
    picture = np.asarray(panel.image(600, 1.0))
    row = picture[HEAD + ROW + ROW // 2]
    filled = np.flatnonzero(np.all(row == panel.bars[1].color, -1))
    assert abs(filled.min() - BAR[0]) <= 1
    assert abs(filled.max() - 3 - (BAR[0] + BAR[1]) / 2) <= 1, "the thumb"


def test_a_panel_that_is_too_long_scrolls_to_what_is_chosen():
    panel = Panel(read_preset("metallic_blue_car_paint"))
    height = 300
    panel.choose(-1, height)
    assert panel.chosen == len(panel.bars) - 1
    assert panel.scrolled > 0
    assert panel.at(height - 300 + HEAD) != 0
    panel.choose(1, height)
    assert (panel.chosen, panel.scrolled) == (0, 0)
    panel.scroll(10_000, height)
    assert panel.at(0) is not None
    panel.scroll(-10_000, height)
    assert panel.scrolled == 0


def test_without_the_extra_it_says_what_to_install(monkeypatch, stack):
    monkeypatch.setitem(sys.modules, "moderngl_window", None)
    with pytest.raises(MachineError, match=r"pip install 'layerfit\[window\]'"):
        show(stack, NAME)


def test_a_window_is_no_file(tmp_path):
    ran = layerfit("view", NAME, "--window", "-o", tmp_path / "page.html")
    assert ran.code == 2
    assert "--output is for the page" in ran.err
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def screen() -> Iterator[str]:
    """The name of a display that nobody looks at."""
    pytest.importorskip("moderngl_window", reason="pip install 'layerfit[window]'")
    if shutil.which("Xvfb") is None:
        pytest.skip(
            "no Xvfb for a window to open on: apt-get install -y --no-install-recommends xvfb libgl1-mesa-dri libglx-mesa0"
        )
    read, write = os.pipe()
    # Not number 0, on which a program finds OpenGL whatever DISPLAY says: others are tried without a driver meanwhile.
    number = f":{100 + os.getpid() % 900}"
    # Nor does it begin anew when the last that looked at it is gone: who comes meanwhile is turned away.
    server = subprocess.Popen(
        ["Xvfb", number, "-displayfd", str(write), "-screen", "0", "1200x800x24", "-nolisten", "tcp", "-noreset"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    assert select.select([read], [], [], 60.0)[0], "Xvfb has not begun in a minute"
    yield f":{os.read(read, 16).decode().strip()}"
    server.terminate()
    server.wait()
    os.close(read)


def seen(screen: str) -> Image.Image:
    return ImageGrab.grab(xdisplay=screen)


HANDS = """
import json, sys
from pathlib import Path
from layerfit.preset import read_preset
from layerfit.window.screen import SIZE, Screen
from layerfit.window.panel import BAR, HEAD, ROW, WIDTH

screen = Screen(read_preset("bare_concrete"), "bare_concrete", Path(sys.argv[1]))
keys, said = screen.window.keys, []

def send(*event):
    screen.window._window.dispatch_event(*event)  # kept until the next line
    screen.window._window.dispatch_events()

def tell():
    for _ in range(2):
        screen.picture.advance()
        screen.draw()
        screen.window.swap_buffers()
    picture = screen.picture
    said.append({"values": [bar.value for bar in screen.panel.bars], "chosen": screen.panel.chosen, "yaw": picture.yaw, "light": picture.light,
                 "distance": picture.distance, "exposure": picture.exposure, "shape": picture.shape})
    print(json.dumps(said[-1]), flush=True)
    sys.stdin.readline()

def drag(x, y, dx, modifiers=0):
    send("on_mouse_press", x, SIZE[1] - y, 1, modifiers)
    send("on_mouse_drag", x + dx, SIZE[1] - y, dx, 0, 1, modifiers)
    send("on_mouse_release", x + dx, SIZE[1] - y, 1, modifiers)

def press(key, modifiers=0):
    send("on_key_press", key, modifiers)
    send("on_key_release", key, modifiers)

left = SIZE[0] - WIDTH
tell()
drag(300, 500, 50)
tell()
drag(300, 500, 50, 1)
drag(*map(round, screen.sun_at()), -20)
tell()
send("on_mouse_motion", 300, 300, 0, 0)
send("on_mouse_scroll", 300, 300, 0, 2)
press(keys.PERIOD)
tell()
send("on_mouse_press", left + BAR[0], SIZE[1] - HEAD - ROW // 2, 1, 0)
send("on_mouse_release", left + BAR[0], SIZE[1] - HEAD - ROW // 2, 1, 0)
tell()
press(keys.DOWN)
press(keys.RIGHT)
press(keys.S)
press(keys.S)
tell()
press(keys.HOME)
tell()
press(keys.R)
tell()
press(keys.M)
tell()
"""
"""What a user does in a window, event by event as the system would send them; after each it waits to be looked at."""


@pytest.fixture(scope="module")
def told(screen, tmp_path_factory):
    """What the window was and looked like after each of them, and where it saved."""
    folder = tmp_path_factory.mktemp("saved")
    command = [sys.executable, "-c", HANDS, folder]
    steps = []
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ | {"DISPLAY": screen}
    ) as window:
        assert window.stdin is not None
        assert window.stdout is not None
        for line in window.stdout:
            steps.append((json.loads(line), np.asarray(seen(screen), float)))
            window.stdin.write("\n")
            window.stdin.flush()
    assert window.returncode == 0
    assert len(steps) == 9
    return steps, folder


def test_a_window_shows_the_material_and_its_bars(told):
    """As a screen has it."""
    (_, first), *_ = told[0]
    assert first[350, 350].min() > 60.0, "concrete in the middle"
    assert first[20, 20].max() < 30.0, "nothing beside it"
    assert first[:700, 1040 - WIDTH : 1040].max() > 200.0, "words"
    assert not first[720:, 1050:].any(), "beyond the window"


def test_a_hand_turns_the_view_and_moves_the_light(told):
    (start, first), (turned, second), (lit, third), (near, fourth), *_ = told[0]
    assert turned["yaw"] == start["yaw"] - 0.5
    assert turned["light"] == start["light"]
    assert lit["yaw"] == turned["yaw"]
    assert lit["light"][0] == pytest.approx(start["light"][0] + 0.5 - 0.2)
    picture = np.s_[:700, : 1040 - WIDTH]
    assert np.abs(second - third)[picture].mean() > 1.0
    assert near["distance"] < lit["distance"]
    assert near["exposure"] == 0.25
    assert fourth[picture].mean() > third[picture].mean() + 5.0
    assert np.abs(first - second)[picture].max() > 20.0, "the mark of the light turns with the view"


def test_bars_and_keys_change_the_material(told):
    steps, _ = told
    start, black, moved, home, reset = (steps[k][0]["values"] for k in (0, 4, 5, 6, 7))
    assert black == [0.0, *start[1:]]
    assert steps[5][0]["chosen"] == 1
    assert moved == pytest.approx([0.0, start[1] + 0.01, *start[2:]])
    assert home == black
    assert reset == start
    middle = [image[350, 350] for _, image in steps]
    assert middle[4][0] < middle[3][0] - 20.0, "no red"
    np.testing.assert_allclose(middle[4][1:], middle[3][1:], atol=6.0)
    np.testing.assert_allclose(middle[7], middle[3], atol=6.0)


def test_a_key_steps_through_the_shapes(told):
    (start, _), *_, (_, sphere), (stepped, torus) = told[0]
    assert (start["shape"], stepped["shape"]) == ("sphere", "torus")
    assert sphere[350, 350].min() > 60.0
    assert torus[350, 350].max() < 40.0, "a hole in the middle"


def test_tuned_presets_are_saved_one_beside_the_other(told):
    steps, folder = told
    assert sorted(path.name for path in folder.iterdir()) == ["bare_concrete.json", "bare_concrete_1.json"]
    document = read_document(folder / "bare_concrete.json")
    saved = stack_of({key: document[key] for key in ("model", "interface", "layers", "base") if key in document}, "saved")
    assert np.asarray(saved.base.albedo).tolist() == pytest.approx(steps[5][0]["values"][:3])


def test_the_command_opens_a_window_until_it_is_closed(screen, tmp_path):
    command = [sys.executable, "-m", "layerfit", "view", "bare_concrete", "--window", "--json"]
    with subprocess.Popen(command, cwd=tmp_path, env=os.environ | {"DISPLAY": screen}, stderr=subprocess.PIPE) as window:
        lit = lambda: np.asarray(seen(screen))[350, 350].min() > 60  # noqa: E731
        for _ in range(600):
            if window.poll() is not None or lit():
                break
            time.sleep(0.1)
        assert window.poll() is None, window.communicate()[1].decode()
        assert lit()
        window.send_signal(signal.SIGINT)
        assert window.wait(30.0) == 130
    assert not list(tmp_path.iterdir())


def test_without_a_display_it_says_so(tmp_path):
    pytest.importorskip("moderngl_window", reason="pip install 'layerfit[window]'")
    command = [sys.executable, "-m", "layerfit", "view", "bare_concrete", "--window"]
    env = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    ran = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert "no window can be opened" in ran.stderr
    assert "Traceback" not in ran.stderr
