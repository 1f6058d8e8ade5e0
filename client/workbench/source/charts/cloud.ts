// Many points on a canvas: those that a filter hides are pale, those that are selected ringed.
import { resolved } from "../colour";

export interface Cloud {
  x: Float32Array;
  y: Float32Array;
  group: Uint8Array; // index into colours
  colours: string[]; // names of custom properties
  shown: Uint8Array;
  marked: number[];
}

export interface Frame { x(value: number): number; y(value: number): number; width: number; height: number }

const manyPoints = 20000; // beyond this a point is a square of pixels

export function drawCloud(canvas: HTMLCanvasElement, cloud: Cloud, frame: Frame): void {
  const dense = Math.min(2, devicePixelRatio || 1);
  canvas.width = Math.round(frame.width * dense);
  canvas.height = Math.round(frame.height * dense);
  const pen = canvas.getContext("2d");
  if (!pen) return;
  pen.scale(dense, dense);
  const colours = cloud.colours.map(resolved);
  const pale = resolved("--pale");
  if (cloud.x.length > manyPoints) {
    drawPixels(pen, canvas.width, canvas.height, dense, cloud, frame, [pale, ...colours].map((colour) => (colour.match(/[\d.]+/g) ?? []).map(Number)));
    drawMarked(pen, cloud, frame, colours);
    return;
  }
  const size = cloud.x.length > 4000 ? 2.2 : 3;
  // Pale ones beneath; then by colour, which is what costs.
  const pass = (colour: string, wanted: (i: number) => boolean, alpha: number) => {
    pen.fillStyle = colour;
    pen.globalAlpha = alpha;
    pen.beginPath();
    for (let i = 0; i < cloud.x.length; ++i) {
      if (!wanted(i)) continue;
      const x = frame.x(cloud.x[i]);
      const y = frame.y(cloud.y[i]);
      pen.moveTo(x + size, y);
      pen.arc(x, y, size, 0, 7);
    }
    pen.fill();
  };
  const known = (i: number) => Number.isFinite(cloud.x[i]) && Number.isFinite(cloud.y[i]);
  pass(pale, (i) => !cloud.shown[i] && known(i), 0.55);
  colours.forEach((colour, group) => pass(colour, (i) => cloud.shown[i] === 1 && cloud.group[i] === group && known(i), cloud.x.length > 4000 ? 0.5 : 0.65));
  pen.globalAlpha = 1;
  drawMarked(pen, cloud, frame, colours);
}

// Two by two pixels a point, those that are shown last: a path of arcs would take seconds.
function drawPixels(pen: CanvasRenderingContext2D, width: number, height: number, dense: number, cloud: Cloud, frame: Frame, colours: number[][]): void {
  const image = pen.createImageData(width, height);
  const words = new Uint32Array(image.data.buffer);
  const packed = colours.map(([r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r);
  for (const shown of [0, 1]) {
    for (let i = 0; i < cloud.x.length; ++i) {
      if (cloud.shown[i] !== shown) continue;
      const x = Math.round(frame.x(cloud.x[i]) * dense);
      const y = Math.round(frame.y(cloud.y[i]) * dense);
      if (!(x >= 0 && x < width - 1 && y >= 0 && y < height - 1)) continue;
      const at = y * width + x;
      words[at] = words[at + 1] = words[at + width] = words[at + width + 1] = packed[shown ? 1 + cloud.group[i] : 0];
    }
  }
  pen.putImageData(image, 0, 0);
}

function drawMarked(pen: CanvasRenderingContext2D, cloud: Cloud, frame: Frame, colours: string[]): void {
  for (const i of cloud.marked) {
    if (!Number.isFinite(cloud.x[i]) || !Number.isFinite(cloud.y[i])) continue;
    pen.beginPath();
    pen.arc(frame.x(cloud.x[i]), frame.y(cloud.y[i]), 6.5, 0, 7);
    pen.fillStyle = colours[cloud.group[i]];
    pen.fill();
    pen.lineWidth = 2.5;
    pen.strokeStyle = resolved("--ink");
    pen.stroke();
  }
}

// The point nearest to a place of the picture, at most 14 px away; those that are shown go first. -1: none.
export function nearest(cloud: Cloud, frame: Frame, px: number, py: number): number {
  let best = -1;
  let least = 14 ** 2;
  for (let i = 0; i < cloud.x.length; ++i) {
    const apart = (frame.x(cloud.x[i]) - px) ** 2 + (frame.y(cloud.y[i]) - py) ** 2 + (cloud.shown[i] ? 0 : 100);
    if (apart < least) { least = apart; best = i; }
  }
  return best;
}

// The same as SVG, at most 20,000 points of those shown.
export function cloudSvg(cloud: Cloud, frame: Frame): string {
  const step = Math.ceil(cloud.x.length / 20000);
  return cloud.colours.map((name, group) => {
    let path = "";
    for (let i = 0; i < cloud.x.length; i += step)
      if (cloud.shown[i] && cloud.group[i] === group && Number.isFinite(cloud.x[i]) && Number.isFinite(cloud.y[i]))
        path += `M${frame.x(cloud.x[i]).toFixed(1)} ${frame.y(cloud.y[i]).toFixed(1)}h0`;
    return path && `<path d="${path}" stroke="var(${name})" stroke-width="4" stroke-linecap="round" opacity=".65"/>`;
  }).join("");
}
