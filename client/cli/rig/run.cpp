// touchstone rig run: a plan's touches, one by one, into a session that can be resumed.
#include <algorithm>
#include <chrono>
#include <cmath>

#include "client/cli/common/progress_bar.h"
#include "client/cli/options/plan_options.h"
#include "client/cli/rig/record.h"
#include "client/cli/rig/rig.h"
#include "client/source/plans/journalled_touches.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/session_files.h"

namespace touchstone::cli {
namespace {

constexpr size_t kMaxRefusalsShown = 20;
constexpr char kHowToMakeNewOnes[] = "; --session NAME makes new ones";

struct RunOptions {
  MotionFlags motion;
  std::string plan, output;
  bool skip_impossible = false, series = false;
};

class Run {
 public:
  Run(const Cli& cli, const RunOptions& options) : cli_(cli), options_(options), bar_(!cli.output().quiet) {}

  absl::Status Go() {
    session_ =
        options_.motion.session.empty() ? client::SessionNameOf(options_.plan) : options_.motion.session;
    TOUCHSTONE_RETURN_IF_ERROR(client::CheckSessionName(session_, "--session"));
    TOUCHSTONE_ASSIGN_OR_RETURN(journal_path_, JournalPathOf(options_.output));
    std::vector<OutputFile> files = {{"-o", journal_path_, OutputKind::kJournal}};
    if (options_.output != journal_path_) files.push_back({"-o", options_.output});
    TOUCHSTONE_RETURN_IF_ERROR(cli_.CheckOutputs(files));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<client::MeasuredTouch> plan, ReadTouches(options_.plan));
    TOUCHSTONE_ASSIGN_OR_RETURN(rows_, client::RowsOf(plan, session_, options_.plan));
    TOUCHSTONE_ASSIGN_OR_RETURN(rig_, ConnectToRig(cli_));
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig_.connection.get()));
    TOUCHSTONE_ASSIGN_OR_RETURN(record_, RigRecord::Open(journal_path_, session_, state));
    std::vector<size_t> wanted;
    for (size_t row = 0; row < rows_.size(); ++row) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool has, record_->Has(rows_[row].id, rows_[row].touch));
      if (!has) wanted.push_back(row);
    }
    if (wanted.size() < rows_.size())
      cli_.Log(absl::StrCat(journal_path_, " has ", rows_.size() - wanted.size(), " of ",
                            Counted(rows_.size(), "touch", "touches"), " already",
                            wanted.empty() ? absl::StrCat("; nothing was moved", kHowToMakeNewOnes)
                                           : "; the rest is asked for now"));
    TOUCHSTONE_RETURN_IF_ERROR(LookInJournal(wanted));
    TOUCHSTONE_RETURN_IF_ERROR(Check(wanted));
    const absl::Status status = wanted.empty() ? absl::OkStatus() : TouchAll(wanted, state);
    bar_.Clear();
    if (from_journal_ > 0)
      cli_.Log(absl::StrCat(FromJournalText(from_journal_, rows_.size(), first_unix_s_),
                            made_ == 0 ? absl::StrCat("; nothing was moved", kHowToMakeNewOnes)
                                       : absl::StrCat("; ", Counted(made_, "was", "were"), " made now")));
    if (!status.ok()) {
      cli_.Log(absl::StrCat(Counted(made_, "touch was", "touches were"),
                            " made now; run the same command again to resume"));
      return status;
    }
    return Finish();
  }

 private:
  // Which of them the source has made before, for another output.
  absl::Status LookInJournal(const std::vector<size_t>& wanted) {
    stands_.resize(rows_.size());
    if (wanted.empty()) return absl::OkStatus();
    std::vector<client::MeasuredTouch> plan;
    for (const PlannedRow& row : rows_) plan.push_back(row.touch);
    TOUCHSTONE_ASSIGN_OR_RETURN(stands_, client::TouchesInJournal(rig_.connection.get(), session_, plan));
    return absl::OkStatus();
  }

  // A dry run of what is to be made.
  absl::Status Check(const std::vector<size_t>& wanted) {
    TOUCHSTONE_RETURN_IF_ERROR(
        CheckRows(rig_.connection.get(), wanted, &rows_, nullptr, [] { return !Interrupt::Raised(); }));
    for (size_t row = 0; row < rows_.size(); ++row) {
      if (stands_[row]) rows_[row].possible = true;  // it was made
      impossible_ += !rows_[row].possible;
    }
    if (impossible_ == 0) return absl::OkStatus();
    cli_.Log(ImpossibleTable(rows_, kMaxRefusalsShown));
    if (options_.skip_impossible) {
      cli_.Log(absl::StrCat(impossible_, " impossible touches are left out"));
      return absl::OkStatus();
    }
    return absl::FailedPreconditionError(absl::StrCat(
        options_.plan, ": ", impossible_, " of ", rows_.size(),
        " touches are impossible here, so nothing was moved; change the plan, or leave them out with "
        "--skip-impossible"));
  }

  absl::Status TouchAll(const std::vector<size_t>& wanted, const v1::RigState& state) {
    const std::function<void(const std::string&)> log = [this](const std::string& line) {
      bar_.Clear();
      cli_.Log(line);
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(source_, OpenLeased(cli_, rig_.connection.get(), options_.motion, log));
    const StopOnInterrupt stop_on_interrupt(source_.get());
    // What stands in the source's journal comes without motion: neither the arm nor the object has to move for it.
    std::vector<bool> take(rows_.size());
    left_ = wanted.size();
    for (const size_t row : wanted) {
      if (stands_[row])
        TOUCHSTONE_RETURN_IF_ERROR(TouchOne({rows_[row].touch.object, rows_[row].up_face, {}, 0}, row));
      take[row] = rows_[row].possible && !stands_[row];
    }
    left_ = 0;
    const std::vector<RigGroup> groups = client::GroupRows(
        rows_, [&](size_t row) { return take[row]; }, state.object(), client::UpFaceWord(state.up_face()));
    for (const RigGroup& group : groups) {
      left_s_ += group.duration_s;
      left_ += group.rows.size();
    }
    for (const RigGroup& group : groups) {
      bar_.Clear();
      TOUCHSTONE_RETURN_IF_ERROR(Mount(group));
      cli_.Log(absl::StrCat(group.object, ", face ", group.up_face,
                            " up: ", Counted(group.rows.size(), "touch", "touches"), ", about ",
                            DurationInWords(group.duration_s)));
      for (const size_t row : group.rows) TOUCHSTONE_RETURN_IF_ERROR(TouchOne(group, row));
    }
    return absl::OkStatus();
  }

  absl::Status Mount(const RigGroup& group) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig_.connection.get()));
    return MountForTouches(cli_, source_.get(), state, group.object, group.up_face);
  }

  absl::Status TouchOne(const RigGroup& group, size_t number) {
    const PlannedRow& row = rows_[number];
    bar_.ShowStage(absl::StrCat("touch ", row.touch.touch, " of ", row.touch.object, ", ", left_, " left, ",
                                DurationInWords(left_s_ * pace_)),
                   1 - static_cast<double>(left_) / rows_.size());
    TOUCHSTONE_RETURN_IF_ERROR(record_->Begin(row.id, row.touch, group.up_face));
    v1::TouchRequest request;
    request.set_object(row.touch.object);
    request.set_session(session_);
    *request.add_touches() = row.touch.commanded;
    request.add_touch_ids(row.id);
    request.set_series(options_.series);
    const auto start = std::chrono::steady_clock::now();
    absl::StatusOr<v1::TouchResponse> response = source_->Touch(request);
    // Somebody took the object away or mounted another one: a person can correct that, once.
    if (absl::IsFailedPrecondition(response.status())) {
      const absl::StatusOr<v1::RigState> now = GetRig(rig_.connection.get());
      if (now.ok() &&
          (now->object() != group.object || client::UpFaceWord(now->up_face()) != group.up_face)) {
        bar_.Clear();
        cli_.Log(std::string(response.status().message()));
        absl::Status mounted = MountForTouches(cli_, source_.get(), *now, group.object, group.up_face);
        if (mounted.ok())
          response = source_->Touch(request);
        else
          response = mounted;
      }
    }
    if (!response.ok()) {
      // What was interrupted is left as it stands: the source knows what became of it.
      if (!absl::IsCancelled(response.status()) && !absl::IsUnavailable(response.status()))
        TOUCHSTONE_RETURN_IF_ERROR(record_->Failed(row.id, response.status()));
      return absl::Status(response.status().code(),
                          absl::StrCat("touch ", row.touch.touch, " of ", row.touch.object, ": ",
                                       response.status().message()));
    }
    TOUCHSTONE_RETURN_IF_ERROR(record_->Done(row.id, response->results(0)));
    without_series_ += options_.series && !response->results(0).measured().has_series();
    if (stands_[number]) {
      const double unix_s = response->results(0).measured().start_unix_s();
      if (from_journal_++ == 0 || unix_s < first_unix_s_) first_unix_s_ = unix_s;
      --left_;
      return absl::OkStatus();
    }
    took_s_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    expected_s_ += row.duration_s;
    if (expected_s_ > 0) pace_ = took_s_ / expected_s_;
    ++made_;
    --left_;
    left_s_ -= row.duration_s;
    return absl::OkStatus();
  }

  absl::Status Finish() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<client::MeasuredTouch> touches, record_->Touches());
    size_t misses = 0;
    for (const client::MeasuredTouch& touch : touches)
      misses += std::any_of(touch.time_s.begin(), touch.time_s.end(), [](double t) { return std::isnan(t); });
    const double noise_s = client::NoiseOfRepeats(touches);
    const bool csv = options_.output != journal_path_;
    if (csv) {
      if (touches.empty())
        return absl::FailedPreconditionError(
            absl::StrCat("session '", session_, "' has no touch that is done"));
      TOUCHSTONE_RETURN_IF_ERROR(cli_.Write(options_.output, client::FormatMeasurements(touches)));
    }
    if (cli_.output().json)
      PrintJson({{"session", session_},
                 {"journal", journal_path_},
                 {"touches", touches.size()},
                 {"made_now", made_},
                 {"from_journal", from_journal_},
                 {"impossible", impossible_},
                 {"misses", misses},
                 {"noise_us", std::isfinite(noise_s) ? Json(noise_s * kMicrosecondsPerSecond) : Json()}});
    cli_.Log(absl::StrCat(
        options_.output, ": session '", session_, "', ", Counted(touches.size(), "touch", "touches"), ", ",
        misses, " in which a finger met nothing",
        impossible_ > 0 ? absl::StrCat(", ", impossible_, " impossible ones left out") : "",
        std::isfinite(noise_s) ? absl::StrCat("; repeats differ by ",
                                              Rounded(noise_s * kMicrosecondsPerSecond), " us per finger")
                               : ""));
    if (without_series_ > 0)
      cli_.Log(absl::StrCat(Counted(without_series_, "touch has", "touches have"),
                            " no series: the rig had made them before, without --series"));
    cli_.Log(absl::StrCat("next: touchstone diagnose ", options_.output, " --model nominal.yaml",
                          csv ? ""
                              : absl::StrCat("\n      touchstone session export ", options_.output, " ",
                                             session_, " -o set.csv")));
    return absl::OkStatus();
  }

  const Cli& cli_;
  const RunOptions& options_;
  ProgressBar bar_;
  std::string session_, journal_path_;
  std::vector<PlannedRow> rows_;
  RigConnection rig_;
  std::unique_ptr<client::LeasedSource> source_;
  std::unique_ptr<RigRecord> record_;
  std::vector<bool> stands_;  // of each row: the source made it before
  size_t impossible_ = 0, made_ = 0, from_journal_ = 0, left_ = 0, without_series_ = 0;
  double first_unix_s_ = 0, left_s_ = 0, took_s_ = 0, expected_s_ = 0, pace_ = 1;
};

}  // namespace

void AddRigRun(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command = cli->AddCommand(
      group, "run",
      "Makes the touches of a plan, object by object and face by face. "
      "Interrupted in whatever way, the same command resumes where it stopped: "
      "no touch is lost and none is made twice. Ctrl-C stops the rig, which holds until touchstone "
      "rig reset.",
      "touchstone plan lat00,lat20 --plan faces -o plan.csv\n"
      "touchstone rig run plan.csv -o session.db --server 127.0.0.1:50052\n"
      "touchstone rig run plan.csv -o monday.csv --session monday --server "
      "127.0.0.1:50052     also monday.db",
      [cli, options] { return Run(*cli, *options).Go(); });
  cli->AddInput(
      command,
      command->add_option("PLAN", options->plan, "A CSV file of touches (touchstone plan writes one)")
          ->type_name("")
          ->required());
  cli->AddOutput(
         command, "-o,--output", &options->output,
         "A journal (.db) that gets every touch as soon as it is made; one that is there is resumed. Or a "
         "measurement file (.csv) that is written at the end, with the journal of the same name beside it",
         OutputKind::kPrefix)
      ->required();
  command->get_option("--force")->description("Replace a measurement file that exists; never a journal");
  command->add_flag("--skip-impossible", options->skip_impossible,
                    "Leave out touches that the rig cannot make. Default: move nothing if there is one");
  command->add_flag(
      "--series", options->series,
      "Also keep the arm's joints, tip pose and tip force during each approach (about 200 kB a touch); "
      "session export writes them to HDF5");
  AddMotionOptions(command, &options->motion, true);
  command->get_option("--session")
      ->description(
          "The session's name, here and at the source. Default: the plan's name without its ending");
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
