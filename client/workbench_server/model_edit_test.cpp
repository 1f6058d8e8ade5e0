#include "client/workbench_server/model_edit.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

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

}  // namespace
}  // namespace touchstone::workbench
