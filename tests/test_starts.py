"""Which minima starts lead to, on a landscape whose minima are known."""

import dataclasses

import numpy as np
import pytest

from helpers import COPPER, sphere_view
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.fit.parameters import parametrise
from layerfit.fit.result import FitResult, minima, to_json
from layerfit.fit.starts import SIGHT, Minimum, distinct, in_sight, search, space_filling
from layerfit.fit.words import other_minima
from layerfit.layers import Coat
from layerfit.stack import Stack
from layerfit.surfaces import Conductor

VALLEYS = {0.0: 1.0, 5.0: 1.2, -5.0: 3.0}
"""Bottoms of a landscape of three parabolas, with their costs."""


def descend(at, stage):
    """Half of the way to the nearest bottom in a few steps, all of it in many."""
    return (downhill(point, stage) for point in at)


def downhill(at, stage):
    bottom = min(VALLEYS, key=lambda b: abs(b - at.vector[0]))
    u = bottom + (at.vector - bottom) * (0.5 if stage == "coarse" else 0.0)
    return dataclasses.replace(at, vector=u, cost=VALLEYS[bottom] + float((u[0] - bottom) ** 2), gram=np.array([[2.0]]))


def test_starts_of_one_valley_are_one_minimum():
    points = [np.array([x]) for x in (0.1, 4.8, -0.1, -4.9, 5.1, 0.05)]
    found = search(points, descend, 0.0, lambda share: None)
    assert [m.vector[0] for m in found] == [0.0, 5.0, -5.0]
    assert [sorted(m.starts) for m in found] == [[0, 2, 5], [1, 4], [3]]
    assert [m.over for m in found] == [1.0, 1.2, 3.0]
    assert [m.vector[0] for m in in_sight(found)] == [0.0, 5.0]


def test_two_points_are_one_minimum_where_neither_curvature_says_otherwise():
    flat = Minimum((0,), np.zeros(2), 1.0, np.diag([1.0, 0.0]))
    along = Minimum((1,), np.array([0.0, 9.0]), 1.0, np.diag([1.0, 0.0]))
    across = Minimum((2,), np.array([0.0, 9.0]), 1.0, np.diag([1.0, 1.0]))
    assert len(distinct([flat, along], 0.0)) == 1
    assert len(distinct([flat, across], 0.0)) == 2
    assert len(distinct([flat, across], 100.0)) == 1


def test_starts_fill_the_ranges_evenly():
    stack = Stack((Coat(alpha=0.1, tau=0.3),), Conductor(alpha=0.2, **COPPER))
    _, free = parametrise(stack, None, (), "test")
    points = np.array(space_filling(free, 64, 0))
    lower, upper = free.bounds()
    assert np.all((lower < points) & (points < upper))
    for column in points.T:
        counts, _ = np.histogram(column, 8)
        assert counts.min() >= 4  # of eight; random points leave fewer somewhere, seven times of ten


FILM = Stack((Coat(alpha=0.2, eta=1.5, film_nm=120.0, film_eta=2.0),), Conductor(alpha=0.3, **COPPER))


@pytest.fixture(scope="module")
def view(tmp_path_factory):
    return sphere_view(FILM, tmp_path_factory.mktemp("film"), 32)


@pytest.fixture(scope="module")
def found(view) -> FitResult:
    """A film from a start at the far end of its range: interference has a minimum an order."""
    far = dataclasses.replace(FILM, layers=(dataclasses.replace(FILM.layers[0], film_nm=700.0),))
    return fit([view], far, free=["coat.film_nm", "coat.alpha"])


def test_the_order_of_a_film_is_found_from_another(found):
    np.testing.assert_allclose(found.stack.layers[0].film_nm, 120.0, rtol=1e-3)
    np.testing.assert_allclose(found.stack.layers[0].alpha, 0.2, rtol=1e-3)


def test_every_start_is_accounted_for(found):
    rows = minima(found)
    assert sorted(k for row in rows for k in row["starts"]) == list(range(8))
    assert rows[0]["cost_over_best"] == 1.0
    np.testing.assert_allclose(rows[0]["values"]["coat.film_nm"], 120.0, rtol=1e-3)


def test_other_minima_are_shown_with_their_values_and_flagged_in_sight(found):
    """Another order, of another error."""
    near = dataclasses.replace(found.minima[0], starts=(7,), over=1.1 * 1.1, ended=True)
    result = dataclasses.replace(found, minima=[found.minima[0], near])
    document = to_json(result, {}, None, {}, "preset.json")
    assert "other_minimum" in document["flags"]
    (line,) = other_minima(document["minima"])
    assert line.startswith("1.1 (1 start): coat.alpha ")
    far = dataclasses.replace(near, over=SIGHT + 0.01)
    result = dataclasses.replace(found, minima=[found.minima[0], far])
    assert "other_minimum" not in to_json(result, {}, None, {}, "preset.json")["flags"]


def test_a_start_at_which_a_parameter_has_no_effect_is_no_end(view):
    """An opaque coat hides its base; other starts look through it."""
    opaque = dataclasses.replace(FILM, layers=(dataclasses.replace(FILM.layers[0], tau=np.full(3, 40.0)),))
    free = ["coat.alpha", "coat.tau", "base.alpha"]
    result = fit([view], opaque, free=free)
    np.testing.assert_allclose(result.stack.base.alpha, 0.3, rtol=5e-3)
    np.testing.assert_allclose(result.stack.layers[0].tau, 0.0, atol=2e-3)
    with pytest.raises(InputError, match=r"coat\.tau, base\.alpha have no effect on this image at the start"):
        fit([view], opaque, free=free, starts=1)
