/* What the page's JSON says, read; the scripts after this one draw it with three.js. */
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
