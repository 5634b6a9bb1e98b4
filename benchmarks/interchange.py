"""What other programs make of the presets that ship: the loss of every format, and of Blender what Cycles itself draws.

    python benchmarks/interchange.py                            the presets of the table in docs/interchange.md
    python benchmarks/interchange.py wood tempered_steel        presets with one of these words
    python benchmarks/interchange.py lacquered_copper --bpy PYTHON --picture docs/images/lacquered_copper_in_cycles.png

PYTHON has `bpy`: the exported script makes the material of a sphere, the script of `layerfit blender-kit` renders it, and the picture is compared
with the preset in the same light. Numbers are delta E 2000, and those of the values as they are in brackets.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import layerfit as lf
from layerfit.fit.metrics import exposure, image_error
from layerfit.interchange.convert import Conversion, convert
from layerfit.interchange.formats import FORMATS, blender_kit
from layerfit.interchange.stage import draw, scene_views
from layerfit.report import pictures

SHOWN = (
    "lacquered_copper",
    "varnished_wood",
    "clear_coated_red_paint",
    "metallic_blue_car_paint",
    "car_paint_bmw_339",
    "brushed_steel",
    "wet_sandstone",
    "patinated_copper",
    "tempered_steel",
    "colour_shift_paint",
    "pearl_nail_varnish",
)
"""One of each kind of layers, and three with a film."""

SAMPLES = 128
STAGE = """
import bpy, sys
from mathutils import Vector
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
bpy.ops.mesh.primitive_uv_sphere_add(segments=512, ring_count=256)
bpy.ops.object.shade_smooth()
ball = bpy.context.object
exec(open(sys.argv[2]).read())
sun = bpy.data.lights.new("sun", "SUN")
sun.energy = 3.14159265
lamp = bpy.data.objects.new("sun", sun)
lamp.rotation_euler = Vector((2, -3, 2.4)).to_track_quat("Z", "Y").to_euler()
eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
eye.data.lens, eye.location = 80, (0.0, -5.0, 0.0)
eye.rotation_euler = Vector(eye.location).to_track_quat("Z", "Y").to_euler()
for thing in (lamp, eye):
    scene.collection.objects.link(thing)
scene.camera = eye
scene.render.resolution_x = scene.render.resolution_y = 128
scene.render.resolution_percentage = 100
"""
"""For Blender's Python: a sphere of the material that the script `sys.argv[2]` makes, a sun and a camera."""
SAVE = "bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])\n"


def row(name: str) -> str:
    """A line of the table."""
    stack, found = lf.read_preset(name), {}
    for each in FORMATS.values():
        if each.dialect not in found:
            found[each.dialect] = convert(stack, name, each.dialect)
    return f"| `{name}` | {' | '.join(map(cell, found.values()))} |"


def cell(found: Conversion) -> str:
    """Of one program."""
    return f"{found.error['delta_e']:.1f} ({found.copied_error['delta_e']:.1f})"


def in_cycles(name: str, python: str, picture: Path | None) -> str:
    """What Cycles draws of the exported material, against the preset; and what was expected of it."""
    stack = lf.read_preset(name)
    found = convert(stack, name, "blender")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for file, text in {
            "stage.py": STAGE + SAVE,
            "paint.py": FORMATS["blender"].write(found),
            "kit.py": blender_kit(),
        }.items():
            (folder / file).write_text(text)
        for words in (
            ("stage.py", str(folder / "user.blend"), "paint.py"),
            ("kit.py", "--blend", "user.blend", "--samples", str(SAMPLES)),
        ):
            subprocess.run([python, *words], cwd=folder, check=True, capture_output=True)
        (view,) = scene_views(folder / "Sphere.toml")
    cycles, ours, formula = (
        view.image(v) for v in (view.target, draw(view, stack), draw(view, lf.Stack((), found.engine, lf.Corrected())))
    )
    if picture is not None:
        white = exposure(ours, view.covered)
        panels = [pictures.shown(f"{name} (JAX)", ours, white), pictures.shown("exported, drawn by Cycles", cycles, white)]
        picture.write_bytes(pictures.strip([[*panels, pictures.difference(cycles, ours, white, view.covered)]]))
    drawn, expected = image_error(cycles, ours, view.covered), image_error(formula, ours, view.covered)
    apart = image_error(cycles, formula, view.covered)
    told = lambda error: f"{error['rel_l2']:.3f} relative L2, delta E {error['delta_e']:.2f}"  # noqa: E731
    return f"{name}: Cycles {told(drawn)}; its formula {told(expected)}; the two apart {told(apart)}"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="parts of names of presets")
    parser.add_argument("--bpy", metavar="PYTHON", help="a Python with bpy: Cycles draws too")
    parser.add_argument("--picture", type=Path, help="where the last of them is drawn, beside the preset")
    args = parser.parse_args()
    lf.use_compilation_cache()
    names = (
        [preset.name for preset in lf.shipped_presets() if any(word in preset.name for word in args.words)]
        if args.words
        else SHOWN
    )
    if args.bpy is None:
        print(f"| preset | {' | '.join(dict.fromkeys(each.dialect for each in FORMATS.values()))} |\n|{' --- |' * 6}")
    for name in names:
        print(row(name) if args.bpy is None else in_cycles(name, args.bpy, args.picture), flush=True)


if __name__ == "__main__":
    main()
