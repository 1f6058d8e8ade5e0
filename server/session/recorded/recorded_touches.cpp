#include "server/session/recorded/recorded_touches.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/journal/command_bytes.h"

namespace touchstone::session {
namespace {

// Of the grid that similar targets are looked up in; well above the tolerance.
constexpr double kCellM = 1e-6;

std::string ExactKey(const std::string& object, const std::string& bytes) {
  return absl::StrCat(object, absl::string_view("\0", 1), bytes);
}

int64_t CellOf(double coordinate_m) {
  const double cell = std::floor(coordinate_m / kCellM);
  return std::abs(cell) < 1e15 ? static_cast<int64_t>(cell) : 0;
}

std::string CellKey(const std::string& object, int64_t x, int64_t y, int64_t z) {
  return absl::StrCat(object, absl::string_view("\0", 1), x, ",", y, ",", z);
}

}  // namespace

absl::StatusOr<std::unique_ptr<RecordedTouches>> RecordedTouches::Read(
    const Journal& journal, const std::vector<std::string>& sessions, bool failed_too) {
  std::unique_ptr<RecordedTouches> recorded(new RecordedTouches);
  std::vector<JournalSession> chosen;
  if (sessions.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(chosen, journal.Sessions());
  }
  for (const std::string& name : sessions) {
    TOUCHSTONE_ASSIGN_OR_RETURN(chosen.emplace_back(), journal.Session(name));
  }
  for (const JournalSession& session : chosen) {
    if (recorded->fingers_ == 0) {
      recorded->fingers_ = session.fingers;
      recorded->spacing_m_ = session.spacing_m;
    }
    if (session.fingers != recorded->fingers_ || session.spacing_m != recorded->spacing_m_)
      return absl::InvalidArgumentError(absl::StrCat(
          "session '", session.name, "' has ", session.fingers, " fingers ",
          FileNumber(Unit::kMillimetre, session.spacing_m), " mm apart, '", chosen[0].name, "' has ",
          recorded->fingers_, " fingers ", FileNumber(Unit::kMillimetre, recorded->spacing_m_),
          " mm apart; sessions of one end effector can be served together"));
    TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachTouch(session.name, [&](const JournalTouch& touch) {
      if (touch.stage == TouchStage::kDone || (failed_too && touch.stage == TouchStage::kFailed))
        recorded->Add(touch);
      return true;
    }));
  }
  if (recorded->touches_.empty() && !failed_too)
    return absl::InvalidArgumentError(
        "nothing was recorded: no session has a touch that is done; name a journal with measurements");
  return recorded;
}

void RecordedTouches::Add(JournalTouch touch) {
  const uint32_t row = static_cast<uint32_t>(touches_.size());
  if (std::find(objects_.begin(), objects_.end(), touch.object) == objects_.end())
    objects_.push_back(touch.object);
  by_id_[touch.id] = row;
  if (const auto command = ParseCommandBytes(touch.command)) {
    by_bytes_[ExactKey(touch.object, CommandBytes(*command))].push_back(row);
    const v1::Vector3& target = command->target_m();
    auto& cell = by_cell_[CellKey(touch.object, CellOf(target.x()), CellOf(target.y()), CellOf(target.z()))];
    const auto same = std::find_if(cell.begin(), cell.end(),
                                   [&](const Recorded& other) { return SamePath(other.command, *command); });
    if (same == cell.end())
      cell.push_back({*command, {row}});
    else
      same->rows.push_back(row);
  } else {
    by_bytes_[ExactKey(touch.object, touch.command)].push_back(row);
  }
  touches_.push_back(std::move(touch));
}

const JournalTouch* RecordedTouches::FindId(const std::string& id) const {
  const auto found = by_id_.find(id);
  return found == by_id_.end() ? nullptr : &touches_[found->second];
}

const RecordedTouches::Rows* RecordedTouches::FindRows(const std::string& object, const std::string& bytes,
                                                       const v1::CommandedTouch& command) const {
  const auto exact = by_bytes_.find(ExactKey(object, bytes));
  if (exact != by_bytes_.end()) return &exact->second;
  // The neighbour's cell too, where the target lies at the border of one.
  const v1::Vector3& target = command.target_m();
  const auto cells = [](double coordinate_m) {
    std::vector<int64_t> both = {CellOf(coordinate_m - kCommandTolerance),
                                 CellOf(coordinate_m + kCommandTolerance)};
    if (both[0] == both[1]) both.pop_back();
    return both;
  };
  for (const int64_t x : cells(target.x()))
    for (const int64_t y : cells(target.y()))
      for (const int64_t z : cells(target.z())) {
        const auto cell = by_cell_.find(CellKey(object, x, y, z));
        if (cell == by_cell_.end()) continue;
        for (const Recorded& recorded : cell->second)
          if (SamePath(recorded.command, command)) return &recorded.rows;
      }
  return nullptr;
}

const JournalTouch* RecordedTouches::Find(const std::string& object, const v1::CommandedTouch& command,
                                          uint64_t repeat) const {
  const Rows* rows = FindRows(object, CommandBytes(command), command);
  return rows == nullptr ? nullptr : &touches_[(*rows)[repeat % rows->size()]];
}

const JournalTouch* RecordedTouches::Find(const std::string& object, const std::string& command_bytes,
                                          uint64_t repeat) const {
  if (const auto command = ParseCommandBytes(command_bytes)) return Find(object, *command, repeat);
  const auto exact = by_bytes_.find(ExactKey(object, command_bytes));
  return exact == by_bytes_.end() ? nullptr : &touches_[exact->second[repeat % exact->second.size()]];
}

size_t RecordedTouches::Repeats(const std::string& object, const v1::CommandedTouch& command) const {
  const Rows* rows = FindRows(object, CommandBytes(command), command);
  return rows == nullptr ? 0 : rows->size();
}

}  // namespace touchstone::session
