"""Presets as a page of live previews: each drawn by the shader that lies beside it."""

from collections.abc import Iterable, Sequence
from html import escape
from itertools import groupby

from ..shader.export import HEADERS
from ..shipped import Shipped
from . import pages


def page(presets: Sequence[Shipped]) -> str:
    """One HTML file for some of the presets that ship, which come by group; it makes no request."""
    groups = groupby(presets, lambda preset: preset.group)
    sections = (
        f'<section><h2>{escape(group.capitalize())}</h2><div class="tiles">{_tiles(members)}</div></section>'
        for group, members in groups
    )
    body = pages.filled("gallery.html", count=str(len(presets)), groups="\n".join(sections))
    shaders = {preset.name: for_web(preset.path.with_suffix(".frag").read_text()) for preset in presets}
    return pages.page("layerfit: materials", body, {"gallery": pages.as_json(shaders)})


def for_web(text: str) -> str:
    """A printed GLSL 3.30 shader as GLSL ES 3.00: only their first lines differ."""
    return text.replace(HEADERS["glsl330"], HEADERS["essl300"], 1)


def _tiles(members: Iterable[Shipped]) -> str:
    """Each with its picture, which stands there until it is drawn live."""
    return "".join(
        f'<div class="tile" data-tile="{escape(preset.name)}"><div class="picture">{preset.picture}</div>'
        f'<div class="about"><h3>{pages.broken(preset.name)}</h3><p>{escape(preset.description)}</p>'
        f'<p class="soft">{escape(preset.structure)}</p></div></div>'
        for preset in members
    )
