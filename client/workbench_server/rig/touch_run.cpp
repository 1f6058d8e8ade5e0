#include "client/workbench_server/rig/touch_run.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "client/source/dataset/measurement_csv.h"
#include "client/source/plans/plan_expansion.h"
#include "client/source/plans/rig_words.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/units.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

constexpr size_t kMaxReasonsShown = 20;
constexpr int kFaces = 6;

absl::StatusOr<std::vector<client::MeasuredTouch>> ExpandFaces(client::Connection* rig, const json& plan) {
  const auto objects = plan.at("objects").get<std::vector<std::string>>();
  if (objects.empty()) return absl::InvalidArgumentError("objects: none is chosen; choose at least one");
  v1::ExpandPlanRequest request;
  v1::FacesPlan* faces = request.mutable_plan()->mutable_faces();
  faces->set_samples_per_face(plan.at("samples_per_face").get<uint32_t>());
  faces->set_rounds(plan.at("rounds").get<uint32_t>());
  if (plan.contains("max_tilt_deg"))
    faces->set_max_tilt_rad(ToSi(Unit::kDegree, plan.at("max_tilt_deg").get<double>()));
  request.mutable_plan()->set_speed_m_s(
      ToSi(Unit::kMillimetrePerSecond, plan.at("speed_mm_s").get<double>()));
  request.set_seed(plan.value("seed", uint64_t{0}));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      client::PlannedTouches planned,
      client::ExpandPlan(rig, objects, 0, uint64_t{kFaces} * faces->samples_per_face() * faces->rounds(),
                         request));
  return std::move(planned.touches);
}

json TouchJson(const client::PlannedRow& row, const v1::TouchResult& result) {
  double first = std::numeric_limits<double>::infinity();
  for (const double time_s : result.contact_time_s())
    if (std::isfinite(time_s)) first = std::min(first, time_s);
  json times = json::array();
  for (const double time_s : result.contact_time_s())
    times.push_back(std::isfinite(time_s) ? json(Microseconds(time_s - first)) : json());
  return {{"touch", row.touch.touch},
          {"object", row.touch.object},
          {"up_face", row.up_face},
          {"times_us", times}};
}

}  // namespace

absl::StatusOr<std::unique_ptr<TouchRun>> TouchRun::Check(client::Connection* rig, const json& plan,
                                                          const ObjectsOfSource& objects,
                                                          const std::function<bool()>& go_on) {
  auto run = std::make_unique<TouchRun>();
  run->session_ = plan.at("session").get<std::string>();
  TOUCHSTONE_RETURN_IF_ERROR(client::CheckSessionName(run->session_, "session"));
  std::vector<client::MeasuredTouch> touches;
  if (plan.contains("csv")) {
    run->origin_ = plan.value("origin", "the plan");
    TOUCHSTONE_ASSIGN_OR_RETURN(touches,
                                client::ParseMeasurements(plan.at("csv").get<std::string>(), run->origin_));
  } else {
    run->origin_ = "the plan";
    TOUCHSTONE_ASSIGN_OR_RETURN(touches, ExpandFaces(rig, plan));
  }
  if (touches.empty()) return absl::InvalidArgumentError(absl::StrCat(run->origin_, " has no touch"));
  TOUCHSTONE_ASSIGN_OR_RETURN(run->rows_, client::RowsOf(touches, run->session_, run->origin_));
  std::vector<size_t> all(run->rows_.size());
  std::iota(all.begin(), all.end(), size_t{0});
  std::vector<v1::TouchCheck> checks;
  TOUCHSTONE_RETURN_IF_ERROR(client::CheckRows(rig, all, &run->rows_, &checks, go_on));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state,
                              rig->CallOnce(&v1::Rig::Stub::GetRig, v1::GetRigRequest()));
  const std::vector<client::RigGroup> setups = client::GroupRows(
      run->rows_, [&](size_t row) { return run->rows_[row].possible; }, state.object(),
      client::UpFaceWord(state.up_face()));
  run->Summarize(setups);
  run->drawing_ = DrawTouches(run->rows_, checks, setups, objects);
  return run;
}

void TouchRun::Summarize(const std::vector<client::RigGroup>& setups) {
  size_t possible = 0;
  double duration_s = 0;
  json groups = json::array(), impossible = json::array(), notes = json::array();
  for (const client::PlannedRow& row : rows_) {
    possible += row.possible;
    if (!row.possible && impossible.size() < kMaxReasonsShown)
      impossible.push_back(
          {{"touch", row.touch.touch}, {"object", row.touch.object}, {"reason", row.reason}});
    for (const std::string& note : row.notes)
      if (notes.size() < kMaxReasonsShown)
        notes.push_back(absl::StrCat("Touch ", row.touch.touch, ": ", note));
  }
  for (const client::RigGroup& group : setups) {
    groups.push_back({{"object", group.object},
                      {"up_face", group.up_face},
                      {"touches", group.rows.size()},
                      {"duration_s", group.duration_s}});
    duration_s += group.duration_s;
  }
  checked_ = {{"session", session_},      {"origin", origin_}, {"touches", rows_.size()},
              {"possible", possible},     {"groups", groups},  {"duration_s", duration_s},
              {"impossible", impossible}, {"notes", notes}};
}

absl::Status TouchRun::TouchAll(client::Connection* rig, client::LeasedSource* source, bool skip_impossible,
                                const RunEvents& events) {
  const size_t impossible =
      std::count_if(rows_.begin(), rows_.end(), [](const client::PlannedRow& row) { return !row.possible; });
  if (impossible > 0 && !skip_impossible)
    return absl::FailedPreconditionError(
        absl::StrCat(impossible, " of ", rows_.size(), " touches are impossible here, so nothing was moved"));
  const auto look = [&] { return rig->CallOnce(&v1::Rig::Stub::GetRig, v1::GetRigRequest()); };
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::RigState state, look());
  const std::vector<client::RigGroup> groups = client::GroupRows(
      rows_, [this](size_t row) { return rows_[row].possible; }, state.object(),
      client::UpFaceWord(state.up_face()));
  for (const client::RigGroup& group : groups) {
    TOUCHSTONE_ASSIGN_OR_RETURN(state, look());
    TOUCHSTONE_RETURN_IF_ERROR(
        source->EnsureMounted(state, group.object, client::UpFaceOf(group.up_face), [&]() -> absl::Status {
          TOUCHSTONE_RETURN_IF_ERROR(
              events.ask(client::RestingFaceRequest(group.object, group.up_face, state.object())));
          return events.go_on() ? absl::OkStatus() : absl::CancelledError("stopped");
        }));
    for (const size_t k : group.rows) {
      if (!events.go_on()) return absl::CancelledError("stopped");
      const client::PlannedRow& row = rows_[k];
      v1::TouchRequest request;
      request.set_object(row.touch.object);
      request.set_session(session_);
      *request.add_touches() = row.touch.commanded;
      request.add_touch_ids(row.id);
      const absl::StatusOr<v1::TouchResponse> response = source->Touch(request);
      if (!response.ok())
        return absl::Status(response.status().code(),
                            absl::StrCat("touch ", row.touch.touch, " of ", row.touch.object, ": ",
                                         response.status().message()));
      events.touched(TouchJson(row, response->results(0)).dump());
    }
  }
  return absl::OkStatus();
}

}  // namespace touchstone::workbench
