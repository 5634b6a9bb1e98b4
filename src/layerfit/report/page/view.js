// A picture of a material that can be turned and lit: passes of the shader, each with other points of the lights, added up until still.

const PASSES = 768;
const COARSEST = 0.25;  // of the pixels along a side

class View {
  constructor(renderer, canvas, fragment, values) {
    this.renderer = renderer;
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.fragment = fragment;
    this.material = null;  // compiled when it is first drawn
    this.warm = false;  // whether something was: some drivers compile then
    this.failed = false;
    this.age = renderer.age;
    this.values = values;
    this.shape = "sphere";
    this.orbit = { yaw: 0, pitch: 0.17, distance: 5 };
    this.light = { yaw: -0.65, pitch: 0.6 };
    this.shares = { key: 1, studio: 1 };
    this.exposure = 0;
    this.tone = 0;
    this.visible = true;
    this.wanted = true;  // live on any machine, not on fast ones alone
    this.passes = 0;
    this.row = 0;  // of the pass that is being drawn
    this.limit = PASSES;
    this.fineness = 1;
    this.onchange = () => {};
    this.ondrawn = () => {};
  }

  // Begin anew: something has changed.
  change(changes = {}) {
    Object.assign(this, changes);
    this.restart();
    this.onchange();
  }

  restart() {
    this.passes = 0;
    this.row = 0;
  }

  resize() {
    const ratio = this.fineness * Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (this.pass?.width === width && this.pass.height === height) return;
    this.release();
    this.pass = this.renderer.target(width, height, true);
    this.totals = [0, 1].map(() => this.renderer.target(width, height));
    this.restart();
  }

  // Fewer pixels, where those of a pass are more than a machine draws in a good while.
  coarsen(pixels) {
    if (this.pass && this.passes < 3 && this.pass.width * this.pass.height > pixels) this.fineness = Math.max(this.fineness / 2, COARSEST);
  }

  release() {
    for (const target of this.pass ? [this.pass, ...this.totals] : []) this.renderer.release(target);
    this.pass = null;
  }

  // Gives back all that it holds of the renderer.
  dispose() {
    this.release();
    if (this.material) this.renderer.gl.deleteProgram(this.material.program);
    this.material = null;
  }

  // Lights of one pass: a point of the key light and of each soft box, by a sequence that fills a square evenly (Roberts 2018).
  lights(k) {
    const at = (n) => [(0.5 + 0.7548776662 * (k + 0.37 * n)) % 1, (0.5 + 0.5698402910 * (k + 0.61 * n)) % 1].map((x) => 2 * x - 1);
    const { yaw, pitch } = this.light;
    const key = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)];
    const [a, b] = at(0);
    const side = unit(cross([0, 1, 0], key));
    const point = [0, 1, 2].map((i) => key[i] + STUDIO.key.size * (a * side[i] + b * cross(key, side)[i]));
    const boxes = STUDIO.boxes.map(({ to, across, along, rgb }, n) => {
      const [s, t] = at(n + 1);
      return [[...unit(to.map((x, i) => x + s * across[i] + t * along[i])), 0], times(rgb, this.shares.studio)];
    });
    return [[[...point, 0], times([1, 1, 1], STUDIO.key.irradiance * this.shares.key)], ...boxes];
  }

  // Forgets what a driver that stopped has taken along.
  renew() {
    if (this.age === this.renderer.age) return;
    Object.assign(this, { age: this.renderer.age, material: null, warm: false, pass: null });
    this.restart();
  }

  get still() {
    return this.pass && this.passes >= this.limit;
  }

  // Draws on: as many rows of its pass as have so many pixels, and the sum where they are the last. Returns how many pixels these were.
  advance(pixels) {
    this.resize();
    const { width, height } = this.pass;
    const { yaw, pitch, distance } = this.orbit;
    const k = this.passes;
    const shift = k ? [((k * 0.618034) % 1) - 0.5, ((k * 0.754878) % 1) - 0.5] : [0, 0];
    const seen = camera(yaw, pitch, distance, width, height, shift);
    const rows = Math.min(Math.max(Math.floor(pixels / width), 1), height - this.row);
    this.renderer.draw(this.pass, this.material, this.values, this.shape, seen, this.lights(k), this.row, rows);
    this.row += rows;
    if (this.row === height) this.add();
    return rows * width;
  }

  // A pass that is whole, to those before it.
  add() {
    const k = this.passes;
    if (k === 0) this.clear(this.totals[0]);
    this.renderer.sum(this.totals[(k + 1) % 2], this.totals[k % 2], this.pass);
    this.passes++;
    this.row = 0;
  }

  // Says why there is no picture.
  fail(error) {
    this.failed = true;
    this.canvas.after(element("p", { className: "said", textContent: `There is no live view here: ${error.message}` }));
    console.error(error);
  }

  clear(target) {
    this.renderer.gl.bindFramebuffer(this.renderer.gl.FRAMEBUFFER, target.buffer);
    this.renderer.gl.clearBufferfv(this.renderer.gl.COLOR, 0, [0, 0, 0, 0]);
  }

  present() {
    if (!this.pass || !this.passes) return;
    const { width, height } = this.pass;
    if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
    this.renderer.present(this.totals[this.passes % 2], this.passes, 2 ** this.exposure, this.tone, this.context);
    this.ondrawn();
  }

  // One pass of given lights at a given size, as linear numbers: what a test compares with another driver.
  snapshot(width, height, lights) {
    this.material ??= this.renderer.material(this.fragment);
    const target = this.renderer.target(width, height, true);
    const { yaw, pitch, distance } = this.orbit;
    const seen = camera(yaw, pitch, distance, width, height);
    this.renderer.draw(target, this.material, this.values, this.shape, seen, lights);
    const pixels = this.renderer.read(target);
    this.renderer.release(target);
    return { pixels, eye: seen.eye, matrix: seen.matrix };
  }
}
