"""Open3D's RaycastingScene fed from NumPy: the same object, lines and work as a touch of three fingers (random poses on
the sphere, three rays each, the descriptor). Two threads. Prints one JSON object."""
import json
import pathlib
import sys
import time

try:
    import numpy as np
    import open3d as o3d
except ImportError as error:
    sys.exit(f"Open3D is not installed ({error})")

ROOT = pathlib.Path(__file__).resolve().parents[2]
BATCH, SECONDS, SPACING_M, SPEED_M_S, SIGMA_S = 131072, 4.0, 0.03, 0.02, 0.005


def load(path):
    """Vertices in metres and triangles of an OFF file in millimetres."""
    tokens = " ".join(line.split("#")[0] for line in path.read_text().splitlines()).split()
    vertices, faces = int(tokens[1]), int(tokens[2])
    xyz = np.array(tokens[4:4 + 3 * vertices], dtype=np.float32).reshape(-1, 3) * 1e-3
    return xyz, np.array(tokens[4 + 3 * vertices:4 + 3 * vertices + 4 * faces], dtype=np.uint32).reshape(-1, 4)[:, 1:]


def main():
    vertices, triangles = load(ROOT / "meshes" / "lat20.off")
    scene = o3d.t.geometry.RaycastingScene(nthreads=2)
    scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(np.ascontiguousarray(triangles)))
    centre = 0.5 * (vertices.min(0) + vertices.max(0))
    radius = 1.05 * 0.5 * np.linalg.norm(vertices.max(0) - vertices.min(0))
    random = np.random.default_rng(1)
    touches, begin = 0, time.perf_counter()
    while time.perf_counter() - begin < SECONDS:
        theta = np.radians(random.integers(0, 360, BATCH)).astype(np.float32)
        phi = np.radians(random.integers(-90, 91, BATCH)).astype(np.float32)
        approach = -np.stack([np.cos(phi) * np.cos(theta), np.cos(phi) * np.sin(theta), np.sin(phi)], 1)
        lateral = np.stack([-np.sin(theta), np.cos(theta), np.zeros_like(theta)], 1)
        rays = np.empty((BATCH, 3, 6), np.float32)
        for finger in range(3):
            rays[:, finger, :3] = centre - radius * approach + SPACING_M * (finger - 1) * lateral
            rays[:, finger, 3:] = approach
        travel = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
        time_s = travel / SPEED_M_S + random.normal(0, SIGMA_S, travel.shape)
        descriptor = time_s - time_s.min(1, keepdims=True)
        touches += int(np.isfinite(descriptor).all(1).sum())
    if touches == 0:
        sys.exit("this Open3D finds no hit")
    print(json.dumps({"touches_per_s": touches / (time.perf_counter() - begin), "version": f"Open3D {o3d.__version__}"}))


if __name__ == "__main__":
    main()
