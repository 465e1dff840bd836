// The stage: bodies, what stands around them, trails and arrows, drawn by WebGL 2.

const SUN = unit([0.55, -0.62, 1.15]);
const SHADOW_TEXELS = 2048;
const OPENING = 30 * Math.PI / 180;
// The longest of all times is so many radii of the figure long; along each other the thin one sticks out.
const ARROWS = {
  momentum: { colour: [0.80, 0.20, 0.24], longest: 1.4, thickness: 0.016 },
  rate: { colour: [0.16, 0.22, 0.62], longest: 1.0, thickness: 0.026 },
  force: { colour: [0.05, 0.50, 0.22], longest: 1.4, thickness: 0.016 },
};
// Where a point touches, in radii of the figure.
const MARK = { colour: [1.0, 0.78, 0.0], radius: 0.024 };
// In place of the sun's view: it takes all out of the box of the shadows, where nothing is shaded.
const SHADELESS = aligned([0, 0, 1], [2, 2, 2], 0, 0);

class Stage {
  constructor(canvas, scene) {
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!this.gl) throw new Error("WebGL 2 is not available");
    this.scene = scene;
    const { gl } = this;
    this.programs = {
      solid: this.program(SOLID_VERTICES, SOLID_FRAGMENTS),
      depth: this.program(SOLID_VERTICES, DEPTH_FRAGMENTS),
      ground: this.program(PLANE_VERTICES, GROUND_FRAGMENTS),
      water: this.program(PLANE_VERTICES, WATER_FRAGMENTS),
      sky: this.program(SKY_VERTICES, SKY_FRAGMENTS),
      line: this.program(LINE_VERTICES, LINE_FRAGMENTS),
    };
    this.square = this.buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
    this.plane = gl.createVertexArray();
    gl.bindVertexArray(this.plane);
    this.attribute(0, 2, 0, 0);
    this.strip = this.buffer(new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]));
    this.shaft = this.solid(skin(SHAFT));
    this.head = this.solid(skin(HEAD));
    this.ball = this.solid(skin(BALL));
    this.fixed = scene.fixed.map(shape => this.shape(shape));
    this.figures = scene.motions.map(motion => motion.shapes.map(shape => this.shape(shape)));
    this.trails = scene.motions.map(motion => motion.trails.map(trail => this.trail(motion, trail)));
    this.arrowScale = {};
    for (const [name, { longest }] of Object.entries(ARROWS)) {
      this.arrowScale[name] = longest * scene.radius / (Math.max(...scene.motions.map(m => m.largest(name))) || 1);
    }
    this.makeShadows();
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  program(vertices, fragments) {
    const { gl } = this, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertices], [gl.FRAGMENT_SHADER, fragments]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(gl.getShaderInfoLog(shader));
      }
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(gl.getProgramInfoLog(program));
    }
    const uniforms = {};
    const n = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) || 0;
    for (let i = 0; i < n; i++) {
      const { name } = gl.getActiveUniform(program, i);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  buffer(data, target = this.gl.ARRAY_BUFFER) {
    const made = this.gl.createBuffer();
    this.gl.bindBuffer(target, made);
    this.gl.bufferData(target, data, this.gl.STATIC_DRAW);
    return made;
  }

  /** An attribute of the array bound, from the buffer bound. */
  attribute(index, size, stride, offset, divisor = 0) {
    this.gl.enableVertexAttribArray(index);
    this.gl.vertexAttribPointer(index, size, this.gl.FLOAT, false, stride, offset);
    this.gl.vertexAttribDivisor(index, divisor);
  }

  solid({ positions, normals, triangles }) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(positions);
    this.attribute(0, 3, 0, 0);
    this.buffer(normals);
    this.attribute(1, 3, 0, 0);
    this.buffer(triangles, gl.ELEMENT_ARRAY_BUFFER);
    return { array, count: triangles.length };
  }

  shape(data) {
    const made = mesh(data);
    return { ...data, ...this.solid(made), reach: reach(made), own: placed(data.quaternion, data.position) };
  }

  trail(motion, data) {
    const points = new Float32Array(3 * motion.times.length);
    motion.times.forEach((_, k) => points.set(motion.point(data, [k, 0]), 3 * k));
    return { ...data, motion, past: this.stretches(points), tip: this.stretches(new Float32Array(6)) };
  }

  /** Points as instances of a strip: each stretch begins where the one before it ends. */
  stretches(points) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.strip);
    this.attribute(0, 2, 0, 0);
    const buffer = this.buffer(points);
    this.attribute(1, 3, 12, 0, 1);
    this.attribute(2, 3, 12, 12, 1);
    return { array, buffer };
  }

  makeShadows() {
    const { gl } = this;
    this.shadows = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.shadows);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW_TEXELS, SHADOW_TEXELS);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    this.shadowBuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowBuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.shadows, 0);
    gl.drawBuffers([gl.NONE]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** Wipes the canvas. */
  begin(width, height) {
    const { gl } = this;
    gl.scissor(0, 0, width, height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** Draws the motions of one panel into a rectangle of the canvas. */
  draw(panel, [left, bottom, width, height], t, camera, shown) {
    const { gl, scene } = this;
    const solids = this.fixed.map(shape => ({ ...shape, model: shape.own }));
    const lines = [], arrows = [], touches = [];
    scene.motions.forEach((motion, m) => {
      if (motion.panel !== panel) return;
      const where = motion.locate(t), bodies = new Map();
      for (const shape of this.figures[m]) {
        if (!bodies.has(shape.body)) {
          const [position, quaternion] = motion.pose(shape.body, where);
          bodies.set(shape.body, placed(quaternion, position));
        }
        // A marker that was not seen.
        if (Number.isNaN(bodies.get(shape.body)[12])) continue;
        solids.push({ ...shape, model: product(bodies.get(shape.body), shape.own) });
      }
      for (const name of Object.keys(ARROWS)) {
        if (!shown[name]) continue;
        const drawn = motion.arrows(name, t).flatMap(([from, vector]) => this.arrow(name, from, vector));
        (name === "force" ? touches : arrows).push(...drawn);
      }
      touches.push(...motion.touching(t).map(([at]) => this.mark(at)));
      if (shown.trails) lines.push(...this.trails[m].map(trail => ({ trail, where })));
    });
    const light = this.castShadows(solids);
    gl.viewport(left, bottom, width, height);
    gl.scissor(left, bottom, width, height);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const far = 16 * camera.distance + 60 * scene.radius;
    const view = product(
      perspective(OPENING, width / height, camera.distance / 200, far),
      looking(camera.eye, camera.target, camera.up),
    );
    const common = { view, light: light.matrix, sun: SUN, eye: camera.eye, shadowed: light.texel };
    this.backdrop(camera, width / height);
    this.drawSolids(this.programs.solid, [...solids, ...arrows], common);
    const planes = { ...common, reach: 10 * camera.distance + 30 * scene.radius, spacing: scene.spacing, time: 0.8 * t };
    if (scene.ground !== null) this.drawPlane("ground", scene.ground, planes, camera);
    this.drawLines(lines, view, [width, height], t);
    if (scene.water !== null) {
      gl.enable(gl.BLEND);
      this.drawPlane("water", scene.water, planes, camera);
      gl.disable(gl.BLEND);
    }
    // Bodies hide where they touch, so that is drawn over all.
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.drawSolids(this.programs.solid, touches, { ...common, light: SHADELESS });
  }

  backdrop({ eye, target, up }, aspect) {
    const { gl } = this, tangent = Math.tan(OPENING / 2);
    const forward = unit(subtract(target, eye)), across = unit(cross(forward, up)), above = cross(across, forward);
    this.use(this.programs.sky, { forward, across: scale(across, tangent * aspect), above: scale(above, tangent) });
    gl.bindVertexArray(this.plane);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  drawPlane(name, level, common, camera) {
    const { gl } = this, used = this.programs[name];
    this.use(used, { ...common, middle: [camera.target[0], camera.target[1], level] });
    gl.bindVertexArray(this.plane);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  mark(at) {
    const radius = MARK.radius * this.scene.radius;
    return { ...this.ball, colour: MARK.colour, checkered: 0, model: aligned([0, 0, 1], at, radius, radius) };
  }

  arrow(name, from, vector) {
    const along = this.arrowScale[name] * length(vector), { colour, thickness } = ARROWS[name];
    const thick = thickness * this.scene.radius;
    const head = Math.min(5.5 * thick, 0.6 * along);
    if (along < 1e-3 * this.scene.radius) return [];
    const way = unit(vector), neck = add(from, scale(way, along - head));
    const look = { colour, checkered: 0 };
    return [
      { ...this.shaft, ...look, model: aligned(way, from, along - head, thick) },
      { ...this.head, ...look, model: aligned(way, neck, head, 0.43 * head) },
    ];
  }

  /** Depths seen from the sun, in a box just around all that casts a shadow. */
  castShadows(solids) {
    const { gl } = this;
    const view = looking(SUN, [0, 0, 0], [0, 1, 0]);
    let low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const { model, reach } of solids) {
      const at = transformed(view, [model[12], model[13], model[14]]);
      low = low.map((x, i) => Math.min(x, at[i] - reach));
      high = high.map((x, i) => Math.max(x, at[i] + reach));
    }
    const span = Math.max(...subtract(high, low)), level = this.scene.ground ?? this.scene.water;
    // The box reaches down to where shadows fall.
    if (level !== null) {
      const corners = [[low[0], low[1]], [high[0], low[1]], [low[0], high[1]], [high[0], high[1]]];
      for (const [x, y] of corners) low[2] = Math.min(low[2], this.depthOf(view, x, y, level));
    }
    low = [low[0] - 0.01 * span, low[1] - 0.01 * span, low[2] - 0.01 * span];
    high = [high[0] + 0.01 * span, high[1] + 0.01 * span, high[2] + 0.01 * span];
    const matrix = product(orthographic(low, high), view);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowBuffer);
    gl.viewport(0, 0, SHADOW_TEXELS, SHADOW_TEXELS);
    gl.scissor(0, 0, SHADOW_TEXELS, SHADOW_TEXELS);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.drawSolids(this.programs.depth, solids, { view: matrix });
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return { matrix, texel: 2 * Math.max(high[0] - low[0], high[1] - low[1]) / SHADOW_TEXELS };
  }

  /** The third coordinate, in the sun's view, of a level plane of the world. */
  depthOf(view, x, y, level) {
    return (level - view[8] * x - view[9] * y) / view[10] + view[14];
  }

  /** The program with its uniforms: numbers, vectors and matrices by their length. */
  use({ program, uniforms }, values) {
    const { gl } = this;
    gl.useProgram(program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, "shadows" in uniforms ? this.shadows : null);
    for (const [name, value] of Object.entries(values)) this.set(uniforms, name, value);
  }

  set(uniforms, name, value) {
    const { gl } = this, at = uniforms[name];
    if (at === undefined) return;
    if (typeof value === "number") gl.uniform1f(at, value);
    else if (value.length === 16) gl.uniformMatrix4fv(at, false, value);
    else if (value.length === 3) gl.uniform3fv(at, value);
    else gl.uniform2fv(at, value);
  }

  drawSolids(used, solids, common) {
    const { gl } = this;
    this.use(used, { ...common, opacity: 1 });
    for (const { array, count, model, colour, checkered } of solids) {
      this.set(used.uniforms, "model", model);
      this.set(used.uniforms, "colour", colour);
      this.set(used.uniforms, "checkered", checkered);
      gl.bindVertexArray(array);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, 0);
    }
  }

  drawLines(lines, view, pixels, t) {
    const { gl } = this, used = this.programs.line;
    this.use(used, { view, pixels, width: 2.4 * Math.min(window.devicePixelRatio || 1, 2), opacity: 1 });
    for (const { trail, where } of lines) {
      const { motion } = trail, [k, s] = where;
      this.set(used.uniforms, "colour", trail.colour);
      gl.bindVertexArray(trail.past.array);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, k);
      if (s === 0) continue;
      const tip = [...motion.point(trail, [k, 0]), ...motion.point(trail, where)];
      gl.bindBuffer(gl.ARRAY_BUFFER, trail.tip.buffer);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, new Float32Array(tip));
      gl.bindVertexArray(trail.tip.array);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, 1);
    }
  }
}
