// touchstone dataset: datasets that were written as files.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "client/cli/common/common.h"
#include "client/cli/common/progress_bar.h"
#include "client/source/dataset/dataset_check.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr size_t kMostNamed = 5;

struct VerifyOptions {
  std::string folder;
};

// "shard-000001.tar, shard-000004.tar and 12 more".
std::string Named(const std::vector<std::string>& names) {
  const size_t shown = std::min(kMostNamed, names.size());
  std::string text = absl::StrJoin(names.begin(), names.begin() + shown, ", ");
  if (names.size() > shown) absl::StrAppend(&text, " and ", names.size() - shown, " more");
  return text;
}

absl::Status RunVerify(const Cli& cli, const VerifyOptions& options) {
  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(const client::DatasetCheck check,
                              client::CheckDataset(options.folder, [&](uint64_t done, uint64_t all) {
                                bar.ShowStage("reading", static_cast<double>(done) / all);
                              }));
  bar.Clear();
  if (cli.output().json)
    PrintJson({{"folder", options.folder},
               {"whole", check.Whole()},
               {"samples", check.samples},
               {"shards", check.shards},
               {"shards_whole", check.shards_whole},
               {"missing", check.missing},
               {"changed", check.changed},
               {"unlisted", check.unlisted}});
  if (check.Whole()) {
    cli.Log(absl::StrCat(options.folder, ": ", check.samples, " samples in ",
                         Counted(check.shards, "shard", "shards"), ", every byte as it was written"));
    return absl::OkStatus();
  }
  std::vector<std::string> wrong;
  if (!check.changed.empty()) wrong.push_back(Named(check.changed));
  if (!check.unlisted.empty())
    wrong.push_back(absl::StrCat(Named(check.unlisted), ": no dataset.json says what was written there"));
  if (!check.missing.empty())
    wrong.push_back(absl::StrCat(Counted(check.missing.size(), "shard is", "shards are"),
                                 " missing: ", Named(check.missing)));
  return absl::DataLossError(
      absl::StrCat(options.folder, ": ", check.shards_whole, " of ", check.shards, " shards are whole; ",
                   absl::StrJoin(wrong, "; "),
                   ". Delete what was changed, and run the command that made the dataset "
                   "again: it makes what is missing"));
}

}  // namespace

void AddDataset(Cli* cli) {
  CLI::App* group = cli->AddGroup("dataset", "Datasets that `touchstone stream` wrote as files.",
                                  "touchstone dataset verify training");
  auto options = std::make_shared<VerifyOptions>();
  CLI::App* verify =
      cli->AddCommand(group, "verify",
                      "Reads every shard of a dataset and says whether its bytes are those that were "
                      "written. Exit code 4 if not.",
                      "touchstone dataset verify training\ntouchstone dataset verify training --json",
                      [cli, options] { return RunVerify(*cli, *options); });
  verify->add_option("FOLDER", options->folder, "The folder with the dataset.json")
      ->type_name("")
      ->required();
}

}  // namespace touchstone::cli
