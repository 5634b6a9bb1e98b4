"""Which structure the data support: candidates are fitted, and the simplest that explains the data is chosen.

What no closed form gets right is alike in neighbouring directions, so residuals are far from independent: a criterion that counts them all
would buy parameters with misfit. The effective number of residuals is that of independent ones whose mean scatters as much (Bayley and
Hammersley 1946; on surfaces Griffith 2005), from how residuals of the nearest fit go together with their distance.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from .._html import table
from ..capture.load import AnyView
from ..capture.measured.view import MeasuredView
from ..capture.samples import Samples
from ..documents import nearest
from ..errors import InputError
from .blocks import stratified
from .candidates import Candidate, candidates
from .difference import compared, curve
from .fit import fit
from .result import FitResult
from .weights import brightness, inverse_sigma

STRONG = 6.0
"""Difference of BIC from which on evidence is called strong (Kass and Raftery 1995)."""

EXPLAINED = 1e-3
"""Relative error below which nothing is left to explain: less is rounding."""

NO_BOUNDARY = 1.05
"""Index of a coat below which its boundary sends back less than a part in a thousand."""

PIXELS = 3000
"""Pixels or samples that structures are tried on, of each reference: stratified by half angle."""

STARTS = 6
PAIRED = 1500
"""Residuals whose pairs are looked at."""

BINS = 24
RETRO_DEG, RETRO_TIMES = 15.0, 1.5
"""Angle between light and view below which light comes back, and how much more of it than the model has is a finding."""


@dataclasses.dataclass(frozen=True)
class Tried:
    """One structure, fitted."""

    candidate: Candidate
    result: FitResult
    error: float
    """Relative, in the metric of the choice: root of the squared differences over the squared values, weighted alike for all structures."""
    bic: float

    @property
    def parameters(self) -> int:
        """Numbers that were fitted."""
        return self.result.free.size

    @property
    def layers(self) -> int:
        """Coats over the base."""
        return len(self.candidate.stack.layers)


@dataclasses.dataclass(frozen=True)
class StructureChoice:
    """All structures that were tried, and the one that was chosen."""

    tried: list[Tried]
    chosen: Tried
    metric: str
    residuals: int
    effective_residuals: float
    coat_gain: float
    """BIC of the best structure without a coat less that of the best one with a coat; NaN where one of the two was not tried."""
    retro: float | None
    """Light that comes back towards the light, over that of the chosen fit, where it is far more; else None."""

    def _repr_html_(self) -> str:
        """For notebooks: the structures, lowest criterion first, and which was chosen."""
        rows = [
            [
                t.candidate.words,
                str(t.layers),
                str(t.parameters),
                f"{t.error:.4g}",
                f"{t.bic:.1f}",
                "chosen" if t is self.chosen else "",
            ]
            for t in sorted(self.tried, key=lambda t: t.bic)
        ]
        return table(("structure", "coats", "parameters", "error", "BIC", ""), rows)

    @property
    def best(self) -> Tried:
        """That of the lowest BIC."""
        return min(self.tried, key=lambda t: t.bic)

    @property
    def coated(self) -> bool:
        """Whether the data support a coat."""
        return self.chosen.layers > 0

    @property
    def pareto(self) -> list[Tried]:
        """Those that none with as few parameters or fewer is nearer than."""
        order = sorted(self.tried, key=lambda t: (t.parameters, t.error))
        return [t for k, t in enumerate(order) if all(t.error < other.error for other in order[:k])]


def choose_structure(
    views: Sequence[AnyView],
    *,
    structures: Sequence[str] | None = None,
    also: Sequence[str] = (),
    each: Sequence[str] = (),
    metric: str = "log",
    seed: int = 0,
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> StructureChoice:
    """Fit candidate structures to references, renders or measured BRDFs, and choose the simplest that explains them.

    `structures` are names of candidates (left out: all). `also` and `each` are what is fitted of the lights beside each of them, as in `fit`. Of
    those within `STRONG` of the lowest BIC, the one with the fewest coats is chosen, then that with the fewest parameters. Raises `InputError` for
    a name that is not one.
    """
    thinned = [_thinned(view, seed) for view in views]
    samples = [view.samples() for view in thinned]
    results: dict[str, tuple[Candidate, FitResult]] = {}
    listed = _asked(candidates(_colour(samples)), structures, views)
    for k, candidate in enumerate(listed):
        progress(candidate.words, k / len(listed))
        if candidate.after in results:
            candidate = candidate.started_from(results[candidate.after][1].stack)
        found = fit(
            thinned,
            candidate.stack,
            free=candidate.free,
            also=also,
            each=each,
            metric=metric,
            starts=STARTS,
            seed=seed,
            where=candidate.name,
        )
        results[candidate.name] = candidate, found
    return _judged(list(results.values()), metric)


def _asked(known: list[Candidate], names: Sequence[str] | None, views: Sequence[AnyView]) -> list[Candidate]:
    """The candidates of these names; or all that can be drawn: what differs from place to place needs to know the place."""
    if names is None:
        placed = all(isinstance(view, MeasuredView) or view.uv is not None for view in views)
        return [candidate for candidate in known if placed or not candidate.stack.reads]
    by_name = {candidate.name: candidate for candidate in known}
    for name in names:
        if name not in by_name:
            raise InputError(f"structure {name!r}: should be one of {', '.join(by_name)}{nearest(name, by_name)}")
    return [candidate for candidate in known if candidate.name in names]


def _thinned(view: AnyView, seed: int) -> AnyView:
    if len(view.index) <= PIXELS:
        return view
    return view.some(np.sort(stratified(view.samples(quadrature=1), seed)[:PIXELS]))


def _colour(samples: Sequence[Samples]) -> np.ndarray:
    """A diffuse colour to start from: the median over the pixels, taken for Lambertian, within what reflects."""
    albedo = [np.pi * s.target / np.maximum(s.weight.sum(1), 1e-12) for s in samples]
    return np.clip(np.median(np.concatenate(albedo), 0), 0.02, 0.9)


def _judged(fits: list[tuple[Candidate, FitResult]], metric: str) -> StructureChoice:
    nearest_fit = min((result for _, result in fits), key=lambda r: r.misfit)
    samples = nearest_fit.samples
    weights = [inverse_sigma(m, s.target, s.noise, metric) for m, s in zip(nearest_fit.models, samples, strict=True)]
    size = np.sqrt(
        sum(np.sum(_weighted(s.target, s, w, metric).astype(float) ** 2) for s, w in zip(samples, weights, strict=True))
    )
    residuals = [_residuals(result, weights, metric) for _, result in fits]
    errors = [float(np.linalg.norm(r) / size) for r in residuals]
    least = residuals[int(np.argmin(errors))]
    count = effective(least, np.concatenate([_place(s) for s in samples]))
    tried = [
        Tried(candidate, result, error, _bic(error, result.free.size, count))
        for (candidate, result), error in zip(fits, errors, strict=True)
    ]
    chosen = _simplest(tried)
    bare, coated = ([t.bic for t in tried if (t.layers > 0) is on] for on in (False, True))
    gain = min(bare) - min(coated) if bare and coated else float("nan")
    return StructureChoice(tried, chosen, metric, least.size, count, gain, _retro(chosen.result))


def _weighted(values: np.ndarray, samples: Samples, weight: np.ndarray, metric: str) -> np.ndarray:
    return compared(values, curve(metric, brightness(samples.target))) * weight


def _residuals(result: FitResult, weights: Sequence[np.ndarray], metric: str) -> np.ndarray:
    """(n, 3) weighted differences at the pixels of all references."""
    rows = zip(result.models, result.samples, weights, strict=True)
    return np.concatenate([_weighted(m, s, w, metric) - _weighted(s.target, s, w, metric) for m, s, w in rows]).astype(float)


def _bic(error: float, parameters: int, count: float) -> float:
    """Schwarz 1978, for residuals whose variance is not known, over the effective number of them."""
    return count * np.log(max(error, EXPLAINED) ** 2) + parameters * np.log(count)


def _simplest(tried: list[Tried]) -> Tried:
    best = min(t.bic for t in tried)
    return min((t for t in tried if t.bic <= best + STRONG), key=lambda t: (t.layers, t.parameters, t.bic))


def _place(samples: Samples) -> np.ndarray:
    """(n, 2) half and difference angle, the first finer in the highlight: where residuals are alike."""
    wi = samples.wi[np.arange(len(samples.index)), np.argmax(samples.weight.sum(-1), 1)]
    h = wi + samples.wo
    half = np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2])
    difference = np.arccos(np.clip(0.5 * np.linalg.norm(h, axis=-1), 0.0, 1.0))
    return np.stack([0.5 * np.log1p(half / 0.1), difference], -1)


def effective(residuals: np.ndarray, place: np.ndarray) -> float:
    """Effective number of residuals (n, 3) at places (n, 2): n over the sum of the correlations of one with all, times that of the channels.
    All of them where there is nothing left: nothing is alike."""
    if not np.any(residuals):
        return float(residuals.size)
    some = np.random.default_rng(0).permutation(len(residuals))[:PAIRED]
    z = residuals[some] / np.maximum(np.sqrt(np.mean(residuals[some] ** 2, 0)), 1e-300)
    distance = np.linalg.norm(place[some, None] - place[None, some], axis=-1)
    upper = np.triu_indices(len(some), 1)
    distance, product = distance[upper], (z @ z.T / z.shape[1])[upper]
    edges = np.geomspace(max(float(np.quantile(distance, 1e-3)), 1e-6), float(distance.max()) * 1.001, BINS)
    place_of = np.digitize(distance, edges)
    total = np.bincount(place_of, product, minlength=BINS + 1)
    # Up to the first distance at which they are no more alike: beyond it is chance.
    end = int(np.argmax(total <= 0.0)) if np.any(total <= 0.0) else len(total)
    alike = 2.0 * float(np.sum(total[:end])) / len(some) * len(residuals) / len(some)
    channels = np.linalg.eigvalsh(z.T @ z / len(z))
    independent = float(np.sum(channels) ** 2 / np.sum(channels**2))
    return max(independent * len(residuals) / (1.0 + alike), 2.0)


def _retro(result: FitResult) -> float | None:
    """Reference over model where the view is near the light, away from the highlight, if it is far above 1."""
    ratios = []
    for model, samples in zip(result.models, result.samples, strict=True):
        wi = samples.wi[np.arange(len(samples.index)), np.argmax(samples.weight.sum(-1), 1)]
        back = np.sum(wi * samples.wo, -1) > np.cos(np.radians(RETRO_DEG))
        back &= wi[:, 2] < np.cos(np.radians(2.0 * RETRO_DEG))
        ratios.append((samples.target[back].mean(-1) + 1e-12) / (model[back].mean(-1) + 1e-12))
    every = np.concatenate(ratios)
    if len(every) < 5 or np.median(every) < RETRO_TIMES:
        return None
    return float(np.median(every))
