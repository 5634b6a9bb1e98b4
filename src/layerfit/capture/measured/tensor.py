"""The tensor file of the RGL material database: named arrays, one after the other.

"tensor_file\\0", two version bytes, a uint32 number of fields; for each its name (uint16 length and text), uint16 number of
dimensions, uint8 type, uint64 place in the file, uint64 for each dimension. (Dupuy and Jakob 2018, the format of their database.)
"""

import math
import struct
from pathlib import Path

import numpy as np

from ...errors import InputError
from .data import read_file

MAGIC = b"tensor_file\0"
VERSION = (1, 0)
MOST_FIELDS, MOST_DIMENSIONS = 1000, 16

_TYPES = dict(enumerate(("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8"), 1))


def read_tensors(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a tensor file by name. Raises `InputError` for one that is cut off or says more than it holds."""
    data = read_file(path)
    if not data.startswith(MAGIC):
        raise InputError(f"{path}: is not a tensor file: it does not begin with {MAGIC[:-1].decode()!r}")
    try:
        version, count, at = struct.unpack_from("<BB", data, 12), *struct.unpack_from("<I", data, 14), 18
        if version != VERSION or count > MOST_FIELDS:
            raise InputError(f"{path}: a tensor file of version {version[0]}.{version[1]} with {count} fields; 1.0 is read")
        fields = {}
        for _ in range(count):
            name, tensor, at = _field(path, data, at)
            fields[name] = tensor
    except (struct.error, UnicodeDecodeError):
        raise InputError(f"{path}: ends within its list of fields; is it whole?") from None
    return fields


def _field(path: Path, data: bytes, at: int) -> tuple[str, np.ndarray, int]:
    """Name and array of the field that is listed at `at`, and where the next one is."""
    (length,) = struct.unpack_from("<H", data, at)
    name = data[at + 2 : at + 2 + length].decode()
    dimensions, kind, offset = struct.unpack_from("<HBQ", data, at + 2 + length)
    at += 2 + length + 11
    if dimensions > MOST_DIMENSIONS or kind not in _TYPES:
        raise InputError(f"{path}: field {name!r} has {dimensions} dimensions and type {kind}; is the file damaged?")
    shape = struct.unpack_from(f"<{dimensions}Q", data, at)
    dtype, size = np.dtype(_TYPES[kind]), math.prod(shape)
    if offset + size * dtype.itemsize > len(data):
        raise InputError(f"{path}: field {name!r} goes on beyond the end of the file; is it whole?")
    if size == 0 and kind != 1:  # text may be empty
        raise InputError(f"{path}: field {name!r} is empty ({' x '.join(map(str, shape))}); is the file damaged?")
    if size == 0:
        return name, np.zeros(0, dtype), at + 8 * dimensions
    return name, np.frombuffer(data, dtype, size, offset).reshape(shape), at + 8 * dimensions
