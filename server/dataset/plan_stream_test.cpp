// Datasets of plans that know the mesh: the same touches as the plan alone, however the dataset is cut.
#include <gmock/gmock.h>

#include <cmath>
#include <cstring>

#include "server/dataset/test_support.h"
#include "server/touch/plan_drawer.h"

namespace touchstone::dataset {
namespace {

Eigen::Vector3d VectorAt(const std::string& column, size_t k) {
  float v[3];
  std::memcpy(v, column.data() + 12 * k, 12);
  return Eigen::Vector3d(v[0], v[1], v[2]);
}

// Three fingers in a row of 60 mm on small, steep objects: many draws are rejected.
DatasetSpecification SmallObjects() {
  DatasetSpecification specification = SmallDataset(0);
  specification.plan.kind = touch::Plan::Kind::kFaces;
  specification.plan.faces.max_incidence_rad = 0.5;
  std::vector<std::shared_ptr<const geometry::Surface>> small;
  for (const auto& object : specification.objects) {
    geometry::TriangleMesh mesh = object->mesh();
    for (Eigen::Vector3f& vertex : mesh.vertices_m) vertex = 0.7F * vertex + Eigen::Vector3f(0.3F, 0, 0.1F);
    small.push_back(*geometry::Surface::Create(object->name(), mesh));
  }
  specification.objects = small;
  return specification;
}

TEST(PlanStream, TargetsLieOnTheSurfaceAndTheCutDoesNotMatter) {
  const std::vector<std::string> whole = Columns(SmallObjects(), {}, 1);
  DatasetPart part;
  part.batch_size = 7;
  EXPECT_EQ(whole, Columns(SmallObjects(), part, 2));
  const std::string& target = whole[4];
  const std::string& contact = whole[9];
  ASSERT_EQ(target.size(), 576u * 12u);
  for (size_t k = 0; k < 576; ++k)
    EXPECT_LT((VectorAt(target, k) - VectorAt(contact, 3 * k + 1)).norm(), 1e-6) << k;
}

TEST(PlanStream, SamplesAreTheTouchesOfThePlanAndTheirDrawsAreCounted) {
  auto specification = std::make_shared<DatasetSpecification>(SmallObjects());
  ASSERT_TRUE(ValidateDataset(specification.get()).ok());
  std::vector<std::unique_ptr<touch::PlanDrawer>> drawers;
  for (const auto& object : specification->objects)
    drawers.push_back(std::make_unique<touch::PlanDrawer>(specification->plan, object, specification->model,
                                                          specification->seed, specification->max_draws));
  ThreadPool pool(2);
  DatasetPart part;
  part.batch_size = 64;
  const auto stream = DatasetStream::Create(specification, part, &pool);
  uint64_t index = 0, all_draws = 0;
  for (;;) {
    const auto batch = (*stream)->Next({});
    ASSERT_TRUE(batch.ok()) << batch.status();
    if (!batch->has_value()) break;
    touch::DrawCounts counts;
    for (uint32_t row = 0; row < (*batch)->rows; ++row, ++index) {
      const auto drawn = drawers[index % 3]->Draw(index / 3, 0, &counts);
      ASSERT_TRUE(drawn.ok()) << drawn.status();
      EXPECT_LT((VectorAt((*batch)->data[5], row) - drawn->touch.approach).norm(), 1e-6) << index;
    }
    EXPECT_EQ((*batch)->draws, counts.Draws());
    all_draws += (*batch)->draws;
  }
  EXPECT_EQ(index, 576u);
  EXPECT_GT(all_draws, 2 * index);
}

TEST(PlanStream, AnIndexThatNoDrawServesSaysWhichConditionFailedHowOften) {
  auto specification = std::make_shared<DatasetSpecification>(SmallObjects());
  specification->plan.faces.max_incidence_rad = 0.002;
  specification->max_draws = 60;
  ASSERT_TRUE(ValidateDataset(specification.get()).ok());
  ThreadPool pool(2);
  const auto batch = (*DatasetStream::Create(specification, {}, &pool))->Next({});
  EXPECT_EQ(batch.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(batch.status().message()),
              testing::AllOf(testing::HasSubstr("object 'lat00', sample "), testing::HasSubstr("in 60 draws"),
                             testing::HasSubstr("an incidence of more than 0.114592 deg"),
                             testing::HasSubstr("a larger max_incidence")));
}

}  // namespace
}  // namespace touchstone::dataset
