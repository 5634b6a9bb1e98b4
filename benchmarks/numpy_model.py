"""The corrected form of one GGX coat over a conductor in plain NumPy, float64: the peer that a fit in JAX is measured against."""

import numpy as np


def brdf(wi, wo, coat_alpha, coat_eta, tau, base_alpha, eta, k):
    """BRDF (n, 3) of directions (n, 3); scalars, and one value a channel for `tau`, `eta` and `k`."""
    h, c = _half(wi, wo)
    f = (_dielectric(c, coat_eta) * _lobe(h, wi, wo, coat_alpha))[:, None]
    i, o = _Crossing(wi, coat_alpha, coat_eta), _Crossing(wo, coat_alpha, coat_eta)
    path = 1.0 / i.w[:, 2] + 1.0 / o.w[:, 2] + 0.5 * (i.added + o.added)
    A = np.exp(-tau * path[:, None])
    throughput = (i.T * o.T / coat_eta**2)[:, None] * A
    xi, xo = _steer(i.w, 0.5 * i.drift), _steer(o.w, 0.5 * o.drift)
    h, c = _half(xi, xo)
    F = _conductor(c[:, None], eta / coat_eta, k / coat_eta)
    R = 0.5 * (2.0 - i.T - o.T)
    edge = 0.5 * sum(_edge(x.sine, x.w[:, 2], coat_eta, base_alpha) for x in (i, o))
    q = F * (R + (1.0 - R) * edge)[:, None] * A
    p = 1.34
    spread = (i.spread**p + o.spread**p) * coat_alpha**p
    lobes = 0.0
    for order in (3, 2, 1):
        width = np.minimum((spread + order * base_alpha**p + (order - 1) * coat_alpha**p) ** (1.0 / p), 1.5)
        lobe = _lobe(h, xi, xo, width)[:, None]
        lobes = lobe / (1.0 - q) if order == 3 else lobe + q * lobes
    return f + throughput * F * lobes


class _Crossing:
    def __init__(self, w, alpha, eta):
        a2 = alpha * alpha
        s2 = w[:, 0] ** 2 + w[:, 1] ** 2
        c = np.sqrt(w[:, 2] ** 2 + 1.134 * alpha**1.479 / (1.0 + 5.189 * alpha) * s2)
        g = np.sqrt(eta * eta - 1.0 + c * c)
        T = 2.0 * c * g * (1.0 / (c + g) ** 2 + eta**2 / (eta**2 * c + g) ** 2)
        self.T = T + (1.0 - T) * 4.005 * a2 / (1.0 + 9.06 * a2)
        self.sine = np.sqrt(s2)
        m = s2 / (1.0 + w[:, 2])
        self.drift = 41.0 * (eta - 1.0) / (eta - 0.93) * alpha**1.76 * m**3.16 * np.exp(-7.0 * alpha * m)
        self.added = 0.77 * (1.0 - 1.0 / eta) * a2 / (1.0 + 0.97 * a2) + self.drift
        self.spread = 0.5 * (eta * eta - 1.0) / (g * (g + c))
        self.w = np.stack([w[:, 0], w[:, 1], np.sqrt(eta * eta - 1.0 + w[:, 2] ** 2)], -1) / eta


def _steer(w, lengthening):
    z = w[:, 2] / (1.0 + lengthening * w[:, 2])
    s2 = w[:, 0] ** 2 + w[:, 1] ** 2
    ratio = np.sqrt(1.0 + lengthening * z * w[:, 2] * (w[:, 2] + z) / np.maximum(s2, 1e-30))
    return np.stack([w[:, 0] * ratio, w[:, 1] * ratio, z], -1)


def _edge(sine, cosine, n, alpha):
    m = 0.5 * (1.0 - sine) / (n * cosine)
    return 0.5 - 0.5 * m / np.sqrt(alpha * alpha + m * m)


def _half(wi, wo):
    s = wi + wo
    length = np.sqrt((s * s).sum(-1))
    return s / length[:, None], np.minimum(0.5 * length, 1.0)


def _lobe(h, wi, wo, alpha):
    """D V of the GGX distribution with separable Smith masking."""
    a2 = alpha * alpha
    e = (h[:, 0] ** 2 + h[:, 1] ** 2) / a2 + h[:, 2] ** 2
    masking = [w[:, 2] + np.sqrt(w[:, 2] ** 2 + a2 * (w[:, 0] ** 2 + w[:, 1] ** 2)) for w in (wi, wo)]
    return 1.0 / (np.pi * a2 * e * e * masking[0] * masking[1])


def _dielectric(c, eta):
    g = np.sqrt(eta * eta - 1.0 + c * c)
    rs = (c - g) / (c + g)
    rp = (eta * eta * c - g) / (eta * eta * c + g)
    return 0.5 * (rs * rs + rp * rp)


def _conductor(c, eta, k):
    c2, s2 = c * c, 1.0 - c * c
    p = eta * eta - k * k - s2
    q = np.sqrt(p * p + 4.0 * (eta * k) ** 2)
    a = np.sqrt(0.5 * (q + p))
    rs = (q + c2 - 2.0 * a * c) / (q + c2 + 2.0 * a * c)
    rp = rs * (q * c2 + s2 * s2 - 2.0 * a * c * s2) / (q * c2 + s2 * s2 + 2.0 * a * c * s2)
    return 0.5 * (rs + rp)
