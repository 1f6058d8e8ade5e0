#include "server/diagnosis/distributions/pose_free.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/random.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/assumed_plan.h"
#include "server/diagnosis/distributions/pose_free_distances.h"
#include "server/diagnosis/distributions/pose_free_rank.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

// A wedge of 120 x 100 x 80 mm: six faces, none of them like another.
std::shared_ptr<const Surface> Wedge() {
  TriangleMesh mesh;
  mesh.vertices_m = {{-0.06f, -0.05f, -0.04f}, {0.06f, -0.05f, -0.04f}, {0.06f, 0.05f, -0.04f},
                     {-0.06f, 0.05f, -0.04f},  {-0.05f, -0.04f, 0.03f}, {0.05f, -0.05f, 0.04f},
                     {0.055f, 0.045f, 0.02f},  {-0.06f, 0.05f, 0.04f}};
  for (const auto& q : std::vector<std::array<uint32_t, 4>>{
           {3, 2, 1, 0}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  }
  return *Surface::Create("wedge", mesh);
}

std::shared_ptr<const Model> ModelWith(const std::string& effects) {
  auto model = ParseModel("touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\n" +
                              (effects.empty() ? effects : "effects:\n" + effects),
                          "test", Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  return std::make_shared<const Model>(*std::move(model));
}

const char kNoise[] = "  - gaussian_noise: {sigma_us: 5000}\n";

// A set without poses that `model` made: `poses` x `rounds` on each object, in rounds.
DiagnosisInput MakeInput(const std::shared_ptr<const Model>& model, int poses_a_face, int rounds,
                         uint64_t seed, const std::string& nominal = kNoise, int objects = 1,
                         const SupposedPoses& poses = {}) {
  auto set = std::make_shared<MeasurementSet>();
  set->origin = "test.csv";
  set->fingers = 3;
  DiagnosisInput input;
  for (int o = 0; o < objects; ++o) {
    set->objects.push_back("wedge" + std::to_string(o));
    input.surfaces[set->objects[o]] = Wedge();
    Plan plan;
    plan.kind = Plan::Kind::kFaces;
    plan.faces.samples_per_face = poses_a_face;
    plan.faces.rounds = rounds;
    plan.touch_interval_s = 10;
    std::vector<uint64_t> numbers(6 * poses_a_face * rounds);
    for (size_t n = 0; n < numbers.size(); ++n) numbers[n] = n;
    const auto time_s =
        *SimulateUnposed(model, Wedge(), WithPoses(plan, poses), numbers, 1000003 * seed + o + 77);
    for (size_t n = 0; n < numbers.size(); ++n) {
      set->touch.push_back(set->touch.size());
      set->object.push_back(o);
    }
    set->time_s.insert(set->time_s.end(), time_s.begin(), time_s.end());
  }
  input.set = set;
  input.model = ModelWith(nominal);
  return input;
}

TEST(EnergyDistance, IsZeroForEqualSamplesAndTheClosedFormForTwoPoints) {
  const TimePoints a = ToPoints({0, 0, 0}, 3), b = ToPoints({0.003, 0, 0}, 3);
  EXPECT_EQ(EnergyDistance(a, a, 0), 0);
  // |P (3, 0, 0)| = 3 sqrt(2 / 3).
  EXPECT_NEAR(EnergyDistance(a, b, 0), 2 * 0.003 * std::sqrt(2.0 / 3), 1e-12);
}

TEST(EnergyDistance, DoesNotHangOnACommonTimeNorOnIncompleteTouches) {
  const TimePoints a = ToPoints({0, 0.1, 0.3, 0.2, 0.2, 0.5, 0, 0, NAN}, 3);
  const TimePoints b = ToPoints({7, 7.1, 7.3, 2.2, 2.2, 2.5}, 3);
  EXPECT_EQ(a.size(), 2);
  EXPECT_NEAR(EnergyDistance(a, b, MeanDistance(b, b)), 0, 1e-12);
}

TEST(KolmogorovDistance, IsTheLargestGapWithTiesOnBothSides) {
  EXPECT_EQ(KolmogorovDistance({1, 2, 3, 4}, {1, 2, 3, 4}), 0);
  EXPECT_EQ(KolmogorovDistance({1, 1, 1, 2}, {1, 2, 2, 2}), 0.5);
  EXPECT_EQ(KolmogorovDistance({1, 2}, {3, 4}), 1);
}

TEST(SequentialP, IsExactWhetherOneStopsOrNot) {
  EXPECT_EQ(SequentialP({1, 2, 3, 4}, 5, 2), 1 / 5.0);
  EXPECT_EQ(SequentialP({1, 2, 3, 4}, 4, 2), 2 / 5.0);
  EXPECT_EQ(SequentialP({1, 2, 3, 4}, 3, 2), 2 / 4.0);
  EXPECT_EQ(SequentialP({4, 4, 1, 1}, 3, 2), 1);  // what is made after the second does not count
}

TEST(CountRepeats, SeesRoundsRepeatsInAnyOrderAndNone) {
  bool in_rounds = false;
  const auto model = ModelWith(kNoise);
  DiagnosisInput input = MakeInput(model, 8, 4, 1);
  EXPECT_EQ(CountRepeats(input.set->time_s, 3, &in_rounds), 4);
  EXPECT_TRUE(in_rounds);
  // Shuffled.
  std::vector<double> shuffled = input.set->time_s;
  RandomStream random(1, RandomDomain::kTest);
  for (int n = 191; n > 0; --n) {
    const int other = static_cast<int>(random.Below(n + 1));
    for (int i = 0; i < 3; ++i) std::swap(shuffled[n * 3 + i], shuffled[other * 3 + i]);
  }
  EXPECT_EQ(CountRepeats(shuffled, 3, &in_rounds), 4);
  EXPECT_FALSE(in_rounds);
  input = MakeInput(model, 32, 1, 2);
  EXPECT_EQ(CountRepeats(input.set->time_s, 3, &in_rounds), 1);
  EXPECT_FALSE(in_rounds);
}

TEST(Unposed, UnderTheRightModelEveryPIsEquallyProbable) {
  int below_tenth = 0, below_half = 0, energy_below_tenth = 0;
  const int sets = 40;
  for (int seed = 0; seed < sets; ++seed) {
    DiagnosisInput input = MakeInput(ModelWith(kNoise), 4, 3, seed);
    input.seed = seed;
    const auto report = CompareUnposed(input, {}, false);
    ASSERT_TRUE(report.ok()) << report.status();
    below_tenth += report->initial().lack_of_fit_p() <= 0.1;
    below_half += report->initial().lack_of_fit_p() <= 0.5;
    energy_below_tenth += report->distributions().p() <= 0.1;
  }
  EXPECT_NEAR(below_half, 0.5 * sets, 3 * std::sqrt(0.25 * sets));
  EXPECT_NEAR(below_tenth, 0.1 * sets, 3 * std::sqrt(0.09 * sets));
  EXPECT_NEAR(energy_below_tenth, 0.1 * sets, 3 * std::sqrt(0.09 * sets));
}

TEST(Unposed, AnAdequateModelIsCalledSoAndTheReportSaysWhatCannotBeKnown) {
  const auto report = CompareUnposed(MakeInput(ModelWith(kNoise), 8, 4, 3, kNoise, 2), {}, true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict(), v1::Report::ADEQUATE);
  EXPECT_EQ(report->touches(), 384u);
  EXPECT_NEAR(report->noise_floor_us(), 5000, 600);
  EXPECT_EQ(report->distributions().compatible_effects_size(), 0);
  EXPECT_GT(report->distributions().simulated_touches(), 1000u);
  EXPECT_THAT(report->warnings(0), testing::HasSubstr("cannot be known"));
  EXPECT_THAT(report->distributions().plan(), testing::HasSubstr("8 poses a face, 4 touches a pose"));
  double fractions = 0;
  for (const v1::StatisticTest& test : report->distributions().statistics())
    if (test.name().substr(0, 6) == "finger") fractions += test.measured();
  EXPECT_NEAR(fractions, 1, 1e-9);
}

// Names of the effects that a report calls compatible.
std::vector<std::string> CompatibleIn(const v1::Report& report) {
  const auto& names = report.distributions().compatible_effects();
  return {names.begin(), names.end()};
}

TEST(Unposed, AGrossErrorIsFoundWithWhatIsCompatibleAndNoCulpritIsNamed) {
  const auto wrong = ModelWith(std::string(kNoise) + "  - finger_length: {offset_mm: [1, -0.5, -0.5]}\n");
  int told = 0;
  DiagnosisContext context;
  context.progress = [&](const std::string&, double) {
    ++told;
    return true;
  };
  const auto report = CompareUnposed(MakeInput(wrong, 16, 2, 4, kNoise, 2), context, true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict(), v1::Report::UNEXPLAINED);
  EXPECT_LT(report->initial().lack_of_fit_p(), 0.005);
  EXPECT_THAT(CompatibleIn(*report), testing::Contains("finger_length"));
  // At one speed a latency is the same as a length.
  EXPECT_THAT(CompatibleIn(*report), testing::Contains("channel_latency"));
  EXPECT_THAT(CompatibleIn(*report), testing::Not(testing::Contains("gaussian_noise")));
  EXPECT_THAT(report->summary(), testing::HasSubstr("write down the poses"));
  EXPECT_EQ(report->steps_size(), 0);
  EXPECT_GT(told, 30);  // a few seconds of work are told of many times a second
}

TEST(Unposed, PosesThatAreNotTheUsualOnesAreFittedNeitherBlamedNorInTheWayOfAnError) {
  DiagnosisInput input = MakeInput(ModelWith(kNoise), 16, 2, 11, kNoise, 2, {0.6, 0.8});
  auto report = CompareUnposed(input, {}, true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict(), v1::Report::ADEQUATE);
  EXPECT_THAT(report->distributions().plan(), testing::HasSubstr("what fits best"));

  const auto wrong = ModelWith(std::string(kNoise) + "  - finger_length: {offset_mm: [1, -0.5, -0.5]}\n");
  report = CompareUnposed(MakeInput(wrong, 16, 2, 11, kNoise, 2, {0.6, 0.8}), {}, true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict(), v1::Report::UNEXPLAINED);
  EXPECT_THAT(CompatibleIn(*report), testing::Contains("finger_length"));
}

TEST(Unposed, MissingNoiseIsNamedWithItsSizeFromTheRounds) {
  const auto report = CompareUnposed(MakeInput(ModelWith(kNoise), 8, 8, 5, "", 2), {}, true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict(), v1::Report::MISSING_EFFECTS);
  ASSERT_EQ(report->steps_size(), 1);
  EXPECT_EQ(report->steps(0).effect(), "gaussian_noise");
  EXPECT_NEAR(report->steps(0).parameters(0).value(), 5000, 4 * report->steps(0).parameters(0).std_error());
  EXPECT_THAT(report->improved_model_yaml(), testing::HasSubstr("gaussian_noise"));
}

TEST(Unposed, TimesInTheWrongUnitAreCalledThat) {
  DiagnosisInput input = MakeInput(ModelWith(kNoise), 4, 2, 6);
  auto set = std::make_shared<MeasurementSet>(*input.set);
  for (double& time_s : set->time_s) time_s *= 1000;
  input.set = set;
  const auto report = CompareUnposed(input, {}, false);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->warnings(), testing::Contains(testing::HasSubstr("is their unit us")));
}

TEST(Unposed, RowsWithAMissingFingerAreCounted) {
  DiagnosisInput input = MakeInput(ModelWith(kNoise), 4, 3, 7);
  auto set = std::make_shared<MeasurementSet>(*input.set);
  for (const int row : {3, 9, 40}) set->time_s[row * 3 + 1] = NAN;
  input.set = set;
  const auto report = CompareUnposed(input, {}, false);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->touches(), 69u);
  EXPECT_EQ(report->data().missed_contacts(), 3u);
  ASSERT_EQ(report->data().unused_size(), 1);
  EXPECT_EQ(report->data().unused(0).rows(), 3u);
  EXPECT_EQ(report->data().unused(0).examples(0), 3u);
}

TEST(Unposed, AnObjectWithoutAMeshAndAWrongNumberOfFingersAreErrors) {
  DiagnosisInput input = MakeInput(ModelWith(kNoise), 4, 2, 8);
  input.surfaces.clear();
  EXPECT_THAT(std::string(CompareUnposed(input, {}, false).status().message()),
              testing::HasSubstr("object 'wedge0' has no mesh"));
  input = MakeInput(ModelWith(kNoise), 4, 2, 8);
  auto model = std::make_shared<Model>(*input.model);
  model->fingers = 4;
  input.model = model;
  EXPECT_THAT(std::string(CompareUnposed(input, {}, false).status().message()),
              testing::HasSubstr("times of 3 fingers, the model 'nominal' has 4"));
}

TEST(Unposed, IsCancelledAtEveryStageAndSaysTheSameOnAnyNumberOfThreads) {
  const auto wrong = ModelWith(std::string(kNoise) + "  - finger_length: {offset_mm: [2, -1, -1]}\n");
  const DiagnosisInput input = MakeInput(wrong, 6, 3, 9);
  for (const char* at : {"simulating sets", "fitting the poses' spread", "trying effects"}) {
    DiagnosisContext stop;
    std::string last;
    stop.progress = [&](const std::string& stage, double done) {
      last = stage;
      return stage != at;
    };
    EXPECT_EQ(CompareUnposed(input, stop, true).status().code(), absl::StatusCode::kCancelled) << at;
    EXPECT_EQ(last, at);  // nothing was asked after the refusal
  }
  ThreadPool pool(2);
  DiagnosisContext threads;
  threads.pool = &pool;
  double before = 0;
  threads.progress = [&](const std::string&, double done) {
    EXPECT_GE(done, before);
    before = done;
    return done <= 1;
  };
  const auto report = CompareUnposed(input, threads, true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict(), v1::Report::UNEXPLAINED);
  EXPECT_EQ(before, 1);
  EXPECT_EQ(CompareUnposed(input, {}, true)->SerializeAsString(), report->SerializeAsString());
}

}  // namespace
}  // namespace touchstone
