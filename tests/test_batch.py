"""Many fits: every scene has its row, what failed says why, and what is interrupted goes on."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from commands import layerfit
from layerfit import InputError, fit_batch
from layerfit.batch.sharing import fitted
from layerfit.batch.table import JOURNAL
from layerfit.batch.tasks import Task

REFERENCES = Path(__file__).parents[1] / "examples" / "references"
QUICK = {"quick": True, "metric": "law"}


@pytest.fixture
def scenes(tmp_path):
    """Three scenes of one small render, and one whose render is not there."""
    shutil.copy(REFERENCES / "brushed_steel.exr", tmp_path)
    text = (REFERENCES / "brushed_steel.toml").read_text()
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.toml").write_text(text)
    (tmp_path / "d.toml").write_text(text.replace("brushed_steel.exr", "lost.exr"))
    return tmp_path


def table(directory):
    with (directory / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_scene_has_its_row(scenes, tmp_path):
    """Values are those of `layerfit fit`; a failure is a row with its message, and tried again; what is done is not."""
    manifest = tmp_path / "captures.csv"
    manifest.write_text("scene,batch of steel\na.toml,7\nd.toml,8\n")
    told = []
    first = fit_batch([manifest], tmp_path / "out", progress=lambda *counts: told.append(counts), **QUICK)
    assert not first.good
    assert told == [(0, 0, 2), (0, 1, 2), (1, 1, 2)], "what cannot be read is known before what is fitted"
    done, failed = table(tmp_path / "out")
    assert (done["batch of steel"], failed["batch of steel"]) == ("7", "8")
    assert float(done["base.alpha_x"]) == pytest.approx(0.08, rel=1e-4)
    assert 0.0 < float(done["base.k.g.sigma"]) < 2e-4
    assert done["error"] == ""
    assert "lost.exr" in failed["error"]
    assert first.document == json.loads((tmp_path / "out" / "batch.json").read_text())

    shutil.copy(scenes / "brushed_steel.exr", scenes / "lost.exr")
    with (tmp_path / "out" / JOURNAL).open("a") as journal:
        journal.write('{"key": "cut o')
    second = fit_batch([manifest], tmp_path / "out", **QUICK)
    assert (second.document["kept"], second.document["done"], second.document["failed"]) == (1, 2, 0)
    again, mended = table(tmp_path / "out")
    assert again == done
    assert float(mended["base.alpha_x"]) == pytest.approx(0.08, rel=1e-4)
    third = fit_batch([manifest], tmp_path / "out", **QUICK)
    assert third.document["kept"] == 2, "a line after one that was cut off is lost"


def test_a_scene_that_fails_is_named(scenes, tmp_path):
    ran = layerfit("batch", scenes / "d.toml", "-o", tmp_path / "out")
    assert ran.code == 1
    assert ran.err.startswith(f"failed: {scenes / 'd.toml'}: ")
    assert "lost.exr: cannot be read" in ran.err


def test_a_batch_that_is_killed_goes_on(scenes, tmp_path):
    """Killed outright after its first fit, a worker killed in the next run: in the end every row is there, and no fit was repeated."""
    command = [sys.executable, "-m", "layerfit", "batch", str(scenes / "[abc].toml"), "-o", "out", "--quick", "--json"]
    journal = tmp_path / "out" / JOURNAL

    def lines(least, run):
        while not journal.exists() or journal.read_text().count("\n") < least:
            assert run.poll() is None
            time.sleep(0.01)

    run = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    lines(1, run)
    run.kill()
    run.wait()
    before = journal.read_text().splitlines()

    run = subprocess.Popen([*command, "--workers", "1"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    out, _ = run.communicate(timeout=120)
    assert run.returncode == 0
    assert json.loads(out)["kept"] == len(before) >= 1
    assert journal.read_text().splitlines()[: len(before)] == before
    assert [Path(row["scene"]).stem for row in table(tmp_path / "out")] == ["a", "b", "c"]


def test_a_scene_whose_worker_is_killed_is_tried_again(scenes, tmp_path):
    command = [sys.executable, "-m", "layerfit", "batch", str(scenes / "[abc].toml"), "-o", "out", "--quick", "--workers", "2"]
    run = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    worker = None
    while worker is None:
        assert run.poll() is None
        found = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
        worker = next((int(pid) for pid in found if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()), None)
        time.sleep(0.01)
    os.kill(worker, signal.SIGKILL)
    assert run.wait(timeout=120) == 0
    assert [row["error"] for row in table(tmp_path / "out")] == ["", "", ""]


class Deadly(Task):
    """A scene that kills whatever worker takes it."""

    def __reduce__(self):
        return os._exit, (9,)


def test_a_scene_that_kills_its_workers_takes_no_other_along(tmp_path):
    tasks = {name: Task(tmp_path / f"{name}.toml", {}, None, {}) for name in "abcdef"}
    tasks["b"] = Deadly(tmp_path / "b.toml", {}, None, {})
    rows = dict(row for some in fitted(tasks, 2) for row in some)
    assert set(rows) == set(tasks)
    assert "killed twice" in rows["b"]["error"]
    assert all("cannot be read" in rows[name]["error"] for name in "acdef")


def test_a_quick_fit_with_all_that_it_leaves(gl, scenes, tmp_path):
    """The same row, beside a directory; sigmas are of the noise alone, and there is one start."""
    alone = fit_batch([scenes / "a.toml"], tmp_path / "rows", **QUICK).rows[0]
    each = fit_batch([scenes / "a.toml"], tmp_path / "each", each=True, **QUICK).rows[0]
    document = json.loads((Path(each["directory"]) / "fit.json").read_text())
    assert document["starts"] == 1
    assert not any("sigma_model" in row for row in document["parameters"].values())
    values = [key for key in alone if key.startswith("base.") and not key.endswith(".sigma")]
    assert [each[key] for key in values] == pytest.approx([alone[key] for key in values], rel=1e-6)


def test_the_table_as_parquet(scenes, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pip install 'layerfit[table]'")
    done = fit_batch([scenes / "a.toml"], tmp_path / "out", **QUICK)
    found = parquet.read_table(done.document["table"]).to_pylist()
    assert found[0]["base.alpha_x"] == pytest.approx(0.08, rel=1e-4)
    assert found[0]["converged"] is True


@pytest.mark.parametrize(
    ("content", "message"),
    [("file\na.toml\n", "one of them `scene`"), ("scene,size\na.toml\n", "line 2 should have 2 columns")],
)
def test_a_manifest_that_is_none(tmp_path, content, message):
    path = tmp_path / "captures.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        fit_batch([path], tmp_path / "out")


def test_a_pattern_that_matches_nothing(tmp_path):
    with pytest.raises(InputError, match=r"there is no such scene"):
        fit_batch([tmp_path / "*.toml"], tmp_path / "out")
    assert not (tmp_path / "out").exists()
