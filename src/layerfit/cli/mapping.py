"""Commands over many fits that are no list of scenes: `map`, a fit for every texel, and `study`, trials by a design."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ..documents import finite
from . import complete
from .app import Output, Scene, Starts, command
from .talk import Done, many, progress, say


@command("map")
def map_texels(
    scene: Scene,
    output: Output = Path("out"),
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="PARAMETER",
            help="Parameter that every texel has for itself, such as coat.thickness_um or tilt, in place of the scene's [map].free; may be repeated.",
        ),
    ] = None,
    shared: Annotated[
        list[str] | None,
        typer.Option(
            "--shared",
            metavar="PARAMETER",
            help="Parameter that is one for all texels, and fitted to all images first; may be repeated.",
        ),
    ] = None,
    smooth: Annotated[
        float | None,
        typer.Option(min=0.0, help="By how much neighbours differ, as a part of the value; left out, texels are fitted apart."),
    ] = None,
    size: Annotated[
        int | None, typer.Option(min=1, help="Texels on a side, over texture coordinates; left out, a texel is a pixel.")
    ] = None,
    starts: Starts = None,
) -> Done:
    """Fit parameters texel by texel, to images of several lights.

    Leaves `maps.exr` (values, sigmas, flags), `textures/`, `material.frag`, which reads them, `map.png`, `preset.json` and `map.json` in
    the output directory. What is interrupted goes on where it was when the same command is given again. Exit code 1: a parameter is not
    told in most texels, or there is no shader.

    Examples:
        layerfit map panel.toml --free coat.thickness_um -o out/panel
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..maps import fit_map

    with progress() as report:
        found = fit_map(
            scene, output, free=free or None, shared=shared or (), smooth=smooth, size=size, starts=starts, progress=report
        )
    document: Any = found.document
    for line in _lines(document):
        say(line)
    shader = (document["parity"] or {}).get("passed")
    say(f"Wrote maps.exr, map.png, map.json, preset.json, textures{' and material.frag' if shader else ''} in {output}/")
    return Done(document, ("view", output / "preset.json"), found.good)


def _lines(document: dict[str, Any]) -> list[str]:
    """What came of each parameter, and of the shader."""
    height, width = document["size"]
    lines = [
        f"{document['texels']} texels of {width} x {height}, of {document['references']} images, relative L2 {document['error']['rel_l2']:.4f}"
    ]
    for name, row in document["parameters"].items():
        low, middle, high = row["quartiles"]
        sigma = "" if row["sigma_median"] is None else f" +/- {row['sigma_median']:.2g}"
        lines.append(f"{name}: {middle:.4g}{sigma}, half of them {low:.4g} to {high:.4g}; told in {100.0 * row['told']:.3g} %")
        lines += [f"    {count} texels: {words}" for words, count in row["flags"].items()]
    parity = document["parity"]
    if parity is None:
        lines.append(f"no shader: {document['no_shader']}")
    else:
        lines.append(
            f"shader against JAX: max {parity['max_rel']:.1e}, p99.9 {parity['p999_rel']:.1e} relative, {parity['values']} values"
        )
    return lines


@command()
def study(
    plan: Annotated[
        Path, typer.Argument(help="Study file (TOML or JSON): material, design, what varies.", autocompletion=complete.files)
    ],
    output: Output = Path("out"),
) -> Done:
    """Vary a material or its fit by a design, and measure.

    What varies may be of the material, of its reference, or of the fit. Leaves `study.nc` (xarray), `study.csv` and, with matplotlib,
    `study.png` in the output directory. What is interrupted goes on where it was when the same command is given again. Exit code 1: some
    trials failed; `study.csv` says why.

    Examples:
        layerfit study depth.toml -o out/depth
    """
    from ..cache import use_compilation_cache

    use_compilation_cache()
    from ..study.sweep import study as run

    with many() as report:
        dataset = run(plan, output, progress=report)
    failures = str(dataset.attrs["failures"]).splitlines()
    for line in failures:
        say(f"failed: {line}")
    medians = {str(name): float(values.median()) for name, values in dataset.data_vars.items()}
    for name, value in medians.items():
        say(f"{name}: {value:.4g} in the median")
    drawn = _draw(dataset, output)
    say(f"Wrote study.nc, study.csv{' and study.png' if drawn else ''} in {output}/")
    document = {
        "schema": "layerfit/study",
        "version": 1,
        "sizes": {str(name): size for name, size in dataset.sizes.items()},
        "failed": len(failures),
        "medians": finite(medians),
        "table": str(output / "study.csv"),
    }
    return Done(document, ("presets",), not failures)


def _draw(dataset: Any, output: Path) -> bool:
    """A picture of the worst error, or of the first number that was measured; none without matplotlib."""
    from importlib.util import find_spec

    if not find_spec("matplotlib"):
        return False
    import io

    from ..documents import write_bytes
    from ..plot import plot_study

    variable = "error" if "error" in dataset else str(next(iter(dataset.data_vars)))
    picture = io.BytesIO()
    figure: Any = plot_study(dataset, variable).figure
    figure.savefig(picture, dpi=120)
    write_bytes(output / "study.png", picture.getvalue())
    return True
