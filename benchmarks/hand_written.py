"""Printed shaders beside the best that were written by hand: instructions, time over Phong, and error against JAX.

    python benchmarks/hand_written.py --rounds 30

The shaders of `hand/` are functions of cosines, with the numbers of one material in them.
"""

import argparse
from pathlib import Path

import numpy as np

from layerfit._directions import FLOOR, random_pairs
from layerfit.forms.faithful import Faithful
from layerfit.layers import Coat
from layerfit.render import brdf_values
from layerfit.shader.cost import ROUNDS, instructions, times
from layerfit.shader.export import Shader, print_material
from layerfit.shader.template import template
from layerfit.shader.verify import shade_samples
from layerfit.stack import Stack
from layerfit.surfaces import Conductor
from layerfit.tiers.tier import make_tier

HAND = Path(__file__).parent / "hand"
COPPER = Conductor(alpha=0.2, eta=[0.201, 0.924, 1.102], k=[3.913, 2.453, 2.142])
COAT = Coat(alpha=0.1, eta=1.5, tau=[0.05, 0.2, 0.6])
MATERIALS = {"bare_metal": Stack((), COPPER), "faithful_metal": Stack((COAT,), COPPER, Faithful())}
PAIRS = 16384


def by_hand(name: str, cosines: Stack) -> Shader:
    """A shader of `hand/` as one that is printed; `cosines` is any material whose shader asks for cosines."""
    frame = template("cosines.glsl", frozenset())
    return Shader(name, cosines, (HAND / f"{name}.glsl").read_text() + frame, {})


def shaders() -> dict[str, tuple[Shader, Stack]]:
    """By their names, each with the material that it is of."""
    compact = make_tier(MATERIALS["faithful_metal"], "compact").stack
    rows: dict[str, tuple[Shader, Stack]] = {}
    for name, stack in MATERIALS.items():
        rows[f"{name}, printed"] = print_material(stack, name), stack
        rows[f"{name}, by hand"] = by_hand(name, compact), stack
    rows["faithful_metal, compact"] = print_material(compact, "compact"), MATERIALS["faithful_metal"]
    return rows


def error(shader: Shader, stack: Stack) -> float:
    """Largest relative difference from the material in JAX, over random and extreme pairs of directions."""
    wi, wo = random_pairs(PAIRS, 0)
    drawn = shade_samples(shader, wi[:, None], wo, np.ones((PAIRS, 1, 3), np.float32))
    exact = brdf_values(stack, wi, wo)
    return float(np.max(np.abs(drawn - exact) / np.maximum(np.abs(exact), FLOOR / np.pi)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--lights", type=int, default=1)
    asked = parser.parse_args()
    rows = shaders()
    timings = times({name: shader for name, (shader, _) in rows.items()}, asked.lights, asked.rounds)
    for name, (shader, stack) in rows.items():
        taken = timings[name]
        print(
            f"{name:<26} {instructions(shader, asked.lights).total:4d} instructions  {taken.median:.2f} x Phong "
            f"({taken.spread[0]:.2f} to {taken.spread[1]:.2f})  error {error(shader, stack):.1e}"
        )


if __name__ == "__main__":
    main()
