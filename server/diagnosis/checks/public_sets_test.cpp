// The public sets (../shared/data/measurements): the two with a data error are named, the others are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include "server/base/test_paths.h"
#include "server/diagnosis/checks/data_problems.h"
#include "server/effects/all_effects.h"
#include "server/geometry/files/mesh_file.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::diagnosis::checks {
namespace {

using engine::ProblemKind;

const std::string kFolder = SharedData() + "/measurements/";

class PublicSets : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kFolder + "nominal.yaml")) GTEST_SKIP() << kFolder << " is not there";
  }

  static DiagnosisInput Read(const std::string& name) {
    DiagnosisInput input;
    const auto set = session::ReadMeasurementSet(kFolder + name + ".csv");
    EXPECT_TRUE(set.ok()) << set.status();
    input.set = std::make_shared<session::MeasurementSet>(*set);
    input.model = std::make_shared<const model::Model>(*model::ParseModel(
        "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
        "  - gaussian_noise: {sigma_us: 5000}\n",
        "nominal.yaml", effects::Catalogue()));
    static std::map<std::string, std::shared_ptr<const geometry::Surface>> surfaces;
    for (const std::string& object : input.set->objects) {
      auto& surface = surfaces[object];
      if (surface == nullptr)
        surface = *geometry::Surface::Create(object, *geometry::ReadMeshFile(kFolder + object + ".off"));
    }
    input.surfaces = surfaces;
    return input;
  }
};

TEST_F(PublicSets, PermutedFingersAreToldAndTheFixMendsTheFile) {
  const DiagnosisInput input = Read("outside_fingers_permuted");
  const auto problems = FindDataProblems(input, {});
  ASSERT_TRUE(problems.ok()) << problems.status();
  ASSERT_EQ(problems->size(), 1u);
  const engine::DataProblem& problem = problems->front();
  EXPECT_EQ(problem.kind, ProblemKind::kFingerOrder);
  EXPECT_EQ(problem.detail, "l, m, r hold m, r, l");
  EXPECT_THAT(problem.fix, ::testing::HasSubstr("--finger-order m,r,l -o fixed.csv"));
  EXPECT_LT(problem.error_after, 0.02 * problem.error_before);
}

TEST_F(PublicSets, SwappedObjectsAreTold) {
  const auto problems = FindDataProblems(Read("outside_objects_swapped"), {});
  ASSERT_TRUE(problems.ok()) << problems.status();
  ASSERT_EQ(problems->size(), 1u);
  EXPECT_EQ(problems->front().kind, ProblemKind::kObjectNames);
  EXPECT_EQ(problems->front().detail, "lat10 <-> lat15");
  EXPECT_THAT(problems->front().fix, ::testing::HasSubstr("--swap-objects lat10,lat15 -o fixed.csv"));
}

TEST_F(PublicSets, PhysicsIsNoMistakeOfTheFile) {
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    const std::string name = entry.path().stem();
    if (entry.path().extension() != ".csv" || name == "outside_fingers_permuted" ||
        name == "outside_objects_swapped")
      continue;
    const DiagnosisInput input = Read(name);
    const auto began = std::chrono::steady_clock::now();
    const auto problems = FindDataProblems(input, {});
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    ASSERT_TRUE(problems.ok()) << name << ": " << problems.status();
    EXPECT_TRUE(problems->empty()) << name << ": " << problems->front().words;
    RecordProperty(name, std::to_string(seconds));
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::checks
