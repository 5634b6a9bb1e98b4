"""What printed shaders were to cost, and what they do: time over Phong, instructions, and largest error against the exact shader of the form.

    python benchmarks/shader_targets.py [--rounds 30]

A coat (alpha .1, eta 1.5, absorbing) over copper (alpha .2) or paper, with one light and with four; exact, and compact within 1e-4 and 1e-3.
Phong and all shaders take turns in one process.
"""

import argparse

from hand_written import COAT, COPPER

from layerfit.errors import InputError
from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.shader.cost import ROUNDS, instructions, times
from layerfit.shader.export import print_material
from layerfit.stack import Stack
from layerfit.surfaces import Lambert
from layerfit.tiers.tier import make_tier

BASES = {"metal": COPPER, "diffuse": Lambert(albedo=[0.5, 0.4, 0.3])}
AIMED = {
    ("faithful, metal", None): "1.5, 130",
    ("faithful, metal", 1e-4): "1.2, 106",
    ("corrected, metal", None): "3.2",
    ("corrected, metal", 1e-4): "1.7, 230",
    ("corrected, metal", 1e-3): "1.6",
    ("precise, metal", None): "3.2",
    ("precise, metal", 1e-4): "1.7, 230",
    ("precise, metal", 1e-3): "1.6",
    ("corrected, diffuse", None): "1.6",
    ("corrected, diffuse", 1e-4): "1.1, 100",
}
FOUR = {"metal": "1.8", "diffuse": "1.3"}
"""What compact shaders were to cost with four lights."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    asked = parser.parse_args()
    shaders, errors = {}, {}
    for form in (Faithful(), Corrected(), Precise()):
        for name, base in BASES.items():
            stack = Stack((COAT,), base, form)
            key = f"{type(form).__name__.lower()}, {name}"
            shaders[key, None], errors[key, None] = print_material(stack, "exact"), 0.0
            for most in (1e-4, 1e-3):
                try:
                    tier = make_tier(stack, "compact", most)
                except InputError as error:
                    print(f"{key}, compact within {most:g}: {error}")
                    continue
                shaders[key, most], errors[key, most] = print_material(tier.stack, "compact"), tier.error
    print("| shader | lights | aimed at: x Phong, instructions | x Phong | quartiles | instructions | error |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for lights in (1, 4):
        taken = times({str(key): shader for key, shader in shaders.items()}, lights, asked.rounds)
        for key, shader in shaders.items():
            name, most = key
            aimed = AIMED.get(key, "") if lights == 1 else FOUR[name.rpartition(" ")[2]] if most else ""
            time = taken[str(key)]
            tier = "exact" if most is None else f"compact, {most:g}"
            count = instructions(shader, lights).total
            spread = f"{time.spread[0]:.2f} to {time.spread[1]:.2f}"
            print(f"| {name}, {tier} | {lights} | {aimed} | {time.median:.2f} | {spread} | {count} | {errors[key]:.1e} |")


if __name__ == "__main__":
    main()
