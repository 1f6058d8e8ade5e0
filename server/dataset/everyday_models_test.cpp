// Meshes that other people made: ten everyday models are read, scaled to the size of a hand and touched.
#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "server/base/test_paths.h"
#include "server/dataset/test_support.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::dataset {
namespace {

class EverydayModel : public testing::TestWithParam<const char*> {};

TEST_P(EverydayModel, IsReadScaledAndTouched) {
  const std::string path = SharedData() + "/psb10/" + GetParam() + ".off";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
  geometry::MeshImport import;
  import.fit_mm = 150;
  auto mesh = geometry::ReadMeshFile(path, import);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  auto surface = geometry::Surface::Create(GetParam(), *std::move(mesh));
  ASSERT_TRUE(surface.ok()) << surface.status();
  EXPECT_NEAR(((*surface)->bounds().max_m - (*surface)->bounds().min_m).maxCoeff(), 0.150, 1e-6);

  // Narrow fingers, since some of the models are slim.
  DatasetSpecification specification = SmallDataset(500, "");
  specification.objects = {*surface};
  specification.model = std::make_shared<const model::Model>(model::NominalModel(3, 0.008));
  const std::vector<std::string> columns = Columns(specification, {}, 2);
  std::vector<float> contact_m(columns[9].size() / sizeof(float));
  std::memcpy(contact_m.data(), columns[9].data(), columns[9].size());
  ASSERT_EQ(contact_m.size(), 500u * 9u);
  const geometry::Bounds& bounds = (*surface)->bounds();
  for (size_t k = 0; k < contact_m.size(); ++k) {
    EXPECT_GE(contact_m[k], bounds.min_m[k % 3] - 1e-6);
    EXPECT_LE(contact_m[k], bounds.max_m[k % 3] + 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Psb, EverydayModel,
                         testing::Values("cup", "martini", "glass", "table", "teddy", "pliers", "bust",
                                         "mech", "vase", "teapot"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace touchstone::dataset
