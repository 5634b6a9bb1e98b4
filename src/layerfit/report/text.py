"""The report of a fit in the terminal: lmfit's blocks, with what an image can and cannot tell beside them."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..fit import words


def lines(document: Mapping[str, Any]) -> list[str]:
    """The blocks of a `fit.json` document as text."""
    d = document
    pixels = d["pixels"]
    out = ["[[Fit]]"]
    out += _rows(
        {
            "model": f"{d['model']['layers']}, {d['model']['name']} form{_options(d['model']['options'])}",
            "why": d["model"]["why"],
            "off by": words.model_error(d["model_error"]),
            "converged": words.converged(d["converged"], d["steps"]),
            "flags": ", ".join(d["flags"]) or "none",
            "error": image_error(d["error"]),
            "pixels": f"{_pixels(pixels)}{_dropped(pixels['dropped'])}",
            "metric": _weights(d["weighting"]),
            "light": _light(d["quadrature"]),
            "starts": words.starts(d["starts"], d["minima"]),
        }
    )
    if "poor_fit" in d["flags"]:
        out += [f"    {words.poor(d['misfit'])}"]
    out += [f"[[Parameters]] (sigmas are {d['sigma_is']})"]
    out += words.parameters(d["parameters"])
    remarks = words.remarks(d["correlations"], [row["why"] for row in d["unidentified"]], d["notes"], d["minima"])
    for heading, said in remarks.items():
        title, space, more = heading.partition(" (")
        out += [f"[[{title}]]{space}{more}", *(f"    {line}" for line in said)]
    if d["left_out"]:
        out += ["[[Left out]]", f"    {', '.join(d['left_out'])}"]
    parity = d["parity"]
    out += [
        f"[[Shader]] (drawn by {parity['renderer']})",
        f"    against JAX: max {relative(parity['max_rel'])}, p99.9 {relative(parity['p999_rel'])} relative: {verdict(parity)}",
        f"    worst value: {worst(parity['worst'])}",
    ]
    return [*out, "[[Time]]", f"    {_time(d['time'])}"]


def not_written(parity: Mapping[str, Any]) -> str:
    """Why there is no shader."""
    return (
        f"material.frag is NOT written: as {parity['renderer']} draws it, it is not the material ({worst(parity['worst'])}). "
        "Try another driver (`layerfit doctor` says which this is); --force writes it all the same."
    )


def verdict(parity: Mapping[str, Any]) -> str:
    """Whether the shader is the material, in a word."""
    return "PASS" if parity["passed"] else "FAILURE"


def image_error(error: Mapping[str, float | None]) -> str:
    """How far one image is from another."""
    measures = {
        "rel_l2": "{:.3g} relative L2",
        "psnr_db": "PSNR {:.1f} dB",
        "ssim": "SSIM {:.4f}",
        "delta_e": "delta E 2000 {:.2f}",
    }
    values = {key: error[key] for key in measures}
    if None in values.values():
        return "not finite"
    return ", ".join(measures[key].format(value) for key, value in values.items())


def relative(value: float | None) -> str:
    """A relative difference, which a value that is not finite has none of."""
    return "not finite" if value is None else f"{value:.1e}"


def worst(place: Mapping[str, Any]) -> str:
    """Where a shader differs most from JAX: a pixel, or a pair of directions."""
    if "x" in place:
        where = f"pixel x {place['x']}, y {place['y']}"
    else:
        where = ", ".join(f"{key} ({', '.join(f'{v:.6f}' for v in place[key])})" for key in ("wi", "wo"))
    shader, jax = ("not finite" if place[by] is None else f"{place[by]:.8g}" for by in ("shader", "jax"))
    return f"{place['channel']} at {where}: shader {shader}, JAX {jax}"


def _rows(rows: Mapping[str, str]) -> list[str]:
    return [f"    {key + ':':<12} {value}" for key, value in rows.items()]


def _options(options: Mapping[str, Any]) -> str:
    return "".join(f", {key} = {value}" for key, value in options.items())


def _pixels(pixels: Mapping[str, Any]) -> str:
    used, usable = pixels["used"], pixels["usable"]
    return f"{used} used" if used == usable else f"{used} used, drawn at random from {usable} that can be compared"


METRICS = {
    "uniform": "values, the same for every pixel: for a measured BRDF the cosine-weighted L2",
    "relative": "values over those of the model",
    "log": "logarithms of values",
    "cube_root": "cube roots of values",
}
"""What is compared, in words; by the law there is more to say."""


def _weights(weighting: Mapping[str, Any]) -> str:
    loss = "" if weighting["loss"] == "square" else f"; {weighting['loss']} loss"
    if weighting["kind"] in METRICS:
        return f"{METRICS[weighting['kind']]}{loss}"
    noise = weighting["noise"]
    known = "the noise that the file states" if all(noise) else "the noise of the files that state it"
    of_model, of_white = 100.0 * weighting["model_share"], 100.0 * weighting["floor_share"]
    misfit = f"{of_model:g} % of the value, {of_white:g} % of the image's brightness"
    misfit += f" and {known}" if any(noise) else "; no file states its noise"
    return f"law, 1 / (expected misfit)^2, from {misfit}{loss}"


def _light(quadrature: Mapping[str, Any] | None) -> str:
    if quadrature is None:
        return "exact: distant and point lights only"
    return (
        f"quadrature: pictures {quadrature['directions']} directions a pixel, {100.0 * quadrature['rms']:.2g} % rms error of a pixel; "
        f"the fit {quadrature['fit_directions']}, {100.0 * quadrature['fit_rms']:.2g} %"
    )


def _time(seconds: Mapping[str, float]) -> str:
    total = seconds["total_s"]
    parts = [f"{key[:-2]} {value:.2f} s ({100.0 * value / total:.0f} %)" for key, value in seconds.items() if key != "total_s"]
    return f"{total:.2f} s in all: {', '.join(parts)}"


def _dropped(dropped: Sequence[Mapping[str, int]]) -> str:
    total: dict[str, int] = {}
    for view in dropped:
        for reason, count in view.items():
            total[reason] = total.get(reason, 0) + count
    return "; left out: " + ", ".join(f"{count} {reason}" for reason, count in total.items()) if total else ""
