// Sets with causes outside the catalogue by a third simulation, which shares no code with the product or with the
// oracle here.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "server/base/test_paths.h"
#include "tests/hidden_effects/generator/set_files.h"
#include "tests/hidden_effects/score/figures.h"
#include "tests/hidden_effects/score/verify.h"

namespace touchstone::hidden {
namespace {

const std::string kMeasurements = SharedData() + "/measurements/";

std::string FileText(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

struct PublicSet {
  const char* file;
  const char* arm;  // by whose rules it is judged
  Scenario truth;
  bool must_be_right;  // else honest is enough
};

void PrintTo(const PublicSet& set, std::ostream* out) {
  *out << set.file;
}

Scenario PublicCause(Cause cause) {
  Scenario truth;
  truth.causes = {std::move(cause)};
  return truth;
}

Scenario PublicEffect(Hidden effect, std::vector<DataError> data_errors) {
  Scenario truth;
  truth.hidden = {std::move(effect)};
  truth.data_errors = std::move(data_errors);
  return truth;
}

std::vector<PublicSet> PublicOutsideSets() {
  const Hidden tips{"tip_radius", {0.5}};
  return {
      {"periodic", "session wave, strong", PublicCause({CauseKind::kSessionWave, 0.2, {1200, 0}, {1, 0, -1}}),
       true},
      {"warm_up", "warm-up, strong", PublicCause({CauseKind::kWarmUp, 0.35, {600}, {1, 0, 0}}), true},
      {"mid_session", "mid-session offset, strong",
       PublicCause({CauseKind::kMidSession, 0.25, {3456}, {0, 1, 0}}), true},
      {"memory", "noise with memory, strong", PublicCause({CauseKind::kNoiseWithMemory, 7000, {295}, {}}),
       true},
      {"incidence_wave", "incidence wave, realistic",
       PublicCause({CauseKind::kIncidenceWave, 0.3, {40, 20}, {}}), false},
      {"one_object", "slip on one object, realistic",
       PublicCause({CauseKind::kSlipOnOneObject, 0.5, {0}, {}}), true},
      {"remounted", "remounted each round, strong", PublicCause({CauseKind::kRemounted, 0.4, {1}, {}}),
       false},
      {"beyond_bound", "beyond its bound, realistic", PublicEffect({"object_push", {8}}, {}), true},
      {"fingers_permuted", "fingers permuted, strong",
       PublicEffect(tips, {{DataErrorKind::kFingersPermuted, 0, {1, 2, 0}}}), true},
      {"objects_swapped", "objects swapped, strong",
       PublicEffect(tips, {{DataErrorKind::kObjectsSwapped, 0, {2, 3}}}), true},
  };
}

class PublicOutside : public testing::TestWithParam<PublicSet> {};

TEST_P(PublicOutside, IsAnsweredRightOrHonestly) {
  const std::string file = kMeasurements + "outside_" + GetParam().file + ".csv";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is missing";
  static const auto* objects = new TestObjects(LoadTestObjects(kMeasurements));
  Set set;
  set.truth = GetParam().truth;
  set.truth.objects = objects->solids;
  set.csv = FileText(file), set.model_yaml = NominalYaml(set.truth);
  const auto input = InputFor(set, *objects);
  ASSERT_TRUE(input.ok()) << input.status();
  const auto diagnosis = diagnosis::Diagnose(*input, {});
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  const v1::Report report = diagnosis::report::ToReport(*diagnosis);
  Tried tried;
  if (ClaimsAFall(report))
    tried.final_found_us = FinalRmseFoundAgainUs(set, report, *objects).value_or(INFINITY);
  const Arm& arm = *FindArm(GetParam().arm);
  const char* wanted = GetParam().must_be_right ? "right" : "honest";
  for (const Mark& mark : JudgeFigures(arm, set.truth, report, Judge(arm, set.truth, report, NAN), tried)) {
    if (mark.measure == "confidently wrong") {
      EXPECT_FALSE(mark.yes) << ReportInWords(report);
    } else if (mark.measure == wanted) {
      EXPECT_TRUE(mark.yes) << "not " << wanted << ": " << ReportInWords(report);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, PublicOutside, testing::ValuesIn(PublicOutsideSets()),
                         [](const auto& info) { return std::string(info.param.file); });

}  // namespace
}  // namespace touchstone::hidden
