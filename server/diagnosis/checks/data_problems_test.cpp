#include "server/diagnosis/checks/data_problems.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/checks/corrupted_test_file.h"
#include "server/diagnosis/checks/rules.h"
#include "server/diagnosis/checks/sampled_set.h"

namespace touchstone::diagnosis::checks {
namespace {

using engine::ProblemKind;

struct Case {
  const char* name;
  MeasurementFix corrupt;
  ProblemKind kind;
  const char* detail;
  const char* fix;
};

std::vector<Case> Cases() {
  const auto move = [](std::vector<std::string> objects, double z_m) {
    return With([&](MeasurementFix* f) {
      for (const std::string& object : objects)
        f->move_objects_m.emplace_back(object, Eigen::Vector3d(0, 0, z_m));
    });
  };
  return {
      {"l and m", With([](auto* f) {
         f->finger_order = {1, 0, 2};
       }),
       ProblemKind::kFingerOrder, "l <-> m", "--swap-fingers l,m"},
      {"turned fingers", With([](auto* f) {
         f->finger_order = {2, 0, 1};
       }),
       ProblemKind::kFingerOrder, "l, m, r hold m, r, l", "--finger-order m,r,l"},
      {"lateral", With([](auto* f) { f->reverse_lateral = true; }), ProblemKind::kLateralReversed, "",
       "--reverse-lateral"},
      {"approach", With([](auto* f) { f->reverse_approach = true; }), ProblemKind::kApproachReversed, "",
       "--reverse-approach"},
      {"names", With([](auto* f) {
         f->rename_objects = {{"lat10", "lat20"}, {"lat20", "lat10"}};
       }),
       ProblemKind::kObjectNames, "lat10 <-> lat20", "--swap-objects lat10,lat20"},
      {"turned names", With([](auto* f) {
         f->rename_objects = {{"lat00", "lat10"}, {"lat10", "lat20"}, {"lat20", "lat00"}};
       }),
       ProblemKind::kObjectNames, "", "--rename-object"},
      {"turned frame", With([](auto* f) { f->axes = *session::ParseAxes("y,-x,z"); }), ProblemKind::kFrame,
       "x,y,z -> -y,x,z", "--permute-axes=-y,x,z"},
      {"y up", With([](auto* f) { f->axes = *session::ParseAxes("x,z,-y"); }), ProblemKind::kFrame,
       "x,y,z -> x,-z,y", "--permute-axes=x,-z,y"},
      {"mirrored", With([](auto* f) { f->axes = *session::ParseAxes("y,x,z"); }), ProblemKind::kFrame, "",
       "--permute-axes="},
      {"times in tenths", With([](auto* f) { f->scale_times = 0.1; }), ProblemKind::kUnitsTime, "times x 10",
       "--scale-times 10"},
      {"times in ms", With([](auto* f) { f->scale_times = 1e-3; }), ProblemKind::kUnitsTime, "times x 1000",
       "--scale-times 1000"},
      {"times in s", With([](auto* f) { f->scale_times = 1e-6; }), ProblemKind::kUnitsTime, "times x 1000000",
       "--scale-times 1e+06"},
      {"times in ns", With([](auto* f) { f->scale_times = 1e3; }), ProblemKind::kUnitsTime, "times x 1/1000",
       "--scale-times 0.001"},
      {"speed doubled", With([](auto* f) { f->scale_speed = 2; }), ProblemKind::kSpeedFactor, "speed x 1/2",
       "--scale-speed 0.5"},
      {"speed in mm/min", With([](auto* f) { f->scale_speed = 60; }), ProblemKind::kSpeedFactor,
       "speed x 1/60", "--scale-speed"},
      {"speed in m/s", With([](auto* f) { f->scale_speed = 1e-3; }), ProblemKind::kSpeedFactor,
       "speed x 1000", "--scale-speed 1000"},
      {"targets in m", With([](auto* f) { f->scale_targets = f->scale_standoff = 1e-3; }),
       ProblemKind::kUnitsLength, "", "--scale-"},
      {"targets in inches", With([](auto* f) { f->scale_targets = 1 / 25.4; }), ProblemKind::kUnitsLength,
       "targets x 25.4", "--scale-targets 25.4"},
      {"a row down", With([](auto* f) { f->shift_rows = 1; }), ProblemKind::kRowShift, "-1 row",
       "--shift-rows=-1"},
      {"a row up", With([](auto* f) { f->shift_rows = -1; }), ProblemKind::kRowShift, "+1 row",
       "--shift-rows=1"},
      {"20 mm lower", move({"lat00", "lat10", "lat20"}, 0.020), ProblemKind::kObjectOrigin, "z -20.0 mm",
       "--move-object lat00=0,0,-20 "},
      {"one 15 mm higher", move({"lat10"}, -0.015), ProblemKind::kObjectOrigin, "z: lat10 +1",
       "--move-object lat10=0,0,1"},
  };
}

TEST(DataProblems, EveryMistakeIsNamedBesidePhysicsThatIsMissing) {
  for (const uint64_t seed : {1, 2, 3}) {
    const DiagnosisInput right = MakeFile(Rig(seed));
    for (const Case& test : Cases()) {
      SCOPED_TRACE(testing::Message() << test.name << ", seed " << seed);
      const auto problems = ProblemsOf(Corrupted(right, test.corrupt));
      EXPECT_FALSE(problems.empty());
      if (problems.empty()) continue;
      const engine::DataProblem& problem = problems.front();
      EXPECT_EQ(problem.kind, test.kind) << problem.words;
      EXPECT_THAT(problem.detail, ::testing::HasSubstr(test.detail));
      EXPECT_THAT(problem.fix, ::testing::HasSubstr(test.fix));
      EXPECT_THAT(problem.fix, ::testing::StartsWith("touchstone session fix set.csv "));
      EXPECT_LT(problem.error_after, 0.03);
    }
  }
}

TEST(DataProblems, AMeshThatTheSetDoesNotNameIsFound) {
  DiagnosisInput input = MakeFile(Rig());
  input.surfaces["elsewhere"] = input.surfaces["lat10"];
  input.surfaces["lat10"] = touches::TestSurface("lat05");
  const auto problems = ProblemsOf(input);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].kind, ProblemKind::kWrongMesh);
  EXPECT_EQ(problems[0].detail, "lat10 is elsewhere");
  EXPECT_THAT(problems[0].fix, ::testing::HasSubstr("--rename-object lat10=elsewhere"));
}

TEST(DataProblems, AnOriginAtTheFootOfTheObjectIsFound) {
  const DiagnosisInput right = MakeFile(Rig());
  const auto problems = ProblemsOf(Corrupted(right, [&](MeasurementSet* set) {
    for (int row = 0; row < set->size(); ++row)
      set->target_m[row].z() -= right.surfaces.at(set->objects[set->object[row]])->bounds().min_m.z();
  }));
  ASSERT_FALSE(problems.empty());
  EXPECT_EQ(problems[0].kind, ProblemKind::kObjectOrigin);
  EXPECT_THAT(problems[0].fix, ::testing::HasSubstr("--move-object lat10=0,0,"));
}

TEST(DataProblems, CopiesUnderNewNumbersAreCountedAndDropped) {
  touches::HiddenRig rig = Rig();
  rig.rounds = 1;
  const DiagnosisInput right = MakeFile(rig);
  EXPECT_TRUE(ProblemsOf(right).empty());
  const auto problems = ProblemsOf(Corrupted(right, [](MeasurementSet* set) {
    const MeasurementSet once = *set;
    for (int row = 0; row < once.size(); ++row) {
      set->touch.push_back(1000 + row);
      set->object.push_back(once.object[row]);
      set->target_m.push_back(once.target_m[row]);
      set->approach.push_back(once.approach[row]);
      set->lateral.push_back(once.lateral[row]);
      set->standoff_m.push_back(once.standoff_m[row]);
      set->speed_m_s.push_back(once.speed_m_s[row]);
      set->session_time_s.push_back(5000 + once.session_time_s[row]);
      set->line.push_back(once.line[row] + once.size());
      for (int i = 0; i < 3; ++i) set->time_s.push_back(once.TimeS(row, i));
    }
  }));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].kind, ProblemKind::kDuplicates);
  EXPECT_EQ(problems[0].detail, "72 of 144 rows");
  EXPECT_THAT(problems[0].fix, ::testing::HasSubstr("--drop-duplicates"));
}

TEST(DataProblems, EqualRepeatsOfAModelWithoutNoiseOrOfCoarseTicksAreNoCopies) {
  touches::HiddenRig quiet = Rig();
  quiet.known.clear();
  quiet.hidden.clear();
  quiet.sigma_us = 1e-9;  // as of a simulation: repeats agree
  DiagnosisInput input = MakeFile(quiet);
  input.model = std::make_shared<const model::Model>(model::NominalModel());
  input = Corrupted(input, [](MeasurementSet* set) {
    for (double& time_s : set->time_s) time_s = std::round(time_s * 1e6) * 1e-6;
  });
  EXPECT_TRUE(ProblemsOf(input).empty());
  touches::HiddenRig ticks = Rig();
  ticks.known.clear();
  ticks.hidden = {{"poll_interval", {"interval_us=20000"}}};
  EXPECT_TRUE(ProblemsOf(MakeFile(ticks)).empty());
}

// The times of a share of the rows, or of all, on ticks; the others to a microsecond.
DiagnosisInput WithTicks(double tick_s, double share) {
  touches::HiddenRig rig = Rig();
  rig.rounds = 4;
  return Corrupted(MakeFile(rig), [&](MeasurementSet* set) {
    RandomStream random(3, RandomDomain::kDiagnosis, 1);
    for (int row = 0; row < set->size(); ++row) {
      const double step_s = random.Uniform() < share ? tick_s : 1e-6;
      for (int i = 0; i < 3; ++i)
        set->time_s[row * 3 + i] =
            std::round(std::round(set->time_s[row * 3 + i] / step_s) * step_s * 1e6) * 1e-6;
    }
  });
}

TEST(DataProblems, EqualRowsOnATickThatAShareOfTheTouchesHasAreNoCopies) {
  for (const double tick_s : {0.008, 0.01, 0.016, 0.02})
    for (const double share : {0.5, 0.9, 1.0})
      EXPECT_TRUE(ProblemsOf(WithTicks(tick_s, share)).empty()) << tick_s << " s in a share of " << share;
}

TEST(DataProblems, CopiesOfUntidyTimesAreTakenForCopiesBesideTicks) {
  const auto problems = ProblemsOf(Corrupted(WithTicks(0.02, 0.5), [](MeasurementSet* set) {
    for (int row = 0; row < 18; ++row)
      for (int i = 0; i < 3; ++i) {
        set->time_s[row * 3 + i] = std::round(set->time_s[row * 3 + i] * 1e6 + 137 * i * (row + 3)) * 1e-6;
        set->time_s[(row + 24) * 3 + i] = set->time_s[row * 3 + i];
      }
  }));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].kind, ProblemKind::kDuplicates);
}

TEST(DataProblems, RowsThatHoldTheTimesOfTheRowBeforeAreTold) {
  for (const double share : {0.03, 0.1, 0.25}) {
    int stale = 0;
    const auto problems = ProblemsOf(Corrupted(MakeFile(Rig()), [&](MeasurementSet* set) {
      RandomStream random(5, RandomDomain::kDiagnosis, 1);
      for (int row = 1; row < set->size(); ++row) {
        if (random.Uniform() >= share) continue;
        ++stale;
        for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] = set->time_s[(row - 1) * 3 + i];
      }
    }));
    ASSERT_EQ(problems.size(), 1u) << share;
    EXPECT_EQ(problems[0].kind, ProblemKind::kStaleRows);
    EXPECT_EQ(problems[0].detail, absl::StrCat(stale, " of 144 rows"));
    EXPECT_THAT(problems[0].fix, ::testing::HasSubstr("--drop-stale"));
    EXPECT_LT(problems[0].error_after, 0.6 * problems[0].error_before);
  }
}

// The file with every time that is later than `limit_s` after the first cut off there; of one finger, or (-1) of all.
DiagnosisInput CutOff(const DiagnosisInput& right, double limit_s, int finger) {
  return Corrupted(right, [&](MeasurementSet* set) {
    for (int row = 0; row < set->size(); ++row) {
      double* times_s = &set->time_s[row * 3];
      const double first_s = std::min({times_s[0], times_s[1], times_s[2]});
      for (int i = 0; i < 3; ++i)
        if (finger < 0 || i == finger) times_s[i] = std::min(times_s[i], first_s + limit_s);
    }
  });
}

TEST(DataProblems, TimesThatAreCutOffAtALargestOneAreTold) {
  for (const int finger : {-1, 2}) {
    const auto problems = ProblemsOf(CutOff(MakeFile(Rig()), 0.3, finger));
    ASSERT_EQ(problems.size(), 1u) << finger;
    EXPECT_EQ(problems[0].kind, ProblemKind::kSaturatedTimes);
    EXPECT_THAT(problems[0].words, ::testing::HasSubstr(finger < 0 ? "300000 us" : "of finger r"));
    EXPECT_LT(problems[0].error_after, 0.5 * problems[0].error_before);
  }
}

TEST(DataProblems, TicksMissedContactsAndRepeatsAreNotTakenForTimesThatAreCutOff) {
  EXPECT_TRUE(ProblemsOf(WithTicks(0.1, 1)).empty());
  EXPECT_TRUE(ProblemsOf(WithTicks(0.02, 1)).empty());
  EXPECT_TRUE(ProblemsOf(Corrupted(MakeFile(Rig()), [](MeasurementSet* set) {
                for (int row = 0; row < set->size(); ++row)
                  for (int i = 0; i < 3; ++i)
                    if (set->time_s[row * 3 + i] > set->time_s[row * 3 + (i + 1) % 3] + 0.3)
                      set->time_s[row * 3 + i] = NAN;
              })).empty());
}

TEST(DataProblems, OneRoundAtAnotherSpeedIsToldBesidePhysicsThatIsMissing) {
  touches::HiddenRig rig = Rig();
  rig.rounds = 4;
  rig.sigma_us = 2000;
  const DiagnosisInput right = MakeFile(rig);
  EXPECT_TRUE(FindRoundAtAnotherSpeed(right, nullptr).empty());
  const auto at_factor = [&](double factor, int round) {
    return FindRoundAtAnotherSpeed(Corrupted(right,
                                             [&](MeasurementSet* set) {
                                               for (int row = 0; row < set->size(); ++row)
                                                 if (row / 24 % 4 == round)
                                                   for (int i = 0; i < 3; ++i)
                                                     set->time_s[row * 3 + i] /= factor;
                                             }),
                                   nullptr);
  };
  for (const double factor : {0.97, 1.03, 1.2}) {
    const auto problems = at_factor(factor, 2);
    ASSERT_EQ(problems.size(), 1u) << factor;
    EXPECT_EQ(problems[0].kind, ProblemKind::kSpeedFactor);
    EXPECT_THAT(problems[0].detail, ::testing::HasSubstr("round 2 x "));
    EXPECT_THAT(problems[0].fix, ::testing::HasSubstr("--scale-speed"));
    EXPECT_LT(problems[0].error_after, problems[0].error_before) << factor;
  }
}

// The kind: a scatter that is larger at steep poses, whose contrasts are long, made a round look faster by seven standard errors.
TEST(DataProblems, AnArmOfAnotherSpeedAtEveryTouchIsNoRoundAtAnotherSpeed) {
  touches::HiddenRig rig = Rig();
  rig.rounds = 4;
  rig.sigma_us = 2000;
  const DiagnosisInput right = MakeFile(rig);
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const auto problems = FindRoundAtAnotherSpeed(Corrupted(right,
                                                            [&](MeasurementSet* set) {
                                                              RandomStream random(seed, RandomDomain::kTest);
                                                              for (int row = 0; row < set->size(); ++row) {
                                                                const double factor =
                                                                    1 + 0.06 * random.Normal();
                                                                for (int i = 0; i < 3; ++i)
                                                                  set->time_s[row * 3 + i] *= factor;
                                                              }
                                                            }),
                                                  nullptr);
    EXPECT_TRUE(problems.empty()) << seed << ": " << problems[0].detail;
  }
}

TEST(DataProblems, AColumnThatWasSortedAloneIsTold) {
  const auto problems = ProblemsOf(Corrupted(MakeFile(Rig()), [](MeasurementSet* set) {
    std::vector<double> column;
    for (int row = 0; row < set->size(); ++row) column.push_back(set->TimeS(row, 1));
    std::sort(column.begin(), column.end());
    for (int row = 0; row < set->size(); ++row) set->time_s[row * 3 + 1] = column[row];
  }));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_EQ(problems[0].detail, "t_m_us is sorted");
  EXPECT_TRUE(problems[0].fix.empty());
}

TEST(DataProblems, StrongPhysicsIsNoMistake) {
  TOUCHSTONE_SECOND_TIER("statistical: every effect, several strengths");
  const std::vector<std::vector<std::pair<std::string, std::vector<std::string>>>> rigs = {
      {},
      {{"tip_radius", {"radius_mm=5"}}},
      {{"oblique_slip", {"travel_mm=3"}}},
      {{"object_push", {"shift_mm=5"}}},
      {{"contact_slowdown", {"fraction=0.3"}}},
      {{"contact_slowdown", {"fraction=0.45"}}},
      {{"contact_slowdown", {"fraction=0.6"}}},
      {{"speed_error", {"relative=0.4"}}},
      {{"speed_error", {"relative=-0.45"}}},
      {{"clock_skew", {"relative=0.1"}}},
      {{"finger_length", {"offset_mm=3,-1,-2"}}},
      {{"channel_latency", {"latency_us=50000,-20000,-30000"}}},
      {{"tool_yaw", {"angle_deg=10"}}},
      {{"tool_tilt", {"angle_deg=5"}}},
      {{"finger_spacing", {"delta_mm=6"}}},
      {{"gravity_sag", {"drop_mm=6"}}},
      {{"object_scale", {"relative=0.1"}}},
      {{"object_pose", {"translation_mm=6,-5,4", "rotation_deg=3,-2,8"}}},
      {{"object_pose", {"rotation_deg=0,0,30"}}},
      {{"return_hysteresis", {"fraction=0.6"}}},
      {{"thermal_drift", {"rate_mm_per_h=2,-1,-1"}}},
      {{"surface_error", {"rms_mm=1", "length_mm=20"}}},
      {{"missed_contact", {"probability=0.3"}}, {"heavy_tail_noise", {"degrees_of_freedom=1.5"}}},
      {{"tip_radius", {"radius_mm=3"}},
       {"contact_slowdown", {"fraction=0.4"}},
       {"tool_yaw", {"angle_deg=5"}}},
  };
  for (size_t r = 0; r < rigs.size(); ++r)
    for (uint64_t seed = 1; seed <= 6; ++seed) {
      touches::HiddenRig rig = Rig(10 * seed + r);
      rig.known.clear();
      rig.hidden = rigs[r];
      rig.objects = {"lat00", "lat05", "lat10", "lat15", "lat20"};
      if (seed % 2 == 0) rig.samples_per_face = 1, rig.rounds = 1;  // 30 touches
      const auto problems = ProblemsOf(MakeFile(rig));
      EXPECT_TRUE(problems.empty()) << (rigs[r].empty() ? "nothing" : rigs[r][0].first) << ", seed " << seed
                                    << ": " << static_cast<int>(problems[0].kind) << ", "
                                    << problems[0].words;
    }
}

TEST(DataProblems, TooFewTouchesBlameNoFile) {
  DiagnosisInput input = MakeFile(Rig());
  input = Corrupted(input, [](MeasurementSet* set) {
    *set = *PartOf(*set, {0, 10, 20, 30, 40, 50}, 0);
    for (Eigen::Vector3d& lateral : set->lateral) lateral = -lateral;
  });
  EXPECT_TRUE(ProblemsOf(input).empty());
}

TEST(SampleRows, TakesEveryObjectItsPosesAndTheWholeSession) {
  touches::HiddenRig rig = Rig();
  rig.samples_per_face = 20;
  rig.rounds = 3;
  const DiagnosisInput input = MakeFile(rig);
  const auto o = touches::MakeObservations(input);
  ASSERT_TRUE(o.ok());
  const std::vector<int> rows = SampleRows(*o);
  EXPECT_NEAR(rows.size(), kCheckRules.sampled_touches, 3);
  EXPECT_EQ(rows, SampleRows(*o));
  std::vector<int> of_object(3);
  for (const int row : rows) ++of_object[input.set->object[row]];
  for (const int count : of_object) EXPECT_NEAR(count, kCheckRules.sampled_touches / 3, 1);
  EXPECT_LT(rows.front(), 30);
  EXPECT_GT(rows.back(), input.set->size() - 30);
}

}  // namespace
}  // namespace touchstone::diagnosis::checks
