"""Closed triangle meshes: read, written, made from formulas; their smooth normals.

Shares no code with the product. Millimetres, z up, counter-clockwise seen from outside.
"""
import dataclasses
import pathlib

import numpy as np

# Neighbouring triangles that meet at a sharper angle do not share a normal (server/image/scene/shading.h, in words).
CREASE_DEG = 35.0


@dataclasses.dataclass
class Solid:
    name: str
    vertices: np.ndarray  # n x 3, mm
    triangles: np.ndarray  # m x 3, indices
    normals: np.ndarray  # m x 3 x 3: of each corner, unit

    @property
    def centre(self):
        """Of the axis-aligned box."""
        return 0.5 * (self.vertices.min(0) + self.vertices.max(0))

    @property
    def radius(self):
        """Half the box's diagonal: of the sphere that the lights are placed by."""
        return 0.5 * float(np.linalg.norm(self.vertices.max(0) - self.vertices.min(0)))


def make_solid(name, vertices, triangles):
    # The product keeps single precision of metres; so do we, or a silhouette could differ by what no camera resolves.
    vertices = np.asarray(np.float32(np.asarray(vertices, float) * 1e-3), float) * 1e3
    triangles = np.asarray(triangles, int)
    corners = vertices[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = triangles[np.linalg.norm(face, axis=1) > 0]
    return Solid(name, vertices, solid, corner_normals(vertices, solid))


def corner_normals(vertices, triangles):
    """Area-weighted means over the triangles round a vertex that are joined by edges which are no crease."""
    points, welded = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    corner = welded.reshape(-1)[triangles]
    a, b, c = points[corner[:, 0]], points[corner[:, 1]], points[corner[:, 2]]
    face = np.cross(b - a, c - a)
    unit = face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)

    # Half edges, those of one edge side by side: in a closed mesh there are two, one in each direction.
    count = len(triangles)
    first = np.arange(3 * count)
    start = corner.reshape(-1)
    end = corner[:, [1, 2, 0]].reshape(-1)
    following = (first // 3) * 3 + (first % 3 + 1) % 3
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((high, low))
    one, other = order[:-1], order[1:]
    pair = (low[one] == low[other]) & (high[one] == high[other]) & (start[one] == end[other])
    one, other = one[pair], other[pair]
    flat = np.einsum("ij,ij->i", unit[one // 3], unit[other // 3]) > np.cos(np.radians(CREASE_DEG))
    one, other = one[flat], other[flat]
    joins = np.concatenate([np.stack([one, following[other]], 1), np.stack([following[one], other], 1)])

    # Smallest label of each connected group of corners.
    label = np.arange(3 * count)
    while True:
        least = np.minimum(label[joins[:, 0]], label[joins[:, 1]])
        before = label.copy()
        np.minimum.at(label, joins[:, 0], least)
        np.minimum.at(label, joins[:, 1], least)
        label = label[label]
        if np.array_equal(label, before):
            break
    sums = np.zeros((3 * count, 3))
    np.add.at(sums, label, np.repeat(face, 3, axis=0))
    normals = sums[label]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return normals.reshape(count, 3, 3)


def read_off(path):
    tokens = [line for line in pathlib.Path(path).read_text().splitlines() if line.strip() and line[0] != "#"]
    head = tokens[0].split()[1:] or tokens[1].split()
    rest = tokens[1:] if tokens[0].split()[1:] else tokens[2:]
    vertices, faces = int(head[0]), int(head[1])
    points = np.array([row.split()[:3] for row in rest[:vertices]], float)
    rows = np.array([row.split()[:4] for row in rest[vertices:vertices + faces]], int)
    if not (rows[:, 0] == 3).all():
        raise ValueError(f"{path}: a face has not three corners")
    return make_solid(pathlib.Path(path).stem, points, rows[:, 1:])


def write_off(solid, path):
    with open(path, "w") as out:
        out.write(f"OFF\n{len(solid.vertices)} {len(solid.triangles)} 0\n")
        out.writelines("{:.9g} {:.9g} {:.9g}\n".format(*tuple(p)) for p in solid.vertices)
        out.writelines(f"3 {a} {b} {c}\n" for a, b, c in solid.triangles)


def _grid_triangles(rows, columns):
    """Of a surface that closes in both directions, counter-clockwise where rows x columns points outwards."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    at = lambda r, c: (r % rows) * columns + c % columns
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def torus(name="torus", ring=52.0, tube=24.0, rows=96, columns=48):
    u, v = np.meshgrid(2 * np.pi * np.arange(rows) / rows, 2 * np.pi * np.arange(columns) / columns, indexing="ij")
    # Tilted, and not quite round, so that no view is like another.
    r = ring + tube * (1 + 0.2 * np.cos(u)) * np.cos(v)
    points = np.stack([r * np.cos(u), 1.15 * r * np.sin(u), tube * np.sin(v) + 10 * np.sin(u)], -1).reshape(-1, 3)
    return make_solid(name, points, _grid_triangles(rows, columns))


def extruded(name, outline, height, rim=0):
    """A polygon that is seen whole from `rim` (index of a corner) made a prism along z; sharp edges all round."""
    outline = np.asarray(outline, float)
    n = len(outline)
    points = np.concatenate([np.c_[outline, np.full(n, -height / 2)], np.c_[outline, np.full(n, height / 2)]])
    faces = []
    fan = [(rim, (rim + k) % n, (rim + k + 1) % n) for k in range(1, n - 1)]
    for a, b, c in fan:
        faces += [(a, c, b), (a + n, b + n, c + n)]
    for k in range(n):
        faces += [(k, (k + 1) % n, (k + 1) % n + n), (k, (k + 1) % n + n, k + n)]
    return make_solid(name, points, faces)


def bracket(name="bracket"):
    """An angle: one leg shades the other."""
    outline = [(-20, -20), (65, -30), (65, 5), (15, 15), (5, 70), (-30, 70)]
    return extruded(name, outline, 80)


def star(name="star"):
    """Five blunt arms round a hub: a smooth, deeply hollow surface."""
    rows, columns = 120, 80  # longitude, latitude
    lon = 2 * np.pi * np.arange(rows) / rows
    lat = np.pi * (np.arange(1, columns) / columns - 0.5)
    u, v = np.meshgrid(lon, lat, indexing="ij")
    r = 55 + 24 * np.cos(5 * u) * np.cos(v) ** 2 + 5 * np.cos(u)
    points = np.stack([r * np.cos(u) * np.cos(v), r * np.sin(u) * np.cos(v), 0.8 * r * np.sin(v)], -1).reshape(-1, 3)
    count = columns - 1
    south, north = len(points), len(points) + 1
    points = np.vstack([points, [0, 0, -44], [0, 0, 44]])
    faces = []
    for i in range(rows):
        a, b = i * count, (i + 1) % rows * count
        faces += [(south, b, a), (north, a + count - 1, b + count - 1)]
        for j in range(count - 1):
            faces += [(a + j, b + j, b + j + 1), (a + j, b + j + 1, a + j + 1)]
    return make_solid(name, points, faces)


def volume(solid):
    a, b, c = (solid.vertices[solid.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
