#include "client/cli/common/provenance.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>

#include "server/base/process/version.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

TEST(ShellCommand, CanBePastedIntoAShell) {
  const char* const argv[] = {"/opt/bin/touchstone", "diagnose", "my set.csv", "--mesh",
                              "cup=it's.off",        "--seed",   "7",          ""};
  EXPECT_EQ(ShellCommand(8, argv), "touchstone diagnose 'my set.csv' --mesh 'cup=it'\\''s.off' --seed 7 ''");
}

TEST(UtcNow, IsIso8601) {
  EXPECT_TRUE(std::regex_match(UtcNow(), std::regex("\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\dZ")))
      << UtcNow();
}

TEST(AddClientProvenance, HashesTheMeshFilesThatWereUsed) {
  const std::string path = (std::filesystem::temp_directory_path() / "provenance_test.off").string();
  std::ofstream(path) << "OFF\n0 0 0\n";
  v1::Report report;
  report.mutable_provenance()->set_seed(5);
  report.mutable_provenance()->add_meshes()->set_object("cup");
  report.mutable_provenance()->add_meshes()->set_object("served");
  source::MeshSpec cup, unused;
  cup.name = "cup";
  unused.name = "unused";
  cup.path = unused.path = path;
  AddClientProvenance("touchstone diagnose set.csv", "abc", {unused, cup}, &report);
  std::filesystem::remove(path);
  const v1::Provenance& provenance = report.provenance();
  EXPECT_EQ(provenance.command(), "touchstone diagnose set.csv");
  EXPECT_EQ(provenance.set_sha256(), "abc");
  EXPECT_EQ(provenance.client_version(), kVersion);
  EXPECT_EQ(provenance.seed(), 5u);
  ASSERT_EQ(provenance.meshes_size(), 2);
  EXPECT_EQ(provenance.meshes(0).path(), path);
  EXPECT_EQ(provenance.meshes(0).file_sha256(), Sha256Hex("OFF\n0 0 0\n"));
  EXPECT_EQ(provenance.meshes(1).path(), "");
}

}  // namespace
}  // namespace touchstone::cli
