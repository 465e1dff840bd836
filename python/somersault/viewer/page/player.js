// The player: time, controls and gestures.

class Player {
  constructor(scene) {
    this.scene = scene;
    scene.motions = scene.motions.map(data => new Motion(data));
    this.canvas = document.getElementById("stage");
    this.controls = document.getElementById("controls").elements;
    this.camera = new Camera(scene);
    this.stage = new Stage(this.canvas, scene);
    this.t = 0;
    this.playing = scene.end > 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.arrange();
    this.listen();
    this.listenToGestures();
    this.obey(new URLSearchParams(location.hash.slice(1)));
    this.render();
  }

  /** Controls for what the scene has. */
  arrange() {
    const { scene, controls } = this;
    document.getElementById("timing").hidden = controls.speed.parentElement.hidden = scene.end === 0;
    controls.time.max = scene.end;
    controls.speed.value = scene.speed;
    controls.follow.checked = this.camera.follow;
    for (const name of Object.keys(ARROWS)) {
      const control = controls[name];
      control.parentElement.hidden = !scene.motions.some(motion => motion[name]);
      control.checked = scene.arrows.includes(name);
    }
    document.querySelector("label.force span").textContent = scene.force;
    controls.trails.parentElement.hidden = !scene.motions.some(motion => motion.trails.length);
    for (const [name, { title }] of Object.entries(VIEWS)) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = title;
      button.onclick = () => { this.camera.look(name); this.refresh(); };
      document.getElementById("views").append(button);
    }
    for (const [t] of scene.captions) {
      const mark = document.createElement("option");
      mark.value = t;
      document.getElementById("marks").append(mark);
    }
    this.labels = scene.panels.map((_, panel) => {
      const label = document.createElement("div");
      label.className = "label";
      for (const motion of scene.motions) {
        if (motion.panel !== panel || !motion.label) continue;
        const name = document.createElement("span");
        name.textContent = motion.label;
        name.style.setProperty("--colour", `rgb(${motion.colour.map(x => 255 * x)})`);
        label.append(name);
      }
      this.canvas.parentElement.append(label);
      return label;
    });
  }

  listen() {
    const { controls, canvas } = this;
    controls.play.onclick = () => this.play(!this.playing);
    controls.time.oninput = () => { this.play(false); this.show(Number(controls.time.value)); };
    for (const name of ["trails", ...Object.keys(ARROWS)]) controls[name].onchange = () => this.refresh();
    controls.follow.onchange = () => {
      this.camera.follow = controls.follow.checked;
      this.camera.shift = [0, 0, 0];
      this.refresh();
    };
    controls.full.onclick = () => {
      if (document.fullscreenElement) document.exitFullscreen();
      else document.documentElement.requestFullscreen().catch(() => { controls.full.hidden = true; });
    };
    controls.full.hidden = !document.fullscreenEnabled;
    document.addEventListener("keydown", event => {
      if (event.target.matches("input, select, button") || event.ctrlKey || event.metaKey || event.altKey) return;
      const step = { ArrowLeft: -1 / 60, ArrowRight: 1 / 60 }[event.key];
      if (event.key === " ") this.play(!this.playing);
      else if (step) { this.play(false); this.show(this.t + step * Number(controls.speed.value)); }
      else return;
      event.preventDefault();
    });
    new ResizeObserver(() => this.refresh()).observe(canvas);
    canvas.addEventListener("webglcontextlost", event => { event.preventDefault(); this.stage = null; });
    canvas.addEventListener("webglcontextrestored", () => {
      this.stage = new Stage(canvas, this.scene);
      this.refresh();
    });
  }

  /** One pointer turns, with shift or the right button slides; two pinch; the wheel approaches. */
  listenToGestures() {
    const { canvas, camera } = this, held = new Map();
    const spread = () => {
      const [a, b] = [...held.values()];
      return { apart: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
    };
    canvas.onpointerdown = event => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, { x: event.clientX, y: event.clientY });
    };
    canvas.onpointermove = event => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const now = { x: event.clientX, y: event.clientY }, height = canvas.clientHeight;
      if (held.size === 2) {
        const old = spread();
        held.set(event.pointerId, now);
        const fresh = spread();
        camera.approach(fresh.apart / (old.apart || 1));
        camera.slide((fresh.x - old.x) / height / camera.zoom, (old.y - fresh.y) / height / camera.zoom);
      } else if (held.size === 1) {
        const [right, down] = [(now.x - before.x) / height, (now.y - before.y) / height];
        if (event.shiftKey || event.buttons === 2) camera.slide(right, -down);
        else camera.turn(240 * right, 180 * down);
      }
      held.set(event.pointerId, now);
      this.refresh();
    };
    canvas.onpointerup = canvas.onpointercancel = event => held.delete(event.pointerId);
    canvas.oncontextmenu = event => event.preventDefault();
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      camera.approach(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.0012)));
      this.refresh();
    }, { passive: false });
  }

  /** What the address asks for after `#`: `t=0.5` holds the motion there, `view=front` chooses the camera. */
  obey(asked) {
    if (asked.get("view") in VIEWS) this.camera.look(asked.get("view"));
    const t = Number.parseFloat(asked.get("t"));
    this.play(this.playing && Number.isNaN(t));
    this.show(Number.isNaN(t) ? 0 : t - this.scene.start);
  }

  play(playing) {
    this.playing = playing;
    this.controls.play.textContent = playing ? "Pause" : "Play";
    this.before = null;
    this.refresh();
  }

  show(t) {
    this.t = Math.max(0, Math.min(this.scene.end, t));
    this.refresh();
  }

  /** Asks for a new picture. */
  refresh() {
    this.asked ??= requestAnimationFrame(clock => this.tick(clock));
  }

  tick(clock) {
    this.asked = null;
    if (this.playing && this.before !== null) {
      const t = this.t + (clock - this.before) / 1000 * Number(this.controls.speed.value);
      this.t = t > this.scene.end ? 0 : t;
    }
    this.before = clock;
    this.render();
    if (this.playing) this.refresh();
  }

  /** Draws the picture for the window, and says what time it is. */
  render() {
    const { canvas, controls, scene, t } = this, pixels = Math.min(window.devicePixelRatio || 1, 2);
    this.draw(Math.round(canvas.clientWidth * pixels), Math.round(canvas.clientHeight * pixels));
    controls.time.value = t;
    controls.shown.value = `${(scene.start + t).toFixed(scene.digits)} s`;
    const said = scene.captions.filter(([from]) => from <= t);
    document.getElementById("caption").textContent = said.length ? said[said.length - 1][1] : "";
  }

  draw(width, height) {
    const { canvas, scene, camera, controls } = this;
    if (!this.stage || !width || !height) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const shown = {};
    for (const name of ["trails", ...Object.keys(ARROWS)]) shown[name] = controls[name].checked;
    const n = scene.panels.length, beside = width > height, gap = Math.ceil(height / 400);
    this.stage.begin(width, height);
    scene.panels.forEach((_, panel) => {
      const whole = (beside ? width : height) + gap;
      const [from, to] = [Math.round(whole * panel / n), Math.round(whole * (panel + 1) / n) - gap];
      const area = beside ? [from, 0, to - from, height] : [0, height - to, width, to - from];
      const motions = scene.motions.filter(motion => motion.panel === panel);
      const seen = camera.seen(area[2] / area[3], motions, this.t);
      this.stage.draw(panel, area, this.t, seen, shown);
      const { style } = this.labels[panel];
      style.left = beside ? `${100 * panel / n}%` : 0;
      style.top = beside ? 0 : `${100 * panel / n}%`;
      style.maxWidth = beside ? `${100 / n}%` : "100%";
    });
  }

  /** The picture at a time of the motion as the address of an image, of a size in pixels. */
  picture(t, width, height) {
    this.t = Math.max(0, Math.min(this.scene.end, t));
    this.draw(width, height);
    return this.canvas.toDataURL("image/png");
  }
}

try {
  window.player = new Player(SCENE);
} catch (error) {
  const message = document.createElement("p");
  message.id = "failed";
  message.textContent = `The motion cannot be shown: ${error.message}.`;
  document.getElementById("stage").replaceWith(message);
  console.error(error);
}
