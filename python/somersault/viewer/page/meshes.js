// Meshes: positions, normals, triangles.

const COLUMNS = 32;

/** A skin over elliptic rings (z, x, y, half width along x, along y); two equal rings make an edge. */
function skin(rings) {
  const n = rings.length / 5, positions = [], triangles = [];
  for (let i = 0; i < n; i++) {
    const [z, x, y, a, b] = rings.subarray(5 * i, 5 * i + 5);
    for (let j = 0; j < COLUMNS; j++) {
      const angle = 2 * Math.PI * j / COLUMNS;
      positions.push(x + a * Math.cos(angle), y + b * Math.sin(angle), z);
    }
    const edge = i > 0 && [0, 1, 2, 3, 4].every(k => rings[5 * i + k] === rings[5 * i - 5 + k]);
    for (let j = 0; i > 0 && !edge && j < COLUMNS; j++) {
      const next = (j + 1) % COLUMNS, low = COLUMNS * (i - 1), high = COLUMNS * i;
      triangles.push(low + j, low + next, high + next, low + j, high + next, high + j);
    }
  }
  return smooth(positions, triangles);
}

/** Normals of vertices: the mean of the faces around them, by area. */
function smooth(positions, triangles) {
  const normals = new Float32Array(positions.length);
  const point = k => positions.slice(3 * k, 3 * k + 3);
  for (let i = 0; i < triangles.length; i += 3) {
    const corners = triangles.slice(i, i + 3), [a, b, c] = corners.map(point);
    const normal = cross(subtract(b, a), subtract(c, a));
    for (const k of corners) for (let axis = 0; axis < 3; axis++) normals[3 * k + axis] += normal[axis];
  }
  return { positions: new Float32Array(positions), normals, triangles: new Uint16Array(triangles) };
}

function cuboid(lengths) {
  const positions = [], normals = [], triangles = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      const first = positions.length / 3, [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
      for (const [s, t] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        const corner = [0, 0, 0], normal = [0, 0, 0];
        corner[axis] = side * lengths[axis] / 2;
        corner[u] = s * lengths[u] / 2;
        corner[v] = t * lengths[v] / 2;
        normal[axis] = side;
        positions.push(...corner);
        normals.push(...normal);
      }
      triangles.push(...(side > 0 ? [0, 1, 2, 0, 2, 3] : [0, 2, 1, 0, 3, 2]).map(k => first + k));
    }
  }
  return {
    positions: new Float32Array(positions), normals: new Float32Array(normals), triangles: new Uint16Array(triangles),
  };
}

function floats(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

function mesh({ lengths, vertices, triangles, rings }) {
  if (lengths) return cuboid(lengths);
  return vertices ? smooth(Array.from(floats(vertices)), Array.from(floats(triangles))) : skin(floats(rings));
}

/** The distance of the farthest vertex from the origin of the mesh. */
function reach({ positions }) {
  let largest = 0;
  for (let i = 0; i < positions.length; i += 3) {
    largest = Math.max(largest, Math.hypot(positions[i], positions[i + 1], positions[i + 2]));
  }
  return largest;
}

// Of length 1 along z; the width is scaled in use.
const SHAFT = new Float32Array([0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1, 1, 1, 0, 0, 1, 1, 1, 0, 0, 1, 1, 1, 0, 0, 0, 0]);
const HEAD = new Float32Array([0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0]);

// Of radius 1.
const BALL = new Float32Array([...Array(17).keys()].flatMap(k => {
  const angle = Math.PI * (k / 16 - 0.5), across = Math.cos(angle);
  return [Math.sin(angle), 0, 0, across, across];
}));
