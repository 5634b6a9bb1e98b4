"""How near the colour of a thin film is to its spectrum, by three ways: for the choice that docs/model.md tells of.

    python tools/measure_film.py

Films of index 1.38, 1.8 and 2.4 on metals and on glass, 0 to 2000 nm thick, at cosines from .05 to 1. The truth is Airy's formula at 81
wavelengths in daylight, with the index of the channel. `polynomial` is what layerfit does. `closed form` is that of Belcour and
Barla 2017, whose constants are of light of equal energy: it is held against that. `three wavelengths` is no integral at all.

Then the polynomial alone by angle, on the metals and on a coat of index 1.5, against a product of transfer matrices that shares nothing with it.
"""

import jax
import jax.numpy as jnp
import numpy as np

from layerfit.optics.film import bake, film_reflectance
from layerfit.optics.spectra import WAVELENGTHS_NM, daylight_weights, delta_e, rgb_weights
from layerfit.surfaces.film import Baked, baked_f0, film_reflects

BELOW = {
    "steel": ([2.911, 2.95, 2.585], [3.089, 2.932, 2.767]),
    "titanium": ([2.74, 2.54, 2.27], [3.81, 3.43, 3.05]),
    "copper": ([0.201, 0.924, 1.102], [3.913, 2.453, 2.142]),
    "aluminium": ([1.34, 0.97, 0.62], [7.47, 6.4, 5.3]),
    "glass": ([1.5, 1.5, 1.5], [0.0, 0.0, 0.0]),
}
"""Indices of what lies below the film, R G B."""

FILMS = 1.38, 1.8, 2.4
THICKNESSES_NM = np.arange(0.0, 2001.0, 20.0)
COSINES = np.linspace(0.05, 1.0, 20)

SENSITIVITY = {
    "X": ((5.4856e-13, 1.6810e6, 4.3278e9), (9.7470e-14, 2.2399e6, 4.5282e9)),
    "Y": ((4.4201e-13, 1.7953e6, 9.3046e9),),
    "Z": ((5.2481e-13, 2.2084e6, 6.6121e9),),
}
"""Belcour and Barla 2017, in SI units: height, place and variance of Gaussians over wave numbers."""
FLAT = 1.0685e-7
ORDERS = 3
ANGLES_DEG = 0.0, 30.0, 60.0, 75.0, 85.0


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    daylight, even = daylight_weights(), rgb_weights("E")
    shape = len(THICKNESSES_NM), len(COSINES)
    d, c = (a.ravel() for a in np.meshgrid(THICKNESSES_NM, COSINES, indexing="ij"))
    rows: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {"polynomial": [], "closed form": [], "three wavelengths": []}
    for eta, k in BELOW.values():
        for film in FILMS:
            index = np.array(eta), np.array(k)
            wavelengths = spectral(c, film, *index, d)
            truth, truth_even = (np.clip(np.einsum("nlc,lc->nc", wavelengths, w), 0.0, 1.0) for w in (daylight, even))
            at = [int(np.argmin(np.abs(WAVELENGTHS_NM - w))) for w in (610.0, 550.0, 465.0)]
            three = np.stack([wavelengths[:, w, channel] for channel, w in enumerate(at)], -1)
            rows["polynomial"].append(compared(polynomial(film, *index).reshape(-1, 3), truth))
            rows["closed form"].append(compared(closed_form(c, film, *index, d, even), truth_even))
            rows["three wavelengths"].append(compared(three, truth))
    print(
        f"{'':<20}{'rms':>8}{'largest':>9}{'delta E':>9}{'p95':>7}{'largest':>9}   ({shape[0] * shape[1] * len(rows['polynomial'])} colours)"
    )
    for name, found in rows.items():
        report(name, found)
    by_angle(daylight)


def by_angle(daylight: np.ndarray) -> None:
    """Print the polynomial's errors at each angle."""
    cosines = np.cos(np.radians(ANGLES_DEG))
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for name, (eta, k) in BELOW.items():
        for film in FILMS:
            index = np.array(eta), np.array(k)
            for c, rgb in zip(cosines, np.swapaxes(polynomial(film, *index, cosines), 0, 1), strict=True):
                waves = transfer_matrices(c, film, index[0] + 1j * index[1], THICKNESSES_NM)
                truth = np.clip(np.einsum("nlc,lc->nc", waves, daylight), 0.0, 1.0)
                where = "coat" if name == "glass" else "metal"
                found.setdefault(f"{where}, {np.degrees(np.arccos(c)):.0f} degrees", []).append(compared(rgb, truth))
    for name in sorted(found):
        report(name, found[name])


def report(name: str, found: list[tuple[np.ndarray, np.ndarray]]) -> None:
    error, colour = (np.concatenate([f[k] for f in found]) for k in (0, 1))
    rms, most = np.sqrt(np.mean(error**2)), np.max(np.abs(error))
    print(f"{name:<20}{rms:8.4f}{most:9.3f}{np.mean(colour):9.2f}{np.quantile(colour, 0.95):7.2f}{np.max(colour):9.2f}")


def transfer_matrices(c: float, film: float, below: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Reflectance (thicknesses, 81, 3) by complex 2 x 2 matrices of both polarisations (Abeles 1950)."""
    q2, q3 = (np.sqrt(n * n - (1.0 - c) * (1.0 + c) + 0j) for n in (film, below))
    phase = 2.0 * np.pi * d[:, None, None] / WAVELENGTHS_NM[:, None] * q2
    total = 0.0
    for above, inside, under in ((c, q2, q3), (1.0 / c, film**2 / q2, below**2 / q3)):
        E = np.cos(phase) - 1j * np.sin(phase) / inside * under
        H = -1j * np.sin(phase) * inside + np.cos(phase) * under
        total = total + 0.5 * np.abs((above * E - H) / (above * E + H)) ** 2
    return total


def spectral(c: np.ndarray, film: float, eta: np.ndarray, k: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Reflectance (n, 81, 3)."""
    one = jax.vmap(
        lambda c, d, w: film_reflectance(c, jnp.asarray(film), jnp.asarray(eta), jnp.asarray(k), d / w), (None, None, 0)
    )
    return np.asarray(jax.jit(jax.vmap(one, (0, 0, None)))(c, d, WAVELENGTHS_NM))


def polynomial(film: float, eta: np.ndarray, k: np.ndarray, cosines: np.ndarray = COSINES) -> np.ndarray:
    """Reflectance (thicknesses, cosines, 3) as baked."""

    def of(d):
        baked = Baked(*bake(film, jnp.asarray(eta), jnp.asarray(k), d))
        return jax.vmap(lambda c: film_reflects(c, baked_f0(baked, c)))(jnp.asarray(cosines))

    return np.asarray(jax.jit(jax.vmap(of))(jnp.asarray(THICKNESSES_NM)))


def closed_form(c: np.ndarray, film: float, eta: np.ndarray, k: np.ndarray, d: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Belcour and Barla 2017: reflectance (n, 3), as a series of orders of interference, each integrated over Gaussians."""
    to_rgb = from_xyz(weights)
    below = eta + 1j * k
    c1 = c[:, None]
    sine2 = (1.0 - c1) * (1.0 + c1)
    q2, q3 = np.sqrt(film**2 - sine2), np.sqrt(below**2 - sine2)
    path = 2e-9 * d[:, None] * q2
    total = np.zeros((len(c), 3))
    for a, b, g in ((c1, q2, q3), (1.0 / c1, film**2 / q2, below**2 / q3)):
        r12, r23 = (a - b) / (a + b), (b - g) / (b + g)
        R12, R23 = np.abs(r12) ** 2, np.abs(r23) ** 2
        through = (1.0 - R12) ** 2 * R23 / (1.0 - R12 * R23)
        phase = np.angle(-r12) + np.angle(r23)
        total += 0.5 * (R12 + through)
        amount = through - (1.0 - R12)
        for order in range(1, ORDERS + 1):
            amount = amount * np.sqrt(R12 * R23)
            seen = sensitivity(order * path, order * phase)  # (3 of XYZ, n, channel)
            total += 0.5 * 2.0 * amount * np.einsum("cx,xnc->nc", to_rgb, seen)
    return total


def sensitivity(path: np.ndarray, phase: np.ndarray) -> np.ndarray:
    psi = 2.0 * np.pi * path
    gaussian = lambda v, p, s: v * np.sqrt(2.0 * np.pi * s) * np.cos(p * psi + phase) * np.exp(-s * psi**2)  # noqa: E731
    return np.stack([sum(gaussian(*g) for g in SENSITIVITY[axis]) for axis in "XYZ"]) / FLAT


def from_xyz(weights: np.ndarray) -> np.ndarray:
    """The matrix from XYZ of light of equal energy, white = (1, 1, 1), to the channels of these weights."""
    import colour

    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(380, 780, 5)).values
    return np.linalg.lstsq(observer / observer.sum(0), weights, rcond=None)[0].T


def compared(rgb: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Difference of reflectances and of colours."""
    rgb = np.clip(rgb, 0.0, 1.0)
    return rgb - truth, delta_e(rgb, truth)


if __name__ == "__main__":
    main()
