#include "server/diagnosis/checks/part_mistakes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/checks/corrupted_test_file.h"

namespace touchstone::diagnosis::checks {
namespace {

using engine::ProblemKind;

using ::testing::HasSubstr;

// 3 objects, one after the other: 24 poses in each of 4 rounds, touches 0 to 287.
DiagnosisInput FileOfRounds(uint64_t seed) {
  touches::HiddenRig rig = Rig(seed);
  rig.rounds = 4;
  return MakeFile(rig);
}

TEST(PartMistakes, FingersExchangedInSomeRoundsAreToldWithTheTouches) {
  for (const uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    const auto problems = ProblemsOf(Corrupted(FileOfRounds(seed), With([](auto* f) {
                                                 f->touches = {{24, 71}};
                                                 f->finger_order = {1, 0, 2};
                                               })));
    ASSERT_FALSE(problems.empty());
    EXPECT_EQ(problems[0].kind, ProblemKind::kFingerOrder);
    EXPECT_THAT(problems[0].fix, HasSubstr("--touches 2"));
    EXPECT_THAT(problems[0].fix, HasSubstr("--swap-fingers l,m"));
    EXPECT_THAT(problems[0].words, HasSubstr(" of the 288 touches alone (touches 2"));
    EXPECT_LT(problems[0].error_after, 0.15 * problems[0].error_before);
  }
}

TEST(PartMistakes, TouchesOfOneObjectUnderTheNameOfAnotherAreTold) {
  for (const uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    DiagnosisInput input = FileOfRounds(seed);
    // From here on no row is called lat10, but its mesh is there.
    input = Corrupted(input, With([](auto* f) { f->rename_objects = {{"lat10", "lat20"}}; }));
    const auto problems = ProblemsOf(input);
    ASSERT_FALSE(problems.empty());
    EXPECT_EQ(problems[0].kind, ProblemKind::kWrongMesh);
    EXPECT_THAT(problems[0].detail, HasSubstr("lat20 is lat10, touches 9"));
    EXPECT_THAT(problems[0].words,
                HasSubstr(" of the 192 touches that the file calls lat20 were touches of lat10"));
    EXPECT_THAT(problems[0].fix, HasSubstr("--rename-object lat20=lat10"));
    EXPECT_LT(problems[0].error_after, 0.15 * problems[0].error_before);
  }
}

TEST(PartMistakes, TimesOfOneObjectInAnotherUnitAreTold) {
  const auto problems = ProblemsOf(Corrupted(FileOfRounds(1), With([](auto* f) {
                                               f->touches = {{96, 191}};
                                               f->scale_times = 1e-3;
                                             })));
  ASSERT_FALSE(problems.empty());
  EXPECT_EQ(problems[0].kind, ProblemKind::kUnitsTime);
  EXPECT_THAT(problems[0].fix, HasSubstr("--scale-times 1000"));
}

TEST(PartMistakes, TimesThatAreOneRowOffFromSomewhereOnAreTold) {
  const auto problems = ProblemsOf(Corrupted(FileOfRounds(2), With([](auto* f) {
                                               f->touches = {{150, 287}};
                                               f->shift_rows = 1;
                                             })));
  ASSERT_FALSE(problems.empty());
  EXPECT_EQ(problems[0].kind, ProblemKind::kRowShift);
  EXPECT_THAT(problems[0].fix, HasSubstr("--shift-rows=-1"));
}

TEST(PartMistakes, NamesExchangedInOneRoundAreTwoPartsFixedOneAfterTheOther) {
  // lat10 holds touches 96 to 191, lat20 those from 192 on, 24 per round.
  DiagnosisInput input = Corrupted(FileOfRounds(1), With([](auto* f) {
                                     f->touches = {{120, 143}, {216, 239}};
                                     f->rename_objects = {{"lat10", "lat20"}, {"lat20", "lat10"}};
                                   }));
  const auto problems = ProblemsOf(input);
  ASSERT_EQ(problems.size(), 2u);
  for (const auto& problem : problems) EXPECT_EQ(problem.kind, ProblemKind::kObjectNames);
  EXPECT_THAT(problems[0].fix, ::testing::StartsWith("touchstone session fix set.csv --touches "));
  EXPECT_THAT(problems[1].fix, ::testing::StartsWith("touchstone session fix fixed.csv --touches "));
  EXPECT_THAT(problems[1].fix, ::testing::EndsWith("-o fixed2.csv"));
  EXPECT_THAT(problems[0].fix + problems[1].fix, HasSubstr("--touches 120-143 --rename-object lat20=lat10"));
  EXPECT_THAT(problems[0].fix + problems[1].fix, HasSubstr("--touches 216-239 --rename-object lat10=lat20"));
  EXPECT_LT(problems[1].error_after, 0.03);
}

TEST(TwoMistakes, BothAreToldWithOneCommand) {
  struct Pair {
    const char* name;
    ProblemKind kinds[2];
    const char* options[2];
    MeasurementFix corrupt;
  };
  const std::vector<Pair> pairs = {
      {"fingers and times",
       {ProblemKind::kFingerOrder, ProblemKind::kUnitsTime},
       {"--finger-order r,l,m", "--scale-times 10 "},
       With([](auto* f) {
         f->finger_order = {1, 2, 0}, f->scale_times = 0.1;
       })},
      {"names and fingers",
       {ProblemKind::kFingerOrder, ProblemKind::kObjectNames},
       {"--swap-fingers l,m", "--swap-objects lat10,lat20"},
       With([](auto* f) {
         f->finger_order = {1, 0, 2};
         f->rename_objects = {{"lat10", "lat20"}, {"lat20", "lat10"}};
       })},
      {"frame and times",
       {ProblemKind::kUnitsTime, ProblemKind::kFrame},
       {"--scale-times 1000 ", "--permute-axes=-y,x,z"},
       With([](auto* f) { f->scale_times = 1e-3, f->axes = *session::ParseAxes("y,-x,z"); })},
  };
  for (const Pair& pair : pairs) {
    SCOPED_TRACE(pair.name);
    const auto problems = ProblemsOf(Corrupted(FileOfRounds(3), pair.corrupt));
    ASSERT_EQ(problems.size(), 2u);
    std::vector<ProblemKind> kinds = {problems[0].kind, problems[1].kind};
    EXPECT_THAT(kinds, ::testing::UnorderedElementsAre(pair.kinds[0], pair.kinds[1])) << problems[0].words;
    EXPECT_EQ(problems[0].fix, problems[1].fix);
    for (const char* option : pair.options) EXPECT_THAT(problems[0].fix, HasSubstr(option));
    EXPECT_LT(problems[0].error_after, 0.03);
  }
}

TEST(MeshUnits, AMeshInAnotherUnitIsToldOfTheWholeSetAndOfOneObject) {
  const std::vector<std::vector<std::string>> objects = {{"lat00", "lat10", "lat20"}, {"lat20"}};
  for (const std::vector<std::string>& wrong : objects)
    for (const double factor : {1e-3, 1 / 25.4, 10.0}) {
      SCOPED_TRACE(testing::Message() << wrong.size() << ", " << factor);
      DiagnosisInput input = FileOfRounds(1);
      for (const std::string& object : wrong) {
        geometry::TriangleMesh mesh = input.surfaces[object]->mesh();
        for (Eigen::Vector3f& vertex : mesh.vertices_m) vertex *= static_cast<float>(factor);
        input.surfaces[object] = *geometry::Surface::Create(object, std::move(mesh));
      }
      const auto problems = ProblemsOf(input);
      ASSERT_EQ(problems.size(), 1u);
      EXPECT_EQ(problems[0].kind, ProblemKind::kUnitsLength);
      EXPECT_THAT(problems[0].detail, HasSubstr("mesh of lat"));
      EXPECT_THAT(problems[0].words, HasSubstr(factor == 1e-3 ? "lat20 is in another unit: 1000 times"
                                               : factor < 1   ? "lat20 is in another unit: 25.4 times"
                                                              : "lat20 is in another unit: 1/10 times"));
      EXPECT_LT(problems[0].error_after, 0.03);
    }
}

}  // namespace
}  // namespace touchstone::diagnosis::checks
