/* What is seen at a moment, in words. */
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
