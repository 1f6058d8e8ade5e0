// Model files with the real catalogue: what a person writes, and what random models survive.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::effects {
namespace {

using testing::HasSubstr;

// A value within bounds: often round, as people write, and often of full precision, as fits end.
double RandomSi(const model::ParameterInfo& p, RandomStream* random) {
  const double lower = std::max(p.lower, p.neutral - 10 * p.typical);
  const double upper = std::min(p.upper, p.neutral + 10 * p.typical);
  if (random->Below(4) == 0) return ToSi(p.unit, p.neutral);
  const double value = random->Uniform(lower, upper);
  const double grid = p.typical / 100;
  const double rounded = std::round(value / grid) * grid;
  return ToSi(p.unit, random->Below(2) == 0 ? std::min(std::max(rounded, lower), upper) : value);
}

std::vector<double> RandomValues(const model::Effect& effect, int fingers, RandomStream* random) {
  std::vector<double> values;
  for (const model::ParameterInfo& p : effect.parameters) {
    const int count = p.Count(fingers);
    for (int i = 0; i < count; ++i) values.push_back(p.sum_zero ? 0.0 : RandomSi(p, random));
    // Pairs of opposite values sum to 0 exactly.
    if (p.sum_zero && count > 1) {
      const double value = 0.1 * RandomSi(p, random);
      values[values.size() - 1] = value;
      values[values.size() - 2] = -value;
    }
  }
  return values;
}

std::shared_ptr<const model::Effect> RandomLookup(int fingers, RandomStream* random) {
  model::LookupSpec spec;
  spec.name = "warm_up";
  spec.adds_time = random->Below(2) == 0;
  if (spec.adds_time) spec.stage = model::Stage::kSensor;
  spec.covariate = "session_time_s";
  for (double knot = random->Uniform(-1, 1); spec.knots.size() < 5; knot += random->Uniform(0.1, 100))
    spec.knots.push_back(knot);
  spec.values.resize(random->Below(2) == 0 ? 1 : fingers);
  for (std::vector<double>& values : spec.values)
    for (size_t n = 0; n < spec.knots.size(); ++n) values.push_back(random->Uniform(-1, 1));
  return *Catalogue().MakeLookup(spec);
}

model::Model RandomModel(uint64_t seed) {
  RandomStream random(seed, RandomDomain::kTest);
  model::Model model;
  const char* names[] = {"nominal", "a b: c", "\"quoted\" \\ back", "null", "3", "t\xc3\xa4st #1", "- x"};
  model.name = names[random.Below(7)];
  model.fingers = 1 + static_cast<int>(random.Below(16));
  model.spacing_m = random.Uniform(0.005, 0.05);
  for (const auto& effect : Catalogue().All()) {
    if (random.Below(2) == 0) continue;
    model::EffectInstance instance;
    instance.effect = effect;
    if (effect->name == "formula") {
      model::FormulaSpec spec;
      spec.name = "lead_screw";
      spec.expression = "k * sin(2*pi*travel_mm/lead)";
      for (const char* name : {"k", "lead"}) {
        model::ParameterInfo p;
        p.name = name;
        p.unit = random.Below(2) == 0 ? Unit::kMillimetre : Unit::kNone;
        p.lower = random.Uniform(-3, -1);
        p.upper = random.Uniform(1, 3);
        spec.parameters.push_back(p);
        spec.values.push_back(random.Uniform(-1, 1));
      }
      spec.adds_time = random.Below(2) == 0;
      spec.stage = spec.adds_time         ? model::Stage::kSensor
                   : random.Below(2) == 0 ? model::Stage::kMotion
                                          : model::Stage::kContact;
      instance.effect = *Catalogue().MakeFormula(spec);
      instance.values = instance.effect->NeutralValues(model.fingers);
    } else if (effect->name == "lookup") {
      instance.effect = RandomLookup(model.fingers, &random);
    } else if (effect->name == "surface_map") {
      instance.effect = *Catalogue().MakeSurfaceMap(
          {"map.csv", {{"obj 1", {20, 0.1, {{{random.Uniform(-9, 9), 2, 3}, random.Uniform(-1, 1), 0.1}}}}}});
    } else {
      instance.values = RandomValues(*effect, model.fingers, &random);
    }
    instance.per_object = !instance.effect->lookup && !instance.effect->surface_map &&
                          (effect->always_per_object || random.Below(3) == 0);
    if (instance.per_object)
      for (uint64_t i = random.Below(3); i > 0; --i)
        instance.object_values[absl::StrCat("obj ", i)] =
            instance.effect->formula ? instance.values : RandomValues(*effect, model.fingers, &random);
    model.effects.push_back(std::move(instance));
  }
  return model;
}

TEST(ModelFile, ReadsBackWhatItWroteToTheSameHash) {
  for (uint64_t seed = 0; seed < 300; ++seed) {
    const model::Model model = RandomModel(seed);
    const std::string text = model::FormatModel(model);
    const absl::StatusOr<model::Model> read = model::ParseModel(text, "model.yaml", Catalogue());
    ASSERT_TRUE(read.ok()) << read.status() << "\n" << text;
    EXPECT_EQ(read->Hash(), model.Hash()) << text;
    EXPECT_EQ(read->name, model.name);
    EXPECT_EQ(model::FormatModel(*read), text);
    EXPECT_TRUE(model::DiffModels(model, *read).empty());
  }
}

TEST(ModelFile, ReadsTheExampleOfTheDesign) {
  const absl::StatusOr<model::Model> model = model::ParseModel(R"yaml(
touchstone: model/1
name: nominal
end_effector: {fingers: 3, spacing_mm: 30}
effects:
  - gaussian_noise: {sigma_us: 5000}
  - formula:
      name: lead_screw
      adds: travel_mm                  # or time_us
      expression: "k * sin(2*pi*travel_mm/lead)"
      parameters: {k: {value: 0, unit: mm, min: -1, max: 1}, lead: {value: 4, unit: mm, min: 2, max: 10}}
)yaml",
                                                               "example.yaml", Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->fingers, 3);
  EXPECT_DOUBLE_EQ(model->spacing_m, 0.03);
  ASSERT_EQ(model->effects.size(), 2u);
  EXPECT_THAT(model->effects[0].values, testing::ElementsAre(0.005));
  EXPECT_EQ(model->effects[1].effect->formula->name, "lead_screw");
  EXPECT_EQ(model::FormatModel(*model), R"yaml(touchstone: model/1
name: nominal
end_effector: {fingers: 3, spacing_mm: 30}
effects:
  - gaussian_noise: {sigma_us: 5000}
  - formula:
      name: lead_screw
      adds: travel_mm
      expression: "k * sin(2*pi*travel_mm/lead)"
      parameters:
        k: {value: 0, unit: mm, min: -1, max: 1}
        lead: {value: 4, unit: mm, min: 2, max: 10}
)yaml");
}

TEST(ModelFile, GivesSingleObjectsTheirOwnValues) {
  const absl::StatusOr<model::Model> model = model::ParseModel(R"yaml(
touchstone: model/1
name: placed
effects:
  - object_pose: {scope: object, translation_mm: [0, 0, 1], objects: {lat00: {translation_mm: [1, 0, 0]}, lat20: {rotation_deg: [0, 0, 2]}}}
)yaml",
                                                               "placed.yaml", Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  const model::EffectInstance& pose = model->effects[0];
  EXPECT_TRUE(pose.per_object);
  EXPECT_THAT(pose.ValuesFor("lat00"), testing::ElementsAre(0.001, 0, 0, 0, 0, 0));
  EXPECT_THAT(pose.ValuesFor("lat05"), testing::ElementsAre(0, 0, 0.001, 0, 0, 0));
  EXPECT_THAT(pose.ValuesFor("lat20"),
              testing::ElementsAre(0, 0, 0.001, 0, 0, testing::DoubleNear(0.0349066, 1e-6)));
}

TEST(ModelFile, HoldsAnyEffectOnOneObjectOnly) {
  for (const auto& effect : Catalogue().All()) {
    if (effect->parameters.empty()) continue;
    model::Model model = model::NominalModel();
    model::EffectInstance instance{effect, true, effect->NeutralValues(model.fingers), {}};
    std::vector<double> values = instance.values;
    for (size_t p = 0, at = 0; p < effect->parameters.size();
         at += effect->parameters[p++].Count(model.fingers)) {
      const model::ParameterInfo& parameter = effect->parameters[p];
      values[at] =
          ToSi(parameter.unit, parameter.neutral == parameter.upper ? parameter.typical
                                                                    : parameter.neutral + parameter.typical);
      if (parameter.sum_zero) values[at + 1] = -values[at];
    }
    instance.object_values["lat10"] = values;
    model.effects = {instance};
    const absl::StatusOr<model::Model> again =
        model::ParseModel(model::FormatModel(model), "one object", Catalogue());
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->Hash(), model.Hash()) << effect->name;
    EXPECT_EQ(again->effects[0].ValuesFor("lat00")[0], instance.values[0]) << effect->name;
    EXPECT_NE(again->effects[0].ValuesFor("lat10")[0], instance.values[0]) << effect->name;
  }
}

TEST(AddEffect, BuildsFormulasFromTheCommandLine) {
  const absl::StatusOr<model::Model> model = model::AddEffect(
      model::NominalModel(), "formula",
      {"name=drag", "adds=time_us", "expression=k * speed_mm_s", "k=3", "k_unit=us", "k_min=0", "k_max=10"},
      Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  const model::Effect& effect = *model->effects[0].effect;
  EXPECT_EQ(effect.stage, model::Stage::kSensor);
  EXPECT_EQ(effect.parameters[0].unit, Unit::kMicrosecond);
  EXPECT_THAT(model->effects[0].values, testing::ElementsAre(testing::DoubleEq(3e-6)));
  const auto missing = model::AddEffect(model::NominalModel(), "formula",
                                        {"name=drag", "adds=time_us", "expression=k", "k=3"}, Catalogue());
  EXPECT_THAT(std::string(missing.status().message()), HasSubstr("parameter k: 'unit' is missing"));
}

}  // namespace
}  // namespace touchstone::effects
