#include "client/workbench_server/rig/touch_drawing.h"

#include <gtest/gtest.h>

#include "server/geometry/shapes/supershape.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

client::PlannedRow Row(uint64_t number, const std::string& object, bool possible = true) {
  client::PlannedRow row;
  row.touch.touch = number;
  row.touch.object = object;
  row.touch.commanded.mutable_target_m()->set_x(0.01 * static_cast<double>(number));
  row.touch.commanded.mutable_approach()->set_z(-1);
  row.touch.commanded.mutable_lateral()->set_x(1);
  row.touch.commanded.set_standoff_m(0.06);
  row.possible = possible;
  row.reason = possible ? "" : "out of reach";
  row.up_face = "+z";
  return row;
}

// The object lies 0.5 m along the base's x; the tip goes from 0.1 m above it down to its frame's origin.
v1::TouchCheck Check() {
  v1::TouchCheck check;
  check.mutable_base_from_object()->mutable_position_m()->set_x(0.5);
  for (const double z : {0.1, 0.0}) {
    v1::Vector3* at = check.add_path()->mutable_position_m();
    at->set_x(0.5);
    at->set_z(z);
  }
  return check;
}

v1::Object Served(const std::string& name, uint64_t triangles) {
  v1::Object object;
  object.set_name(name);
  const auto mesh = geometry::MakeSupershape(*geometry::NamedSupershape("lat10"), triangles);
  object.set_mesh_hash(geometry::MeshHash(*mesh));
  object.set_triangles(mesh->triangles.size());
  object.mutable_bounds_max_m()->set_x(0.075);
  return object;
}

TEST(TouchDrawing, HasEveryTouchInTheOrderInWhichTheRigMakesItWithItsPathInTheObjectsFrame) {
  const std::vector<client::PlannedRow> rows = {Row(1, "lat10"), Row(2, "lat10", false), Row(3, "lat10")};
  const std::vector<client::RigGroup> setups = {{"lat10", "+z", {2, 0}, 1}};
  const json drawn =
      DrawTouches(rows, {Check(), Check(), Check()}, setups, {{"lat10", Served("lat10", 2000)}});
  EXPECT_EQ(drawn["touches"], 3);
  const json& touches = drawn["setups"][0]["touches"];
  ASSERT_EQ(touches.size(), 2u);
  EXPECT_EQ(touches[0]["touch"], 3);
  EXPECT_EQ(touches[0]["target_mm"], json({30.0, 0.0, 0.0}));
  EXPECT_EQ(touches[0]["standoff_mm"], 60.0);
  EXPECT_EQ(touches[0]["path_mm"], json({0.0, 0.0, 100.0, 0.0, 0.0, 0.0}));
  ASSERT_EQ(drawn["impossible"].size(), 1u);
  EXPECT_EQ(drawn["impossible"][0]["touch"], 2);
  EXPECT_EQ(drawn["impossible"][0]["reason"], "out of reach");
}

TEST(TouchDrawing, ShowsTheMeshOnlyWhereItIsTheSourcesOwn) {
  const std::vector<client::PlannedRow> rows = {Row(1, "lat10")};
  const std::vector<client::RigGroup> setups = {{"lat10", "+z", {0}, 1}};
  v1::Object served = Served("lat10", 2000);
  const json same = DrawTouches(rows, {Check()}, setups, {{"lat10", served}})["objects"][0];
  EXPECT_GT(same["triangles"].size(), 100u);
  EXPECT_LE(same["triangles"].size(), 1200u);
  served.set_mesh_hash("of a file with this name");
  const json other = DrawTouches(rows, {Check()}, setups, {{"lat10", served}})["objects"][0];
  EXPECT_EQ(other["triangles"].size(), 0u);
  EXPECT_EQ(other["high_mm"], json({75.0, 0.0, 0.0}));
}

TEST(TouchDrawing, HasAnEvenSampleOfManyTouches) {
  std::vector<client::PlannedRow> rows;
  std::vector<client::RigGroup> setups = {{"lat10", "+z", {}, 1}};
  for (uint64_t k = 0; k < 5000; ++k) {
    rows.push_back(Row(k, "lat10"));
    setups[0].rows.push_back(k);
  }
  const json drawn = DrawTouches(rows, std::vector<v1::TouchCheck>(rows.size()), setups, {});
  EXPECT_EQ(drawn["touches"], 5000);
  EXPECT_EQ(drawn["setups"][0]["touches"].size(), 1667u);
  EXPECT_EQ(drawn["setups"][0]["touches"][1]["touch"], 3);
}

}  // namespace
}  // namespace touchstone::workbench
