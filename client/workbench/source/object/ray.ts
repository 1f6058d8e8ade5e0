// Where a line from `from` along `direction` (a unit vector) first meets a mesh: the distance, Infinity where it meets none.
// Moeller and Trumbore 1997.
export function firstHit(from: number[], direction: number[], vertices: ArrayLike<number>, triangles: ArrayLike<number>): number {
  const [dx, dy, dz] = direction;
  let nearest = Infinity;
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ux = vertices[b] - vertices[a], uy = vertices[b + 1] - vertices[a + 1], uz = vertices[b + 2] - vertices[a + 2];
    const vx = vertices[c] - vertices[a], vy = vertices[c + 1] - vertices[a + 1], vz = vertices[c + 2] - vertices[a + 2];
    const px = dy * vz - dz * vy, py = dz * vx - dx * vz, pz = dx * vy - dy * vx;
    const volume = ux * px + uy * py + uz * pz;
    if (Math.abs(volume) < 1e-12) continue;
    const sx = from[0] - vertices[a], sy = from[1] - vertices[a + 1], sz = from[2] - vertices[a + 2];
    const along = (sx * px + sy * py + sz * pz) / volume;
    if (along < 0 || along > 1) continue;
    const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux;
    const across = (dx * qx + dy * qy + dz * qz) / volume;
    if (across < 0 || along + across > 1) continue;
    const far = (vx * qx + vy * qy + vz * qz) / volume;
    if (far >= 0 && far < nearest) nearest = far;
  }
  return nearest;
}
