"""What a map leaves in its directory: the maps as layers of one EXR, textures, the shader that reads them, a picture and a summary."""

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from ..capture.exr import write_exr
from ..documents import finite, of_ours, write_files
from ..errors import InputError
from ..fit.parameters import Parametrisation
from ..preset import preset_of
from ..report import pictures
from ..report.pictures import Panel
from ..shader.export import Shader, print_material
from ..shader.verify import FLOOR, Parity, check_pairs, compare, shade_samples
from . import model
from .descent import Descent
from .judge import FLAGS
from .parameters import TILT
from .result import MapFit

SCHEMA = "layerfit/map"
CHECKED = 4096
"""Texels in which the shader is compared with JAX."""


def written(result: MapFit, descent: Descent, directory: Path, name: str) -> dict[str, Any]:
    """Write everything, all files whole or none; the document that stands in `map.json`."""
    shader, parity, why = _shader(result, descent, name)
    document = finite(_document(result, descent, parity, why))
    textures = {f"{key.replace('.', '_')}.exr": _texture(values) for key, values in _textures(result).items()}
    passed = parity is not None and parity.passed
    files: dict[str, str | bytes | None] = {
        "material.frag": shader.text() if shader is not None and passed else None,
        **{f"textures/{key}": value for key, value in textures.items()},
        "maps.exr": _exr(channels(result), {"layerfitFlags": "; ".join(f"{bit} {words}" for bit, words in FLAGS.items())}),
        "map.png": _picture(result),
        "preset.json": json.dumps(preset_of(result.stack, name), indent=2) + "\n",
        "map.json": json.dumps(document, indent=2) + "\n",
    }
    gone = {f"textures/{path.name}": None for path in (directory / "textures").glob("*.exr") if path.name not in textures}
    files = gone | files
    write_files(directory, of_ours(directory, files, "map.json", SCHEMA))
    return document


def channels(result: MapFit) -> dict[str, np.ndarray]:
    """The layers of `maps.exr`: parameters by name, their sigmas under `sigma`, their flags under `flags`, the normal as N, coverage as A."""
    made: dict[str, np.ndarray] = {}
    for prefix, maps in (("", result.values), ("sigma.", result.sigmas), ("flags.", result.flags)):
        for name, values in maps.items():
            made |= _layer(f"{prefix}{name}", values, "XY" if name == TILT else "RGB")
    if result.normal is not None:
        made |= _layer("N", result.normal, "XYZ")
    return made | {"A": (result.seen > 0).astype(float), "misfit": result.misfit}


def _layer(name: str, values: np.ndarray, letters: str) -> dict[str, np.ndarray]:
    if values.ndim == 2:
        return {name: values}
    return {f"{name}.{letter}": values[..., k] for k, letter in enumerate(letters)}


def _textures(result: MapFit) -> dict[str, np.ndarray]:
    tilt = {TILT: result.values[TILT]} if TILT in result.values else {}
    return result.fields() | tilt


def _texture(values: np.ndarray) -> bytes:
    """One float texture: a number as Y, a colour as R, G and B, slopes as R and G."""
    if values.ndim == 2:
        return _exr({"Y": values})
    filled = values if values.shape[-1] == 3 else np.concatenate([values, np.zeros_like(values[..., :1])], -1)
    return _exr({letter: filled[..., k] for k, letter in enumerate("RGB")})


def _exr(layers: Mapping[str, np.ndarray], header: Mapping[str, Any] | None = None) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "maps.exr"
        write_exr(path, layers, header=header)
        return path.read_bytes()


def _shader(result: MapFit, descent: Descent, name: str) -> tuple[Shader | None, Parity | None, str | None]:
    """The shader that reads the textures, and how near it is to JAX; or why there is none."""
    maps = list(_textures(result))
    try:
        shader = print_material(result.stack, name, maps=maps, tangent=result.texels.tangents and TILT in maps)
    except InputError as error:
        return None, None, str(error)
    return shader, _parity(result, descent, shader), None


def _parity(result: MapFit, descent: Descent, shader: Shader) -> Parity:
    """Shader against JAX where texels were seen, along the tilted normals."""
    texels, fields = result.texels, result.fields()
    if not fields:
        return check_pairs(shader)
    which = np.sort(np.random.default_rng(0).permutation(len(texels.index))[:CHECKED])
    seen = descent.seen(which)
    wi, wo, weight = seen.wi, seen.wo, seen.weight
    if descent.tilted:
        slopes = result.values[TILT].reshape(-1, 2)[texels.index[which]].astype(np.float32)
        wi, wo = (np.asarray(jax.vmap(model.turned)(w, slopes)) for w in (wi, wo))
        weight = weight * np.maximum(wi[:, None, :, :, 2], 0.0)
    seen = model.Seen(wi, wo, weight, seen.target, seen.inverse_sigma)
    flat, free = _of_material(descent.free)
    values = descent.values(result.vector[which][:, flat], seen, free).transpose(0, 2, 1)
    given = {key: _repeated(values_of, texels.index[which], wi.shape[1]) for key, values_of in fields.items()}
    rows = values.reshape(-1, 3)
    samples = wi.reshape(-1, *wi.shape[2:]), wo.reshape(-1, 3), weight.transpose(0, 2, 3, 1).reshape(len(rows), -1, 3)
    drawn = shade_samples(shader, *samples, maps=given)
    lit = np.any(samples[2] > 0.0, (1, 2))
    floor = FLOOR * float(np.quantile(np.max(rows[lit], -1), 0.99))
    return compare(drawn[lit], rows[lit], floor)


def _of_material(free: Parametrisation) -> tuple[list[int], Parametrisation]:
    """Entries of the vector that are of the material, and what they are."""
    slots = [slot for f in free.free if f.layer is not None for slot in f.slots]
    return slots, free.without([f.name for f in free.free if f.layer is None], np.zeros(free.size))


def _repeated(values: np.ndarray, places: np.ndarray, count: int) -> np.ndarray:
    flat = values.reshape(-1, *values.shape[2:])[places]
    return np.repeat(flat, count, 0).astype(np.float32)


def _document(result: MapFit, descent: Descent, parity: Parity | None, why: str | None) -> dict[str, Any]:
    texels = result.texels
    return {
        "schema": SCHEMA,
        "version": 1,
        "size": list(texels.shape),
        "texels": len(texels.index),
        "references": len(texels.bright),
        "seen": {"least": int(texels.seen.min()), "median": float(np.median(texels.seen)), "most": int(texels.seen.max())},
        "parameters": result.summary(),
        "error": {"rel_l2": result.rel_l2},
        "parity": None if parity is None else parity.to_json() | {"passed": parity.passed, "renderer": parity.renderer},
        "no_shader": why,
        "frame": None if TILT not in result.values else "the tangent given" if texels.tangents else "of the normal alone",
        "preset": "preset.json",
    }


def _picture(result: MapFit) -> bytes:
    """For each parameter its map, its sigma and where it is told; the misfit."""
    there = result.seen > 0
    rows = [_row(name, result, there) for name in result.values]
    end = float(np.quantile(result.misfit[there], 0.99)) + 1e-9
    rows.append([Panel("misfit of each texel", _false(result.misfit, 0.0, end, there), f"{end:.2g} relative")])
    return pictures.strip(rows)


def _row(name: str, result: MapFit, there: np.ndarray) -> list[Panel]:
    values, sigmas, flags = (
        _plain(maps[name], how) for maps, how in ((result.values, np.mean), (result.sigmas, np.max), (result.flags, np.max))
    )
    low, high = np.quantile(values[there], [0.005, 0.995])
    told = there & np.isfinite(sigmas)
    end = float(np.quantile(sigmas[told], 0.99)) if told.any() else 1.0
    flagged = np.where(there, np.where(flags > 0, 1.0, 0.0), 0.0)
    return [
        Panel(f"{name}, {low:.3g} to {high:.3g}", _false(values, low, high, there)),
        Panel("sigma", _false(sigmas, 0.0, end, told), f"{end:.2g}"),
        Panel("flagged", _false(flagged, 0.0, 1.0, there)),
    ]


def _plain(values: np.ndarray, how: Any) -> np.ndarray:
    return values if values.ndim == 2 else how(values, -1)


def _false(values: np.ndarray, low: float, high: float, there: np.ndarray) -> np.ndarray:
    scaled = (np.nan_to_num(values, posinf=high) - low) / max(high - low, 1e-12)
    return np.where(there[..., None], pictures.false_colour(scaled), 0.3)
