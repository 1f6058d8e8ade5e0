#include "client/source/plans/rig_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include <absl/strings/str_cat.h>

#include "client/source/plans/rig_words.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/geometry/pose.h"
#include "server/service/core/convert.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/recorded/base_pose.h"

namespace touchstone::client {
namespace {

constexpr size_t kChecksPerRequest = 100;

}  // namespace

std::vector<RigGroup> GroupRows(const std::vector<PlannedRow>& rows, const std::function<bool(size_t)>& take,
                                const std::string& mounted_object, const std::string& mounted_up_face) {
  std::vector<std::string> objects;
  std::vector<RigGroup> groups;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (!take(row)) continue;
    const std::string& object = rows[row].touch.object;
    if (std::find(objects.begin(), objects.end(), object) == objects.end()) objects.push_back(object);
    auto group = std::find_if(groups.begin(), groups.end(), [&](const RigGroup& g) {
      return g.object == object && g.up_face == rows[row].up_face;
    });
    if (group == groups.end()) {
      groups.push_back({object, rows[row].up_face, {}, 0});
      group = groups.end() - 1;
    }
    group->rows.push_back(row);
    group->duration_s += rows[row].duration_s;
  }
  // An object stays on the fixture until every face of it that is needed was up.
  const auto rank = [&](const RigGroup& group) {
    const bool on_fixture = group.object == mounted_object;
    const bool lies_so = on_fixture && group.up_face == mounted_up_face;
    return std::make_tuple(
        !on_fixture, std::find(objects.begin(), objects.end(), group.object) - objects.begin(), !lies_so);
  };
  std::stable_sort(groups.begin(), groups.end(),
                   [&](const RigGroup& a, const RigGroup& b) { return rank(a) < rank(b); });
  return groups;
}

absl::StatusOr<std::vector<PlannedRow>> RowsOf(const std::vector<MeasuredTouch>& plan,
                                               const std::string& session, const std::string& origin) {
  std::vector<PlannedRow> rows;
  std::set<std::string> ids;
  for (const MeasuredTouch& touch : plan) {
    PlannedRow row;
    row.touch = touch;
    row.touch.time_s.clear();
    row.id = TouchId(session, touch.object, touch.touch);
    if (!ids.insert(row.id).second)
      return absl::InvalidArgumentError(absl::StrCat(origin, ": touch ", touch.touch, " of ", touch.object,
                                                     " stands twice; every touch needs a number of its own"));
    rows.push_back(std::move(row));
  }
  return rows;
}

absl::Status CheckRows(Connection* connection, const std::vector<size_t>& wanted,
                       std::vector<PlannedRow>* rows, std::vector<v1::TouchCheck>* checks,
                       const std::function<bool()>& go_on) {
  for (size_t first = 0; first < wanted.size();) {
    v1::CheckTouchesRequest request;
    request.set_object((*rows)[wanted[first]].touch.object);
    request.set_path(checks != nullptr);
    size_t stop = first;
    while (stop < wanted.size() && stop - first < kChecksPerRequest &&
           (*rows)[wanted[stop]].touch.object == request.object())
      *request.add_touches() = (*rows)[wanted[stop++]].touch.commanded;
    TOUCHSTONE_ASSIGN_OR_RETURN(v1::CheckTouchesResponse response,
                                connection->CallOnce(&v1::Rig::Stub::CheckTouches, request));
    if (static_cast<size_t>(response.checks_size()) != stop - first)
      return absl::InternalError(
          absl::StrCat("the source checked ", response.checks_size(), " of ", stop - first, " touches"));
    for (size_t k = first; k < stop; ++k) {
      v1::TouchCheck& check = *response.mutable_checks(static_cast<int>(k - first));
      PlannedRow& row = (*rows)[wanted[k]];
      row.possible = check.possible();
      row.reason = check.reason();
      row.notes.assign(check.notes().begin(), check.notes().end());
      row.up_face = UpFaceWord(check.up_face());
      row.duration_s = check.duration_s();
      if (checks != nullptr) checks->push_back(std::move(check));
    }
    first = stop;
    if (go_on && !go_on()) return absl::CancelledError("interrupted");
  }
  return absl::OkStatus();
}

std::string RestingFaceRequest(const std::string& object, const std::string& up_face,
                               const std::string& mounted_object) {
  if (object == mounted_object)
    return absl::StrCat("Turn ", object, " so that its face ", up_face, " points up");
  return absl::StrCat("Put ", object, " on the fixture with its face ", up_face, " up");
}

absl::StatusOr<MeasuredTouch> TaughtTouch(const v1::GuideState& state, uint64_t number, double standoff_m,
                                          double speed_m_s) {
  if (state.object().empty() || !state.has_object_from_tip())
    return absl::FailedPreconditionError(
        "what lies on the fixture is unknown, or the calibration has no pose of it: touchstone rig mount "
        "says it");
  const Eigen::Isometry3d object_from_tip =
      geometry::PoseFromVector(session::ParseBasePose(state.object_from_tip()));
  MeasuredTouch touch;
  touch.touch = number;
  touch.object = state.object();
  *touch.commanded.mutable_target_m() = service::ToProto(Eigen::Vector3d(object_from_tip.translation()));
  *touch.commanded.mutable_approach() = service::ToProto(Eigen::Vector3d(object_from_tip.linear().col(2)));
  *touch.commanded.mutable_lateral() = service::ToProto(Eigen::Vector3d(object_from_tip.linear().col(0)));
  touch.commanded.set_standoff_m(standoff_m);
  touch.commanded.set_speed_m_s(speed_m_s);
  return touch;
}

double NoiseOfRepeats(const std::vector<MeasuredTouch>& touches) {
  struct Repeats {
    std::vector<double> sum, sum_of_squares;
    size_t count = 0;
  };
  std::map<std::pair<std::string, std::string>, Repeats> poses;
  size_t fingers = 0;
  for (const MeasuredTouch& touch : touches) {
    double mean = 0;
    for (const double time_s : touch.time_s) mean += time_s / touch.time_s.size();
    fingers = std::max(fingers, touch.time_s.size());
    if (!std::isfinite(mean) || touch.time_s.size() < 2) continue;
    // The same pose at another time is a repeat.
    v1::CommandedTouch command = touch.commanded;
    command.clear_session_time_s();
    command.clear_covariates();
    Repeats& repeats = poses[{touch.object, session::CommandBytes(command)}];
    repeats.sum.resize(touch.time_s.size());
    repeats.sum_of_squares.resize(touch.time_s.size());
    ++repeats.count;
    for (size_t i = 0; i < touch.time_s.size(); ++i) {
      // The start of the approach is no part of the descriptor.
      const double time_s = touch.time_s[i] - mean;
      repeats.sum[i] += time_s;
      repeats.sum_of_squares[i] += time_s * time_s;
    }
  }
  double squares = 0;
  size_t degrees_of_freedom = 0;
  for (const auto& [pose, repeats] : poses) {
    if (repeats.count < 2) continue;
    for (size_t i = 0; i < repeats.sum.size(); ++i)
      squares += std::max(0.0, repeats.sum_of_squares[i] - repeats.sum[i] * repeats.sum[i] / repeats.count);
    degrees_of_freedom += (repeats.count - 1) * (repeats.sum.size() - 1);
  }
  return degrees_of_freedom > 0 ? std::sqrt(squares / degrees_of_freedom)
                                : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace touchstone::client
