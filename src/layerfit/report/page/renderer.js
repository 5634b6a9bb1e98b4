// Draws materials with their exported shaders. One WebGL2 context serves a whole page: it draws out of sight, in linear float32, and
// what it has drawn is copied to the canvas of the view that asked.

const LIGHTS = 4;  // in one pass: the key light, and a point of each soft box

class Renderer {
  constructor() {
    this.canvas = document.createElement("canvas");
    const gl = this.canvas.getContext("webgl2", { alpha: true, antialias: false, premultipliedAlpha: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this browser cannot draw to float textures");
    this.gl = gl;
    this.age = 0;
    this.begin();
    // A driver may stop, and take all that it held along: it is asked to come back, and views draw anew when it does.
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => this.begin());
  }

  // What every picture needs of the driver; what views have of it is of one age.
  begin() {
    const { gl } = this;
    gl.getExtension("EXT_color_buffer_float");
    this.age += 1;
    this.meshes = {};
    this.add = this.link(GLSL["screen.vert"], GLSL["add.frag"]);
    this.show = this.link(GLSL["screen.vert"], GLSL["show.frag"]);
    this.nothing = gl.createVertexArray();
    this.asked = null;
    this.parallel = gl.getExtension("KHR_parallel_shader_compile");
  }

  get lost() {
    return this.gl.isContextLost();
  }

  // Marks the end of what was asked of the driver; it is `busy` until that is done.
  mark() {
    this.asked = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
  }

  get busy() {
    const gl = this.gl;
    if (!this.asked) return false;
    if (gl.getSyncParameter(this.asked, gl.SYNC_STATUS) === gl.UNSIGNALED) return true;
    gl.deleteSync(this.asked);
    this.asked = null;
    return false;
  }

  // A program, which a driver may compile beside other work: it is used when it is `ready`, which throws what the driver has against it.
  link(vertex, fragment) {
    const gl = this.gl;
    const program = gl.createProgram();
    const shaders = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].map(([type, text]) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      return shader;
    });
    gl.linkProgram(program);
    const places = {};
    let linked = false;
    const ready = () => {
      if (linked || this.lost) return linked;
      if (this.parallel && !gl.getProgramParameter(program, this.parallel.COMPLETION_STATUS_KHR)) return false;
      linked = gl.getProgramParameter(program, gl.LINK_STATUS);
      if (!linked && !this.lost) throw new Error([...shaders.map((s) => gl.getShaderInfoLog(s)), gl.getProgramInfoLog(program)].filter(Boolean).join("\n"));
      return linked;
    };
    return { program, ready, at: (name) => (places[name] ??= gl.getUniformLocation(program, name)) };
  }

  // A fragment shader as `layerfit export --target essl300` prints it, for so many lights.
  material(fragment) {
    return this.link(GLSL["mesh.vert"], fragment.replace("\n", `\n#define LF_LIGHTS ${LIGHTS}\n`));
  }

  mesh(shape) {
    return (this.meshes[shape] ??= this.upload(mesh(SHAPES[shape])));
  }

  upload({ vertices, triangles }) {
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
    [3, 3, 3, 2].reduce((offset, size, k) => {
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, size, gl.FLOAT, false, 44, 4 * offset);
      return offset + size;
    }, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    return { array, count: triangles.length, mode: gl.TRIANGLES };
  }

  // A float picture: what one pass draws to, with depth, or what passes are added up in.
  target(width, height, depth = false) {
    const gl = this.gl;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, height);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    const buffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    let render = null;
    if (depth) {
      render = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, render);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, render);
    }
    return { texture, buffer, render, width, height };
  }

  release(target) {
    this.gl.deleteTexture(target.texture);
    this.gl.deleteFramebuffer(target.buffer);
    if (target.render) this.gl.deleteRenderbuffer(target.render);
  }

  // Rows of one pass: a shape in a material, seen by a camera under lights [[x, y, z, w], [r, g, b]].
  draw(target, material, values, shape, camera, lights, row = 0, rows = target.height) {
    const gl = this.gl;
    const { program, at } = material;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.buffer);
    gl.viewport(0, 0, target.width, target.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, row, target.width, rows);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(program);
    for (const [name, value] of values) {
      if (value.length === 3) gl.uniform3fv(at(name), value);
      else if (value.length === 4) gl.uniform4fv(at(name), value);
      else if (value.length === 2) gl.uniform2fv(at(name), value);
      else gl.uniform1fv(at(name), value);
    }
    gl.uniformMatrix4fv(at("u_view_projection"), false, camera.matrix);
    gl.uniform3fv(at("u_eye"), camera.eye);
    gl.uniform3fv(at("u_up"), [0, 1, 0]);
    gl.uniform4fv(at("u_light"), lights.flatMap(([place]) => place));
    gl.uniform3fv(at("u_light_rgb"), lights.flatMap(([, rgb]) => rgb));
    const { array, count, mode } = this.mesh(shape);
    gl.bindVertexArray(array);
    gl.drawElements(mode, count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.SCISSOR_TEST);
  }

  screen({ program, at }, textures, numbers) {
    const gl = this.gl;
    gl.useProgram(program);
    Object.entries(textures).forEach(([name, texture], k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(at(name), k);
    });
    for (const [name, [set, value]] of Object.entries(numbers)) gl[set](at(name), value);
    gl.bindVertexArray(this.nothing);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  sum(to, total, pass) {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, to.buffer);
    this.gl.viewport(0, 0, to.width, to.height);
    this.screen(this.add, { u_total: total.texture, u_pass: pass.texture }, {});
  }

  // The mean of passes, as it is shown: onto the context of another canvas.
  present(total, passes, exposure, tone, context) {
    const gl = this.gl;
    if (this.canvas.width !== total.width || this.canvas.height !== total.height) {
      this.canvas.width = total.width;
      this.canvas.height = total.height;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, total.width, total.height);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.screen(this.show, { u_total: total.texture }, {
      u_passes: ["uniform1f", passes], u_exposure: ["uniform1f", exposure], u_tone: ["uniform1i", tone],
    });
    context.clearRect(0, 0, total.width, total.height);
    context.drawImage(this.canvas, 0, 0);
  }

  // Linear numbers of a target, row 0 at the bottom.
  read(target) {
    const out = new Float32Array(4 * target.width * target.height);
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, target.buffer);
    this.gl.readPixels(0, 0, target.width, target.height, this.gl.RGBA, this.gl.FLOAT, out);
    return out;
  }
}

// The camera that looks at the origin from a distance, 26 degrees across; `shift` moves the picture by parts of a pixel.
function camera(yaw, pitch, distance, width, height, shift = [0, 0]) {
  const back = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)];
  const right = unit(cross([0, 1, 0], back));
  const up = cross(back, right);
  const [near, far] = [distance - 2, distance + 2];
  const f = Math.min(height, width) / Math.tan((13 * Math.PI) / 180);
  const [x, y, dx, dy] = [f / width, f / height, (2 * shift[0]) / width, (2 * shift[1]) / height];
  const z = (far + near) / (far - near);
  const matrix = new Float32Array(16);
  for (let k = 0; k < 3; k++) matrix.set([x * right[k] - dx * back[k], y * up[k] - dy * back[k], -z * back[k], -back[k]], 4 * k);
  matrix.set([dx * distance, dy * distance, z * distance - (2 * far * near) / (far - near), distance], 12);
  return { eye: times(back, distance), matrix, right, up, back, scale: [x, y] };
}
