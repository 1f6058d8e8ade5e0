#include "server/diagnosis/selection/touches_nothing_missing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/test_tier.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

engine::NothingMissing TestOf(const touches::HiddenRig& rig) {
  const absl::StatusOr<std::unique_ptr<Workspace>> workspace = MakeWorkspace(touches::MakeTestInput(rig), {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  EXPECT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const engine::StepwiseSearch search((*workspace)->experiment,
                                      MakeCandidates((*workspace)->input, *(*workspace)->searched),
                                      engine::SearchRules(), [](const std::string&) {});
  const absl::StatusOr<GivenAndEffects> columns = ColumnsOfEffects(**workspace, search);
  EXPECT_TRUE(columns.ok()) << columns.status();
  const absl::StatusOr<engine::NothingMissing> test = TestNothingMissing(**workspace, *columns);
  EXPECT_TRUE(test.ok()) << test.status();
  return test.ok() ? *test : engine::NothingMissing();
}

touches::HiddenRig SmallRig(uint64_t seed) {
  touches::HiddenRig rig;
  rig.objects = {"lat05", "lat15"};
  rig.rounds = 2;
  rig.seed = seed;
  return rig;
}

// Kolmogorov's distance of p values from the uniform distribution; above 0.073 of 500 in 1 of 100 cases.
double DistanceFromUniform(std::vector<double> p) {
  std::sort(p.begin(), p.end());
  double distance = 0;
  const double count = static_cast<double>(p.size());
  for (size_t i = 0; i < p.size(); ++i)
    distance = std::max({distance, std::abs(p[i] - static_cast<double>(i) / count),
                         std::abs(p[i] - static_cast<double>(i + 1) / count)});
  return distance;
}

TEST(TouchesNothingMissing, HasAUniformPWhereNothingIsHidden) {
  TOUCHSTONE_SECOND_TIER("statistical: 500 sets");
  std::vector<double> p;
  for (int set = 0; set < 500; ++set) p.push_back(TestOf(SmallRig(100 + set)).p);
  EXPECT_LT(DistanceFromUniform(p), 0.073);
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
  EXPECT_LT(DistanceFromUniform(p), 0.115);
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

}  // namespace
}  // namespace touchstone::diagnosis::selection
