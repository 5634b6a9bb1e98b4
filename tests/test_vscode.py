"""The live material in VS Code's notebook: the widget manager of its Jupyter extension in a page, before a real kernel.

NODE_PATH names the folder that has the npm packages. The extension's own part is done here: it stands in for the socket of the kernel,
and finds a widget's module among the `nbextensions` of the kernel's environment.
"""

import base64
import sys
from pathlib import Path

import pytest

import engines
from browser import middle, until

kernels = pytest.importorskip("jupyter_client.manager", reason="pip install nbclient ipykernel")
pytest.importorskip("ipykernel", reason="pip install nbclient ipykernel")
pytest.importorskip("anywidget", reason="pip install 'layerfit[notebook]'")

PACKAGES = ("@vscode/jupyter-ipywidgets8", "@jupyterlab/services", "requirejs")
pytestmark = [pytest.mark.slow, engines.needs(PACKAGES)]

NAME = "concrete.albedo"
WIDGET = "document.querySelector('.layerfit')"
VIEW = f"{WIDGET}.view"

HOST = """<!doctype html><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'self' blob:; style-src 'unsafe-inline'; font-src data:">
<body class="vscode-dark" data-vscode-theme-kind="vscode-dark"><div id="cell" style="width: 700px"></div>
<script src="/requirejs/require.js"></script><script type="module" src="/host.js"></script>"""
"""Stricter than a notebook of VS Code, which has no policy unless it is asked for: no request leaves, and no text is evaluated."""

SCRIPT = """import { activate } from "/@vscode/jupyter-ipywidgets8/dist/ipywidgets.js";
activate();
vscIPyWidgets8.load();

let socket;
class Socket {
    protocol = "";
    constructor() { socket = this; }
    send(message) { toKernel(message); }
    close() {}
}
const view = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const serializer = {
    serialize: (message) => message,
    deserialize: (message) => ({ ...message, buffers: message.buffers.map(view) }),
};
const scripts = {
    widgetsRegisteredInRequireJs: new Set(),
    loadWidgetScript: async (name) => requirejs.config({ paths: { [name]: `/nbextensions/${name}/index` } }),
    errorHandler: (...said) => console.error(...said),
    successHandler: () => {},
};

requirejs.config({ paths: { "@jupyterlab/services": "/@jupyterlab/services/dist/dist/index" } });
requirejs(["@jupyterlab/services"], ({ KernelConnection, ServerConnection }) => {
    const serverSettings = ServerConnection.makeSettings({ WebSocket: Socket, wsUrl: "ws://kernel.test", serializer });
    const kernel = new KernelConnection({ model: { id: "kernel", name: "python3" }, serverSettings });
    const manager = new vscIPyWidgets.WidgetManager(kernel, null, scripts, () => {});
    const cell = document.getElementById("cell");
    globalThis.run = async (code) => {
        let said = "";
        let shown;
        const future = kernel.requestExecute({ code });
        future.onIOPub = ({ content }) => {
            said += content.text ?? "";
            shown = content.data?.["application/vnd.jupyter.widget-view+json"] ?? shown;
        };
        const { content } = await future.done;
        if (content.status !== "ok") throw new Error(content.evalue);
        if (shown) {
            const view = await manager.create_view(await manager.get_model(shown.model_id), { el: cell });
            await manager.display_view(shown, view, { node: cell });
        }
        return said;
    };
    socket.onopen();
    (async function listen() {
        for (const data of await fromKernel()) socket.onmessage({ data });
        setTimeout(listen, 50);
    })();
});
"""


@pytest.fixture(scope="module")
def kernel():
    manager, client = kernels.start_new_kernel()
    yield client
    client.stop_channels()
    manager.shutdown_kernel(now=True)


@pytest.fixture(scope="module")
def page(kernel):
    """A notebook with the live material; `run` runs a cell, shows its widget and gives what it printed."""
    channels = {"shell": kernel.shell_channel, "control": kernel.control_channel, "iopub": kernel.iopub_channel}

    def send(message):
        channels[message["channel"]].send(message)

    def received():
        return [_plain(channel.get_msg(), name) for name, channel in channels.items() for _ in range(channel.msg_ready())]

    index = Path(sys.prefix, "share", "jupyter", "nbextensions", "anywidget", "index.js").read_text()
    texts = {"": HOST, "host.js": SCRIPT, "nbextensions/anywidget/index.js": index}
    with engines.packaged(PACKAGES, texts, toKernel=send, fromKernel=received) as page:
        until(page, "typeof run === 'function'")
        run(page, 'import layerfit as lf\nw = lf.live("bare_concrete")\nw')
        until(page, f"{WIDGET}?.view")
        page.evaluate(f"{VIEW}.limit = 2")
        yield page


def _plain(message, channel):
    """A message of the kernel with its bytes as text."""
    parts = {key: message[key] for key in ("header", "parent_header", "metadata", "content")}
    return parts | {"channel": channel, "buffers": [base64.b64encode(buffer).decode() for buffer in message["buffers"]]}


def run(page, code):
    return page.evaluate("(code) => run(code)", code)


def test_the_material_is_drawn(page):
    assert middle(page, VIEW).max() > 20


def test_a_slider_sets_the_value_in_the_kernel(page):
    box = page.get_by_label(f"{NAME} r, number")
    box.fill("0.77")
    box.press("Enter")
    assert run(page, f'print(w["{NAME}"])').startswith("[0.77, ")


def test_a_value_in_the_kernel_moves_the_slider_and_the_picture(page):
    before = middle(page, VIEW)
    run(page, f'w["{NAME}"] = 0.02')
    until(page, f"{VIEW}.numbers()['{NAME}'].every((x) => Math.abs(x - 0.02) < 1e-9)")
    assert middle(page, VIEW).max() < 0.6 * before.max()
    assert float(page.get_by_label(f"{NAME} r, number").input_value()) == 0.02


def test_it_is_as_light_as_the_theme(page):
    assert page.evaluate(f"{WIDGET}.style.colorScheme") == "dark"
    for theme, scheme in (("vscode-high-contrast-light", "light"), ("vscode-high-contrast", "dark")):
        page.evaluate(f"document.body.dataset.vscodeThemeKind = '{theme}'")
        until(page, f"{WIDGET}.style.colorScheme === '{scheme}'")
