// MuJoCo's mj_ray on the same object and lines, one thread. Debian packages an old MuJoCo; this says nothing
// of later ones. One JSON object on stdout.
#include <mujoco/mujoco.h>

#include <chrono>
#include <cstdio>
#include <fstream>

#include "server/geometry/files/mesh_file.h"
#include "tests/bench/scene.h"

int main() {
  using namespace touchstone::bench;
  const auto specification = Touches(Lat20(), "");
  const std::string folder = std::string(P_tmpdir) + "/touchstone_mujoco_bench";
  const std::string mesh_path = folder + ".obj", model_path = folder + ".xml";
  if (!touchstone::geometry::WriteMeshFile(mesh_path, specification->objects[0]->mesh()).ok()) return 1;
  std::ofstream(model_path) << "<mujoco><asset><mesh name=\"m\" file=\"" << mesh_path
                            << "\" scale=\"0.001 0.001 0.001\"/></asset><worldbody><geom type=\"mesh\" "
                               "mesh=\"m\"/></worldbody></mujoco>";
  char error[1000] = "";
  mjModel* model = mj_loadXML(model_path.c_str(), nullptr, error, sizeof error);
  std::remove(mesh_path.c_str());
  std::remove(model_path.c_str());
  if (model == nullptr) {
    std::fprintf(stderr, "%s\n", error);
    return 1;
  }
  mjData* data = mj_makeData(model);
  mj_forward(model, data);
  const auto poses = AcceptedPoses(*specification, 200);
  size_t hits = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (const auto& pose : poses) {
    for (int finger = -1; finger <= 1; ++finger) {
      const Eigen::Vector3d o =
          pose.target_m - pose.approach * pose.standoff_m + pose.lateral * (0.03 * finger);
      int geom = -1;
      hits += mj_ray(model, data, o.data(), pose.approach.data(), nullptr, 1, -1, &geom) >= 0;
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (hits < poses.size() * 3 * 9 / 10) return 1;
  std::printf("{\"touches_per_s\": %.0f, \"version\": \"MuJoCo %s\"}\n", poses.size() / seconds,
              mj_versionString());
  mj_deleteData(data);
  mj_deleteModel(model);
}
