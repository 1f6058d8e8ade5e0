#include "server/service/sessions/session_store.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::service {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kSet[] = "object,t_0_us,t_1_us\ncup,1,0\ncup,2,0\n";
constexpr char kOther[] = "object,t_0_us,t_1_us\ncup,3,0\n";

// The same facts for a store in memory and one in a folder.
class SessionStoreTest : public ::testing::TestWithParam<bool> {
 protected:
  SessionStoreTest() {
    if (GetParam()) options_.sessions_dir = folder_;
  }

  std::unique_ptr<SessionStore> Open() {
    auto store = SessionStore::Open(options_);
    EXPECT_TRUE(store.ok()) << store.status();
    return *std::move(store);
  }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  ServerOptions options_;
};
INSTANTIATE_TEST_SUITE_P(MemoryAndFolder, SessionStoreTest, ::testing::Bool());

TEST_P(SessionStoreTest, KeepsWhatItWasGiven) {
  const auto store = Open();
  const auto created = store->Create("monday", kSet);
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->hash(), Sha256Hex(kSet));
  EXPECT_EQ(created->touches(), 2u);
  EXPECT_EQ(created->fingers(), 2u);
  EXPECT_FALSE(created->has_poses());
  EXPECT_EQ(store->Find("monday")->SerializeAsString(), created->SerializeAsString());
  EXPECT_EQ(**store->Bytes("monday"), kSet);
  std::string exported;
  EXPECT_TRUE(store
                  ->Export("monday",
                           [&](const std::string&, absl::string_view piece) {
                             exported.append(piece.data(), piece.size());
                             return true;
                           })
                  .ok());
  EXPECT_EQ(exported, kSet);
  EXPECT_EQ(store->Names().size(), 1u);
  EXPECT_TRUE(store->Delete("monday").ok());
  EXPECT_THAT(store->Names(), IsEmpty());
  EXPECT_TRUE(absl::IsNotFound(store->Delete("monday")));
  EXPECT_TRUE(absl::IsNotFound(store->Bytes("monday").status()));
}

TEST_P(SessionStoreTest, ANameNeverChangesItsMeaning) {
  const auto store = Open();
  ASSERT_TRUE(store->Create("monday", kSet).ok());
  EXPECT_TRUE(store->Create("monday", kSet).ok());
  EXPECT_TRUE(absl::IsAlreadyExists(store->Create("monday", kOther).status()));
  EXPECT_EQ(**store->Bytes("monday"), kSet);
}

TEST_P(SessionStoreTest, OfManyWhoWantANameAtOnceOneGetsIt) {
  const auto store = Open(), replica = GetParam() ? Open() : nullptr;
  std::atomic<int> taken{0};
  std::vector<std::thread> threads;
  for (int k = 0; k < 8; ++k)
    threads.emplace_back([&, k] {
      SessionStore& one = replica != nullptr && k % 2 == 0 ? *replica : *store;
      taken += one.Create("race", absl::StrCat("object,t_0_us\ncup,", k, "\n")).ok();
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(taken, 1);
  EXPECT_EQ(store->Names().size(), 1u);
}

TEST_P(SessionStoreTest, RefusesNamesFilesAndPlansThatAreNone) {
  const auto store = Open();
  for (const char* name : {"", ".", "..", ".hidden", "a/b", "a b", "ä"})
    EXPECT_TRUE(absl::IsInvalidArgument(store->Create(name, kSet).status())) << name;
  EXPECT_TRUE(absl::IsInvalidArgument(store->Create(std::string(65, 'a'), kSet).status()));
  EXPECT_TRUE(store->Create(std::string(64, 'a'), kSet).ok());
  EXPECT_THAT(std::string(store->Create("x", "object,t_0_us\ncup,nan\n").status().message()),
              HasSubstr("x:2: column t_0_us"));
  EXPECT_THAT(
      std::string(store
                      ->Create("x",
                               "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,"
                               "approach_x,approach_y,approach_z,lateral_x,lateral_y,lateral_z\n"
                               "0,cup,20,60,0,0,0,0,0,-1,1,0,0\n")
                      .status()
                      .message()),
      HasSubstr("it is a plan"));
}

TEST_P(SessionStoreTest, KeepsItsLimits) {
  options_.max_session_mib = 1;
  options_.max_sessions_mib = 1;
  const auto store = Open();
  std::string large = "object,t_0_us\n";
  while (large.size() < 700'000) absl::StrAppend(&large, "cup,", large.size(), "\n");
  ASSERT_TRUE(store->Create("large", large).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(store->Create("second", large + "cup,1\n").status()));
  EXPECT_TRUE(store->Create("small", kSet).ok());

  SessionStore::Upload upload(store.get());
  EXPECT_TRUE(upload.Append("", large).ok());
  EXPECT_THAT(std::string(upload.Append("", large).message()), HasSubstr("max_session_mib"));
  SessionStore::Upload beside(store.get());
  EXPECT_TRUE(absl::IsResourceExhausted(beside.Append("", large)));
}

TEST(SessionStoreFolder, IsSharedByReplicasAndLeavesStrangeFilesAlone) {
  const TestFolder folder;
  ServerOptions options;
  options.sessions_dir = folder.path();
  const auto one = *SessionStore::Open(options), two = *SessionStore::Open(options);
  ASSERT_TRUE(one->Create("monday", kSet).ok());
  EXPECT_EQ(two->Find("monday")->hash(), Sha256Hex(kSet));
  EXPECT_TRUE(absl::IsAlreadyExists(two->Create("monday", kOther).status()));
  ASSERT_TRUE(two->Delete("monday").ok());
  EXPECT_TRUE(absl::IsNotFound(one->Find("monday").status()));
  ASSERT_TRUE(two->Create("monday", kOther).ok());
  EXPECT_EQ(one->Find("monday")->hash(), Sha256Hex(kOther));

  std::ofstream(options.sessions_dir + "/broken.csv") << "no measurement file";
  std::ofstream(options.sessions_dir + "/notes.txt") << "notes";
  EXPECT_THAT(one->Names(), ElementsAre("broken", "monday"));
  EXPECT_FALSE(one->Find("broken").ok());
  std::filesystem::remove_all(options.sessions_dir);
}

}  // namespace
}  // namespace touchstone::service
