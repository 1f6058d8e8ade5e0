#include "client/workbench_server/model_edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/workbench_server/formula_words.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

std::string With(const std::vector<std::string>& assignments) {
  return model::FormatModel(
      *model::AddEffect(model::NominalModel(), "tip_radius", assignments, effects::Catalogue()));
}

json Changed(json request) {
  const absl::StatusOr<std::string> answer = ChangeModel(request.dump());
  EXPECT_TRUE(answer.ok()) << answer.status();
  return answer.ok() ? json::parse(*answer) : json();
}

TEST(ChangeModel, TakesAnEffectOfAnotherModelOnce) {
  const std::string nominal = model::FormatModel(model::NominalModel());
  json request = {
      {"yaml", nominal}, {"change", "take"}, {"effect", "tip_radius"}, {"from", With({"radius_mm=2"})}};
  const json added = Changed(request);
  ASSERT_EQ(added["effects"].size(), 1u);
  EXPECT_EQ(added["effects"][0]["parameters"][0]["values"][0], 2.0);
  request["yaml"] = added["yaml"];
  request["from"] = With({"radius_mm=3"});
  const json replaced = Changed(request);
  ASSERT_EQ(replaced["effects"].size(), 1u);
  EXPECT_EQ(replaced["effects"][0]["parameters"][0]["values"][0], 3.0);
}

TEST(ChangeModel, SaysWhatATakenEffectWasFittedTo) {
  const std::string from =
      With({"radius_mm=2"}) +
      "provenance:\n  over: {name: nominal, hash: 8e3c}\n  fitted_to:\n"
      "    - {set: set.csv, sha256: 0f3a, unit: us, rmse_before: 9000, rmse_after: 5000}\n";
  json request = {{"yaml", model::FormatModel(model::NominalModel())},
                  {"change", "take"},
                  {"effect", "tip_radius"},
                  {"from", from}};
  const json whole = Changed(request);
  EXPECT_EQ(whole["yaml"], from);
  // With a change of the user's own beside it the errors are no longer those.
  request["yaml"] = model::FormatModel(
      *model::AddEffect(model::NominalModel(), "object_push", {"shift_mm=1"}, effects::Catalogue()));
  const std::string part = Changed(request)["yaml"];
  EXPECT_THAT(part, testing::HasSubstr("- {set: set.csv, sha256: \"0f3a\"}"));
  // A value of another origin says nothing.
  EXPECT_THAT(std::string(Changed({{"yaml", whole["yaml"]},
                                   {"change", "set"},
                                   {"effect", "tip_radius"},
                                   {"assignments", {"radius_mm=1.5"}}})["yaml"]),
              testing::Not(testing::HasSubstr("provenance")));
}

TEST(ChangeModel, SetsAndRemovesAnEffect) {
  const json set = Changed({{"yaml", With({"radius_mm=2"})},
                            {"change", "set"},
                            {"effect", "tip_radius"},
                            {"assignments", {"radius_mm=1.5"}}});
  EXPECT_EQ(set["effects"][0]["parameters"][0]["values"][0], 1.5);
  EXPECT_EQ(
      Changed({{"yaml", set["yaml"]}, {"change", "remove"}, {"effect", "tip_radius"}})["effects"].size(), 0u);
}

TEST(ChangeModel, RefusesWhatIsNoChange) {
  for (const char* wrong : {"", "[]", "{}", "{\"yaml\":3}", "{\"yaml\":\"x: [\",\"change\":\"none\"}"})
    EXPECT_FALSE(ChangeModel(wrong).ok()) << wrong;
  EXPECT_FALSE(
      ChangeModel(json{{"yaml", With({"radius_mm=2"})}, {"change", "burn"}, {"effect", "x"}}.dump()).ok());
  EXPECT_FALSE(ChangeModel(json{{"yaml", With({"radius_mm=2"})},
                                {"change", "set"},
                                {"effect", "tip_radius"},
                                {"assignments", {"radius_mm=1e9"}}}
                               .dump())
                   .ok());
}

TEST(ChangeModel, AddsAFormulaSetsItsValuesAndTakesItAway) {
  const std::string nominal = model::FormatModel(model::NominalModel());
  const json added =
      Changed({{"yaml", nominal},
               {"change", "formula"},
               {"assignments",
                {"name=screw", "adds=travel_mm", "expression=k * sin(travel_mm/lead)", "k=0", "k_unit=mm",
                 "k_min=-1", "k_max=1", "lead=4", "lead_unit=mm", "lead_min=2", "lead_max=10"}}});
  ASSERT_EQ(added["effects"].size(), 1u);
  EXPECT_EQ(added["effects"][0]["name"], "screw");
  EXPECT_TRUE(added["effects"][0]["editable"]);
  const json set = Changed({{"yaml", added["yaml"]},
                            {"change", "set"},
                            {"effect", "screw"},
                            {"assignments", {"k=0.25", "lead=5"}}});
  EXPECT_EQ(set["effects"][0]["parameters"][0]["values"][0], 0.25);
  EXPECT_EQ(set["effects"][0]["formula"], "k * sin(travel_mm/lead)");
  const json removed = Changed({{"yaml", set["yaml"]}, {"change", "remove"}, {"effect", "screw"}});
  EXPECT_EQ(removed["effects"].size(), 0u);
  const auto wrong = ChangeModel(json{
      {"yaml", set["yaml"]},
      {"change", "set"},
      {"effect", "screw"},
      {"assignments", {"pitch=1"}}}.dump());
  EXPECT_EQ(wrong.status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(NamesInFormula, SaysWhatIsUsedAndWhereAnErrorIs) {
  const auto named = NamesInFormula(json{{"expression", "k * sin(travel_mm)"}}.dump());
  ASSERT_TRUE(named.ok()) << named.status();
  EXPECT_EQ(json::parse(*named)["names"][1], (json{{"name", "travel_mm"}, {"character", 9}}));
  const auto wrong = NamesInFormula(json{{"expression", "k * * 2"}}.dump());
  EXPECT_EQ(std::string(wrong.status().message()).rfind("character 5", 0), 0u) << wrong.status();
}

}  // namespace
}  // namespace touchstone::workbench
