#include "client/workbench_server/rig/touch_drawing.h"

#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/residuals/touches/outlines.h"
#include "server/geometry/pose.h"
#include "server/geometry/shapes/supershape.h"
#include "server/session/recorded/base_pose.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

constexpr size_t kMaxDrawn = 2000;
constexpr int kMaxTriangles = 400;

// Hundredths of `unit`s are more than a screen shows.
double Rounded(double value, double places) {
  return std::round(value * places) / places;
}
json Millimetres(double x, double y, double z) {
  json list = json::array();
  for (const double m : {x, y, z}) list.push_back(Rounded(m * kMillimetresPerMetre, 100));
  return list;
}
json Millimetres(const v1::Vector3& v) {
  return Millimetres(v.x(), v.y(), v.z());
}
json Direction(const v1::Vector3& v) {
  return {Rounded(v.x(), 1e4), Rounded(v.y(), 1e4), Rounded(v.z(), 1e4)};
}

json Drawn(const client::PlannedRow& row, const v1::TouchCheck& check) {
  const v1::CommandedTouch& commanded = row.touch.commanded;
  json path = json::array();
  if (check.has_base_from_object()) {
    const Eigen::Isometry3d object_from_base =
        geometry::PoseFromVector(session::ParseBasePose(check.base_from_object())).inverse();
    for (const v1::BasePose& pose : check.path()) {
      const v1::Vector3& at = pose.position_m();
      const Eigen::Vector3d point = object_from_base * Eigen::Vector3d(at.x(), at.y(), at.z());
      for (json& x : Millimetres(point.x(), point.y(), point.z())) path.push_back(std::move(x));
    }
  }
  return {{"touch", row.touch.touch},
          {"target_mm", Millimetres(commanded.target_m())},
          {"approach", Direction(commanded.approach())},
          {"lateral", Direction(commanded.lateral())},
          {"standoff_mm", Rounded(commanded.standoff_m() * kMillimetresPerMetre, 100)},
          {"path_mm", std::move(path)}};
}

// A built-in shape, where the source's has its mesh.
void AddMesh(const v1::Object& served, json* object) {
  const auto shape = geometry::NamedSupershape(served.name());
  if (!shape.ok() || served.triangles() > geometry::kMaxSupershapeTriangles) return;
  const auto mesh = geometry::MakeSupershape(*shape, served.triangles());
  if (!mesh.ok() || geometry::MeshHash(*mesh) != served.mesh_hash()) return;
  const geometry::TriangleMesh coarse = diagnosis::residuals::Decimated(*mesh, kMaxTriangles);
  for (const Eigen::Vector3f& vertex : coarse.vertices_m)
    for (json& x : Millimetres(vertex.x(), vertex.y(), vertex.z())) (*object)["vertices_mm"].push_back(x);
  for (const auto& triangle : coarse.triangles)
    for (const uint32_t corner : triangle) (*object)["triangles"].push_back(corner);
}

json ObjectOf(const std::string& name, const ObjectsOfSource& objects) {
  json object = {{"name", name}, {"vertices_mm", json::array()}, {"triangles", json::array()}};
  const auto served = objects.find(name);
  if (served == objects.end()) return object;
  object["low_mm"] = Millimetres(served->second.bounds_min_m());
  object["high_mm"] = Millimetres(served->second.bounds_max_m());
  AddMesh(served->second, &object);
  return object;
}

}  // namespace

json DrawTouches(const std::vector<client::PlannedRow>& rows, const std::vector<v1::TouchCheck>& checks,
                 const std::vector<client::RigGroup>& setups, const ObjectsOfSource& objects) {
  json drawn_objects = json::array(), drawn_setups = json::array(), impossible = json::array();
  std::map<std::string, size_t> entries;
  const auto entry = [&](const std::string& name) {
    const auto [there, added] = entries.emplace(name, entries.size());
    if (added) drawn_objects.push_back(ObjectOf(name, objects));
    return there->second;
  };
  const size_t every = (rows.size() + kMaxDrawn - 1) / kMaxDrawn;
  size_t seen = 0;
  for (const client::RigGroup& setup : setups) {
    json touches = json::array();
    for (const size_t row : setup.rows)
      if (seen++ % every == 0) touches.push_back(Drawn(rows[row], checks[row]));
    drawn_setups.push_back(
        {{"object", entry(setup.object)}, {"up_face", setup.up_face}, {"touches", std::move(touches)}});
  }
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row].possible || seen++ % every != 0) continue;
    json touch = Drawn(rows[row], checks[row]);
    touch["object"] = entry(rows[row].touch.object);
    touch["reason"] = rows[row].reason;
    impossible.push_back(std::move(touch));
  }
  return {{"touches", rows.size()},
          {"objects", std::move(drawn_objects)},
          {"setups", std::move(drawn_setups)},
          {"impossible", std::move(impossible)}};
}

}  // namespace touchstone::workbench
