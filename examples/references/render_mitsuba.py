"""Render the reference pictures of this folder that come from Mitsuba 3.

    uv run --no-project --python 3.11 --with mitsuba==3.9.1 --with openexr==3.5.3 python render_mitsuba.py

Camera and lights are read from the scene files NAME.toml beside this script. The true materials are below, and are written to
NAME.truth.json, which no fit reads. Mitsuba compiles with LLVM: install libLLVM (19 was used; on Debian
`apt install libllvm19`), and set DRJIT_LIBLLVM_PATH to the library where it is not found.
"""

import argparse
import json
import math
import platform
import sys
import time
import tomllib
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR

mi.set_variant("llvm_ad_rgb")
TRANSMISSION = mi.BSDFFlags.Transmission

HERE = Path(__file__).resolve().parent
SHELL = 0.005  # thickness of the coat in the shipped files; the sphere has radius 1
PASS_SPP = 256  # samples a pixel in one pass, at most: bounds the memory

# Indices against air, for the channels R, G and B.
COPPER = {"eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}
ALUMINIUM = {"eta": [1.658, 0.880, 0.521], "k": [9.224, 6.270, 4.837]}
IRON = {"eta": [2.911, 2.950, 2.585], "k": [3.089, 2.932, 2.767]}

REFERENCES = {
    "lacquered_copper": {
        "size": 128,
        "spp": 16384,
        "integrator": "shell",
        "coat": {"alpha": 0.12, "eta": 1.5, "tau": [0.08, 0.25, 0.7]},
        "base": {"type": "conductor", "alpha": 0.2, **COPPER},
    },
    "varnished_wood": {
        "size": 96,
        "spp": 16384,
        "integrator": "shell",
        "coat": {"alpha": 0.08, "eta": 1.5, "tau": [0.03, 0.1, 0.25]},
        "base": {"type": "lambert", "albedo": [0.5, 0.28, 0.13]},
    },
    "lacquered_aluminium_environment": {
        "size": 96,
        "spp": 16384,
        "integrator": "shell",
        "coat": {"alpha": 0.1, "eta": 1.5, "tau": [0.05, 0.3, 0.45]},
        "base": {"type": "conductor", "alpha": 0.25, **ALUMINIUM},
    },
    "brushed_steel": {
        "size": 128,
        "spp": 1,
        "integrator": "exact",
        "base": {"type": "conductor", "alpha_x": 0.08, "alpha_y": 0.3, **IRON},
    },
}


class ShellIntegrator(mi.SamplingIntegrator):
    """Path tracing of a sphere in a thin, clear or absorbing shell, under one distant or point light or an environment map.

    The same light transport as `volpath`, without bias, and with far less noise, for three reasons. The absorption is a factor
    exp(-sigma t) rather than a collision that ends the path. The shell is convex and outside it is nothing but the light: what
    leaves it is counted on the spot, and every path goes on inside. And under a light without extent, every second direction
    from the core is drawn from the light as the shell refracts it: `volpath` meets such a light only where a path arrives
    below the shell in the right direction by chance. Strategies are weighted by the balance heuristic (Veach and Guibas 1995).
    """

    def __init__(self, sigma: list[float], scene: mi.Scene):
        super().__init__(mi.Properties())
        self.sigma = mi.Color3f(sigma)
        self.shell = next(b for b in (shape.bsdf() for shape in scene.shapes()) if mi.has_flag(b.flags(), TRANSMISSION))
        self.environment = scene.environment()

    @dr.syntax
    def sample(self, scene, sampler, ray, medium=None, active=True):
        """Radiance along rays; see `mitsuba.SamplingIntegrator.sample`."""
        both, transmit, reflect = mi.BSDFContext(), mi.BSDFContext(), mi.BSDFContext()
        transmit.type_mask = TRANSMISSION
        reflect.type_mask = mi.BSDFFlags.Reflection
        shell = mi.BSDFPtr(self.shell)
        ray = mi.Ray3f(ray)
        through, result = mi.Color3f(1.0), mi.Color3f(0.0)
        inside, seen, active = mi.Bool(False), mi.Bool(False), mi.Bool(active)
        hidden = mi.Float(0.0)
        while active:
            si = scene.ray_intersect(ray, active)
            active &= si.is_valid()
            seen |= active
            bsdf = si.bsdf()
            through *= dr.select(inside, dr.exp(-self.sigma * (si.t + hidden)), 1.0)
            at_shell = active & mi.has_flag(bsdf.flags(), TRANSMISSION)
            at_core = active & ~at_shell
            entering, leaving = at_shell & (si.wi.z > 0.0), at_shell & (si.wi.z < 0.0)

            # Out of the shell: reflected by it, or from inside it.
            ds, light = scene.sample_emitter_direction(si, sampler.next_2d(active), False, active)
            to_light = si.to_local(ds.d)
            facing = active & (to_light.z > 0.0)
            lit = at_shell & facing
            value = through * light * bsdf.eval(both, si, to_light, lit)
            if self.environment is None:
                result += dr.select(lit, value, 0.0)
            else:
                pdf = bsdf.pdf(reflect, si, to_light, lit & entering) + bsdf.pdf(transmit, si, to_light, lit & leaving)
                # Ratios of densities: Mitsuba's are infinite, at times, at a pole of the map or in a facet seen edge on.
                result += dr.select(lit & (ds.pdf > 0.0), value / (1.0 + pdf / ds.pdf), 0.0)
                u, v = sampler.next_1d(active), sampler.next_2d(active)
                sent, weight_sent = bsdf.sample(reflect, si, u, v, entering)
                passed, weight_passed = bsdf.sample(transmit, si, u, v, leaving)
                out, weight = dr.select(entering, sent, passed), dr.select(entering, weight_sent, weight_passed)
                away = dr.zeros(mi.SurfaceInteraction3f)
                away.wi = -si.to_world(out.wo)
                beyond = dr.zeros(mi.DirectionSample3f)
                beyond.d = -away.wi
                other = self.environment.pdf_direction(si, beyond, at_shell)
                value = through * weight * self.environment.eval(away, at_shell)
                result += dr.select(at_shell & (out.pdf > 0.0) & (out.wo.z > 0.0), value / (1.0 + other / out.pdf), 0.0)

            # On: into the shell, back from its inner side, or off the core.
            u, v = sampler.next_1d(active), sampler.next_2d(active)
            into, weight_into = bsdf.sample(transmit, si, u, v, entering)
            back, weight_back = bsdf.sample(reflect, si, u, v, leaving)
            off, weight_off = bsdf.sample(both, si, u, v, at_core)
            if self.environment is None:
                from_light = mi.SurfaceInteraction3f(si)
                from_light.wi = to_light
                guided = at_core & facing & (sampler.next_1d(active) < 0.5)
                refracted, _ = shell.sample(transmit, from_light, u, v, guided)
                off.wo = dr.select(guided, -refracted.wo, off.wo)
                value, pdf = bsdf.eval_pdf(both, si, off.wo, at_core)
                dense = shell.pdf(transmit, from_light, -off.wo, at_core & facing)
                pdf = dr.select(facing, 0.5 * (pdf + dense), pdf)
                weight_off = dr.select(pdf > 0.0, value / pdf, 0.0)
            wo = dr.select(at_core, off.wo, dr.select(entering, into.wo, back.wo))
            through *= dr.select(at_core, weight_off, dr.select(entering, weight_into, weight_back))
            d = si.to_world(wo)
            ray = si.spawn_ray(d)
            # A ray starts a little off its surface: the way that this leaves out is absorbing too.
            hidden = dr.norm(ray.o - si.p) / dr.maximum(dr.abs(dr.dot(d, si.n)), 0.05)
            inside |= entering
            # Roulette behind the shell only: towards it, a guided path is dense, light and wanted.
            left = dr.max(through)
            survival = dr.select(at_shell, dr.minimum(1.0, left * 50.0), 1.0)
            active &= (left > 0.0) & (sampler.next_1d(active) < survival)
            through /= dr.maximum(survival, 1e-30)
        return result, seen, []


def bsdf_dict(base: dict, outside: float) -> dict:
    """Mitsuba's description of a base under a medium of index `outside`."""
    if base["type"] == "lambert":
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": base["albedo"]}}
    indices = {key: {"type": "rgb", "value": [x / outside for x in base[key]]} for key in ("eta", "k")}
    widths = {"alpha_u": base["alpha_x"], "alpha_v": base["alpha_y"]} if "alpha_x" in base else {"alpha": base["alpha"]}
    return {"type": "roughconductor", "distribution": "ggx", **widths, **indices}


def light_dict(light: dict, folder: Path) -> dict:
    """Mitsuba's description of a light of a scene file."""
    if light["type"] == "directional":
        direction = [-x for x in light["to_light"]]
        return {"type": "directional", "direction": direction, "irradiance": {"type": "rgb", "value": light["irradiance_rgb"]}}
    if light["type"] == "point":
        return {"type": "point", "position": light["position"], "intensity": {"type": "rgb", "value": light["intensity_rgb"]}}
    image = upsampled(read_rgb(folder / light["file"]))
    return {"type": "envmap", "bitmap": mi.Bitmap(image), "scale": light.get("scale", 1.0)}


def scene_dict(scene: dict, truth: dict, folder: Path, shell: float) -> dict:
    """Mitsuba's description of a reference, its coat so thick."""
    camera, coat, size = scene["camera"], truth.get("coat"), truth["size"]
    to_world = mi.ScalarTransform4f().look_at(camera["position"], camera["look_at"], camera["up"])
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    result = {
        "type": "scene",
        "sensor": {"type": "perspective", "fov": camera["vfov_deg"], "fov_axis": "y", "to_world": to_world, "film": film},
        "light": light_dict(scene["light"][0], folder),
        # Mitsuba's sphere has its poles on Z; turned, dp/du runs along the circles of latitude around Y.
        "core": {"type": "sphere", "bsdf": bsdf_dict(truth["base"], coat["eta"] if coat else 1.0)},
    }
    turned = mi.ScalarTransform4f().rotate([1, 0, 0], -90)
    result["core"]["to_world"] = turned.scale(1.0 - shell) if coat else turned
    if coat:
        rough = {"distribution": "ggx", "alpha": coat["alpha"], "int_ior": coat["eta"], "ext_ior": 1.0}
        result["shell"] = {"type": "sphere", "radius": 1.0, "bsdf": {"type": "roughdielectric", **rough}}
    return result


def add_medium(description: dict, tau: list[float], shell: float) -> None:
    """Fill the shell with an absorbing medium for `volpath`.

    Mitsuba starts a ray (1 + max |p|) * RayEpsilon off its surface; a thin shell is that much thinner to it, on the mean over
    the sphere, where max |p| is 0.83. That it is not the same everywhere shows in shells below 0.005: they want `ShellIntegrator`.
    """
    epsilon = 1500.0 * 2.0**-24
    thickness = shell - 1.83 * epsilon
    sigma = [t / thickness for t in tau]
    scale = max(sigma)
    value = {"type": "rgb", "value": [s / scale for s in sigma]}
    description["shell"]["interior"] = {"type": "homogeneous", "albedo": 0.0, "sigma_t": value, "scale": scale}


def path_traced(
    name: str, description: dict, tau: list[float], shell: float, spp: int, passes: int, integrator: str
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (H, W, 3) and its standard error, from the variance over passes of different seeds."""
    if integrator == "shell":
        loaded = mi.load_dict(description)
        tracer = ShellIntegrator([t / shell for t in tau], loaded)
    else:
        add_medium(description, tau, shell)
        loaded = mi.load_dict(description)
        tracer = mi.load_dict({"type": integrator, "max_depth": -1, "rr_depth": 1000, "hide_emitters": True})
    passes = max(passes, math.ceil(spp / PASS_SPP))
    each = math.ceil(spp / passes)
    mean, squares, start = 0.0, 0.0, time.monotonic()
    for k in range(passes):
        image = np.array(mi.render(loaded, integrator=tracer, spp=each, seed=k), np.float64)
        step = image - mean  # Welford 1962
        mean = mean + step / (k + 1)
        squares = squares + step * (image - mean)
        progress(name, k + 1, passes, start)
    if not np.all(np.isfinite(mean)):
        raise FloatingPointError(f"{name}: {np.sum(~np.isfinite(mean).all(-1))} pixels are not finite")
    return mean, np.sqrt(squares / (passes - 1) / passes)


def progress(name: str, done: int, total: int, start: float) -> None:
    """One line on standard error, rewritten."""
    end = "\n" if done == total else "\r"
    print(f"{name:32s} pass {done:4d} of {total}, {time.monotonic() - start:6.1f} s", end=end, file=sys.stderr, flush=True)


def hits(loaded: mi.Scene, size: int, grid: int) -> tuple[mi.SurfaceInteraction3f, mi.Bool]:
    """What the camera sees at grid x grid points of each pixel, in rows."""
    points = (np.arange(size * grid) + 0.5) / (size * grid)
    y, x = np.meshgrid(points, points, indexing="ij")
    position = mi.Point2f(mi.Float(x.ravel().astype(np.float32)), mi.Float(y.ravel().astype(np.float32)))
    ray, _ = loaded.sensors()[0].sample_ray(0.0, 0.5, position, mi.Point2f(0.5))
    si = loaded.ray_intersect(ray)
    return si, si.is_valid()


def geometry(description: dict, size: int, grid: int = 16) -> dict[str, np.ndarray]:
    """Coverage, normal and position: means over grid x grid points of each pixel, free of noise."""
    loaded = mi.load_dict(description)
    si, seen = hits(loaded, size, grid)
    result = {"A": mi.Float(seen)}
    result |= {f"N.{axis}": dr.select(seen, getattr(si.n, axis.lower()), 0.0) for axis in "XYZ"}
    result |= {f"P.{axis}": dr.select(seen, getattr(si.p, axis.lower()), 0.0) for axis in "XYZ"}
    return {key: np.array(value, np.float64).reshape(size, grid, size, grid).mean((1, 3)) for key, value in result.items()}


def exact(description: dict, light: dict, size: int) -> dict[str, np.ndarray]:
    """Mitsuba's BSDF at the point in the middle of each pixel under a point light, and the tangent along dp/du."""
    loaded = mi.load_dict(description)
    si, seen = hits(loaded, size, 1)
    away = mi.Point3f(light["position"]) - si.p
    f_cos = si.bsdf().eval(mi.BSDFContext(), si, si.to_local(dr.normalize(away)), seen)
    rgb = dr.select(seen, f_cos * mi.Color3f(light["intensity_rgb"]) / dr.squared_norm(away), 0.0)
    result = {"R": rgb.x, "G": rgb.y, "B": rgb.z, "A": mi.Float(seen)}
    for letter, vector in (("N", si.n), ("P", si.p), ("T", dr.normalize(si.dp_du))):
        result |= {f"{letter}.{axis}": dr.select(seen, getattr(vector, axis.lower()), 0.0) for axis in "XYZ"}
    return {key: np.array(value).reshape(size, size) for key, value in result.items()}


def studio(width: int = 64, height: int = 32) -> np.ndarray:
    """Three soft boxes in a dim room, half floats. Texel centres: u = (column + 1/2) / W, v = (row + 1/2) / H."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    longitude, latitude = 360.0 * u, 90.0 - 180.0 * v  # longitude 0 is -Z, 90 +X, 180 +Z: where the camera stands

    def box(at: float, half_width: float, low: float, high: float, soft: float = 9.0) -> np.ndarray:
        aside = np.abs((longitude - at + 180.0) % 360.0 - 180.0) - half_width
        outside = np.maximum(aside, np.maximum(low - latitude, latitude - high))
        t = np.clip(0.5 - outside / (2.0 * soft), 0.0, 1.0)
        return (t * t * (3.0 - 2.0 * t))[..., None]

    room = 0.12 + 0.14 * (1.0 - v[..., None]) ** 2
    image = room * np.array([0.95, 1.0, 1.08])
    image = image + 6.0 * box(132.0, 30.0, 18.0, 62.0) * np.array([1.0, 0.97, 0.92])  # key, right of the camera
    image = image + 3.0 * box(252.0, 11.0, -25.0, 55.0) * np.array([0.9, 0.97, 1.08])  # strip, left
    image = image + 4.0 * box(0.0, 40.0, 30.0, 58.0) * np.array([1.0, 1.0, 1.0])  # behind the sphere: seen near the rim
    return image.astype(np.float16)


def read_rgb(path: Path) -> np.ndarray:
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([channels[c].pixels for c in "RGB"], -1).astype(np.float64)


def upsampled(image: np.ndarray, factor: int = 16) -> np.ndarray:
    """The map on Mitsuba's finer texels, bilinearly.

    Mitsuba has its first and last row ON the poles, v = row / (H - 1), most other renderers half a texel off them. On fine
    texels it sees the same radiance as those that read the small map the usual way.
    """
    height, width = image.shape[:2]
    x = (np.arange(width * factor) + 0.5) / factor - 0.5
    y = np.clip(np.linspace(0.0, height, height * factor + 1) - 0.5, 0.0, height - 1.0)
    x0, y0 = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), height - 2)
    fx, fy = (x - x0)[None, :, None], (y - y0)[:, None, None]
    columns = image[:, x0 % width] * (1.0 - fx) + image[:, (x0 + 1) % width] * fx
    return (columns[y0] * (1.0 - fy) + columns[y0 + 1] * fy).astype(np.float32)


def write(path: Path, channels: dict[str, np.ndarray], half: tuple[str, ...] = ()) -> None:
    """Float channels, those whose layer is in `half` as half floats; ZIP."""
    pixels = {
        name: np.ascontiguousarray(a, np.float16 if name.split(".")[0] in half else np.float32) for name, a in channels.items()
    }
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "comments": f"Mitsuba {mi.__version__}"}
    OpenEXR.File(header, pixels).write(str(path))


def render(name: str, out: Path, spp: int | None, passes: int, integrator: str | None, shell: float) -> None:
    """Render one reference, and write what is true of it."""
    scene, truth = tomllib.loads((HERE / f"{name}.toml").read_text()), REFERENCES[name]
    method = truth["integrator"] if "coat" not in truth else integrator or truth["integrator"]
    known = {
        "about": "what is known of this render; never read by a fit",
        "renderer": f"Mitsuba {mi.__version__} ({mi.variant()}, {platform.machine()})",
        "material": {key: truth[key] for key in ("coat", "base") if key in truth},
    }
    description = scene_dict(scene, truth, out, shell)
    if method == "exact":
        channels = exact(description, scene["light"][0], truth["size"])
        known["method"] = "Mitsuba's roughconductor evaluated at pixel centres, no noise"
        known["tangent"] = "alpha_x along T, the circles of latitude around Y"
        print(f"{name:32s} exact", file=sys.stderr)
    else:
        spp = spp or truth["spp"]
        channels = geometry(description, truth["size"])
        mean, error = path_traced(name, description, truth["coat"]["tau"], shell, spp, passes, method)
        channels |= {c: mean[..., k] for k, c in enumerate("RGB")} | {f"SE.{c}": error[..., k] for k, c in enumerate("RGB")}
        lit = (channels["A"] == 1.0) & (mean > 0.0).all(-1)
        relative = np.median(error[lit] / mean[lit], 0)
        print(f"{name:32s} median relative standard error {', '.join(f'{r:.2%}' for r in relative)}", file=sys.stderr)
        known |= {
            "method": f"path traced through two concentric spheres, integrator {method!r}",
            "spp": spp,
            "shell_thickness": shell,
            "base_indices": "of conductors: against air above, divided by the coat's for the render",
            "median_relative_standard_error": np.round(relative, 4).tolist(),
        }
    known["masking"] = "Smith, separable: G1(wi) G1(wo)"
    write(out / f"{name}.exr", channels, half=("SE",))
    (out / f"{name}.truth.json").write_text(json.dumps(known, indent=2) + "\n")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(REFERENCES), metavar="NAME", help="references to render; all without")
    parser.add_argument("-o", "--out", type=Path, default=HERE, help="folder to write to (this one)")
    parser.add_argument("--spp", type=int, help="samples a pixel; without, what the shipped files have")
    parser.add_argument("--passes", type=int, default=64, help="independent passes for the standard error, at least (64)")
    parser.add_argument("--integrator", choices=("shell", "volpath", "volpathmis"), help="another one for coated references")
    parser.add_argument("--shell", type=float, default=SHELL, help=f"thickness of coats ({SHELL}); thinner is nearer to a slab")
    args = parser.parse_args()
    if unknown := set(args.names) - set(REFERENCES):
        parser.error(f"no reference called {', '.join(sorted(unknown))}; there are {', '.join(REFERENCES)}")
    if args.passes < 2:
        parser.error("--passes: a standard error takes two passes at least")
    if not 0.0005 <= args.shell <= 0.02:
        parser.error("--shell: should be 0.0005 to 0.02; Mitsuba starts rays 0.00016 off their surface")
    args.out.mkdir(parents=True, exist_ok=True)
    write(args.out / "studio.exr", dict(zip("RGB", np.moveaxis(studio(), -1, 0), strict=True)), half=("R", "G", "B"))
    for name in args.names:
        render(name, args.out, args.spp, args.passes, args.integrator, args.shell)


if __name__ == "__main__":
    main()
