#include "server/diagnosis/selection/surface/surface_support.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "server/base/numbers/random.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

touches::HiddenRig PrintedRig() {
  touches::HiddenRig rig;
  rig.samples_per_face = 12;
  return rig;
}

SurfaceSupport SupportIn(const DiagnosisInput& input) {
  auto workspace = MakeWorkspace(input, {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  EXPECT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const auto fit = engine::FitModel((*workspace)->experiment,
                                    engine::Parameterization(*input.model, (*workspace)->searched->objects));
  EXPECT_TRUE(fit.ok()) << fit.status();
  const auto support = FindSurfaceSupport(**workspace, *fit);
  EXPECT_TRUE(support.ok()) << support.status();
  return *support;
}

// Every finger of every pose is off by an amount of its own, the same in all repeats, times `growth` of the cosine of
// its incidence.
DiagnosisInput WithErrorsOfPoses(DiagnosisInput input, uint64_t seed, double size_m,
                                 double (*growth)(double)) {
  const auto observations = touches::MakeObservations(input);
  EXPECT_TRUE(observations.ok());
  const touches::Prediction details = *touches::Predict(*observations, *input.model, true, false, nullptr);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (int k = 0; k < observations->size(); ++k) {
    RandomStream random(seed, RandomDomain::kTest, observations->pose[k]);
    for (int i = 0; i < 3; ++i) {
      const double cosine = details.cos_incidence[static_cast<size_t>(k) * 3 + i];
      const int row = observations->row[k];
      set->time_s[static_cast<size_t>(row) * 3 + i] +=
          size_m * random.Normal() * growth(cosine) / set->speed_m_s[row];
    }
  }
  input.set = set;
  return input;
}

TEST(SurfaceSupport, IsGivenByBumps) {
  touches::HiddenRig rig = PrintedRig();
  rig.hidden = {{"surface_error", {"rms_mm=0.1", "length_mm=30"}}};
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    rig.seed = seed;
    const SurfaceSupport support = SupportIn(touches::MakeTestInput(rig));
    EXPECT_TRUE(support.IsSurface()) << seed;
    EXPECT_GT(support.Probability(), 0.9) << seed;
    EXPECT_LT(support.left_s, support.before_s) << seed;
    EXPECT_FALSE(support.IsElsewhere()) << seed;
  }
}

TEST(SurfaceSupport, IsNotGivenByErrorsOfPosesThatSteepFacesEnlarge) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  touches::HiddenRig rig = PrintedRig();
  const auto tangent = [](double cosine) { return std::sqrt(1 / std::max(cosine * cosine, 0.04) - 1); };
  const auto alike = [](double) { return 1.0; };
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    rig.seed = seed;
    for (double (*growth)(double) : {+tangent, +alike}) {
      const SurfaceSupport support =
          SupportIn(WithErrorsOfPoses(touches::MakeTestInput(rig), seed, 0.1e-3, growth));
      EXPECT_FALSE(support.IsSurface())
          << seed << " field " << support.field_nats << " own " << support.own_nats;
      EXPECT_LT(support.Probability(), 0.5) << seed;
    }
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
