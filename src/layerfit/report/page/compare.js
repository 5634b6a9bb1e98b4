// A reference and its fit, pixel by pixel: swept over one another, and their difference in false colours.

const HALVES = (() => {  // float16 to numbers, all of them
  const table = new Float32Array(65536);
  for (let k = 0; k < 65536; k++) {
    const [sign, exponent, part] = [k >> 15 ? -1 : 1, (k >> 10) & 31, k & 1023];
    table[k] = sign * (exponent === 31 ? (part ? NaN : Infinity) : exponent ? 2 ** (exponent - 15) * (1 + part / 1024) : 2 ** -24 * part);
  }
  return table;
})();

// Numbers from bytes: the upper halves of all float16 first, then the lower ones, so that they pack well.
function floats(bytes) {
  const n = bytes.length / 2;
  return Float32Array.from({ length: n }, (_, k) => HALVES[(bytes[k] << 8) | bytes[n + k]]);
}

const encoded = (x) => 255 * (x <= 0.0031308 ? 12.92 * Math.max(x, 0) : 1.055 * Math.min(x, 1) ** (1 / 2.4) - 0.055);

function ramp(colours, t) {
  const x = clamp(t, 0, 1) * (colours.length - 1);
  const low = Math.min(Math.floor(x), colours.length - 2);
  return colours[low].map((c, k) => 255 * (c + (x - low) * (colours[low + 1][k] - c)));
}

const CHANNELS = ["mean of the channels", "red", "green", "blue"];

// `data`: name, width, height, white, scale (the end of the false colours, of white), ramp (below 0 to above); `pixels`: reference, then fit, NaN where not compared.
function compare(place, data, bytes) {
  const { width, height, white } = data;
  const all = floats(bytes);
  const count = 3 * width * height;
  const [reference, fit] = [all.subarray(0, count), all.subarray(count, 2 * count)];
  const compared = all.subarray(2 * count);
  const state = { split: 0.5, exposure: 0, top: data.scale, channel: 0 };
  const canvases = [0, 1].map(() => element("canvas", { width, height, tabIndex: 0, role: "img" }));
  const [swept, differing] = canvases;
  for (const [key, value] of Object.entries({ role: "slider", "aria-valuemin": 0, "aria-valuemax": 100, "aria-label": `${data.name}: reference left, fit right of the line; arrow keys move it` })) swept.setAttribute(key, value);
  const swipe = element("div", { className: "swipe" }, swept);  // the line lies over it: a pixel of a small picture is wide
  differing.setAttribute("aria-label", `${data.name}: fit less reference in false colours`);
  const said = element("output", { className: "said", textContent: "Point at a pixel to read it." });

  const apart = (k) => (fit[k] - reference[k]) / white;
  const error = (k) => (state.channel ? apart(k + state.channel - 1) : (apart(k) + apart(k + 1) + apart(k + 2)) / 3);
  const paint = (canvas, colour) => {
    const image = new ImageData(width, height);
    for (let n = 0; n < width * height; n++) image.data.set([...colour(3 * n, n), 255], 4 * n);
    canvas.getContext("2d", { willReadFrequently: true }).putImageData(image, 0, 0);
  };
  const draw = () => {
    const gain = 2 ** state.exposure / white;
    const edge = Math.round(state.split * width);
    paint(swept, (k, n) => {
      const from = n % width < edge ? reference : fit;
      return [0, 1, 2].map((c) => encoded(gain * from[k + c]));
    });
  };
  const drawDifference = () => paint(differing, (k, n) => (compared[n] ? ramp(data.ramp, 0.5 + 0.5 * error(k) / state.top) : [77, 77, 77]));

  const split = (x) => {
    state.split = clamp(x, 0, 1);
    swipe.style.setProperty("--at", state.split);
    swept.setAttribute("aria-valuenow", Math.round(100 * state.split));
    draw();
  };
  const pixelAt = (event) => {
    const box = event.target.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  for (const name of ["pointerdown", "pointermove"]) swept.addEventListener(name, (event) => split(pixelAt(event)[0]));
  swept.addEventListener("keydown", (event) => {
    const to = { ArrowLeft: state.split - 0.02, ArrowRight: state.split + 0.02, Home: 0, End: 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    split(to);
  });
  canvases.forEach((canvas) => canvas.addEventListener("pointermove", (event) => {
    const [x, y] = pixelAt(event).map((t, k) => clamp(Math.floor(t * [width, height][k]), 0, [width, height][k] - 1));
    const [n, k] = [y * width + x, 3 * (y * width + x)];
    const three = (from) => Array.from(from.subarray(k, k + 3), digits).join(" ");
    said.textContent = `x ${x}, y ${y}: reference ${three(reference)}, fit ${three(fit)}${compared[n] ? `, the fit is off by ${digits(100 * error(k))} % of white` : ", not compared"}`;
  }));

  const bar = element("canvas", { width: 256, height: 1, className: "bar" });
  const ends = element("span", {});
  const rescale = (x) => {
    state.top = data.scale * 2 ** x;
    ends.textContent = `fit too dark (blue) to too bright (orange), ${digits(100 * state.top)} % of white each way; grey: not compared`;
    drawDifference();
  };
  const line = new ImageData(256, 1);
  for (let k = 0; k < 256; k++) line.data.set([...ramp(data.ramp, k / 255), 255], 4 * k);
  bar.getContext("2d").putImageData(line, 0, 0);
  place.append(
    element("div", { className: "pair" },
      element("figure", {}, swipe, element("figcaption", { className: "ends" }, element("span", { textContent: "reference" }), element("span", { textContent: "fit (its shader)" }))),
      element("figure", {}, differing, element("figcaption", {}, bar, ends))),
    element("div", { className: "look" }, range("exposure", -6, 6, 0, (x) => { state.exposure = x; draw(); }), range("end of the scale, 2^", -5, 5, 0, rescale),
      choice("difference of", CHANNELS, (k) => { state.channel = k; drawDifference(); })),
    said,
  );
  split(0.5);
  rescale(0);
}
