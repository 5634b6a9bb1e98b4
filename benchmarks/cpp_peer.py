"""layerfit's evaluation and its products J^T J against the same formula in C++, compiled by g++ for this processor, on two threads.

    python benchmarks/cpp_peer.py [--pairs 65536] [--runs 20]

The formula is the printed one: the GLSL of a material becomes C++ by `cpp_peer.hpp`, which has GLSL's words, on plain numbers for the
values and on numbers with derivatives for J^T J, where what does not depend on a parameter carries none. Both sides are given the
prepared material and its derivatives, and the pairs of directions in the layout that suits them; layerfit's time of values holds the
preparation too. Numbers are compared before times are; runs take turns in one process. A plain loop is left to the compiler to
vectorise; "by hand" is the most that C++ can do here: AVX-512 vectors of 16 pixels, and libmvec's functions of them.
"""

import argparse
import ctypes
import operator
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ["OMP_WAIT_POLICY"] = "passive"  # threads that wait for work must not take time from the other side

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from rich.console import Console
from rich.table import Table

from layerfit._compiled import Compiled
from layerfit.fit import residuals
from layerfit.fit.blocks import LARGEST, Blocks
from layerfit.fit.parameters import parametrise
from layerfit.fit.solve import products
from layerfit.forms.corrected import Corrected
from layerfit.forms.precise import Precise
from layerfit.preset import read_preset
from layerfit.render import predict
from layerfit.shader.export import print_material
from layerfit.shader.verify import FLOOR, random_pairs
from layerfit.stack import Stack

HERE = Path(__file__).parent
FLAGS = {
    "-O3": ["-DLANES=1"],
    "-O3 -ffast-math": ["-DLANES=1", "-ffast-math"],
    "-O3 -ffast-math, 16 lanes by hand": ["-DLANES=16", "-ffast-math"],
}
COMMAND = ["g++", "-std=c++20", "-O3", "-march=native", "-fopenmp", "-fsingle-precision-constant", "-shared", "-fPIC"]
LOOPS = """
constexpr int BLOCK = 256;
INLINE auto shade(auto m, const float *wi, const float *wo, int i, int n) {
    return lf_evaluate(m, FreeDirection(vec3(load(wi + i), load(wi + n + i), 0.0f), load(wi + 2 * n + i)),
                       FreeDirection(vec3(load(wo + i), load(wo + n + i), 0.0f), load(wo + 2 * n + i)));
}

extern "C" void values(const float *numbers, const float *wi, const float *wo, const float *weight, float *out, int n) {
#pragma omp parallel for num_threads(2) schedule(static)
    for (int start = 0; start < n; start += BLOCK) {
        const auto m = material(Values{numbers});
#pragma omp simd
        for (int i = start; i < start + BLOCK; i += LANES) {
            const auto f = shade(m, wi, wo, i, n);
            store(out + i, f.x * load(weight + i));
            store(out + n + i, f.y * load(weight + n + i));
            store(out + 2 * n + i, f.z * load(weight + 2 * n + i));
        }
    }
}
"""
PRODUCTS = """
constexpr int K = 4, R = K + 1;

extern "C" void products(const float *numbers, int count, const float *wi, const float *wo, const float *weight,
                         const float *target, const float *inverse_sigma, double *out, int n) {
    double total[3 * R * R] = {};
#pragma omp parallel for num_threads(2) schedule(static) reduction(+ : total)
    for (int start = 0; start < n; start += BLOCK) {
        const auto m = material(Tangents<K>{numbers, count});
        alignas(64) float rows[3][R][BLOCK];
#pragma omp simd
        for (int j = 0; j < BLOCK; j += LANES) {
            const int i = start + j;
            const auto f = shade(m, wi, wo, i, n);
            auto row = [&](int c, auto model) LAMBDA {
                const F s = load(inverse_sigma + c * n + i), scale = load(weight + c * n + i) * s;
                store(&rows[c][0][j], model.d[0] * scale);
                store(&rows[c][1][j], model.d[1] * scale);
                store(&rows[c][2][j], model.d[2] * scale);
                store(&rows[c][3][j], model.d[3] * scale);
                store(&rows[c][K][j], model.v * scale - load(target + c * n + i) * s);
            };
            row(0, f.x);
            row(1, f.y);
            row(2, f.z);
        }
        for (int c = 0; c < 3; ++c)
            for (int k = 0; k < R; ++k)
                for (int l = 0; l <= k; ++l) {
                    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
                    for (int j = 0; j < BLOCK; ++j) sum += double(rows[c][k][j]) * rows[c][l][j];
                    total[(c * R + k) * R + l] += sum;
                }
    }
    for (int c = 0; c < 3; ++c)
        for (int k = 0; k < R; ++k)
            for (int l = 0; l < R; ++l) out[(c * R + k) * R + l] = total[(c * R + (k > l ? k : l)) * R + (k > l ? l : k)];
}
"""


def choices(text: str) -> str:
    """An expression with `select(a, b, c)` for `a ? b : c`: no branch, so that loops of it vectorise."""
    flat, groups, depth, begin = "", [], 0, 0
    for k, letter in enumerate(text):
        if letter == "(" and (depth := depth + 1) == 1:
            begin = k + 1
        elif letter == ")" and (depth := depth - 1) == 0:
            flat += f"({len(groups)})"
            groups.append(choices(text[begin:k]))
        elif depth == 0:
            flat += letter
    flat = re.sub(r"([^,?]+)\?([^,:]+):([^,]+)", r"select(\1,\2,\3)", flat)
    # A select's own brackets hold groups, not a number of one.
    return re.sub(r"\((\d+)\)", lambda group: f"({groups[int(group[1])]})", flat)


def body(lines: list[str]) -> list[str]:
    """Statements with the types left to the compiler; a name that is assigned again becomes another: its type may have changed."""
    names: dict[str, str] = {}
    out = []
    for line in lines:
        declared, name, expression = re.fullmatch(r"\s*(?:(return)|(?:\w+ )?(\w+) =) (.*);", line).groups()
        expression = choices(re.sub(r"(?<![.\w])[A-Za-z_]\w*", lambda w: names.get(w[0], w[0]), expression))
        if declared:
            out.append(f"    return {expression};")
        else:
            names[name] = f"{name}_{len(out)}"
            out.append(f"    const auto {names[name]} = {expression};")
    return out


def function(name: str, given: str, lines: str) -> str:
    """A printed function with its types left to the compiler: a number has derivatives only where one goes in."""
    arguments = ", ".join(f"auto {argument.split()[-1]}" for argument in given.split(", "))
    return "\n".join([f"INLINE auto {name}({arguments}) {{", *body(lines.splitlines()), "}", ""])


def struct(name: str, fields: Sequence[str]) -> str:
    kinds = ", ".join(f"class T{k}" for k in range(len(fields)))
    members = " ".join(f"T{k} {field};" for k, field in enumerate(fields))
    return f"template <{kinds}> struct {name} {{ {members} }};\n"


def cpp(stack: Stack) -> str:
    """The printed material as C++: structs and functions as printed, constants as a `Material` that is read at run time."""
    printed = print_material(stack, "peer").functions.partition("vec3 lf_brdf(")[0]
    text = re.sub(r" *//.*", "", printed).replace("lf_evaluate(", "lf_evaluate(Material m, ")
    structs = re.findall(r"^struct (\w+) \{(.*?)^\};", text, re.M | re.S)
    fields = {name: re.findall(r"(\w+) (\w+);", lines) for name, lines in structs}
    constants = re.findall(r"^const (\w+) (lf_\w+) = ", text, re.M)
    functions = re.findall(r"^\w+ (lf_\w+)\((.*?)\) \{\n(.*?)^\}", text, re.M | re.S)
    out = [struct(name, [field for _, field in members]) for name, members in fields.items()]
    out.append(struct("Material", [name for _, name in constants]))
    owned = re.compile(rf"\b({'|'.join(name for _, name in constants)})\b")
    out += [function(name, given, owned.sub(r"m.\1", lines)) for name, given, lines in functions if name != "lf_log1p"]

    def read(kind: str) -> str:
        parts = (
            [read(field) for field, _ in fields[kind]]
            if kind in fields
            else ["from.one()"] * {"float": 1, "vec2": 2, "vec3": 3, "vec4": 4}[kind]
        )
        return parts[0] if kind == "float" else f"{kind}{{{', '.join(parts)}}}"

    out.append(f"auto material(auto from) {{ return Material{{{', '.join(read(kind) for kind, _ in constants)}}}; }}\n")
    return "\n".join(out)


def flat(tree: Any) -> np.ndarray:
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)]).astype(np.float32)


@dataclass(frozen=True)
class Pairs:
    """Pairs of directions (n, 3), and what a fit would compare their radiance with (3, n); float32."""

    wi: np.ndarray
    wo: np.ndarray
    weight: np.ndarray
    target: np.ndarray
    inverse_sigma: np.ndarray


class Peer:
    """The compiled C++ of a material."""

    def __init__(self, material: tuple[Any, Any], text: str, pairs: Pairs, folder: Path, flags: Sequence[str]) -> None:
        source, library = folder / "peer.cpp", folder / f"{'_'.join(flags)}.so"
        source.write_text(f'#include "{HERE / "cpp_peer.hpp"}"\n{text}{LOOPS}{PRODUCTS}')
        subprocess.run([*COMMAND, *flags, source, "-o", library], check=True)
        self.library = ctypes.CDLL(str(library))
        made, along = material
        self.primal = flat(made)
        directions = len(jax.tree.leaves(along)[0])
        self.numbers = np.concatenate(
            [self.primal, *(flat(jax.tree.map(lambda a, k=k: a[k], along)) for k in range(directions))]
        )
        self.columns = directions + 1
        self.n = pairs.weight.shape[1]
        self.directions = [np.ascontiguousarray(a.T) for a in (pairs.wi, pairs.wo)]
        self.rest = [pairs.weight, pairs.target, pairs.inverse_sigma]

    def call(self, name: str, out: np.ndarray, *arguments: Any) -> np.ndarray:
        given = [a.ctypes.data_as(ctypes.c_void_p) if isinstance(a, np.ndarray) else a for a in (*arguments, out, self.n)]
        getattr(self.library, name)(*given)
        return out

    def values(self) -> np.ndarray:
        return self.call("values", np.empty((3, self.n), np.float32), self.primal, *self.directions, self.rest[0]).T

    def products(self) -> np.ndarray:
        out = np.empty((3, self.columns, self.columns))
        return self.call("products", out, self.numbers, len(self.primal), *self.directions, *self.rest)


class Ours:
    """layerfit, as `render.predict` and a step of a fit call it."""

    def __init__(self, stack: Stack, pairs: Pairs) -> None:
        self.pairs, self.form = pairs, stack.form
        coat, base = stack.layers[0], stack.base
        depth = "absorption_per_mm" if coat.tau is None else "tau"
        fields = [(coat, "alpha"), (coat, "eta"), (coat, depth), (base, "alpha" if hasattr(base, "alpha") else "albedo")]
        names = [f"{layer.name}.{field}" for layer, field in fields]
        self.start, self.free = parametrise(stack, names, (), "start")
        cut = lambda a: np.stack(np.split(a, range(LARGEST, a.shape[-1], LARGEST), -1))  # noqa: E731 (pairs last)
        wi, wo = (np.moveaxis(cut(w.T), 1, -1) for w in (pairs.wi, pairs.wo))
        weight, target, inverse_sigma = (cut(a) for a in (pairs.weight, pairs.target, pairs.inverse_sigma))
        blocks = Blocks(wi[:, :, None], wo, weight[..., None], target, inverse_sigma, np.zeros(len(wi), np.int32))
        self.halves = [
            jax.device_put(jax.tree.map(operator.itemgetter(every), blocks)) for every in (slice(0, None, 2), slice(1, None, 2))
        ]
        with jax.enable_x64(True):
            u = self.free.pack(self.start).astype(np.float32)
            self.material = Compiled(residuals._material)(u, self.start.astype(np.float32), None, free=self.free)
            self.sums = Compiled(_sums)

    def values(self) -> np.ndarray:
        return predict(self.start, self.pairs.wi[:, None], self.pairs.wo, self.pairs.weight.T[:, None])

    def products(self) -> np.ndarray:
        with jax.enable_x64(True):
            return np.sum([self.sums(self.material, half, form=self.form) for half in self.halves], 0)


def _sums(material: Any, blocks: Blocks, *, form: Any) -> Any:
    return jnp.sum(lax.map(lambda block: products(residuals._columns(material, block, form=form)), blocks), 0)


def draw(stack: Stack, count: int) -> Pairs:
    """Pairs above grazing, half of them about the mirror, and what a fit with 1 % of noise would hold against them."""
    rng = np.random.default_rng(0)
    wi, wo = random_pairs(3 * count, 0)
    usable = rng.permutation(np.flatnonzero((wi[:, 2] > 0.1) & (wo[:, 2] > 0.1)))[:count]
    wi, wo = wi[usable], wo[usable]
    weight = np.repeat(np.pi * wi[None, :, 2], 3, 0)
    model = predict(stack, wi[:, None], wo, weight.T[:, None]).T
    target = model * (1.0 + 0.01 * rng.normal(size=model.shape))
    bright = np.quantile(target, 0.98, axis=1, keepdims=True)
    return Pairs(wi, wo, *(a.astype(np.float32) for a in (weight, target, 1.0 / np.hypot(0.05 * target, 0.02 * bright))))


def apart(name: str, ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest relative difference: of values over a floor, of products over those of the columns with themselves."""
    if name == "values":
        return float(np.max(np.abs(theirs - ours) / np.maximum(np.abs(ours), FLOOR / np.pi)))
    size = np.sqrt(np.einsum("ckk->ck", ours))
    return float(np.max(np.abs(theirs - ours) / (size[:, :, None] * size[:, None, :])))


def timed(peers: dict[str, Any], name: str, runs: int) -> dict[str, np.ndarray]:
    """Seconds by the clock and of all processors, a run each (runs, 2); the peers take turns."""
    taken: dict[str, list[Any]] = {key: [] for key in peers}
    for _ in range(runs):
        for key, peer in peers.items():
            start = time.perf_counter(), time.process_time()
            getattr(peer, name)()
            taken[key].append((time.perf_counter() - start[0], time.process_time() - start[1]))
    return {key: np.array(rows) for key, rows in taken.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=65536)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--flags", nargs="+", choices=FLAGS, default=list(FLAGS))
    parser.add_argument("--presets", nargs="+", default=["lacquered_copper", "varnished_wood"])
    arguments = parser.parse_args()
    table = Table("preset", "form", "what", "g++ -march=native", "apart", "time over C++'s", "of the processors")
    for preset in arguments.presets:
        for form in (Corrected(), Precise()):
            stack = replace(read_preset(preset), form=form)
            pairs = draw(stack, arguments.pairs)
            ours = Ours(stack, pairs)
            with tempfile.TemporaryDirectory() as folder:
                text, material = cpp(ours.start), tuple(part[0] for part in ours.material)
                peers = {key: Peer(material, text, pairs, Path(folder), FLAGS[key]) for key in arguments.flags}
            for name in ("values", "products"):
                wanted = getattr(ours, name)()
                error = {key: apart(name, wanted, getattr(peer, name)()) for key, peer in peers.items()}
                if max(error.values()) > 1e-5:
                    raise SystemExit(f"{preset}, {name}: C++ and layerfit are apart: {error}")
                taken = timed({"": ours, **peers}, name, arguments.runs)
                for key in peers:
                    ratio = np.median(taken[""] / taken[key], axis=0)
                    form_name = type(form).__name__.lower()
                    table.add_row(preset, form_name, name, key, f"{error[key]:.0e}", f"{ratio[0]:.2f}", f"{ratio[1]:.2f}")
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
