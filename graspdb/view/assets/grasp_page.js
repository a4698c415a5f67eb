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
