// What holds for every effect of the catalogue, whatever its physics. A new effect is tested as soon as it is listed.
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "server/effects/all_effects.h"
#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

// The fields that effects of a stage may change.
std::set<std::string> FieldsOf(model::Stage stage) {
  switch (stage) {
    case model::Stage::kPose:
      return {"lateral",       "spacing_m",        "travel_offset_m",      "tip_displacement_m",
              "surface_scale", "surface_rotation", "surface_translation_m"};
    case model::Stage::kContact:
      return {"tip_radius_m", "travel_m", "contact_m"};
    case model::Stage::kMotion:
      return {"travel_m", "speed_factor", "acceleration_m_s2", "slowdown_fraction"};
    case model::Stage::kSensor:
      return {"reported_time_s",    "noise_sigma_s", "noise_growth",    "any_noise",
              "degrees_of_freedom", "clock_factor",  "poll_interval_s", "missed_probability",
              "wander_sigma_s",     "wander_time_s"};
    default:
      break;  // a photograph's: photo_effects_contract_test.cpp
  }
  return {};
}

// One step of the typical size away from neutral, kept within bounds and with zero sum where that is asked
// for.
FileValues TypicalValues(const model::Effect& effect, int fingers, double steps) {
  FileValues values;
  for (const model::ParameterInfo& p : effect.parameters) {
    std::vector<double> own;
    const int count = p.Count(fingers);
    for (int i = 0; i < count; ++i) {
      // A parameter whose neutral value is its upper bound stands for "none"; its typical value is a size.
      double value = p.neutral == p.upper ? p.typical : p.neutral + steps * p.typical;
      if (p.arity == model::Arity::kPerFinger) value = steps * p.typical * (i - 0.5 * (count - 1)) / count;
      own.push_back(std::min(std::max(value, p.lower), p.upper));
    }
    values.emplace_back(p.name, own);
  }
  return values;
}

class EffectContract : public testing::TestWithParam<std::shared_ptr<const model::Effect>> {
 protected:
  const model::Effect& effect() const { return *GetParam(); }
  bool describes_only() const {
    return effect().name == "formula" || effect().name == "lookup" || effect().name == "surface_map";
  }
};

TEST_P(EffectContract, HasTextsForPeople) {
  for (const std::string& text :
       {effect().meaning, effect().signature, effect().check_on_rig, effect().remedy}) {
    EXPECT_GE(text.size(), 30u);
    EXPECT_TRUE(absl::EndsWith(text, ".") || absl::EndsWith(text, "?")) << text;
  }
  for (const model::ParameterInfo& parameter : effect().parameters) EXPECT_GE(parameter.meaning.size(), 10u);
}

TEST_P(EffectContract, NamesEndInTheirUnit) {
  for (const model::ParameterInfo& p : effect().parameters) {
    EXPECT_TRUE(absl::EndsWith(p.name, std::string(UnitSuffix(p.unit)))) << p.name;
    if (p.unit != Unit::kNone) continue;
    for (const char* suffix : {"_mm", "_deg", "_us", "_s", "_mm_s", "_mm_s2", "_mm_per_h", "_per_m"})
      EXPECT_FALSE(absl::EndsWith(p.name, suffix)) << p.name << " has no unit";
  }
}

TEST_P(EffectContract, HasOrderedBoundsAroundItsNeutralValue) {
  for (const model::ParameterInfo& p : effect().parameters) {
    EXPECT_LT(p.lower, p.upper) << p.name;
    EXPECT_GE(p.neutral, p.lower) << p.name;
    EXPECT_LE(p.neutral, p.upper) << p.name;
    EXPECT_GT(p.typical, 0) << p.name;
    EXPECT_LE(p.typical, p.upper - p.lower) << p.name;
    if (p.sum_zero) {
      EXPECT_EQ(p.arity, model::Arity::kPerFinger) << p.name;
    }
  }
}

TEST_P(EffectContract, ChangesNothingWithNeutralValues) {
  for (const int fingers : {1, 3, 16}) {
    const TouchBatch before = TestBatch(20, fingers, 7, /*all_hit=*/false);
    TouchBatch after = before;
    effect().apply(effect().NeutralValues(fingers), after);
    EXPECT_THAT(ChangedFields(before, after), testing::IsEmpty()) << fingers << " fingers";
  }
}

TEST_P(EffectContract, ChangesItsOwnStageOnly) {
  if (describes_only()) GTEST_SKIP() << "the catalogue's entry does nothing; its own test has real ones";
  const TouchBatch before = TestBatch(20, 3, 7);
  TouchBatch after = before;
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &after);
  const std::vector<std::string> changed = ChangedFields(before, after);
  EXPECT_FALSE(changed.empty());
  for (const std::string& field : changed) EXPECT_EQ(FieldsOf(effect().stage).count(field), 1u) << field;
}

TEST_P(EffectContract, GivesTheSameForTheSameSeed) {
  TouchBatch once = TestBatch(20, 3, 7);
  TouchBatch again = once;
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &once);
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &again);
  EXPECT_THAT(ChangedFields(once, again), testing::IsEmpty());
}

TEST_P(EffectContract, HangsOnTheTouchAndNotOnItsPlaceInTheBatch) {
  TouchBatch whole = TestBatch(21, 3, 7);
  TouchBatch part = TestBatch(8, 3, 7);  // the same first touches
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &whole);
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &part);
  for (int touch = 0; touch < part.size(); ++touch) {
    EXPECT_EQ(whole.lateral[touch], part.lateral[touch]);
    for (int finger = 0; finger < 3; ++finger) {
      const int a = whole.At(finger, touch);
      const int b = part.At(finger, touch);
      EXPECT_EQ(whole.travel_offset_m[a], part.travel_offset_m[b]);
      EXPECT_EQ(whole.travel_m[a], part.travel_m[b]);
      EXPECT_EQ(whole.contact_m[a], part.contact_m[b]);
      EXPECT_EQ(whole.reported_time_s[a], part.reported_time_s[b]);
      EXPECT_EQ(whole.noise_sigma_s[a], part.noise_sigma_s[b]);
      if (!part.noise_growth.empty()) {
        EXPECT_EQ(whole.noise_growth[a], part.noise_growth[b]);
      }
    }
  }
}

TEST_P(EffectContract, StaysFiniteOverItsBoundsAndKeepsMisses) {
  for (const double steps : {-1e9, 1e9}) {
    for (const int fingers : {1, 2, 16}) {
      const TouchBatch before = TestBatch(20, fingers, 7, /*all_hit=*/false);
      TouchBatch after = before;
      ApplyEffect(effect(), TypicalValues(effect(), fingers, steps), &after);
      for (size_t i = 0; i < before.travel_m.size(); ++i) {
        EXPECT_TRUE(std::isfinite(after.travel_offset_m[i]));
        EXPECT_EQ(std::isfinite(after.travel_m[i]), std::isfinite(before.travel_m[i]));
        EXPECT_EQ(std::isfinite(after.reported_time_s[i]), std::isfinite(before.reported_time_s[i]));
        EXPECT_GE(after.noise_sigma_s[i], 0);
        if (!after.noise_growth.empty()) {
          EXPECT_GE(after.noise_growth[i], 1);
        }
      }
      EXPECT_GT(after.surface_scale, 0);
      EXPECT_GT(after.speed_factor, 0);
      EXPECT_GT(after.clock_factor, 0);
      EXPECT_NEAR(after.surface_rotation.determinant(), 1, 1e-9);
      EXPECT_THAT(after.slowdown_fraction, testing::AllOf(testing::Ge(0), testing::Lt(1)));
      EXPECT_THAT(after.missed_probability, testing::AllOf(testing::Ge(0), testing::Lt(1)));
    }
  }
}

// The fields that say how readings scatter, and none that say where they are expected.
std::set<std::string> ScatterFields() {
  return {"noise_sigma_s",   "noise_growth",       "any_noise",      "degrees_of_freedom",
          "poll_interval_s", "missed_probability", "wander_sigma_s", "wander_time_s"};
}

TEST_P(EffectContract, ChangesTheExpectationOrTheScatterAsItsRoleSays) {
  if (describes_only()) GTEST_SKIP() << "the catalogue's entry does nothing";
  const TouchBatch before = TestBatch(20, 3, 7);
  TouchBatch after = before;
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &after);
  for (const std::string& field : ChangedFields(before, after)) {
    if (effect().role == model::EffectRole::kSmoothError) continue;  // drawn anew for every object, see below
    EXPECT_EQ(ScatterFields().count(field) == 1, effect().random()) << field;
  }
}

TEST_P(EffectContract, DependsOnTheSeedOnlyIfItIsRandom) {
  TouchBatch one = TestBatch(20, 3, 7);
  TouchBatch other = one;
  other.seed = one.seed + 1;
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &one);
  ApplyEffect(effect(), TypicalValues(effect(), 3, 1), &other);
  one.seed = other.seed;
  if (effect().role == model::EffectRole::kSmoothError) {
    EXPECT_THAT(ChangedFields(one, other), testing::Not(testing::IsEmpty()));
  } else {
    EXPECT_THAT(ChangedFields(one, other), testing::IsEmpty());
  }
}

TEST_P(EffectContract, DependsOnSessionTimeAndOnTheLastTouchOnlyIfItSaysSo) {
  TouchBatch one = TestBatch(20, 3, 7), later = one, pressed = one;
  for (double& time_s : later.session_time_s) time_s += 3600;
  for (double& press_m : pressed.previous_press_m) press_m += 0.004;
  const auto reported = [&](TouchBatch* touches) {
    ApplyEffect(effect(), TypicalValues(effect(), 3, 1), touches);
    return touches->reported_time_s;
  };
  const std::vector<double> now_s = reported(&one);
  EXPECT_EQ(reported(&later) != now_s, effect().needs.session_time);
  EXPECT_EQ(reported(&pressed) != now_s, effect().needs.previous_press);
}

TEST_P(EffectContract, ReciprocalParametersStandAtTheirUpperBoundWhereTheyChangeNothing) {
  for (const model::ParameterInfo& p : effect().parameters) {
    if (!p.reciprocal) continue;
    EXPECT_EQ(p.neutral, p.upper) << p.name;
    EXPECT_GT(p.lower, 0) << p.name;
    EXPECT_EQ(p.arity, model::Arity::kScalar) << p.name;
  }
}

TEST_P(EffectContract, NamesWhatItIsConfoundedWithAndWhatTellsThemApart) {
  for (const model::ConfoundedEffect& confounded : effect().confounded_with) {
    EXPECT_TRUE(absl::EndsWith(confounded.discriminating_measurement, ".")) << confounded.effect;
    EXPECT_GE(confounded.discriminating_measurement.size(), 30u) << confounded.effect;
    if (confounded.effect.empty()) continue;
    const auto other = Catalogue().Find(confounded.effect);
    ASSERT_NE(other, nullptr) << confounded.effect;
    EXPECT_NE(other->name, effect().name);
    for (const model::ConfoundedEffect& back : other->confounded_with)
      EXPECT_NE(back.effect, effect().name) << "declared on both sides, which may contradict each other";
  }
}

TEST(Catalogue, HasOneEffectForEachPropertyOfTheScatter) {
  std::map<model::EffectRole, int> effects;
  for (const auto& effect : Catalogue().All()) ++effects[effect->role];
  for (const model::EffectRole role :
       {model::EffectRole::kNoiseLevel, model::EffectRole::kNoiseGrowth, model::EffectRole::kNoiseTails,
        model::EffectRole::kQuantisation, model::EffectRole::kDropout, model::EffectRole::kSmoothError,
        model::EffectRole::kNoiseMemory, model::EffectRole::kNoiseOfLength, model::EffectRole::kNoiseByFinger,
        model::EffectRole::kPixelNoise})
    EXPECT_EQ(effects[role], 1) << static_cast<int>(role);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EffectContract, testing::ValuesIn(TouchEffects()),
                         [](const auto& info) { return info.param->name; });

TEST(Catalogue, HasTheEffectsOfTheDesignInItsOrder) {
  std::vector<std::string> names;
  for (const auto& effect : Catalogue().All()) names.push_back(effect->name);
  EXPECT_THAT(names,
              testing::ElementsAre(
                  "tool_yaw", "tool_tilt", "finger_spacing", "finger_length", "gravity_sag", "object_scale",
                  "object_pose", "tip_radius", "surface_error", "surface_map", "speed_error",
                  "acceleration_ramp", "contact_slowdown", "object_push", "oblique_slip", "channel_latency",
                  "thermal_drift", "return_hysteresis", "clock_skew", "poll_interval", "gaussian_noise",
                  "incidence_noise", "heavy_tail_noise", "missed_contact", "correlated_noise",
                  "position_noise", "finger_noise", "camera_translation", "camera_rotation", "focal_error",
                  "principal_point", "radial_distortion", "light_position", "ambient_light", "specular",
                  "cast_shadow", "background_level", "vignetting", "defocus_blur", "motion_blur", "exposure",
                  "gamma", "response", "black_level", "image_noise", "formula", "lookup"));
}

TEST(Catalogue, ListsStagesInTheOrderOfTheDataAndOnlyTipRadiusBeforeTheCast) {
  int previous = 0;
  for (const auto& effect : Catalogue().All()) {
    if (effect->parameters.empty()) continue;  // a formula, a lookup, a map
    EXPECT_GE(static_cast<int>(effect->stage), previous) << effect->name;
    previous = static_cast<int>(effect->stage);
    EXPECT_EQ(effect->before_cast, effect->name == "tip_radius");
    EXPECT_EQ(effect->always_per_object, effect->name == "surface_error");
    EXPECT_EQ(effect->needs.previous_press, effect->name == "return_hysteresis");
  }
  EXPECT_EQ(Catalogue().Find("tip_radios"), nullptr);
}

}  // namespace
}  // namespace touchstone::effects
