"""Batches on a cluster: rows of all scenes, whatever becomes of a worker."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from layerfit import InputError, fit_batch

pytest.importorskip("distributed", reason="pip install 'layerfit[cluster]'")

EXAMPLE = Path(__file__).parents[1] / "examples" / "lost_worker.py"


@pytest.mark.slow
def test_a_worker_of_a_cluster_may_be_killed(tmp_path):
    """The example: two workers, one killed while it has work, and every fit done. Its values are those of one process."""
    ran = subprocess.run(
        [sys.executable, str(EXAMPLE), "6", str(tmp_path / "out")], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "killed worker" in ran.stdout
    with (tmp_path / "out" / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len({row["scene"] for row in rows}) == 6
    assert [float(row["base.alpha_x"]) for row in rows] == pytest.approx([0.08] * 6, rel=1e-4)


def test_a_scheduler_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr("layerfit.batch.cluster.CONNECT_S", 0.2)
    (tmp_path / "a.toml").write_text("")
    with pytest.raises(InputError, match="no scheduler of dask answers there"):
        fit_batch([tmp_path], tmp_path / "out", scheduler="tcp://127.0.0.1:9", quick=True)
