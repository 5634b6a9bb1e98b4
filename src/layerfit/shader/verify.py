"""Is the shader the material? The printed functions rendered in OpenGL, compared with JAX number by number."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._directions import FLOOR as FLOOR, random_pairs as random_pairs, random_places as random_places
from .._place import Place
from ..documents import finite
from ..render import predict
from .export import Shader
from .gl import renderer, shade_points

MAX_REL = 5e-5
P999_REL = 1e-5
"""What printed float32 arithmetic may differ by: rounding, and a driver's exp that is 17 units in the last place off."""


@dataclasses.dataclass(frozen=True)
class Parity:
    """Shader against JAX, same material, same inputs: relative to the larger of the value and the floor."""

    max_rel: float
    p999_rel: float
    worst: dict[str, Any]
    count: int
    renderer: str

    @property
    def passed(self) -> bool:
        return self.max_rel <= MAX_REL and self.p999_rel <= P999_REL

    def to_json(self) -> dict[str, Any]:
        """Plain values; what is not finite is None."""
        return finite({"max_rel": self.max_rel, "p999_rel": self.p999_rel, "worst": self.worst, "values": self.count})


def together(parities: Sequence[Parity]) -> Parity:
    """The worst of several checks as one."""
    worst = max(parities, key=lambda p: p.max_rel)
    p999 = max(p.p999_rel for p in parities)
    return dataclasses.replace(worst, p999_rel=p999, count=sum(p.count for p in parities))


def compare(shader: np.ndarray, model: np.ndarray, floor: float, describe: Any = lambda row: {}) -> Parity:
    """Parity of values (n, 3); `describe` adds what is known of the worst row to the report."""
    difference = np.abs(shader.astype(float) - model) / np.maximum(np.abs(model), floor)
    difference = np.where(np.isfinite(shader) & np.isfinite(model), difference, np.inf)
    row, channel = np.unravel_index(np.argmax(difference), difference.shape)
    worst = {"channel": "rgb"[channel], "shader": float(shader[row, channel]), "jax": float(model[row, channel])}
    return Parity(
        float(difference.max()),
        float(np.quantile(difference, 0.999, method="higher")),  # without a mean of two, of which one may be infinite
        describe(int(row)) | worst,
        int(difference.size),
        renderer(),
    )


def shade_samples(
    shader: Shader,
    wi: np.ndarray,
    wo: np.ndarray,
    weight: np.ndarray,
    place: Place | None = None,
    maps: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """Pixels (n, 3) that the printed functions make of samples: wi and weight (n, samples, 3), wo (n, 3).

    `place` holds (n, 2) texture coordinates and (n,) distances, for a material that reads them; `maps` what a shader with maps reads from its
    textures, (n,) or (n, 3) by the name of the parameter.
    """
    attributes = {"v_wi": np.swapaxes(wi, 0, 1), "v_wo": wo, "v_weight": np.swapaxes(weight, 0, 1)}
    for name in shader.stack.reads:
        attributes[f"v_{name}"] = np.reshape(getattr(place, name), (len(wo), -1))
    for name, values in (maps or {}).items():
        attributes[f"v_{name.replace('.', '_')}"] = np.reshape(values, (len(wo), -1))
    return shade_points(shader.text(file="samples.frag"), attributes, shader.uniforms)


def check_image(image: np.ndarray, model: np.ndarray, index: np.ndarray, width: int) -> Parity:
    """Parity of an image's pixels (n, 3) with what JAX computed for them; `index` is their row-major place."""
    white = float(np.quantile(np.max(model, -1), 0.99)) or 1.0  # a black picture has no white of its own
    floor = FLOOR * white
    return compare(image, model, floor, lambda row: {"x": int(index[row] % width), "y": int(index[row] // width)})


def check_pairs(shader: Shader, count: int = 65536, seed: int = 0) -> Parity:
    """Parity of the BRDF on random and extreme pairs of directions."""
    wi, wo = random_pairs(count, seed)
    place = random_places(count, seed)
    samples = wi[:, None], wo, np.ones_like(wi)[:, None], place
    model, values = predict(shader.stack, *samples), shade_samples(shader, *samples)
    where = {name: getattr(place, name) for name in shader.stack.reads}
    describe = lambda row: {key: a[row].tolist() for key, a in {"wi": wi, "wo": wo, **where}.items()}  # noqa: E731
    return compare(values, model, FLOOR / np.pi, describe)
