/* Begin: connect the page's parts to their boxes, buttons and keys. */
function begin() {
  let shown;
  try {
    shown = new Page($('picture'));
  } catch (error) {
    $('fallback').hidden = false;
    $('picture').hidden = true;
    return null;
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
  return shown;
}

const shownPage = begin();
