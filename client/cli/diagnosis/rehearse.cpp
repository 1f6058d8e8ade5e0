// touchstone rehearse: how well a diagnosis of such a plan does, by sets in which something is hidden.
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "client/cli/diagnosis/comparison.h"
#include "client/cli/diagnosis/rehearsal.h"
#include "client/source/measurement_csv.h"
#include "client/source/session_parts.h"
#include "server/base/file_writer.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/effects/all_effects.h"

namespace touchstone::cli {
namespace {

struct RehearseOptions : ComparisonOptions {
  uint32_t sets = 0;
  double minutes = 10;
  std::string size = "1";
  std::string effects;
  uint32_t pairs = 2;
  std::string state;
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

// Rehearsed sets in a file, a line each, so that a rehearsal goes on where it was stopped. The first line says of what.
class RehearsalState {
 public:
  // Reads what there is. Error: it is of another rehearsal.
  static absl::StatusOr<RehearsalState> Open(const std::string& path, const Json& of) {
    RehearsalState state;
    state.path_ = path;
    if (path.empty()) return state;
    std::ifstream file(path);
    std::string line;
    for (int number = 1; std::getline(file, line); ++number) {
      const Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
      if (number == 1) {
        if (json != of)
          return absl::FailedPreconditionError(
              absl::StrCat("--state: ", path,
                           " is of another plan, model, seed or size; another file, or none, was expected"));
        continue;
      }
      if (json.is_discarded() && file.peek() == EOF) break;  // cut by what stopped it: made again
      absl::StatusOr<RehearsedSet> set = SetFromJson(json);
      if (!set.ok())
        return absl::Status(set.status().code(),
                            absl::StrCat(path, ":", number, ": ", set.status().message()));
      state.sets_.push_back(*std::move(set));
    }
    state.text_ = of.dump() + "\n";
    for (const RehearsedSet& set : state.sets_) absl::StrAppend(&state.text_, ToJson(set).dump(), "\n");
    TOUCHSTONE_RETURN_IF_ERROR(state.Write());
    return state;
  }

  absl::Status Add(RehearsedSet set) {
    sets_.push_back(std::move(set));
    if (path_.empty()) return absl::OkStatus();
    absl::StrAppend(&text_, ToJson(sets_.back()).dump(), "\n");
    return Write();
  }
  const std::vector<RehearsedSet>& sets() const { return sets_; }

 private:
  // Whole, beside what it replaces: what was rehearsed before outlives a disk that fails and a kill.
  absl::Status Write() const {
    const absl::Status written = WriteFileAtomically(path_, text_);
    return absl::Status(written.code(), written.ok() ? "" : absl::StrCat("--state: ", written.message()));
  }

  std::string path_, text_;  // where, and what stands there
  std::vector<RehearsedSet> sets_;
};

// The plan's touches under a model, as a measurement file.
absl::StatusOr<std::string> TouchPlan(const std::vector<client::MeasuredTouch>& plan,
                                      const RehearsedCase& hidden, uint64_t seed,
                                      client::Connection* connection) {
  std::vector<client::MeasuredTouch> measured = plan;
  constexpr size_t kPerRequest = 1000;
  for (size_t first = 0, stop = 0; first < measured.size(); first = stop) {
    v1::TouchRequest request = client::PartOfSession(measured, first, kPerRequest);
    stop = first + static_cast<size_t>(request.touches_size());
    request.mutable_model()->set_yaml(model::FormatModel(hidden.model));
    request.set_seed(seed);
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchResponse response,
                                connection->Call(&v1::Source::Stub::Touch, request));
    for (size_t k = first; k < stop; ++k) {
      const auto& time_s = response.results(static_cast<int>(k - first)).contact_time_s();
      measured[k].time_s.assign(time_s.begin(), time_s.end());
      if (hidden.is_mistake && measured[k].time_s.size() > 1)
        std::swap(measured[k].time_s[0], measured[k].time_s[1]);
    }
  }
  return client::FormatMeasurements(measured);
}

std::string SharePercent(int count, int of) {
  if (of == 0) return "-";
  const Interval95 interval = IntervalOf(count, of);
  return absl::StrFormat("%.0f %% (%.0f-%.0f)", 100.0 * count / of, 100 * interval.lower,
                         100 * interval.upper);
}

std::string SummaryText(const std::vector<RehearsalRow>& rows) {
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
  return absl::StrCat(table.Text(),
                      "\nIn brackets: 95 % intervals. Coverage: hidden values within the 95 % interval that "
                      "was reported. Bias and spread: of\n"
                      "(value - truth) / standard error; 0 and 1 are right. The simulation that hides is the "
                      "one that diagnoses: what it\n"
                      "lacks altogether, this does not show.\n");
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
    TOUCHSTONE_ASSIGN_OR_RETURN(
        plan_, client::ParseMeasurements(comparison_->evidence().csv(), comparison_->evidence().origin()));
    if (plan_.empty()) return absl::InvalidArgumentError("PLAN: has no touch");
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
    TOUCHSTONE_ASSIGN_OR_RETURN(
        cases_, ListCases(model, check, size, only, static_cast<int>(options_.pairs), options_.seed));
    std::vector<std::string> names;
    for (const RehearsedCase& one : cases_) names.push_back(one.name);
    const Json of = {{"rehearsal", 1},        {"plan", Sha256Hex(comparison_->evidence().csv())},
                     {"model", given.hash()}, {"size", options_.size},
                     {"seed", options_.seed}, {"cases", names}};
    TOUCHSTONE_ASSIGN_OR_RETURN(state_, RehearsalState::Open(options_.state, of));
    return absl::OkStatus();
  }

  // Set n hides case n mod cases, under a seed of its own: the same whatever was interrupted before.
  absl::Status Run() {
    const auto begin = std::chrono::steady_clock::now();
    const auto minutes = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / 60;
    };
    const size_t wanted = options_.sets > 0 ? options_.sets : SIZE_MAX;
    ProgressBar bar(!cli_.output().quiet);
    const size_t first = state_.sets().size();
    for (size_t n = first; n < wanted && (options_.sets > 0 || minutes() < options_.minutes); ++n) {
      const RehearsedCase& hidden = cases_[n % cases_.size()];
      // Of a time that was given, a set is as large a share as those before it were.
      const double sets = options_.sets > 0 ? options_.sets : 0;
      const double share = sets > 0 ? static_cast<double>(n) / sets : minutes() / options_.minutes;
      const double made = static_cast<double>(n - first);
      const double next = sets > 0 ? (static_cast<double>(n) + 1) / sets
                                   : std::min(1.0, made > 0 ? share * (made + 1) / made : share);
      bar.SetPart(absl::StrCat("set ", n + 1, ", ", hidden.name, " hidden"), share, next);
      bar.ShowStage("touching");
      v1::DiagnoseRequest request;
      *request.mutable_evidence() = comparison_->evidence();
      request.mutable_evidence()->set_seed(options_.seed + n);
      TOUCHSTONE_ASSIGN_OR_RETURN(
          *request.mutable_evidence()->mutable_csv(),
          TouchPlan(plan_, hidden, options_.seed + 1 + n, &comparison_->connection()));
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

 private:
  const Cli& cli_;
  const RehearseOptions& options_;
  Comparison* comparison_;
  std::vector<client::MeasuredTouch> plan_;
  std::vector<RehearsedCase> cases_;
  RehearsalState state_;
};

absl::Status RunRehearse(const Cli& cli, const RehearseOptions& options) {
  if (!(options.minutes > 0))
    return absl::InvalidArgumentError(
        absl::StrCat("--minutes: ", options.minutes, "; a positive number was expected"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  if (comparison->evidence().csv().empty())
    return absl::InvalidArgumentError("PLAN: a measurement file or plan (CSV) of touches was expected");
  Rehearsal rehearsal(cli, options, comparison.get());
  TOUCHSTONE_RETURN_IF_ERROR(rehearsal.Prepare());
  const absl::Status run = rehearsal.Run();
  // What was done before an interruption is said all the same.
  if (!run.ok() && !absl::IsCancelled(run)) return run;
  const std::vector<RehearsalRow> rows = rehearsal.Rows();
  if (!options.json.empty())
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.json, SummaryJson(rows).dump(2) + "\n"));
  if (!options.ReportOnStdout()) TOUCHSTONE_RETURN_IF_ERROR(cli.Print(SummaryText(rows)));
  return run;
}

}  // namespace

void AddRehearse(Cli* cli) {
  auto options = std::make_shared<RehearseOptions>();
  options->set_name = "PLAN";
  options->set_text = kPlanText;
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
      "gives",
      [cli, options] { return RunRehearse(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
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
