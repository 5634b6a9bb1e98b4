"""How near the closed forms are to the random walk, for one material: what a fit's sigmas do not hold.

Light from below the coats alone is compared: the lobe of the top interface is the same formula in all of them, and would hide the rest.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .documents import check_directory, finite, nearest, write_files
from .errors import InputError
from .fit.words import structure
from .preset import MODELS, model_name
from .render import brdf
from .report import truth as report
from .report.told import Told
from .stack import FORMS, Stack
from .walk import Estimate, hazes, interface_of, refuses, top_lobe, walk

INCIDENCE_DEG = (0.0, 20.0, 40.0, 60.0, 75.0)
PLANE_DEG = (20.0, 60.0, 75.0)
"""Incidence of the curves in the plane of incidence."""

AZIMUTH_DEG = 45.0
"""Of the light to the tangent: both widths of an anisotropic surface matter there. An isotropic one has no azimuth."""

LOWEST_DEG = 85.0
"""Views nearer to the horizon are left out: they carry no light worth the paths."""

PILOT = 1000
"""Paths that show how noisy a material is."""
NOISE = 0.0045
"""What the paths are chosen for: an error of 1 % is then seen as one."""
MOST = 20_000
"""Paths for one pair of directions at most, unless more are asked for: some ten seconds on two cores."""
PLANE_SHARE = 4
"""Curves take this part of the paths, the pilot's at least: they are looked at, not measured."""

DARK = 1e-5
"""A channel with less light than this part of a white diffuse surface's is black; nobody sees its relative error."""

Progress = Callable[[str, float], None]


@dataclasses.dataclass(frozen=True)
class Fan:
    """One direction of light and those that it is seen from."""

    incidence_deg: float
    wi: np.ndarray
    wo: np.ndarray
    outgoing_deg: np.ndarray
    """Angle to the normal, positive on the side of the mirror direction."""


def compare(
    stack: Stack,
    name: str,
    *,
    interface: str | None = None,
    paths: int | None = None,
    seed: int = 0,
    progress: Progress = lambda stage, share: None,
) -> dict[str, Any]:
    """Every form for this structure against the walk: the content of `truth.json`; `name` is of the material.

    `interface` is what the walk's interfaces do, by default as in the preset; `paths` for every pair of directions, by default as
    many as the noise asks for. The same numbers for the same seed. Raises `InputError` for a material that has no walk.
    """
    if interface is None:
        interface = interface_of(stack)
    check(stack, name, interface)
    forms = forms_of(stack, interface)
    hemispheres, planes = [hemisphere(a) for a in INCIDENCE_DEG], [_plane(a) for a in PLANE_DEG]
    fans = [*hemispheres, *planes]
    counts = path_counts(stack, hemispheres, interface, paths, seed, progress)
    counts += [max(counts[INCIDENCE_DEG.index(a)] // PLANE_SHARE, PILOT) for a in PLANE_DEG]
    work = np.cumsum([0, *(count * len(fan.wo) for count, fan in zip(counts, fans, strict=True))])
    walks = []
    for k, (fan, count) in enumerate(zip(fans, counts, strict=True)):
        progress("walk", work[k] / work[-1])
        walks.append(walked(stack, fan, count, interface, seed))
    values = {}
    for key, form in forms.items():
        progress(key, 1.0)
        values[key] = below(dataclasses.replace(stack, form=form), fans)
    measured = len(hemispheres)
    truths = [(fan, truth) for fan, truth in zip(hemispheres, walks, strict=False)]
    errors = {key: [relative_error(f, t, fan) for f, (fan, t) in zip(fs, truths, strict=False)] for key, fs in values.items()}
    if np.all(np.isnan([error for rows in errors.values() for error in rows])):
        raise InputError(f"{name}: no light comes back from below the coat: there is nothing to compare")
    document = {
        "schema": "layerfit/truth",
        "version": 1,
        "name": name,
        "material": structure(stack),
        "model": model_name(stack),
        "interface": interface,
        "seed": seed,
        "incidence_deg": list(INCIDENCE_DEG),
        "paths": counts[:measured],
        "noise_rel": [mean_of(noise(truth, fan)) for fan, truth in truths],
        "forms": {key: _summary(rows) for key, rows in errors.items()},
        "planes": [
            {
                "incidence_deg": fan.incidence_deg,
                "outgoing_deg": fan.outgoing_deg.tolist(),
                "walk": truth.mean.tolist(),
                "walk_se": truth.se.tolist(),
                "forms": {key: fs[measured + k].tolist() for key, fs in values.items()},
            }
            for k, (fan, truth) in enumerate(zip(planes, walks[measured:], strict=True))
        ],
    }
    document["in_a_sentence"] = report.sentence(document)
    document["trusted"] = document["forms"][document["model"]]["median"] <= report.TRUST
    return finite(document)


def write_truth(document: dict[str, Any], directory: Path) -> None:
    """Leave `truth.png` and `truth.json` in a directory, both or none."""
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    write_files(directory, {"truth.png": report.curves(document), "truth.json": text})


def truth_of_preset(stack: Stack, name: str, directory: Path, **options: Any) -> Told:
    """Compare, and write the results; a directory that cannot be written to is told before the work."""
    check_directory(directory)
    document = compare(stack, name, **options)
    write_truth(document, directory)
    return Told(document, report.table(document), document["in_a_sentence"])


def check(stack: Stack, name: str, interface: str) -> None:
    """Raise `InputError` for a material that cannot be compared with the walk."""
    if interface not in ("single", "multi"):
        raise InputError(f"--interface {interface}: should be single or multi{nearest(interface, ('single', 'multi'))}")
    if not stack.layers:
        raise InputError(f"{name}: there is no coat, so nothing to compare: every form is the base alone, and exact")
    if reason := refuses(stack, interface):
        raise InputError(f"{name}: {reason}")


def forms_of(stack: Stack, interface: str) -> dict[str, Any]:
    """Forms for this structure by their names, nearest first; the material's own with its options."""
    names = [key for key, form in MODELS.items() if FORMS[form].refuses(stack.layers, stack.base) is None]
    forms: dict[str, Any] = {key: stack.form if key == model_name(stack) else MODELS[key]() for key in names}
    if "precise" in forms:
        forms["precise"] = dataclasses.replace(forms["precise"], interface=interface)
    return forms


def below(stack: Stack, fans: Sequence[Fan], of: Stack | None = None) -> list[np.ndarray]:
    """BRDF (n, 3) [1/sr] from below the coats in the form of the stack, for every fan; the lobe that is taken off is `of` another, where given."""
    wi = np.concatenate([np.broadcast_to(fan.wi, fan.wo.shape) for fan in fans])
    wo = np.concatenate([fan.wo for fan in fans])
    # The lobe that is taken off may be 1e5 times what is left of it: too much for the digits of float32.
    with jax.enable_x64(True):
        whole = np.asarray(brdf(stack.astype(np.float64), wi, wo))
        top = np.concatenate([top_lobe(of or stack, fan.wi, fan.wo) for fan in fans])
    return np.split(whole - top, np.cumsum([len(fan.wo) for fan in fans])[:-1])


def relative_error(f: np.ndarray, truth: Estimate, fan: Fan) -> np.ndarray:
    """Of each channel: sum of |f - truth| cos over sum of truth cos, over the directions of a fan; NaN where it is black."""
    return _relative(np.abs(f - truth.mean), truth, fan)


def noise(truth: Estimate, fan: Fan) -> np.ndarray:
    """The relative error that an exact form would show: the mean deviation of a normal variable is sqrt(2 / pi) sigma."""
    return _relative(math.sqrt(2.0 / math.pi) * truth.se, truth, fan)


def _relative(difference: np.ndarray, truth: Estimate, fan: Fan) -> np.ndarray:
    cosine = fan.wo[:, 2:]
    light = np.sum(truth.mean * cosine, 0)
    seen = light > DARK / math.pi * np.sum(cosine)
    return np.where(seen, np.sum(difference * cosine, 0) / np.where(seen, light, 1.0), np.nan)


def walked(stack: Stack, fan: Fan, paths: int, interface: Any, seed: int) -> Estimate:
    """The walk through a material for one fan."""
    return walk(stack, fan.wi, fan.wo, paths=paths, seed=seed, interface=interface, haze=hazes(stack))


def path_counts(
    stack: Stack, fans: Sequence[Fan], interface: str, paths: int | None, seed: int, progress: Progress
) -> list[int]:
    """Paths of every fan, from the noise of a few: so the numbers do not depend on how fast a machine is."""
    if paths is not None:
        return [paths] * len(fans)
    counts = []
    for k, fan in enumerate(fans):
        progress("pilot", k / len(fans))
        # Another seed, or the noise that chose the paths would be part of the result.
        pilot = mean_of(noise(walked(stack, fan, PILOT, interface, seed + 1), fan))
        wanted = 0.0 if math.isnan(pilot) else PILOT * (pilot / NOISE) ** 2
        counts.append(int(np.clip(math.ceil(wanted), PILOT, MOST)))
    return counts


def _summary(errors: Sequence[np.ndarray]) -> dict[str, Any]:
    table = np.array(errors)
    return {
        "error_rel": [mean_of(row) for row in table],
        "error_rel_rgb": table.tolist(),
        "median": float(np.nanmedian(table)),
        "p90": float(np.nanquantile(table, 0.9)),
    }


def mean_of(values: np.ndarray) -> float:
    """Over the channels that are not black."""
    return math.nan if np.all(np.isnan(values)) else float(np.nanmean(values))


def hemisphere(incidence_deg: float) -> Fan:
    """About forty views: evenly over one side of the plane of incidence, as the other is its image, and around the mirror direction."""
    evenly = [(theta, phi) for theta in (10.0, 25.0, 40.0, 55.0, 70.0) for phi in (0.0, 45.0, 90.0, 135.0, 180.0)]
    views = [_direction(theta, phi) for theta, phi in evenly]
    mirror = _direction(incidence_deg, 180.0)
    along, across = _direction(incidence_deg + 90.0, 180.0), np.array([0.0, 1.0, 0.0])
    views.append(mirror)
    for ring in np.radians([4.0, 10.0, 20.0]):
        for psi in np.radians([0.0, 60.0, 120.0, 180.0]):
            views.append(math.cos(ring) * mirror + math.sin(ring) * (math.cos(psi) * along + math.sin(psi) * across))
    wo = np.array(views)
    return _fan(incidence_deg, wo[wo[:, 2] > math.cos(math.radians(LOWEST_DEG))])


def _plane(incidence_deg: float) -> Fan:
    """Views in the plane of incidence, closest around the mirror direction."""
    near = incidence_deg + np.array([-6.0, -4.0, -2.5, -1.0, 0.0, 1.0, 2.5, 4.0, 6.0])
    angles = np.union1d(np.arange(-80.0, 81.0, 5.0), near[near < LOWEST_DEG])
    return _fan(incidence_deg, np.array([_direction(angle, 180.0) for angle in angles]))


def _fan(incidence_deg: float, wo: np.ndarray) -> Fan:
    """Light in the xz plane and views, turned to where the light is."""
    c, s = math.cos(math.radians(AZIMUTH_DEG)), math.sin(math.radians(AZIMUTH_DEG))
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    outgoing = np.degrees(np.arctan2(-wo[:, 0], wo[:, 2]))
    return Fan(incidence_deg, _direction(incidence_deg, 0.0) @ turn, wo @ turn, outgoing)


def _direction(theta_deg: float, phi_deg: float) -> np.ndarray:
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])
