// The page's script: turning an object with its residuals, and copying text. Without it the page lacks
// nothing else.
#include "client/report/html_page.h"

namespace touchstone::client {

const char* HtmlScript() {
  return R"js(
'use strict';
document.documentElement.classList.add('js');
for (const button of document.querySelectorAll('[data-copy]')) {
  button.onclick = () => {
    const text = document.getElementById(button.dataset.copy);
    const said = (word) => { button.textContent = word; setTimeout(() => { button.textContent = 'Copy'; }, 1500); };
    const select = () => { getSelection().selectAllChildren(text); said('Selected'); };
    if (!navigator.clipboard) return select();
    navigator.clipboard.writeText(text.textContent).then(() => said('Copied'), select);
  };
}
const source = document.getElementById('objects-data');
if (source) turnTable(JSON.parse(source.textContent));

function turnTable(data) {
  const canvas = document.getElementById('turn'), pen = canvas.getContext('2d');
  const which = document.getElementById('which'), readout = document.getElementById('readout');
  const hidden = new Set();
  let object, after = false, azimuth = -0.96, elevation = 0.49, spots = [];

  const button = (place, text, pressed, act) => {
    const made = document.createElement('button');
    made.type = 'button';
    made.textContent = text;
    made.setAttribute('aria-pressed', pressed);
    made.onclick = () => { act(made); draw(); };
    document.getElementById(place).append(made);
    return made;
  };
  data.objects.forEach((one, i) => which.add(new Option(one.name, i)));
  which.onchange = () => { choose(data.objects[which.value]); draw(); };
  if (data.improved) {
    const both = ['given model', 'improved model'].map((text, i) => button('when', text, i === 0, () => {
      after = i === 1;
      both.forEach((one, k) => one.setAttribute('aria-pressed', k === i));
    }));
  }
  const most = Math.max(...data.objects.map((one) => one.f.reduce((a, b) => Math.max(a, b), 0)));
  for (let f = 0; f <= most && most > 0; ++f) {
    button('who', 'finger ' + (data.fingers[f] || f), true, (made) => {
      if (!hidden.delete(f)) hidden.add(f);
      made.setAttribute('aria-pressed', !hidden.has(f));
    });
  }

  function choose(one) {
    object = one;
    const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9], all = one.v.length ? one.v : one.p;
    all.forEach((x, i) => { low[i % 3] = Math.min(low[i % 3], x); high[i % 3] = Math.max(high[i % 3], x); });
    one.centre = low.map((x, k) => (x + high[k]) / 2);
    one.size = 1;
    for (let i = 0; i < all.length; i += 3) {
      one.size = Math.max(one.size, 2 * Math.hypot(...one.centre.map((x, k) => all[i + k] - x)));
    }
  }

  function draw() {
    const dense = devicePixelRatio || 1, wide = canvas.clientWidth, tall = canvas.clientHeight;
    canvas.width = wide * dense;
    canvas.height = tall * dense;
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue('--' + name);
    const shades = [0, 1, 2, 3, 4].map((i) => colour('s' + i)), dots = [0, 1, 2, 3, 4, 5, 6].map((i) => colour('d' + i));
    const ca = Math.cos(azimuth), sa = Math.sin(azimuth), ce = Math.cos(elevation), se = Math.sin(elevation);
    const scale = 0.94 * Math.min(wide, tall) / object.size, c = object.centre;
    const project = (list, i) => {
      const x = list[i] - c[0], y = list[i + 1] - c[1], z = list[i + 2] - c[2];
      const ahead = x * ca + y * sa;
      return [wide / 2 + scale * (y * ca - x * sa), tall / 2 - scale * (z * ce - ahead * se), scale * (ahead * ce + z * se)];
    };
    const corners = [];
    for (let i = 0; i < object.v.length; i += 3) corners.push(project(object.v, i));
    const faces = [];
    for (let i = 0; i + 2 < object.t.length; i += 3) {
      const [a, b, d] = [corners[object.t[i]], corners[object.t[i + 1]], corners[object.t[i + 2]]];
      if (!a || !b || !d) continue;
      const u = [b[0] - a[0], a[1] - b[1], b[2] - a[2]], v = [d[0] - a[0], a[1] - d[1], d[2] - a[2]];
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const long = Math.hypot(...n), turned = n[2] < 0 ? -1 : 1;
      if (long < 1e-3) continue;
      const lit = turned * (-0.35 * n[0] + 0.5 * n[1] + 0.79 * n[2]) / long;
      faces.push({a, b, d, depth: a[2] + b[2] + d[2], area: n[2], shade: Math.min(4, Math.max(0, Math.floor(5.6 * lit - 0.6)))});
    }
    faces.sort((p, q) => p.depth - q.depth);
    pen.lineJoin = 'round';
    for (const f of faces) {
      pen.fillStyle = pen.strokeStyle = shades[f.shade];
      pen.beginPath();
      pen.moveTo(f.a[0], f.a[1]);
      pen.lineTo(f.b[0], f.b[1]);
      pen.lineTo(f.d[0], f.d[1]);
      pen.closePath();
      pen.fill();
      pen.stroke();
    }
    // A dot is hidden if a triangle lies in front of it by more than 4 % of the size.
    const margin = 0.04 * object.size * scale;
    const covered = (p) => faces.some((f) => {
      if (f.area === 0) return false;
      const w1 = ((f.b[0] - p[0]) * (f.d[1] - p[1]) - (f.d[0] - p[0]) * (f.b[1] - p[1])) / -f.area;
      const w2 = ((f.d[0] - p[0]) * (f.a[1] - p[1]) - (f.a[0] - p[0]) * (f.d[1] - p[1])) / -f.area;
      const w3 = 1 - w1 - w2;
      return w1 >= 0 && w2 >= 0 && w3 >= 0 && w1 * f.a[2] + w2 * f.b[2] + w3 * f.d[2] > p[2] + margin;
    });
    const spot = Math.min(7, Math.max(3.5, 4 * Math.sqrt(500 / object.f.length)));
    spots = [];
    for (let i = 0; i < object.f.length; ++i) {
      if (hidden.has(object.f[i])) continue;
      const p = project(object.p, 3 * i);
      if (!covered(p)) spots.push({x: p[0], y: p[1], us: after ? object.a[i] : object.r[i], finger: object.f[i]});
    }
    spots.sort((p, q) => Math.abs(p.us) - Math.abs(q.us));
    for (const s of spots) {
      pen.fillStyle = dots[Math.min(6, Math.max(0, Math.floor((s.us / data.limit_us + 1) * 3.5)))];
      pen.beginPath();
      pen.arc(s.x, s.y, spot, 0, 7);
      pen.fill();
    }
  }

  const turn = (dx, dy) => {
    azimuth -= dx;
    elevation = Math.min(1.55, Math.max(-1.55, elevation + dy));
    draw();
  };
  let held = null;
  canvas.onpointerdown = (e) => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); };
  canvas.onpointerup = canvas.onpointercancel = () => { held = null; };
  canvas.onpointermove = (e) => {
    if (held) {
      turn((e.clientX - held[0]) * 0.01, (e.clientY - held[1]) * 0.01);
      held = [e.clientX, e.clientY];
      return;
    }
    const near = spots.filter((s) => Math.hypot(s.x - e.offsetX, s.y - e.offsetY) < 8).pop();
    readout.textContent = !near ? 'Drag, or use the arrow keys, to turn it.' : 'finger ' +
        (data.fingers[near.finger] || near.finger) + ': ' + (near.us > 0 ? '+' : '') +
        (near.us * data.per_us).toPrecision(3) + ' ' + data.unit;
  };
  canvas.onkeydown = (e) => {
    const step = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]}[e.key];
    if (step) { e.preventDefault(); turn(...step); }
  };
  addEventListener('resize', draw);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  choose(data.objects[0]);
  draw();
}
)js";
}

}  // namespace touchstone::client
