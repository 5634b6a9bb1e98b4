"""The demonstration: every shipped reference fitted, its shader verified, its pictures written."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ._data import references
from .documents import check_directory
from .fit.words import measured
from .job import Outcome, Progress, fit_scene
from .report.text import image_error, relative


def run(directory: Path, say: Callable[[str], None], progress: Progress) -> dict[str, Outcome]:
    """Fit all shipped references into `directory`, a folder each; says a line of each, and where the pictures are."""
    check_directory(directory)
    scenes = sorted(references().glob("*.toml"))
    outcomes: dict[str, Outcome] = {}
    for k, scene in enumerate(scenes):
        say(f"[{k + 1}/{len(scenes)}] {scene.stem}")
        outcomes[scene.stem] = outcome = fit_scene(scene, directory / scene.stem, progress=progress)
        for line in _summary(outcome.document):
            say(f"      {line}")
    say("\nPictures and reports:")
    for outcome in outcomes.values():
        beside = ", ".join(name for name in ("report.html", "material.frag", "preset.json") if name in outcome.written)
        say(f"  {outcome.directory / 'fit.png'}  ({beside} beside it)")
    return outcomes


def _summary(document: dict[str, Any]) -> list[str]:
    rows = [f"{name} = {' +/- '.join(measured(row['value'], row['sigma']))}" for name, row in document["parameters"].items()]
    parity = document["parity"]
    return [
        ", ".join(rows),
        f"fit error {image_error(document['error'])}; shader against JAX {relative(parity['max_rel'])}, {document['time']['total_s']:.1f} s",
    ]
