"""How far values are from others that they stand for: relative, and as a viewer sees it."""

import numpy as np

from ..fit.metrics import delta_e


def relative(values: np.ndarray, truth: np.ndarray, floor: float) -> dict[str, float]:
    """Largest, 99.9th percentile and root mean square of |values - truth| over the larger of the truth and a floor; arrays (n, 3)."""
    off = np.abs(values.astype(float) - truth) / np.maximum(np.abs(truth), floor)
    return {
        "max_rel": float(np.max(off)),
        "p999_rel": float(np.quantile(off, 0.999, method="higher")),
        "rms_rel": float(np.sqrt(np.mean(off**2))),
    }


def seen(values: np.ndarray, truth: np.ndarray) -> float:
    """Mean CIEDE2000 of linear pixels (n, 3), exposed so that the 99th percentile of the truth is white."""
    white = float(max(np.quantile(np.max(truth, -1), 0.99), 1e-9))
    return float(np.mean(delta_e(values, truth, white)))
