"""Presets: a material as data, one JSON document (or the same blocks in a scene file).

Layers outermost first; keys are the fields of the layers, so that ranges, units and meanings are written once. Unknown keys
are errors that name the nearest known one.
"""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np

from ._fields import Param, given, params
from .documents import check_keys, is_number, nearest, read_document, write_text
from .errors import InputError
from .forms import patina, precise
from .forms.corrected import Corrected
from .forms.faithful import Faithful
from .forms.precise import Precise
from .layers import LAYERS
from .optics.metals import metal
from .shipped import WORDS, find_preset
from .stack import FORMS, IN_TIME, Stack
from .surfaces import BASES, Conductor

SCHEMA = "layerfit/preset"
VERSION = 1
MODELS: dict[str, type] = {"precise": Precise, "corrected": Corrected, "faithful": Faithful}
MOST_ORDERS = 16
"""Each is a lobe in the shader; the third stands for all that follow."""
MOST_COATS = 8
"""Each is a function in the shader and a trace that grows."""
FORM_KEYS = ("model", "interface", "options")
_STACK_KEYS = (*FORM_KEYS, "layers", "base")
_PRESET_KEYS = ("schema", "version", "name", *WORDS, *_STACK_KEYS, "left_out", "fit", "losses")


def read_preset(path: Path | str) -> Stack:
    """The material of a preset file, or of a shipped preset by its bare name, such as "lacquered_copper".

    Raises `InputError` that says which key is wrong and what was meant.
    """
    path = find_preset(Path(path))
    document = read_document(path)
    where = str(path)
    if document.get("schema") != SCHEMA:
        if "reference" in document:
            raise InputError(
                f"{where}: is a scene file, not a preset. A fit of it leaves one, preset.json; `layerfit presets` lists those that ship."
            )
        raise InputError(f'{where}: not a preset: "schema" is {document.get("schema")!r} and should be {SCHEMA!r}')
    if document.get("version") != VERSION:
        raise InputError(
            f"{where}: preset version {document.get('version')!r}; this layerfit reads version {VERSION}. "
            "A newer layerfit reads newer presets."
        )
    check_keys(document, _PRESET_KEYS, where)
    for key in ("name", *WORDS):
        if not isinstance(document.get(key, ""), str):
            raise InputError(f"{where}: {key} = {document[key]!r}: should be text")
    return stack_of({key: document[key] for key in _STACK_KEYS if key in document}, where)


def preset_of(stack: Stack, name: str, **more: Any) -> dict[str, Any]:
    """The preset document of a material; `more` are further keys: words for people, and `fit`."""
    words = {key: more.pop(key) for key in WORDS if key in more}
    document: dict[str, Any] = {"schema": SCHEMA, "version": VERSION, "name": name, **words, "model": model_name(stack)}
    changed = {
        field.name: getattr(stack.form, field.name)
        for field in dataclasses.fields(stack.form)
        if field.name != "interface" and getattr(stack.form, field.name) != field.default
    }
    if isinstance(stack.form, Precise):
        document["interface"] = stack.form.interface
    if changed:
        document["options"] = changed
    document["layers"] = [_layer_document(layer, LAYERS) for layer in stack.layers]
    document["base"] = _layer_document(stack.base, BASES)
    document["left_out"] = left_out(stack)
    return document | more


def write_preset(path: Path | str, stack: Stack, name: str, **more: Any) -> None:
    """Write a preset file, whole or not at all; `more` are further keys, such as `description`."""
    write_text(Path(path), json.dumps(preset_of(stack, name, **more), indent=2) + "\n")


def model_name(stack: Stack) -> str:
    """Name of the form in presets and reports."""
    return next(name for name, form in MODELS.items() if isinstance(stack.form, form))


def left_out(stack: Stack) -> list[str]:
    """What this material does without, in words: none of it is evaluated, fitted or printed."""
    words = []
    if not stack.layers:
        words.append("coat")
    for layer in stack.layers:
        if hasattr(layer, "optical_depth") and layer.optical_depth is None:
            words.append(f"{layer.name}: absorption")
    for layer in (*stack.layers, stack.base):
        words += [f"{layer.name}: {lack}" for lack in getattr(layer, "lacks", ())]
    for layer in (*stack.layers, stack.base):
        if hasattr(layer, "alpha_x") and layer.alpha is not None:
            words.append(f"{layer.name}: anisotropy")
    return words


def stack_of(document: Mapping[str, Any], where: str) -> Stack:
    """The material of `model`, `interface`, `options`, `layers` and `base` keys; `where` is named in messages."""
    check_keys(document, _STACK_KEYS, where)
    layers = document.get("layers", [])
    if not isinstance(layers, Sequence) or isinstance(layers, str):
        raise InputError(f"{where}: layers should be a list, outermost first")
    if len(layers) > MOST_COATS:
        raise InputError(f"{where}: {len(layers)} layers over the base are too many; at most {MOST_COATS} are read")
    if "base" not in document:
        raise InputError(f'{where}: there is no base; give one, for example {{"type": "conductor", "alpha": 0.2}}')
    built = tuple(_layer(layer, LAYERS, f"{where}: layers[{k}]") for k, layer in enumerate(layers))
    base = _layer(document["base"], BASES, f"{where}: base")
    names = [layer.name for layer in (*built, base)]
    if len(set(names)) < len(names):
        raise InputError(f"{where}: two layers share a name ({', '.join(names)}); names tell parameters apart")
    return Stack(built, base, form_of(document, built, base, where))


def form_of(document: Mapping[str, Any], layers: tuple[Any, ...], base: Any, where: str) -> Any:
    """The form of `model`, `interface` and `options`; without a model the precise one, for materials that it is for."""
    for kind in IN_TIME:
        if problem := kind.refuses(layers, base):
            raise InputError(f"{where}: {problem}")
    in_time = any(kind.grows(layers) for kind in IN_TIME)
    model = document.get("model", "corrected" if in_time or precise.refuses(layers, base) else "precise")
    if not isinstance(model, str) or model not in MODELS:
        raise InputError(f"{where}: model = {model!r} is not one of {', '.join(MODELS)}{nearest(str(model), MODELS)}")
    reason = patina.form_refuses(layers, MODELS[model]) if in_time else FORMS[MODELS[model]].refuses(layers, base)
    if reason:
        instead = "" if model == "corrected" else '. Use "corrected", which is for all of them'
        raise InputError(f'{where}: model = "{model}" is not for this material: {reason}{instead}')
    form = MODELS[model]
    options = document.get("options", {})
    known = [f.name for f in dataclasses.fields(form) if f.name != "interface"]
    check_keys(options, known, f"{where}: options")
    options = {key: _option(value, get_type_hints(form)[key], f"{where}: options.{key}") for key, value in options.items()}
    if "interface" in document:
        interface = document["interface"]
        if model != "precise":
            raise InputError(f'{where}: interface is of model = "precise"; {model} has no choice of it')
        if interface not in ("single", "multi"):
            raise InputError(
                f"{where}: interface = {interface!r} should be single or multi{nearest(str(interface), ('single', 'multi'))}"
            )
        options["interface"] = interface
    return form(**options)


def _option(value: Any, kind: Any, where: str) -> Any:
    """A truth value, one of some words, or a small number, as the form says."""
    words = get_args(kind)
    if words and value not in words:
        raise InputError(f"{where} = {value!r}: should be one of {', '.join(words)}{nearest(str(value), words)}")
    if kind is bool and not isinstance(value, bool):
        raise InputError(f"{where} = {value!r}: should be true or false")
    if kind is int and (not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= MOST_ORDERS):
        raise InputError(f"{where} = {value!r}: should be a whole number from 0 to {MOST_ORDERS}")
    return value


def _layer(document: Any, kinds: Mapping[str, Any], where: str) -> Any:
    if not isinstance(document, Mapping):
        raise InputError(f"{where}: should be a table of keys, not {document!r}")
    kind = document.get("type")
    if not isinstance(kind, str) or kind not in kinds:
        raise InputError(f"{where}: type = {kind!r} is not one of {', '.join(kinds)}{nearest(str(kind), kinds)}")
    cls = kinds[kind]
    known = {field.name: field for field in dataclasses.fields(cls) if field.name in given(cls)}
    check_keys(document, ("type", *known, *(("metal",) if cls is Conductor else ())), where)
    document = _named_metal(document, where)
    specs = dict(params(cls))
    values: dict[str, Any] = {}
    for key, value in document.items():
        if key == "type":
            continue
        if key in specs:
            values[key] = _number(value, specs[key], f"{where}.{key}")
        else:
            values[key] = _choice(value, known[key], f"{where}.{key}")
    if ("alpha_x" in values) != ("alpha_y" in values):
        raise InputError(f"{where}: alpha_x and alpha_y come together; one is missing")
    if "alpha_x" in values:
        if "alpha" in values:
            raise InputError(f"{where}: give either alpha, or alpha_x and alpha_y")
        values["alpha"] = None
    if "absorption_per_mm" in specs and ("absorption_per_mm" in values) != ("thickness_um" in values):
        raise InputError(
            f"{where}: absorption_per_mm and thickness_um come together; where neither is known give their product tau"
        )
    if "g" in values and "tau_s" not in values and "tau_s" in specs:
        raise InputError(f"{where}: g says how a coat scatters, but there is no tau_s, the depth of its scattering")
    if "tau" in values and "absorption_per_mm" in values:
        raise InputError(f"{where}: give either tau, or absorption_per_mm and thickness_um; tau is their product")
    for group in getattr(cls, "together", ()):
        if missing := [key for key in group if key not in values] if any(key in values for key in group) else []:
            raise InputError(f"{where}: {', '.join(group)} come together; {', '.join(missing)} is missing")
    for key, others in getattr(cls, "only_with", {}).items():
        if missing := [other for other in others if other not in values] if key in values else []:
            raise InputError(f"{where}: {key} belongs to {missing[0]}, which is not there: leave it out or give both")
    made = cls(**values)
    if problem := getattr(made, "film_problem", None):
        raise InputError(f"{where}: {problem}")
    return made


def _named_metal(document: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """A layer's document with the index in place of the name of a metal."""
    if "metal" not in document:
        return document
    if "eta" in document or "k" in document:
        raise InputError(f"{where}: give either metal, or eta and k; a metal's name stands for both")
    if not isinstance(document["metal"], str):
        raise InputError(f'{where}.metal = {document["metal"]!r}: should be a name, such as "Cu" or "copper"')
    found = metal(document["metal"], f"{where}.metal")
    others = {key: value for key, value in document.items() if key != "metal"}
    return others | {"eta": rounded(found.eta), "k": rounded(found.k)}


def _number(value: Any, spec: Param, where: str) -> Any:
    array = np.asarray(value, object)
    numeric = all(is_number(v) for v in array.ravel())
    if not numeric or array.shape not in ((), (3,)):
        raise InputError(f"{where} = {value!r}: should be a finite number{' or a list of three' if spec.colour else ''}")
    if array.shape == (3,) and not spec.colour:
        raise InputError(f"{where} = {value!r}: is one number for all channels, not a colour")
    array = array.astype(float)
    if np.any(array < spec.lower) or np.any(array > spec.upper):
        raise InputError(f"{where} = {value!r}: outside its range {spec.lower:g} to {spec.upper:g} {_unit(spec)}({spec.doc})")
    return float(array) if array.shape == () else array


def _unit(spec: Param) -> str:
    return "" if spec.unit == "1" else f"{spec.unit} "


def _choice(value: Any, field: dataclasses.Field[Any], where: str) -> str:
    choices = field.metadata.get("choices")
    if choices and value not in choices:
        raise InputError(f"{where} = {value!r}: should be one of {', '.join(choices)}{nearest(str(value), choices)}")
    if not choices and not (isinstance(value, str) and value.isidentifier() and value.isascii() and len(value) <= 32):
        raise InputError(f"{where} = {value!r}: a name is up to 32 letters, digits and underscores, the first a letter")
    return value


def _layer_document(layer: Any, kinds: Mapping[str, type]) -> dict[str, Any]:
    kind = next(name for name, cls in kinds.items() if isinstance(layer, cls))
    document: dict[str, Any] = {"type": kind, "name": layer.name}
    for field in dataclasses.fields(layer):
        value = getattr(layer, field.name)
        if field.name == "name" or value is None:
            continue
        if "param" in field.metadata:
            document[field.name] = rounded(value)
        elif value != field.default:
            document[field.name] = value
    return document


def rounded(value: Any) -> Any:
    """A number or a colour for a document: as many digits as float32 holds."""
    array = np.asarray(value, np.float32)
    return float(str(array)) if array.shape == () else [float(str(v)) for v in array]
