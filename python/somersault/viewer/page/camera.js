// The camera: it turns about a point, which may be the center of mass.

/** Azimuth of the eye from +x towards +y and elevation, degrees. */
const VIEWS = {
  corner: { title: "Corner", azimuth: -52, elevation: 16 },
  side: { title: "Side", azimuth: -90, elevation: 5 },
  front: { title: "Front", azimuth: 0, elevation: 5 },
  top: { title: "Top", azimuth: -90, elevation: 89.9 },
};

class Camera {
  constructor(scene) {
    this.scene = scene;
    this.follow = scene.camera.follow;
    this.look(scene.camera.view);
    this.zoom = scene.camera.zoom;
  }

  /** Takes a view, with all of it in sight. */
  look(name) {
    this.framed = VIEWS[name];
    ({ azimuth: this.azimuth, elevation: this.elevation } = this.framed);
    this.zoom = 1;
    this.shift = [0, 0, 0];
  }

  turn(right, up) {
    this.azimuth -= right;
    this.elevation = Math.max(-89.9, Math.min(89.9, this.elevation + up));
  }

  /** Nearer by a factor. */
  approach(factor) {
    this.zoom = Math.max(0.02, Math.min(50, this.zoom * factor));
  }

  /** Moves the target across the view, by fractions of the height of the picture. */
  slide(right, up) {
    const { eye, target, distance } = this.seen(1, this.scene.motions, 0);
    const forward = unit(subtract(target, eye)), across = unit(cross(forward, [0, 0, 1])), above = cross(across, forward);
    const height = 2 * distance * Math.tan(OPENING / 2);
    this.shift = add(this.shift, add(scale(across, -right * height), scale(above, -up * height)));
  }

  /** Where the eye is and what it looks at. */
  seen(aspect, motions, t) {
    const [low, high] = this.follow ? this.around(motions, t) : this.scene.region;
    const target = add(scale(add(low, high), 0.5), this.shift), distance = this.fit(aspect) / this.zoom;
    const [a, e] = [this.azimuth * Math.PI / 180, this.elevation * Math.PI / 180];
    const way = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    return { eye: add(target, scale(way, distance)), target, distance, up: [0, 0, 1] };
  }

  /** The distance from which all is in sight in the view taken last, whichever way the camera turned since. */
  fit(aspect) {
    const { radius, region } = this.scene, tangent = Math.tan(OPENING / 2);
    if (this.follow) return radius * (1.05 / tangent * Math.max(1, 1 / aspect) + 0.3);
    // The half widths, across, up and away, of the ellipsoid with those of the region.
    const [x, y, z] = scale(subtract(region[1], region[0]), 0.5);
    const [a, e] = [this.framed.azimuth * Math.PI / 180, this.framed.elevation * Math.PI / 180];
    const wide = Math.hypot(x * Math.sin(a), y * Math.cos(a)), deep = Math.hypot(x * Math.cos(a), y * Math.sin(a));
    const tall = Math.hypot(z * Math.cos(e), deep * Math.sin(e)), near = Math.hypot(deep * Math.cos(e), z * Math.sin(e));
    return 1.08 * Math.max(tall, wide / aspect) / tangent + near;
  }

  /** The box about the centers of mass at a time. */
  around(motions, t) {
    const centers = motions.map(motion => motion.vector("center", motion.locate(t)));
    const extreme = choose => [0, 1, 2].map(i => centers.reduce((x, p) => choose(x, p[i]), centers[0][i]));
    return [extreme(Math.min), extreme(Math.max)];
  }
}
