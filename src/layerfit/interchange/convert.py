"""The values with which another program comes nearest to a material, and what is lost all the same, measured."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..capture.load import AnyView
from ..capture.samples import View
from ..fit.fit import fit
from ..fit.metrics import image_error
from ..layers import Coat
from ..stack import Stack
from ..surfaces import Conductor, Dielectric, KubelkaMunk, Lambert
from .dialects import COAT_INDEX, DIALECTS
from .engine import Engine
from .mapping import alone, copied, filmed, fitted_fields
from .stage import default_views, draw, showing

METRIC = "cube_root"
"""In what the search compares: what a viewer sees, not the highlight alone."""


THICKNESSES_NM = np.geomspace(30.0, 900.0, 18)
"""Of films that a search begins with."""


@dataclasses.dataclass(frozen=True)
class Conversion:
    """A material in the words of another program."""

    name: str
    stack: Stack
    """What is converted."""
    engine: Engine
    """The best values."""
    error: dict[str, float]
    """Of them, against the material: `rel_l2`, and of pictures `psnr_db`, `ssim` and `delta_e`."""
    copied_error: dict[str, float]
    """Of its values as they are."""
    seen: str
    """Where they were compared."""
    views: Sequence[AnyView]
    """The same, showing the material."""
    lost: tuple[str, ...]
    """What the other program has no word for."""

    def to_json(self) -> dict[str, Any]:
        """What a preset keeps of it."""
        return {
            "formula": DIALECTS[self.engine.dialect].title,
            "on": self.seen,
            "error": self.error,
            "error_of_copied_values": self.copied_error,
            "lost": list(self.lost),
        }


def convert(stack: Stack, name: str, dialect: str, views: Sequence[AnyView] | None = None) -> Conversion:
    """Find the values of a program's coat over a base that look most like a material, on a scene or on a sphere under two lights.

    Raises `InputError` where the material cannot be drawn there.
    """
    seen = "a sphere under two lights" if views is None else ", ".join(str(view.reference.path.name) for view in views)
    shown = showing(list(default_views() if views is None else views), stack)
    plain = copied(stack, dialect)
    starts = [plain] if (film := filmed(stack, plain)) is None else [plain, film, _nearest_film(film, shown)]
    best, error, copied_error = min((_tried(start, shown) for start in starts), key=lambda tried: _seen(tried[1]))
    return Conversion(name, stack, best, error, copied_error, seen, shown, lost(stack, best))


def _nearest_film(film: Engine, views: Sequence[AnyView]) -> Engine:
    """A film as thick as looks most like it: a metal turns the phase of light, a clear medium does not, so that another order may be nearer."""
    tried = [dataclasses.replace(film, film_nm=float(nm)) for nm in THICKNESSES_NM]
    return min(tried, key=lambda one: _seen(_error(views, one)))


def _tried(start: Engine, views: Sequence[AnyView]) -> tuple[Engine, dict[str, float], dict[str, float]]:
    """The best values from a start, their error, and that of the start."""
    best = _best(start, views)
    copied_error, error = (_error(views, engine) for engine in (start, best))
    if copied_error["rel_l2"] < error["rel_l2"] and copied_error.get("delta_e", 0.0) <= error.get("delta_e", 0.0):
        return start, copied_error, copied_error  # the values as they are cannot be bettered
    return best, error, copied_error


def _seen(error: dict[str, float]) -> float:
    """Delta E where there are pictures."""
    return error.get("delta_e", error["rel_l2"])


def _best(start: Engine, views: Sequence[AnyView]) -> Engine:
    free = tuple(f"{start.name}.{field}" for field in fitted_fields(start))
    return fit(views, alone(start), free=free, metric=METRIC, starts=1).stack.base if free else start


def _error(views: Sequence[AnyView], engine: Engine) -> dict[str, float]:
    return mean_error(views, [draw(view, alone(engine)) for view in views])


def mean_error(views: Sequence[AnyView], images: Sequence[np.ndarray]) -> dict[str, float]:
    """Errors of what another program draws, radiances (pixels, 3), averaged over the references."""
    errors = [_view_error(view, values) for view, values in zip(views, images, strict=True)]
    return {key: float(np.mean([error[key] for error in errors])) for key in errors[0] if all(key in e for e in errors)}


def _view_error(view: AnyView, values: np.ndarray) -> dict[str, float]:
    if isinstance(view, View):
        return image_error(view.image(values), view.image(view.target), view.covered)
    return {"rel_l2": float(np.sqrt(np.sum((values - view.target) ** 2) / np.sum(view.target**2)))}


def lost(stack: Stack, engine: Engine) -> tuple[str, ...]:
    """What of a material its conversion has no word for, in words for people."""
    return tuple(sentence for layer in (*stack.layers, stack.base) for sentence in _lost_of(layer, stack, engine))


def _lost_of(layer: Any, stack: Stack, engine: Engine) -> list[str]:
    film = getattr(layer, "film_nm", None) is not None
    on = {"clear": "on a clear medium that reflects like the metal", "metal": "on a metal of two reflectances"}
    said = {
        "its film: the colour that changes with the angle": film and engine.film_nm is None,
        f"its film: interference in three channels, {on[engine.rules.film_on]}": film and engine.film_nm is not None,
        "what differs from place to place: its mean is taken": bool(getattr(layer, "reads", ())),
        "Beckmann's facets: GGX in their place": getattr(layer, "distribution", "ggx") != "ggx",
    }
    said |= _of_a_coat(layer, stack, engine) if isinstance(layer, Coat) else _of_a_base(layer, engine)
    return [f"{layer.name}: {sentence}" for sentence, so in said.items() if so]


def _of_a_coat(coat: Coat, stack: Stack, engine: Engine) -> dict[str, bool]:
    if coat is not stack.layers[0]:
        return {"a layer of its own: it is in the outermost coat": True}
    ways = {"view": "light goes out as the viewer looks, and in the same way", "flat": "without regard to the angle"}
    rules, index, absorbs = engine.rules, float(np.mean(np.asarray(coat.eta))), coat.extinction is not None
    return {
        f"its index: {COAT_INDEX:g} in place of {index:.3g}": engine.base != "glossy"
        and not rules.coat_index
        and index != COAT_INDEX,
        "its absorption: it is in the colour of the base": absorbs and rules.path is None,
        f"how it absorbs by angle: {ways.get(rules.path or '', '')}": absorbs and rules.path in ways,
        "its scattering": coat.tau_s is not None,
        "its grain": coat.alpha_x is not None,
        "light that goes to and fro below it": not (rules.darkens and engine.base == "diffuse"),
        "how it widens what shines through it: the base is as wide as the two": not rules.widens
        and engine.base in ("metal", "mixed"),
    }


def _of_a_base(base: Any, engine: Engine) -> dict[str, bool]:
    metal = isinstance(base, Conductor)
    rest = not isinstance(base, Conductor | Dielectric | Lambert | KubelkaMunk)
    return {
        "eta and k of the metal: three reflectances, and Schlick's formula": metal and engine.edge_tint is None,
        "eta and k of the metal: reflectances at 0 and 82 degrees": metal and engine.edge_tint is not None,
        "all but a lobe and a diffuse part": rest,
    }
