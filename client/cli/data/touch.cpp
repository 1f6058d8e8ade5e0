// touchstone touch: explicit touches and their contact times.
#include <algorithm>
#include <cmath>
#include <set>

#include "client/cli/common/progress_bar.h"
#include "client/cli/options/motion_options.h"
#include "client/cli/options/plan_options.h"
#include "client/cli/options/touch_options.h"
#include "client/source/dataset/lab_units.h"
#include "client/source/dataset/measurement_csv.h"
#include "client/source/plans/journalled_touches.h"
#include "client/source/plans/session_parts.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/touch_limits.h"

namespace touchstone::cli {
namespace {

struct TouchOptions {
  TouchFlags touch;
  MotionFlags motion;
  std::string object;
  std::string plan;
  std::string model;
  uint64_t seed = 0;
  uint32_t repeats = 1;
  std::string output;
};

// What a touch gave, beside the row of the measurement file.
struct TouchRow {
  client::MeasuredTouch measured;
  uint64_t planned = 0;  // its number in the plan, for its id
  v1::TouchResult result;
};

absl::StatusOr<std::vector<TouchRow>> CommandedRows(const TouchOptions& options) {
  std::vector<client::MeasuredTouch> touches;
  if (!options.plan.empty()) {
    if (!options.touch.approach.empty())
      return absl::InvalidArgumentError(
          "--approach and --plan: give one touch by options, or many by a file");
    TOUCHSTONE_ASSIGN_OR_RETURN(touches, ReadTouches(options.plan));
    for (client::MeasuredTouch& touch : touches)
      if (!options.object.empty()) touch.object = options.object;
  } else {
    if (options.object.empty())
      return absl::InvalidArgumentError("OBJECT is missing: what to touch (touchstone objects lists it)");
    client::MeasuredTouch touch;
    touch.object = options.object;
    TOUCHSTONE_ASSIGN_OR_RETURN(touch.commanded, MakeTouch(options.touch));
    touches.push_back(std::move(touch));
  }
  if (options.repeats < 1) return absl::InvalidArgumentError("--repeats: 0 is out of range; 1 or more");
  std::vector<TouchRow> rows;
  for (uint32_t repeat = 0; repeat < options.repeats; ++repeat)
    for (const client::MeasuredTouch& touch : touches) {
      rows.push_back({touch, options.repeats == 1 ? touch.touch : rows.size(), {}});
      rows.back().measured.touch = rows.size() - 1;
    }
  return rows;
}

// What the options left open of a touch, by where the object is and how large. The rows are repeats of one touch.
absl::Status AimRows(const TouchOptions& options, client::Connection* connection,
                     std::vector<TouchRow>* rows) {
  if (!options.plan.empty() || (!options.touch.target_mm.empty() && options.touch.standoff_mm.has_value()))
    return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::Bounds bounds, BoundsOfObject(connection, options.object));
  const auto standoff = [](const geometry::Bounds& box, const Eigen::Vector3d& target_m,
                           const Eigen::Vector3d& approach) {
    constexpr double kStandoffM = 0.1, kClearanceM = 0.02;
    return std::clamp(geometry::DistanceToLeave(box, target_m, -approach) + kClearanceM, kStandoffM,
                      kMaxStandoffM);
  };
  for (TouchRow& row : *rows) AimAtObject(options.touch, bounds, standoff, &row.measured.commanded);
  return absl::OkStatus();
}

// When the first of those that `stands` names began.
double FirstUnixS(const std::vector<TouchRow>& rows, const std::vector<bool>& stands) {
  double first_s = 0;
  for (size_t k = 0; k < rows.size(); ++k) {
    const double unix_s = rows[k].result.measured().start_unix_s();
    if (stands[k] && (first_s == 0 || unix_s < first_s)) first_s = unix_s;
  }
  return first_s;
}

// All rows are one session; the noise depends on the row's number alone. A physical source gets one at a time, with
// ids: those of a plan's touches are always the same, so that a repeated command resumes where it stopped.
absl::Status TouchAll(const Cli& cli, const TouchOptions& options, std::vector<TouchRow>* rows,
                      std::string* model_hash) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ModelRef model, ParseModelRef(options.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  TOUCHSTONE_RETURN_IF_ERROR(AimRows(options, connection.get(), rows));
  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source,
                              OpenLeased(cli, connection.get(), options.motion, [&](const std::string& line) {
                                bar.Clear();
                                cli.Log(line);
                              }));
  const StopOnInterrupt stop_on_interrupt(source.get());
  const std::string session = options.motion.session.empty() ? "default" : options.motion.session;
  const size_t max_touches = source->touches_per_request();
  std::vector<client::MeasuredTouch> commanded;
  for (const TouchRow& row : *rows) commanded.push_back(row.measured);
  // A plan's touches that the source has made before come from its journal: they are no new ones.
  std::vector<bool> stands(rows->size());
  if (source->physical() && !options.plan.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(stands, client::TouchesInJournal(connection.get(), session, commanded));
  }
  std::set<std::string> said;
  for (size_t first = 0; first < rows->size();) {
    v1::TouchRequest request = client::PartOfSession(commanded, first, max_touches);
    const size_t stop = first + static_cast<size_t>(request.touches_size());
    *request.mutable_model() = model;
    request.set_seed(options.seed);
    if (source->physical()) {
      request.set_session(session);
      for (size_t k = first; k < stop; ++k)
        request.add_touch_ids(options.plan.empty()
                                  ? client::NewTouchId((*rows)[k].measured.touch)
                                  : client::TouchId(session, request.object(), (*rows)[k].planned));
    }
    bar.ShowStage(absl::StrCat("touch ", first + 1, " of ", rows->size(), ": ", request.object()),
                  static_cast<double>(first) / static_cast<double>(rows->size()));
    absl::StatusOr<v1::TouchResponse> response = source->Touch(std::move(request));
    if (!response.ok()) {
      bar.Clear();
      if (source->physical() && first > 0 && !options.plan.empty())
        cli.Log(absl::StrCat(first, " of ", rows->size(), " touches stand in session '", session,
                             "' of the source; the same command resumes after them"));
      return response.status();
    }
    for (size_t row = first; row < stop; ++row) {
      v1::TouchResult& result = *response->mutable_results(static_cast<int>(row - first));
      (*rows)[row].measured.time_s.assign(result.contact_time_s().begin(), result.contact_time_s().end());
      (*rows)[row].result = std::move(result);
    }
    *model_hash = response->model_hash();
    for (const std::string& note : response->notes()) {
      if (!said.insert(note).second) continue;
      bar.Clear();
      cli.Log("note: " + note);
    }
    first = stop;
  }
  bar.Clear();
  if (const size_t count = std::count(stands.begin(), stands.end(), true); count > 0)
    cli.Log(absl::StrCat(FromJournalText(count, rows->size(), FirstUnixS(*rows, stands)),
                         count == rows->size() ? "; nothing was moved" : "",
                         "; --session NAME makes new ones"));
  return absl::OkStatus();
}

// JSON has no NaN: a finger that reported nothing is null.
Json Numbers(const google::protobuf::RepeatedField<double>& values, Unit unit) {
  Json list = Json::array();
  for (const double value : values)
    list.push_back(std::isfinite(value) ? Json(client::LabNumber(unit, value)) : Json());
  return list;
}

Json RowJson(const TouchRow& row) {
  const v1::TouchResult& r = row.result;
  return {{"touch", row.measured.touch},
          {"object", row.measured.object},
          {"complete", r.complete()},
          {"descriptor_us", Numbers(r.descriptor_s(), Unit::kMicrosecond)},
          {"contact_time_us", Numbers(r.contact_time_s(), Unit::kMicrosecond)},
          {"travel_mm", Numbers(r.travel_m(), Unit::kMillimetre)},
          {"contact_point_mm", Numbers(r.contact_point_m(), Unit::kMillimetre)},
          {"normal", Numbers(r.normal(), Unit::kNone)}};
}

absl::Status RunTouch(const Cli& cli, const TouchOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<TouchRow> rows, CommandedRows(options));
  std::string model_hash;
  TOUCHSTONE_RETURN_IF_ERROR(TouchAll(cli, options, &rows, &model_hash));
  size_t incomplete = 0;
  for (const TouchRow& row : rows) incomplete += !row.result.complete();
  if (incomplete > 0)
    cli.Log(absl::StrCat(incomplete, " of ", rows.size(),
                         " touches are incomplete: a finger met nothing, its time is left empty"));
  std::string text;
  if (cli.output().json) {
    Json list = Json::array();
    for (const TouchRow& row : rows) list.push_back(RowJson(row));
    text = Json({{"model_hash", model_hash}, {"touches", list}}).dump(2) + "\n";
  } else {
    std::vector<client::MeasuredTouch> measured;
    for (TouchRow& row : rows) measured.push_back(std::move(row.measured));
    text = client::FormatMeasurements(measured);
  }
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, text));
  cli.LogWritten(options.output, absl::StrCat(" (", Counted(rows.size(), "touch", "touches"), ")"));
  return absl::OkStatus();
}

}  // namespace

void AddTouch(Cli* cli) {
  auto options = std::make_shared<TouchOptions>();
  CLI::App* command = cli->AddCommand(
      nullptr, "touch",
      "Touches an object and prints a measurement file: one row per touch, t_*_us when each finger met it.",
      "touchstone touch lat20 --approach 0,0,-1\n"
      "touchstone touch lat20 --approach 0,0,-1 --target-mm 10,0,0 --lateral 0,1,0 --repeats 10 "
      "--model noisy.yaml\n"
      "touchstone touch --plan plan.csv --model tips.yaml --seed 7 -o set.csv\n"
      "touchstone touch lat20 --approach=-1,0,0 --json",
      [cli, options] { return RunTouch(*cli, *options); });
  command->add_option("OBJECT", options->object, "What to touch; with --plan, instead of the file's objects")
      ->type_name("");
  cli->AddInput(
      command,
      command->add_option("--plan", options->plan, "A CSV file of touches (touchstone plan writes one)")
          ->type_name("FILE"));
  cli->AddInput(
      command,
      command->add_option("--model", options->model, "Model file, name or hash. Default: the source's own")
          ->type_name("MODEL"));
  command->add_option("--seed", options->seed, "Seed of the noise. Default: 0")->type_name("N");
  command->add_option("--repeats", options->repeats, "How often all of it is touched. Default: 1")
      ->type_name("N");
  cli->AddFormattedOutput(command, "-o,--output", &options->output, "The file to write. Default: stdout");
  AddTouchOptions(command, "100, or more where the object reaches farther from the target", &options->touch);
  AddMotionOptions(command, &options->motion, true);
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
