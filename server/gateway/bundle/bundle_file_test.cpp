// Bundles as others might make them.
#include "server/gateway/bundle/bundle_file.h"

#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::gateway::bundle {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct Member {
  std::string name, text;
  int kind = AE_IFREG;
};

nlohmann::ordered_json ManifestOf(const std::vector<Member>& members) {
  nlohmann::ordered_json manifest = {{"format", "touchstone bundle"}, {"format_version", 1}};
  manifest["files"] = nlohmann::ordered_json::array();
  for (const Member& member : members)
    manifest["files"].push_back(
        {{"name", member.name}, {"bytes", member.text.size()}, {"sha256", Sha256Hex(member.text)}});
  return manifest;
}

class BundleFile : public testing::Test {
 protected:
  void Pack(const std::vector<Member>& members) {
    archive* const tar = archive_write_new();
    archive_write_set_format_pax(tar);
    archive_write_add_filter_gzip(tar);
    ASSERT_EQ(archive_write_open_filename(tar, path_.c_str()), ARCHIVE_OK);
    for (const Member& member : members) {
      archive_entry* const entry = archive_entry_new();
      archive_entry_set_pathname(entry, member.name.c_str());
      archive_entry_set_filetype(entry, static_cast<unsigned>(member.kind));
      archive_entry_set_perm(entry, 0644);
      if (member.kind == AE_IFLNK)
        archive_entry_set_symlink(entry, member.text.c_str());
      else
        archive_entry_set_size(entry, static_cast<la_int64_t>(member.text.size()));
      ASSERT_EQ(archive_write_header(tar, entry), ARCHIVE_OK) << archive_error_string(tar);
      if (member.kind == AE_IFREG) archive_write_data(tar, member.text.data(), member.text.size());
      archive_entry_free(entry);
    }
    archive_write_close(tar);
    archive_write_free(tar);
  }
  // With a manifest that lists `listed`.
  void Pack(const std::vector<Member>& listed, std::vector<Member> members) {
    members.insert(members.begin(), {"manifest.json", ManifestOf(listed).dump()});
    Pack(members);
  }
  std::string WhyRefused() {
    const auto opened = OpenedBundle::Open(path_);
    EXPECT_FALSE(opened.ok());
    return std::string(opened.status().message());
  }

  const TestFolder folder_;
  const std::string path_ = folder_.Path("bug.tar.gz");
  const Member session_{"session.db", "what was touched"};
};

TEST_F(BundleFile, ComesBackAsItWasAndItsFolderGoesWithIt) {
  const std::string source = folder_.Path("given");
  std::ofstream(source) << session_.text;
  ASSERT_TRUE(
      WriteBundle(path_, {{"seed", 7}}, {{"session.db", source}, {"models/model-1.yaml", source}}).ok());
  EXPECT_TRUE(LooksLikeBundle(path_));
  EXPECT_FALSE(LooksLikeBundle(source));
  std::string unpacked;
  {
    const auto opened = OpenedBundle::Open(path_);
    ASSERT_TRUE(opened.ok()) << opened.status();
    EXPECT_EQ((*opened)->manifest()["seed"], 7);
    EXPECT_THAT((*opened)->names(), testing::ElementsAre("session.db", "models/model-1.yaml"));
    unpacked = (*opened)->PathOf("models/model-1.yaml");
    EXPECT_EQ(ReadFile(unpacked).value(), session_.text);
    const auto folder = std::filesystem::path(unpacked).parent_path().parent_path();
    EXPECT_EQ(std::filesystem::status(folder).permissions(), std::filesystem::perms::owner_all);
  }
  EXPECT_FALSE(std::filesystem::exists(unpacked));
  const std::string first = ReadFile(path_).value(), again = folder_.Path("again.tar.gz");
  ASSERT_TRUE(
      WriteBundle(again, {{"seed", 7}}, {{"session.db", source}, {"models/model-1.yaml", source}}).ok());
  EXPECT_EQ(ReadFile(again).value(), first);
}

TEST_F(BundleFile, CutOffAnywhereIsRefused) {
  Member noise{"session.db", ""};
  for (uint32_t k = 0, value = 1; k < 400000; ++k)
    noise.text += static_cast<char>((value = value * 1664525 + 7) >> 24);
  Pack({noise}, {noise});
  ASSERT_TRUE(OpenedBundle::Open(path_).ok());
  const std::string whole = ReadFile(path_).value();
  for (size_t bytes = 0; bytes + 12 < whole.size(); bytes += whole.size() / 37) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc)
        .write(whole.data(), static_cast<std::streamsize>(bytes));
    EXPECT_FALSE(OpenedBundle::Open(path_).ok()) << bytes << " of " << whole.size() << " bytes";
  }
  std::ofstream(path_, std::ios::binary | std::ios::trunc)
      .write(whole.data(), static_cast<std::streamsize>(whole.size() / 2));
  EXPECT_THAT(WhyRefused(), AllOf(HasSubstr("bug.tar.gz: session.db is cut off or damaged"),
                                  HasSubstr("get the file again")));
}

TEST_F(BundleFile, AChangedByteIsFoundByItsHash) {
  Member other = session_;
  other.text[3] ^= 1;
  Pack({session_}, {other});
  EXPECT_THAT(WhyRefused(), HasSubstr("session.db is not what the manifest lists"));
  other.text = session_.text + "more";
  Pack({session_}, {other});
  EXPECT_THAT(WhyRefused(), HasSubstr("session.db is not what the manifest lists"));
}

TEST_F(BundleFile, NamesOutsideOfItAreRefusedAndNothingIsWrittenThere) {
  for (const char* name :
       {"../evil", "/tmp/evil", "models/../../evil", "a/b/c", "./session.db", ".hidden", "models/.x", ""}) {
    EXPECT_FALSE(IsBundleName(name)) << name;
    const Member evil{*name == '\0' ? "a\\b" : name, "evil"};
    Pack({session_}, {session_, evil});
    EXPECT_THAT(WhyRefused(), HasSubstr("lies outside of a bundle")) << name;
    // As a name in the manifest too.
    Pack({evil}, {session_});
    EXPECT_THAT(WhyRefused(), HasSubstr("is no file of a bundle")) << name;
  }
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::temp_directory_path() / "evil"));
}

TEST_F(BundleFile, LinksAndDevicesAreRefused) {
  Pack({session_}, {{"session.db", "/etc/passwd", AE_IFLNK}});
  EXPECT_THAT(WhyRefused(), HasSubstr("'session.db', which is no plain file"));
  Pack({session_}, {{"session.db", "", AE_IFIFO}});
  EXPECT_THAT(WhyRefused(), HasSubstr("which is no plain file"));
}

TEST_F(BundleFile, WhatTheManifestDoesNotListOrListsOtherwiseIsRefused) {
  Pack({session_}, {session_, {"audit.jsonl", "x"}});
  EXPECT_THAT(WhyRefused(), HasSubstr("'audit.jsonl', which its manifest does not list"));
  Pack({session_}, {session_, session_});
  EXPECT_THAT(WhyRefused(), HasSubstr("'session.db' twice"));
  Pack({session_, {"audit.jsonl", "x"}}, {session_});
  EXPECT_THAT(WhyRefused(), HasSubstr("audit.jsonl is missing"));
  Pack({session_});
  EXPECT_THAT(WhyRefused(), HasSubstr("begins with 'session.db' and not with manifest.json"));
  for (const char* text :
       {"[]", "{", "{\"format\": 1}", "{\"format\": \"touchstone bundle\", \"format_version\": 2}",
        "{\"format\": \"touchstone bundle\", \"format_version\": 1, \"files\": {}}",
        "{\"format\": \"touchstone bundle\", \"format_version\": 1, \"files\": [{\"name\": 1}]}"}) {
    Pack({Member{"manifest.json", text}});
    EXPECT_THAT(WhyRefused(), HasSubstr("a bundle is what touchstone rig bundle writes")) << text;
  }
  std::ofstream(path_, std::ios::trunc) << "no archive";
  EXPECT_THAT(WhyRefused(), HasSubstr("is no gzipped tar"));
}

TEST_F(BundleFile, HugeOnesAreRefusedBeforeTheyAreUnpacked) {
  nlohmann::ordered_json manifest = ManifestOf({session_});
  manifest["files"][0]["bytes"] = kMaxBundleBytes + 1;
  Pack({{"manifest.json", manifest.dump()}, session_});
  EXPECT_THAT(WhyRefused(), HasSubstr("more than 4 GiB"));
  // Many gigabytes of zeros in a small file: no more than was listed is written.
  Member zeros{"session.db", std::string(64 << 20, '\0')};
  Pack({session_}, {zeros});
  EXPECT_LT(std::filesystem::file_size(path_), 1u << 20);
  EXPECT_THAT(WhyRefused(), HasSubstr("not what the manifest lists"));
  Pack({{"manifest.json", std::string(kMaxManifestBytes + 1, ' ')}});
  EXPECT_THAT(WhyRefused(), HasSubstr("its manifest has 1048577 bytes"));
  std::vector<Member> many;
  for (size_t k = 0; k <= kMaxBundleFiles; ++k) many.push_back({"models/" + std::to_string(k), ""});
  Pack(many, {});
  EXPECT_THAT(WhyRefused(), HasSubstr("at most 256"));
}

}  // namespace
}  // namespace touchstone::gateway::bundle
