#include "client/cli/options/slurm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(SlurmIndices, JoinsNeighbours) {
  EXPECT_EQ(SlurmIndices({0, 1, 2, 3}), "0-3");
  EXPECT_EQ(SlurmIndices({0, 2, 3, 9}), "0,2-3,9");
  EXPECT_EQ(SlurmIndices({5}), "5");
}

TEST(WithoutSlurm, KeepsEveryOtherWord) {
  EXPECT_THAT(
      WithoutSlurm({"stream", "--slurm", "--slurm-option", "--partition=gpu", "--samples", "10",
                    "--slurm-tasks=4", "--slurm-option=--time=5", "--restart", "--out", "--slurm-dir"}),
      ElementsAre("stream", "--samples", "10", "--out", "--slurm-dir"));
}

TEST(SlurmScript, QuotesWhatAShellWouldRead) {
  SlurmArray array;
  array.program = "/opt/tool box/touchstone";
  array.arguments = {"stream", "--model", "it's.yaml"};
  array.folder = "/data/50% done";
  array.tasks = 8;
  array.indices = {1, 2, 7};
  array.options = {"--partition=gpu"};
  const std::string script = SlurmScript(array);
  EXPECT_THAT(script, HasSubstr("\n'/opt/tool box/touchstone' stream --model 'it'\\''s.yaml' --shards "
                                "\"$SLURM_ARRAY_TASK_ID/8\"\n"));
  EXPECT_THAT(script, HasSubstr("\n#SBATCH --array=1-2,7\n"));
  EXPECT_THAT(script, HasSubstr("\n#SBATCH --output=\"/data/50%% done/slurm/%a.log\"\n"));
  EXPECT_THAT(script, HasSubstr("\n#SBATCH --partition=gpu\n"));
  EXPECT_THAT(script, Not(HasSubstr("--threads")));
}

TEST(SlurmScript, ASourceInTheTaskHasTheCoresOfTheTask) {
  SlurmArray array;
  array.program = "touchstone";
  array.tasks = 1;
  array.indices = {0};
  array.limit_threads = true;
  EXPECT_THAT(SlurmScript(array), HasSubstr("--threads \"${SLURM_CPUS_ON_NODE:-0}\""));
}

}  // namespace
}  // namespace touchstone::cli
