// A motion: poses at times, and between them on the group.

/** The sample before t and how far t is on the way to the next; the ends hold. */
function locate(times, t) {
  const last = times.length - 1;
  if (last === 0 || t <= times[0]) return [0, 0];
  if (t >= times[last]) return [last - 1, 1];
  let low = 0, high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle; else high = middle;
  }
  return [low, (t - times[low]) / (times[high] - times[low])];
}

/** The vector there, of those that go with samples. */
function vectorAt(vectors, [k, s]) {
  const from = Array.from(vectors.subarray(3 * k, 3 * k + 3));
  return s === 0 ? from : mix(from, vectors.subarray(3 * k + 3, 3 * k + 6), s);
}

class Motion {
  constructor(data) {
    Object.assign(this, data);
    this.times = floats(data.times);
    this.poses = floats(data.poses);
    this.center = floats(data.center);
    for (const name of ["momentum", "rate"]) this[name] = data[name] && floats(data[name]);
    this.force = data.force?.map(at => ({
      ...at, times: floats(at.times), forces: floats(at.forces), offsets: at.offsets && floats(at.offsets),
    }));
  }

  locate(t) {
    return locate(this.times, t);
  }

  /** Position and quaternion of a body. */
  pose(body, [k, s]) {
    const at = i => 7 * (i * this.bodies + body);
    const from = this.poses.subarray(at(k), at(k) + 7);
    if (s === 0) return [Array.from(from.subarray(0, 3)), Array.from(from.subarray(3))];
    const to = this.poses.subarray(at(k + 1), at(k + 1) + 7);
    return [
      mix(Array.from(from.subarray(0, 3)), to, s),
      slerp(Array.from(from.subarray(3)), Array.from(to.subarray(3)), s),
    ];
  }

  /** A vector that goes with the samples: center, momentum or rate. */
  vector(name, where) {
    return vectorAt(this[name], where);
  }

  /** Where a point of a body, or without a body the center of mass, is. */
  point({ body, point }, where) {
    if (body === null) return this.vector("center", where);
    const [position, quaternion] = this.pose(body, where);
    return add(position, rotate(quaternion, point));
  }

  /** The points that touch at a time, and the forces on them. */
  touching(t) {
    const where = this.locate(t);
    const found = (this.force ?? []).map(at => {
      const when = locate(at.times, t), point = this.point(at, where);
      return [at.offsets ? add(point, vectorAt(at.offsets, when)) : point, vectorAt(at.forces, when)];
    });
    return found.filter(([, force]) => length(force) > 0);
  }

  /** Where vectors of a name start at a time, and they. */
  arrows(name, t) {
    if (name === "force") return this.touching(t);
    const where = this.locate(t);
    return this[name] ? [[this.vector("center", where), this.vector(name, where)]] : [];
  }

  largest(name) {
    const all = name === "force" ? (this.force ?? []).map(at => at.forces) : [this[name] ?? []];
    let largest = 0;
    for (const vectors of all) {
      for (let k = 0; 3 * k < vectors.length; k++) largest = Math.max(largest, length(vectorAt(vectors, [k, 0])));
    }
    return largest;
  }
}
