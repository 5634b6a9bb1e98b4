"""Writers of measured BRDFs, small ones, from any function of directions: for tests of their readers."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

Brdf = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""wi and wo (n, 3) to f (n, 3) [1/sr]."""


def polar(theta, phi):
    """Directions (n, 3) at angles [rad]."""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def write_table(path: Path, brdf: Brdf, wi: np.ndarray, wo: np.ndarray) -> None:
    """A CSV of these pairs."""
    rows = np.concatenate([wi, wo, brdf(wi, wo)], -1)
    np.savetxt(path, rows, delimiter=",", comments="", header="wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,f_r,f_g,f_b")


def write_cornell(
    path: Path, spectrum: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """A gonioreflectometer's text file; `spectrum` gives (n, w) values at wavelengths (w,). Returns wi and wo."""
    wavelengths = np.arange(400.0, 701.0, 10.0)
    theta_i, theta_o, phi_o = (
        a.ravel()
        for a in np.meshgrid(
            np.radians([10.0, 30.0, 50.0, 70.0]), np.linspace(0.0, 1.3, 9), np.linspace(0.1, 3.1, 7), indexing="ij"
        )
    )
    wi, wo = polar(theta_i, 0.0 * theta_i), polar(theta_o, phi_o)
    rows = np.stack([theta_i, 0.0 * theta_i, theta_o, phi_o], -1)
    with path.open("w") as file:
        file.write("# A paint\n# num wls\n31\n\n# wls\n" + " ".join(f"{w:g}" for w in wavelengths) + "\n\n# theta i\n")
        np.savetxt(file, np.concatenate([rows, spectrum(wi, wo, wavelengths)], -1), fmt="%.9g")
    return wi, wo


def write_merl(path: Path, brdf: Brdf, shape: tuple[int, int, int]) -> None:
    """A MERL table of any size; cells below the horizon hold -1."""
    half, difference, turn = np.meshgrid(*((np.arange(n) + 0.5) / n for n in shape), indexing="ij")
    theta_h = 0.5 * np.pi * half.ravel() ** 2
    # Rusinkiewicz 1998: light and view in the frame of the half vector, then that frame turned into the surface's.
    light = polar(0.5 * np.pi * difference.ravel(), np.pi * turn.ravel())
    zero, one, c, s = 0.0 * theta_h, 1.0 + 0.0 * theta_h, np.cos(theta_h), np.sin(theta_h)
    turned = np.moveaxis(np.array([[c, zero, s], [zero, one, zero], [-s, zero, c]]), -1, 0)
    wi, wo = (np.einsum("nij,nj->ni", turned, w) for w in (light, light * [-1.0, -1.0, 1.0]))
    seen = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
    values = np.full((3, len(wi)), -1.0)
    values[:, seen] = (brdf(wi[seen], wo[seen]) * 1500.0 / np.array([1.0, 1.15, 1.66])).T
    path.write_bytes(np.array(shape, "<i4").tobytes() + values.astype("<f8").tobytes())


def write_tensors(path: Path, fields: Mapping[str, np.ndarray]) -> None:
    """A tensor file of these fields: bytes or float32."""
    head, body = b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)), b""
    size = len(head) + sum(2 + len(name) + 11 + 8 * field.ndim for name, field in fields.items())
    for name, field in fields.items():
        kind = 1 if field.dtype == np.uint8 else 10
        data = field.astype("u1" if kind == 1 else "<f4").tobytes()
        head += struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", field.ndim, kind, size + len(body))
        head += struct.pack(f"<{field.ndim}Q", *field.shape)
        body += data
    path.write_bytes(head + body)


def write_rgl(path: Path, brdf: Brdf, phi_i: tuple[float, ...] = (0.0,), side: int = 12) -> None:
    """An RGL file whose square is that of half angles, theta_h = u^2 pi / 2 and phi_h = (2 v - 1) pi: a constant density does not warp it."""
    theta_i = np.radians([0.0, 20.0, 40.0, 60.0])
    u, v = np.meshgrid(np.linspace(0.0, 1.0, side), np.linspace(0.0, 1.0, side))
    rgb = np.zeros((len(phi_i), len(theta_i), 3, side, side))
    ndf, sigma = 2.0, 0.5
    for p, phi in enumerate(phi_i):
        for t, theta in enumerate(theta_i):
            wi = np.broadcast_to(polar(np.array(theta), np.array(phi)), (side * side, 3))
            h = polar(0.5 * np.pi * u.ravel() ** 2, (2.0 * v.ravel() - 1.0) * np.pi + (phi if len(phi_i) == 1 else 0.0))
            wo = 2.0 * np.sum(wi * h, -1, keepdims=True) * h - wi
            seen = wo[:, 2] > 0.0
            values = np.zeros((side * side, 3))
            values[seen] = brdf(wi[seen], wo[seen]) * wo[seen, 2:] * 4.0 * sigma / ndf
            rgb[p, t] = values.T.reshape(3, side, side)
    slices = (len(phi_i), len(theta_i))
    write_tensors(
        path,
        {
            "description": np.frombuffer(b"A made material", np.uint8),
            "phi_i": np.array(phi_i),
            "theta_i": theta_i,
            "sigma": np.full((2, 8), sigma),
            "ndf": np.full((2, 8), ndf),
            "vndf": np.ones((*slices, 6, 8)),
            "rgb": rgb,
        },
    )
