// The model file with two made-up effects: the reader's rules, not the physics.
#include "server/model/model.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/text/text.h"
#include "server/model/parameter_values.h"
#include "server/model/yaml/yaml_tree.h"

namespace touchstone::model {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

ParameterInfo Row(const char* name, Unit unit, Arity arity, double lower, double upper,
                  bool sum_zero = false) {
  ParameterInfo info;
  info.name = name;
  info.unit = unit;
  info.arity = arity;
  info.lower = lower;
  info.upper = upper;
  info.typical = 1;
  info.sum_zero = sum_zero;
  return info;
}

class TwoEffects : public EffectCatalogue {
 public:
  TwoEffects() {
    auto tip = std::make_shared<Effect>();
    tip->name = "tip_radius";
    tip->parameters = {Row("radius_mm", Unit::kMillimetre, Arity::kScalar, 0, 20)};
    auto length = std::make_shared<Effect>();
    length->name = "finger_length";
    length->parameters = {Row("offset_mm", Unit::kMillimetre, Arity::kPerFinger, -5, 5, true),
                          Row("axis", Unit::kNone, Arity::kVector3, -1, 1)};
    effects_ = {tip, length};
  }
  std::vector<std::shared_ptr<const Effect>> All() const override { return effects_; }
  std::shared_ptr<const Effect> Find(const std::string& name) const override {
    for (const auto& effect : effects_)
      if (effect->name == name) return effect;
    return nullptr;
  }
  absl::StatusOr<std::shared_ptr<const Effect>> MakeFormula(const FormulaSpec&) const override {
    return absl::UnimplementedError("no formulas here");
  }
  absl::StatusOr<std::shared_ptr<const Effect>> MakeLookup(const LookupSpec&) const override {
    return absl::UnimplementedError("no lookups here");
  }
  absl::StatusOr<std::shared_ptr<const Effect>> MakeSurfaceMap(const SurfaceMapSpec&) const override {
    return absl::UnimplementedError("no maps here");
  }

 private:
  std::vector<std::shared_ptr<const Effect>> effects_;
};

const TwoEffects kCatalogue;

absl::StatusOr<Model> Parse(const std::string& text) {
  return ParseModel(text, "m.yaml", kCatalogue);
}

std::string ErrorOf(const std::string& text) {
  const absl::StatusOr<Model> model = Parse(text);
  return model.ok() ? "no error" : std::string(model.status().message());
}

// The rest of a file after two good lines.
std::string File(const std::string& rest) {
  return absl::StrCat("touchstone: model/1\nname: n\n", rest);
}

TEST(ModelFile, FillsInTheSeedsRigAndNeutralValues) {
  const absl::StatusOr<Model> model = Parse(File("effects:\n  - finger_length:\n"));
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->fingers, 3);
  EXPECT_EQ(model->spacing_m, 0.030);
  EXPECT_THAT(model->effects[0].values, ElementsAre(0, 0, 0, 0, 0, 0));
  EXPECT_EQ(ErrorOf(File("")), "no error");
  EXPECT_EQ(ErrorOf(File("effects:\n")), "no error");
}

TEST(ModelFile, NamesThePlaceTheValueAndWhatWouldBeRight) {
  EXPECT_EQ(ErrorOf(File("effects:\n  - tip_radius: {radius_mm: 25}\n")),
            "m.yaml:4:29: tip_radius.radius_mm is 25; it must lie in 0 to 20 mm");
  EXPECT_EQ(ErrorOf(File("effects:\n  - tip_radios: {radius_mm: 1}\n")),
            "m.yaml:4:5: unknown effect 'tip_radios', did you mean 'tip_radius'?");
  EXPECT_EQ(ErrorOf(File("effects:\n  - tip_radius: {radius: 1}\n")),
            "m.yaml:4:18: tip_radius has no parameter 'radius', did you mean 'radius_mm'?");
  EXPECT_EQ(ErrorOf(File("effcts: []\n")),
            "m.yaml:3:1: a model file has no 'effcts', did you mean 'effects'?");
  EXPECT_EQ(ErrorOf(File("effects:\n  - tip_radius: {radius_mm: wide}\n")),
            "m.yaml:4:29: tip_radius.radius_mm: 'wide' is not a number; one like 12.5 was expected");
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius: {radius_mm: .nan}\n")), HasSubstr("m.yaml:4:29"));
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius: {radius_mm: nan}\n")),
              HasSubstr("not a finite number"));
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius: {radius_mm: [1]}\n")),
              HasSubstr("is a list; it must be a number"));
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius\n")), HasSubstr("m.yaml:4:5: an effect is written as"));
  EXPECT_THAT(ErrorOf(File("effects: 3\n")), HasSubstr("effects is a single value ('3'); it must be a list"));
}

TEST(ModelFile, WantsAValueForEveryFinger) {
  EXPECT_THAT(ErrorOf(File("effects:\n  - finger_length: {offset_mm: [1, -1]}\n")),
              HasSubstr("finger_length.offset_mm has 2 values; it needs one per finger, 3"));
  EXPECT_THAT(ErrorOf(File("effects:\n  - finger_length: {axis: [1, 0]}\n")),
              HasSubstr("finger_length.axis has 2 values; it needs 3, for x, y and z"));
  EXPECT_EQ(ErrorOf(File("end_effector: {fingers: 2}\neffects:\n  - finger_length: {offset_mm: [1, -1]}\n")),
            "no error");
}

TEST(ModelFile, RefusesPerFingerValuesThatDoNotSumToZeroAndGivesThoseThatDo) {
  EXPECT_THAT(
      ErrorOf(File("effects:\n  - finger_length: {offset_mm: [1, 0, 0.5]}\n")),
      HasSubstr(
          "sum to 1.5 and must sum to 0, since only differences between fingers can be seen; less their mean "
          "they are [0.5, -0.5, 0]"));
  // What the message proposes is accepted.
  EXPECT_THAT(ErrorOf(File("effects:\n  - finger_length: {offset_mm: [1, 0, 0]}\n")),
              HasSubstr("[0.666666666667, -0.333333333333, -0.333333333333]"));
  EXPECT_EQ(
      ErrorOf(File(
          "effects:\n  - finger_length: {offset_mm: [0.666666666667, -0.333333333333, -0.333333333333]}\n")),
      "no error");
}

TEST(ModelFile, WantsItsHeader) {
  EXPECT_THAT(ErrorOf("name: n\n"), HasSubstr("'touchstone: model/1' is missing"));
  EXPECT_THAT(ErrorOf("touchstone: model/2\nname: n\n"), HasSubstr("m.yaml:1:13: touchstone is 'model/2'"));
  EXPECT_THAT(ErrorOf("touchstone: model/1\n"), HasSubstr("'name' is missing"));
  EXPECT_THAT(ErrorOf(File("end_effector: {fingers: 17}\n")),
              HasSubstr("m.yaml:3:25: end_effector.fingers is 17; it must lie in 1 to 16"));
  EXPECT_THAT(ErrorOf(File("end_effector: {fingers: 2.5}\n")), HasSubstr("must be a whole number"));
  EXPECT_THAT(ErrorOf(File("end_effector: {spacing_mm: 0}\n")), HasSubstr("must be above 0"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("m.yaml"));
}

TEST(ModelFile, RefusesRepeatedKeysAndEffects) {
  EXPECT_EQ(ErrorOf(File("effects:\n  - tip_radius: {radius_mm: 1, radius_mm: 2}\n")),
            "m.yaml:4:32: 'radius_mm' is given twice; leave one out");
  EXPECT_EQ(ErrorOf(File("effects:\n  - tip_radius: {}\n  - tip_radius: {}\n")),
            "m.yaml:5:5: tip_radius is in the model already; change its values in the file");
}

TEST(ModelFile, TakesObjectsOnlyInObjectScope) {
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius: {objects: {a: {radius_mm: 1}}}\n")),
              HasSubstr("need 'scope: object'"));
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius: {scope: world}\n")),
              HasSubstr("must be 'rig' or 'object'"));
  EXPECT_THAT(ErrorOf(File("effects:\n  - tip_radius: {scope: object, objects: {a: {radius_mm: 99}}}\n")),
              HasSubstr("0 to 20 mm"));
}

TEST(ModelFile, SurvivesHostileYaml) {
  EXPECT_THAT(ErrorOf(File("effects: &a [*a]\n")), HasSubstr("anchors"));
  EXPECT_THAT(ErrorOf(File("effects: !!python/object:os.system x\n")), HasSubstr("tags"));
  EXPECT_THAT(ErrorOf(File("effects: " + std::string(40, '[') + std::string(40, ']'))),
              HasSubstr("levels deep"));
  EXPECT_THAT(ErrorOf(std::string(100'000, '[')), HasSubstr("m.yaml:"));
  EXPECT_THAT(ErrorOf(std::string(100'000, '{')),
              testing::AnyOf(HasSubstr("deep"), HasSubstr("a key must be")));
  EXPECT_THAT(ErrorOf(std::string((1 << 20) + 1, 'a')), HasSubstr("at most 1048576 are read"));
  std::string many = "effects: [";
  for (int i = 0; i < 200'000; ++i) many += "1,";
  EXPECT_THAT(ErrorOf(File(many + "]\n")), HasSubstr("more than 100000"));
  EXPECT_THAT(ErrorOf("a: b: c: d"), HasSubstr("not valid YAML"));
  EXPECT_THAT(ErrorOf(File("---\nname: two\n")), HasSubstr("second document"));
  EXPECT_THAT(ErrorOf(std::string("\0\0\0", 3)), HasSubstr("m.yaml"));
}

TEST(ModelHash, IsAboutPhysicsAndNotAboutTheName) {
  Model model = NominalModel();
  const std::string hash = model.Hash();
  EXPECT_EQ(hash.size(), 64u);
  model.name = "another";
  EXPECT_EQ(model.Hash(), hash);
  model.spacing_m = 0.031;
  EXPECT_NE(model.Hash(), hash);
  const Model added = *AddEffect(NominalModel(), "tip_radius", {"radius_mm=1"}, kCatalogue);
  EXPECT_NE(added.Hash(), hash);
  EXPECT_NE(AddEffect(NominalModel(), "tip_radius", {"radius_mm=1", "scope=object"}, kCatalogue)->Hash(),
            added.Hash());
}

TEST(Yaml, LinesMayEndInCarriageReturnsAndNumbersHaveUnicodeSigns) {
  for (const char* text : {"a: 1\rb: \xE2\x88\x92"
                           "2.5\r",
                           "a: 1\r\nb: \xE2\x88\x92"
                           "2.5\r\n"}) {
    const auto tree = ParseYaml(text, "m.yaml");
    ASSERT_TRUE(tree.ok()) << tree.status();
    ASSERT_NE(tree->Find("b"), nullptr);
    EXPECT_EQ(tree->Find("b")->line, 2);
    EXPECT_EQ(*ParseNumber(tree->Find("b")->text), -2.5);
  }
}

TEST(FileNumber, PrintsWhatAPersonWouldHaveWritten) {
  EXPECT_EQ(FileNumber(Unit::kMillimetre, ToSi(Unit::kMillimetre, 30)), "30");
  EXPECT_EQ(FileNumber(Unit::kDegree, ToSi(Unit::kDegree, 0.7)), "0.7");
  EXPECT_EQ(FileNumber(Unit::kMillimetrePerHour, ToSi(Unit::kMillimetrePerHour, 0.1)), "0.1");
  EXPECT_EQ(FileNumber(Unit::kMicrosecond, -0.0), "0");
  EXPECT_EQ(FileNumber(Unit::kNone, 0.1 + 0.2), "0.30000000000000004");
}

TEST(RemoveEffect, TakesOneEffectOutAndLeavesTheOldModelAlone) {
  const Model added = *AddEffect(NominalModel(), "tip_radius", {"radius_mm=1"}, kCatalogue);
  const auto removed = RemoveEffect(added, "tip_radius");
  ASSERT_TRUE(removed.ok()) << removed.status();
  EXPECT_EQ(removed->Hash(), NominalModel().Hash());
  EXPECT_EQ(added.effects.size(), 1u);
  EXPECT_EQ(RemoveEffect(added, "tip").status().message(),
            "the model has no effect 'tip'; it has tip_radius");
  EXPECT_EQ(RemoveEffect(*removed, "tip_radius").status().message(),
            "the model has no effect 'tip_radius', and no other");
}

TEST(AddEffect, ChecksLikeAFileAndLeavesTheOldModelAlone) {
  const Model before = NominalModel();
  const auto error = [&](const std::string& effect, const std::vector<std::string>& texts) {
    return std::string(AddEffect(before, effect, texts, kCatalogue).status().message());
  };
  EXPECT_THAT(error("tip_radios", {}), HasSubstr("did you mean 'tip_radius'?"));
  EXPECT_THAT(error("tip_radius", {"radius=1"}), HasSubstr("did you mean 'radius_mm'?"));
  EXPECT_THAT(error("tip_radius", {"radius_mm=99"}), HasSubstr("0 to 20 mm"));
  EXPECT_THAT(error("tip_radius", {"radius_mm"}), HasSubstr("parameter=value"));
  EXPECT_THAT(error("tip_radius", {"radius_mm=1", "radius_mm=2"}), HasSubstr("given twice"));
  EXPECT_THAT(error("tip_radius", {"lat00.radius_mm=2"}), HasSubstr("scope=object"));
  const Model after = *AddEffect(before, "finger_length", {"offset_mm=0.25,0,-0.25"}, kCatalogue);
  EXPECT_TRUE(before.effects.empty());
  EXPECT_THAT(after.effects[0].values, ElementsAre(0.00025, 0, -0.00025, 0, 0, 0));
  EXPECT_THAT(AddEffect(after, "finger_length", {}, kCatalogue).status().code(),
              absl::StatusCode::kAlreadyExists);
  const Model objects =
      *AddEffect(before, "tip_radius", {"radius_mm=1", "scope=object", "lat00.radius_mm=2"}, kCatalogue);
  EXPECT_THAT(objects.effects[0].ValuesFor("lat00"), ElementsAre(0.002));
  EXPECT_THAT(objects.effects[0].ValuesFor("lat05"), ElementsAre(0.001));
}

TEST(DiffModels, SaysInWordsWhatChanged) {
  const Model nominal = NominalModel();
  const Model one = *AddEffect(nominal, "tip_radius", {"radius_mm=1"}, kCatalogue);
  const Model two = *AddEffect(nominal, "tip_radius", {"radius_mm=2.5"}, kCatalogue);
  EXPECT_THAT(DiffModels(nominal, nominal), ElementsAre());
  EXPECT_THAT(DiffModels(nominal, one), ElementsAre("tip_radius added: radius_mm = 1 mm"));
  EXPECT_THAT(DiffModels(one, nominal), ElementsAre("tip_radius removed: radius_mm = 1 mm"));
  EXPECT_THAT(DiffModels(one, two), ElementsAre("tip_radius: radius_mm 1 mm -> 2.5 mm"));
  const Model objects =
      *AddEffect(nominal, "tip_radius", {"radius_mm=1", "scope=object", "lat00.radius_mm=2"}, kCatalogue);
  EXPECT_THAT(DiffModels(one, objects),
              ElementsAre("tip_radius: scope rig -> object", "tip_radius, object lat00: own values added",
                          "tip_radius, object lat00: radius_mm 1 mm -> 2 mm"));
  const Model first = *AddEffect(one, "finger_length", {}, kCatalogue);
  Model second = first;
  std::swap(second.effects[0], second.effects[1]);
  EXPECT_THAT(DiffModels(first, second),
              ElementsAre("order: tip_radius, finger_length -> finger_length, tip_radius"));
}

}  // namespace
}  // namespace touchstone::model
