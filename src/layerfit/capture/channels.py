"""Which channels of a picture are beauty, alpha, normal, position, depth and noise: every renderer has names of its own.

What the scene file says comes first. Else a role is looked for by the names listed for it: as the name of a part, then as that
of a layer LAYER.CHANNEL, those of the beauty's own view layer (Blender's `ViewLayer.`) before others. Earlier names in a list
win over later ones, and names in exactly this case over others. Two candidates that are equally good are an error naming both.
"""

import difflib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .exr import Exr

ROLES = ("beauty", "alpha", "normal", "position", "tangent", "uv", "depth", "noise")
"""Also the keys of the scene file's [reference] that say where a role is."""

_SUFFIXES = {  # the channels of a layer that make a vector, three or two; roles that are not here are one number
    "beauty": ("RGB", "rgb"),
    "normal": ("XYZ", "RGB", "xyz", "rgb"),
    "position": ("XYZ", "RGB", "xyz", "rgb"),
    "tangent": ("XYZ", "RGB", "xyz", "rgb"),
    "uv": ("UV", "uv", "XY", "RG", "xy", "rg"),
    "noise": ("RGB", "rgb"),
}
_SINGLE = "ZTVYARztvyar"
"""The one channel that is taken of a layer for a number: `Depth.Z`, Mitsuba's `depth.T`, `alpha.A`, a grey `zDepth.R`."""
_NAMES = {
    # the unnamed layer first, then Blender's, Arnold's, Karma's and RenderMan's among the general ones
    "beauty": ("", "Combined", "RGBA", "beauty", "C", "RGB", "color", "Ci"),
    "alpha": ("A", "alpha"),
    "normal": ("N", "normal", "normals", "sh_normal", "Ns", "Normal"),
    "position": ("P", "position", "worldPositions", "Position", "WP"),
    "tangent": ("T", "tangent", "Tangent", "dp_du"),
    "uv": ("UV", "uv", "st", "ST", "texcoord"),
    "depth": ("Z", "depth", "zDepth", "Depth", "T", "Pz"),
    "noise": ("SE",),
}
_NOT_BEAUTY = ("albedo", "ao", "crypto", "diff", "gloss", "mask", "mist", "motion", "shadow", "uv", "vector")
"""Starts of the names of layers that are no beauty even where no other layer has colours."""


@dataclass(frozen=True)
class Channels:
    """The roles of a picture as float32 arrays, None where it has none.

    `chosen` says of every role what was taken and why, or that there is none; `names` holds the channels that were taken.
    """

    beauty: np.ndarray
    alpha: np.ndarray | None
    normal: np.ndarray | None
    position: np.ndarray | None
    tangent: np.ndarray | None
    """Along which an anisotropic surface is brushed."""
    uv: np.ndarray | None
    """Texture coordinates, (H, W, 2)."""
    depth: np.ndarray | None
    noise: np.ndarray | None
    chosen: dict[str, str]
    names: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class _Candidate:
    names: tuple[str, ...]
    layer: str
    why: str
    rank: tuple[int, ...] = ()
    """The lowest is the best."""


def resolve(exr: Exr, overrides: Mapping[str, str] | None = None, need: Collection[str] = ("beauty",)) -> Channels:
    """Find the channels of every role. `overrides` are the scene's: a layer ("N"), its channels ("N.X,N.Y,N.Z") or "none".

    Raises `InputError` where a role of `need`, or the beauty, is not there, where an override asks for what is not there, and
    where two candidates are equally good.
    """
    overrides = dict(overrides or {})
    for key, value in overrides.items():
        if key not in ROLES:
            raise InputError(f"{exr.path}: a scene can say where {', '.join(ROLES)} are, but not {key}{_nearest(key, ROLES)}")
        if not isinstance(value, str):
            raise InputError(
                f'{exr.path}: {key} = {value!r} must be a text, the name of a layer or of channels, as in {key} = "N"'
            )
    found: dict[str, _Candidate] = {}
    chosen: dict[str, str] = {}
    for role in ROLES:
        beside = found["beauty"].layer if "beauty" in found else ""
        best = _overridden(exr, role, overrides[role]) if role in overrides else _best(exr, role, beside)
        if best is not None:
            found[role], chosen[role] = best, f"{', '.join(best.names)}: {best.why}"
        elif role in {"beauty", *need}:
            raise InputError(_missing(exr, role))
        else:
            absent = f"no part or layer is called {', '.join(_NAMES[role])}"
            chosen[role] = f"none: {'the scene says so' if role in overrides else absent}"

    def array(role: str) -> np.ndarray | None:
        return _array(exr, found[role].names) if role in found else None

    return Channels(
        beauty=_array(exr, found["beauty"].names),
        alpha=array("alpha"),
        normal=array("normal"),
        position=array("position"),
        tangent=array("tangent"),
        uv=array("uv"),
        depth=array("depth"),
        noise=array("noise"),
        chosen=chosen,
        names={role: candidate.names for role, candidate in found.items()},
    )


def _array(exr: Exr, names: tuple[str, ...]) -> np.ndarray:
    return exr.channels[names[0]] if len(names) == 1 else np.stack([exr.channels[name] for name in names], -1)


def _layers(exr: Exr) -> dict[str, dict[str, str]]:
    """Layer to last part of the name to channel. The dot that V-Ray starts names with is dropped."""
    layers: dict[str, dict[str, str]] = {}
    for name in exr.channels:
        layer, _, last = name.lstrip(".").rpartition(".")
        layers.setdefault(layer, {}).setdefault(last, name)
    return layers


def _overridden(exr: Exr, role: str, value: str) -> _Candidate | None:
    """What the scene says: channels in full, or the layer that they are in."""
    if value.strip() == "none":
        return None
    wanted = tuple(text.strip() for text in value.split(","))
    layers = _layers(exr)
    size = _size(role)
    why = f'the scene says {role} = "{value}"'
    absent = [name for name in wanted if name not in exr.channels]
    if not absent and len(wanted) == size:
        return _Candidate(wanted, wanted[0].lstrip(".").rpartition(".")[0], why)
    layer = value.strip().strip(".")
    if layer and (names := _in_layer(layers.get(layer, {}), role)):
        return _Candidate(names, layer, why)
    if not absent or (layer and layer in layers):
        count = {2: "two", 3: "three"}.get(size)
        form = f"{count} channels or a layer with {' or '.join(_SUFFIXES[role])}" if count else "one channel or its layer"
        raise InputError(f'{exr.path}: {role} = "{value}" of the scene is not {form}; {_there(exr)}')
    if absent[0] in exr.left_out:
        raise InputError(f'{exr.path}: {role} = "{value}" of the scene was not read: {exr.left_out[absent[0]]}')
    near = _nearest(absent[0], [*filter(None, layers), *exr.channels])
    raise InputError(f'{exr.path}: {role} = "{value}" of the scene is not in the file{near}; {_there(exr)}')


def _size(role: str) -> int:
    """How many channels a role has."""
    return len(_SUFFIXES[role][0]) if role in _SUFFIXES else 1


def _best(exr: Exr, role: str, beside: str) -> _Candidate | None:
    """The best candidate for a role by its name; `beside` is the beauty's layer."""
    candidates = sorted(_candidates(exr, role, beside), key=lambda candidate: candidate.rank)
    taken = [candidate.names for candidate in candidates]
    candidates = [candidate for i, candidate in enumerate(candidates) if candidate.names not in taken[:i]]
    if role == "beauty" and not candidates:
        candidates = sorted(_only_colours(exr), key=lambda candidate: candidate.rank)
    if not candidates:
        return None
    best, *others = candidates
    names = [candidate.layer or ", ".join(candidate.names) for candidate in candidates]
    if others and others[0].rank == best.rank:
        raise InputError(
            f"{exr.path}: two layers could be the {role}, {names[0]} and {names[1]}; say which in the scene's [reference], "
            f'as in {role} = "{names[0]}"' + ("" if role == "beauty" else f', or {role} = "none"')
        )
    why = best.why + (f"; there are also {', '.join(names[1:])}" if others else "")
    return _Candidate(best.names, best.layer, why)


def _candidates(exr: Exr, role: str, beside: str) -> Iterator[_Candidate]:
    parts = {part.name for part in exr.parts if part.name}
    family = beside.rpartition(".")[0]
    for layer, channels in _layers(exr).items():
        parent, _, leaf = layer.rpartition(".")
        order, names = _order(role, leaf), _in_layer(channels, role)
        if order is not None and names and bool(layer) | (role == "beauty"):
            near = 0 if parent == beside else 1 if parent == family else 2
            if role == "beauty":
                near = int(parent == "Composite")  # what Blender's compositor made of the render is no measurement
            why = ("the part " if layer in parts else "the layer ") + layer if layer else "no layer"
            yield _Candidate(names, layer, why, (int(layer not in parts), near, *order))
        if role in _SUFFIXES or _is_vector(channels):
            continue
        for last, name in channels.items():
            # a Z of another layer can be anything, Blender's mist for one; only Mitsuba writes a T, and in a layer of any name
            near = 0 if layer == beside else 1 if layer in ("", family) else 2
            if (order := _order(role, last)) is not None and (near < 2 or last == "T"):
                yield _Candidate((name,), "", "beside the beauty" if near == 0 else "its name", (int(near > 0), near, *order))


def _only_colours(exr: Exr) -> Iterator[_Candidate]:
    """Layers of colours whose names say nothing, as Mitsuba's, which the user chooses; a whole part before a layer in one."""
    parts = {part.name for part in exr.parts}
    for layer, channels in _layers(exr).items():
        leaf = layer.rpartition(".")[2]
        other = any(_order(role, leaf) for role in ("normal", "position", "depth", "noise")) or leaf.lower().startswith(
            _NOT_BEAUTY
        )
        if not other and (names := _in_layer(channels, "beauty")):
            yield _Candidate(names, layer, "the only layer of colours", (int(layer not in parts),))


def _order(role: str, name: str) -> tuple[int, int] | None:
    """How good a name is for a role: in its list, or in another case."""
    known = _NAMES[role]
    if name in known:
        return 0, known.index(name)
    folded = [text.lower() for text in known]
    return (1, folded.index(name.lower())) if name.lower() in folded else None


def _in_layer(channels: Mapping[str, str], role: str) -> tuple[str, ...]:
    """The channels of a role within one layer, empty where it lacks them."""
    for suffixes in _SUFFIXES.get(role, ()):
        if all(last in channels for last in suffixes):
            return tuple(channels[last] for last in suffixes)
    if role in _SUFFIXES or _is_vector(channels):
        return ()
    return next(((channels[last],) for last in _SINGLE if last in channels), ())


def _is_vector(channels: Collection[str]) -> bool:
    """Whether a Z among them is an axis and no depth."""
    return any(all(last in channels for last in suffixes) for suffixes in ("XYZ", "xyz"))


def _missing(exr: Exr, role: str) -> str:
    example = '"LAYER", or "LAYER.R,LAYER.G,LAYER.B"' if role in _SUFFIXES else '"CHANNEL"'
    near = _nearest(role, [*filter(None, _layers(exr)), *exr.channels])
    return (
        f"{exr.path}: there is no {role}{near}; say in the scene's [reference] which it is, {role} = {example}; {_there(exr)}"
    )


def _nearest(wanted: str, known: Iterable[str], limit: int = 3) -> str:
    """The known names that are most like the wanted one, as the middle of a sentence."""
    known = list(dict.fromkeys(known))
    folded = wanted.lower()
    holding = [name for name in known if min(len(name), len(wanted)) > 2 and (folded in name.lower() or name.lower() in folded)]
    near = dict.fromkeys(holding + difflib.get_close_matches(wanted, known, limit, 0.5))
    return f" (nearest: {', '.join(list(near)[:limit])})" if near else ""


def _there(exr: Exr, limit: int = 40) -> str:
    names = list(exr.channels)
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return f"the file holds {', '.join(names[:limit])}{more}"
