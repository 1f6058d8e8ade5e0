#include "tests/hidden_effects/generator/generate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"
#include "server/touch/simulate.h"
#include "tests/hidden_effects/generator/unlisted.h"

namespace touchstone::hidden {
namespace {

constexpr uint64_t kTriangles = 5000;

const Scenario& Lats() {
  static const Scenario* scenario = [] {
    auto* s = new Scenario;
    for (const char* name : {"lat00", "lat10", "lat20"})
      s->objects.push_back(std::make_shared<Solid>(name, SupershapeTriangles(name, kTriangles)));
    return s;
  }();
  return *scenario;
}

Scenario With(std::vector<Hidden> hidden) {
  Scenario scenario = Lats();
  scenario.hidden = std::move(hidden);
  return scenario;
}

double Deviation(const Set& set, double power = 2) {
  double sum = 0;
  int count = 0;
  for (size_t k = 0; k < set.reported_us.size(); ++k) {
    const double off = set.reported_us[k] - set.exact_time_us[k];
    if (off == off) sum += std::pow(std::abs(off), power), ++count;
  }
  return std::pow(sum / count, 1 / power);
}

// The one place where the oracle meets the product: same commands, same meshes, both alone.
void ExpectTheProductAgrees(const std::vector<Hidden>& hidden, const std::string& effects_yaml) {
  const Set set = Generate(With(hidden), 7);
  auto model = model::ParseModel(
      "touchstone: model/1\nname: n\nend_effector: {fingers: 3, spacing_mm: 30}\n" + effects_yaml, "test",
      effects::Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  const touch::TouchSimulator simulator(std::make_shared<const model::Model>(*model));
  for (size_t object = 0; object < set.truth.objects.size(); ++object) {
    const std::string& name = set.truth.objects[object]->name();
    effects::TouchBatch batch;
    touch::TouchWorkspace workspace;
    simulator.Prepare(set.touches, &batch);
    batch.surface = *geometry::Surface::Create(
        name, *geometry::MakeSupershape(*geometry::NamedSupershape(name), kTriangles));
    for (int k = 0; k < set.touches; ++k) {
      batch.target_m[k] = set.commands[k].target_mm / 1000;
      batch.approach[k] = set.commands[k].approach;
      batch.lateral[k] = set.commands[k].lateral;
      batch.standoff_m[k] = 0.06;
      batch.speed_m_s[k] = set.speed_mm_s[k] / 1000;
    }
    ASSERT_TRUE(simulator.Run(&batch, &workspace).ok());
    for (int k = 0; k < set.touches; ++k) {
      if (set.commands[k].object != static_cast<int>(object)) continue;
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(batch.reported_time_s[batch.At(i, k)] * 1e6, set.exact_time_us[3 * k + i], 1)
            << name << " touch " << k << " finger " << i;
    }
  }
}

TEST(Generator, AndTheProductAgreeWithinAMicrosecondWhenNothingIsHidden) {
  ExpectTheProductAgrees({}, "");
}

TEST(Generator, AndTheProductAgreeOnBallTips) {
  ExpectTheProductAgrees({{"tip_radius", {1.5}}}, "effects:\n  - tip_radius: {radius_mm: 1.5}\n");
}

TEST(Generator, ASetIsAPureFunctionOfScenarioAndSeed) {
  const Set once = Generate(With({{"tip_radius", {1}}}), 3), again = Generate(With({{"tip_radius", {1}}}), 3);
  EXPECT_EQ(once.csv, again.csv);
  EXPECT_NE(once.csv, Generate(With({{"tip_radius", {1}}}), 4).csv);
}

TEST(Generator, HidingSomethingChangesNeitherPosesNorNoise) {
  const Set plain = Generate(Lats(), 3), hidden = Generate(With({{"object_push", {0.5}}}), 3);
  for (size_t k = 0; k < plain.exact_time_us.size(); ++k)
    EXPECT_NEAR(plain.reported_us[k] - plain.exact_time_us[k],
                hidden.reported_us[k] - hidden.exact_time_us[k], 1e-3);
  EXPECT_EQ(plain.session_time_s, hidden.session_time_s);
  EXPECT_EQ(ExactTimesUs(With({{"object_push", {0.5}}}), plain, 3), hidden.exact_time_us);
}

TEST(Generator, WritesTheColumnsOfAMeasurementFile) {
  const Set set = Generate(Lats(), 3);
  std::istringstream lines(set.csv);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(
      line,
      "touch,object,round,face,session_time_s,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,"
      "target_z_mm,approach_x,approach_y,approach_z,lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us");
  int rows = 0;
  while (std::getline(lines, line)) ++rows;
  EXPECT_EQ(rows, 3 * 48 * 4);
  EXPECT_EQ(set.touches, rows);
}

TEST(Generator, NoiseHasItsSizeAndItsTails) {
  const double sigma = Deviation(Generate(Lats(), 3));
  EXPECT_NEAR(sigma, 5000, 5000 * 4 / std::sqrt(2.0 * 1728));
  // Kurtosis: 3 for Gaussian noise, much more with tails.
  const Set tails = Generate(With({{"heavy_tail_noise", {3}}}), 3);
  EXPECT_GT(std::pow(Deviation(tails, 4) / Deviation(tails), 4), 5);
  // Noise that grows by tan(inc) has more than its sigma everywhere.
  EXPECT_GT(Deviation(Generate(With({{"incidence_noise", {1}}}), 3)), 1.15 * sigma);
}

TEST(Generator, PollingRoundsUpByHalfAnIntervalOnAverage) {
  Scenario scenario = With({{"poll_interval", {8000}}});
  scenario.sigma_us = 0;
  const Set set = Generate(scenario, 3);
  double sum = 0;
  for (size_t k = 0; k < set.reported_us.size(); ++k) {
    const double late = set.reported_us[k] - set.exact_time_us[k];
    EXPECT_GE(late, -1e-3);
    EXPECT_LE(late, 8000 + 1e-3);
    sum += late;
    // Ticks of one touch lie whole intervals apart.
    const double first_us = set.reported_us[k - k % 3];
    EXPECT_NEAR(std::remainder(set.reported_us[k] - first_us, 8000), 0, 1e-3);
  }
  EXPECT_NEAR(sum / set.reported_us.size(), 4000, 200);
}

TEST(Generator, LossesAndOutliersHaveTheirShare) {
  Scenario scenario = With({{"missed_contact", {0.1}}});
  scenario.outlier_share = 0.02;
  const Set set = Generate(scenario, 3);
  int lost = 0, wild = 0;
  for (size_t k = 0; k < set.reported_us.size(); ++k) {
    lost += std::isnan(set.reported_us[k]);
    wild += std::abs(set.reported_us[k] - set.exact_time_us[k]) > 25'000;
  }
  const double n = set.reported_us.size();
  EXPECT_NEAR(lost / n, 0.1, 0.03);
  EXPECT_NEAR(wild / n, 0.02 * 0.9, 0.012);
}

TEST(Generator, ManySpeedsManyFingersAndNoPosesAreWritten) {
  Scenario scenario = Lats();
  scenario.objects.resize(1);
  scenario.fingers = 5, scenario.spacing_mm = 12, scenario.speeds_mm_s = {20, 50},
  scenario.speed_by_round = true;
  const Set set = Generate(scenario, 3);
  EXPECT_EQ(set.speed_mm_s[0], 20);
  EXPECT_EQ(set.speed_mm_s[48], 50);
  EXPECT_NEAR(set.exact_time_us[0] / set.exact_time_us[48 * 5], 2.5, 1e-9);
  EXPECT_THAT(set.csv, testing::HasSubstr("t_0_us,t_1_us,t_2_us,t_3_us,t_4_us"));
  scenario.with_poses = false;
  EXPECT_THAT(Generate(scenario, 3).csv, testing::StartsWith("object,t_0_us"));
}

TEST(Generator, ALongerListOfTouchesBeginsLikeAShorterOne) {
  const auto commands = DrawCommands(Lats(), 20, 3);
  const Set longer = GenerateFor(Lats(), commands, 3);
  const Set shorter = GenerateFor(Lats(), {commands.begin(), commands.begin() + 12}, 3);
  EXPECT_EQ(shorter.reported_us,
            std::vector<double>(longer.reported_us.begin(), longer.reported_us.begin() + 36));
  EXPECT_EQ(DrawCommands(Lats(), 5, 3).back().target_mm, commands[4].target_mm);
  // A command may have a standoff and a speed of its own.
  Command near = commands[0];
  near.standoff_mm = 30, near.speed_mm_s = 10;
  const Set own = GenerateFor(Lats(), {near}, 3);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(own.exact_time_us[i], 2 * longer.exact_time_us[i] - 30 / 10.0 * 1e6, 1e-3);
}

TEST(Generator, EveryUnlistedEffectMovesSomething) {
  for (const UnlistedKind& kind : UnlistedKinds()) {
    Scenario scenario = Lats();
    scenario.unlisted = {{kind.name, 0.3, 5}};
    const Set plain = Generate(Lats(), 3);
    EXPECT_GT(SignalInStandardErrors(ExactTimesUs(scenario, plain, 3), plain.exact_time_us, 3, 5000), 5)
        << kind.name;
  }
}

TEST(Generator, TheSignalOfFingersThatAreTooLongIsKnown) {
  const Set plain = Generate(Lats(), 3);
  const auto longer = ExactTimesUs(With({{"finger_length", {0.1, -0.05, -0.05}}}), plain, 3);
  // 0.1 mm is 5000 us: sqrt(576 touches * (1 + 1/4 + 1/4)).
  EXPECT_NEAR(SignalInStandardErrors(longer, plain.exact_time_us, 3, 5000), std::sqrt(576 * 1.5), 1e-6);
}

}  // namespace
}  // namespace touchstone::hidden
