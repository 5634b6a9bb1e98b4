"""A preset to look at and tune: a page that holds all it needs, in a file or served to this machine alone."""

import webbrowser
from collections.abc import Callable
from html import escape
from http.server import BaseHTTPRequestHandler, HTTPServer

from .fit.words import structure
from .preset import model_name
from .report import pages, viewer
from .stack import Stack

HOST = "127.0.0.1"


def page(stack: Stack, name: str) -> str:
    """A material as one HTML file: its exported shader, live, with a slider for every parameter."""
    about = f"{structure(stack)}, {model_name(stack)} form."
    body = pages.filled("view.html", name=escape(name), heading=pages.broken(name), about=escape(about))
    return pages.page(name, body, {"material": pages.as_json(viewer.live(stack, name))})


def serve(text: str, ready: Callable[[str], None], open_browser: bool = True) -> None:
    """Serve a page on this machine, at a free port of the loopback address, until interrupted; `ready` is told where."""
    with HTTPServer((HOST, 0), _handler(text.encode())) as server:
        address = f"http://{HOST}:{server.server_port}/"
        ready(address)
        if open_browser:
            webbrowser.open(address)
        server.serve_forever()


def _handler(content: bytes) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found = self.path == "/"
            self.send_response(200 if found else 404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(content) if found else 0))
            self.end_headers()
            if found:
                self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Requests are of no interest."""

    return Handler
