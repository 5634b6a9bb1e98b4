// What is around a view: turning it, dragging its light, and a slider for every number of the material.

const element = (tag, attributes = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), attributes);
  for (const [name, value] of Object.entries(attributes)) if (name.includes("-") || name === "for") made.setAttribute(name, value);
  made.append(...children);
  return made;
};
const clamp = (x, lower, upper) => Math.min(Math.max(x, lower), upper);
const digits = (x) => (x === 0 ? "0" : Math.abs(x) >= 1e5 || Math.abs(x) < 1e-3 ? x.toExponential(2) : String(+x.toPrecision(4)));

// Between a number and its place on a slider, 0 to 1: in the coordinate that the fit steps in.
function scaleOf({ scale, soft, lower, upper }) {
  const to = { linear: (x) => x, log: (x) => Math.log(x), softlog: (x) => Math.log1p(x / soft) }[scale];
  const from = { linear: (y) => y, log: Math.exp, softlog: (y) => soft * Math.expm1(y) }[scale];
  const [a, b] = [to(lower), to(upper)];
  return {
    place: (x) => clamp((to(clamp(x, lower, upper)) - a) / (b - a), 0, 1),
    value: (t) => clamp(from(a + t * (b - a)), lower, upper),
  };
}

const TONES = ["none", "neutral", "filmic"];
const STEP = 0.08;  // radians for an arrow key

function turn(angles, dx, dy) {
  angles.yaw += dx;
  angles.pitch = clamp(angles.pitch + dy, -1.5, 1.5);
}

// Calls `move(dx, dy, shift)`, in pixels, when an element is dragged or arrow keys are pressed on it.
function turned(target, move) {
  target.addEventListener("pointerdown", (event) => {
    target.setPointerCapture(event.pointerId);
    target.onpointermove = ({ movementX, movementY, shiftKey }) => move(movementX, movementY, shiftKey);
  });
  for (const end of ["pointerup", "pointercancel"]) target.addEventListener(end, () => { target.onpointermove = null; });
  target.addEventListener("keydown", (event) => {
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
    if (!x && !y) return;
    event.preventDefault();
    move(100 * STEP * x, 100 * STEP * y, event.shiftKey);
  });
}

// Drag, arrow keys and wheel turn the view; the same on the mark of the light move the light.
function turning(view, sun) {
  const light = (dx, dy) => {
    turn(view.light, dx / 100, -dy / 100);
    view.change();
  };
  turned(sun, light);
  turned(view.canvas, (dx, dy, shift) => {
    if (shift) return light(dx, dy);
    turn(view.orbit, -dx / 100, dy / 100);
    return view.change();
  });
  const nearer = (by) => {
    view.orbit.distance = clamp(view.orbit.distance * by, 2.6, 12);
    view.change();
  };
  view.canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !view.canvas.matches(":focus")) return;  // else the page scrolls
    event.preventDefault();
    nearer(Math.exp(event.deltaY / 1000));
  }, { passive: false });
  view.canvas.addEventListener("keydown", ({ key }) => {
    if (key === "+" || key === "=") nearer(1 / 1.1);
    if (key === "-") nearer(1.1);
  });
  view.onchange = () => placeSun(view, sun);
  placeSun(view, sun);
}

function placeSun(view, sun) {
  const { yaw, pitch } = view.light;
  const { right, up, back, scale } = camera(view.orbit.yaw, view.orbit.pitch, view.orbit.distance, 1, 1);
  const at = times([Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)], 1.12);
  const w = view.orbit.distance - dot(back, at);
  sun.style.left = `${clamp(50 + (50 * scale[0] * dot(right, at)) / w, 2, 98)}%`;
  sun.style.top = `${clamp(50 - (50 * scale[1] * dot(up, at)) / w, 2, 98)}%`;
  sun.classList.toggle("behind", dot(back, at) < 0);
}

function choice(name, options, picked) {
  const select = element("select", {}, ...options.map((text, k) => element("option", { value: k, textContent: text })));
  select.addEventListener("change", () => picked(+select.value));
  return element("label", {}, element("span", { textContent: name }), select);
}

function range(name, lower, upper, value, moved) {
  const input = element("input", { type: "range", min: lower, max: upper, step: (upper - lower) / 200, value });
  const shown = element("output", { textContent: digits(value) });
  input.addEventListener("input", () => {
    shown.textContent = digits(+input.value);
    moved(+input.value);
  });
  return element("label", {}, element("span", { textContent: name }), input, shown);
}

// One number of a parameter: slider, mark of the value that was fitted with its sigma as a band, and the number to type.
function slider(row, channel, values, changed) {
  const scale = scaleOf(row);
  const fitted = row.value[channel];
  const name = `${row.name}${row.value.length > 1 ? ` ${"rgb"[channel]}` : ""}`;
  const input = element("input", { type: "range", min: 0, max: 1, step: "any", "aria-label": name, className: `channel${channel}` });
  const box = element("input", { type: "text", inputMode: "decimal", "aria-label": `${name}, number` });
  const mark = element("i", { className: "mark", title: `${row.fitted ? "fitted" : "preset"}: ${digits(fitted)}` });
  const show = () => {
    input.value = scale.place(values[channel]);
    box.value = digits(values[channel]);
    input.setAttribute("aria-valuetext", box.value);
  };
  const set = (x) => {
    values[channel] = x;
    show();
    changed();
  };
  mark.style.setProperty("--at", scale.place(fitted));
  const sigma = row.sigma?.[channel];
  const track = element("span", { className: "track" });
  if (sigma) {
    const band = element("i", { className: "sigma", title: `sigma: ${digits(sigma)}` });
    band.style.setProperty("--from", scale.place(fitted - sigma));
    band.style.setProperty("--to", scale.place(fitted + sigma));
    track.append(band);
  }
  track.append(mark, input);
  input.addEventListener("input", () => set(scale.value(+input.value)));
  box.addEventListener("change", () => {
    const typed = Number(box.value);
    if (box.value.trim() && Number.isFinite(typed)) set(clamp(typed, row.lower, row.upper));
    else show();
  });
  show();
  return { made: element("div", { className: "number" }, track, box), show };
}

// A viewer of one material in an element: `data` is what report/viewer.py writes.
function viewer(place, renderer, data) {
  const canvas = element("canvas", {
    tabIndex: 0, role: "img",
    "aria-label": `${data.name}, drawn live: drag or arrow keys turn it, with Shift the light; + and - come nearer and go back`,
  });
  const sun = element("button", { type: "button", className: "sun", "aria-label": "light: drag it, or arrow keys", title: "light: drag" });
  const view = new View(renderer, canvas, data.fragment, data.values.map(([name, value]) => [name, value]));
  turning(view, sun);

  const run = compile(data.program);
  const now = data.parameters.map(({ value }) => Float64Array.from(value));
  const recompute = () => {
    run(now).forEach((value, k) => { view.values[k][1] = value; });
    view.change();
  };
  const tuned = () => {
    recompute();
    view.ontuned();
  };
  const shows = [];
  const groups = new Map();
  data.parameters.forEach((row, k) => {
    const [layer, field] = [row.name.slice(0, row.name.lastIndexOf(".")), row.name.slice(row.name.lastIndexOf(".") + 1)];
    if (!groups.has(layer)) groups.set(layer, element("fieldset", {}, element("legend", { textContent: layer })));
    const unitText = row.unit === "1" ? "" : ` [${row.unit}]`;
    const label = element("span", { className: "name", textContent: `${field}${unitText}`, title: `${row.doc}; ${digits(row.lower)} to ${digits(row.upper)}` });
    const sliders = row.value.map((_, channel) => slider(row, channel, now[k], tuned));
    shows.push(...sliders.map(({ show }) => show));
    groups.get(layer).append(element("div", { className: "parameter" }, label, element("div", {}, ...sliders.map(({ made }) => made))));
  });

  const back = element("button", { type: "button", textContent: "Back to the start" });
  back.addEventListener("click", () => {
    data.parameters.forEach(({ value }, k) => now[k].set(value));
    shows.forEach((show) => show());
    data.values.forEach(([, value], k) => { view.values[k][1] = value; });
    view.change();
    view.ontuned();
  });
  const save = element("button", { type: "button", textContent: "Save as preset" });
  save.addEventListener("click", () => download(`${data.name}.json`, view.saved()));
  const shapes = Object.keys(SHAPES);
  const look = element("div", { className: "look" },
    choice("shape", shapes, (k) => view.change({ shape: shapes[k] })),
    choice("tone", TONES, (k) => { view.tone = k; view.present(); }),
    range("exposure", -4, 4, 0, (x) => { view.exposure = x; view.present(); }),
    range("key light", 0, 3, 1, (x) => { view.shares.key = x; view.change(); }),
    range("soft boxes", 0, 3, 1, (x) => { view.shares.studio = x; view.change(); }),
  );
  const stage = element("div", { className: "stage waiting" }, canvas, sun);
  view.ondrawn = () => stage.classList.remove("waiting");
  place.append(
    stage,
    element("div", { className: "controls" }, look, element("div", { className: "buttons" }, back, save), ...groups.values()),
  );
  // Numbers of the sliders by the names of their parameters, and back; `ontuned` is called where a user has moved one.
  const numbers = () => Object.fromEntries(data.parameters.map(({ name }, k) => [name, now[k].length > 1 ? Array.from(now[k]) : now[k][0]]));
  const assign = (numbers) => {
    const moved = data.parameters.filter(({ name }, k) => {
      const value = [numbers[name]].flat();
      const differs = value.some((x, channel) => x !== now[k][channel]);
      if (differs) now[k].set(value);
      return differs;
    });
    if (!moved.length) return;
    shows.forEach((show) => show());
    recompute();
  };
  return Object.assign(view, { constants: () => run(now), saved: () => preset(data, now), numbers, assign, ontuned: () => {} });
}

// The preset's document with the numbers of the sliders; what a fit said of the old ones is left out.
function preset({ preset: document, parameters }, now) {
  const changed = structuredClone(document);
  delete changed.fit;
  const layers = [...changed.layers, changed.base];
  parameters.forEach(({ name }, k) => {
    const [layer, field] = [name.slice(0, name.lastIndexOf(".")), name.slice(name.lastIndexOf(".") + 1)];
    const value = Array.from(now[k], (x) => +x.toPrecision(7));
    layers.find((one) => one.name === layer)[field] = value.length > 1 ? value : value[0];
  });
  return `${JSON.stringify(changed, null, 2)}\n`;
}

function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
