"""Render the reference picture of this folder that comes from Blender, as a Blender user saves it.

    uv run --no-project --python 3.11 --with bpy==5.0.1 python render_blender.py

Camera and sun are read from the scene file NAME.toml beside this script. The true material is below, and is written to
NAME.truth.json, which no fit reads.
"""

import argparse
import json
import math
import sys
import time
import tomllib
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent

REFERENCES = {
    "coated_paint": {
        "size": 128,
        "spp": 1024,
        "inputs": {
            "Base Color": [0.6, 0.06, 0.03],
            "Metallic": 0.0,
            "Roughness": 0.5,
            "Specular IOR Level": 0.0,
            "Coat Weight": 1.0,
            "Coat Roughness": 0.25,
            "Coat IOR": 1.5,
            "Coat Tint": [0.96, 0.86, 0.7],
        },
    },
}


def build(scene_file: dict, inputs: dict, size: int) -> bpy.types.Scene:
    """A sphere of radius 1, a sun and a camera in an otherwise black and empty world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_uv_sphere_add(segments=512, ring_count=256, radius=1.0)
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("paint")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    principled = material.node_tree.nodes["Principled BSDF"]
    for name, value in inputs.items():
        principled.inputs[name].default_value = [*value, 1.0] if isinstance(value, list) else value
    bpy.context.object.data.materials.append(material)

    light = scene_file["light"][0]
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle = 0.0
    strength = max(light["irradiance_rgb"])
    sun.energy, sun.color = strength, [x / strength for x in light["irradiance_rgb"]]
    lamp = bpy.data.objects.new("sun", sun)
    lamp.rotation_euler = Vector(light["to_light"]).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(lamp)

    view = scene_file["camera"]
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "VERTICAL", math.radians(view["vfov_deg"])
    eye = bpy.data.objects.new("camera", camera)
    back = (Vector(view["position"]) - Vector(view["look_at"])).normalized()
    right = Vector(view["up"]).cross(back).normalized()
    axes = Matrix((right, back.cross(right), back)).transposed().to_4x4()
    eye.matrix_world = Matrix.Translation(view["position"]) @ axes
    scene.collection.objects.link(eye)
    scene.camera = eye

    world = bpy.data.worlds.new("world")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    scene.world = world
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    return scene


def settings(scene: bpy.types.Scene, spp: int) -> None:
    """Cycles without what changes the picture afterwards; Blender's default pixel filter; a multilayer file."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", spp, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    scene.render.film_transparent = True
    layer = scene.view_layers[0]
    layer.use_pass_combined = layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"


def progress(status: str, *_: object) -> None:
    """One line on standard error, rewritten: what Cycles says it is doing."""
    print(f"{status.split(' | ')[-1]:60.60s}", end="\r", file=sys.stderr, flush=True)


def render(name: str, out: Path, spp: int | None) -> None:
    """Render one reference, and write what is true of it."""
    scene_file, truth = tomllib.loads((HERE / f"{name}.toml").read_text()), REFERENCES[name]
    spp = spp or truth["spp"]
    scene = build(scene_file, truth["inputs"], truth["size"])
    settings(scene, spp)
    bpy.app.handlers.render_stats.append(progress)  # cleared by the next read_factory_settings
    scene.render.filepath = str(out / f"{name}.exr")
    start = time.monotonic()
    print(f"{name}: {spp} samples a pixel", file=sys.stderr)
    bpy.ops.render.render(write_still=True)
    print(f"\n{name}: {time.monotonic() - start:.1f} s", file=sys.stderr)
    inputs = truth["inputs"]
    known = {
        "about": "what is known of this render; never read by a fit",
        "renderer": f"Blender {bpy.app.version_string}, Cycles (CPU)",
        "method": "Principled BSDF, a sun of strength pi: irradiance pi; pixel = f cos irradiance",
        "spp": spp,
        "pixel_filter": "Blackman-Harris, width 1.5 pixels",
        "inputs": inputs,
        "meaning": {
            "coat.alpha": inputs["Coat Roughness"] ** 2,
            "coat.eta": inputs["Coat IOR"],
            "base.albedo": inputs["Base Color"],
            "coat.tau": [round(-math.log(t) / 2.0, 5) for t in inputs["Coat Tint"]],
            "note": "widths are squares of roughness; tau is -log(tint) / 2. Blender multiplies by tint^(1 / cos) along the "
            "viewing path and leaves out light between coat and base: tau and albedo of a slab that looks alike are near these",
        },
    }
    (out / f"{name}.truth.json").write_text(json.dumps(known, indent=2) + "\n")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(REFERENCES), metavar="NAME", help="references to render; all without")
    parser.add_argument("-o", "--out", type=Path, default=HERE, help="folder to write to (this one)")
    parser.add_argument("--spp", type=int, help="samples a pixel; without, what the shipped files have")
    args = parser.parse_args()
    if unknown := set(args.names) - set(REFERENCES):
        parser.error(f"no reference called {', '.join(sorted(unknown))}; there are {', '.join(REFERENCES)}")
    args.out.mkdir(parents=True, exist_ok=True)
    for name in args.names:
        render(name, args.out.resolve(), args.spp)


if __name__ == "__main__":
    main()
