#include "server/model/provenance.h"

#include <gtest/gtest.h>

#include "server/model/model.h"

namespace touchstone::model {
namespace {

class NoEffects : public EffectCatalogue {
 public:
  std::vector<std::shared_ptr<const Effect>> All() const override { return {}; }
  std::shared_ptr<const Effect> Find(const std::string&) const override { return nullptr; }
  absl::StatusOr<std::shared_ptr<const Effect>> MakeFormula(const FormulaSpec&) const override {
    return absl::UnimplementedError("no formula is read here");
  }
  absl::StatusOr<std::shared_ptr<const Effect>> MakeLookup(const LookupSpec&) const override {
    return absl::UnimplementedError("no lookup is read here");
  }
  absl::StatusOr<std::shared_ptr<const Effect>> MakeSurfaceMap(const SurfaceMapSpec&) const override {
    return absl::UnimplementedError("no map is read here");
  }
};

Provenance Promoted() {
  Provenance provenance;
  provenance.over_name = "nominal", provenance.over_hash = "12ab";
  provenance.fitted_to = {{"lab, bench 2/set.csv", "0f", "us", 15800.5, 4910},
                          {"photos", "", "grey", 12, 1.3}};
  provenance.promotion = {{"set2.csv", "1e5", "us", 15600, 5020},
                          -10700,
                          -10400,
                          FormatModel(NominalModel()) + "provenance:\n  over: {name: older, hash: \"7\"}\n"};
  return provenance;
}

std::string FileOf(const Provenance& provenance) {
  return FormatModel(NominalModel()) + FormatProvenance(provenance);
}

TEST(Provenance, IsReadBackAsItWasWritten) {
  const Provenance written = Promoted();
  const absl::StatusOr<Provenance> read = ReadProvenance(FileOf(written), "better.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->over_name, "nominal");
  EXPECT_EQ(read->over_hash, "12ab");
  ASSERT_EQ(read->fitted_to.size(), 2u);
  EXPECT_EQ(read->fitted_to[0].set, "lab, bench 2/set.csv");
  EXPECT_EQ(read->fitted_to[0].rmse_before, 15800.5);
  EXPECT_EQ(read->fitted_to[1].sha256, "");
  ASSERT_TRUE(read->promotion);
  EXPECT_EQ(read->promotion->on.sha256, "1e5");
  EXPECT_EQ(read->promotion->lower, -10700);
  EXPECT_EQ(read->promotion->before, written.promotion->before);
  EXPECT_EQ(FileOf(*read), FileOf(written));
}

TEST(Provenance, KeepsTheFileBeforeByteForByte) {
  for (const char* before :
       {"touchstone: model/1\n# two lines\n\nname: rig  # comment\n", "a: 1", "a: 1\n\n", "a: 1\r\nb: 2\r\n",
        "\n a: 1\n", "a: 1\n\tb\n", "a: \"5 \xc2\xb5m\"\n", "# \"quoted\" \\ back\n"}) {
    Provenance provenance = Promoted();
    provenance.promotion->before = before;
    provenance.promotion->hash = "3f9c";
    const absl::StatusOr<Provenance> read = ReadProvenance(FileOf(provenance), "better.yaml");
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->promotion->before, before);
    EXPECT_EQ(read->promotion->hash, "3f9c");
  }
}

// It describes the model, and is no part of its physics.
TEST(Provenance, ChangesNeitherHashNorModel) {
  const NoEffects none;
  const absl::StatusOr<Model> model = ParseModel(FileOf(Promoted()), "better.yaml", none);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->Hash(), NominalModel().Hash());
  EXPECT_EQ(FormatModel(*model), FormatModel(NominalModel()));
}

TEST(Provenance, OfAFileWithoutItIsEmpty) {
  const absl::StatusOr<Provenance> read = ReadProvenance(FormatModel(NominalModel()), "nominal.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(read->empty());
  EXPECT_EQ(FormatProvenance(*read), "");
}

TEST(Provenance, MistakesAreNamedWithTheirPlace) {
  const auto message = [](const std::string& text) {
    const NoEffects none;
    const absl::Status status = ParseModel(FormatModel(NominalModel()) + text, "better.yaml", none).status();
    EXPECT_FALSE(status.ok()) << text;
    return std::string(status.message());
  };
  EXPECT_EQ(message("provenance: [1]\n").find("better.yaml:5:"), 0u);
  EXPECT_NE(message("provenance: {fitted: []}\n").find("has no 'fitted', did you mean 'fitted_to'"),
            std::string::npos);
  EXPECT_NE(
      message("provenance: {fitted_to: [{set: a, rmse_before: much}]}\n").find("'much' is not a number"),
      std::string::npos);
}

}  // namespace
}  // namespace touchstone::model
