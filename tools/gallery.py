"""Print the shader of every shipped preset, draw a picture of it with that shader, and write docs/gallery.md.

    python tools/gallery.py            what is out of date: a preset changed, or what is printed for it
    python tools/gallery.py --all      every picture anew
    python tools/gallery.py gold wood  presets with one of these words, and the page
    python tools/gallery.py --verify  nothing is written: each shader against JAX, as `layerfit verify` compares it

The picture is a sphere in the studio of the example references, with a small bright key light. It carries the hash of the shader that drew
it, so that the tests see a picture that is behind its preset.
"""

import argparse
import functools
import hashlib
import io
import re
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import layerfit as lf
from layerfit._data import references
from layerfit.capture.geometry import frames, normalise, sphere_surface, sphere_tangent, sphere_uv
from layerfit.capture.lights import receive
from layerfit.capture.scene import Camera, EnvironmentMap, Sphere, SphereLight
from layerfit.fit.metrics import display
from layerfit.shipped import Shipped

PAGE = Path(__file__).parents[1] / "docs" / "gallery.md"
TARGET = "glsl330"
STAMP = "shader"
"""Keyword of the PNG text that holds the hash of the shader."""

NUMBER = re.compile(r"-?\d+(?:\.\d*(?:e[+-]?\d+)?|e[+-]?\d+)")
LAST_DIGITS = 2e-4
"""What numbers may differ by, over the largest of their line or LEAST: they are fitted in float32, and two versions of XLA differ by half of it."""

LEAST = 0.03

SIDE = 128
FINER = 2
"""Points along a pixel."""
SAMPLES = 180
"""Directions of each light at a point: with the points of a pixel, enough that hardly a grain is seen."""
WIDTHS = (0.02, 0.06, 0.18, 0.5)
"""Of half vectors, as narrow as the narrowest coats."""
COLOURS = 256
"""Of a picture: of one or two hues each, it needs no more, and is half as large."""
BACKGROUND = 0.045
"""Linear grey."""
WHITE = 1.15
"""Radiance that is shown as white."""

CAMERA = Camera(position=(0.0, 0.9, 5.2), look_at=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), vfov_deg=23.0)
LIGHTS = (
    EnvironmentMap(references() / "studio.exr", scale=(0.8, 0.8, 0.8)),
    SphereLight(center=(-2.6, 3.4, 3.6), radius=0.45, radiance_rgb=(22.0, 22.0, 22.0)),
)

COLUMNS = 4


@functools.cache
def scene() -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray, lf.Place]]:
    """Where the sphere is in the picture, and what its points see: the same for every preset."""
    side = SIDE * FINER
    surface = sphere_surface(Sphere(), CAMERA, side, side)
    position, normal = surface.position[surface.covered], surface.normal[surface.covered]
    away = np.asarray(CAMERA.position) - position
    view = normalise(away)
    received = receive(LIGHTS, position, normal, view, SAMPLES, seed=0, widths=WIDTHS)
    to_surface = frames(normal, sphere_tangent(normal, CAMERA.up))
    wi = (received.to_light @ to_surface.swapaxes(1, 2)).astype(np.float32)
    wo = np.einsum("nij,nj->ni", to_surface, view).astype(np.float32)
    uv = np.add(sphere_uv(normal, CAMERA.up), (0.5, 0.0)) % 1.0  # the seam behind
    sky = 0.5 + 0.5 * normal @ np.asarray(CAMERA.up)  # what a sphere in the open sees of it
    place = lf.Place(*(x.astype(np.float32) for x in (uv, np.linalg.norm(away, axis=-1), sky)))
    return surface.covered, (wi, wo, received.weight.astype(np.float32), place)


def picture(shader: lf.Shader, mark: str) -> bytes:
    """The sphere in this material, as a PNG that bears a mark."""
    covered, samples = scene()
    image = np.full((*covered.shape, 3), BACKGROUND)
    image[covered] = lf.shade_samples(shader, *samples)
    image = np.minimum(image, WHITE)  # before the mean: a highlight is no larger than it is
    pixels = image.reshape(SIDE, FINER, SIDE, FINER, 3).mean((1, 3))
    info = PngInfo()
    info.add_text(STAMP, mark)
    drawn = Image.fromarray(np.round(255.0 * display(pixels, WHITE)).astype(np.uint8))
    file = io.BytesIO()
    drawn.quantize(COLOURS, dither=Image.Dither.NONE).save(file, "PNG", optimize=True, pnginfo=info)
    return file.getvalue()


def stamp(text: str) -> str:
    """What tells one printed shader from another; comments and layout draw nothing."""
    code = " ".join(re.sub(r"//.*", "", text).split())
    return hashlib.sha256(code.encode()).hexdigest()


def same(text: str, other: str) -> bool:
    """Whether two printed shaders are alike, but for the last digits of numbers that were fitted: these are a processor's."""
    lines, others = text.splitlines(), other.splitlines()
    return len(lines) == len(others) and all(map(_close, lines, others))


def _close(line: str, other: str) -> bool:
    if line == other:
        return True
    # Comments are aligned, so more digits mean fewer blanks.
    words, others = (NUMBER.sub("#", each).split() for each in (line, other))
    a, b = (np.array([float(number) for number in NUMBER.findall(each)]) for each in (line, other))
    return words == others and np.allclose(a, b, rtol=0.0, atol=LAST_DIGITS * max(LEAST, *np.abs(b)))


def drawn_by(path: Path) -> str | None:
    """The stamp in a picture."""
    if not path.exists():
        return None
    with Image.open(path) as image:
        return image.info.get(STAMP)


def page() -> str:
    """The page of all presets."""
    presets = lf.shipped_presets()
    parts = [HEAD.format(count=len(presets))]
    for group, members in groupby(presets, lambda preset: preset.group):
        members = list(members)
        parts += [f"## {group.capitalize()}\n", "\n".join(_grid(members)), ""]
    parts += ["## Where the values are from\n", "| preset | source |", "| --- | --- |"]
    parts += [f"| `{preset.name}` | {preset.source} |" for preset in presets]
    return "\n".join(parts) + "\n"


HEAD = """\
# Gallery

<!-- Written by tools/gallery.py (make gallery). -->

{count} materials to start from. Each is found by its name wherever a preset is asked for, as in `layerfit export lacquered_copper`;
`layerfit presets` lists them. A name leads to the [preset](presets.md), "shader" to what `layerfit export` prints for it: GLSL 3.30, of which
`--target essl300` changes the first lines. The picture is that shader's: a sphere in a studio of three soft boxes, with a small key light.
"""


def _grid(presets: list[Shipped]) -> Iterator[str]:
    """A table of pictures, a few in a row, with what they are of."""
    yield "|" + "   |" * COLUMNS
    yield "|" + " :---: |" * COLUMNS
    for start in range(0, len(presets), COLUMNS):
        row = presets[start : start + COLUMNS]
        yield "| " + " | ".join([*map(_cell, row), *[""] * (COLUMNS - len(row))]) + " |"


def _cell(preset: Shipped) -> str:
    beside = f"../shaders/presets/{preset.name}"
    lines = [
        f"![{preset.name}]({beside}.png)",
        f"**[{preset.name}]({beside}.json)**",
        preset.description,
        f"*{preset.structure}*",
        f"[shader]({beside}.frag)",
    ]
    return "<br>".join(lines)


def update(presets: Iterable[Shipped], anew: bool) -> None:
    """Print and draw what is out of date."""
    for preset in presets:
        shader = lf.print_material(lf.read_preset(preset.path), preset.name)
        text, drawing = preset.path.with_suffix(".frag"), preset.path.with_suffix(".png")
        if not (text.exists() and same(shader.text(TARGET), text.read_text())):
            text.write_text(shader.text(TARGET))
            print(f"printed {text.name}")
        if anew or drawn_by(drawing) != stamp(text.read_text()):
            drawing.write_bytes(picture(shader, stamp(text.read_text())))
            print(f"drew {drawing.name}, {drawing.stat().st_size / 1e3:.1f} kB")


def verify(presets: Iterable[Shipped]) -> None:
    """Print how far each shader is from JAX, at worst and for all but one value in a thousand."""
    for preset in presets:
        parity = lf.check_pairs(lf.print_material(lf.read_preset(preset.path), preset.name))
        print(f"{preset.group:<20} {preset.name:<28} {parity.max_rel:.1e} {parity.p999_rel:.1e}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("words", nargs="*", help="presets with one of these words; left out: all")
    parser.add_argument("--all", action="store_true", help="draw every picture anew")
    parser.add_argument("--verify", action="store_true", help="write nothing; compare each shader with JAX")
    asked = parser.parse_args()
    presets = [preset for word in asked.words or [""] for preset in lf.shipped_presets(word)]
    if asked.verify:
        verify(presets)
    else:
        update(presets, asked.all)
        PAGE.write_text(page())
        print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
