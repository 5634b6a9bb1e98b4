"""A fit of a rough conductor against inverse rendering: Mitsuba 3 with Adam, until the width is within 1 % and stays there.

    pip install mitsuba   # and LLVM: DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1
    python benchmarks/mitsuba_peer.py [--side 128] [--spp 4 16] [--rates 0.01 0.02 0.05 0.1] [--runs 2]

The set-up of Mitsuba's own tutorial on gradient-based optimisation: variant llvm_ad_rgb, integrator prb, mean squared error, Adam, one
seed an iteration, a reference of 512 samples a pixel; rate .05 and 4 samples a pixel are that tutorial's. The scene is a copper sphere
below a distant light, which Mitsuba renders. Free are alpha, eta and k, seven numbers; both sides start at alpha .5, eta 1 and k 3 and
take turns in one process. layerfit's fit goes to its own end; its solver, alone, is timed as Adam is: to where the width comes to within
1 % for good. Of Adam that is for 50 iterations more, which are not counted.
"""

import argparse
import functools
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import drjit as dr
import jax
import mitsuba as mi
import numpy as np
from rich.console import Console
from rich.table import Table

from layerfit.capture.exr import write_exr
from layerfit.capture.reference import load_reference
from layerfit.capture.samples import View
from layerfit.capture.scene import Camera, Directional, Reference, Sphere
from layerfit.fit.blocks import arrange, weighted
from layerfit.fit.fit import fit
from layerfit.fit.parameters import parametrise
from layerfit.fit.residuals import Residuals, initial
from layerfit.fit.weights import inverse_sigma
from layerfit.stack import Stack
from layerfit.surfaces import Conductor

TRUTH: dict[str, Any] = {"alpha": 0.2, "eta": [0.201, 0.924, 1.102], "k": [3.913, 2.453, 2.142]}
START: dict[str, Any] = {"alpha": 0.5, "eta": [1.0] * 3, "k": [3.0] * 3}
BOUNDS = {"alpha": (0.01, 1.0), "eta": (0.01, 10.0), "k": (0.0, 10.0)}
FREE = ["base.alpha", "base.eta", "base.k"]
TOLERANCE, STAYS = 0.01, 50
CAMERA = Camera((0.8, 0.6, 4.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 26.0)
TO_LIGHT = (0.46175709, 0.55410852, 0.69263564)


def rgb(values: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": values}


def scene(metal: dict[str, Any], side: int) -> Any:
    """The sphere, as Mitsuba knows it."""
    bsdf = {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha": metal["alpha"],
        "eta": rgb(metal["eta"]),
        "k": rgb(metal["k"]),
    }
    film = {"type": "hdrfilm", "width": side, "height": side, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    to_world = mi.ScalarTransform4f().look_at(origin=CAMERA.position, target=CAMERA.look_at, up=CAMERA.up)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "prb"},
            "sensor": {"type": "perspective", "fov": CAMERA.vfov_deg, "to_world": to_world, "film": film},
            "sphere": {"type": "sphere", "bsdf": bsdf},
            "sun": {"type": "directional", "direction": [-c for c in TO_LIGHT], "irradiance": rgb([np.pi] * 3)},
        }
    )


def adam(made: Any, target: Any, spp: int, rate: float, most: int) -> tuple[float, int] | None:
    """Seconds and iterations until the width is within 1 % for good; None where it is not in `most` iterations."""
    parameters = mi.traverse(made)
    keys = {f"sphere.bsdf.{name}.value": name for name in START}
    for key, name in keys.items():
        parameters[key] = START[name] if name == "alpha" else mi.Color3f(START[name])
    parameters.update()
    began = time.perf_counter()
    optimiser = mi.ad.Adam(lr=rate)
    for key in keys:
        optimiser[key] = parameters[key]
    parameters.update(optimiser)
    arrived: tuple[float, int] | None = None
    for k in range(1, most + 1):
        image = mi.render(made, parameters, spp=spp, seed=k)
        dr.backward(dr.mean(dr.square(image - target), axis=None))
        optimiser.step()
        for key, name in keys.items():
            optimiser[key] = dr.clip(optimiser[key], *BOUNDS[name])
        parameters.update(optimiser)
        alpha = float(np.ravel(np.array(parameters["sphere.bsdf.alpha.value"]))[0])
        if abs(alpha / TRUTH["alpha"] - 1.0) > TOLERANCE:
            arrived = None
        elif arrived is None:
            arrived = time.perf_counter() - began, k
        elif k - arrived[1] >= STAYS:
            return arrived
    return None


def view(image: np.ndarray) -> View:
    """What Mitsuba rendered, as layerfit reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sphere.exr"
        write_exr(path, {c: image[..., k] for k, c in enumerate("RGB")})
        return load_reference(Reference(path, CAMERA, (Directional(TO_LIGHT, (np.pi,) * 3),), Sphere(), {}, None, {}), 0.1)


def layerfit(seen: View) -> tuple[float, float]:
    """Seconds of a whole fit, with its starts and sigmas, and the width."""
    start = Stack((), Conductor(**START, masking="smith_separable"))
    began = time.perf_counter()
    found = fit([seen], start, free=FREE)
    return time.perf_counter() - began, float(found.stack.base.alpha)


class Descent:
    """The solver alone, from the same start: all pixels, equal weights, no other starts, no sigmas. What Adam does."""

    def __init__(self, seen: View) -> None:
        start, self.free = parametrise(Stack((), Conductor(**START, masking="smith_separable")), FREE, (), "start")
        self.start, samples = start.astype(np.float32), seen.samples()
        blocks, layout = arrange([samples], 0)
        blocks = weighted(blocks, layout, [inverse_sigma(samples.target, samples.target, None, "uniform")])
        self.residuals = Residuals(self.start, self.free, None, blocks, len(layout.pixel))

    def run(self) -> tuple[float, int]:
        """Seconds and steps until the width is within 1 %, in one call as a fit makes it."""
        with jax.enable_x64(True):
            most = self.arrival()
            u = self.free.pack(self.start)
            began = time.perf_counter()
            np.asarray(self.residuals.steps(u, initial(u), self.free.bounds(), most=most)[0])
            return time.perf_counter() - began, most

    @functools.cache  # noqa: B019 (one object, which lives as long as the program)
    def arrival(self) -> int:
        """Steps after which the width is within 1 % for good."""
        u, widths = self.free.pack(self.start), []
        state = initial(u)
        while not bool(state.done):
            u, state, _ = self.residuals.steps(u, state, self.free.bounds(), most=1)
            widths.append(float(self.free.values(np.asarray(u))["base.alpha"]))
        off = np.abs(np.array(widths) / TRUTH["alpha"] - 1.0) > TOLERANCE
        return int(np.max(np.flatnonzero(off), initial=-1)) + 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=128)
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 16])
    parser.add_argument("--rates", type=float, nargs="+", default=[0.01, 0.02, 0.05, 0.1])
    parser.add_argument("--runs", type=int, default=2, help="runs after the first, which compiles")
    parser.add_argument("--iterations", type=int, default=400, help="what Adam may take at most")
    arguments = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    target = mi.render(scene(TRUTH, arguments.side), spp=512, seed=1234)
    seen, made = view(np.array(target)), scene(START, arguments.side)
    descent = Descent(seen)
    settings = [(spp, rate) for spp in arguments.spp for rate in arguments.rates]
    whole: list[float] = []
    solver: list[Any] = []
    theirs: dict[tuple[int, float], list[Any]] = {setting: [] for setting in settings}
    width = 0.0
    for _ in range(arguments.runs + 1):
        seconds, width = layerfit(seen)
        whole.append(seconds)
        solver.append(descent.run())
        for setting in settings:
            if None not in theirs[setting]:  # one that did not arrive is not asked again
                theirs[setting].append(adam(made, target, *setting, arguments.iterations))
    again = [t for t, _ in solver[1:]]
    table = Table("", "", "first, s", "again, s", "over the fit's", "over its solver's")

    def row(name: str, note: str, first: float, seconds: Sequence[float]) -> None:
        ratios = [np.median(np.array(seconds) / np.array(ours)) for ours in (whole[1:], again)]
        table.add_row(name, note, f"{first:.2f}", f"{np.median(seconds):.3f}", f"{ratios[0]:.3g}", f"{ratios[1]:.3g}")

    row("layerfit, a whole fit", f"alpha {width:.5f}, {abs(width / TRUTH['alpha'] - 1.0):.1e} off", whole[0], whole[1:])
    row("layerfit, its solver", f"{solver[-1][1]} steps", solver[0][0], again)
    for (spp, rate), runs in theirs.items():
        name = f"Mitsuba {mi.__version__}, {spp} samples a pixel, rate {rate:g}"
        if None in runs:
            table.add_row(name, f"not in {arguments.iterations} iterations")
        else:
            row(name, f"{runs[-1][1]} iterations", runs[0][0], [t for t, _ in runs[1:]])
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
