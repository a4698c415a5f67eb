/* The page of a grasp, or of two beside each other: draws what the page's JSON says, with three.js. */
'use strict';

const page = JSON.parse(document.getElementById('data').textContent);
const css = getComputedStyle(document.documentElement);
const colour = (name) => new THREE.Color(css.getPropertyValue(`--${name}`).trim());
const $ = (id) => document.getElementById(id);
const mm = (metres, digits = 1) =>
  Number.isFinite(metres) ? `${(1000 * metres).toFixed(digits).replace('-', '\u2212')} mm` : 'not known';

function numbers(text, kind) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return new kind(bytes.buffer);
}
const floats = (text) => numbers(text, Float32Array);
const integers = (text) => numbers(text, Uint32Array);
const at = (array, index) => new THREE.Vector3(array[3 * index], array[3 * index + 1], array[3 * index + 2]);
const known = (vector) => Number.isFinite(vector.x + vector.y + vector.z);

/* Let a material be seen through, or not. */
function see(material, through) {
  if (material.transparent === through) return;
  Object.assign(material, { transparent: through, opacity: through ? 0.5 : 1, needsUpdate: true });
}

/* Layers, in the order of the keys 1 to 7. */
const LAYERS = ['object', 'hand', 'spheres', 'hull', 'feature', 'contacts', 'map'];

/* One grasp as three.js objects. */
class GraspView {
  constructor(data) {
    this.data = data;
    this.root = new THREE.Group();
    this.object = new THREE.Group();
    this.hand = new THREE.Group();
    this.held = new THREE.Group();
    this.root.add(this.object, this.hand);
    this.object.add(this.held);
    this.nodes = floats(data.nodes);
    this.radii = floats(data.radii);
    this.motion = data.motion && Object.fromEntries(
      Object.entries(data.motion).map(([name, value]) =>
        [name, name === 'touching' ? integers(value) : typeof value === 'string' ? floats(value) : value]));
    this.addObject();
    this.addHand();
    this.addHull();
    this.addContacts();
    this.start = this.pose(this.motion ? this.motion.snapshot : 0) || new THREE.Matrix4();
    this.show(0);
  }

  /* --- what does not change ---------------------------------------------------------------------- */

  addObject() {
    const surface = this.data.surface;
    const geometry = new THREE.BufferGeometry();
    this.points = floats(surface.points);
    geometry.setAttribute('position', new THREE.BufferAttribute(this.points, 3));
    geometry.setAttribute('normal', new THREE.BufferAttribute(floats(surface.normals), 3));
    geometry.setAttribute('color', new THREE.BufferAttribute(new Float32Array(this.points.length), 3));
    geometry.setIndex(new THREE.BufferAttribute(integers(surface.faces), 1));
    const material = new THREE.MeshPhongMaterial(
      { vertexColors: true, side: THREE.DoubleSide, shininess: 24, specular: 0x222222 });
    this.surface = new THREE.Mesh(geometry, material);
    this.surface.userData.tip = (hit) => this.pointTip(hit);
    this.feature = new Set(integers(this.data.feature));
    const map = this.data.map;
    this.gaps = new Map();
    if (map) {
      const gaps = floats(map.gaps);
      integers(map.points).forEach((point, i) => this.gaps.set(point, gaps[i]));
    }
    this.object.add(this.surface);
  }

  paint(layers) {
    const [plain, green] = [colour('object'), colour('feature')];
    const steps = page.scale.map((text) => new THREE.Color(text));
    const colours = this.surface.geometry.attributes.color;
    const useMap = layers.map && this.gaps.size;
    for (let i = 0; i < colours.count; i++) {
      let chosen = layers.feature && this.feature.has(i) ? green : plain;
      if (useMap) {
        const [near, far] = page.map_range;
        const gap = this.gaps.has(i) ? this.gaps.get(i) : far;
        const share = Math.min(1, Math.max(0, (far - gap) / (far - near))) * (steps.length - 1);
        const step = Math.min(steps.length - 2, Math.floor(share));
        chosen = steps[step].clone().lerp(steps[step + 1], share - step);
      }
      colours.setXYZ(i, chosen.r, chosen.g, chosen.b);
    }
    colours.needsUpdate = true;
  }

  addHand() {
    const skin = new THREE.MeshPhongMaterial({ color: colour('hand'), shininess: 18, specular: 0x222222 });
    this.skin = skin;
    /* Seen through, the hand is one body: its nearest surface is laid into the depth first. */
    this.depth = new THREE.MeshBasicMaterial({ colorWrite: false });
    this.segments = this.data.segments.map(([name, start, end]) => {
      const [r0, r1] = [this.radii[start], this.radii[end]].map((r) => page.capsule_share * r);
      const geometry = new THREE.CylinderGeometry(r1, r0, 1, 24, 1, true);
      const cap = new THREE.SphereGeometry(r0, 20, 14);
      const parts = [new THREE.Mesh(geometry, skin), new THREE.Mesh(cap, skin),
        new THREE.Mesh(new THREE.SphereGeometry(r1, 20, 14), skin)];
      const shadows = parts.map((part) => new THREE.Mesh(part.geometry, this.depth));
      parts.forEach((part) => { part.userData.tip = () => `segment ${name}`; });
      const group = new THREE.Group();
      group.add(...shadows, ...parts);
      shadows.forEach((part) => { part.renderOrder = 1; });
      parts.forEach((part) => { part.renderOrder = 2; });
      this.hand.add(group);
      return { start, end, parts, shadows, group };
    });
    const unit = new THREE.SphereGeometry(1, 24, 16);
    this.spheres = page.sites.map((site, i) => {
      const sphere = new THREE.Mesh(unit, new THREE.MeshPhongMaterial({ shininess: 30, specular: 0x333333 }));
      sphere.scale.setScalar(this.radii[i]);
      sphere.userData.tip = () => this.siteTip(i);
      const shadow = new THREE.Mesh(unit, this.depth);
      shadow.renderOrder = 1;
      sphere.add(shadow);
      this.root.add(sphere);
      return sphere;
    });
  }

  addHull() {
    const hull = this.data.hull;
    if (!hull) return;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(floats(hull.vertices), 3));
    geometry.setIndex(new THREE.BufferAttribute(integers(hull.faces), 1));
    geometry.computeVertexNormals();
    const material = new THREE.MeshPhongMaterial(
      { color: colour('hull'), transparent: true, opacity: 0.24, depthWrite: false, side: THREE.DoubleSide });
    this.hull = new THREE.Mesh(geometry, material);
    this.hull.renderOrder = 3;
    this.hull.userData.tip = () => `hand enclosing space\n${(1e6 * hull.volume).toFixed(1)} cm\u00b3`;
    const edges = new THREE.LineSegments(
      new THREE.EdgesGeometry(geometry, 12),
      new THREE.LineBasicMaterial({ color: colour('hull'), transparent: true, opacity: 0.45 }));
    edges.renderOrder = 3;
    this.hull.add(edges);
    this.held.add(this.hull);
  }

  addContacts() {
    this.contacts = new THREE.Group();
    const material = new THREE.MeshPhongMaterial({ color: colour('contact'), shininess: 40 });
    const [positions, normals] = [floats(this.data.contacts.positions), floats(this.data.contacts.normals)];
    this.data.contacts.sites.forEach((site, i) => {
      const [point, normal] = [at(positions, i), at(normals, i)];
      if (!known(point)) return;
      const bead = new THREE.Mesh(new THREE.SphereGeometry(0.0028, 16, 12), material);
      bead.position.copy(point);
      const parts = [bead];
      if (known(normal)) {
        const needle = new THREE.Mesh(new THREE.CylinderGeometry(0.0004, 0.0009, 0.018, 10), material);
        needle.position.copy(point).addScaledVector(normal, 0.009);
        needle.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), normal.normalize());
        parts.push(needle);
      }
      const gap = floats(this.data.gap)[page.sites.indexOf(site)];
      parts.forEach((part) => { part.userData.tip = () => `contact of ${site}\ngap ${mm(gap)}`; });
      this.contacts.add(...parts);
    });
    this.held.add(this.contacts);
  }

  /* --- what moves --------------------------------------------------------------------------------- */

  /* The frame that is nearest to a time after the snapshot [s]. */
  frameAt(time) {
    const { times, snapshot } = this.motion;
    const wanted = times[snapshot] + time;
    let [low, high] = [0, times.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= wanted) low = middle; else high = middle;
    }
    return wanted - times[low] <= times[high] - wanted ? low : high;
  }

  pose(frame) {
    if (!this.motion) return null;
    const [p, q] = [at(this.motion.position, frame), this.motion.quaternion.subarray(4 * frame, 4 * frame + 4)];
    if (!known(p) || !Number.isFinite(q[0])) return null;
    return new THREE.Matrix4().compose(p, new THREE.Quaternion(q[1], q[2], q[3], q[0]), new THREE.Vector3(1, 1, 1));
  }

  node(index) {
    if (this.atSnapshot) return at(this.nodes, index).applyMatrix4(this.handFrame);
    return at(this.motion.nodes, this.frame * this.radii.length + index).applyMatrix4(this.handFrame);
  }

  /* Show a time after the snapshot [s]; `still` holds the object where it was then. */
  show(time, still = false) {
    this.frame = this.motion ? this.frameAt(time) : 0;
    this.atSnapshot = !this.motion || this.frame === this.motion.snapshot;
    const pose = this.pose(this.frame);
    const first = this.start;
    this.object.visible = this.atSnapshot || pose !== null;
    const objectFrame = still || this.atSnapshot || !pose ? first : pose;
    this.object.matrixAutoUpdate = false;
    this.object.matrix.copy(objectFrame);
    /* Nodes of the snapshot are in the object frame, those of other frames in the lab's. */
    this.handFrame = this.atSnapshot ? first
      : still && pose ? first.clone().multiply(pose.clone().invert()) : new THREE.Matrix4();
    this.held.visible = this.isHeld();
    this.layHand();
  }

  isHeld() {
    if (this.atSnapshot) return true;
    const now = this.motion.times[this.frame];
    return this.motion.phases.some((phase) => ['lift', 'hold'].includes(phase.name)
      && phase.start <= now && now <= phase.end);
  }

  touches(site) {
    if (this.atSnapshot) return this.data.touching[site];
    return Boolean(this.motion.touching[this.frame] & (1 << site));
  }

  gap(site) {
    return this.atSnapshot ? floats(this.data.gap)[site] : this.motion.gap[20 * this.frame + site];
  }

  layHand() {
    const up = new THREE.Vector3(0, 1, 0);
    for (const { start, end, parts, shadows, group } of this.segments) {
      const [a, b] = [this.node(start), this.node(end)];
      group.visible = known(a) && known(b);
      if (!group.visible) continue;
      const axis = b.clone().sub(a);
      for (const [tube, first, second] of [parts, shadows]) {
        tube.position.copy(a).addScaledVector(axis, 0.5);
        tube.scale.set(1, Math.max(axis.length(), 1e-6), 1);
        tube.quaternion.setFromUnitVectors(up, axis.clone().normalize());
        first.position.copy(a);
        second.position.copy(b);
      }
    }
    const [red, plain] = [colour('touching'), colour('hand')];
    this.spheres.forEach((sphere, i) => {
      const place = this.node(i);
      sphere.userData.lost = !known(place);
      if (!sphere.userData.lost) sphere.position.copy(place);
      sphere.material.color.copy(this.touches(i) ? red : plain);
    });
  }

  layer(layers, through) {
    this.surface.visible = layers.object;
    this.hand.visible = layers.hand;
    this.spheres.forEach((sphere, i) => {
      sphere.visible = layers.spheres && !sphere.userData.lost;
      /* Spheres that do not touch are of one piece with the hand. */
      const clear = through && !this.touches(i);
      see(sphere.material, clear);
      sphere.renderOrder = clear ? 2 : 0;
      sphere.children[0].visible = clear;
    });
    if (this.hull) this.hull.visible = layers.hull;
    this.contacts.visible = layers.contacts;
    see(this.skin, through);
    this.segments.forEach(({ shadows }) => shadows.forEach((part) => { part.visible = through; }));
  }

  /* --- what the pointer meets ---------------------------------------------------------------------- */

  siteTip(site) {
    const touches = this.touches(site) ? 'touches' : 'does not touch';
    return `${page.sites[site]}\ngap ${mm(this.gap(site))}, ${touches}\nradius ${mm(this.radii[site])}`;
  }

  pointTip(hit) {
    const corners = [hit.face.a, hit.face.b, hit.face.c];
    const local = this.surface.worldToLocal(hit.point.clone());
    const point = corners.reduce((best, corner) =>
      (at(this.points, corner).distanceTo(local) < at(this.points, best).distanceTo(local) ? corner : best));
    const lines = [`${this.data.object}, point ${point}`];
    if (this.gaps.has(point)) lines.push(`${mm(this.gaps.get(point))} from the hand at the snapshot`);
    if (this.feature.has(point)) lines.push('in the graspable feature');
    return lines.join('\n');
  }
}

/* The page: one or two views, one camera, one time. */
class Page {
  constructor(canvas) {
    this.canvas = canvas;
    this.asked = null;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.views = page.grasps.map((data) => new GraspView(data));
    this.scenes = this.views.map((view) => this.sceneOf(view));
    this.camera = new THREE.PerspectiveCamera(26, 1, 0.01, 20);
    this.layers = Object.fromEntries(LAYERS.map((name) => [name, name !== 'map']));
    this.through = true;
    this.still = page.grasps.length > 1;
    this.time = 0;
    this.aim();
    this.views.forEach((view) => view.paint(this.layers));
    this.update();
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
    this.listen();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.update());
  }

  sceneOf(view) {
    const scene = new THREE.Scene();
    scene.add(new THREE.HemisphereLight(0xffffff, 0x8d96a5, 1.9));
    /* The light stands over the camera's shoulder and goes with it. */
    const light = new THREE.DirectionalLight(0xffffff, 1.7);
    scene.add(light, light.target, view.root);
    scene.userData.light = light;
    const laid = new THREE.Matrix4().fromArray(view.data.world_from_object).multiply(view.start.clone().invert());
    view.root.applyMatrix4(laid);
    return scene;
  }

  aim() {
    const { eye, target, up } = page.camera;
    this.camera.up.set(...up);
    this.camera.position.set(...eye);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.target.set(...target);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => this.draw());
    this.controls.update();
    this.controls.saveState();
  }

  update() {
    this.views.forEach((view) => {
      view.show(this.time, this.still);
      view.layer(this.layers, this.through);
    });
    this.draw();
  }

  /* Draw before the screen is next shown, once, however much has changed by then. */
  draw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      this.render();
    });
  }

  render() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.renderer.setScissorTest(true);
    const share = width / this.views.length;
    /* All of the grasp stays in sight where the view is narrower than high. */
    this.camera.aspect = share / height;
    this.camera.zoom = Math.min(1, this.camera.aspect);
    this.camera.updateProjectionMatrix();
    this.scenes.forEach((scene, i) => {
      const { light } = scene.userData;
      light.position.set(-0.4, 0.6, 1).applyQuaternion(this.camera.quaternion).add(this.controls.target);
      light.target.position.copy(this.controls.target);
      this.renderer.setViewport(i * share, 0, share, height);
      this.renderer.setScissor(i * share, 0, share, height);
      this.renderer.render(scene, this.camera);
    });
  }

  setLayer(name, shown) {
    this.layers[name] = shown;
    if (name === 'feature' || name === 'map') this.views.forEach((view) => view.paint(this.layers));
    $('legend').hidden = !this.layers.map;
    this.update();
  }

  setTime(time) {
    this.time = time;
    this.update();
    this.tell();
  }

  /* What is seen at this time, in words and numbers. */
  tell() {
    const view = this.views[0];
    const moment = $('moment');
    if (moment) moment.textContent = describe(view);
    const rows = document.querySelectorAll('.sites tbody tr');
    rows.forEach((row, i) => {
      row.classList.toggle('touching', view.touches(i));
      row.children[1].textContent = mm(view.gap(i));
      row.children[2].textContent = view.touches(i) ? 'touches' : '';
    });
  }

  reset() {
    this.controls.reset();
    this.draw();
  }

  /* Turn the camera about its target by angles [rad], and bring it nearer by a factor. */
  turn(aside, upwards, nearer) {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const right = new THREE.Vector3().crossVectors(this.camera.up, arm).normalize();
    const raised = arm.clone().applyAxisAngle(right, -upwards);
    const tilt = raised.angleTo(this.camera.up);
    if (tilt > 0.05 && tilt < Math.PI - 0.05) arm.copy(raised);
    arm.applyAxisAngle(this.camera.up.clone().normalize(), aside).multiplyScalar(nearer);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.draw();
  }

  hover(event) {
    const box = this.canvas.getBoundingClientRect();
    const share = box.width / this.views.length;
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const i = Math.min(this.views.length - 1, Math.max(0, Math.floor(x / share)));
    const place = new THREE.Vector2(2 * ((x - i * share) / share) - 1, 1 - 2 * (y / box.height));
    const ray = new THREE.Raycaster();
    ray.setFromCamera(place, this.camera);
    const shown = (part) => !part || (part.visible && shown(part.parent));
    const hits = ray.intersectObject(this.views[i].root, true)
      .filter((hit) => hit.object.userData.tip && shown(hit.object));
    const solid = hits.find((hit) => hit.object !== this.views[i].hull && hit.object.material !== this.views[i].skin);
    return (solid || hits[0] || null);
  }

  listen() {
    const tip = $('tip');
    let waiting = null;
    this.canvas.addEventListener('pointermove', (event) => {
      if (waiting) return;
      waiting = requestAnimationFrame(() => {
        waiting = null;
        const hit = event.buttons ? null : this.hover(event);
        tip.hidden = !hit;
        if (!hit) return;
        tip.textContent = hit.object.userData.tip(hit);
        const box = this.canvas.getBoundingClientRect();
        const left = event.clientX - box.left + 14;
        tip.style.left = `${Math.min(left, box.width - tip.offsetWidth - 8)}px`;
        tip.style.top = `${Math.min(event.clientY - box.top + 14, box.height - tip.offsetHeight - 8)}px`;
      });
    });
    this.canvas.addEventListener('pointerleave', () => { tip.hidden = true; });
    this.canvas.addEventListener('keydown', (event) => {
      const step = Math.PI / 36;
      const turns = {
        ArrowLeft: [-step, 0, 1], ArrowRight: [step, 0, 1], ArrowUp: [0, step, 1], ArrowDown: [0, -step, 1],
        '+': [0, 0, 0.9], '=': [0, 0, 0.9], '-': [0, 0, 1 / 0.9],
      };
      if (!turns[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      this.turn(...turns[event.key]);
    });
  }
}

function describe(view) {
  if (!view.motion) return 'one instant';
  const { times, phases } = view.motion;
  const now = times[view.frame];
  const phase = phases.find(({ start, end }) => start <= now && now <= end);
  const count = page.sites.filter((_, i) => view.touches(i)).length;
  const words = [`${now.toFixed(2)} s`, phase ? phase.name : null, `${count} of ${page.sites.length} sites touch`];
  if (view.atSnapshot) words.push('snapshot');
  return words.filter(Boolean).join(', ');
}

/* The slider, the parts of the trial above it, and when each digit touches. */
class Timeline {
  constructor(shown) {
    this.shown = shown;
    this.slider = $('time');
    const moving = shown.views.filter((view) => view.motion);
    if (!moving.length) return;
    const ends = moving.map(({ motion }) => [motion.times[0], motion.times.at(-1)]
      .map((time) => time - motion.times[motion.snapshot]));
    this.first = Math.min(...ends.map(([first]) => first));
    this.last = Math.max(...ends.map(([, last]) => last));
    const { times } = moving[0].motion;
    this.step = (times.at(-1) - times[0]) / (times.length - 1);
    Object.assign(this.slider, { min: 0, max: Math.round((this.last - this.first) / this.step), step: 1 });
    $('timeline').hidden = false;
    this.phases(moving[0].motion);
    this.digits(moving[0].motion);
    this.slider.addEventListener('input', () => this.go(Number(this.slider.value)));
    $('play').addEventListener('click', () => this.toggle());
    $('snapshot').addEventListener('click', () => this.toSnapshot());
    $('still').addEventListener('click', () => this.hold());
    $('still').setAttribute('aria-pressed', String(shown.still));
    this.toSnapshot();
  }

  get moves() { return this.step !== undefined; }

  go(value) {
    this.slider.value = value;
    const time = this.first + Number(this.slider.value) * this.step;
    /* Times are those of frames: at the snapshot's own step, exactly. */
    this.shown.setTime(Math.abs(time) < this.step / 2 ? 0 : time);
    this.slider.setAttribute('aria-valuetext', describe(this.shown.views[0]));
  }

  toSnapshot() { this.go(Math.round(-this.first / this.step)); }

  hold() {
    this.shown.still = !this.shown.still;
    $('still').setAttribute('aria-pressed', String(this.shown.still));
    this.shown.update();
  }

  toggle() {
    const button = $('play');
    if (this.playing) {
      cancelAnimationFrame(this.playing);
      this.playing = null;
    } else {
      const from = Number(this.slider.value) >= Number(this.slider.max) ? 0 : Number(this.slider.value);
      const began = performance.now();
      const run = (now) => {
        const value = from + (now - began) / 1000 / this.step;
        this.go(Math.min(Math.round(value), Number(this.slider.max)));
        if (value < Number(this.slider.max)) this.playing = requestAnimationFrame(run);
        else this.toggle();
      };
      this.playing = requestAnimationFrame(run);
    }
    button.textContent = this.playing ? 'Pause' : 'Play';
  }

  share(time, motion) {
    return (time - motion.times[motion.snapshot] - this.first) / (this.last - this.first);
  }

  phases(motion) {
    for (const { name, start, end } of motion.phases) {
      const part = document.createElement('span');
      part.textContent = name;
      part.title = `${name}: ${start.toFixed(2)} to ${end.toFixed(2)} s`;
      part.style.width = `${100 * (this.share(end, motion) - this.share(start, motion))}%`;
      if (!$('phases').children.length) part.style.marginLeft = `${100 * this.share(start, motion)}%`;
      $('phases').append(part);
    }
  }

  digits(motion) {
    const names = ['thumb', 'index', 'middle', 'ring', 'little'];
    const svg = $('digits');
    const row = 36 / names.length;
    names.forEach((digit, k) => {
      const mask = 15 << (4 * k);
      let begun = null;
      for (let i = 0; i <= motion.times.length; i++) {
        const on = i < motion.times.length && motion.touching[i] & mask;
        if (on && begun === null) begun = i;
        if (!on && begun !== null) {
          const bar = document.createElementNS('http://www.w3.org/2000/svg', 'rect');
          const [x0, x1] = [motion.times[begun], motion.times[i - 1]].map((t) => 1000 * this.share(t, motion));
          const box = { x: x0, width: Math.max(x1 - x0, 1), y: k * row + 1.5, height: row - 3 };
          Object.entries(box).forEach(([name, value]) => bar.setAttribute(name, value));
          bar.setAttribute('fill', `var(--${digit})`);
          const title = document.createElementNS('http://www.w3.org/2000/svg', 'title');
          title.textContent = `${digit} touches, ${motion.times[begun].toFixed(2)} to ${motion.times[i - 1].toFixed(2)} s`;
          bar.append(title);
          svg.append(bar);
          begun = null;
        }
      }
    });
  }
}

function begin() {
  let shown;
  try {
    shown = new Page($('picture'));
  } catch (error) {
    $('fallback').hidden = false;
    $('picture').hidden = true;
    return;
  }
  const timeline = new Timeline(shown);
  shown.tell();
  LAYERS.forEach((name) => {
    const box = $(`layer-${name}`);
    box.checked = shown.layers[name];
    box.addEventListener('change', () => shown.setLayer(name, box.checked));
  });
  $('through').addEventListener('change', (event) => {
    shown.through = event.target.checked;
    shown.update();
  });
  $('reset').addEventListener('click', () => shown.reset());
  const keys = {
    ...Object.fromEntries(LAYERS.map((name, i) => [String(i + 1), () => $(`layer-${name}`).click()])),
    t: () => $('through').click(),
    r: () => shown.reset(),
    ...(timeline.moves && {
      ' ': () => timeline.toggle(),
      s: () => timeline.toSnapshot(),
      o: () => timeline.hold(),
      ',': () => timeline.go(Number(timeline.slider.value) - 1),
      '.': () => timeline.go(Number(timeline.slider.value) + 1),
    }),
  };
  document.addEventListener('keydown', (event) => {
    const busy = event.target.closest('button, summary, input[type=checkbox]') && event.key === ' ';
    if (busy || event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  shown.render();
  document.body.dataset.ready = String(Math.round(performance.now()));
}

begin();
