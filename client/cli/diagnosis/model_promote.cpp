// touchstone model promote|demote: a better model takes the place of another where data that it was not fitted to say so.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <filesystem>

#include "client/cli/diagnosis/comparison.h"
#include "client/cli/options/model_output.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"

namespace touchstone::cli {
namespace {

struct PromoteOptions : ComparisonOptions {
  std::string better, over, on, output;
};

// A model file with what it says of itself.
struct KnownModel {
  std::string text;
  model::Model model;
  model::Provenance provenance;
};

absl::StatusOr<KnownModel> ReadKnownModel(const std::string& path) {
  KnownModel known;
  TOUCHSTONE_ASSIGN_OR_RETURN(known.text, ReadFile(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      known.model, model::ParseModel(known.text, path, effects::Catalogue(), model::FilesBeside(path)));
  TOUCHSTONE_ASSIGN_OR_RETURN(known.provenance, model::ReadProvenance(known.text, path));
  return known;
}

// The whole file as it stands; one that needs a file beside it (a surface map) with that in it.
std::string WholeFile(const KnownModel& known) {
  const bool alone =
      std::none_of(known.model.effects.begin(), known.model.effects.end(),
                   [](const model::EffectInstance& one) { return one.effect->surface_map != nullptr; });
  return alone ? known.text : model::FormatModel(known.model) + model::FormatProvenance(known.provenance);
}

// An error where the set is one of those that the model was fitted to.
absl::Status CheckUnseen(const Cli& cli, const PromoteOptions& options, const model::Provenance& better,
                         const std::string& sha256) {
  for (const model::UsedSet& set : better.fitted_to)
    if (!sha256.empty() && set.sha256 == sha256)
      return absl::InvalidArgumentError(
          absl::StrCat("--on: ", options.on, " holds what ", options.better, " was fitted to (", set.set,
                       ", content ", sha256.substr(0, 12), "...): a set that it has not seen was expected"));
  if (better.fitted_to.empty())
    cli.Log(absl::StrCat("note: ", options.better,
                         " does not say what it was fitted to: that it has not seen ", options.on,
                         " cannot be checked"));
  else if (sha256.empty())
    cli.Log(absl::StrCat("note: of the stored photographs ", options.on, " it is not known here whether ",
                         options.better, " has seen them"));
  return absl::OkStatus();
}

std::string Milliseconds(double us) {
  return absl::StrFormat("%.3g ms", us / 1000);
}

absl::Status NotPromoted(const PromoteOptions& options, const v1::DataReport& data) {
  const v1::ModelComparison& versus = data.versus();
  return absl::FailedPreconditionError(
      absl::StrCat(options.better, " is not promoted over ", options.over, ": on ", options.on, " (",
                   data.count(), " touches) its error is ", Milliseconds(versus.other().rmse()),
                   ", and that of ", options.over, " ", Milliseconds(data.initial().rmse()),
                   "; the 95 % interval of the difference, ", Milliseconds(versus.lower()), " to ",
                   Milliseconds(versus.upper()), versus.lower() > 0 ? ", lies above 0" : ", holds 0"));
}

// The report, and the hash of what was measured.
absl::StatusOr<std::pair<v1::Report, std::string>> CompareOn(const Cli& cli, const PromoteOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  v1::CompareRequest request;
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::Report report,
                              comparison->Run<v1::CompareResponse>([&](grpc::ClientContext* context) {
                                *request.mutable_evidence() = comparison->evidence();
                                *request.mutable_other_model() = *comparison->other_model();
                                return comparison->connection().diagnosis().Compare(context, request);
                              }));
  return std::pair(std::move(report), comparison->content_sha256());
}

absl::Status RunPromote(const Cli& cli, PromoteOptions options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(KnownModel better, ReadKnownModel(options.better));
  TOUCHSTONE_ASSIGN_OR_RETURN(const KnownModel over, ReadKnownModel(options.over));
  if (better.model.Hash() == over.model.Hash())
    return absl::InvalidArgumentError(absl::StrCat(options.better, " has the same physics as ", options.over,
                                                   " (hash ", over.model.Hash().substr(0, 12),
                                                   "): there is nothing to promote"));
  options.sets = {options.on};
  options.models = {options.over, options.better};
  options.with_content_hash = true;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto compared, CompareOn(cli, options));
  const auto& [report, sha256] = compared;
  TOUCHSTONE_RETURN_IF_ERROR(CheckUnseen(cli, options, better.provenance, sha256));
  if (report.data_size() == 0 || !report.data(0).has_versus())
    return absl::InvalidArgumentError(
        absl::StrCat("--on: ", options.on, ": no touch could be compared under both models"));
  const v1::DataReport& data = report.data(0);
  const v1::ModelComparison& versus = data.versus();
  if (!(versus.upper() < 0)) return NotPromoted(options, data);

  model::Provenance provenance = better.provenance;
  provenance.over_name = over.model.name;
  provenance.over_hash = over.model.Hash();
  model::Promotion& promotion = provenance.promotion.emplace();
  promotion.on = {options.on, sha256, data.unit(), data.initial().rmse(), versus.other().rmse()};
  promotion.lower = versus.lower();
  promotion.upper = versus.upper();
  promotion.hash = better.model.Hash();
  promotion.before = WholeFile(over);
  if (!options.output.empty() && !IsStandardOutput(options.output))
    better.model.name = std::filesystem::path(options.output).stem().string();
  TOUCHSTONE_RETURN_IF_ERROR(
      model::ParseModel(model::FormatModel(better.model), options.output, effects::Catalogue()).status());
  TOUCHSTONE_RETURN_IF_ERROR(WriteModel(cli, "-o", options.output, better.model, provenance));
  cli.Log(absl::StrCat("promoted over ", options.over, ": ", versus.words()));
  if (!options.output.empty()) cli.LogWritten(options.output);
  return absl::OkStatus();
}

absl::Status RunDemote(const Cli& cli, const PromoteOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const KnownModel promoted, ReadKnownModel(options.better));
  if (!promoted.provenance.promotion)
    return absl::InvalidArgumentError(absl::StrCat(
        options.better, " was not promoted over another model: it holds none that could be restored"));
  const std::string& before = promoted.provenance.promotion->before;
  const std::string place = absl::StrCat(options.better, ": provenance.promoted.before");
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model restored,
                              model::ParseModel(before, place, effects::Catalogue()));
  const std::string& over = promoted.provenance.over_hash;
  if (!over.empty() && restored.Hash() != over)
    return absl::FailedPreconditionError(
        absl::StrCat(place, " was changed: its model has the hash ", restored.Hash().substr(0, 12),
                     ", and the one before had ", over.substr(0, 12), "; nothing is written"));
  const std::string &hash = promoted.provenance.promotion->hash, now = promoted.model.Hash();
  if (!hash.empty() && hash != now)
    cli.Log(absl::StrCat("note: ", options.better, " was changed since it was promoted (hash ",
                         now.substr(0, 12), ", promoted ", hash.substr(0, 12),
                         "): the change is not in what is restored"));
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, before));
  if (!options.output.empty())
    cli.LogWritten(options.output, absl::StrCat(" (", promoted.provenance.over_name, ", as it was before)"));
  return absl::OkStatus();
}

}  // namespace

void AddModelPromote(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<PromoteOptions>();
  options->takes_sets = options->takes_models = options->set_required = false;
  options->max_models = 2;
  CLI::App* promote = cli->AddCommand(
      group, "promote",
      "Lets a better model take the place of another only if a set that it was not fitted to says so: the 95 "
      "% "
      "interval of the difference of their errors, over poses, must lie below 0. What it was compared with, "
      "and "
      "the model before, are kept in the file.",
      "touchstone diagnose monday.csv --model rig.yaml --mesh-dir meshes --save-model better.yaml\n"
      "touchstone model promote better.yaml --over rig.yaml --on friday.csv --mesh-dir meshes -o rig2.yaml",
      [cli, options] { return RunPromote(*cli, *options); });
  const auto add = [&](CLI::App* command, const std::string& name, std::string* value,
                       const std::string& type, const std::string& text) {
    cli->AddInput(command, command->add_option(name, *value, text)->type_name(type)->required());
  };
  const char* const kOutputText = "The file to write. Default: stdout";
  add(promote, "BETTER", &options->better, "", "The better model, a file");
  add(promote, "--over", &options->over, "MODEL", "The model file whose place it takes");
  add(promote, "--on", &options->on, "SET",
      "Touches that BETTER was not fitted to: a measurement file, a journal");
  cli->AddOutput(promote, "-o,--output", &options->output, kOutputText);
  AddComparisonOptions(cli, promote, options.get(), /*html=*/false);

  auto undone = std::make_shared<PromoteOptions>();
  CLI::App* demote = cli->AddCommand(group, "demote", "Restores the model whose place a promoted one took.",
                                     "touchstone model demote rig2.yaml -o rig.yaml",
                                     [cli, undone] { return RunDemote(*cli, *undone); });
  add(demote, "PROMOTED", &undone->better, "", "A model file that `touchstone model promote` wrote");
  cli->AddOutput(demote, "-o,--output", &undone->output, kOutputText);
}

}  // namespace touchstone::cli
