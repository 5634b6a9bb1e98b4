"""Tables of one interface: where they come from, and that the walk gives them again."""

import hashlib
import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from layerfit.forms.tables import InterfaceTables, load, origin

SCRIPT = Path(__file__).parents[1] / "tools" / "make_interface_tables.py"
FROM_ABOVE = ("dT", "rx", "w", "kt", "lt")
NOISE = {"dT": 1.5e-3, "rx": 4e-3, "w": 6e-3, "kt": 6e-3, "lt": 0.05, "Rb": 3e-3}
"""What a node made of an eighth of the samples may differ by: absolute for energies and lt, else of the value."""
# Root mean squares, of which some 0.2 % are theirs. Not lt: where paths hardly spread, theta is next to nothing and so is its effect.
ORACLE_NOISE = {"dT": 2e-3, "rx": 4e-3, "w": 6e-3, "kt": 6e-3, "Rb": 3e-3}


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_interface_tables", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def interpolated(tables: InterfaceTables, name: str, eta: float, alpha: float, mu: float) -> float:
    """Cubic in eta, ln alpha and mu, one after another."""
    over_eta = CubicSpline(tables.eta, getattr(tables, name))(eta)
    over_alpha = CubicSpline(np.log(tables.alpha), over_eta)(np.log(alpha))
    nodes = tables.mu if name in FROM_ABOVE else CubicSpline(tables.eta, tables.mu_below)(eta)
    return float(CubicSpline(nodes, over_alpha)(mu))


def error(name: str, value: Any, wanted: Any) -> Any:
    """Absolute for energies and logarithms, relative for what may be large."""
    scale = 1.0 if name in ("dT", "lt", "Rb") else np.maximum(np.abs(wanted), 1.0 if name == "rx" else 0.2)
    return np.abs(np.asarray(value) - wanted) / scale


def test_file_is_made_by_this_script(script: ModuleType) -> None:
    made = origin()
    assert made.script_sha256 == hashlib.sha256(SCRIPT.read_bytes()).hexdigest()
    assert (made.version, made.seed, made.count, made.count_below) == (
        script.VERSION,
        script.SEED,
        script.COUNT,
        script.COUNT_BELOW,
    )


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_tables_are_whole(interface: Any) -> None:
    tables = load(interface)
    shape = len(tables.eta), len(tables.alpha)
    for name in FROM_ABOVE:
        table = getattr(tables, name)
        assert table.shape == (*shape, len(tables.mu))
        assert np.all(np.isfinite(table))
    assert tables.Rb.shape == (*shape, tables.mu_below.shape[1])
    assert np.all((tables.Rb >= 0.0) & (tables.Rb <= 1.0))
    for nodes in (tables.eta, tables.alpha, tables.mu, *tables.mu_below):
        assert np.all(np.diff(nodes) > 0.0)
    assert tables.mu_below[:, tables.mu_below.shape[1] // 2] == pytest.approx(np.sqrt(1.0 - 1.0 / tables.eta**2), rel=1e-5)
    with pytest.raises(ValueError, match="read-only"):
        tables.dT[0, 0, 0] = 0.0


def test_no_energy_is_lost_in_multi(script: ModuleType) -> None:
    """What a white bath below sends out through a rough interface is what one above sends in, over eta^2."""
    tables = load("multi")
    x, weight = np.polynomial.legendre.leggauss(48)
    mu, weight = 0.5 * (x + 1.0), 0.5 * weight
    for e, a in ((0, 2), (3, 0), (3, 8), (5, 12), (7, 5)):
        eta, alpha, edge = (
            float(tables.eta[e]),
            float(tables.alpha[a]),
            float(tables.mu_below[e, tables.mu_below.shape[1] // 2]),
        )
        fit = np.array([script.fitted_transmittance(eta, alpha, m) for m in mu])
        entering = np.sum(2.0 * weight * mu * (fit + CubicSpline(tables.mu, tables.dT[e, a])(mu)))
        inner, part = (
            np.concatenate([edge * mu, edge + (1.0 - edge) * mu]),
            np.concatenate([edge * weight, (1.0 - edge) * weight]),
        )
        leaving = np.sum(2.0 * part * inner * (1.0 - CubicSpline(tables.mu_below[e], tables.Rb[e, a])(inner)))
        assert leaving == pytest.approx(entering / eta**2, abs=1e-3)


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_nodes_are_what_the_walk_gives(script: ModuleType, interface: Any) -> None:
    tables = load(interface)
    for e, a, m in ((0, 3, 2), (3, 7, 6), (5, 10, 12), (7, 12, 9)):
        node = (float(tables.eta[e]), float(tables.alpha[a]), float(tables.mu[m]))
        again = script.from_above(interface, *node, count=script.COUNT // 8, seed=7)
        for name in FROM_ABOVE:
            assert error(name, getattr(tables, name)[e, a, m], again[name]) < NOISE[name], (name, node)
        below = float(tables.mu_below[e, 2 * m])
        again_below = script.from_below(interface, *node[:2], below, count=script.COUNT_BELOW // 8, seed=7)
        assert error("Rb", tables.Rb[e, a, 2 * m], again_below) < NOISE["Rb"], (node, below)


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_between_nodes(script: ModuleType, interface: Any) -> None:
    """Cubic interpolation is worth a few thousandths."""
    tables = load(interface)
    for node in ((1.37, 0.06, 0.2), (1.52, 0.25, 0.5), (1.7, 0.7, 0.08), (2.1, 0.13, 0.9)):
        direct = script.from_above(interface, *node, count=script.COUNT // 8)
        # Rough facets send grazing light two ways in `multi`, and its median swings between them.
        tolerance = NOISE | {"rx": 0.015 if interface == "multi" and node[1] > 0.5 and node[2] < 0.1 else NOISE["rx"]}
        for name in ("dT", "rx", "w", "kt"):
            assert error(name, interpolated(tables, name, *node), direct[name]) < tolerance[name] + 3e-3, (name, node)
        for mu in (0.3, 0.6, 0.95):
            direct_below = script.from_below(interface, *node[:2], mu, count=script.COUNT_BELOW // 8)
            assert error("Rb", interpolated(tables, "Rb", *node[:2], mu), direct_below) < NOISE["Rb"] + 3e-3, (node, mu)


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_another_program_agrees(oracle: Path, interface: Any) -> None:
    """Tables of an independent walk, at the nodes that both have; its noise is about 0.2 %."""
    theirs, ours = json.loads((oracle / "interface_tables.json").read_text())[interface], load(interface)
    at = [[int(np.argmin(np.abs(mine - x))) for x in theirs[axis]] for axis, mine in vars_of(ours).items()]
    for name in ("dT", "rx", "w", "kt"):
        # Not at the normal: the other program repeats its last ratio there.
        wanted = np.array(theirs[name])[..., :-1]
        off = error(name, getattr(ours, name)[np.ix_(*at)][..., :-1], wanted)
        assert np.sqrt(np.mean(off**2)) < ORACLE_NOISE[name], name
    wanted = np.array(theirs["Rb"])[..., 4:]  # above 0.16: below, their nodes are further apart than what there is to see
    nodes = [(e, a) for e in at[0] for a in at[1]]
    rows = [CubicSpline(ours.mu_below[e], ours.Rb[e, a])(theirs["mu_below"][4:]) for e, a in nodes]
    assert np.sqrt(np.mean((np.array(rows) - wanted.reshape(len(nodes), -1)) ** 2)) < ORACLE_NOISE["Rb"]


def vars_of(tables: InterfaceTables) -> dict[str, np.ndarray]:
    """The axes that two programs may share."""
    return {"eta": tables.eta, "alpha": tables.alpha, "mu": tables.mu}
