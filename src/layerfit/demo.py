"""The demonstration: every shipped reference fitted, its shader verified, its pictures written."""

from pathlib import Path
from typing import Any

from ._data import references
from .documents import check_directory
from .fit.words import measured
from .job import Outcome, Progress, fit_scene
from .report.text import image_error, relative


def run(directory: Path, console: Any, progress: Progress) -> bool:
    """Fit all shipped references into `directory`, a folder each; prints a line each and where the pictures are."""
    check_directory(directory)
    scenes = sorted(references().glob("*.toml"))
    outcomes: list[tuple[str, Outcome]] = []
    for k, scene in enumerate(scenes):
        console.print(f"[{k + 1}/{len(scenes)}] {scene.stem}", markup=False)
        outcome = fit_scene(scene, directory / scene.stem, progress=progress)
        outcomes.append((scene.stem, outcome))
        for line in _summary(outcome.document):
            console.print(f"      {line}", markup=False, soft_wrap=True)
    console.print("\nPictures and reports:", markup=False)
    for _, outcome in outcomes:
        console.print(
            f"  {outcome.directory / 'fit.png'}  (report.html, material.frag, preset.json beside it)",
            markup=False,
            soft_wrap=True,
        )
    return all(outcome.good for _, outcome in outcomes)


def _summary(document: dict[str, Any]) -> list[str]:
    rows = [f"{name} = {' +/- '.join(measured(row['value'], row['sigma']))}" for name, row in document["parameters"].items()]
    parity = document["parity"]
    return [
        ", ".join(rows),
        f"fit error {image_error(document['error'])}; shader against JAX {relative(parity['max_rel'])}, {document['time']['total_s']:.1f} s",
    ]
