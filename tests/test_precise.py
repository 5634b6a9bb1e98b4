"""The precise form: its values with linear tables, its tables in use, its distance from the random walk, its derivatives."""

import functools
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers import COPPER, brdf_rows, direction, hemisphere, varnish, with_slope
from layerfit.errors import InputError
from layerfit.forms import bounces, corrected, curves, one_coat, precise, tables
from layerfit.forms.one_coat import Crossing, Prepared
from layerfit.forms.precise import Precise, refuses
from layerfit.layers import Coat
from layerfit.optics.interface import facet_cosine, facet_tilt, rough_transmittance, second_facet
from layerfit.preset import preset_of, stack_of
from layerfit.render import brdf
from layerfit.stack import Stack
from layerfit.surfaces import Conductor, Dielectric, Lambert, OrenNayar
from layerfit.walk import walk_rows


def linear(x, nodes):
    """Weights of the values at `nodes` in their linear interpolant at x."""
    x = np.clip(x, nodes[0], nodes[-1])
    k = min(np.searchsorted(nodes, x, side="right") - 1, len(nodes) - 2)
    weight = np.zeros(len(nodes))
    weight[k + 1] = (x - nodes[k]) / (nodes[k + 1] - nodes[k])
    weight[k] = 1.0 - weight[k + 1]
    return weight


class Linear:
    """What an interface does, by linear look-up of given tables."""

    def __init__(self, values, eta, alpha, const):
        self.tables = {key: np.array(value) for key, value in values.items()}
        self.eta, self.alpha, self.const = eta, alpha, const

    def look(self, name, x, nodes="mu"):
        t = self.tables
        plane = np.einsum("e,a,eam->m", linear(self.eta, t["eta"]), linear(self.alpha, t["alpha"]), t[name])
        return plane @ linear(x, t[nodes])

    def cross(self, w):
        w, eta = np.array(w), self.eta
        mu, sine = w[2], np.hypot(w[0], w[1])
        closed = rough_transmittance(
            facet_cosine(jnp.asarray(w), facet_tilt(jnp.asarray(self.alpha))),
            jnp.asarray(eta),
            second_facet(jnp.asarray(self.alpha)),
        )
        T = np.clip(float(closed) + self.look("dT", mu), 0.0, 1.0)
        bent = min(sine / eta * (1.0 + self.const["st"] * (self.look("rx", mu) - 1.0)), 0.9998)
        xy = bent * w[:2] / max(sine, 1e-30)
        spread = self.const["wid"] * self.look("w", mu) * self.alpha
        mean, theta = curves.inverse_gaussian(self.look("kt", mu), np.exp(self.look("lt", mu)))
        values = T, spread, 1.0 + mean, theta, 0.0
        return Crossing(jnp.array([*xy, np.sqrt(1.0 - bent**2)]), *map(jnp.asarray, values), jnp.asarray(w))

    def returned(self, tau):
        x, weight = np.polynomial.legendre.leggauss(64)
        x = 0.5 * (x + 1.0)
        return float(
            sum(w * u * np.exp(-2.0 * tau / u) * self.look("Rb", u, "mu_below") for u, w in zip(x, weight, strict=True))
        )


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_light_of_a_diffuse_base_with_linear_tables_is_that_of_the_oracle(oracle, interface):
    """But for the distribution of paths: theirs is a Gamma's, of the same mean of exp(-tau u) at two depths."""
    data = json.loads((oracle / "interface_tables.json").read_text())
    as_array = lambda layer: jax.tree.map(lambda v: jnp.asarray(v, float), layer)  # noqa: E731
    found = []
    for case in json.loads((oracle / "precise_cases.json").read_text())["cases"]:
        c, b = case["coat"], case["base"]
        if b["kind"] != "lambert" or case["interface"] != interface:
            continue
        top = Linear(data[case["interface"]], c["ior"], c["a"], data["const"])
        coat = as_array(Coat(alpha=c["a"], eta=c["ior"], tau=c["tau"]))
        prepared = Prepared(coat, None, as_array(Lambert(albedo=b["rho"])), jnp.asarray(top.returned(c["tau"])), None, None)
        value = one_coat.below(top.cross(case["wi"]), top.cross(case["wo"]), prepared)
        found.append(abs(float(value) / float(case["f_sub"]) - 1.0))
    assert len(found) == 40
    assert np.median(found) < 1e-3
    assert np.quantile(found, 0.9) < 0.02


@functools.cache
def errors(oracle, interface, kind):
    """Relative error of the light from below the coat, by row of the walk, and the width of the base."""
    chosen = json.loads((oracle / "walk_truth.json").read_text())["rows"]
    chosen = [r for r in chosen if r["interface"] == interface and r["base"]["kind"] == kind]
    column = lambda of: jnp.array([of(r) for r in chosen])  # noqa: E731
    coat = Coat(
        alpha=column(lambda r: r["coat"]["a"]), eta=column(lambda r: r["coat"]["ior"]), tau=column(lambda r: r["coat"]["tau"])
    )
    if kind == "lambert":
        base = Lambert(albedo=column(lambda r: r["base"]["rho"]))
        width = np.ones(len(chosen))
    else:
        base = Conductor(
            **{key: column(lambda r, k=k: r["base"][k]) for key, k in {"alpha": "a", "eta": "n", "k": "k"}.items()}
        )
        width = np.asarray(base.alpha)
    stack = Stack((coat,), base, Precise(interface))

    def row(stack, wi, wo):
        p = stack.prepare()
        i = one_coat.pass_interface(p.interface, p.coat.eta, p.coat.alpha, wi)
        cross = lambda w: one_coat.pass_interface(p.interface, p.coat.eta, p.coat.alpha, w)  # noqa: E731
        return jax.vmap(lambda w: one_coat.below(i, cross(w), p))(wo)

    wo, truth = column(lambda r: r["wos"]), np.asarray(column(lambda r: r["f_sub"]))
    f = np.asarray(jax.jit(jax.vmap(row))(stack, column(lambda r: r["wi"]), wo))
    mu = np.asarray(wo[..., 2])
    return np.sum(np.abs(f - truth) * mu, 1) / np.sum(truth * mu, 1), width


@pytest.mark.parametrize(
    ("interface", "kind", "narrow", "p50", "p90"),
    [
        ("single", "lambert", False, 0.01, 0.02),
        ("multi", "lambert", False, 0.01, 0.02),
        ("single", "conductor", False, 0.03, 0.11),
        ("multi", "conductor", False, 0.03, 0.11),
        ("single", "conductor", True, 0.035, 0.15),
        ("multi", "conductor", True, 0.035, 0.18),
    ],
)
def test_it_is_near_to_the_walk(oracle, interface, kind, narrow, p50, p90):
    error, width = errors(oracle, interface, kind)
    error = error[width < 0.2] if narrow else error
    assert np.median(error) <= p50
    assert np.quantile(error, 0.9) <= p90


def brushed(x, y):
    return Stack(
        (varnish(alpha=None, alpha_x=x, alpha_y=y),),
        Conductor(alpha=None, alpha_x=2.0 * y, alpha_y=2.0 * x, **COPPER),
        Precise(),
    ).astype(np.float64)


def test_axes_of_one_width_are_one_width():
    wi, wo = hemisphere(256, 3), hemisphere(256, 4)
    plain = Stack((varnish(),), Conductor(alpha=0.2, **COPPER), Precise()).astype(np.float64)
    np.testing.assert_allclose(brdf_rows(brushed(0.1, 0.1), wi, wo), brdf_rows(plain, wi, wo), rtol=1e-9)


def test_axes_are_alike():
    wi, wo = hemisphere(256, 3), hemisphere(256, 4)
    swapped = [w[:, [1, 0, 2]] for w in (wi, wo)]
    np.testing.assert_allclose(brdf_rows(brushed(0.05, 0.2), *swapped), brdf_rows(brushed(0.2, 0.05), wi, wo), rtol=1e-9)


@functools.cache
def walked_axes():
    """Materials whose widths differ by axis, directions about the mirror's, and light from below the coat by the walk."""
    rng = np.random.default_rng(8)
    count, views = 40, 6
    wide = lambda low, high: np.exp(rng.uniform(np.log(low), np.log(high), count)).repeat(views)  # noqa: E731
    number = lambda low, high: rng.uniform(low, high, count).repeat(views)  # noqa: E731
    coat = Coat(
        alpha=None,
        alpha_x=wide(0.03, 0.4),
        alpha_y=wide(0.03, 0.4),
        eta=number(1.3, 1.9),
        tau=number(0.0, 1.0),
        masking="smith_separable",
    )
    base = Conductor(alpha=None, alpha_x=wide(0.08, 0.6), alpha_y=wide(0.08, 0.6), eta=number(0.2, 1.5), k=number(2.0, 5.0))
    wi = hemisphere(count, 5).repeat(views, 0)
    wo = wi * [-1.0, -1.0, 1.0] + 0.25 * rng.normal(size=wi.shape)
    wo[:, 2] = np.maximum(np.abs(wo[:, 2]), 0.15)
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    f = walk_rows(Stack((coat,), base), wi, wo, paths=4000, seed=1).mean.mean(-1)
    return coat, base, wi, wo, f.reshape(count, views)


def distance(form, options):
    """Relative error of each of them."""
    coat, base, wi, wo, f = walked_axes()

    def one(coat, base, wi, wo):
        prepared = form.prepare((coat,), base, options)
        return form.evaluate(prepared, wi, wo, options) - coat.evaluate(wi, wo)

    found = np.asarray(jax.jit(jax.vmap(one))(coat, base, wi, wo)).reshape(f.shape)
    mu = wo[:, 2].reshape(f.shape)
    return np.sum(np.abs(found - f) * mu, 1) / np.sum(f * mu, 1)


@pytest.mark.optimised(1)
def test_axes_are_near_to_the_walk():
    error, plain = distance(precise, Precise()), distance(corrected, corrected.Corrected())
    assert np.median(error) <= 0.06
    assert np.quantile(error, 0.9) <= 0.15
    for q in (0.5, 0.9):
        assert np.quantile(error, q) < 0.6 * np.quantile(plain, q)


@pytest.mark.parametrize("interface", ["single", "multi"])
def test_the_baked_curves_are_the_tables(interface):
    """At the nodes of the tables, where the interpolation is exact, what is left is the error of the polynomials.

    Nearer to index 1 than 1.03 the curves are too steep for them at grazing angles.
    """
    t = tables.load(interface)
    worst: dict[str, list[float]] = {"T": [], "path": [], "spread": []}
    for e in range(2, len(t.eta), 2):
        for a in range(0, len(t.alpha), 3):
            eta, alpha = (jnp.asarray(float(x)) for x in (t.eta[e], t.alpha[a]))
            baked, _ = curves.bake(eta, alpha, interface)
            mu = t.mu.astype(float)
            w = jnp.stack([jnp.sqrt(1.0 - mu**2), 0.0 * mu, mu], -1)
            found = jax.vmap(lambda w, baked=baked, eta=eta, alpha=alpha: one_coat.pass_interface(baked, eta, alpha, w))(w)
            closed = jax.vmap(
                lambda w, eta=eta, alpha=alpha: rough_transmittance(
                    facet_cosine(w, facet_tilt(alpha)), eta, second_facet(alpha)
                )
            )(w)
            wanted = {
                "T": np.clip(closed + t.dT[e, a], 0, 1),
                "path": 1.0 + curves.inverse_gaussian(t.kt[e, a], np.exp(t.lt[e, a]))[0],
                "spread": curves.WIDTH * alpha * t.w[e, a],
            }
            for name, value in {"T": found.T, "path": found.path, "spread": found.a}.items():
                scale = 1.0 if name == "T" else wanted[name]
                worst[name].append(float(np.max(np.abs(value - wanted[name]) / scale)))
    assert max(worst["T"]) < 3e-3
    assert np.median(worst["path"]) < 2e-3
    assert np.median(worst["spread"]) < 0.01


def test_sums_of_powers_have_their_derivatives():
    """They are solutions of y = x + M y."""
    draw = np.random.default_rng(0).random
    M, x, dM, dx = 0.13 * draw((6, 6)), draw(6), draw((6, 6)), draw(6)
    assert np.max(np.abs(np.linalg.eigvals(M))) > 0.3
    total, slope = jax.jvp(bounces.sum_of_powers, (M, x), (dM, dx))
    inverse = np.linalg.inv(np.eye(6) - M)
    np.testing.assert_allclose(total, inverse @ x, rtol=1e-12)
    np.testing.assert_allclose(slope, inverse @ (dx + dM @ inverse @ x), rtol=1e-12)


@pytest.mark.parametrize("alpha", [0.02, 0.3, 1.0])
def test_facets_in_sight_mirror_a_direction(alpha):
    """Cosines of facets and of what they reflect are those of vectors: a direction on a stretched sphere, a point of its cap, and their sum."""
    u, _ = np.polynomial.legendre.leggauss(bounces.RINGS)
    ring, phi = (
        np.repeat(0.5 * (u + 1.0), bounces.SPOKES),
        np.tile((np.arange(bounces.SPOKES) + 0.5) * np.pi / bounces.SPOKES, len(u)),
    )
    stretch = np.array([alpha, alpha, 1.0])
    directions = np.array([direction(theta) for theta in (84.0, 60.0, 18.0)])
    cosines, mirrored, weight = bounces.facets(directions[:, 2], np.full(3, alpha))
    for w, c, out, seen in zip(directions, cosines, mirrored, weight, strict=True):
        there = w * stretch / np.linalg.norm(w * stretch)
        cap = (1.0 - ring) * (1.0 + there[2]) - there[2]
        radius = np.sqrt(1.0 - cap * cap)
        h = (np.stack([radius * np.cos(phi), radius * np.sin(phi), cap], -1) + there) * stretch
        h /= np.linalg.norm(h, axis=-1, keepdims=True)
        np.testing.assert_allclose(c, h @ w, rtol=1e-12)
        reflected = 2.0 * (h @ w) * h[:, 2] - w[2]
        np.testing.assert_allclose(out, np.where(reflected > 1e-3, reflected, 1.0), rtol=1e-9)
        assert np.array_equal(seen > 0.0, reflected > 1e-3)


def test_interpolation_is_smooth_and_exact_for_parabolas():
    nodes = np.array([1.0, 1.3, 1.4, 2.0, 2.5])
    x = jnp.linspace(1.0, 2.5, 301)
    weights = jax.vmap(lambda x: curves._cubic(x, nodes))(x)
    np.testing.assert_allclose(weights @ (nodes**2 - nodes), x**2 - x, rtol=1e-12)
    slope = jax.vmap(jax.grad(lambda x: curves._cubic(x, nodes) @ jnp.sin(3.0 * nodes)))
    below, above = slope(jnp.asarray(nodes[1:-1] - 1e-9)), slope(jnp.asarray(nodes[1:-1] + 1e-9))
    np.testing.assert_allclose(below, above, atol=1e-6)


def grazing_pairs():
    """Pairs of directions, of which many graze the surface."""
    wi, wo = hemisphere(256, 3), hemisphere(256, 4)
    cosine = np.geomspace(1e-3, 1.0, 256)
    lowered = lambda w, c: np.c_[w[:, :2] * np.sqrt((1.0 - c**2) / np.sum(w[:, :2] ** 2, 1))[:, None], c]  # noqa: E731
    return np.r_[wi, lowered(wi, cosine), lowered(wi, cosine)], np.r_[wo, wo, lowered(wo, cosine[::-1])]


@pytest.mark.parametrize("interface", ["single", "multi"])
@pytest.mark.parametrize(
    "base", [Conductor(alpha=0.3, **COPPER), Lambert(albedo=0.7), OrenNayar(albedo=0.7)], ids=lambda b: b.name
)
def test_a_coat_that_is_not_there_changes_nothing(interface, base):
    """Index 1: what is below it alone, and what the medium takes of a straight way, down to grazing angles."""
    wi, wo = grazing_pairs()
    bare = brdf_rows(Stack((), base).astype(np.float64), wi, wo)
    for tau in (None, 0.0, 0.3):
        coated = Stack((Coat(alpha=0.2, eta=1.0, tau=tau),), base, Precise(interface)).astype(np.float64)
        left = np.exp(-(tau or 0.0) * (1.0 / wi[:, 2:] + 1.0 / wo[:, 2:]))
        np.testing.assert_allclose(brdf_rows(coated, wi, wo), bare * left, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("interface", ["single", "multi"])
@pytest.mark.parametrize("base", [Conductor(alpha=0.3, **COPPER), Lambert(albedo=0.7)], ids=lambda b: type(b).__name__)
def test_a_coat_goes_as_its_step_of_the_index_does(interface, base):
    wi, wo = grazing_pairs()
    seen = np.minimum(wi[:, 2], wo[:, 2]) > 0.02
    wi, wo = wi[seen], wo[seen]
    bare = brdf_rows(Stack((), base).astype(np.float64), wi, wo)
    off = []
    for step in (1e-4, 1e-5, 1e-6):
        coat = Coat(alpha=0.2, eta=1.0 + step, tau=None)
        stack = Stack((coat,), base, Precise(interface)).astype(np.float64)
        off.append(np.max(np.abs(brdf_rows(stack, wi, wo) / bare - 1.0)))
    assert off[1] < 0.2 * off[0]
    assert off[2] < 0.2 * off[1]
    assert off[2] < 0.01


@functools.cache
def walked_near_one(interface, eta):
    """Metals below coats that hardly refract, directions about the mirror's, and light from below the coat by the walk."""
    rng = np.random.default_rng(11)
    count, views = 24, 6
    spread = lambda low, high: np.exp(rng.uniform(np.log(low), np.log(high), count)).repeat(views)  # noqa: E731
    number = lambda low, high: rng.uniform(low, high, count).repeat(views)  # noqa: E731
    coat = Coat(alpha=spread(0.03, 0.6), eta=np.full(count * views, eta), tau=number(0.0, 1.0), masking="smith_separable")
    base = Conductor(alpha=spread(0.1, 0.6), eta=number(0.2, 1.5), k=number(2.0, 5.0))
    theta = np.radians(rng.uniform(0.0, 75.0, count))
    wi = np.stack([np.sin(theta), np.zeros(count), np.cos(theta)], -1).repeat(views, 0)
    wo = wi * [-1.0, -1.0, 1.0] + 0.25 * rng.normal(size=wi.shape)
    wo[:, 2] = np.maximum(np.abs(wo[:, 2]), 0.15)
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    f = walk_rows(Stack((coat,), base), wi, wo, paths=4000, seed=1, interface=interface).mean.mean(-1)
    return coat, base, wi, wo, f.reshape(count, views)


@pytest.mark.optimised(1)
@pytest.mark.parametrize("interface", ["single", "multi"])
@pytest.mark.parametrize("eta", [1.005, 1.02, 1.1])
def test_near_index_1_it_is_near_to_the_walk(interface, eta):
    coat, base, wi, wo, f = walked_near_one(interface, eta)

    def one(coat, base, wi, wo):
        prepared = precise.prepare((coat,), base, Precise(interface))
        return precise.evaluate(prepared, wi, wo, Precise(interface)) - coat.evaluate(wi, wo)

    found = np.asarray(jax.jit(jax.vmap(one))(coat, base, wi, wo)).reshape(f.shape)
    mu = wo[:, 2].reshape(f.shape)
    error = np.sum(np.abs(found - f) * mu, 1) / np.sum(f * mu, 1)
    assert np.median(error) <= 0.03
    assert np.quantile(error, 0.9) <= 0.1


@pytest.mark.parametrize("base", [Conductor(alpha=0.3, **COPPER), Lambert(albedo=0.7)], ids=lambda b: type(b).__name__)
@pytest.mark.parametrize(("absent", "tolerance"), [("outer", 2e-3), ("inner", 5e-4)])
def test_of_two_coats_one_that_is_not_there_changes_nothing(absent, tolerance, base):
    """No step of the index at its top and no absorption: the other coat alone, but for energies between their nodes and the bound of paths."""
    wi, wo = hemisphere(256, 3), hemisphere(256, 4)
    coat = varnish(alpha=0.15, eta=1.6, tau=None)
    one = brdf_rows(Stack((coat,), base, Precise("multi")).astype(np.float64), wi, wo)
    gone = Coat(name="gone", alpha=0.4, eta=1.0 if absent == "outer" else 1.6)
    layers = (gone, coat) if absent == "outer" else (coat, gone)
    two = brdf_rows(Stack(layers, base, Precise("multi")).astype(np.float64), wi, wo)
    np.testing.assert_allclose(two, one, rtol=tolerance)


def walked_two():
    """Two coats at random over metals, the inner one denser or rarer; directions, and light from below their top by the walk."""
    rng = np.random.default_rng(9)
    count, views = 30, 6
    number = lambda low, high: rng.uniform(low, high, count).repeat(views)  # noqa: E731
    coats = tuple(
        Coat(name=name, alpha=number(0.05, 0.4), eta=number(1.3, 2.0), tau=number(0.0, 1.0), masking="smith_separable")
        for name in ("coat", "primer")
    )
    base = Conductor(alpha=number(0.1, 0.6), eta=number(0.2, 1.5), k=number(2.0, 5.0))
    wi, wo = (hemisphere(count * views, seed) for seed in (5, 6))
    wi = wi[::views].repeat(views, 0)
    f = walk_rows(Stack(coats, base), wi, wo, paths=3000, seed=1).mean.mean(-1)
    return coats, base, wi, wo, f.reshape(count, views)


@pytest.mark.optimised(1)
def test_two_coats_are_near_to_the_walk():
    coats, base, wi, wo, f = walked_two()
    mu = wo[:, 2].reshape(f.shape)

    def error(form, options):
        def one(coats, base, wi, wo):
            return form.evaluate(form.prepare(coats, base, options), wi, wo, options) - coats[0].evaluate(wi, wo)

        found = np.asarray(jax.jit(jax.vmap(one))(coats, base, wi, wo)).reshape(f.shape)
        return np.sum(np.abs(found - f) * mu, 1) / np.sum(f * mu, 1)

    near, plain = error(precise, Precise()), error(corrected, corrected.Corrected())
    assert np.median(near) <= 0.06
    for q in (0.5, 0.9):
        assert np.quantile(near, q) < 0.7 * np.quantile(plain, q)


def test_it_refuses_what_it_is_not_for():
    coat, metal = Coat(), Conductor(alpha=0.2, **COPPER)
    assert refuses((coat,), metal) is None
    assert refuses((coat,), OrenNayar()) is None
    assert refuses((coat, coat), metal) is None
    for layers, base in [
        ((), metal),
        ((coat, coat, coat), metal),
        ((coat, Coat(name="primer", alpha=None, alpha_x=0.1, alpha_y=0.2)), metal),
        ((coat, Coat(name="primer", distribution="beckmann")), metal),
        ((coat, Coat(name="primer", tau_s=0.5)), metal),
        ((coat, coat), Conductor(alpha=None, alpha_x=0.1, alpha_y=0.2, **COPPER)),
        ((coat,), Conductor(alpha=0.2, distribution="beckmann", **COPPER)),
        ((coat,), Dielectric(alpha=0.2, eta=1.5)),
    ]:
        assert refuses(layers, base)
        if layers:
            with pytest.raises(ValueError, match="precise form is not for this material"):
                Stack(layers, base, Precise()).astype(np.float32).prepare()


METAL = {"type": "conductor", "alpha": 0.2, "eta": [0.2, 0.9, 1.1], "k": [3.9, 2.5, 2.1]}


def test_it_is_the_default_where_the_structure_allows_it():
    assert stack_of({"layers": [{"type": "coat"}], "base": METAL}, "here").form == Precise("single")
    assert not isinstance(stack_of({"base": METAL}, "here").form, Precise)
    brushed = {"type": "coat", "alpha_x": 0.1, "alpha_y": 0.2}
    assert stack_of({"layers": [brushed], "base": METAL}, "here").form == Precise("single")
    assert not isinstance(stack_of({"layers": [brushed], "base": METAL | {"distribution": "beckmann"}}, "here").form, Precise)


def test_its_interface_is_kept_in_a_preset_and_checked():
    stack = stack_of({"model": "precise", "interface": "multi", "layers": [{"type": "coat"}], "base": METAL}, "here")
    document = preset_of(stack, "copper")
    assert (document["model"], document["interface"]) == ("precise", "multi")
    with pytest.raises(InputError, match="single or multi"):
        stack_of({"interface": "double", "layers": [{"type": "coat"}], "base": METAL}, "here")
    with pytest.raises(InputError, match='of model = "precise"'):
        stack_of({"model": "corrected", "interface": "multi", "layers": [{"type": "coat"}], "base": METAL}, "here")
    with pytest.raises(InputError, match="not for this material: there is no coat"):
        stack_of({"model": "precise", "base": METAL}, "here")


@pytest.mark.parametrize("indices", [(1.000002,), (1.0, 1.0), (1.5, 1.0), (1.0, 1.000002)])
def test_grazing_light_near_index_1_has_its_digits(indices):
    """Both the squared cosine and what refraction adds to it are some 1e-6 there: as a sine of nearly 1 neither has digits."""
    coats = tuple(Coat(name=f"coat {k}", alpha=0.1, eta=n, tau=0.02) for k, n in enumerate(indices))
    stack = Stack(coats, Conductor(alpha=0.2, eta=0.2, k=3.5), Precise()).astype(np.float32)
    wi, wo = (np.float32([direction(*angles)]) for angles in ((89.9, 20.0), (35.0, 170.0)))
    double = jax.tree.map(lambda x: np.asarray(x, float), (stack, wi, wo))
    with jax.enable_x64(False):
        found = np.asarray(brdf_rows(stack, wi, wo))
    np.testing.assert_allclose(found, brdf_rows(*double), rtol=5e-5)


@pytest.mark.parametrize("eta", [1.0, 1.5])
def test_the_narrowest_lobes_have_derivatives_in_single_precision(eta):
    """Their squared width at grazing angles is some 1e-14, and the square of that, by which a quotient is differentiated, is next to 0."""
    stack = Stack((Coat(alpha=1e-3, eta=eta, tau=0.1),), Conductor(alpha=1e-3, eta=0.2, k=3.5), Precise()).astype(np.float32)
    theta = np.radians([0.0, 60.0, 89.0, 89.9, 89.99])
    wi = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], -1).astype(np.float32)
    with jax.enable_x64(False):
        f, slope = with_slope(lambda stack: brdf(stack, wi, wi * np.float32([-1, -1, 1])), stack)
    assert np.all(np.isfinite(f))
    assert np.all(np.isfinite(slope))
