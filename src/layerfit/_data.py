"""Files that ship with the package: in the wheel below `layerfit/data`, in a checkout where people look for them."""

from pathlib import Path

_PACKAGED = Path(__file__).parent / "data"
_CHECKOUT = Path(__file__).parents[2]


def shaders() -> Path:
    """Templates and presets."""
    return _PACKAGED / "shaders" if _PACKAGED.is_dir() else _CHECKOUT / "shaders"


def references() -> Path:
    """Reference renders with their scene files."""
    return _PACKAGED / "references" if _PACKAGED.is_dir() else _CHECKOUT / "examples" / "references"
