"""Put a run of `layerfit stability` into the manual: the tables of docs/stability.md, heat maps, and the run as JSON.

    python tools/stability.py out/stability    docs/stability.md, docs/stability.json and docs/images/stability/

The page has its tables between `<!-- run -->` and `<!-- end -->`; all else of it is written by hand. Heat maps are of the structures whose names
have no further word: each base, each base below a coat in each form, two coats, what changes in time.
"""

import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from layerfit.report import stability as report

DOCS = Path(__file__).parents[1] / "docs"
PAGE, IMAGES, NUMBERS = DOCS / "stability.md", DOCS / "images" / "stability", DOCS / "stability.json"
BLOCK = re.compile(r"(<!-- run -->\n).*?(<!-- end -->)", re.DOTALL)
LONG = ("heat", "lines", "worst")
"""What the JSON of the manual leaves out of a structure: pictures are of it."""


def pictured(name: str) -> bool:
    """Whether a structure stands for its model."""
    return "," not in re.sub(r"^(precise|corrected|faithful|weathered)( multi)?, ", "", name)


def maps(document: dict[str, Any]) -> list[str]:
    """Lines that show the heat maps."""
    names = [entry["name"] for entry in document["structures"] if pictured(entry["name"])]
    return [f"![{name}](images/stability/{report.file_name(name)}.png)" for name in names]


def main() -> None:
    folder = Path(sys.argv[1])
    document = json.loads((folder / "stability.json").read_text())
    shutil.rmtree(IMAGES, ignore_errors=True)
    IMAGES.mkdir(parents=True)
    for line in maps(document):
        name = re.findall(r"stability/(.+)\)", line)[0]
        shutil.copy(folder / "heat" / name, IMAGES / name)
    short = [{key: value for key, value in entry.items() if key not in LONG} for entry in document["structures"]]
    NUMBERS.write_text(json.dumps(document | {"structures": short}, separators=(",", ":")) + "\n")
    text = report.markdown(document) + "\n### Heat maps\n\n" + "\n\n".join(maps(document)) + "\n\n"
    PAGE.write_text(BLOCK.sub(lambda m: m[1] + "\n" + text + m[2], PAGE.read_text()))


if __name__ == "__main__":
    main()
