#include "server/diagnosis/joint/session_changes.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/diagnosis/engine/row_modality.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::joint {
namespace {

constexpr double kNoise = 0.002;
constexpr double kSessionPerMetre = 50;
constexpr uint64_t kColumnSeed = 1u << 30;  // none of the noise's
constexpr int kGroups = 3, kBlocks = 20, kRepeats = 2;
// Of a column of 120 rows with standard deviation kSessionPerMetre.
const double kStdErrorM = kNoise / kSessionPerMetre / std::sqrt(kGroups * kBlocks * kRepeats);

const char* const kEffects[] = {"object_push", "oblique_slip", "tip_radius", "finger_length"};

// What a session is made with: by effect, its first value, SI.
using Truth = std::map<std::string, double>;

std::unique_ptr<engine::RowModality> Session(const Truth& truth, uint64_t seed,
                                             const std::vector<std::string>& given = {}) {
  auto rows = std::make_shared<engine::LinearTestModel>(kGroups, kBlocks, kRepeats);
  uint64_t column = 0;
  for (const char* effect : kEffects)
    rows->columns[effect] = rows->Random(kColumnSeed + ++column, kSessionPerMetre);
  rows->measured = rows->Random(seed, kNoise);
  for (const auto& [effect, value] : truth) rows->measured += value * rows->columns.at(effect);
  engine::RowModality::Description description;
  description.name = "rows";
  description.given = model::NominalModel();
  for (const char* effect : kEffects) {
    const auto found = effects::Catalogue().Find(effect);
    if (std::find(given.begin(), given.end(), effect) == given.end()) {
      description.candidates.push_back({found, false});
      continue;
    }
    description.given.effects.push_back({found, false, found->NeutralValues(3), {}});
  }
  description.rows = rows;
  description.noise = kNoise;
  description.sees = [](const model::Effect& effect) {
    return std::find(std::begin(kEffects), std::end(kEffects), effect.name) != std::end(kEffects);
  };
  auto made = engine::RowModality::Make(std::move(description));
  EXPECT_TRUE(made.ok()) << made.status();
  return *std::move(made);
}

SessionChanges Find(const std::vector<Truth>& truths, uint64_t seed,
                    const std::vector<std::string>& given = {}) {
  std::vector<std::unique_ptr<engine::RowModality>> sessions;
  std::vector<const engine::Modality*> all;
  for (size_t s = 0; s < truths.size(); ++s) {
    sessions.push_back(Session(truths[s], 100 * seed + s, given));
    all.push_back(sessions.back().get());
  }
  auto found = FindSessionChanges(all, {}, nullptr);
  EXPECT_TRUE(found.ok()) << found.status();
  return *std::move(found);
}

const ComparedEffect* Named(const SessionChanges& changes, const std::string& effect) {
  for (const ComparedEffect& compared : changes.effects)
    if (compared.effect == effect) return &compared;
  return nullptr;
}

TEST(SessionChanges, AnEffectOfBothSessionsIsOneStepAndOneValue) {
  const SessionChanges found = Find({{{"object_push", 0.8e-3}}, {{"object_push", 0.8e-3}}}, 1);
  ASSERT_EQ(found.steps.size(), 1u);
  EXPECT_EQ(found.steps[0].effect, "object_push");
  EXPECT_FALSE(found.changed());
  const ComparedEffect* compared = Named(found, "object_push");
  ASSERT_NE(compared, nullptr);
  EXPECT_EQ(compared->values, SessionValues::kShared);
  EXPECT_EQ(compared->entries[0].change, ValueChange::kUnchanged);
  EXPECT_EQ(found.models[0].Hash(), found.models[1].Hash());
}

TEST(SessionChanges, NothingIsSaidToHaveChangedWhereNothingDid) {
  int changed = 0;
  for (uint64_t seed = 1; seed <= 200; ++seed)
    changed += Find({{{"object_push", 0.8e-3}}, {{"object_push", 0.8e-3}}}, seed,
                    {"object_push", "oblique_slip", "finger_length"})
                   .changed();
  EXPECT_LE(changed, 2);
}

TEST(SessionChanges, AChangeOfTenStandardErrorsIsFoundAndNamed) {
  const double from = 0.8e-3, to = from + 10 * std::sqrt(2.0) * kStdErrorM;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    const SessionChanges found = Find({{{"object_push", from}}, {{"object_push", to}}}, seed);
    const ComparedEffect* compared = Named(found, "object_push");
    ASSERT_NE(compared, nullptr) << seed;
    EXPECT_EQ(compared->values, SessionValues::kOwn) << seed;
    const ComparedValue& value = compared->entries[0];
    EXPECT_EQ(value.change, ValueChange::kChanged);
    EXPECT_NEAR(value.difference, (to - from) * 1e3, 4 * std::sqrt(2.0) * kStdErrorM * 1e3) << seed;
    EXPECT_TRUE(compared->equivalent.empty());
  }
}

// All that is said of a value of three sessions agrees: what is unchanged neither scatters nor has a session outside, and
// what changed is said to have changed in the session in which it did.
TEST(SessionChanges, WhatIsSaidOfAValueOfThreeSessionsIsOneVerdict) {
  const double low = 0.8e-3, high = low + 20 * kStdErrorM;
  const std::vector<std::pair<std::vector<double>, std::vector<std::vector<int>>>> truths = {
      {{low, low, low}, {}},
      {{low, low, high}, {{0, 1}, {2}}},
      {{low, high, high}, {{0}, {1, 2}}},
      {{low, high, low}, {{0}, {1}, {2}}}};
  for (const auto& [values, runs] : truths)
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      std::vector<Truth> sessions;
      for (const double value : values) sessions.push_back({{"object_push", value}});
      const SessionChanges found = Find(sessions, seed);
      const ComparedEffect* compared = Named(found, "object_push");
      ASSERT_NE(compared, nullptr);
      const ComparedValue& value = compared->entries[0];
      EXPECT_EQ(value.change, runs.empty() ? ValueChange::kUnchanged : ValueChange::kChanged);
      EXPECT_EQ(value.scatter > 0, !runs.empty()) << seed;
      std::vector<std::vector<int>> told;
      for (const SessionRun& run : value.runs) told.push_back(run.sessions);
      EXPECT_EQ(told, runs) << seed;
    }
}

// Many sessions without a verdict of a change: one of them outside its limits is not called unchanged.
TEST(SessionChanges, AValueWithASessionOutsideItsLimitsIsNotCalledUnchanged) {
  ComparedValue value;
  for (int session = 0; session < 6; ++session) {
    engine::ParameterEstimate estimate;
    estimate.value = session == 4 ? 1.5 : 1;
    estimate.std_error = 0.1;
    value.by_session.emplace_back(estimate);
  }
  SetVerdict(/*apart=*/false, /*steady=*/true, &value);
  EXPECT_TRUE(value.limits[4]->outside);
  EXPECT_EQ(value.change, ValueChange::kCannotSay);
  value.by_session[4]->value = 1.1;
  SetVerdict(/*apart=*/false, /*steady=*/true, &value);
  EXPECT_FALSE(value.limits[4]->outside);
  EXPECT_EQ(value.change, ValueChange::kUnchanged);
}

TEST(SessionChanges, AnEffectThatCameBetweenIsAbsentBefore) {
  const SessionChanges found = Find({{}, {{"oblique_slip", 0.5e-3}}, {{"oblique_slip", 0.5e-3}}}, 1);
  const ComparedEffect* compared = Named(found, "oblique_slip");
  ASSERT_NE(compared, nullptr);
  EXPECT_EQ(compared->values, SessionValues::kOwn);
  EXPECT_EQ(compared->entries[0].from, 0);
  EXPECT_LT(compared->entries[0].by_session[0]->value, 4 * kStdErrorM * 1e3);
  EXPECT_NE(found.models[0].Hash(), found.models[1].Hash());
}

// The change is one of the two, whichever was tied first in the search.
TEST(SessionChanges, TheEffectThatChangedIsTheOneThatIsNamed) {
  for (const char* effect : {"object_push", "finger_length"}) {
    Truth before = {{"object_push", 0.8e-3}, {"finger_length", 0.5e-3}}, after = before;
    after[effect] += 0.1e-3;
    const SessionChanges found = Find({before, after}, 7);
    for (const ComparedEffect& compared : found.effects)
      EXPECT_EQ(compared.values == SessionValues::kOwn, compared.effect == effect) << compared.effect;
  }
}

TEST(SessionChanges, AValueOfTheGivenModelThatBothSessionsWantOtherwiseIsRefitted) {
  const SessionChanges found =
      Find({{{"finger_length", 0.5e-3}}, {{"finger_length", 0.5e-3}}}, 3, {"finger_length"});
  EXPECT_TRUE(found.steps.empty());
  ASSERT_EQ(found.refitted.size(), 1u);
  EXPECT_EQ(found.refitted[0].effect, "finger_length");
  EXPECT_FALSE(found.changed());
}

TEST(SessionChanges, NothingMissingAndNothingChangedLeavesTheGivenModel) {
  const SessionChanges found = Find({{}, {}}, 5, {"object_push"});
  EXPECT_FALSE(found.moved());
  for (const model::Model& model : found.models)
    EXPECT_EQ(model.Hash(), Session({}, 1, {"object_push"})->given().Hash());
}

}  // namespace
}  // namespace touchstone::diagnosis::joint
