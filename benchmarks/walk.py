"""Paths a second of the random walk, against the same walk in one thread, turn by turn in one process.

    python benchmarks/walk.py

One coat over a conductor and over Lambert, one direction of view. Ratios are medians over rounds in which both sides run; absolute
numbers hold for the machine they were taken on.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any
from unittest import mock

from layerfit.layers import Coat
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Lambert
from layerfit.walk import walk

PATHS = 2_000_000
ROUNDS = 5
WI, WO = (0.5, 0.0, 0.8660254), [(-0.3420201, 0.0, 0.9396926)]
CASES = {
    "conductor": Stack((Coat(alpha=0.2, eta=1.5, tau=0.2),), Conductor(alpha=0.2)),
    "conductor, three colours": Stack((Coat(alpha=0.2, eta=1.5, tau=[0.1, 0.2, 0.4]),), Conductor(alpha=0.2)),
    "copper": Stack(
        (Coat(alpha=0.2, eta=1.5, tau=[0.1, 0.2, 0.4]),), Conductor(alpha=0.2, eta=[0.2, 0.9, 1.1], k=[3.9, 2.5, 2.1])
    ),
    "white Lambert": Stack((Coat(alpha=0.2, eta=1.5),), Lambert(albedo=1.0)),
    "three layers": Stack((Coat(alpha=0.2, eta=1.5, tau=0.2), Coat(name="primer", alpha=0.3, eta=1.8)), Conductor(alpha=0.2)),
}


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    print(f"{'case':26} {'interface':10} {'M paths/s':>10} {'x one thread':>13}")
    for name, stack in CASES.items():
        for interface in ("single", "multi"):
            run = lambda seed, s=stack, i=interface: walk(s, WI, WO, paths=PATHS, seed=seed, interface=i)  # noqa: E731
            run(0)  # compiles
            times, ratios = [], []
            for seed in range(ROUNDS):
                times.append(seconds(lambda: run(seed)))  # noqa: B023
                with mock.patch("os.cpu_count", return_value=1):
                    ratios.append(seconds(lambda: run(seed)) / times[-1])  # noqa: B023
            print(f"{name:26} {interface:10} {PATHS / statistics.median(times) / 1e6:10.2f} {statistics.median(ratios):13.2f}")


if __name__ == "__main__":
    main()
