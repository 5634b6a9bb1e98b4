"""Parts of a long piece of work, kept as they are done: what was interrupted goes on where it was."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..documents import finite, write_text


class Kept:
    """Results by name in a file, which is for one question: another `question` begins anew."""

    def __init__(self, path: Path, question: Any) -> None:
        self.path, self.question = path, json.loads(json.dumps(question))
        self.parts: dict[str, Any] = {}
        if path.is_file():
            try:
                found = json.loads(path.read_text(encoding="utf-8"))
            except (ValueError, RecursionError):
                return  # not whole, so of no use
            if isinstance(found, dict) and found.get("question") == self.question and isinstance(found.get("parts"), dict):
                self.parts = found["parts"]

    def part(self, name: str, make: Callable[[], Any]) -> Any:
        """The result of that name, made where it is not there yet."""
        if name not in self.parts:
            self.parts[name] = finite(make())
            write_text(self.path, json.dumps({"question": self.question, "parts": self.parts}))
        return self.parts[name]

    def done(self) -> None:
        """Throw the file away: all of it stands in the results."""
        self.path.unlink(missing_ok=True)
