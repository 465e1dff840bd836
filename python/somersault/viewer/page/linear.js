// Vectors, unit quaternions (x, y, z, w) and matrices of WebGL (columns first).

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = a => Math.hypot(a[0], a[1], a[2]);
const unit = a => scale(a, 1 / (length(a) || 1));
const mix = (a, b, s) => a.map((x, i) => x + (b[i] - x) * s);

/** The shortest way between two orientations, at the fraction s of it. */
function slerp(a, b, s) {
  let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const sign = cosine < 0 ? -1 : 1;
  cosine *= sign;
  let from = 1 - s, to = s;
  if (cosine < 0.9995) {
    const angle = Math.acos(cosine), sine = Math.sin(angle);
    from = Math.sin(from * angle) / sine;
    to = Math.sin(to * angle) / sine;
  }
  const q = a.map((x, i) => from * x + sign * to * b[i]);
  const norm = Math.hypot(...q);
  return q.map(x => x / norm);
}

function rotate(q, p) {
  const t = scale(cross(q, p), 2), u = cross(q, t);
  return [p[0] + q[3] * t[0] + u[0], p[1] + q[3] * t[1] + u[1], p[2] + q[3] * t[2] + u[2]];
}

/** The matrix of a rotation and then a translation. */
function placed([x, y, z, w], p) {
  return new Float32Array([
    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0,
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0,
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0,
    p[0], p[1], p[2], 1,
  ]);
}

/** The matrix that takes the z axis to `axis`, scaled by `along` there and by `across` beside it. */
function aligned(axis, origin, along, across) {
  const z = unit(axis);
  const x = unit(cross(Math.abs(z[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], z)), y = cross(z, x);
  return new Float32Array([
    ...scale(x, across), 0, ...scale(y, across), 0, ...scale(z, along), 0, ...origin, 1,
  ]);
}

function product(a, b) {
  const c = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      c[4 * column + row] = sum;
    }
  }
  return c;
}

const transformed = (m, p) => [0, 1, 2].map(i => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]);

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2);
  return new Float32Array([
    f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0,
  ]);
}

/** The box from `low` to `high`, of which the eye looks along −z, to the cube of WebGL. */
function orthographic(low, high) {
  const [sx, sy, sz] = subtract(high, low);
  return new Float32Array([
    2 / sx, 0, 0, 0, 0, 2 / sy, 0, 0, 0, 0, -2 / sz, 0,
    -(high[0] + low[0]) / sx, -(high[1] + low[1]) / sy, (high[2] + low[2]) / sz, 1,
  ]);
}

function looking(eye, target, up) {
  const z = unit(subtract(eye, target)), x = unit(cross(up, z)), y = cross(z, x);
  return new Float32Array([
    x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1,
  ]);
}
