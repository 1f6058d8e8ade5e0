#include "client/source/dataset/dataset_manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/source/dataset/lab_units.h"

namespace touchstone::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

struct Example {
  Example() {
    spec.add_objects("lat20");
    spec.mutable_plan()->mutable_sphere()->set_step_angle_rad(ToSi(Unit::kDegree, 5));
    spec.mutable_plan()->set_speed_m_s(0.02);
    spec.set_seed(18446744073709551615ull);
    spec.set_samples(20);
    spec.add_columns("descriptor");
    spec.mutable_image()->set_vertical_fov_rad(ToSi(Unit::kDegree, 45));
    header.set_samples(20);
    header.set_model_name("nominal");
    header.set_model_hash("abc");
    header.set_model_yaml("touchstone: model/1\n");
    header.add_mesh_hashes("def");
    header.set_spacing_m(0.03);
    layout.samples = 20;
    layout.shard_size = 10;
  }
  DatasetManifest Manifest() const {
    DatasetManifest manifest;
    manifest.identity = MakeIdentity(spec, header, layout);
    manifest.shards[1] = {"shard-000001.tar", 10, 10, 1234, "0123"};
    return manifest;
  }
  v1::DatasetSpec spec;
  v1::DatasetHeader header;
  DatasetLayout layout;
};

TEST(DatasetManifest, IsReadBackAsItWasWritten) {
  const Example example;
  const std::string text = FormatManifest(example.Manifest(), false);
  EXPECT_THAT(text, HasSubstr("\"state\": \"partial\""));
  EXPECT_THAT(text, HasSubstr("\"step_angle_deg\": 5.0"));
  EXPECT_THAT(text, HasSubstr("\"speed_mm_s\": 20.0"));
  EXPECT_THAT(text, HasSubstr("\"seed\": 18446744073709551615"));
  const auto read = ParseManifest(text, "dataset.json");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(FormatManifest(*read, false), text);
  EXPECT_EQ(read->shards.at(1).bytes, 1234u);
}

TEST(DatasetManifest, TheSpecificationCanBeSentAgain) {
  const Example example;
  const auto spec = SpecOfManifest(example.Manifest().identity, "dataset.json");
  ASSERT_TRUE(spec.ok()) << spec.status();
  v1::DatasetSpec expected = example.spec;
  expected.mutable_model()->set_yaml(example.header.model_yaml());
  EXPECT_EQ(spec->SerializeAsString(), expected.SerializeAsString());
}

TEST(DatasetManifest, DifferencesAreNamed) {
  Example example;
  const auto before = example.Manifest().identity;
  example.spec.set_seed(2);
  example.header.set_model_hash("xyz");
  EXPECT_THAT(DiffIdentities(before, example.Manifest().identity),
              ElementsAre("seed: 18446744073709551615 there, 2 now",
                          "specification.seed: 18446744073709551615 there, 2 now",
                          "model.hash: \"abc\" there, \"xyz\" now"));
  EXPECT_TRUE(DiffIdentities(before, before).empty());
}

TEST(DatasetManifest, OtherFilesAreRefused) {
  for (const char* text : {"", "{", "[]", "{}", R"({"touchstone":"dataset/2","shards":[],"shard_size":1})"})
    EXPECT_THAT(std::string(ParseManifest(text, "x.json").status().message()), StartsWith("x.json: is no"))
        << text;
  EXPECT_THAT(
      std::string(
          ParseManifest(
              R"({"touchstone":"dataset/1","format":"folder","samples":5,"shards":[],"shard_size":0})",
              "x.json")
              .status()
              .message()),
      HasSubstr("'shard_size' is 0"));
}

// A file that somebody edited is an error with the file's name, whatever stands where.
TEST(DatasetManifest, AValueOfAnotherTypeIsAnError) {
  const Example example;
  const auto whole = nlohmann::ordered_json::parse(FormatManifest(example.Manifest(), false));
  std::vector<std::string> places = {"/shards",  "/shards/0",      "/model",   "/objects",
                                     "/columns", "/specification", "/versions"};
  const nlohmann::ordered_json flat = whole.flatten();
  for (const auto& [path, value] : flat.items()) places.push_back(path);
  const std::vector<nlohmann::ordered_json> strange = {nullptr,
                                                       true,
                                                       -1,
                                                       1e300,
                                                       "text",
                                                       nlohmann::ordered_json::array({1}),
                                                       nlohmann::ordered_json::object({{"a", 1}})};
  int refused = 0;
  for (const std::string& place : places)
    for (const auto& value : strange) {
      nlohmann::ordered_json changed = whole;
      changed[nlohmann::ordered_json::json_pointer(place)] = value;
      const auto manifest = ParseManifest(changed.dump(), "there/dataset.json");
      const absl::Status status = manifest.ok()
                                      ? SpecOfManifest(manifest->identity, "there/dataset.json").status()
                                      : manifest.status();
      if (status.ok()) continue;
      ++refused;
      EXPECT_THAT(std::string(status.message()), HasSubstr("there/dataset.json")) << place;
    }
  EXPECT_GT(refused, 100);
}

TEST(DatasetManifest, NumberOfAShardIsWhole) {
  const Example example;
  const auto whole = nlohmann::ordered_json::parse(FormatManifest(example.Manifest(), false));
  for (const char* key : {"first_index", "samples", "bytes"})
    for (const nlohmann::ordered_json& value :
         {nlohmann::ordered_json(0.5), nlohmann::ordered_json(-1), nlohmann::ordered_json(1e300),
          nlohmann::ordered_json(nullptr)}) {
      nlohmann::ordered_json changed = whole;
      changed["shards"][0][key] = value;
      const absl::Status status = ParseManifest(changed.dump(), "there/dataset.json").status();
      EXPECT_THAT(std::string(status.message()), HasSubstr(std::string("'") + key + "' is ")) << value;
    }
}

}  // namespace
}  // namespace touchstone::client
