"""What a shell is told when it asks to complete a word: names of presets, and what options take. Told nothing, it completes file names."""

from collections.abc import Callable
from importlib import import_module

from .._data import shaders

Words = Callable[[str], list[str]]


def files(incomplete: str) -> list[str]:
    """Nothing: files are what a shell knows."""
    return []


def presets(incomplete: str) -> list[str]:
    """Presets that ship."""
    names = sorted(path.stem for path in (shaders() / "presets").glob("*.json"))
    return [name for name in names if name.startswith(incomplete)]


def _known(module: str, name: str) -> Words:
    """The words of a table of the package, which is imported when a shell asks."""

    def words(incomplete: str) -> list[str]:
        known = getattr(import_module(f"layerfit.{module}"), name)
        return [word for word in known if word.startswith(incomplete)]

    return words


metrics = _known("capture.scene", "METRICS")
losses = _known("capture.scene", "LOSSES")
targets = _known("shader.export", "HEADERS")
tiers = _known("tiers.tier", "TIERS")
evaluated = _known("tiers.tier", "EVALUATED")
formats = _known("interchange.formats", "FORMATS")
