// Draws the views of a renderer, as much of them a frame as the machine keeps up with: where it is slow, some rows of a picture.

const LEAST = 1 << 12;  // pixels in a frame
const MOST = 1 << 22;
const FAST = 1 << 18;  // from here on, a machine draws all that is in sight
const FRAME_MS = 12;  // of JavaScript
const ON_TIME_MS = 40;
const LATE_MS = 80;
const FRAMES = 12;  // a picture that takes more of them, each late, is drawn in fewer pixels

class Loop {
  constructor(renderer) {
    this.renderer = renderer;
    this.views = new Set();
    this.pace = 4 * LEAST;  // pixels in a frame
    this.since = 0;  // when the driver got what it is at; 0: that tells nothing of its pace
    this.waited = 0;
    this.drawn = new Set();
  }

  begin() {
    if (!this.next) this.next = requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    this.next = 0;
    if (this.views.size) this.begin();
    this.views.forEach((view) => view.renew());
    this.waited += 1;
    this.begun = false;
    if (this.renderer.lost || this.renderer.busy) return;
    this.learn(now);
    this.work(now);
  }

  // Twice the pixels where as many were there by the next frame, half where they took long.
  learn(now) {
    const took = now - this.since;
    if (this.since && this.full && this.waited === 1 && took < ON_TIME_MS) this.pace = Math.min(2 * this.pace, MOST);
    if (this.since && took > LATE_MS) {
      this.pace = Math.max(this.pace / 2, LEAST);
      this.drawn.forEach((view) => view.coarsen(FRAMES * this.pace));
    }
    this.since = 0;
    this.drawn.clear();
  }

  work(now) {
    let left = this.pace;
    let first = false;
    for (let view = this.due(); view && left > 0 && performance.now() - now < FRAME_MS; view = this.due()) {
      first = !view.warm;
      if (first && left < this.pace) break;  // compiling takes long: alone, in a frame to come
      const passes = view.passes;
      left -= first ? this.pace : 0;
      left -= view.advance(first ? 1 : left);
      view.warm = true;
      if (view.passes > passes) this.drawn.add(view);
    }
    if (left === this.pace) return;
    this.drawn.forEach((view) => view.present());
    this.renderer.mark();
    Object.assign(this, { since: first ? 0 : now, waited: 0, full: left <= 0 });
  }

  // The view that is the furthest behind, of those whose shader is compiled; what is pointed at goes first.
  due() {
    let [found, least] = [null, Infinity];
    for (const view of this.views) {
      if (!view.visible || view.failed || view.still || !(view.wanted || this.pace >= FAST)) continue;
      const place = view.passes - (view.canvas.matches(":hover, :focus") ? 4 : 0);
      if (place < least && this.compiled(view)) [found, least] = [view, place];
    }
    return found;
  }
  // One shader a frame is given to the driver, which may make the page wait for it.
  compiled(view) {
    if (!view.material && this.begun) return false;
    try {
      if (!view.material) view.material = this.renderer.material(view.fragment);
      this.begun ||= !view.warm;
      return view.material.ready();
    } catch (error) {
      view.fail(error);
      return false;
    }
  }
}

// Draws those views of a page that are in sight and not yet still. Returns what ends it.
function run(views) {
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const view = views.find(({ canvas }) => canvas === target);
      view.visible = isIntersecting;
      if (!isIntersecting) view.release();
    }
  }, { rootMargin: "100px" });
  const anew = () => views.forEach((view) => view.change());
  window.addEventListener("resize", anew);
  for (const view of views) {
    seen.observe(view.canvas);
    const loop = (view.renderer.loop ??= new Loop(view.renderer));
    loop.views.add(view);
    loop.begin();
  }
  return () => {
    seen.disconnect();
    window.removeEventListener("resize", anew);
    for (const view of views) {
      view.renderer.loop.views.delete(view);
      view.dispose();
    }
  };
}
