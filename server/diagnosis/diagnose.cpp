#include "server/diagnosis/diagnose.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/design/propose.h"
#include "server/diagnosis/distributions/pose_free.h"
#include "server/diagnosis/report/design_messages.h"
#include "server/diagnosis/report/distributions_messages.h"
#include "server/diagnosis/report/residuals_messages.h"
#include "server/diagnosis/report/summary.h"
#include "server/diagnosis/residuals/describe_residuals.h"
#include "server/diagnosis/selection/ladder.h"

namespace touchstone {
namespace {

constexpr int kMaxCompetingModels = 4;
constexpr int kDefaultTouches = 8;  // proposed by Diagnose where something is ambiguous
constexpr char kCancelled[] = "the diagnosis was cancelled";

// Passes progress on from whatever thread works, one at a time, and remembers a cancellation.
class Gate {
 public:
  explicit Gate(const DiagnosisContext& context) : context_(context) {}

  // Returns false once cancelled.
  bool Tell(const std::string& stage, double done) {
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_ = stage;
    done_ = std::max(done_, done);
    return Pass();
  }
  // The same stage goes on. Busy threads do not wait for each other.
  bool Again() {
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (lock.owns_lock()) Pass();
    return !cancelled_;
  }

 private:
  bool Pass() {
    if (context_.progress && !cancelled_ && !context_.progress(stage_, done_)) cancelled_ = true;
    return !cancelled_;
  }
  const DiagnosisContext& context_;
  std::mutex mutex_;
  std::string stage_ = "reading";
  double done_ = 0;
  std::atomic<bool> cancelled_{false};
};

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void SetReducibleShare(v1::Report* report) {
  const double floor = report->noise_floor_us(), rmse = report->initial().rmse_us();
  report->set_reducible_share(rmse > 0 ? std::clamp(1 - floor * floor / (rmse * rmse), 0.0, 1.0) : 0);
}

// The parts that Compare and Diagnose share, once the noise floor is known.
void Describe(const Study& study, const std::vector<double>& before, const Prediction& improved,
              const std::vector<double>& after, v1::Report* report) {
  const Observations& o = *study.observations;
  const double sigma_s = report->noise_floor_us() * 1e-6;
  WriteResiduals(DescribeResiduals(o, study.nominal, improved, before, after,
                                   {sigma_s, study.input.model->spacing_m, study.input.seed}),
                 o.fingers, report);
}

// Touches that would tell what fits alike apart. Always asked for by Propose; Diagnose asks only where
// something is ambiguous.
absl::Status AddNextTouches(const Study& study, const Explained& explained, const Ladder& ladder, int touches,
                            bool always, v1::Report* report) {
  std::vector<CompetingModel> models = {
      {"the model as it is", std::make_shared<const Model>(ladder.improved)}};
  // The step with the closest competing effect decides what is asked.
  const ExplainedStep* closest = nullptr;
  for (const ExplainedStep& step : explained.steps) {
    if (step.rivals.empty() || !(always || step.rivals[0].equivalent)) continue;
    if (closest == nullptr || step.rivals[0].evidence > closest->rivals[0].evidence) closest = &step;
  }
  if (closest != nullptr) {
    models[0].name = NameOf(*explained.fit.model.base().effects[closest->effect].effect);
    for (const Rival& rival : closest->rivals) {
      if (!rival.equivalent && models.size() > 1) break;
      if (static_cast<int>(models.size()) == kMaxCompetingModels) break;
      models.push_back({rival.name, std::make_shared<const Model>(rival.model)});
    }
  } else if (!always) {
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::vector<ProposedTouch> proposed,
      ProposeTouches(*study.searched, models, report->noise_floor_us() * kSecondsPerMicrosecond, touches,
                     study.input.seed, study.context.pool));
  for (const ProposedTouch& touch : proposed) WriteProposedTouch(touch, report);
  if (always && proposed.empty())
    report->add_warnings(closest == nullptr
                             ? "No touch would tell more than those at hand."
                             : "No touch of this rig tells " + models[0].name + " from " + models[1].name +
                                   ": " + DecidedBy({models[0].name, models[1].name}));
  return absl::OkStatus();
}

v1::Report Begin(const DiagnosisInput& input) {
  v1::Report report;
  report.set_model_name(input.model->name);
  report.set_model_hash(input.model->Hash());
  return report;
}

absl::StatusOr<v1::Report> ReportWithoutPoses(const DiagnosisInput& input, const DiagnosisContext& context,
                                              bool diagnose) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const PoseFreeComparison comparison, ComparePoseFree(input, context, diagnose));
  return PoseFreeReport(input, comparison);
}

}  // namespace

absl::StatusOr<v1::Report> Compare(const DiagnosisInput& input, const DiagnosisContext& context) {
  if (!input.set->has_poses) return ReportWithoutPoses(input, context, false);
  const double began = Now();
  Gate gate(context);
  DiagnosisContext gated = context;
  gated.progress = [&gate](const std::string& stage, double done) { return gate.Tell(stage, done); };
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<Study> study, MakeStudy(input, gated));
  if (!gate.Tell("comparing", 0.3)) return absl::CancelledError(kCancelled);
  const Observations& o = *study->observations;
  v1::Report report = Begin(input);
  DescribeData(o, &report);
  const std::vector<double> residuals = Residuals(o, study->nominal);
  *report.mutable_noise_floor() = NoiseFloorOf(o, residuals, 0);
  report.set_noise_floor_us(report.noise_floor().sigma_us());
  const double rmse_us = Rmse(o, residuals) * 1e6;
  report.mutable_initial()->set_rmse_us(rmse_us);
  report.mutable_initial()->set_heldout_rmse_us(rmse_us);
  report.mutable_initial()->set_lack_of_fit_p(LackOfFitP(o, residuals, 0));
  *report.mutable_final() = report.initial();
  SetReducibleShare(&report);
  if (report.touches() > 0) Describe(*study, residuals, study->nominal, residuals, &report);
  for (const std::string& warning : study->warnings) report.add_warnings(warning);
  AddWarnings(o, &report);
  report.set_summary(Summary(report));
  report.set_duration_s(Now() - began);
  return report;
}

namespace {

// `always`: Propose, which names touches even where nothing is ambiguous.
absl::StatusOr<v1::Report> DiagnoseStudy(const DiagnosisInput& input, int touches, bool always,
                                         const DiagnosisContext& context) {
  if (!input.set->has_poses) return ReportWithoutPoses(input, context, true);
  const double began = Now();
  Gate gate(context);
  DiagnosisContext gated = context;
  gated.progress = [&gate](const std::string& stage, double done) { return gate.Tell(stage, done); };
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<Study> study, MakeStudy(input, gated));
  study->experiment.cancelled = [&gate] { return !gate.Again(); };
  if (!gate.Tell("fitting", 0.1)) return absl::CancelledError(kCancelled);
  Observations& o = *study->observations;
  v1::Report report = Begin(input);
  if (std::none_of(o.used.begin(), o.used.end(), [](char used) { return used; })) {
    DescribeData(o, &report);
    AddWarnings(o, &report);
    report.set_verdict(v1::Report::ADEQUATE);
    report.set_summary(Summary(report));
    return report;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const Explained explained, Explain(study.get()));
  if (!gate.Tell("describing", 0.7)) return absl::CancelledError(kCancelled);

  DescribeData(o, &report);
  const std::vector<double> before = Residuals(o, study->nominal);
  *report.mutable_initial() = QualityOf(*study, *explained.search, explained.given, before, false);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Ladder ladder, BuildLadder(study.get(), explained, &report));
  SetReducibleShare(&report);
  if (!gate.Tell("describing", 0.85)) return absl::CancelledError(kCancelled);
  Describe(*study, before, ladder.prediction, ladder.residuals, &report);
  for (const std::string& warning : study->warnings) report.add_warnings(warning);
  AddWarnings(o, &report);
  report.set_summary(Summary(report));
  TOUCHSTONE_RETURN_IF_ERROR(
      AddNextTouches(*study, explained, ladder, always ? touches : kDefaultTouches, always, &report));
  report.set_duration_s(Now() - began);
  gate.Tell("done", 1);
  return report;
}

}  // namespace

absl::StatusOr<v1::Report> Diagnose(const DiagnosisInput& input, const DiagnosisContext& context) {
  return DiagnoseStudy(input, kDefaultTouches, false, context);
}

absl::StatusOr<v1::Report> Propose(const DiagnosisInput& input, int touches,
                                   const DiagnosisContext& context) {
  return DiagnoseStudy(input, touches, true, context);
}

}  // namespace touchstone
