#include "server/touch/touch_notes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "server/geometry/shapes/supershape.h"

namespace touchstone::touch {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

geometry::TriangleMesh Shape() {
  return *geometry::MakeSupershape(*geometry::NamedSupershape("lat00"), 2000);
}

CommandedTouch CommandFromAbove(double standoff_m) {
  CommandedTouch touch;
  touch.standoff_m = standoff_m;
  return touch;
}

TEST(TouchNotes, AStartInsideIsNamedOnceWithTheStandoffThatWouldBeRight) {
  // lat00 reaches from -70 to 70 mm along z.
  const auto surface = *geometry::Surface::Create("lat00", Shape());
  const model::Model model = model::NominalModel();
  const std::vector<CommandedTouch> outside = {CommandFromAbove(0.1)};
  const std::vector<CommandedTouch> mixed = {CommandFromAbove(0.1), CommandFromAbove(0.02),
                                             CommandFromAbove(0.03)};
  EXPECT_THAT(NotesOnTouches(*surface, model, outside, 0), IsEmpty());
  EXPECT_THAT(NotesOnTouches(*surface, model, mixed, 10),
              ElementsAre(AllOf(HasSubstr("touch 11 and 1 other start inside of 'lat00'"),
                                HasSubstr("a standoff of 20 mm"), HasSubstr("from 70 mm on"))));
}

TEST(TouchNotes, AMeshThatIsInsideOutHasTheSameInside) {
  geometry::TriangleMesh mesh = Shape();
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  const auto surface = *geometry::Surface::Create("lat00", mesh);
  const std::vector<CommandedTouch> inside = {CommandFromAbove(0.02)}, outside = {CommandFromAbove(0.1)};
  EXPECT_THAT(NotesOnTouches(*surface, model::NominalModel(), inside, 0),
              ElementsAre(HasSubstr("starts inside of 'lat00'")));
  EXPECT_THAT(NotesOnTouches(*surface, model::NominalModel(), outside, 0), IsEmpty());
}

TEST(TouchNotes, AStartBetweenTwoPartsIsOutside) {
  geometry::TriangleMesh mesh = Shape();
  const size_t vertices = mesh.vertices_m.size(), triangles = mesh.triangles.size();
  for (size_t k = 0; k < vertices; ++k)
    mesh.vertices_m.push_back(mesh.vertices_m[k] + Eigen::Vector3f(0, 0, 0.4F));
  for (size_t k = 0; k < triangles; ++k) {
    auto triangle = mesh.triangles[k];
    for (uint32_t& corner : triangle) corner += vertices;
    mesh.triangles.push_back(triangle);
  }
  const auto surface = *geometry::Surface::Create("two", mesh);
  const std::vector<CommandedTouch> between = {CommandFromAbove(0.2)};
  EXPECT_THAT(NotesOnTouches(*surface, model::NominalModel(), between, 0), IsEmpty());
}

}  // namespace
}  // namespace touchstone::touch
