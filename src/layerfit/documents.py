"""Documents that users write and read: TOML and JSON in, whole files out."""

import difflib
import json
import math
import os
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from .errors import InputError

MAX_BYTES = 4 * 2**20
"""Scene files and presets are a few kB; anything larger is not one."""


def read_document(path: Path) -> dict[str, Any]:
    """A TOML (`.toml`) or JSON file as a table. Raises `InputError` with the place of the fault."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: {path.stat().st_size} bytes are too many for a scene file or a preset")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}. Check the path and its permissions.") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start}); is it another kind of file?") from None
    try:
        document = tomllib.loads(text) if path.suffix == ".toml" else json.loads(text)
        json.dumps(
            document, ensure_ascii=False, default=str
        ).encode()  # JSON may spell a half of a character, which no file can hold
    except ValueError as error:  # of both formats, and of whole numbers of thousands of digits
        raise InputError(f"{path}: not valid {'TOML' if path.suffix == '.toml' else 'JSON'}: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: nested too deeply to be a scene file or a preset") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: should hold a table of keys, not a {type(document).__name__}")
    return document


def finite(value: Any) -> Any:
    """The value with None for NaN and infinity, at any depth: JSON has no word for them."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def is_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold: no NaN, no infinity, no whole number of hundreds of digits, no truth value."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def nearest(word: str, known: Iterable[str]) -> str:
    """ " (did you mean '...'?)" where something known is close, else nothing."""
    close = difflib.get_close_matches(word, list(known), 1, 0.5)
    return f" (did you mean {close[0]!r}?)" if close else ""


def check_keys(document: Any, known: Sequence[str], where: str) -> None:
    """Raise `InputError` for a key that is not known, naming the nearest one."""
    if not isinstance(document, Mapping):
        raise InputError(f"{where}: should be a table of keys, not {document!r}")
    for key in document:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r}{nearest(str(key), known)}. Known keys: {', '.join(known)}")


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all: to a temporary name beside it, then renamed."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}. Choose another output path.") from None
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True)
        raise InputError(
            f"{path}: cannot be written: {error.strerror}. It was left as it was; choose another output path."
        ) from None
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """`write_bytes` for text, in UTF-8."""
    write_bytes(path, content.encode())


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def check_directory(path: Path) -> None:
    """Say before the work, not after it, why results cannot be written to a directory. Makes nothing: `write_bytes` does."""
    there = path
    while not there.exists() and there != there.parent:
        there = there.parent
    advice = "Choose another output directory with -o."
    if not there.is_dir():
        what = "is a file, not a directory" if there == path else f"cannot be made: {there} is a file"
        raise InputError(f"{path}: {what}. {advice}")
    try:
        with tempfile.NamedTemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written to: {error.strerror}. {advice}") from None
