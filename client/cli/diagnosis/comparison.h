// What compare, diagnose and propose share: the set, the model and the meshes that go together, the call with
// its progress, and the report in its three forms.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/common/common.h"
#include "client/cli/common/interrupt.h"
#include "client/cli/common/progress_bar.h"
#include "client/cli/common/provenance.h"
#include "client/cli/session/named_set.h"
#include "server/base/status.h"

namespace touchstone::cli {

// Of commands whose set is a plan.
inline constexpr char kPlanText[] =
    "The plan (CSV of touches with poses, as `touchstone plan` writes it), or a measurement file, whose "
    "times are not read; "
    "-: stdin";

inline constexpr int kMaxSessions = 100;  // in one request

struct ComparisonOptions {
  std::vector<std::string> sets;  // at most `max_sets`
  int max_sets = 1;
  std::vector<std::string> models;  // at most `max_models`
  int max_models = 1;
  std::vector<std::string> also;
  uint64_t seed = 0;
  std::string html;
  std::string json;
  bool set_required = true;
  bool takes_sets = true;                  // false: the command finds the sets by itself
  bool takes_models = true;                // ... the models, and there are none that compete
  std::string set_name = "SET", set_text;  // as the help has it; empty text: any set
  bool with_content_hash = false;          // content_sha256() is asked for
  bool further_meshes = false;  // of --mesh-dir also those that the set does not name, up to a bound

  std::string set() const { return sets.empty() ? "" : sets[0]; }
  std::string model() const { return models.empty() ? "" : models[0]; }
  // What goes to standard output takes the place of the report in words.
  bool ReportOnStdout() const { return IsStandardOutput(json) || IsStandardOutput(html); }
};

// SET, --model, --also, --seed, --json FILE and, if `html`, --html FILE; then the options of the source.
void AddComparisonOptions(Cli* cli, CLI::App* command, ComparisonOptions* options, bool html);

// Refuses outputs (option and path) that the next command would take for meshes of --mesh-dir.
absl::Status CheckNoMeshes(const Cli& cli, const std::vector<std::pair<std::string, std::string>>& outputs);

// A source and what to ask it.
class Comparison {
 public:
  // Reads what is here and connects. Only meshes that the set names are read, and those that `further_meshes` asks
  // for; a server is sent those that it lacks.
  static absl::StatusOr<std::unique_ptr<Comparison>> Open(const Cli& cli, const ComparisonOptions& options);
  // A set that was sent ahead is deleted again.
  ~Comparison();

  client::Connection& connection() { return *connection_; }
  const v1::Evidence& evidence() const { return evidence_; }
  // The second of two models, read and checked; none if one was given.
  const std::optional<v1::ModelRef>& other_model() const { return other_model_; }
  // Of what the first set measured, whatever file it stands in: of its touches, or of photographs without touches.
  const std::string& content_sha256() const { return content_sha256_; }
  // Files that were read.
  const std::vector<source::MeshSpec>& meshes() const { return meshes_; }
  // Sets after the first, as requests take them.
  const std::vector<v1::Evidence>& further() const { return further_; }

  // Sends what Run would send ahead, so that evidence() is whole. Run does it by itself.
  absl::Status SendAheadNow() { return sent_ahead_.empty() ? SendAhead() : absl::OkStatus(); }

  // To a server that does not have it (any more), under the same name. From any thread, once SendAheadNow has returned.
  // FAILED_PRECONDITION: nothing was sent ahead.
  absl::Status SendAheadAgain(const std::shared_ptr<grpc::Channel>& server) const;

  // Runs the call that `start` makes; shows progress; returns the report with its provenance. Ctrl-C cancels it. A lost server
  // is replaced by the next one, which begins anew. With `after_report` a report is returned although the call failed once it had
  // been sent, and there stands why.
  template <typename Response, typename Start>
  absl::StatusOr<v1::Report> Run(const Start& start, absl::Status* after_report = nullptr) {
    ProgressBar bar(!cli_.output().quiet);
    return Run<Response>(start, &bar, after_report);
  }
  // The same on a bar that shows more than this call.
  template <typename Response, typename Start>
  absl::StatusOr<v1::Report> Run(const Start& start, ProgressBar* bar, absl::Status* after_report = nullptr);

 private:
  explicit Comparison(const Cli& cli) : cli_(cli) {}
  absl::StatusOr<std::vector<std::string>> ObjectsOfStored(const std::string& session);
  absl::StatusOr<std::string> ContentSha256Of(const NamedSet& set) const;
  absl::Status SendMeshes(const std::vector<source::MeshSpec>& meshes);
  absl::Status AddImages(v1::ImageSetFiles images);
  // What is too large for one request goes ahead as a session, once to each server that is asked.
  absl::Status SendAhead();
  absl::Status SendSession(v1::Sessions::StubInterface* sessions, const std::string& name,
                           grpc::ClientContext* context) const;
  template <typename Response, typename Start>
  absl::StatusOr<v1::Report> Attempt(const Start& start, ProgressBar* bar, absl::Status* after_report);

  const Cli& cli_;
  std::unique_ptr<client::Connection> connection_;
  v1::Evidence evidence_;
  std::optional<v1::ModelRef> other_model_;
  std::vector<v1::Evidence> further_;
  std::string csv_to_send_ahead_;
  std::string sent_ahead_;  // the session's name
  std::string content_sha256_;
  std::string set_sha256_;                // of the set's file; empty: it is none here
  std::vector<source::MeshSpec> meshes_;  // files that were read
};

// A refusal of one of these names of an effect, with the effect of the catalogue that was probably meant.
absl::Status WithEffectHint(const absl::Status& status, const std::vector<std::string>& names);

// The report as JSON and as HTML, as the options ask.
absl::Status WriteReportFiles(const Cli& cli, const ComparisonOptions& options, const v1::Report& report);
// The same, and the report in words unless one of them went to standard output.
absl::Status PrintReport(const Cli& cli, const ComparisonOptions& options, const v1::Report& report);

template <typename Response, typename Start>
absl::StatusOr<v1::Report> Comparison::Attempt(const Start& start, ProgressBar* bar,
                                               absl::Status* after_report) {
  bar->ShowStage("sending the measurements", 0);
  TOUCHSTONE_RETURN_IF_ERROR(SendAheadNow());
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  const auto reader = start(&context);
  Response response;
  v1::Report report;
  bool reported = false;
  while (reader->Read(&response)) {
    if (response.has_progress()) bar->ShowStage(response.progress().stage(), response.progress().done());
    if (!response.has_report()) continue;
    report = std::move(*response.mutable_report());
    reported = true;
  }
  bar->Clear();
  absl::Status status = client::FromGrpc(reader->Finish());
  if (!Interrupt::Raised()) status = client::LostWhereCancelled(status);
  // Another server does not have it.
  if (client::IsLostServer(status)) sent_ahead_.clear();
  if (reported && after_report != nullptr) {
    *after_report = status;
    return report;
  }
  if (!status.ok()) return status;
  if (!reported) return absl::InternalError("the source ended without a report");
  return report;
}

template <typename Response, typename Start>
absl::StatusOr<v1::Report> Comparison::Run(const Start& start, ProgressBar* bar, absl::Status* after_report) {
  absl::StatusOr<v1::Report> report;
  TOUCHSTONE_RETURN_IF_ERROR(connection_->Retrying([&] {
    report = Attempt<Response>(start, bar, after_report);
    return report.status();
  }));
  AddClientProvenance(cli_.command_line(), set_sha256_, meshes_, &*report);
  return report;
}

}  // namespace touchstone::cli
