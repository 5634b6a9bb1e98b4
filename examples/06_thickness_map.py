"""A painted varnish: its thickness, texel by texel, from images under twelve lights.

    python examples/06_thickness_map.py [OUT.png]

Draws a panel of wood whose varnish was laid on with a broad brush (Weidlich and Wilkie 2007 vary it so), adds noise, writes the images with a scene
file, and has `fit_map` find the thickness again. The picture: the truth, the map, its error, and the sigma that it claims.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import layerfit as lf
from layerfit.capture.exr import write_exr
from layerfit.report.pictures import RAMP, SIGNED, Panel, false_colour, strip

SIDE, NOISE = 64, 0.005
EYE = np.array([0.0, 0.0, 4.0])
VARNISH, ALBEDO = [2.0, 6.0, 15.0], [0.5, 0.28, 0.13]
SCENE = f"""
[camera]
position = [0, 0, 4]
look_at = [0, 0, 0]
vfov_deg = 30
[material]
model = "corrected"
[[material.layers]]
type = "coat"
alpha = 0.12
absorption_per_mm = {VARNISH}
thickness_um = 40.0
[material.base]
type = "lambert"
albedo = {ALBEDO}
[map]
free = ["coat.thickness_um"]
"""


def painted() -> np.ndarray:
    """Thickness [um] of strokes beside and over one another, (H, W), in steps of a quarter."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    thickness = np.full((SIDE, SIDE), 12.0)
    for k, middle in enumerate((0.2, 0.45, 0.72, 0.88)):
        across = (y - middle - 0.05 * np.sin(5.0 * x + k)) / 0.16
        thickness += 30.0 * np.maximum(1.0 - across**2, 0.0) * (0.7 + 0.3 * np.cos(9.0 * x + 2.0 * k))
    return np.round(4.0 * thickness) / 4.0


def lights() -> np.ndarray:
    """Twelve directions, in three rings."""
    t, p = np.radians(np.tile([25.0, 45.0, 60.0], 4)), 2.0 * np.pi * np.arange(12) / 12.0
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)


def drawn(thickness: np.ndarray, position: np.ndarray) -> np.ndarray:
    """The panel under every light, (12, H, W, 3): a material for each thickness that there is."""
    wo = EYE - position
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    images = np.zeros((12, SIDE, SIDE, 3))
    for value in np.unique(thickness):
        here = thickness == value
        stack = lf.Stack(
            (lf.Coat(alpha=0.12, absorption_per_mm=VARNISH, thickness_um=float(value)),),
            lf.Lambert(albedo=ALBEDO),
            lf.Corrected(),
        )
        wi = np.repeat(lights()[None], here.sum(), 0).reshape(-1, 1, 3)
        seen = lf.predict(stack, wi, np.repeat(wo[here], 12, 0), np.pi * np.repeat(wi[..., 2:], 3, -1))
        images[:, here] = seen.reshape(-1, 12, 3).swapaxes(0, 1)
    return images


def write(folder: Path, images: np.ndarray, position: np.ndarray) -> Path:
    """One EXR with a layer for each light, and the scene file."""
    up = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
    channels = {f"{name}.{c}": a[..., k] for name, a in (("P", position), ("N", up)) for k, c in enumerate("XYZ")}
    channels |= {f"light{k}.{c}": image[..., i] for k, image in enumerate(images) for i, c in enumerate("RGB")}
    write_exr(folder / "panel.exr", channels | {"A": np.ones((SIDE, SIDE))})
    references = [
        f'[[reference]]\nexr = "panel.exr"\nbeauty = "light{k}"\n[[reference.light]]\ntype = "directional"\n'
        f"to_light = {to_light.tolist()}\nirradiance_rgb = {np.pi}\n"
        for k, to_light in enumerate(lights())
    ]
    (folder / "panel.toml").write_text("".join(references) + SCENE)
    return folder / "panel.toml"


def picture(truth: np.ndarray, maps: lf.MapFit) -> bytes:
    found, sigma = maps.values["coat.thickness_um"], maps.sigmas["coat.thickness_um"]
    error, end = found - truth, float(np.quantile(sigma, 0.99))
    top = float(truth.max())
    panels = [
        Panel("painted thickness", false_colour(truth / top, RAMP), f"{top:.0f} um"),
        Panel("found from 12 images", false_colour(found / top, RAMP), f"{top:.0f} um"),
        Panel("error", false_colour(0.5 + 0.5 * error / (3.0 * end), SIGNED), f"{3.0 * end:.2g} um", signed=True),
        Panel("sigma", false_colour(sigma / end, RAMP), f"{end:.2g} um"),
    ]
    return strip([panels])


def main(path: str) -> None:
    y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) / SIDE
    position = np.stack([2.0 * x - 1.0, 1.0 - 2.0 * y, np.zeros_like(x)], -1)
    truth = painted()
    images = drawn(truth, position)
    images *= 1.0 + NOISE * np.random.default_rng(0).normal(size=images.shape)
    with tempfile.TemporaryDirectory() as folder:
        maps = lf.fit_map(write(Path(folder), images, position))
    off = maps.values["coat.thickness_um"] - truth
    within = np.mean(np.abs(off) < maps.sigmas["coat.thickness_um"])
    print(f"thickness {truth.min():.0f} to {truth.max():.0f} um, found to {np.sqrt(np.mean(off**2)):.2f} um (root mean square)")
    print(f"{100.0 * within:.0f} % of the texels are within one sigma (68 % if it is right)")
    assert 0.6 < within < 0.76
    Path(path).write_bytes(picture(truth, maps))
    print(f"wrote {path}, {Image.open(path).size[0]} pixels wide")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "thickness_map.png")
