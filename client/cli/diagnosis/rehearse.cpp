// touchstone rehearse: how well a diagnosis of such a plan does, by sets in which something is hidden.
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "client/cli/diagnosis/comparison.h"
#include "client/cli/diagnosis/rehearsal.h"
#include "client/cli/diagnosis/rehearsal_state.h"
#include "client/cli/diagnosis/rehearsed_files.h"
#include "client/source/dataset/measurement_csv.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"

namespace touchstone::cli {
namespace {

struct RehearseOptions : ComparisonOptions {
  std::optional<uint32_t> sets;
  double minutes = 10;
  std::string size = "1";
  std::string effects;
  uint32_t pairs = 2;
  std::string state;
  GeneratorOptions generator;
};

absl::StatusOr<HiddenSize> ParseSize(const std::string& text) {
  HiddenSize size;
  if (text == "found") {
    size.found = true;
    return size;
  }
  char* end = nullptr;
  size.times_typical = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(size.times_typical > 0) || !std::isfinite(size.times_typical))
    return absl::InvalidArgumentError(absl::StrCat(
        "--size: '", text, "'; a positive number (times what rigs usually show) or 'found' was expected"));
  return size;
}

std::string SharePercent(int count, int of) {
  if (of == 0) return "-";
  const Interval95 interval = IntervalOf(count, of);
  return absl::StrFormat("%.0f %% (%.0f-%.0f)", 100.0 * count / of, 100 * interval.lower,
                         100 * interval.upper);
}

std::string SummaryText(const std::vector<RehearsalRow>& rows, const std::string& generator,
                        const std::vector<std::string>& left_out) {
  Table table(
      {"HIDDEN", "SETS", "FOUND", "CHECK SAYS", "RIGHT", "CONFIDENTLY WRONG", "COVERAGE", "BIAS", "SPREAD"});
  for (const RehearsalRow& row : rows) {
    if (row.sets == 0) continue;
    table.Add({row.name, absl::StrCat(row.sets), SharePercent(row.found, row.sets),
               row.predicted < 0 ? "" : absl::StrFormat("%.0f %%", 100 * row.predicted),
               SharePercent(row.right, row.sets), SharePercent(row.confident, row.sets),
               row.values == 0 ? "" : SharePercent(row.covered, row.values),
               row.values == 0 ? "" : absl::StrFormat("%+.2f", row.mean_z),
               row.values < 2 ? "" : absl::StrFormat("%.2f", row.spread_z)});
  }
  return absl::StrCat(
      table.Text(),
      "\nIn brackets: 95 % intervals. Coverage: hidden values within the 95 % interval that "
      "was reported. Bias and spread: of\n"
      "(value - truth) / standard error; 0 and 1 are right. ",
      generator.empty() ? "The simulation that hides is the one that diagnoses: what it\n"
                          "lacks altogether, this does not show.\n"
                        : absl::StrCat("The sets were made by ", generator, ".\n"),
      left_out.empty() ? ""
                       : absl::StrCat("It cannot hide and left out: ", absl::StrJoin(left_out, ", "), ".\n"));
}

Json SummaryJson(const std::vector<RehearsalRow>& rows) {
  Json list = Json::array();
  for (const RehearsalRow& row : rows) {
    const Interval95 found = IntervalOf(row.found, row.sets), confident = IntervalOf(row.confident, row.sets);
    Json entry = {{"hidden", row.name},
                  {"sets", row.sets},
                  {"found", row.found},
                  {"found_95", {found.lower, found.upper}},
                  {"right", row.right},
                  {"honest", row.honest},
                  {"confidently_wrong", row.confident},
                  {"confidently_wrong_95", {confident.lower, confident.upper}},
                  {"values", row.values},
                  {"covered", row.covered},
                  {"mean_z", row.mean_z},
                  {"spread_z", row.spread_z}};
    if (row.predicted >= 0) entry["predicted_power"] = row.predicted;
    list.push_back(std::move(entry));
  }
  return list;
}

// One rehearsal: the plan, what is hidden, and the diagnoses.
class Rehearsal {
 public:
  Rehearsal(const Cli& cli, const RehearseOptions& options, Comparison* comparison)
      : cli_(cli), options_(options), comparison_(comparison) {}

  absl::Status Prepare() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const HiddenSize size, ParseSize(options_.size));
    TOUCHSTONE_RETURN_IF_ERROR(ReadPlans());
    if (options_.generator.program.empty()) {
      files_ = SimulatedFiles(&comparison_->connection());
    } else {
      GeneratorOptions generator = options_.generator;
      generator.meshes = comparison_->meshes();
      TOUCHSTONE_ASSIGN_OR_RETURN(files_, GeneratedFiles(generator));
    }
    v1::CheckRequest request;
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Report check,
                                comparison_->Run<v1::CheckResponse>([&](grpc::ClientContext* context) {
                                  *request.mutable_evidence() = comparison_->evidence();
                                  return comparison_->connection().diagnosis().Check(context, request);
                                }));
    v1::GetModelRequest get;
    *get.mutable_model() = comparison_->evidence().model();
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Model given,
                                comparison_->connection().Call(&v1::Models::Stub::GetModel, get));
    TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model,
                                model::ParseModel(given.yaml(), "the model", effects::Catalogue()));
    const std::vector<std::string> only =
        options_.effects.empty() ? std::vector<std::string>() : absl::StrSplit(options_.effects, ',');
    TOUCHSTONE_ASSIGN_OR_RETURN(cases_, ListCases(model, check, size, only, static_cast<int>(options_.pairs),
                                                  options_.seed, static_cast<int>(plans_.size())));
    std::vector<std::string> names;
    for (const RehearsedCase& one : cases_) names.push_back(one.name);
    std::string plans = comparison_->evidence().csv();
    for (const v1::Evidence& further : comparison_->further()) plans += further.csv();
    Json of = {{"rehearsal", 1},        {"plan", Sha256Hex(plans)}, {"model", given.hash()},
               {"size", options_.size}, {"seed", options_.seed},    {"cases", names}};
    if (!options_.generator.program.empty()) of["generator"] = options_.generator.program;
    TOUCHSTONE_ASSIGN_OR_RETURN(state_, RehearsalState::Open(options_.state, of));
    return absl::OkStatus();
  }

  // Set n hides case n mod cases, under a seed of its own: the same whatever was interrupted before.
  absl::Status Run() {
    const auto begin = std::chrono::steady_clock::now();
    const auto minutes = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / 60;
    };
    const size_t wanted = options_.sets ? *options_.sets : SIZE_MAX;
    ProgressBar bar(!cli_.output().quiet);
    const size_t first = state_.sets().size();
    for (size_t n = first; n < wanted && (options_.sets || minutes() < options_.minutes); ++n) {
      const RehearsedCase& hidden = cases_[n % cases_.size()];
      // Of a time that was given, a set is as large a share as those before it were.
      const double sets = options_.sets.value_or(0);
      const double share = sets > 0 ? static_cast<double>(n) / sets : minutes() / options_.minutes;
      const double made = static_cast<double>(n - first);
      const double next = sets > 0 ? (static_cast<double>(n) + 1) / sets
                                   : std::min(1.0, made > 0 ? share * (made + 1) / made : share);
      bar.SetPart(absl::StrCat("set ", n + 1, ", ", hidden.name, " hidden"), share, next);
      bar.ShowStage("touching");
      v1::DiagnoseRequest request;
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool touched, Touch(hidden, n, &request));
      if (!touched) {
        RehearsedSet left_out;
        left_out.name = hidden.name, left_out.left_out = true;
        TOUCHSTONE_RETURN_IF_ERROR(state_.Add(left_out));
        if (NothingIsMade())
          return absl::FailedPreconditionError(
              absl::StrCat("--generator: ", options_.generator.program, " hides none of the ", cases_.size(),
                           " cases (exit status ", kCannotHide, " for each)"));
        continue;
      }
      TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Report report,
                                  comparison_->Run<v1::DiagnoseResponse>(
                                      [&](grpc::ClientContext* context) {
                                        return comparison_->connection().diagnosis().Diagnose(context,
                                                                                              request);
                                      },
                                      &bar));
      TOUCHSTONE_RETURN_IF_ERROR(state_.Add(Assess(hidden, report)));
    }
    return absl::OkStatus();
  }

  std::vector<RehearsalRow> Rows() const { return Summarise(cases_, state_.sets()); }
  // Cases that the generator does not hide.
  std::vector<std::string> LeftOut() const {
    std::vector<std::string> names;
    for (const RehearsedCase& one : cases_)
      if (std::any_of(state_.sets().begin(), state_.sets().end(),
                      [&](const RehearsedSet& set) { return set.left_out && set.name == one.name; }))
        names.push_back(one.name);
    return names;
  }

 private:
  absl::Status ReadPlans() {
    const auto read = [this](const v1::Evidence& evidence) -> absl::Status {
      if (evidence.csv().empty())
        return absl::InvalidArgumentError("PLAN: a measurement file or plan (CSV) of touches was expected");
      TOUCHSTONE_ASSIGN_OR_RETURN(plans_.emplace_back(),
                                  client::ParseMeasurements(evidence.csv(), evidence.origin()));
      if (plans_.back().empty())
        return absl::InvalidArgumentError(absl::StrCat("PLAN: ", evidence.origin(), " has no touch"));
      return absl::OkStatus();
    };
    TOUCHSTONE_RETURN_IF_ERROR(read(comparison_->evidence()));
    for (const v1::Evidence& further : comparison_->further()) TOUCHSTONE_RETURN_IF_ERROR(read(further));
    return absl::OkStatus();
  }

  // The sessions of set n; false: the case cannot be hidden.
  absl::StatusOr<bool> Touch(const RehearsedCase& hidden, size_t n, v1::DiagnoseRequest* request) {
    *request->mutable_evidence() = comparison_->evidence();
    request->mutable_evidence()->set_seed(options_.seed + n);
    *request->mutable_further() = {comparison_->further().begin(), comparison_->further().end()};
    const int sessions = static_cast<int>(plans_.size());
    for (int session = 0; session < sessions; ++session) {
      // Sets of one session have the seeds that they always had.
      const uint64_t seed = options_.seed + 1 + n + (static_cast<uint64_t>(session) << 32);
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<std::string> csv,
                                  files_->Make({&plans_[session], &hidden, session, sessions, seed}));
      if (!csv) return false;
      v1::Evidence* evidence =
          session == 0 ? request->mutable_evidence() : request->mutable_further(session - 1);
      const bool mistaken = hidden.is_mistake && session == sessions - 1;
      evidence->set_csv(mistaken ? WithFingersExchanged(*csv) : *csv);
    }
    return true;
  }

  // A round of all cases, and no set.
  bool NothingIsMade() const {
    const std::vector<RehearsedSet>& sets = state_.sets();
    return sets.size() >= cases_.size() &&
           std::all_of(sets.begin(), sets.end(), [](const RehearsedSet& set) { return set.left_out; });
  }

  const Cli& cli_;
  const RehearseOptions& options_;
  Comparison* comparison_;
  std::vector<std::vector<client::MeasuredTouch>> plans_;  // one per session
  std::unique_ptr<RehearsedFiles> files_;
  std::vector<RehearsedCase> cases_;
  RehearsalState state_;
};

absl::Status RunRehearse(const Cli& cli, const RehearseOptions& options) {
  if (options.sets == 0u)
    return absl::InvalidArgumentError("--sets: 0 is out of range; 1 or more was expected");
  if (!(options.minutes > 0))
    return absl::InvalidArgumentError(
        absl::StrCat("--minutes: ", options.minutes, "; a positive number was expected"));
  if (!(options.generator.limit_s > 0) || !std::isfinite(options.generator.limit_s))
    return absl::InvalidArgumentError(
        absl::StrCat("--generator-limit-s: ", options.generator.limit_s, "; a positive number was expected"));
  if (options.generator.program.empty() && options.generator.limit_s != kGeneratorLimitS)
    return absl::InvalidArgumentError("--generator-limit-s: of what generator? Give --generator PROGRAM");
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  Rehearsal rehearsal(cli, options, comparison.get());
  TOUCHSTONE_RETURN_IF_ERROR(rehearsal.Prepare());
  const absl::Status run = rehearsal.Run();
  // What was done before an interruption is said all the same.
  if (!run.ok() && !absl::IsCancelled(run)) return run;
  const std::vector<RehearsalRow> rows = rehearsal.Rows();
  if (!options.json.empty())
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.json, SummaryJson(rows).dump(2) + "\n"));
  if (!options.ReportOnStdout())
    TOUCHSTONE_RETURN_IF_ERROR(cli.Print(SummaryText(rows, options.generator.program, rehearsal.LeftOut())));
  return run;
}

}  // namespace

void AddRehearse(Cli* cli) {
  auto options = std::make_shared<RehearseOptions>();
  options->set_name = "PLAN";
  options->max_sets = kMaxSessions;
  options->set_text = absl::StrCat(kPlanText, ". Several: sessions of one rig, diagnosed together");
  CLI::App* command = cli->AddCommand(
      nullptr, "rehearse",
      "Hides effects, pairs, a cause of no catalogue, a mistake and nothing in simulated sets of your own "
      "plan, diagnoses "
      "each, and says how often the answer is right.",
      "touchstone rehearse plan.csv --model rig.yaml --minutes 5\n"
      "touchstone rehearse plan.csv --model rig.yaml --sets 200 --state rehearsal.jsonl      goes on where "
      "it was stopped\n"
      "touchstone rehearse plan.csv --model rig.yaml --effects tip_radius,oblique_slip --size 0.1\n"
      "touchstone rehearse plan.csv --model rig.yaml --size found      at the sizes that `touchstone check` "
      "gives\n"
      "touchstone rehearse monday.csv friday.csv --model rig.yaml      is a change between them found?\n"
      "touchstone rehearse plan.csv --model rig.yaml --generator ./my_rig.py      the sets are your "
      "program's",
      [cli, options] { return RunRehearse(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
  cli->AddInput(
      command,
      command
          ->add_option(
              "--generator", options->generator.program,
              "A program that makes the sets, a path or a name in PATH: run once per session with "
              "--plan, --model, --output, --seed, --session, --sessions, --mesh and a --hide per effect "
              "(server/README.md). Default: this product's simulator")
          ->type_name("PROGRAM"));
  command
      ->add_option("--generator-limit-s", options->generator.limit_s,
                   "What the program may take for one file. Default: 60")
      ->type_name("SECONDS");
  command->add_option("--minutes", options->minutes, "Ends after so long. Default: 10")->type_name("MINUTES");
  command
      ->add_option("--sets", options->sets,
                   "Ends after so many sets, whatever the time. Default: by --minutes")
      ->type_name("N");
  command
      ->add_option(
          "--size", options->size,
          "Of a hidden effect, times what rigs usually show; found: where a check says 80 %. Default: 1")
      ->type_name("SIZE");
  command
      ->add_option("--effects", options->effects,
                   "Hide these only (and nothing, outside, mistake). Default: all")
      ->type_name("A,B");
  command->add_option("--pairs", options->pairs, "Pairs of effects among what is hidden. Default: 2")
      ->type_name("N");
  command
      ->add_option("--state", options->state,
                   "A file of the sets that are done: the same command goes on where it was stopped")
      ->type_name("FILE");
}

}  // namespace touchstone::cli
