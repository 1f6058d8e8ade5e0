// Trees of files as the kernel shows them to processes of systemd, Slurm and containers.
#include "server/base/process/memory_limit.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "server/base/test_folder.h"

namespace touchstone {
namespace {

constexpr uint64_t kMib = 1 << 20;
constexpr uint64_t kNone = std::numeric_limits<uint64_t>::max();
constexpr char kV2Mount[] =
    "29 23 0:26 / /sys/fs/cgroup rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate,memory_recursiveprot\n";
constexpr char kV1Mount[] =
    "36 25 0:31 / /sys/fs/cgroup/memory rw,nosuid shared:17 master:3 - cgroup cgroup rw,memory\n";

class CgroupMemory : public testing::Test {
 protected:
  void Write(const std::string& path, const std::string& text) {
    const std::filesystem::path whole = root_.path() + path;
    std::filesystem::create_directories(whole.parent_path());
    std::ofstream(whole) << text;
  }
  void Limit(const std::string& path, uint64_t bytes) { Write(path, std::to_string(bytes) + "\n"); }
  void Process(const std::string& groups, const std::string& mounts) {
    Write("/proc/self/cgroup", groups);
    Write("/proc/self/mountinfo", "24 1 8:1 / / rw,relatime - ext4 /dev/sda1 rw\n" + mounts);
  }
  uint64_t Bytes() const { return CgroupMemoryBytes(root_.path()); }

  TestFolder root_;
};

TEST_F(CgroupMemory, IsTheSmallestLimitOfTheOwnGroup) {
  struct Case {
    const char *why, *group, *mounts, *folder;
    uint64_t max_mib, high_mib, limit_mib;  // high: 0: none
  };
  for (const Case& c :
       {Case{"a service of systemd", "/system.slice/touchstone-server.service", kV2Mount,
             "/sys/fs/cgroup/system.slice/touchstone-server.service", 600, 0, 600},
        Case{"held up from its memory.high on", "/a", kV2Mount, "/sys/fs/cgroup/a", 600, 400, 400},
        Case{"a mount with a blank in its name", "/a:b",
             "29 23 0:26 / /mnt/own\\040groups rw - cgroup2 none rw\n", "/mnt/own groups/a:b", 90, 0, 90}}) {
    Process(std::string("0::") + c.group + "\n", c.mounts);
    Limit(std::string(c.folder) + "/memory.max", c.max_mib * kMib);
    if (c.high_mib > 0) Limit(std::string(c.folder) + "/memory.high", c.high_mib * kMib);
    Write(std::filesystem::path(c.folder).parent_path().string() + "/memory.max", "max\n");
    EXPECT_EQ(Bytes(), c.limit_mib * kMib) << c.why;
  }
}

TEST_F(CgroupMemory, IsTheSmallestOfAllGroupsAround) {
  Process("0::/system.slice/slurmstepd.scope/job_7/step_0/user/task_0\n", kV2Mount);
  const std::string job = "/sys/fs/cgroup/system.slice/slurmstepd.scope/job_7";
  Write(job + "/step_0/user/task_0/memory.max", "max\n");
  Limit(job + "/step_0/memory.max", 900 * kMib);
  Limit(job + "/memory.max", 700 * kMib);
  Limit("/sys/fs/cgroup/memory.max", 2000 * kMib);
  EXPECT_EQ(Bytes(), 700 * kMib);
  Limit("/sys/fs/cgroup/system.slice/memory.max", 500 * kMib);
  EXPECT_EQ(Bytes(), 500 * kMib);
}

TEST_F(CgroupMemory, IsFoundInVersion1AmongOtherControllers) {
  Process("9:cpuset:/\n5:blkio,memory:/slurm/uid_0/job_7/step_0\n1:name=systemd:/other\n",
          "30 25 0:30 / /sys/fs/cgroup/cpuset rw - cgroup cgroup rw,cpuset\n"
          "36 25 0:31 / /sys/fs/cgroup/blkio,memory rw - cgroup cgroup rw,blkio,memory\n");
  const std::string top = "/sys/fs/cgroup/blkio,memory";
  Limit(top + "/memory.limit_in_bytes", 9223372036854771712u);
  Limit(top + "/slurm/uid_0/job_7/memory.limit_in_bytes", 600 * kMib);
  Limit(top + "/slurm/uid_0/job_7/step_0/memory.limit_in_bytes", 9223372036854771712u);
  Limit("/sys/fs/cgroup/cpuset/memory.limit_in_bytes", 1 * kMib);
  EXPECT_EQ(Bytes(), 600 * kMib);
}

TEST_F(CgroupMemory, IsFoundWhereBothVersionsStandBesideOneAnother) {
  const std::string mounts =
      kV1Mount + std::string("37 25 0:32 / /sys/fs/cgroup/unified rw - cgroup2 cgroup2 rw\n");
  Process("4:memory:/user.slice\n0::/user.slice/session-1.scope\n", mounts);
  Limit("/sys/fs/cgroup/memory/user.slice/memory.limit_in_bytes", 800 * kMib);
  Write("/sys/fs/cgroup/unified/user.slice/session-1.scope/cgroup.procs", "");
  EXPECT_EQ(Bytes(), 800 * kMib);
  Limit("/sys/fs/cgroup/unified/user.slice/memory.max", 300 * kMib);
  EXPECT_EQ(Bytes(), 300 * kMib);
}

TEST_F(CgroupMemory, OfANamespaceIsThatOfItsTop) {
  Process("0::/\n", kV2Mount);
  Limit("/sys/fs/cgroup/memory.max", 256 * kMib);
  EXPECT_EQ(Bytes(), 256 * kMib);
  Process("0::/inner\n", kV2Mount);
  EXPECT_EQ(Bytes(), 256 * kMib) << "a group within the container, without a limit of its own";
}

// Docker of version 1: the paths are those of the host, and only the container's own group is mounted.
TEST_F(CgroupMemory, OfAContainerWithoutANamespaceIsWhatIsMounted) {
  Process("4:memory:/docker/0123/sub\n",
          "36 25 0:31 /docker/0123 /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n");
  Limit("/sys/fs/cgroup/memory/memory.limit_in_bytes", 400 * kMib);
  EXPECT_EQ(Bytes(), 400 * kMib);
  Limit("/sys/fs/cgroup/memory/sub/memory.limit_in_bytes", 200 * kMib);
  EXPECT_EQ(Bytes(), 200 * kMib);
  // Another name, a name that begins alike, a group outside of the namespace.
  for (const char* group : {"/kubepods/77", "/docker/01234", "/../../elsewhere"}) {
    Process(std::string("4:memory:") + group + "\n",
            "36 25 0:31 /docker/0123 /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n");
    EXPECT_EQ(Bytes(), 400 * kMib) << group;
  }
  Process("0::/../sibling\n", kV2Mount);
  Limit("/sys/fs/cgroup/memory.max", 300 * kMib);
  EXPECT_EQ(Bytes(), 300 * kMib);
}

TEST_F(CgroupMemory, IsNoneWhereNothingLimitsIt) {
  EXPECT_EQ(Bytes(), kNone) << "without /proc";
  Process("", "");
  EXPECT_EQ(Bytes(), kNone) << "without groups";
  Process("0::/a\nnonsense\n", std::string("nonsense\n") + kV2Mount);
  Write("/sys/fs/cgroup/a/memory.max", "max\n");
  EXPECT_EQ(Bytes(), kNone);
}

TEST(MemoryLimit, IsAtMostThatOfThisProcess) {
  EXPECT_LE(MemoryLimitBytes(), CgroupMemoryBytes());
  EXPECT_GT(MemoryLimitBytes(), 64 * kMib);
}

}  // namespace
}  // namespace touchstone
