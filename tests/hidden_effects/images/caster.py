"""Which triangle a ray from one point meets first: exact, for any bundle of rays with a common origin.

Rays are points of a plane before the origin; triangles are projected onto it and listed by the cells of a grid that they
overlap. Each ray tests the triangles of its cell. Double precision.
"""
import numpy as np

NONE = -1
CELLS = 160  # along one side of the grid


class Bundle:
    """Rays from `origin`; `axes` are rows right, down, forward (unit, perpendicular)."""

    def __init__(self, solid, origin, axes, cull=True):
        corners = solid.vertices[solid.triangles]  # m x 3 x 3
        local = (corners - origin) @ axes.T
        kept = np.arange(len(local))
        # Behind the origin nothing is seen; a triangle that reaches behind it would need clipping.
        front = (local[:, :, 2] > 1e-6).all(1)
        if cull:  # of a closed solid only faces towards the origin can be seen
            a, b, c = local[:, 0], local[:, 1], local[:, 2]
            front &= np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
        self.index = kept[front]
        local = local[front]
        self.a, self.e1, self.e2 = local[:, 0], local[:, 1] - local[:, 0], local[:, 2] - local[:, 0]
        flat = local[:, :, :2] / local[:, :, 2:]
        low, high = flat.min(1), flat.max(1)
        self.low, self.high = low.min(0), high.max(0)
        self.size = np.maximum((self.high - self.low) / CELLS, 1e-12)
        self._list_by_cell(low, high)

    def _cell(self, points):
        return np.clip(np.floor((points - self.low) / self.size).astype(int), 0, CELLS - 1)

    def _list_by_cell(self, low, high):
        # One cell more on each side would only cost; rounding is covered by growing the boxes a little.
        first, last = self._cell(low - 1e-9 * self.size), self._cell(high + 1e-9 * self.size)
        span = last - first + 1
        count = span[:, 0] * span[:, 1]
        triangle = np.repeat(np.arange(len(count)), count)
        step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        column = first[triangle, 0] + step % span[triangle, 0]
        row = first[triangle, 1] + step // span[triangle, 0]
        cell = row * CELLS + column
        order = np.argsort(cell, kind="stable")
        self.triangle = triangle[order]
        self.start = np.searchsorted(cell[order], np.arange(CELLS * CELLS + 1))

    def first(self, points, beyond=0.0):
        """points: n x 2, where the rays (x, y, 1) pass. Returns index of the first triangle with a depth above `beyond`
        (scalar or per ray; NONE: none), its depth, and its barycentric weights of the second and third corner."""
        inside = ((points >= self.low) & (points <= self.high)).all(1)
        ray = np.flatnonzero(inside)
        cells = self._cell(points[ray])
        cell = cells[:, 1] * CELLS + cells[:, 0]
        count = self.start[cell + 1] - self.start[cell]
        pair_ray = np.repeat(ray, count)
        step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        pair = self.triangle[np.repeat(self.start[cell], count) + step]

        # Moeller and Trumbore, from the origin: depth t along (x, y, 1).
        x, y = points[pair_ray, 0], points[pair_ray, 1]
        e1, e2, a = self.e1[pair], self.e2[pair], self.a[pair]
        px, py, pz = y * e2[:, 2] - e2[:, 1], e2[:, 0] - x * e2[:, 2], x * e2[:, 1] - y * e2[:, 0]
        determinant = e1[:, 0] * px + e1[:, 1] * py + e1[:, 2] * pz
        with np.errstate(divide="ignore", invalid="ignore"):
            u = -(a[:, 0] * px + a[:, 1] * py + a[:, 2] * pz) / determinant
            q = np.cross(-a, e1)
            v = (x * q[:, 0] + y * q[:, 1] + q[:, 2]) / determinant
            t = (e2[:, 0] * q[:, 0] + e2[:, 1] * q[:, 1] + e2[:, 2] * q[:, 2]) / determinant
        beyond = np.broadcast_to(np.asarray(beyond, float), (len(points),))[pair_ray]
        edge = 1e-12  # a ray through an edge belongs to both sides, to none never
        hit = np.flatnonzero((u >= -edge) & (v >= -edge) & (u + v <= 1 + edge) & (t > beyond))
        order = hit[np.lexsort((t[hit], pair_ray[hit]))]
        rays, at = np.unique(pair_ray[order], return_index=True)
        best = order[at]
        index = np.full(len(points), NONE)
        depth, weight = np.zeros(len(points)), np.zeros((len(points), 2))
        index[rays], depth[rays] = self.index[pair[best]], t[best]
        weight[rays] = np.stack([u[best], v[best]], 1)
        return index, depth, weight


def looking(origin, at, up):
    """Axes right, down, forward of a camera."""
    forward = np.asarray(at, float) - origin
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])
