#include "server/diagnosis/selection/touches_nothing_missing.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/engine/uniform_p_values.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

engine::NothingMissing TestOf(const DiagnosisInput& input) {
  const absl::StatusOr<std::unique_ptr<Workspace>> workspace = MakeWorkspace(input, {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  EXPECT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const engine::StepwiseSearch search((*workspace)->experiment,
                                      MakeCandidates((*workspace)->input, *(*workspace)->searched),
                                      engine::SearchRules(), [](const std::string&) {});
  const absl::StatusOr<engine::GivenAndEffects> columns =
      engine::ColumnsOfEffects(search, *(*workspace)->input.model);
  EXPECT_TRUE(columns.ok()) << columns.status();
  const absl::StatusOr<engine::TriedPValues> tried = TryOnTouches(**workspace, *columns);
  EXPECT_TRUE(tried.ok()) << tried.status();
  return tried.ok() ? engine::WorstOfAll(*tried) : engine::NothingMissing();
}

engine::NothingMissing TestOf(const touches::HiddenRig& rig) {
  return TestOf(touches::MakeTestInput(rig));
}

touches::HiddenRig SmallRig(uint64_t seed) {
  touches::HiddenRig rig;
  rig.objects = {"lat05", "lat15"};
  rig.rounds = 2;
  rig.seed = seed;
  return rig;
}

TEST(TouchesNothingMissing, HasAUniformPWhereNothingIsHidden) {
  TOUCHSTONE_SECOND_TIER("statistical: 500 sets");
  std::vector<double> p;
  for (int set = 0; set < 500; ++set) p.push_back(TestOf(SmallRig(100 + set)).p);
  engine::ExpectUniform(p);
}

// The given model's own noise is drawn, whatever its shape.
TEST(TouchesNothingMissing, HasAUniformPUnderNoiseWithHeavyTails) {
  TOUCHSTONE_SECOND_TIER("statistical: 200 sets");
  std::vector<double> p;
  for (int set = 0; set < 200; ++set) {
    touches::HiddenRig rig = SmallRig(1000 + set);
    rig.hidden = rig.known = {{"heavy_tail_noise", {"degrees_of_freedom=4"}}};
    p.push_back(TestOf(rig).p);
  }
  engine::ExpectUniform(p);
}

TEST(TouchesNothingMissing, IsSmallForEachKindOfCause) {
  const auto p_of = [](const std::string& effect, const std::vector<std::string>& values) {
    touches::HiddenRig rig = SmallRig(1);
    rig.hidden = {{effect, values}};
    return TestOf(rig).p;
  };
  EXPECT_LT(p_of("tip_radius", {"radius_mm=1"}), 1e-4);
  EXPECT_LT(p_of("formula", {"name=wave", "adds=travel_mm", "expression=0.2*finger*sin(session_time_s/200)"}),
            1e-4);
  EXPECT_LT(p_of("finger_noise", {"sigma_us=0,0,9000"}), 0.02);
}

// Kinds: what a verdict is given for is among the hypotheses.
TEST(TouchesNothingMissing, IsSmallForTicksAndTurnsOfAFinger) {
  using Change = std::function<double(int row, double time_s)>;
  const Change changes[] = {[](int, double time_s) { return std::round(time_s * 2000) / 2000; },
                            [](int row, double time_s) { return time_s + (row % 5 == 0 ? 0.006 : 0); }};
  for (const Change& change : changes) {
    DiagnosisInput input = touches::MakeTestInput(SmallRig(3));
    auto set = std::make_shared<session::MeasurementSet>(*input.set);
    for (int row = 0; row < set->size(); ++row)
      set->time_s[row * 3 + 1] = change(row, set->time_s[row * 3 + 1]);
    input.set = set;
    EXPECT_LT(TestOf(input).p, 1e-3);
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
