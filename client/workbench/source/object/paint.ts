// The residuals between the contacts: a weighted mean over those nearby, pale where there are none.
import type { RGB } from "../colour";

export interface Mesh { positions: Float32Array; triangles: Uint32Array }

const minTriangles = 3000;

// Every triangle in four, until colours of corners show a smooth picture.
export function refined(vertices: number[], triangles: number[]): Mesh {
  let positions = [...vertices];
  let corners = [...triangles];
  while (corners.length / 3 < minTriangles && corners.length > 0) {
    const middles = new Map<string, number>();
    const middle = (a: number, b: number) => {
      const key = a < b ? `${a},${b}` : `${b},${a}`;
      let at = middles.get(key);
      if (at === undefined) {
        at = positions.length / 3;
        for (let k = 0; k < 3; ++k) positions.push((positions[3 * a + k] + positions[3 * b + k]) / 2);
        middles.set(key, at);
      }
      return at;
    };
    const finer: number[] = [];
    for (let t = 0; t < corners.length; t += 3) {
      const [a, b, c] = [corners[t], corners[t + 1], corners[t + 2]];
      const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
      finer.push(a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca);
    }
    corners = finer;
  }
  return { positions: Float32Array.from(positions), triangles: Uint32Array.from(corners) };
}

// Of x, y, z and a value of each contact in turn: the places, the values, and the least and the largest.
export function unpacked(list: number[]): { points: Float32Array; values: Float32Array; low: number; high: number } {
  const size = Math.floor(list.length / 4);
  const points = new Float32Array(3 * size);
  const values = new Float32Array(size);
  for (let i = 0; i < size; ++i) {
    for (let k = 0; k < 3; ++k) points[3 * i + k] = list[4 * i + k];
    values[i] = list[4 * i + 3];
  }
  const low = values.reduce((a, b) => Math.min(a, b), Infinity);
  const high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  return { points, values, low, high: Math.max(high, 1.01 * low) };
}

const maxSources = 1500; // contacts that are read; beyond this a part, evenly

// Colours (0 to 255) of the mesh's corners. `reach`: how far a contact is seen, mm.
export function paint(mesh: Mesh, points: Float32Array, values: Float32Array, reach: number, solid: RGB, colour: (value: number) => RGB): Uint8Array {
  const colours = new Uint8Array(mesh.positions.length);
  const step = Math.max(1, Math.ceil(values.length / maxSources));
  for (let v = 0; v < mesh.positions.length; v += 3) {
    let weight = 0;
    let sum = 0;
    for (let p = 0; p < values.length; p += step) {
      const dx = points[3 * p] - mesh.positions[v];
      const dy = points[3 * p + 1] - mesh.positions[v + 1];
      const dz = points[3 * p + 2] - mesh.positions[v + 2];
      const apart = (dx * dx + dy * dy + dz * dz) / (reach * reach);
      if (apart > 4) continue;
      const w = Math.exp(-2 * apart);
      weight += w;
      sum += w * values[p];
    }
    const cover = Math.min(1, weight);
    const paintOf = weight > 0 ? colour(sum / weight) : solid;
    for (let k = 0; k < 3; ++k) colours[v + k] = solid[k] + 0.85 * cover * (paintOf[k] - solid[k]);
  }
  return colours;
}
