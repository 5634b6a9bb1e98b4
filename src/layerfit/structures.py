"""`layerfit structures`: which structure a reference supports, and its fit."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .capture.load import load
from .capture.measured.read import is_measured
from .capture.scene import FitRequest, MeasuredReference, Scene
from .capture.scene_file import check_request, read_scene
from .documents import check_directory, write_files
from .fit.nuisances import of_the_scene
from .fit.structures import choose_structure
from .forms.corrected import Corrected
from .job import Outcome, Progress, fit_scene
from .report import structures as report
from .stack import Stack
from .surfaces import Lambert

ANY = Stack((), Lambert(), Corrected())
"""In place of a material that a scene does not say: the search begins elsewhere."""

SEARCH = 0.8
"""Part of the work that is the search."""


@dataclasses.dataclass(frozen=True)
class StructuresOutcome:
    """What a search for a structure leaves behind."""

    document: dict[str, Any]
    """The content of `structures.json`."""
    fit: Outcome
    """That of the structure that was chosen, on all pixels."""

    @property
    def good(self) -> bool:
        """Fitted, verified, and it explains the reference."""
        return self.fit.good and "poor_fit" not in self.fit.document["flags"]


def structures_of(
    path: str | Path,
    directory: str | Path,
    *,
    structures: Sequence[str] | None = None,
    metric: str = "log",
    seed: int = 0,
    min_half_deg: float = 0.0,
    progress: Progress = lambda stage, share: None,
) -> StructuresOutcome:
    """Choose the structure that a scene or a measured BRDF supports, fit it, and write all to `directory`.

    Of a scene's `free`, `also` and `each`, what is of its lights is fitted beside each structure; the rest, and `fixed`, are of its own material
    and are not used. `min_half_deg` is for a measured BRDF that is named itself. Raises `LayerfitError` for input or a machine that is at fault.
    """
    path, directory = Path(path), Path(directory)
    check_request({"metric": metric, "seed": seed}, f"{path}: fit")
    scene = _scene(path, min_half_deg)
    check_directory(directory)
    searching = lambda stage, share: progress(stage, SEARCH * share)  # noqa: E731
    views = load(scene)
    lights = of_the_scene(ANY, views)
    asked = scene.fit
    also = tuple(name for name in (*(asked.free or ()), *asked.also) if name in lights)
    each = tuple(name for name in asked.each if name in lights)
    choice = choose_structure(views, structures=structures, also=also, each=each, metric=metric, seed=seed, progress=searching)
    found = choice.chosen
    request = dataclasses.replace(asked, free=found.candidate.free, also=also, each=each, fixed={}, metric=metric, seed=seed)
    outcome = fit_scene(dataclasses.replace(scene, start=found.result.stack, fit=request), directory, progress=progress)
    document = report.document(choice)
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    write_files(directory, {"structures.png": report.pareto(choice), "structures.json": text})
    return StructuresOutcome(document, outcome)


def _scene(path: Path, min_half_deg: float) -> Scene:
    """A scene file, or one that a measured BRDF makes by itself."""
    if not is_measured(path):
        return read_scene(path, ANY)
    return Scene(path, (MeasuredReference(path, "D65", min_half_deg, {}),), ANY, FitRequest())
