// Many materials at once, turned and lit together, so that they can be compared. Each is a picture first, and is drawn live where it is in
// sight: on a fast machine at once, on any other when it is pointed at, has the focus, or is turned. The first one tells which it is.

const TILE_PASSES = 160;

function gallery(place, renderer, fragments) {
  const orbit = { yaw: 0, pitch: 0.17, distance: 4.8 };
  const light = { yaw: -0.65, pitch: 0.6 };
  const views = Array.from(place.querySelectorAll("[data-tile]"), (tile) => {
    const canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": `${tile.dataset.tile}: drag or arrow keys turn all, with Shift the light` });
    tile.firstElementChild.append(canvas);
    const view = new View(renderer, canvas, fragments[tile.dataset.tile], []);
    Object.assign(view, { orbit, light, limit: TILE_PASSES, wanted: false, ondrawn: () => tile.classList.add("live") });
    for (const event of ["pointerenter", "focus"]) canvas.addEventListener(event, () => { view.wanted = true; });
    return view;
  });
  views[0].wanted = true;
  const all = (changes) => views.forEach((view) => view.change({ ...changes, wanted: true }));
  for (const view of views) turned(view.canvas, (dx, dy, shift) => {
    if (shift) turn(light, dx / 100, -dy / 100);
    else turn(orbit, -dx / 100, dy / 100);
    all();
  });
  const shapes = Object.keys(SHAPES);
  const find = element("input", { type: "search", placeholder: "name, group or words", "aria-label": "find materials" });
  find.addEventListener("input", () => {
    const words = find.value.toLowerCase().split(/\s+/);
    for (const tile of place.querySelectorAll("[data-tile]")) tile.hidden = !words.every((word) => tile.textContent.toLowerCase().includes(word));
    for (const group of place.querySelectorAll("section")) group.hidden = !group.querySelector("[data-tile]:not([hidden])");
  });
  place.querySelector(".bar-top").append(
    find,
    element("div", { className: "look" }, choice("shape", shapes, (k) => all({ shape: shapes[k] }))),
    element("div", { className: "look" }, choice("tone", TONES, (k) => all({ tone: k }))),
    element("div", { className: "look" }, range("exposure", -4, 4, 0, (x) => all({ exposure: x }))),
  );
  return views;
}
