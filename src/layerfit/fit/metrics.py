"""How far one image is from another, in the measures that users compare by."""

from typing import Any

import numpy as np


def image_error(image: np.ndarray, reference: np.ndarray, covered: np.ndarray) -> dict[str, float]:
    """Errors of a linear RGB image (H, W, 3) against a reference over the covered pixels (H, W).

    `rel_l2` is linear and needs no exposure. The others are what a viewer sees: both images exposed alike, so that the 99th
    percentile of the reference is white, sRGB-encoded and clipped; PSNR [dB] and SSIM of the encoded images, and the mean
    CIEDE2000 difference (Sharma et al. 2005).
    """
    from skimage.metrics import structural_similarity

    a, b = image[covered], reference[covered]
    rel_l2 = float(np.sqrt(np.sum((a - b) ** 2) / np.maximum(np.sum(b**2), 1e-30)))
    white = exposure(reference, covered)
    shown, wanted = (np.where(covered[..., None], display(x, white), 0.0) for x in (image, reference))
    error = np.mean((shown[covered] - wanted[covered]) ** 2)
    similarity: Any = structural_similarity(wanted, shown, channel_axis=-1, data_range=1.0, full=True)
    return {
        "rel_l2": rel_l2,
        "psnr_db": float(10.0 * np.log10(1.0 / np.maximum(error, 1e-12))),
        "ssim": float(np.mean(similarity[1][covered])),
        "delta_e": float(np.mean(delta_e(a, b, white))),
    }


def delta_e(image: np.ndarray, reference: np.ndarray, white: float) -> np.ndarray:
    """CIEDE2000 difference (n,) of linear RGB pixels (n, 3) that are shown with `white` at 1."""
    from skimage.color import deltaE_ciede2000, rgb2lab

    return deltaE_ciede2000(rgb2lab(display(reference, white)), rgb2lab(display(image, white)))


def exposure(reference: np.ndarray, covered: np.ndarray) -> float:
    """The linear value that is shown as white: the 99th percentile of the brightest channel."""
    values = np.max(reference[covered], -1)
    return float(max(np.quantile(values[np.isfinite(values)], 0.99), 1e-9))


def display(image: np.ndarray, white: float) -> np.ndarray:
    """Linear RGB as sRGB in [0, 1] (IEC 61966-2-1), `white` at 1; not finite becomes 0."""
    x = np.clip(np.nan_to_num(image, nan=0.0, posinf=white, neginf=0.0) / white, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)
