// Runs what shader/program.py writes: the steps of a traced function, on flat arrays of numbers. It knows arithmetic, no model.

const ELEMENTWISE = {
  abs: Math.abs, cos: Math.cos, exp: Math.exp, expm1: Math.expm1, floor: Math.floor, log: Math.log, log1p: Math.log1p,
  sign: Math.sign, sin: Math.sin, sqrt: Math.sqrt, tanh: Math.tanh, neg: (a) => -a, not: (a) => +!a,
  add: (a, b) => a + b, sub: (a, b) => a - b, mul: (a, b) => a * b, div: (a, b) => a / b, pow: Math.pow, max: Math.max, min: Math.min,
  eq: (a, b) => +(a === b), ne: (a, b) => +(a !== b), lt: (a, b) => +(a < b), le: (a, b) => +(a <= b), gt: (a, b) => +(a > b),
  ge: (a, b) => +(a >= b), whole_div: (a, b) => Math.trunc(a / b), and: (a, b) => a & b, or: (a, b) => a | b, select_n: (which, no, yes) => (which ? yes : no),
};

const product = (sizes) => sizes.reduce((a, b) => a * b, 1);

// Another shape over the numbers of an array: its rows in order, each by its strides.
function view(a, shape, strides, start) {
  const out = new Float64Array(product(shape));
  let n = 0;
  const walk = (axis, at) => {
    if (axis === shape.length) out[n++] = a[at];
    else for (let k = 0; k < shape[axis]; k++) walk(axis + 1, at + k * strides[axis]);
  };
  walk(0, start);
  return out;
}

function join(parts, rows) {
  const widths = parts.map((part) => part.length / rows);
  const out = new Float64Array(rows * widths.reduce((a, b) => a + b, 0));
  let n = 0;
  for (let row = 0; row < rows; row++) {
    parts.forEach((part, k) => {
      out.set(part.subarray(row * widths[k], (row + 1) * widths[k]), n);
      n += widths[k];
    });
  }
  return out;
}

function matmul(a, b, batch, rows, inner, columns) {
  const out = new Float64Array(batch * rows * columns);
  for (let i = 0; i < batch * rows; i++) {
    const from = Math.floor(i / rows) * inner * columns;
    for (let k = 0; k < inner; k++) {
      const x = a[i * inner + k];
      if (x !== 0) for (let j = 0; j < columns; j++) out[i * columns + j] += x * b[from + k * columns + j];
    }
  }
  return out;
}

// Rows of numbers to one each.
const REDUCE = {
  sum: (row) => row.reduce((a, b) => a + b, 0),
  largest: (row) => row.reduce((a, b) => Math.max(a, b), -Infinity),
  place: (row) => row.reduce((best, x, k) => (x > row[best] ? k : best), 0),
};

function reduce(f, a, width) {
  return Float64Array.from({ length: a.length / width }, (_, k) => f(a.subarray(k * width, (k + 1) * width)));
}

// Numbers of an array by rows of indices, each held inside and times its stride, and an offset for each result.
function pick(a, indices, rows, offsets, starts) {
  return Float64Array.from(rows, (row, k) => a[starts.reduce(
    (at, [stride, last], j) => at + stride * Math.min(Math.max(indices[row * starts.length + j], 0), last), offsets[k])]);
}

function sort(rows) {
  const order = Array.from(rows[0].keys()).sort((i, j) => rows[0][i] - rows[0][j]);
  return rows.map((row) => Float64Array.from(order, (k) => row[k]));
}

function elementwise(f, a, b, c) {
  const out = new Float64Array(a.length);
  if (c) for (let k = 0; k < out.length; k++) out[k] = f(a[k], b[k], c[k]);
  else if (b) for (let k = 0; k < out.length; k++) out[k] = f(a[k], b[k]);
  else for (let k = 0; k < out.length; k++) out[k] = f(a[k]);
  return out;
}

// A body run once for each row, with what is carried from one run to the next; returns that and the rows of what else it gives.
function loop(body, length, constants, carries, operands) {
  const fixed = operands.slice(0, constants);
  let carried = operands.slice(constants, constants + carries);
  const rows = operands.slice(constants + carries);
  const made = [];
  for (let k = 0; k < length; k++) {
    const results = body([...fixed, ...carried, ...rows.map((a) => a.subarray((k * a.length) / length, ((k + 1) * a.length) / length))]);
    carried = results.slice(0, carries);
    results.slice(carries).forEach((part, n) => (made[n] ??= []).push(part));
  }
  return [...carried, ...made.map((parts) => join(parts, 1))];
}

const numbers = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);

// One step as a function of the arrays that it reads.
function stepOf(kind, p) {
  switch (kind) {
    case "view": return (a) => view(a, ...p);
    case "join": return (...parts) => join(parts, p[0]);
    case "matmul": return (a, b) => matmul(a, b, ...p);
    case "pick": return (a, indices) => pick(a, indices, ...p);
    case "sort": return (...rows) => sort(rows);
    case "sum": case "largest": case "place": return (a) => reduce(REDUCE[kind], a, p[0]);
    case "loop": {
      const body = compile(p[0]);
      return (...operands) => loop(body, p[1], p[2], p[3], operands);
    }
    default: return (...operands) => elementwise(ELEMENTWISE[kind], ...operands);
  }
}

// A program as a function of a list of arrays that returns one.
function compile(program) {
  const memory = new Array(program.size);
  for (const [place, length, value] of program.arrays) {
    memory[place] = typeof value === "number" ? new Float64Array(length).fill(value) : Float64Array.from(numbers(value));
  }
  const steps = program.steps.map(([kind, result, operands, ...p]) => [stepOf(kind, p), result, operands]);
  return (inputs) => {
    program.inputs.forEach((place, k) => { memory[place] = inputs[k]; });
    for (const [step, result, operands] of steps) {
      const made = step(...operands.map((place) => memory[place]));
      if (Array.isArray(result)) result.forEach((place, k) => { memory[place] = made[k]; });
      else memory[result] = made;
    }
    return program.outputs.map((place) => memory[place]);
  };
}
