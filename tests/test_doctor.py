"""The doctor: what it finds on this machine, and what it says where something is missing."""

import json
import shutil
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from commands import layerfit
from layerfit import doctor
from layerfit.errors import MachineError

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]


def found(name):
    return next(finding for finding in doctor.examine().findings if finding.name == name)


def test_a_machine_that_can_do_the_main_job(gl):
    ran = layerfit("doctor", "--json")
    document = json.loads(ran.out)
    assert (ran.code, document["good"]) == (0, True)
    rows = {(row["group"], row["name"]): row for row in document["findings"]}
    assert rows["python", "jax"]["found"] == metadata.version("jax")
    assert gl.info["GL_RENDERER"] in rows["opengl", "driver"]["found"]
    assert rows["opengl", "float32 target"]["there"]
    assert not rows["cache", "compilation"]["there"], "the tests run without"
    text = layerfit("doctor").out
    assert "Fitting, printing and verifying can be done here." in text


def test_every_extra_is_looked_for():
    """By the packages that the project says it brings."""
    extras = PROJECT["optional-dependencies"]
    assert set(doctor.EXTRAS) == set(extras), "say in doctor.EXTRAS what each extra gives"
    for extra, (packages, gives) in doctor.EXTRAS.items():
        assert len(packages) <= len(extras[extra])
        assert all(any(line.startswith(package) for line in extras[extra]) for package in packages)
        assert gives


def test_a_missing_extra_is_no_fault_and_says_what_it_would_give(gl, monkeypatch):
    monkeypatch.setattr(doctor, "find_spec", lambda package: None)
    ran = layerfit("doctor")
    assert ran.code == 0
    for extra, (_, gives) in doctor.EXTRAS.items():
        assert f"pip install 'layerfit[{extra}]'" in ran.out
        assert gives in ran.out


def test_without_a_driver_the_main_job_cannot_be_done(monkeypatch):
    def nothing():
        raise MachineError("no OpenGL 3.3 driver was found (egl: none). Advice.")

    monkeypatch.setattr("layerfit.shader.gl.renderer", nothing)
    ran = layerfit("doctor")
    assert ran.code == 1
    assert "MISSING: no OpenGL 3.3 driver was found" in ran.out
    assert "apt-get install -y --no-install-recommends libegl1 libgl1-mesa-dri" in ran.out
    assert "can NOT be done here" in ran.out
    assert "Next:" not in ran.err, "the command that gets it stands in its lines"


def test_a_driver_that_rounds_is_found_out(gl, monkeypatch):
    monkeypatch.setattr("layerfit.shader.gl.shade_points", lambda text, sent: sent["v_sent"] * np.float32(1.001))
    assert not found("float32 target").there


def test_a_package_that_is_missing_is_told(monkeypatch):
    version = metadata.version

    def without(name):
        if name == "optimistix":
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(doctor.metadata, "version", without)
    missing = found("optimistix")
    assert (missing.there, missing.needed) == (False, True)
    assert missing.fix.startswith("pip install 'optimistix")


def test_a_source_that_is_not_installed_is_no_fault(monkeypatch):
    def nothing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(doctor.metadata, "requires", nothing)
    assert [(finding.name, finding.needed) for finding in doctor._packages()] == [("layerfit", False)]


def test_the_cache_is_found_and_its_size(tmp_path, monkeypatch):
    monkeypatch.delenv("LAYERFIT_NO_CACHE", raising=False)
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "cache" / "traced").mkdir(parents=True)
    (tmp_path / "cache" / "traced" / "a").write_bytes(bytes(3_000_000))
    assert doctor._cache().found == f"{tmp_path / 'cache'}, 3 MB in 1 files"
    shutil.rmtree(tmp_path / "cache")
    (tmp_path / "cache").write_text("a file in its place")
    blocked = doctor._cache()
    assert "$HOME/" in blocked.fix
    assert not blocked.there
    assert "is a file, not a directory" in blocked.found


@pytest.mark.parametrize("there", [True, False])
def test_a_browser_is_looked_for(monkeypatch, there):
    def get():
        if not there:
            raise doctor.webbrowser.Error("none")
        return type("Browser", (), {"name": "firefox"})()

    monkeypatch.setattr(doctor.webbrowser, "get", get)
    assert doctor._browser().there is there


def test_a_browser_that_is_no_program_is_missing(monkeypatch):
    monkeypatch.setattr(doctor.webbrowser, "get", lambda: doctor.webbrowser.GenericBrowser("nosuch"))
    found = doctor._browser()
    assert not found.there
    assert (found.found, found.fix) == ("there is no program nosuch", "unset BROWSER")


@pytest.mark.parametrize(("name", "there"), [("", False), (":7", True)])
def test_a_display_is_looked_for(monkeypatch, name, there):
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", name)
    assert doctor._display().there is there
