"""Documents that users write and read: TOML and JSON in, whole files out."""

import contextlib
import difflib
import errno
import fcntl
import json
import math
import os
import re
import signal
import sys
import tempfile
import threading
import tomllib
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from .errors import InputError

EXR = b"\x76\x2f\x31\x01"
"""What an OpenEXR file begins with."""

MAX_BYTES = 4 * 2**20
"""Scene files and presets are a few kB; anything larger is not one."""


def read_bytes(path: Path, most: int, what: str) -> bytes:
    """The content of a file of at most so many bytes, as `what` has. Raises `InputError`."""
    try:
        with path.open("rb") as file:
            large = os.fstat(file.fileno()).st_size > most  # before memory is taken; of a device it says nothing
            content = b"" if large else file.read(most + 1)
    except OSError as error:
        raise unreadable(path, error) from None
    if large or len(content) > most:
        raise InputError(f"{path}: more than {most} bytes are too many for {what}")
    return content


def read_document(path: Path) -> dict[str, Any]:
    """A TOML (`.toml`) or JSON file as a table. Raises `InputError` with the place of the fault."""
    content = read_bytes(path, MAX_BYTES, "a scene file or a preset")
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        what = "an EXR image" if content.startswith(EXR) else f"not UTF-8 text (byte {error.start})"
        raise InputError(
            f"{path}: is {what}, where a scene file or a preset is read. `layerfit inspect` says what images hold."
        ) from None
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


def nearest(word: str, known: Iterable[str], alike: float = 0.5) -> str:
    """ " (did you mean '...'?)" where something known is close, else nothing; `alike` is from 0 to 1."""
    close = difflib.get_close_matches(word, list(known), 1, alike)
    return f" (did you mean {close[0]!r}?)" if close else ""


def unreadable(path: Path, error: OSError) -> InputError:
    """What is said of a file that cannot be opened; of one that is not there, which of its neighbours may have been meant."""
    near = ""
    if isinstance(error, FileNotFoundError) and path.parent.is_dir():
        near = nearest(path.name, (file.name for file in path.parent.iterdir()), 0.6)
    return InputError(f"{path}: cannot be read: {error.strerror}{near}. Check the path and its permissions.")


def check_keys(document: Any, known: Sequence[str], where: str) -> None:
    """Raise `InputError` for a key that is not known, naming the nearest one."""
    if not isinstance(document, Mapping):
        raise InputError(f"{where}: should be a table of keys, not {document!r}")
    for key in document:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r}{nearest(str(key), known)}. Known keys: {', '.join(known)}")


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Where to write a file that is to be there whole or not at all: it takes its name when the block ends well.

    Until then it has no name, so that a process that is killed leaves nothing behind; where the file system cannot do that, a hidden
    one. What is no file, as a pipe or `/dev/stdout`, is written straight. Raises `InputError` where the file cannot be written.
    """
    if not path.name:
        raise InputError(f"{path}: cannot be written: it is a directory. Choose another output path, with the name of a file.")
    hidden = path.with_name(f".{uuid.uuid4().hex}{path.suffix[:9]}")
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            yield path
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _nameless(path.parent)
        if descriptor is None:
            yield hidden
            os.replace(hidden, path)
        else:
            with os.fdopen(descriptor, "wb"):
                yield Path(f"/proc/self/fd/{descriptor}")
                with undisturbed():
                    _name(descriptor, path, hidden)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written: {error.strerror}. It was left as it was; choose another output path."
        ) from None
    finally:
        with contextlib.suppress(OSError):
            hidden.unlink(missing_ok=True)


def _nameless(directory: Path) -> int | None:
    """A descriptor of a new file without a name; None where the file system has none, or nothing to name it by later."""
    if not Path("/proc/self/fd").is_dir():
        return None
    try:
        return os.open(directory, os.O_TMPFILE | os.O_WRONLY, 0o666)
    except OSError as error:
        if error.errno in (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL):
            return None
        raise


def _name(descriptor: int, path: Path, hidden: Path) -> None:
    """Give a file without a name its name; by way of another one where something stands there, which a link does not replace."""
    place = f"/proc/self/fd/{descriptor}"
    try:
        os.link(place, path, src_dir_fd=descriptor)  # with a descriptor, what the place leads to is linked
    except FileExistsError:
        os.link(place, hidden, src_dir_fd=descriptor)
        os.replace(hidden, path)


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Ctrl-C waits for the end of what takes no time."""
    # Signals are for the main thread, and a handler that Python did not set cannot be put back.
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is None:
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    with whole(path) as place:
        place.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """`write_bytes` for text, in UTF-8."""
    write_bytes(path, content.encode())


def write_files(directory: Path, contents: Mapping[str, str | bytes | None]) -> None:
    """Write the files of one result, by their names in a directory: all of them, or none where one cannot be written. None is a file that
    this result does not have: that of an earlier one goes.

    They take their names in this order, at once when all are written, and those of two processes one after the other: what stands in
    the directory is of one result.
    """
    with one_writer(directory), undisturbed(), contextlib.ExitStack() as files:
        for name, content in contents.items():
            if content is not None and (directory / name).is_dir():
                raise InputError(f"{directory / name}: is a directory, where a file goes. Choose another output directory.")
        for name, content in reversed(list(contents.items())):  # what is entered last leaves first
            if content is None:
                files.callback((directory / name).unlink, missing_ok=True)
                continue
            place = files.enter_context(whole(directory / name))
            place.write_bytes(content.encode() if isinstance(content, str) else content)


def of_ours(
    directory: Path, contents: Mapping[str, str | bytes | None], document: str, schema: str
) -> dict[str, str | bytes | None]:
    """The files of a result without those that it does not have, but where the document of an earlier one stands: what is named alike
    elsewhere is the user's, and stays. Of the `files` of that document those that are numbered go too, such as preset_3.json beside a preset.json."""
    try:
        earlier = json.loads((directory / document).read_text(encoding="utf-8"))
        ours, files = earlier.get("schema") == schema, earlier.get("files", [])
    except (OSError, ValueError, AttributeError, RecursionError):
        ours, files = False, []
    gone = {name: None for name in files if isinstance(name, str) and re.sub(r"_\d+\.", ".", name) in contents} if ours else {}
    return gone | {name: content for name, content in contents.items() if ours or content is not None}


@contextlib.contextmanager
def one_writer(directory: Path) -> Iterator[None]:
    """Make a directory, and wait until no other process writes to it. What is held is given back when the process ends, in whatever way."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        held = os.open(directory, os.O_RDONLY)
    except OSError as error:
        raise InputError(f"{directory}: cannot be written to: {error.strerror}. Choose another output directory.") from None
    try:
        with contextlib.suppress(OSError):  # file systems of a network may have no locks: there the last one wins, file by file
            fcntl.flock(held, fcntl.LOCK_EX)
        yield
    finally:
        os.close(held)


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
