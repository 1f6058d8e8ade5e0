// A session as HDF5, in SI so that every number comes back bit for bit.
#include <absl/strings/str_cat.h>

#include <array>
#include <limits>
#include <optional>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/hdf5/hdf5_file.h"
#include "server/session/images/emulated.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/recorded/touch_series.h"
#include "server/session/session_content_checks.h"
#include "server/session/session_files.h"
#include "server/session/session_hdf5_images.h"

namespace touchstone::session {
namespace {

constexpr char kFormat[] = "touchstone: session/1";
constexpr uint64_t kMaxRows = 1u << 28;
constexpr uint64_t kNoNumber = std::numeric_limits<uint64_t>::max();  // of a round or face that is unknown

void Append(const v1::Vector3& v, std::vector<double>* values) {
  values->insert(values->end(), {v.x(), v.y(), v.z()});
}

// Commands as numbers that others read.
struct Commanded {
  std::vector<double> target, approach, lateral, standoff, speed;

  void Append(const JournalTouch& touch) {
    const v1::CommandedTouch command = ParseCommandBytes(touch.command).value_or(v1::CommandedTouch());
    session::Append(command.target_m(), &target);
    session::Append(command.approach(), &approach);
    session::Append(command.lateral(), &lateral);
    standoff.push_back(command.standoff_m());
    speed.push_back(command.speed_m_s());
  }
  struct Column {
    const char *name, *unit;
    const std::vector<double>* values;
    hsize_t per_row;
  };
  std::array<Column, 5> Columns() const {
    return {{{"target_m", "m", &target, 3},
             {"approach", "", &approach, 3},
             {"lateral", "", &lateral, 3},
             {"standoff_m", "m", &standoff, 1},
             {"commanded_speed_m_s", "m/s", &speed, 1}}};
  }
};

void WriteTouches(const std::vector<JournalTouch>& touches, hsize_t fingers, Hdf5Columns* columns) {
  const hsize_t rows = touches.size();
  std::vector<std::string> ids, objects, up_faces, commands;
  std::vector<uint64_t> attempt, round, face, recovered, ticks;
  Commanded commanded;
  std::vector<double> speed, session_time, start, time_uncertainty, synchronisation, drift, time, position,
      rotation;
  for (const JournalTouch& touch : touches) {
    ids.push_back(touch.id);
    objects.push_back(touch.object);
    up_faces.push_back(touch.up_face);
    commands.push_back(touch.command);
    attempt.push_back(static_cast<uint64_t>(touch.attempt));
    round.push_back(touch.round ? static_cast<uint64_t>(*touch.round) : kNoNumber);
    face.push_back(touch.face ? static_cast<uint64_t>(*touch.face) : kNoNumber);
    commanded.Append(touch);
    const JournalResult& result = touch.result;
    speed.push_back(result.speed_m_s);
    session_time.push_back(result.session_time_s);
    start.push_back(result.start_unix_s);
    time_uncertainty.push_back(result.time_uncertainty_s);
    synchronisation.push_back(result.synchronisation_uncertainty_s);
    drift.push_back(result.effector_drift);
    recovered.push_back(result.recovered);
    for (const JournalFinger& finger : result.fingers) {
      time.push_back(finger.contact_time_s);
      position.insert(position.end(), finger.base_from_tip.begin(), finger.base_from_tip.begin() + 3);
      rotation.insert(rotation.end(), finger.base_from_tip.begin() + 3, finger.base_from_tip.end());
      ticks.push_back(finger.ticks);
    }
  }
  columns->Texts("id", ids);
  columns->Texts("object", objects);
  columns->Texts("placement", up_faces);
  for (const auto& [name, unit, values, per_row] : commanded.Columns())
    columns->Numbers(name, unit, *values, per_row == 1 ? std::vector{rows} : std::vector{rows, per_row});
  columns->Numbers("contact_time_s", "s", time, {rows, fingers});
  columns->Numbers("base_from_tip_position_m", "m", position, {rows, fingers, 3});
  columns->Numbers("base_from_tip_rotation_rad", "rad", rotation, {rows, fingers, 3});
  columns->Whole("ticks", ticks, {rows, fingers});
  columns->Numbers("measured_speed_m_s", "m/s", speed, {rows});
  columns->Numbers("session_time_s", "s", session_time, {rows});
  columns->Numbers("start_unix_s", "s", start, {rows});
  columns->Numbers("time_uncertainty_s", "s", time_uncertainty, {rows});
  columns->Numbers("synchronisation_uncertainty_s", "s", synchronisation, {rows});
  columns->Numbers("effector_drift", "", drift, {rows});
  columns->Whole("recovered", recovered, {rows});
  columns->Whole("attempt", attempt, {rows});
  columns->Whole("round", round, {rows});
  columns->Whole("face", face, {rows});
  columns->Bytes("command", commands);
}

// Series end to end, and how many states each touch has; nothing if no touch has one.
absl::Status WriteSeries(const Journal& journal, const std::string& session,
                         const std::vector<JournalTouch>& touches, Hdf5Columns* columns) {
  std::vector<uint64_t> states;
  std::vector<double> time, joints, position, rotation, force;
  for (const JournalTouch& touch : touches) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<JournalSeries> kept, journal.Series(session, touch.id));
    v1::TouchSeries series;
    if (kept.has_value()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(series, ParseSeries(*kept, absl::StrCat("touch '", touch.id, "'")));
    }
    states.push_back(series.time_s_size());
    time.insert(time.end(), series.time_s().begin(), series.time_s().end());
    joints.insert(joints.end(), series.joints_rad().begin(), series.joints_rad().end());
    force.insert(force.end(), series.tip_force_n().begin(), series.tip_force_n().end());
    for (int k = 0; k < series.base_from_tip_size(); ++k)
      (k % 6 < 3 ? position : rotation).push_back(series.base_from_tip(k));
  }
  if (time.empty()) return absl::OkStatus();
  const hsize_t rows = time.size();
  columns->Whole("series/states", states, {states.size()});
  columns->Numbers("series/time_s", "s", time, {rows});
  columns->Numbers("series/joints_rad", "rad", joints, {rows, 6});
  columns->Numbers("series/base_from_tip_position_m", "m", position, {rows, 3});
  columns->Numbers("series/base_from_tip_rotation_rad", "rad", rotation, {rows, 3});
  columns->Numbers("series/tip_force_n", "N", force, {rows, 3});
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::optional<JournalSeries>>> ReadSeriesOf(const Hdf5ColumnsReader& file,
                                                                       uint64_t touches) {
  std::vector<std::optional<JournalSeries>> all;
  if (touches == 0 || !file.Has("series/states")) return all;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto states, file.Whole("series/states", touches));
  uint64_t rows = 0;
  for (const uint64_t count : states) {
    if (count > kMaxRows || (rows += count) > kMaxRows)
      return absl::InvalidArgumentError("series/states: more states than can be read");
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto time, file.Numbers("series/time_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto joints, file.Numbers("series/joints_rad", 6 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto position, file.Numbers("series/base_from_tip_position_m", 3 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto rotation,
                              file.Numbers("series/base_from_tip_rotation_rad", 3 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto force, file.Numbers("series/tip_force_n", 3 * rows));
  uint64_t row = 0;
  for (const uint64_t count : states) {
    v1::TouchSeries series;
    for (const uint64_t end = row + count; row < end; ++row) {
      series.add_time_s(time[row]);
      for (int k = 0; k < 6; ++k) series.add_joints_rad(joints[6 * row + k]);
      for (int k = 0; k < 3; ++k) series.add_base_from_tip(position[3 * row + k]);
      for (int k = 0; k < 3; ++k) series.add_base_from_tip(rotation[3 * row + k]);
      for (int k = 0; k < 3; ++k) series.add_tip_force_n(force[3 * row + k]);
    }
    all.emplace_back();
    if (count > 0) all.back() = JournalSeries{kSeriesEncoding, series.SerializeAsString()};
  }
  return all;
}

// A number that is unknown where it is kNoNumber.
absl::Status ReadNumber(const std::string& path, const char* name, uint64_t row, uint64_t value,
                        std::optional<int>* number) {
  if (value == kNoNumber) return absl::OkStatus();
  if (value > static_cast<uint64_t>(std::numeric_limits<int>::max()))
    return absl::InvalidArgumentError(absl::StrCat(path, ": touch ", row, ": ", name, " (", value,
                                                   ") is out of range; 0 to ",
                                                   std::numeric_limits<int>::max(), " was expected"));
  *number = static_cast<int>(value);
  return absl::OkStatus();
}

// What is also written as numbers for others to read says what the command says.
absl::Status CheckCommands(const Hdf5ColumnsReader& file, const std::string& path,
                           const std::vector<JournalTouch>& touches) {
  Commanded commanded;
  for (const JournalTouch& touch : touches) commanded.Append(touch);
  for (const auto& [name, unit, values, per_row] : commanded.Columns()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto there, file.Numbers(name, values->size()));
    for (size_t k = 0; k < there.size(); ++k)
      if (there[k] != (*values)[k])
        return absl::InvalidArgumentError(absl::StrCat(path, ": touch ", k / per_row, ": dataset ", name,
                                                       " has ", ShortestNumber(there[k]), ", its command ",
                                                       ShortestNumber((*values)[k])));
  }
  return absl::OkStatus();
}

absl::Status ReadTouches(const Hdf5ColumnsReader& file, const std::string& path, uint64_t rows,
                         uint64_t fingers, std::vector<JournalTouch>* touches) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto ids, file.Texts("id", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto objects, file.Texts("object", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto up_faces, file.Texts("placement", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto commands, file.Bytes("command", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto attempt, file.Whole("attempt", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto round, file.Whole("round", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto face, file.Whole("face", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto recovered, file.Whole("recovered", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto speed, file.Numbers("measured_speed_m_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto session_time, file.Numbers("session_time_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto start, file.Numbers("start_unix_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto uncertainty, file.Numbers("time_uncertainty_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto synchronisation,
                              file.Numbers("synchronisation_uncertainty_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto drift, file.Numbers("effector_drift", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto time, file.Numbers("contact_time_s", rows * fingers));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto position,
                              file.Numbers("base_from_tip_position_m", rows * fingers * 3));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto rotation,
                              file.Numbers("base_from_tip_rotation_rad", rows * fingers * 3));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto ticks, file.Whole("ticks", rows * fingers));
  touches->resize(rows);
  for (uint64_t k = 0; k < rows; ++k) {
    JournalTouch& touch = (*touches)[k];
    touch.id = ids[k];
    touch.number = k;
    touch.object = objects[k];
    touch.up_face = up_faces[k];
    touch.command = commands[k];
    touch.stage = TouchStage::kDone;
    std::optional<int> number;
    TOUCHSTONE_RETURN_IF_ERROR(ReadNumber(path, "attempt", k, attempt[k], &number));
    touch.attempt = number.value_or(0);
    TOUCHSTONE_RETURN_IF_ERROR(ReadNumber(path, "round", k, round[k], &touch.round));
    TOUCHSTONE_RETURN_IF_ERROR(ReadNumber(path, "face", k, face[k], &touch.face));
    if (recovered[k] > 1)
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": touch ", k, ": recovered (", recovered[k], ") is neither 0 nor 1"));
    touch.result.recovered = recovered[k] != 0;
    touch.result.speed_m_s = speed[k];
    touch.result.session_time_s = session_time[k];
    touch.result.start_unix_s = start[k];
    touch.result.time_uncertainty_s = uncertainty[k];
    touch.result.synchronisation_uncertainty_s = synchronisation[k];
    touch.result.effector_drift = drift[k];
    for (uint64_t i = k * fingers; i < (k + 1) * fingers; ++i) {
      JournalFinger& finger = touch.result.fingers.emplace_back();
      finger.contact_time_s = time[i];
      for (int axis = 0; axis < 3; ++axis) {
        finger.base_from_tip[axis] = position[3 * i + axis];
        finger.base_from_tip[3 + axis] = rotation[3 * i + axis];
      }
      finger.ticks = ticks[i];
    }
  }
  return CheckCommands(file, path, *touches);
}

}  // namespace

absl::Status ExportSessionHdf5(const Journal& journal, const std::string& name, const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const JournalSession session, journal.Session(name));
  std::vector<JournalTouch> touches;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachTouch(name, [&](const JournalTouch& touch) {
    if (touch.stage == TouchStage::kDone) touches.push_back(touch);
    return true;
  }));
  std::vector<JournalImage> images;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachImage(name, [&](const JournalImage& image) {
    images.push_back(image);
    return true;
  }));
  if (touches.empty() && images.empty())
    return absl::FailedPreconditionError(
        absl::StrCat("session '", name,
                     "' has no touch that is done and no picture; there is nothing to write to ", path));
  const auto fingers = static_cast<hsize_t>(session.fingers);
  Hdf5Columns columns(path);
  columns.Texts("session/format", {kFormat});
  columns.Texts("session/name", {session.name});
  columns.Texts("session/source", {session.provenance});
  columns.Whole("session/emulated", {session.emulated ? 1u : 0u}, {1});
  columns.Texts("session/calibration", {session.calibration});
  columns.Numbers("session/created_unix_s", "s", {session.created_unix_s}, {1});
  columns.Numbers("session/spacing_m", "m", {session.spacing_m}, {1});
  columns.Whole("session/fingers_touches_images", {fingers, touches.size(), images.size()}, {3});
  WriteTouches(touches, fingers, &columns);
  TOUCHSTONE_RETURN_IF_ERROR(WriteSeries(journal, name, touches, &columns));
  WriteHdf5Images(images, &columns);
  return columns.Finish();
}

absl::StatusOr<SessionContent> ReadSessionHdf5(const std::string& path, const ImportOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5ColumnsReader file, Hdf5ColumnsReader::Open(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto format, file.Texts("session/format", 1));
  if (format[0] != kFormat)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": is of format '", format[0], "'; this program reads '", kFormat, "'"));
  SessionContent content;
  JournalSession& session = content.session;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto name, file.Texts("session/name", 1));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, file.Texts("session/source", 1));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto calibration, file.Texts("session/calibration", 1));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto created_unix_s, file.Numbers("session/created_unix_s", 1));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto spacing_m, file.Numbers("session/spacing_m", 1));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto counts, file.Whole("session/fingers_touches_images", 3));
  session.name = options.session.empty() ? name[0] : options.session;
  session.provenance = options.provenance.empty() ? source[0] : options.provenance;
  // Files of before it was kept have the note alone.
  session.emulated = NotedAsEmulated(source[0]);
  if (file.Has("session/emulated")) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto emulated, file.Whole("session/emulated", 1));
    session.emulated = emulated[0] != 0;
  }
  session.calibration = calibration[0];
  session.created_unix_s = created_unix_s[0];
  session.spacing_m = spacing_m[0];
  for (const uint64_t count : counts)
    if (count > kMaxRows)
      return absl::InvalidArgumentError(absl::StrCat(path, ": ", count, " rows cannot be read"));
  session.fingers = static_cast<int>(counts[0]);
  TOUCHSTONE_RETURN_IF_ERROR(ReadTouches(file, path, counts[1], counts[0], &content.touches));
  TOUCHSTONE_RETURN_IF_ERROR(ReadHdf5Images(file, counts[2], &content.images));
  TOUCHSTONE_ASSIGN_OR_RETURN(content.series, ReadSeriesOf(file, counts[1]));
  TOUCHSTONE_RETURN_IF_ERROR(CheckSessionContent(content, path));
  return content;
}

}  // namespace touchstone::session
