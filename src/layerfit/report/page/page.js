// What a page holds: compressed data beside the text, unpacked here; then its viewers and comparisons.

const unpacked = (name) => inflated(Uint8Array.from(atob(document.getElementById(name).textContent), (c) => c.charCodeAt(0)));
const readDocument = async (name) => parsed(await unpacked(name));

async function start() {
  const page = { views: [], ready: false };
  globalThis.layerfit = page;
  for (const place of document.querySelectorAll("[data-compare]")) {
    const data = JSON.parse(place.dataset.compare);
    compare(place, data, await unpacked(data.pixels));
  }
  const places = document.querySelectorAll("[data-viewer], [data-gallery]");
  try {
    const renderer = places.length ? new Renderer() : null;
    for (const place of places) {
      const { viewer: one, gallery: many } = place.dataset;
      if (one) page.views.push(viewer(place, renderer, await readDocument(one)));
      else page.views.push(...gallery(place, renderer, await readDocument(many)));
    }
  } catch (error) {
    for (const place of places) place.prepend(`There is no live view here: ${error.message}.`);
    throw error;
  }
  run(page.views);
  page.ready = true;
}

start();
