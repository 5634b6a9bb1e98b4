// Shapes to look at a material on: each a function of (u, v) in [0, 1]^2, as a mesh of positions, normals, tangents and texture coordinates.

const SHAPES = {
  sphere: { at: (u, v) => spherical(u, v), rows: 96, columns: 192 },
  torus: {
    at: (u, v) => {
      const [a, b] = [2 * Math.PI * u, 2 * Math.PI * v];
      const r = 0.68 - 0.32 * Math.cos(b);
      return turnedX([r * Math.sin(a), 0.32 * Math.sin(b), r * Math.cos(a)], 0.5);
    },
    rows: 96, columns: 192,
  },
  block: {  // a box with round edges: a superellipsoid
    at: (u, v) => {
      const d = spherical(u, v);
      const size = Math.pow(d.reduce((total, x) => total + Math.pow(Math.abs(x), 8), 0), 1 / 8);
      const [x, y, z] = d.map((c) => (0.64 * c) / size);
      return turnedX([0.82 * x + 0.57 * z, y, 0.82 * z - 0.57 * x], 0.25);
    },
    rows: 192, columns: 256,
  },
  vase: {
    at: (u, v) => {
      const r = 0.42 + 0.22 * Math.sin(6.1 * v + 3.6) + 0.05 * Math.cos(12 * v);
      return [r * Math.sin(2 * Math.PI * u), 0.98 - 1.96 * v, r * Math.cos(2 * Math.PI * u)];
    },
    rows: 128, columns: 192,
  },
  cloth: {
    at: (u, v) => {
      const [x, z] = [1.7 * (u - 0.5), 1.7 * (v - 0.5)];
      return turnedX([x, 0.12 * Math.sin(4.1 * x + 1.6 * z) + 0.07 * Math.cos(5.6 * z - 1.9 * x), z], 0.9);
    },
    rows: 128, columns: 128,
  },
};

function turnedX([x, y, z], angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [x, c * y - s * z, s * y + c * z];
}

function spherical(u, v) {
  const [phi, theta] = [2 * Math.PI * (u - 0.5), Math.PI * v];
  return [Math.sin(theta) * Math.sin(phi), Math.cos(theta), Math.sin(theta) * Math.cos(phi)];
}

const minus = (a, b) => a.map((x, k) => x - b[k]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const times = (a, s) => a.map((x) => x * s);
const unit = (a) => times(a, 1 / Math.max(Math.hypot(...a), 1e-12));

// Eleven numbers a vertex: position, normal, tangent, uv; and the vertices of its triangles.
function mesh({ at, rows, columns }) {
  const step = 1e-4;
  const vertices = new Float32Array(11 * (rows + 1) * (columns + 1));
  for (let j = 0, n = 0; j <= rows; j++) {
    for (let i = 0; i <= columns; i++, n += 11) {
      const u = i / columns;
      const v = Math.min(Math.max(j / rows, 2 * step), 1 - 2 * step);  // at a pole nothing has a direction
      const along = unit(minus(at(u + step, v), at(u - step, v)));
      const down = unit(minus(at(u, v + step), at(u, v - step)));
      vertices.set([...at(u, j / rows), ...unit(cross(down, along)), ...along, u, j / rows], n);
    }
  }
  const triangles = new Uint32Array(6 * rows * columns);
  for (let j = 0, n = 0; j < rows; j++) {
    for (let i = 0; i < columns; i++, n += 6) {
      const a = j * (columns + 1) + i;
      const b = a + columns + 1;
      triangles.set([a, b, a + 1, a + 1, b, b + 1], n);
    }
  }
  return { vertices, triangles };
}
