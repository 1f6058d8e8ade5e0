#include "server/diagnosis/answers/session_rests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

using engine::Verdict;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

report::Diagnosis Asks(const std::string& effect, const std::string& parameter) {
  report::Diagnosis one;
  one.verdict = Verdict::kMissingEffects;
  one.improved_model = touches::WithEffects(model::NominalModel(), {{effect, {parameter}}});
  one.improved_model->name = "better";
  one.steps.emplace_back().effect = effect;
  return one;
}

model::Model Own() {
  model::Model own = model::NominalModel();
  own.name = "own";
  return own;
}

TEST(SessionRests, NoiseBecomesPartOfTheSessionsModelUnderItsName) {
  model::Model own = Own();
  SessionRests rests;
  EXPECT_EQ(rests.Add(Asks("gaussian_noise", "sigma_us=5000"), 1, &own), Verdict::kMissingEffects);
  EXPECT_EQ(own.name, "own");
  EXPECT_EQ(own.effects.back().effect->name, "gaussian_noise");
  EXPECT_TRUE(rests.changed_noise());
  EXPECT_THAT(rests.unexplained(), IsEmpty());
  EXPECT_THAT(rests.asked_by_one(), IsEmpty());
}

TEST(SessionRests, AnEffectOfOneSessionAloneIsARestAndNotInItsModel) {
  model::Model own = Own();
  const size_t effects = own.effects.size();
  SessionRests rests;
  EXPECT_EQ(rests.Add(Asks("oblique_slip", "travel_mm=0.5"), 2, &own), Verdict::kUnexplained);
  EXPECT_EQ(own.effects.size(), effects);
  EXPECT_THAT(rests.unexplained(), ElementsAre(2));
  ASSERT_EQ(rests.asked_by_one().size(), 1u);
  EXPECT_EQ(rests.asked_by_one()[0].effect, "oblique_slip");
  EXPECT_THAT(rests.noise_steps(), IsEmpty());
}

TEST(SessionRests, OfOneNoiseInTwoSessionsThereIsOneStepThatOfTheLast) {
  model::Model first = Own(), second = Own();
  SessionRests rests;
  report::Diagnosis one = Asks("gaussian_noise", "sigma_us=5000");
  one.steps[0].probability = 0.7;
  rests.Add(one, 0, &first);
  one.steps[0].probability = 0.9;
  rests.Add(one, 1, &second);
  ASSERT_EQ(rests.noise_steps().size(), 1u);
  EXPECT_EQ(rests.noise_steps()[0].probability, 0.9);
}

TEST(SessionRests, WhatIsUnexplainedByItselfStaysSo) {
  model::Model own = Own();
  report::Diagnosis one;
  one.verdict = Verdict::kUnexplained;
  SessionRests rests;
  EXPECT_EQ(rests.Add(one, 0, &own), Verdict::kUnexplained);
  EXPECT_THAT(rests.unexplained(), ElementsAre(0));
  EXPECT_FALSE(rests.changed_noise());
}

}  // namespace
}  // namespace touchstone::diagnosis
