"""Cases and tolerances that several tests share.

Tolerances of physics: relative to the value, absolute below a floor. float64 is held against 50-digit values. float32 is held
against float64 at the SAME rounded inputs: an index of 1.0001 loses three digits of its distance from 1 when it is rounded, which no
formula can give back.
"""

import dataclasses
import functools
import json
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from layerfit._compiled import fusion_emitters
from layerfit.capture.exr import write_exr
from layerfit.capture.geometry import sphere_surface
from layerfit.capture.reference import load_reference
from layerfit.capture.samples import View
from layerfit.capture.scene import Camera, Directional, Reference, Sphere
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.layers import Coat
from layerfit.render import predict
from layerfit.shader.export import HEADERS, Shader, print_material
from layerfit.stack import Stack, evaluate
from layerfit.surfaces import (
    Blinn,
    CarPaint,
    Conductor,
    CookTorrance,
    Dielectric,
    Flakes,
    KubelkaMunk,
    Lafortune,
    Lambert,
    OrenNayar,
    Phong,
    TorranceSparrow,
)

REL = {np.float64: 1e-12, np.float32: 1e-5}
FLOOR = {np.float64: 1e-13, np.float32: 1e-6}

# What is evaluated a few times only is compiled quickly rather than well: options for `jax.jit`, 2 to 4 times as quick.
QUICKLY = {"xla_backend_optimization_level": 0} | fusion_emitters(newer=False)

needs_tools = pytest.mark.skipif(
    shutil.which("spirv-opt") is None or shutil.which("glslangValidator") is None,
    reason="no spirv-opt; on Debian or Ubuntu: apt-get install -y glslang-tools spirv-tools",
)
"""Instructions are counted with what compiles shaders."""

COPPER = {"eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}


@functools.cache
def cases(oracle: Path) -> dict[str, list[dict[str, Any]]]:
    """50-digit cases by the name of their formula."""
    by_name: dict[str, list[dict[str, Any]]] = {}
    for case in json.loads((oracle / "cases.json").read_text())["cases"]:
        by_name.setdefault(case["fn"], []).append(case)
    return by_name


def close(value: float, wanted: float, rel: float, floor: float) -> bool:
    """Within `rel` of the value, or of the floor where the value is smaller."""
    return bool(abs(value - wanted) <= rel * max(abs(wanted), floor / rel))


def _width(layer: Mapping[str, Any]) -> dict[str, Any]:
    if layer["ax"] == layer["ay"]:
        return {"alpha": layer["ax"]}
    return {"alpha": None, "alpha_x": layer["ax"], "alpha_y": layer["ay"]}


def surface_of(base: Mapping[str, Any]) -> Any:
    """The surface of a case."""
    if base["kind"] == "lambert":
        return Lambert(albedo=base["rho"])
    kind = {"distribution": base["ndf"], "masking": base.get("G", "smith")}
    if base["kind"] == "dielectric":
        return Dielectric(**_width(base), eta=base["ior"], **kind)
    return Conductor(**_width(base), eta=base["n"], k=base["k"], **kind)


def coat_of(layer: Mapping[str, Any], name: str = "coat") -> Coat:
    """The coat of a case."""
    return Coat(
        name=name,
        **_width(layer),
        eta=layer["ior"],
        tau=layer["alpha"] * layer["d"],
        distribution=layer["ndf"],
        masking=layer.get("G", "smith"),
    )


def stack_of(layers: list[Mapping[str, Any]], form: Any) -> Stack:
    """The stack of a case."""
    return Stack(tuple(coat_of(layer, f"coat{k}") for k, layer in enumerate(layers[:-1])), surface_of(layers[-1]), form)


# Not jitted: chunks are, one by one, and are shared by all materials; compiling every material whole would take minutes.
def brdf(stack: Stack, wi: Any, wo: Any) -> Any:
    """BRDF of one pair of directions."""
    return evaluate(stack.form, stack.prepare(), wi, wo)


@jax.jit
def brdf_rows(stack: Stack, wi: Any, wo: Any) -> Any:
    """BRDF (n, 3) of rows of directions."""
    prepared = stack.prepare()
    one = lambda i, o: jnp.broadcast_to(evaluate(stack.form, prepared, i, o), (3,))  # noqa: E731
    return jax.vmap(one)(jnp.asarray(wi), jnp.asarray(wo))


def with_slope(fn: Callable[[Stack], Any], stack: Stack) -> Any:
    """A function of a material, and its derivative along all of its numbers at once."""
    return jax.jit(lambda s: jax.jvp(fn, (s,), (jax.tree.map(jnp.ones_like, s),)))(stack)


def direction(theta_deg: float, phi_deg: float = 0.0) -> np.ndarray:
    """A unit direction by its angles."""
    t, p = np.radians([theta_deg, phi_deg])
    return np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])


def hemisphere(count: int, seed: int = 0) -> np.ndarray:
    """Directions above the surface (n, 3), uniform in solid angle."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(0.02, 1.0, count)
    phi = rng.uniform(0.0, 2.0 * np.pi, count)
    s = np.sqrt(1.0 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], -1)


WOOD = [0.5, 0.28, 0.13]
LAFORTUNE = Lafortune(kd=WOOD, ks=[1.5, 1.2, 0.9], cx=-0.98, cz=0.97, exponent=30.0)


def varnish(**coat: Any) -> Coat:
    """A coat with all that a coat can have."""
    return Coat(**({"alpha": 0.1, "eta": 1.5, "tau": [0.05, 0.2, 0.6]} | coat))


STACKS: dict[str, Stack] = {
    "conductor": Stack((), Conductor(alpha=0.2, **COPPER)),
    "conductor, Beckmann": Stack((), Conductor(alpha=0.2, distribution="beckmann", **COPPER)),
    "conductor, anisotropic": Stack((), Conductor(alpha=None, alpha_x=0.1, alpha_y=0.35, **COPPER)),
    "conductor, anisotropic Beckmann": Stack(
        (), Conductor(alpha=None, alpha_x=0.1, alpha_y=0.35, distribution="beckmann", masking="smith_separable", **COPPER)
    ),
    "conductor, V-cavity": Stack((), Conductor(alpha=0.05, masking="vcavity", **COPPER)),
    "dielectric": Stack((), Dielectric(alpha=0.3, eta=1.5)),
    "lambert": Stack((), Lambert(albedo=[0.5, 0.28, 0.13])),
    "oren_nayar": Stack((), OrenNayar(albedo=[0.5, 0.28, 0.13], sigma=0.4)),
    "oren_nayar, qualitative": Stack((), OrenNayar(albedo=0.5, sigma=0.4, form="qualitative")),
    "phong": Stack((), Phong(kd=WOOD, ks=0.3, exponent=80.0)),
    "phong, faithful": Stack((), Phong(ks=0.1, exponent=40.0, scaling="faithful")),
    "blinn": Stack((), Blinn(kd=WOOD, ks=0.2, exponent=300.0)),
    "lafortune": Stack((), LAFORTUNE),
    "lafortune, two lobes with a grain": Stack(
        (), Lafortune(ks=0.5, cx=-0.9, cy=-1.02, ks_2=[0.02, 0.01, 0.02], cx_2=0.7, cz_2=0.7, exponent_2=4.0)
    ),
    "torrance_sparrow": Stack((), TorranceSparrow(ks=12.0, kappa=7.0, kd=0.1, **COPPER)),
    "cook_torrance": Stack((), CookTorrance(alpha=0.25, ks=0.6, kd=[0.1, 0.05, 0.02], **COPPER)),
    "kubelka_munk": Stack((), KubelkaMunk(kx=[0.1, 0.4, 0.9], sx=1.2, kx_2=0.3, sx_2=0.7, substrate=0.8)),
    "corrected over lafortune": Stack((varnish(),), LAFORTUNE),
    "corrected over conductor": Stack((varnish(),), Conductor(alpha=0.2, **COPPER)),
    "corrected, narrow": Stack((varnish(alpha=0.02),), Conductor(alpha=0.02, **COPPER)),
    "corrected with trapped light": Stack((varnish(),), Conductor(alpha=0.4, **COPPER), Corrected(trapped=True)),
    "corrected, clear coat": Stack((varnish(tau=None),), Conductor(alpha=0.2, **COPPER)),
    "corrected over dielectric": Stack((varnish(),), Dielectric(alpha=0.2, eta=2.2)),
    "corrected over lambert": Stack((varnish(),), Lambert(albedo=[0.5, 0.28, 0.13])),
    "corrected over oren_nayar": Stack((varnish(),), OrenNayar(albedo=[0.5, 0.28, 0.13])),
    "corrected, Beckmann": Stack((varnish(distribution="beckmann"),), Conductor(alpha=0.2, distribution="beckmann", **COPPER)),
    "corrected, anisotropic": Stack(
        (varnish(alpha=None, alpha_x=0.05, alpha_y=0.2),), Conductor(alpha=None, alpha_x=0.3, alpha_y=0.1, **COPPER)
    ),
    "corrected, three layers": Stack(
        (varnish(), Coat(name="primer", alpha=0.2, eta=1.35, tau=[0.3, 0.1, 0.2])), Conductor(alpha=0.25, **COPPER)
    ),
    "corrected, three layers over lambert": Stack(
        (varnish(), Coat(name="primer", alpha=0.2, eta=1.7, tau=[0.3, 0.1, 0.2])), Lambert(albedo=[0.5, 0.28, 0.13])
    ),
    "corrected, absorption and thickness": Stack(
        (Coat(alpha=0.1, eta=1.5, absorption_per_mm=[1.0, 4.0, 12.0], thickness_um=50.0),), Conductor(alpha=0.2, **COPPER)
    ),
    "car_paint": Stack((), CarPaint(kd=0.05, ks=0.06, ks_2=[0.1, 0.12, 0.13], f0_2=0.8, alpha_2=0.15, scaling="cook_torrance")),
    "flakes": Stack((), Flakes(**COPPER)),
    "corrected over flakes": Stack((varnish(tau=None),), Flakes(coverage=0.6, albedo=[0.02, 0.05, 0.3], **COPPER)),
    "milky over conductor": Stack((varnish(tau_s=0.5, g=0.6),), Conductor(alpha=0.2, **COPPER)),
    "milky over lambert": Stack((varnish(tau_s=[0.5, 0.8, 1.2], g=0.6),), Lambert(albedo=[0.5, 0.28, 0.13])),
    "precise over conductor": Stack((varnish(),), Conductor(alpha=0.2, **COPPER), Precise()),
    "precise, narrow": Stack((varnish(alpha=0.025),), Conductor(alpha=0.02, **COPPER), Precise()),
    "precise, Beckmann": Stack((varnish(distribution="beckmann"),), Conductor(alpha=0.2, **COPPER), Precise()),
    "precise, rough and conserving": Stack((varnish(alpha=0.5, eta=1.7),), Conductor(alpha=0.4, **COPPER), Precise("multi")),
    "precise, clear coat": Stack((varnish(tau=None),), Conductor(alpha=0.2, **COPPER), Precise()),
    "precise over lambert": Stack((varnish(),), Lambert(albedo=[0.5, 0.28, 0.13]), Precise()),
    "precise over oren_nayar": Stack((varnish(alpha=0.3),), OrenNayar(albedo=[0.5, 0.28, 0.13]), Precise("multi")),
    "precise, anisotropic": Stack(
        (varnish(alpha=None, alpha_x=0.05, alpha_y=0.2),), Conductor(alpha=None, alpha_x=0.3, alpha_y=0.1, **COPPER), Precise()
    ),
    "precise, two coats": Stack(
        (varnish(), Coat(name="primer", alpha=0.25, eta=1.8, tau=[0.3, 0.1, 0.2])), Conductor(alpha=0.25, **COPPER), Precise()
    ),
    "precise, the inner coat rarer": Stack(
        (varnish(eta=1.7), Coat(name="primer", alpha=0.2, eta=1.4)), Lambert(albedo=[0.5, 0.28, 0.13]), Precise("multi")
    ),
    "precise over an anisotropic metal": Stack(
        (varnish(tau=None),), Conductor(alpha=None, alpha_x=0.1, alpha_y=0.35, **COPPER), Precise("multi")
    ),
    "faithful over conductor": Stack((varnish(masking="vcavity"),), Conductor(alpha=0.2, **COPPER), Faithful()),
    "faithful at the normal": Stack((varnish(),), Conductor(alpha=0.2, **COPPER), Faithful("n", "n")),
    "faithful over lambert": Stack((varnish(),), Lambert(albedo=[0.5, 0.28, 0.13]), Faithful()),
    "faithful, three layers": Stack(
        (varnish(masking="vcavity"), Coat(name="primer", alpha=0.2, eta=1.35, tau=0.3)),
        Conductor(alpha=0.25, **COPPER),
        Faithful(),
    ),
}
"""One material of every structure, for tests that all of them must pass."""

BELOW_COATS: dict[str, Stack] = {
    "corrected over phong": Stack((varnish(),), Phong(kd=WOOD, ks=[0.3, 0.2, 0.1], exponent=80.0)),
    "corrected over blinn": Stack((varnish(),), Blinn(kd=WOOD, ks=0.2, exponent=300.0)),
    "corrected over lafortune with a grain": Stack((varnish(),), Lafortune(ks=0.5, cx=-0.9, cy=-1.02)),
    "corrected over torrance_sparrow": Stack((varnish(tau=None),), TorranceSparrow(ks=12.0, kappa=7.0, **COPPER)),
    "corrected over cook_torrance": Stack((varnish(),), CookTorrance(alpha=0.25, ks=0.6, kd=0.2, **COPPER)),
    "corrected over phong, faithful": Stack((varnish(),), Phong(kd=0.1, ks=0.1, exponent=40.0, scaling="faithful")),
    "corrected over car_paint": Stack((varnish(),), CarPaint(kd=WOOD, ks_2=[0.1, 0.2, 0.3], f0_2=0.8, alpha_2=0.15)),
    "faithful over blinn": Stack((varnish(),), Blinn(kd=0.1, ks=0.2, exponent=20.0, scaling="faithful"), Faithful()),
}
"""The bases that say little new below a coat: for fewer tests."""

APPROXIMATE: dict[str, Stack] = {
    "conductor, Schlick": Stack((), Conductor(alpha=0.2, fresnel="schlick", **COPPER)),
    "conductor, Lazanyi": Stack((), Conductor(alpha=0.2, fresnel="lazanyi", **COPPER)),
    "dielectric, Lazanyi": Stack((), Dielectric(alpha=0.3, eta=1.5, fresnel="lazanyi")),
    "corrected, Schlick and Lazanyi": Stack((varnish(fresnel="schlick"),), Conductor(alpha=0.2, fresnel="lazanyi", **COPPER)),
    "corrected, into a rarer coat": Stack(
        (varnish(eta=1.7), Coat(name="primer", alpha=0.2, eta=1.35, tau=0.3, fresnel="schlick")),
        Lambert(albedo=WOOD),
    ),
    "precise over Lazanyi": Stack((varnish(),), Conductor(alpha=0.2, fresnel="lazanyi", **COPPER), Precise()),
    "faithful, Lazanyi": Stack((varnish(fresnel="lazanyi"),), CookTorrance(fresnel="lazanyi", **COPPER), Faithful()),
}
"""Fresnel reflectances that are not exact."""


@functools.cache
def printed(stack: Stack, uniforms: bool = False) -> Shader:
    """The shader of a material of a list, printed once for all tests of it."""
    return print_material(stack, "test", uniforms)


def every_text(stack: Stack) -> dict[str, str]:
    """The shader of a material as files: its numbers as constants and as uniforms, in every language."""
    return {
        f"{target}_{uniforms}.frag": printed(stack, uniforms).text(target) for uniforms in (False, True) for target in HEADERS
    }


def compiles(folder: Path, files: Mapping[str, str], *options: str) -> None:
    """Assert that shaders compile: all of them by one process, of a compiler that is of no driver. Skips where it is absent."""
    if shutil.which("glslangValidator") is None:
        pytest.skip("no glslangValidator; on Debian or Ubuntu: apt-get install -y glslang-tools")
    for name, text in files.items():
        (folder / name).write_text(text)
    ran = subprocess.run(["glslangValidator", *options, *files], cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout


def sphere_view(stack: Stack, folder: Path, side: int) -> View:
    """A sphere of a material under one distant light, drawn by the model at `side` x `side` pixels, as a fit sees it."""
    camera = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
    covered = sphere_surface(Sphere(), camera, side, side).covered
    path = folder / "sphere.exr"
    write_exr(path, dict.fromkeys("RGB", np.where(covered, 0.5, 0.0)) | {"A": covered.astype(float)})
    sun = Directional((0.46175709, 0.55410852, 0.69263564), (np.pi, np.pi, np.pi))
    view = load_reference(Reference(path, camera, (sun,), Sphere(), {}, None, {}), 0.1)
    image = predict(stack, *view.samples(np.arange(len(view.index))).arrays)
    return dataclasses.replace(view, target=image.astype(np.float32))
