#include "server/session/session_measurements.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <cmath>
#include <limits>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/session/images/emulated.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/measurements/measurement_checks.h"

namespace touchstone::session {
namespace {

Eigen::Vector3d VectorOf(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

absl::StatusOr<std::vector<MeasuredTouch>> MeasuredTouchesOf(const std::vector<JournalTouch>& done,
                                                             bool emulated, const std::string& where) {
  std::vector<MeasuredTouch> touches;
  std::vector<uint64_t> ids;
  for (const JournalTouch& touch : done) {
    const auto command = ParseCommandBytes(touch.command);
    if (!command)
      return absl::DataLossError(
          absl::StrCat(where, ": the command of touch '", touch.id, "' cannot be read; it is damaged"));
    MeasuredTouch& measured = touches.emplace_back();
    measured.touch = touch.number;
    measured.object = touch.object;
    measured.commanded = *command;
    // What was touched is what the session says, whatever the plan was made from.
    measured.commanded.mutable_covariates()->erase(kEmulatedCovariate);
    if (emulated) (*measured.commanded.mutable_covariates())[kEmulatedCovariate] = 1;
    if (!std::isnan(touch.result.session_time_s))
      measured.commanded.set_session_time_s(touch.result.session_time_s);
    for (const JournalFinger& finger : touch.result.fingers) measured.time_s.push_back(finger.contact_time_s);
    measured.round = touch.round;
    measured.face = touch.face;
    // "007" would not come back as it was.
    uint64_t id = 0;
    if (absl::SimpleAtoi(touch.id, &id) && std::to_string(id) == touch.id && id <= 1ull << 53)
      ids.push_back(id);
  }
  if (ids.size() == touches.size())
    for (size_t i = 0; i < ids.size(); ++i) touches[i].touch = ids[i];
  return touches;
}

absl::StatusOr<std::vector<MeasuredTouch>> SessionMeasurements(const Journal& journal,
                                                               const std::string& session) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const JournalSession head, journal.Session(session));
  std::vector<JournalTouch> done;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachTouch(session, [&](const JournalTouch& touch) {
    if (touch.stage == TouchStage::kDone) done.push_back(touch);
    return true;
  }));
  return MeasuredTouchesOf(done, head.emulated, absl::StrCat("session '", session, "'"));
}

absl::StatusOr<MeasurementSet> MakeMeasurementSet(const std::vector<MeasuredTouch>& touches,
                                                  const std::string& origin) {
  MeasurementSet set;
  set.origin = origin;
  set.has_poses = true;
  set.fingers = touches.empty() ? 0 : static_cast<int>(touches[0].time_s.size());
  if (set.fingers == 0)
    return absl::InvalidArgumentError(absl::StrCat(origin, ": has no touch with contact times"));
  // As in a file: round and face stand there if every touch has them, the others if any has.
  const MeasurementColumns columns = OptionalColumnsOf(touches);
  set.has_session_time = columns.session_time;
  for (const std::string& name : columns.covariates) set.covariates[name].reserve(touches.size());
  absl::flat_hash_map<std::string, int> objects;
  for (const MeasuredTouch& touch : touches) {
    const v1::CommandedTouch& c = touch.commanded;
    if (static_cast<int>(touch.time_s.size()) != set.fingers)
      return absl::InvalidArgumentError(absl::StrCat(origin, ": touch ", touch.touch, " has ",
                                                     touch.time_s.size(), " fingers, others have ",
                                                     set.fingers));
    set.line.push_back(static_cast<int>(set.line.size()) + 2);  // below the header
    set.touch.push_back(touch.touch);
    const auto [object, is_new] = objects.try_emplace(touch.object, static_cast<int>(objects.size()));
    if (is_new) set.objects.push_back(touch.object);
    set.object.push_back(object->second);
    set.target_m.push_back(VectorOf(c.target_m()));
    set.approach.push_back(VectorOf(c.approach()));
    set.lateral.push_back(VectorOf(c.lateral()));
    set.standoff_m.push_back(c.standoff_m());
    set.speed_m_s.push_back(c.speed_m_s());
    set.session_time_s.push_back(c.session_time_s());
    if (columns.round) set.round.push_back(*touch.round);
    if (columns.face) set.face.push_back(*touch.face);
    for (auto& [name, values] : set.covariates) {
      const auto found = c.covariates().find(name);
      values.push_back(found == c.covariates().end() ? kNaN : found->second);
    }
    set.time_s.insert(set.time_s.end(), touch.time_s.begin(), touch.time_s.end());
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckMeasurementSet(&set));
  return set;
}

absl::StatusOr<MeasurementSet> SessionMeasurementSet(const Journal& journal, const std::string& session,
                                                     const std::string& origin) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> touches,
                              SessionMeasurements(journal, session));
  return MakeMeasurementSet(touches, origin);
}

}  // namespace touchstone::session
