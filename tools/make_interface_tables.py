"""Make src/layerfit/forms/interface_tables.npz: what one rough interface does to light, from the random walk.

    python tools/make_interface_tables.py

Takes about fifteen minutes on two cores. `layerfit.forms.tables` says what each table holds; here is how it is made. Every node sees the
same evenly spread samples, so that what noise is left varies smoothly from node to node.
"""

import hashlib
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from layerfit.layers import Coat
from layerfit.optics.interface import facet_cosine, facet_tilt, rough_transmittance, second_facet
from layerfit.walk import Interface, scatter

OUTPUT = Path(__file__).parents[1] / "src" / "layerfit" / "forms" / "interface_tables.npz"
VERSION = 2
SEED = 0
COUNT, COUNT_BELOW = 1 << 19, 1 << 18
"""Samples of a node, from above and from below; of `multi` below index 1.15 a quarter of them: there, light that meets many facets hardly turns."""

ETA = (1.003, 1.01, 1.03, 1.07, 1.15, 1.22, 1.3, 1.45, 1.6, 1.8, 2.0, 2.25)
ALPHA = (0.02, 0.035, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
DEGREES = (88.5, 87.278, 86.0, 84.549, 83.0, 81.547, 80.0, 77.0, 73.0, 68.0, 63.0, 57.0, 50.0, 40.0, 30.0, 15.0, 0.0)
# Cosines from below are laid out about the edge of total reflection, which at small widths is a step: parts of the way from it.
FROM_EDGE = (0.0, 0.01, 0.025, 0.05, 0.085, 0.13, 0.19, 0.27, 0.37, 0.5, 0.65, 0.82, 1.0)
LOWEST = 0.985  # part of the way to grazing: no light arrives there

TAUS = (0.25, 2.0)
"""Optical depths at which the spread of paths is matched."""
THETA = np.geomspace(1e-3, 50.0, 4000)


def cosines() -> np.ndarray:
    return np.cos(np.radians(DEGREES))


def cosines_below(eta: float) -> np.ndarray:
    """Ascending, the edge of total reflection in their middle."""
    edge = np.sqrt(1.0 - 1.0 / eta**2)
    part = np.array(FROM_EDGE)
    return np.concatenate([edge * (1.0 - LOWEST * part[:0:-1]), edge + (1.0 - edge) * part])


def quantiles(x: np.ndarray, weight: np.ndarray, parts: tuple[float, ...]) -> np.ndarray:
    order = np.argsort(x)
    sums = np.cumsum(weight[order])
    return np.interp(np.array(parts) * sums[-1], sums - 0.5 * weight[order], x[order])


def fitted_transmittance(eta: float, alpha: float, mu: float) -> float:
    """The closed form that `dT` is added to."""
    w = jnp.array([np.sqrt(1.0 - mu * mu), 0.0, mu])
    a, n = jnp.asarray(alpha), jnp.asarray(eta)
    return float(rough_transmittance(facet_cosine(w, facet_tilt(a)), n, second_facet(a)))


def from_above(
    interface: Interface, eta: float, alpha: float, mu: float, count: int = COUNT, seed: int = SEED
) -> dict[str, float]:
    """One node of dT, rx, w, kt and lt; rx is meaningless at mu = 1."""
    sine = np.sqrt(1.0 - mu * mu)
    light = scatter(Coat(alpha=alpha, eta=eta), (sine, 0.0, mu), count=count, seed=seed, interface=interface)
    passed = light.through & (light.energy > 0.0)
    down, energy = -light.d[passed].astype(float), light.energy[passed].astype(float)
    x, y = (quantiles(down[:, k], energy, (0.25, 0.5, 0.75)) for k in (0, 1))
    spread = np.sqrt(3.0) / 2.0 / alpha  # quartiles of a projected GGX lobe lie alpha / sqrt(3) from its middle
    theta, kt = path_spread([float(np.average(np.exp(-tau / down[:, 2]), weights=energy)) for tau in TAUS])
    return {
        "dT": energy.sum() / count - fitted_transmittance(eta, alpha, mu),
        "rx": x[1] / (sine / eta) if sine > 0.0 else np.nan,
        "w": spread * np.sqrt((x[2] - x[0]) * (y[2] - y[0])),
        "kt": kt,
        "lt": np.log(theta),
    }


def path_spread(transmitted: list[float]) -> tuple[float, float]:
    """theta and k theta of u - 1 ~ Gamma(k, theta) with the given means of exp(-tau u) at TAUS."""
    thin, thick = (-np.log(t) - tau for t, tau in zip(transmitted, TAUS, strict=True))  # k log(1 + theta tau)
    ratio = np.log1p(TAUS[0] * THETA) / np.log1p(TAUS[1] * THETA)  # rises from 1/8
    theta = float(np.interp(thin / thick, ratio, THETA)) if thick > 1e-9 else THETA[0]
    return theta, thick * theta / np.log1p(TAUS[1] * theta)


def from_below(interface: Interface, eta: float, alpha: float, mu: float, count: int = COUNT_BELOW, seed: int = SEED) -> float:
    """One node of Rb."""
    wi = (np.sqrt(1.0 - mu * mu), 0.0, mu)
    light = scatter(Coat(alpha=alpha, eta=eta), wi, count=count, seed=seed, interface=interface, below=True)
    return float(light.energy[~light.through].sum(dtype=float)) / count


def tables(interface: Interface, pool: ThreadPoolExecutor) -> dict[str, np.ndarray]:
    """All tables of one model of the interface."""
    shape = len(ETA), len(ALPHA)
    mu = cosines()
    of = lambda count, eta: count // 4 if interface == "multi" and eta < 1.15 else count  # noqa: E731
    above = list(
        pool.map(
            lambda node: from_above(interface, *node, count=of(COUNT, node[0])),
            [(n, a, m) for n in ETA for a in ALPHA for m in mu],
        )
    )
    made: dict[str, np.ndarray] = {name: np.array([node[name] for node in above]).reshape(*shape, -1) for name in above[0]}
    # The limit at the normal, where the median is 0 / 0: nothing bends there, the function of mu is straight.
    made["rx"][..., -1] = made["rx"][..., -2] + (made["rx"][..., -2] - made["rx"][..., -3]) * (mu[-1] - mu[-2]) / (
        mu[-2] - mu[-3]
    )
    nodes = [(n, a, m) for n in ETA for a in ALPHA for m in cosines_below(n)]
    below = list(pool.map(lambda node: from_below(interface, *node, count=of(COUNT_BELOW, node[0])), nodes))
    made["Rb"] = np.array(below).reshape(*shape, -1)
    return made


def main() -> None:
    arrays: dict[str, Any] = {"eta": ETA, "alpha": ALPHA, "mu": cosines(), "mu_below": [cosines_below(n) for n in ETA]}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for interface in ("single", "multi"):
            for name, table in tables(interface, pool).items():
                arrays[f"{interface}_{name}"] = table
    script = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    facts = {"version": VERSION, "script_sha256": script, "seed": SEED, "count": COUNT, "count_below": COUNT_BELOW}
    single = {name: np.asarray(x, np.float32) for name, x in arrays.items()}
    np.savez_compressed(OUTPUT, **single, **{name: np.array(x) for name, x in facts.items()})


if __name__ == "__main__":
    main()
