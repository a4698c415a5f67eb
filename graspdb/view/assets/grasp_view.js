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
