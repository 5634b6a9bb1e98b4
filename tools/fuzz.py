"""Feed mutated files to every reader: each is read or refused by one message, within 10 seconds and 2 GB.

    python tools/fuzz.py                     3,000 files of each kind; exit code 1 where one was neither read nor refused
    python tools/fuzz.py exr preset -n 500   fewer, and of some kinds
    python tools/fuzz.py -k DIR              keep what was found in DIR

Files of a kind are mutated from a small corpus, by a generator whose seed is the number of the file: any of them can be made again.
Children read them, thousands each, so that a crash or a hang ends one of those and names the file.
"""

import argparse
import multiprocessing
import re
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_files import KINDS, TEXTS, corpus

from layerfit.errors import InputError

SECONDS, MEMORY = 10, 2 * 2**30
"""Of one file: of the processor's time, for a busy machine is no hang."""
MESSAGE = 4000
"""Letters of a message, at most."""
BATCH = 1500

HOSTILE_NUMBERS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**63, 2**64 - 1, 100_000)
HOSTILE_WORDS = [
    "nan",
    "inf",
    "-1",
    "1e999",
    "1e-999",
    "9" * 400,
    "9" * 5000,
    "0x",
    "true",
    "null",
    "[]",
    "{}",
    "[[[[",
    '""',
    "'",
    '"',
    "\\",
    "#",
    '"../../../etc/passwd"',
    '"/dev/zero"',
    '"/dev/stdin"',
    '"$(id)"',
    '"a;b"',
    '"*/ void main"',
    '"\\u0000"',
    '"\\ud800"',
    '"\n"',
    "1979-05-27T07:32:00",
    "[1, 2, 3]",
    '[1, "a", null]',
    '{"a" = 1}',
    '{"a": 1}',
    '["sphere"]',
    '"' + "x" * 3000 + '"',
    "\0",
    "é",
    "\u202e",
]


def mutated(data: bytes, rng: np.random.Generator, text: bool) -> bytes:
    """A file with one to four faults."""
    for _ in range(rng.integers(1, 5)):
        data = (_in_text if text and rng.random() < 0.7 else _in_bytes)(data, rng)
    return data


def _in_text(data: bytes, rng: np.random.Generator) -> bytes:
    """A word, number or line replaced by a hostile one, taken out, or moved."""
    parts = re.split(rb"(\"[^\"\n]*\"|[-+.\w]+|\n)", data)
    if len(parts) < 3:
        return data
    at = 2 * int(rng.integers(0, len(parts) // 2)) + 1
    choice = rng.integers(0, 4)
    if choice == 0:
        parts[at] = b""
    elif choice == 1:
        parts[at] = parts[2 * int(rng.integers(0, len(parts) // 2)) + 1]
    else:
        parts[at] = HOSTILE_WORDS[rng.integers(len(HOSTILE_WORDS))].encode("utf-8", "surrogatepass")
    return b"".join(parts)


def _in_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Bits turned, a hostile number put in, a piece cut out, doubled or noised, or the end cut off."""
    if not data:
        return rng.bytes(8)
    made = bytearray(data)
    at, length = int(rng.integers(len(made))), int(rng.integers(1, 17))
    choice = rng.integers(0, 7)
    if choice == 0:
        made[at] ^= 1 << int(rng.integers(8))
    elif choice in (1, 2):
        size = (1, 2, 4, 8)[rng.integers(4)]
        number = HOSTILE_NUMBERS[rng.integers(len(HOSTILE_NUMBERS))] % 256**size
        made[at : at + size] = number.to_bytes(size, "little")
    elif choice == 3:
        del made[at : at + length]
    elif choice == 4:
        made[at:at] = made[at : at + length * int(rng.integers(1, 20))]
    elif choice == 5:
        made[at : at + length] = rng.bytes(length)
    else:
        del made[at:]
    return bytes(made)


def made(kind: str, number: int, whole: list[bytes]) -> bytes:
    """File `number` of a kind."""
    rng = np.random.default_rng((number, len(kind), *kind.encode()))
    return mutated(whole[rng.integers(len(whole))], rng, kind in TEXTS)


def read_some(kind: str, numbers: range, whole: list[bytes], reached: Any, found: Any) -> None:
    """In a child: read files one after the other, and say which could not be, one for each reason."""
    suffix, read = KINDS[kind]
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    warnings.simplefilter("error")  # what a user would see on the console is no message either
    reasons: dict[str, tuple[str, int, str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"mutated{suffix}"
        for number in numbers:
            reached.value = number
            path.write_bytes(made(kind, number, whole))
            signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of this process's own time; it ends the child
            signal.alarm(10 * SECONDS)  # and so does waiting for ever
            try:
                read(path)
            except InputError as error:
                if not str(error).strip() or len(str(error)) > MESSAGE:
                    reasons.setdefault(
                        "a message that is empty or long", (kind, number, f"a message of {len(str(error))} letters")
                    )
            except BaseException as error:
                reasons.setdefault(f"{type(error)} {error}"[:60], (kind, number, traceback.format_exc()))
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.alarm(0)
    for told in list(reasons.values())[:20]:  # a pipe holds no more before it is read
        found.put(told)
    reached.value = -1


def fuzz(kind: str, count: int) -> Iterator[tuple[str, int, str]]:
    """What was found among so many files of a kind: kind, number, why."""
    context = multiprocessing.get_context("fork")
    with tempfile.TemporaryDirectory() as folder:
        whole = corpus(kind, Path(folder))
    start = 0
    while start < count:
        numbers = range(start, min(start + BATCH, count))
        reached, found = context.Value("q", start), context.SimpleQueue()
        child = context.Process(target=read_some, args=(kind, numbers, whole, reached, found))
        child.start()
        child.join()
        while not found.empty():
            yield found.get()
        start = numbers.stop
        if reached.value >= 0:
            yield kind, reached.value, f"the reader ended its process (exit code {child.exitcode}; -27 and -14 are a hang)"
            start = reached.value + 1


def main() -> int:
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    options.add_argument("kinds", nargs="*", help=f"of {', '.join(KINDS)}; left out: all")
    options.add_argument("-n", "--count", type=int, default=3000, help="files of each kind")
    options.add_argument("-k", "--keep", type=Path, help="folder for the files that were found")
    chosen = options.parse_args()
    total = 0
    for kind in chosen.kinds or KINDS:
        faults = list(fuzz(kind, chosen.count))
        total += len(faults)
        print(f"{kind}: {chosen.count} files, {len(faults)} neither read nor refused", flush=True)
        for reason, number in {reason.strip().splitlines()[-1]: number for _, number, reason in faults}.items():
            print(f"  number {number}: {reason[:300]}", flush=True)
        if chosen.keep and faults:
            _keep(chosen.keep, faults)
    return 1 if total else 0


def _keep(folder: Path, faults: list[tuple[str, int, str]]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        whole = corpus(faults[0][0], Path(temporary))
    for kind, number, reason in faults:
        path = folder / f"{kind}_{number}{KINDS[kind][0]}"
        path.write_bytes(made(kind, number, whole))
        path.with_name(path.name + ".txt").write_text(reason)


if __name__ == "__main__":
    sys.exit(main())
