#include "server/effects/formula/lookup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/effects/all_effects.h"
#include "server/effects/effect_test_batch.h"
#include "server/model/model.h"

namespace touchstone::effects {
namespace {

model::LookupSpec WarmUp() {
  return {{"warm_up", true, model::Stage::kSensor},
          "session_time_s",
          {0, 300, 900},
          {{0, 3000, 6000}, {0, 0, 0}, {0, -3000, -6000}}};
}

TEST(Lookup, IsLinearBetweenKnotsAndConstantBeyond) {
  const model::LookupSpec spec = WarmUp();
  EXPECT_DOUBLE_EQ(LookupValue(spec, 0, -5), 0);
  EXPECT_DOUBLE_EQ(LookupValue(spec, 0, 150), 1500);
  EXPECT_DOUBLE_EQ(LookupValue(spec, 2, 600), -4500);
  EXPECT_DOUBLE_EQ(LookupValue(spec, 0, 1e6), 6000);
}

TEST(Lookup, AddsTimeAndTravelByFinger) {
  TouchBatch before = TestBatch(3, 3);
  before.session_time_s = {0, 300, 5000};
  TouchBatch after = before;
  (*MakeLookupEffect(WarmUp()))->apply({}, after);
  EXPECT_NEAR(after.reported_time_s[after.At(0, 1)] - before.reported_time_s[after.At(0, 1)], 3e-3, 1e-12);
  EXPECT_NEAR(after.reported_time_s[after.At(2, 2)] - before.reported_time_s[after.At(2, 2)], -6e-3, 1e-12);
  model::LookupSpec travel = {{"wave", false, model::Stage::kMotion}, "incidence_deg", {0, 90}, {{1, 1}}};
  after = before;
  (*MakeLookupEffect(travel))->apply({}, after);
  for (size_t e = 0; e < before.travel_m.size(); ++e)
    EXPECT_NEAR(after.travel_m[e] - before.travel_m[e], 1e-3, 1e-12);
}

TEST(Lookup, NamesWhatIsWrongWithIt) {
  const auto error = [](void (*spoil)(model::LookupSpec*)) {
    model::LookupSpec spec = WarmUp();
    spoil(&spec);
    return std::string(MakeLookupEffect(spec).status().message());
  };
  EXPECT_THAT(error([](auto* s) { s->knots[1] = 900; }), testing::HasSubstr("knots must rise; knot 3"));
  EXPECT_THAT(error([](auto* s) { s->values[1].pop_back(); }), testing::HasSubstr("3 knots and 2 values"));
  EXPECT_THAT(error([](auto* s) { s->covariate = "session_tim_s"; }), testing::HasSubstr("session_time_s"));
  EXPECT_THAT(error([](auto* s) { s->stage = model::Stage::kPose; }),
              testing::HasSubstr("sensor stage only"));
  TouchBatch four = TestBatch(2, 4);
  (*MakeLookupEffect(WarmUp()))->apply({}, four);
  EXPECT_THAT(four.formula_error, testing::HasSubstr("3 fingers and the rig 4"));
}

TEST(Lookup, ReadsBackFromTheModelFileItWrites) {
  const std::string yaml =
      "touchstone: model/1\nname: warm\neffects:\n  - lookup:\n      name: warm_up\n      adds: time_us\n"
      "      covariate: session_time_s\n      knots: [0, 300, 900]\n"
      "      values: {l: [0, 3000, 6000], m: [0, 0, 0], r: [0, -3000, -6000]}\n"
      "  - lookup: {name: wave, adds: travel_mm, covariate: incidence_deg, knots: [0, 40], values: [0, "
      "0.1]}\n";
  const auto model = model::ParseModel(yaml, "m.yaml", Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  const auto again = model::ParseModel(model::FormatModel(*model), "again.yaml", Catalogue());
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->Hash(), model->Hash());
  EXPECT_EQ(model::FormatModel(*again), model::FormatModel(*model));
  std::string other = yaml;
  other.replace(other.find("6000"), 4, "6001");
  const auto changed = model::ParseModel(other, "m.yaml", Catalogue());
  EXPECT_NE(changed->Hash(), model->Hash());
  EXPECT_THAT(model::DiffModels(*model, *changed),
              testing::ElementsAre(testing::HasSubstr("values changed")));
}

TEST(Lookup, ErrorsOfTheModelFileNameTheField) {
  const auto error = [](const std::string& body) {
    return std::string(
        model::ParseModel("touchstone: model/1\nname: x\neffects:\n  - lookup: {" + body + "}\n", "m.yaml",
                          Catalogue())
            .status()
            .message());
  };
  EXPECT_THAT(error("name: a, adds: time_us, knots: [0, 1], values: [0, 1]"),
              testing::HasSubstr("'covariate'"));
  EXPECT_THAT(
      error("name: a, adds: time_us, covariate: finger, knots: [0, 1], values: {l: [0, 1], m: [0, 1]}"),
      testing::HasSubstr("values of finger r are missing"));
  EXPECT_THAT(error("name: a, adds: time_us, covariate: finger, knots: 3, values: [0, 1]"),
              testing::HasSubstr("lookup.knots"));
}

TEST(Lookup, IsAddedFromTheCommandLine) {
  const auto model = model::AddEffect(model::NominalModel(), "lookup",
                                      {"name=warm_up", "adds=travel_mm", "covariate=session_time_s",
                                       "knots=0,600", "l=0,0.3", "m=0,0", "r=0,-0.3"},
                                      Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->effects[0].effect->lookup->values[2][1], -0.3);
}

}  // namespace
}  // namespace touchstone::effects
