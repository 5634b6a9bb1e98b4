"""A map against a loop: seconds for one of 512 x 512 texels under twelve lights, and the same texels fitted one by one by scipy.

    python benchmarks/maps.py [--side 512] [--texels 200] [--free coat.thickness_um] [--model corrected]

Images are drawn by the model itself, with half a percent of noise, and held in memory: reading files is not timed. The peer is
`scipy.optimize.least_squares` (trf, 2-point) over the same compiled model, texel by texel, from the same start with the same weights; its turns lie
between those of the map, on some of the texels, and the ratio is of times for each texel.
"""

import argparse
import resource
import time
from typing import Any

import jax
import numpy as np
from scipy.optimize import least_squares

import layerfit as lf
from layerfit.capture.geometry import frames
from layerfit.maps.descent import Descent, Found
from layerfit.maps.judge import judge
from layerfit.maps.parameters import mapped
from layerfit.maps.texels import Texels

LIGHTS, NOISE, TILE = 12, 0.005, 8192
EYE = np.array([0.0, 0.0, 4.0])


def panel(side: int, start: lf.Stack, free: Any) -> tuple[Texels, np.ndarray]:
    """Observations of a flat panel whose mapped parameters vary by a third of what they are, and their true vectors."""
    y, x = (np.mgrid[0:side, 0:side].reshape(2, -1) + 0.5) / side
    position = np.stack([2.0 * x - 1.0, 1.0 - 2.0 * y, np.zeros_like(x)], -1)
    n = len(position)
    wo = EYE - position
    wo = np.repeat(wo / np.linalg.norm(wo, axis=-1, keepdims=True), LIGHTS, 0).astype(np.float32)
    t, p = np.radians(np.tile([25.0, 45.0, 60.0], LIGHTS // 3)), 2.0 * np.pi * np.arange(LIGHTS) / LIGHTS
    to_light = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).astype(np.float32)
    wi = np.tile(to_light, (n, 1))[:, None]
    weight = np.pi * np.repeat(wi[..., 2:], 3, -1)
    waves = np.stack([np.sin((4.0 + k) * x + k) * np.cos((3.0 + k) * y) for k in range(free.size)], -1)
    truth = np.clip(free.pack(start) + 0.3 * waves, *free.bounds())
    rows = np.arange(n * LIGHTS, dtype=np.int32).reshape(n, LIGHTS)
    empty = np.zeros((n * LIGHTS, 3), np.float32)
    frame = np.broadcast_to(frames(np.array([[0.0, 0.0, 1.0]]), None), (n, 3, 3)).astype(np.float32)
    of = np.tile(np.arange(LIGHTS, dtype=np.int16), n)
    bright = np.ones((LIGHTS, 3), np.float32)
    texels = Texels(
        (side, side), np.arange(n), rows, of, wi, wo, weight, empty, bright, np.zeros(LIGHTS, np.float32), frame, False
    )
    descent = Descent(texels, start, free, "square", 1, 0)
    rng = np.random.default_rng(0)
    for which in tiles(n):
        light = descent.values(truth[which], descent.seen(which)).transpose(0, 2, 1)
        empty[rows[which]] = light * (1.0 + NOISE * rng.normal(size=light.shape))
    bright[:] = np.quantile(empty.reshape(n, LIGHTS, 3), 0.98, axis=0)
    return texels, truth


def tiles(n: int) -> list[np.ndarray]:
    return np.array_split(np.arange(n), -(-n // TILE))


def by_scipy(descent: Descent, which: np.ndarray) -> float:
    """Seconds for each texel of a loop over some of them, with the weights that the map ended on."""
    seen = descent.weighed(np.broadcast_to(descent.points[0], (len(which), descent.free.size)), descent.seen(which), which)
    one = Descent(descent.texels, descent.start, descent.free, "square", 1, 0)
    one.batch = 1
    lower, upper = descent.free.bounds()
    first = np.clip(descent.points[0], lower + 1e-9, upper - 1e-9)

    def residual(u: np.ndarray, at: int) -> np.ndarray:
        here = jax.tree.map(lambda a: a[at : at + 1], seen)
        return ((one.values(u[None], here) - here.target) * here.inverse_sigma).ravel()

    residual(first, 0)
    began = time.perf_counter()
    for at in range(len(which)):
        least_squares(residual, first, bounds=(lower, upper), method="trf", jac="2-point", x_scale="jac", args=(at,))
    return (time.perf_counter() - began) / len(which)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--side", type=int, default=512)
    parser.add_argument("--texels", type=int, default=200, help="that the peer fits")
    parser.add_argument("--free", default="coat.thickness_um", help="parameters with commas")
    parser.add_argument("--model", choices=("corrected", "precise"), default="corrected")
    parser.add_argument("--starts", type=int, default=1)
    asked = parser.parse_args()
    lf.use_compilation_cache()
    form = lf.Corrected() if asked.model == "corrected" else lf.Precise()
    coat = lf.Coat(alpha=0.12, absorption_per_mm=[2.0, 6.0, 15.0], thickness_um=40.0)
    with jax.enable_x64(True):
        start, free = mapped(lf.Stack((coat,), lf.Lambert(albedo=[0.5, 0.28, 0.13]), form), asked.free.split(","), "maps")
        texels, truth = panel(asked.side, start, free)
        descent = Descent(texels, start, free, "square", asked.starts, 0)
        descent.solve(np.arange(min(descent.batch, len(texels.index))))  # compiled
        began, processor, parts, peer = time.perf_counter(), time.process_time(), [], 0.0
        chosen = np.random.default_rng(1).permutation(len(texels.index))[: asked.texels]
        waiting = list(np.array_split(chosen, 4))
        spent = 0.0
        for k, which in enumerate(tiles(len(texels.index))):
            parts.append(descent.solve(which)[0])
            if waiting and k % max(len(tiles(len(texels.index))) // 4, 1) == 0:
                paused = time.perf_counter()
                some = waiting.pop()
                peer += by_scipy(descent, some) * len(some)
                spent += time.perf_counter() - paused
        seconds = time.perf_counter() - began - spent
        found = Found.together(parts)
        judged = judge(found, texels.seen, free.bounds())
    z = (found.u - truth) / judged.sigma
    each, theirs = seconds / len(texels.index), peer / max(len(chosen), 1)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"{asked.side} x {asked.side} texels, {LIGHTS} lights, {asked.free}, {asked.model}: {seconds:.1f} s, {1e6 * each:.0f} us a texel"
    )
    print(f"processor (with the peer) {time.process_time() - processor:.0f} s, memory {memory:.2f} GB at most")
    print(f"scipy's loop: {1e6 * theirs:.0f} us a texel of {len(chosen)}, {theirs / each:.0f} times as long")
    print(f"within one sigma: {100.0 * np.mean(np.abs(z) < 1.0):.1f} %; converged {100.0 * np.mean(found.done):.2f} %")


if __name__ == "__main__":
    main()
