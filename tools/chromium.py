"""Where Chromium is, and how it draws without a GPU: WebGL 2 by SwiftShader."""

import shutil
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--disable-gpu-watchdog"]
"""In software, without the watch that ends a driver which compiles for long."""


def executable(playwright: Any) -> str:
    """The path of the system's Chromium, else where Playwright would have its own."""
    return next((path for name in NAMES if (path := shutil.which(name))), None) or playwright.chromium.executable_path
