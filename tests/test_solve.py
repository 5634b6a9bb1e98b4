"""The solver on problems that are known, and its normal equations against derivatives taken another way."""

from functools import partial

import jax
import jax.numpy as jnp
import nist
import numpy as np
import pytest
from scipy.optimize import least_squares

from layerfit.fit.residuals import initial
from layerfit.fit.solve import NormalLevenbergMarquardt, columns, dense, descend, normal_equations, products, tangents
from layerfit.fit.uncertainty import AGREEMENT, GROUPS, estimate

pytestmark = pytest.mark.optimised

SLOTS = ((0,), (1, 2, 3), (4,))
RNG = np.random.default_rng(1)
X = RNG.uniform(0.1, 2.0, 200)


def model(fields):
    """Channels first; channel c sees channel c of the colour, and both scalars."""
    width, colour, level = fields
    return colour[:, None] * jnp.exp(-((X / width) ** 2)) + level**2 * X


def fields(u):
    return [u[at[0]] if len(at) == 1 else u[jnp.array(at)] for at in SLOTS]


TRUTH = np.array([0.7, 0.5, 1.0, 2.0, 0.3])
TARGET = np.asarray(model(fields(jnp.asarray(TRUTH)))) + 0.01 * RNG.normal(size=(3, 200))
SOLVER = NormalLevenbergMarquardt()


def residual(f, target=TARGET):
    return model(f) - target


def derivatives(residual, fields):
    """Columns of a problem whose material is its fields."""
    return columns(residual, *tangents(lambda f: f, fields))


@partial(jax.jit, static_argnames="residual")
def jacobian(u, target, residual):
    return derivatives(lambda f: residual(f, target), fields(u))


@jax.jit
def advance(y, state, bounds, total):
    fn = lambda u, args: normal_equations(total, SLOTS)  # noqa: E731
    return SOLVER.step(fn, y, None, {"lower": bounds[0], "upper": bounds[1]}, state, frozenset())[:2]


def minimise(start, lower=-np.inf, upper=np.inf, target=TARGET, residual=residual, gain=None):
    y = jnp.asarray(start, float)
    state = initial(y, gain=gain)
    path = []
    for _ in range(200):
        total = products(jacobian(state.y_eval, target, residual))
        y, state = advance(y, state, (np.full(5, lower), np.full(5, upper)), total)
        path.append(np.asarray(y))
        if state.done:
            break
    return np.asarray(y), state, np.array(path)


def test_normal_equations_are_those_of_the_dense_jacobian():
    u = jnp.array([0.6, 0.4, 0.9, 1.5, 0.5])
    r = np.asarray(residual(fields(u))).ravel()
    wanted = np.asarray(jax.jacfwd(lambda u: residual(fields(u)).ravel())(u))
    rows, at = dense(derivatives(residual, fields(u)), SLOTS)
    np.testing.assert_allclose(rows.transpose(1, 0, 2).reshape(-1, 5), wanted, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(at.T.ravel(), r)
    loss, (gradient, gram) = normal_equations(products(derivatives(residual, fields(u))), SLOTS)
    np.testing.assert_allclose(loss, 0.5 * r @ r, rtol=1e-13)
    np.testing.assert_allclose(gradient, wanted.T @ r, rtol=1e-12)
    np.testing.assert_allclose(gram, wanted.T @ wanted, rtol=1e-12, atol=1e-12)


def test_sums_of_float32_residuals_are_float64():
    u = jnp.array([0.6, 0.4, 0.9, 1.5, 0.5])
    narrow = [f.astype(np.float32) for f in fields(u)]
    sums = products(derivatives(lambda f: residual(f).astype(np.float32), narrow))
    assert sums.dtype == np.float64
    np.testing.assert_allclose(sums, products(derivatives(residual, fields(u))), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("start", [[0.3, 1.0, 1.0, 1.0, 1.0], [2.0, 0.1, 0.1, 0.1, 0.01]])
def test_the_minimum_is_that_of_scipy(start):
    u, state, _ = minimise(start)
    wanted = least_squares(lambda u: np.asarray(residual(fields(jnp.asarray(u)))).ravel(), start, xtol=1e-12, ftol=1e-12)
    assert state.done
    assert float(state.loss) == pytest.approx(wanted.cost, rel=1e-6)
    np.testing.assert_allclose(np.abs(u), np.abs(wanted.x), rtol=1e-3)


def test_a_step_that_promises_too_little_is_not_taken():
    start = [0.3, 1.0, 1.0, 1.0, 1.0]
    (_, end, path), (_, search, some) = minimise(start), minimise(start, gain=0.1)
    assert search.done
    assert len(some) < len(path)
    np.testing.assert_array_equal(some, path[: len(some)])  # the way is the same
    assert float(end.loss) <= float(search.loss) <= 1.2 * float(end.loss)


def test_bounds_always_hold_and_the_rest_is_fitted():
    start = np.array([0.3, 1.0, 1.0, 1.0, 1.0])
    u, state, path = minimise(start, lower=0.0, upper=1.2)
    wanted = least_squares(lambda u: np.asarray(residual(fields(jnp.asarray(u)))).ravel(), start, bounds=(0.0, 1.2))
    assert state.done
    assert path.min() >= 0.0
    assert path.max() <= 1.2
    assert u[3] == 1.2  # the truth, 2, lies outside
    assert float(state.loss) == pytest.approx(wanted.cost, rel=1e-4)


def test_a_step_that_the_bounds_turn_uphill_is_shortened():
    """In a narrow valley across the bounds, the cut Newton step lands on its wall; the quadratic loss is known exactly."""
    gram = jnp.array([[1.0, 0.99], [0.99, 1.0]])
    valley = jnp.array([-3.0, 3.5])
    lower, upper = jnp.array([0.0, 0.0]), jnp.array([10.0, 10.0])

    def fn(y, args):
        away = y - valley
        return 0.5 * away @ gram @ away, (gram @ away, gram)

    solver = NormalLevenbergMarquardt()
    y = jnp.array([0.4, 0.1])
    away = y - valley
    cut = jnp.clip(valley, lower, upper) - valley
    assert cut @ gram @ cut > away @ gram @ away, "the test is none: the cut step goes downhill"
    state = initial(y, 1e6)
    losses = []
    for _ in range(60):
        y, state = solver.step(fn, y, None, {"lower": lower, "upper": upper}, state, frozenset())[:2]
        losses.append(float(state.loss))
        if bool(state.done):
            break
    assert state.done
    assert np.all(np.diff(losses) <= 0.0), "a step uphill was taken"
    np.testing.assert_allclose(y, [0.0, 3.5 - 0.99 * 3.0], atol=1e-4)  # on the bound, and where the slope along it ends


@pytest.mark.parametrize("depth", [2.0, 8.0, 30.0, 90.0])
def test_a_start_below_which_nothing_is_seen_is_left(depth):
    """Slopes of exp(-90), and plain ones beside them: as of a clear coat over a base that a deep one hides."""

    def coated(f):
        width, colour, level = f
        return X / width + colour[:, None] * jnp.exp(-level * (1.0 + X))

    truth = np.array([0.7, 0.5, 1.0, 0.8, 1.0])
    target = np.asarray(coated(fields(jnp.asarray(truth))))
    start = np.array([1.5, 0.4, 0.9, 0.9, depth])
    lower, upper = np.array([0.1, 0.0, 0.0, 0.0, 0.0]), np.array([3.0, 1.0, 1.0, 1.0, 100.0])
    u, state, _ = minimise(start, lower, upper, target, lambda f, target: coated(f) - target)
    assert state.done
    np.testing.assert_allclose(u, truth, rtol=1e-4)


def test_a_descent_is_the_same_steps_in_one_call():
    start, target = [0.3, 1.0, 1.0, 1.0, 1.0], jnp.asarray(TARGET)
    bounds = np.full(5, -np.inf), np.full(5, np.inf)

    def evaluate(u, kept):
        return normal_equations(products(jacobian(u, target, residual)), SLOTS), kept + 1

    y = jnp.array(start)
    whole, state, losses, evaluations = descend(SOLVER, evaluate, y, initial(y), bounds, 40, 0)
    stepped, ended, path = minimise(start)
    taken = int(np.sum(~np.isnan(losses)))
    assert taken == evaluations == len(path)
    assert state.done
    np.testing.assert_allclose(whole, stepped, rtol=1e-10)
    assert losses[taken - 1] == pytest.approx(float(ended.loss), rel=1e-12)
    cut, state, losses, _ = descend(SOLVER, evaluate, y, initial(y), bounds, 3, 0)
    assert not state.done
    np.testing.assert_allclose(cut, path[2], rtol=1e-10)
    assert np.sum(~np.isnan(losses)) == 3


def test_units_of_the_parameters_do_not_matter():
    units = jnp.array([1.0, 1e-2, 1e3, 1.0, 1e2])
    scaled = lambda f, target: residual([a * u for a, u in zip(f, fields(units), strict=True)], target)  # noqa: E731
    plain, _, _ = minimise([0.3, 1.0, 1.0, 1.0, 1.0])
    u, _, _ = minimise(np.array([0.3, 1.0, 1.0, 1.0, 1.0]) / units, residual=scaled)
    np.testing.assert_allclose(u * units, plain, rtol=1e-4)


def test_a_trial_that_is_not_finite_is_stepped_back_from():
    cliff = lambda f, target: residual(f, target) + jnp.where(f[0] > 0.75, jnp.nan, 0.0)  # noqa: E731
    u, state, _ = minimise([0.3, 1.0, 1.0, 1.0, 1.0], residual=cliff)
    assert np.isfinite(state.loss)
    assert abs(u[0] - 0.7) < 0.02


NOISE = {
    "even": lambda rng: 0.02 * rng.normal(size=TARGET.shape),
    "uneven": lambda rng: 0.01 * X**2 * rng.normal(size=TARGET.shape),
    "the same in all channels": lambda rng: 0.02 * rng.normal(size=200) * np.ones((3, 1)),
}
"""What equal weights expect, and what they do not."""


@pytest.mark.parametrize("noise", NOISE)
def test_sigmas_are_the_scatter_of_repeated_fits(noise):
    truth = np.asarray(model(fields(jnp.asarray(TRUTH))))
    part = np.arange(200) % GROUPS
    found, sigmas = [], []
    for seed in range(100):
        target = truth + NOISE[noise](np.random.default_rng(seed))
        u, state, _ = minimise(TRUTH, target=target)
        rows = dense(jacobian(u, target, residual), SLOTS)
        found.append(u)
        sigmas.append(estimate(np.asarray(state.gram), *rows, part).sigma)
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(sigmas), 0)), np.std(found, 0), rtol=0.25)  # of a hundred: 7 %


def test_no_image_tells_more_digits_than_float32_has():
    part = np.arange(600) % 12
    found = estimate(np.array([[600.0]]), np.ones((600, 1, 1)), np.zeros((600, 1)), part)
    np.testing.assert_allclose(found.sigma, AGREEMENT)


def test_misfit_that_neighbours_share_widens_a_sigma():
    """Twelve parts that pull a mean apart, by more than the scatter of their pixels."""
    offsets = np.random.default_rng(0).normal(size=12)
    offsets -= offsets.mean()
    residual, part = np.repeat(offsets, 50)[:, None], np.repeat(np.arange(12), 50)
    found = estimate(np.array([[600.0]]), np.ones((600, 1, 1)), residual, part)
    np.testing.assert_allclose(found.sigma, np.std(offsets, ddof=1) / np.sqrt(12), rtol=0.05)


def test_an_error_that_all_pixels_have_together_is_not_averaged_away():
    rng = np.random.default_rng(0)
    residual, part = 0.1 * rng.normal(size=(600, 1)), np.arange(600) % 12
    alone = estimate(np.array([[600.0]]), np.ones((600, 1, 1)), residual, part)
    together = estimate(np.array([[600.0]]), np.ones((600, 1, 1)), residual, part, [np.full((600, 1), 0.3)])
    np.testing.assert_allclose(together.sigma, np.hypot(alone.sigma, 0.3), rtol=1e-6)


def test_where_nothing_shows_nothing_is_known():
    part = np.arange(60) % GROUPS
    found = estimate(np.zeros((2, 2)), np.zeros((60, 3, 2)), np.ones((60, 3)), part)
    assert np.all(np.isinf(found.sigma))
    assert len(found.blind) == 2


def test_a_direction_that_nothing_sees_is_named():
    gram = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    jacobian = np.repeat([[[1.0, 1.0, 0.0]], [[0.0, 0.0, 2.0**0.5]]], 12, 0) / 12**0.5
    found = estimate(gram, jacobian, np.full((24, 1), 0.1), np.arange(24) % 12)
    assert len(found.blind) == 1
    np.testing.assert_allclose(np.abs(found.blind[0]), [0.5**0.5, 0.5**0.5, 0.0], atol=1e-9)
    assert np.all(found.sigma[:2] > 10.0 * found.sigma[2]), "what is not seen is not known"


@pytest.mark.parametrize("name", nist.MODELS)
def test_a_problem_of_nist_is_what_its_file_says(name):
    """Its model at the certified values leaves the certified sum of squares."""
    problem = nist.read(name)
    assert len(problem.certified) == len(problem.starts[0]) == len(problem.starts[1])
    rss = float(np.sum(np.asarray(jax.jit(nist.residual(problem))(list(problem.certified))) ** 2))
    assert rss == pytest.approx(problem.rss, rel=1e-8, abs=1e-20)  # of eleven digits; Lanczos1 is exact but for rounding


@pytest.mark.parametrize(("name", "start"), [("Misra1a", 0), ("Nelson", 1), ("Gauss2", 0), ("Thurber", 0), ("Rat43", 0)])
def test_certified_values_of_nist_are_found(name, start):
    problem = nist.read(name)
    usual, steps, done = nist.solve(problem, problem.starts[start], nist.AS_IN_A_FIT)
    assert done
    assert steps < 60
    assert nist.digits(usual, problem.certified) > 3.5  # a step below 1e-5 is the last one
    tight, _, _ = nist.solve(problem, problem.starts[start], nist.TIGHT)
    assert nist.digits(tight, problem.certified) > 7.0  # normal equations keep half of the sixteen digits
