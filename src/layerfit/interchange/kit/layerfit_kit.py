"""Render a reference for layerfit from a .blend, with all that a fit has to know of it. Written by `layerfit blender-kit`.

    blender scene.blend --background --python layerfit_kit.py
    blender scene.blend --background --python layerfit_kit.py -- --object Car --output renders --samples 1024

It renders one object alone, from the scene's camera, and leaves beside one another: NAME.exr (radiance, normals and positions), NAME.toml (camera
and lights, a scene of layerfit) and NAME.principled.json (its material, where a fit starts). The .blend is not changed. Blender 4 and 5, Cycles.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]

COLOURS = ("Base Color", "Specular Tint", "Coat Tint")
NUMBERS = (
    "Metallic",
    "Roughness",
    "IOR",
    "Specular IOR Level",
    "Anisotropic",
    "Anisotropic Rotation",
    "Thin Film Thickness",
    "Thin Film IOR",
)
COAT = ("Coat Weight", "Coat Roughness", "Coat IOR")
GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"}
POINT = 1e-3
"""Radius up to which a lamp is a point."""


class Unsuited(Exception):
    """What of the scene cannot be said to layerfit, and what to do."""


def main(words):
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="layerfit_kit.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--object", help="what to render; without, the active object")
    parser.add_argument("--output", type=Path, help="folder to write to; without, that of the .blend")
    parser.add_argument("--samples", type=int, default=512, help="samples a pixel (512)")
    parser.add_argument("--blend", type=Path, help="the .blend, where Python runs this and not Blender")
    args = parser.parse_args(words)
    if args.blend:
        bpy.ops.wm.open_mainfile(filepath=str(args.blend.resolve()))
    try:
        written = render(args)
    except Unsuited as error:
        print(f"layerfit: {error}", file=sys.stderr)
        return 2
    toml, principled = written
    print(f"Next: layerfit fit {toml} --start {principled} -o {toml.with_suffix('')}")
    return 0


def render(args):
    """Read the scene, set it up, render it, and write what is known."""
    scene = bpy.context.scene
    thing = chosen(scene, args.object)
    inputs, told = material(thing)
    camera_words, lamps = camera(scene), [*lights(), *world(scene)]
    if not lamps:
        raise Unsuited("nothing lights the scene. Add a sun, or give the world a colour")
    alone(scene, thing)
    settings(scene, args.samples)
    folder = (args.output or Path(bpy.path.abspath("//") or ".")).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    name = "".join(c if c.isalnum() else "_" for c in thing.name)
    scene.render.filepath = str(folder / f"{name}.exr")
    bpy.ops.render.render(write_still=True)
    toml, principled = folder / f"{name}.toml", folder / f"{name}.principled.json"
    principled.write_text(json.dumps({"schema": "layerfit/principled", "inputs": inputs}, indent=2) + "\n")
    toml.write_text(scene_file(f"{name}.exr", thing.name, camera_words, lamps))
    for line in told:
        print(f"layerfit: {line}")
    return toml, principled


def chosen(scene, name):
    """The object that is rendered."""
    thing = scene.objects.get(name) if name else bpy.context.view_layer.objects.active
    if thing is None or thing.type not in GEOMETRY:
        seen = ", ".join(other.name for other in scene.objects if other.type in GEOMETRY) or "none"
        raise Unsuited(
            f"{f'no object called {name}' if name else 'no object is active'} that can be rendered; name one with --object: {seen}"
        )
    return thing


def alone(scene, thing):
    """Hide all other things from the render: a fit knows of no shadows and of no light between surfaces."""
    thing.hide_render = False
    for other in scene.objects:
        drawn = other.type in GEOMETRY or (other.type == "EMPTY" and other.instance_type == "COLLECTION")
        if other != thing and drawn and not other.hide_render:
            other.hide_render = True
            print(f"layerfit: {other.name} is left out of the render")


def material(thing):
    """Inputs of its Principled BSDF, and what of them could not be read."""
    slot = thing.active_material
    tree = slot.node_tree if slot is not None else None
    found = [node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"] if tree else []
    if slot is None or not found:
        return {}, [f"{thing.name} has no Principled BSDF: the fit starts from Blender's defaults"]
    sockets = [found[0].inputs[name] for name in (*COLOURS, *NUMBERS, *COAT) if name in found[0].inputs]
    told = [
        f"{slot.name}: {socket.name} comes from a node; its plain value is the start" for socket in sockets if socket.is_linked
    ]
    return {s.name: list(s.default_value)[:3] if s.name in COLOURS else s.default_value for s in sockets}, told


def camera(scene):
    """Words of a pinhole: what the scene's camera is, without its depth of field."""
    eye = scene.camera
    if eye is None:
        raise Unsuited("the scene has no camera. Add one that sees the object")
    lens = eye.data
    if lens.type != "PERSP" or lens.shift_x or lens.shift_y:
        raise Unsuited(f"{eye.name} is not a plain perspective camera. Set its type to Perspective and its shifts to 0")
    lens.dof.use_dof = False
    if scene.render.pixel_aspect_x != scene.render.pixel_aspect_y:
        raise Unsuited("pixels are not square. Set both aspects of the output to 1")
    corners = lens.view_frame(scene=scene)
    height, depth = max(c.y for c in corners) - min(c.y for c in corners), -corners[0].z
    turn, position = eye.matrix_world.to_quaternion(), eye.matrix_world.translation
    forward, up = turn @ type(position)((0.0, 0.0, -1.0)), turn @ type(position)((0.0, 1.0, 0.0))
    return {
        "position": list(position),
        "look_at": list(position + forward),
        "up": list(up),
        "vfov_deg": math.degrees(2.0 * math.atan(0.5 * height / depth)),
    }


def lights():
    """A table for each lamp that is rendered."""
    return [lamp(thing) for thing in dict.fromkeys(rendered(bpy.context.view_layer.layer_collection)) if thing.type == "LIGHT"]


def rendered(layer):
    """Objects that a view layer's collection and those in it show in renders. One may be in several."""
    if layer.collection.hide_render:
        return []
    own = [] if layer.exclude else [thing for thing in layer.collection.objects if not thing.hide_render]
    return own + [thing for child in layer.children for thing in rendered(child)]


def lamp(thing):
    """Blender's strengths are W/m^2 of a sun and W of the others. Of a point the radiance is W / (4 pi^2 r^2), of an area W / (pi area)."""
    light, place = thing.data, thing.matrix_world
    bright = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    tint = light.temperature_color if getattr(light, "use_temperature", False) else (1.0, 1.0, 1.0)
    rgb = [bright * a * b for a, b in zip(light.color, tint, strict=True)]
    if light.use_nodes and light.node_tree:
        found = [node for node in light.node_tree.nodes if node.type == "EMISSION"]
        if len(found) != 1 or found[0].inputs["Color"].is_linked or found[0].inputs["Strength"].is_linked:
            raise Unsuited(f"{thing.name} is lit by nodes. Give it a plain colour and strength")
        color, strength = found[0].inputs["Color"].default_value, found[0].inputs["Strength"].default_value
        rgb = [strength * a * b for a, b in zip(rgb, list(color)[:3], strict=True)]
    if light.type == "SUN":
        light.angle = 0.0
        return {
            "type": "directional",
            "to_light": list(place.to_quaternion() @ type(place.translation)((0.0, 0.0, 1.0))),
            "irradiance_rgb": rgb,
        }
    if light.type == "AREA":
        return area(thing, rgb)
    if light.type != "POINT":
        raise Unsuited(
            f"{thing.name} is a lamp of type {light.type}: layerfit knows suns, points, areas and the world. Change it, or hide it from renders"
        )
    centre, radius = list(place.translation), light.shadow_soft_size
    if radius <= POINT:
        return {"type": "point", "position": centre, "intensity_rgb": [v / (4.0 * math.pi) for v in rgb]}
    light.use_soft_falloff = False
    radiance = [v / (4.0 * math.pi**2 * radius**2) for v in rgb]
    return {"type": "sphere", "center": centre, "radius": radius, "radiance_rgb": radiance}


def area(thing, rgb):
    """It shines along its -Z."""
    light, place = thing.data, thing.matrix_world
    if light.spread < math.pi - 1e-3 or any(abs(s - 1.0) > 1e-4 for s in place.to_scale()):
        raise Unsuited(
            f"{thing.name} is an area lamp that is scaled, or of a spread below 180 degrees. Apply its scale, and give it 180"
        )
    shape = {"SQUARE": "rectangle", "RECTANGLE": "rectangle", "DISK": "disk", "ELLIPSE": "disk"}[light.shape]
    sides = light.size, light.size if light.shape in ("SQUARE", "DISK") else light.size_y
    size = sides[0] * sides[1] * (math.pi / 4.0 if shape == "disk" else 1.0)
    return {
        "type": shape,
        "center": list(place.translation),
        "half_u": [0.5 * sides[0] * v for v in place.col[0][:3]],
        "half_v": [-0.5 * sides[1] * v for v in place.col[1][:3]],
        "radiance_rgb": [v / (math.pi * size) for v in rgb],
    }


def world(scene):
    """The world's light, the same from everywhere; none where it is black."""
    tree = scene.world.node_tree if scene.world else None
    found = [node for node in tree.nodes if node.type == "BACKGROUND"] if tree else []
    if not found:
        return []
    color, strength = found[0].inputs["Color"], found[0].inputs["Strength"]
    if strength.is_linked or (color.is_linked and strength.default_value):
        raise Unsuited(
            "the world is lit by nodes or an image. Give its background a plain colour; layerfit reads maps from a scene file"
        )
    rgb = [strength.default_value * v for v in list(color.default_value)[:3]]
    return [{"type": "constant", "radiance_rgb": rgb}] if any(rgb) else []


def settings(scene, samples):
    """Cycles without what changes the picture afterwards; a multilayer file of 32 bits."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.samples = samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.film_exposure = 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    scene.render.film_transparent = True
    scene.render.use_compositing = scene.render.use_sequencer = scene.render.use_border = scene.render.use_motion_blur = False
    for other in scene.view_layers:
        other.use = other == bpy.context.view_layer
    layer = bpy.context.view_layer
    layer.use_pass_combined = layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"


def scene_file(exr, what, camera_words, lamps):
    """The scene as layerfit reads it; the material is named when it is fitted."""
    lines = [
        f"# {json.dumps(what)} from {bpy.app.version_string}: written by layerfit_kit.py.",
        "",
        "[reference]",
        f"exr = {json.dumps(exr)}",
    ]
    lines += ["", "[camera]", *(f"{key} = {value(v)}" for key, v in camera_words.items())]
    for words in lamps:
        lines += ["", "[[light]]", *(f"{key} = {value(v)}" for key, v in words.items())]
    return "\n".join(lines) + "\n"


def value(v):
    """A TOML value: text, a number, or a list of numbers."""
    if isinstance(v, list):
        return f"[{', '.join(map(value, v))}]"
    return json.dumps(v) if isinstance(v, str) else repr(float(f"{v:.9g}"))


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [] if bpy.app.binary_path else sys.argv[1:]
    sys.exit(main(given))
