// The viewer in a notebook, as an anywidget module (https://anywidget.dev): its sliders are the values of Python, both ways.

// One WebGL2 context for all widgets of a page, as browsers keep but some sixteen; another version of this file has its own.
const shared = () => (globalThis[Symbol.for(`layerfit ${Renderer}`)] ??= new Renderer());

// Whether the notebook is dark, where it says so: JupyterLab and VS Code do. Else the system's choice holds.
function scheme() {
  const { jpThemeLight, vscodeThemeKind } = document.body.dataset;
  const light = { true: true, false: false }[jpThemeLight] ?? vscodeThemeKind?.endsWith("light");
  return light === undefined ? "light dark" : light ? "light" : "dark";
}

async function render({ model, el }) {
  const host = element("div", { className: "layerfit" });
  const root = host.attachShadow({ mode: "open" });  // styles neither come in nor leave
  const place = element("div", { className: "viewer" });
  const themed = new MutationObserver(() => { host.style.colorScheme = scheme(); });
  themed.observe(document.body, { attributeFilter: ["data-jp-theme-light", "data-vscode-theme-kind"] });
  host.style.colorScheme = scheme();
  root.append(element("style", { textContent: STYLE }), place);
  el.append(host);
  const packed = model.get("_material");
  const data = parsed(await inflated(new Uint8Array(packed.buffer, packed.byteOffset, packed.byteLength)));
  let view;
  try {
    view = viewer(place, shared(), data);
  } catch (error) {
    place.append(`There is no live view here: ${error.message}.`);
    throw error;
  }
  const take = () => view.assign(model.get("values"));
  take();
  view.ontuned = () => {
    model.set("values", view.numbers());
    model.save_changes();
  };
  model.on("change:values", take);
  const stop = run([view]);
  host.view = view;
  return () => {
    model.off("change:values", take);
    stop();
    themed.disconnect();
    host.remove();
  };
}

export default { render };
