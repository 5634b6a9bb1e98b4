"""What a material does without costs nothing: the printed shader gets shorter, and evaluation faster.

    python benchmarks/leaving_out.py

Prints, a material a row, the lines of the shader's functions and the run time of JAX on the same directions, relative to the first row.
Run times are the least of several, the materials taking turns, so that other work on the machine weighs on all alike.
"""

import dataclasses
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from layerfit import Coat, Conductor, Corrected, Lambert, Stack, predict, print_material
from layerfit.shader.verify import random_pairs

PAIRS = 1 << 18
ROUNDS = 7

COPPER = Conductor(alpha=0.2, eta=[0.201, 0.924, 1.102], k=[3.913, 2.453, 2.142])
ANISOTROPIC = dataclasses.replace(COPPER, alpha=None, alpha_x=0.1, alpha_y=0.3)
VARNISH = Coat(alpha=0.12, eta=1.5, tau=[0.1, 0.25, 0.7])
CLEAR = Coat(alpha=0.12, eta=1.5)

MATERIALS = {
    "absorbing coat over an anisotropic metal": Stack((VARNISH,), ANISOTROPIC),
    "without anisotropy": Stack((VARNISH,), COPPER),
    "without absorption": Stack((CLEAR,), COPPER),
    "without bounces": Stack((CLEAR,), COPPER, Corrected(orders=0)),
    "a diffuse base instead": Stack((CLEAR,), Lambert(albedo=[0.5, 0.28, 0.13])),
    "without the coat": Stack((), COPPER),
}


def main() -> None:
    wi, wo = random_pairs(PAIRS, 0)
    samples = wi[:, None], wo, np.ones_like(wi)[:, None]
    least = dict.fromkeys(MATERIALS, np.inf)
    for stack in MATERIALS.values():
        predict(stack, *samples)
    for _ in range(ROUNDS):
        for name, stack in MATERIALS.items():
            start = time.perf_counter()
            predict(stack, *samples)
            least[name] = min(least[name], time.perf_counter() - start)
    table = Table("material", "lines of the shader", "run time, relative")
    first = next(iter(least.values()))
    for name, stack in MATERIALS.items():
        table.add_row(name, str(print_material(stack, "m").functions.count("\n")), f"{least[name] / first:.2f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
