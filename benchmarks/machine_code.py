"""What the software driver's compiler makes of printed shaders: instructions of x86-64 for eight pixels, counted by `objdump`.

    python benchmarks/machine_code.py

The materials are those of `shader_targets.py`, over metal, as compact shaders within 1e-4. llvmpipe compiles each shader twice, for squares that a
triangle covers whole and for others; counts are of one. Linux only.
"""

import re
import subprocess
import tempfile
from pathlib import Path

from hand_written import COAT, COPPER

from layerfit.forms.corrected import Corrected
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.shader.cost import _Drawing, phong
from layerfit.shader.export import Shader, print_material
from layerfit.stack import Stack
from layerfit.tiers.tier import make_tier

KINDS = {
    "products": r"\tvmulps",
    "sums": r"\tv(add|sub)ps",
    "products and sums": r"\tvfn?m(add|sub)\w*ps",
    "divisions": r"\tvdivps",
    "roots": r"\tvsqrtps",
    "constants": r"\tvbroadcastss",
    "on the stack": r"\(%r[sb]p",
}


def mapped() -> set[str]:
    """Address ranges of this process that hold code of no file."""
    lines = (line.split() for line in Path("/proc/self/maps").read_text().splitlines())
    return {fields[0] for fields in lines if fields[1] == "r-xp" and len(fields) == 5}


def machine_code(shader: Shader) -> str:
    """The largest piece of code that drawing a shader brings, disassembled."""
    before = mapped()
    drawing = _Drawing(shader, 1)
    ranges = [[int(end, 16) for end in part.split("-")] for part in mapped() - before]
    first, last = max(ranges, key=lambda ends: ends[1] - ends[0])
    with open("/proc/self/mem", "rb") as memory, tempfile.NamedTemporaryFile() as file:
        memory.seek(first)
        file.write(memory.read(last - first))
        file.flush()
        drawing.release()
        command = ["objdump", "-D", "-b", "binary", "-m", "i386:x86-64", "--no-show-raw-insn", file.name]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def main() -> None:
    shaders = {"Phong": phong()}
    for form in (Faithful(), Corrected(), Precise()):
        tier = make_tier(Stack((COAT,), COPPER, form), "compact", 1e-4)
        shaders[type(form).__name__.lower()] = print_material(tier.stack, "compact")
    for name, shader in shaders.items():
        text = machine_code(shader)
        counts = {kind: len(re.findall(pattern, text)) // 2 for kind, pattern in KINDS.items()}
        print(f"{name:<10}", ", ".join(f"{count} {kind}" for kind, count in counts.items()))


if __name__ == "__main__":
    main()
