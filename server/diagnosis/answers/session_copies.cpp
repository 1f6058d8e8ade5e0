#include "server/diagnosis/answers/session_copies.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/diagnosis/checks/rows/duplicates.h"
#include "server/session/measurements/touch_content.h"

namespace touchstone::diagnosis {
namespace {

// What duplicates are found by: objects, poses, times.
void Append(const session::MeasurementSet& from, session::MeasurementSet* all) {
  std::vector<int> object;
  for (const std::string& name : from.objects) {
    const auto found = std::find(all->objects.begin(), all->objects.end(), name);
    object.push_back(static_cast<int>(found - all->objects.begin()));
    if (found == all->objects.end()) all->objects.push_back(name);
  }
  for (const int one : from.object) all->object.push_back(object[one]);
  const auto append = [](const auto& values, auto* to) {
    to->insert(to->end(), values.begin(), values.end());
  };
  append(from.touch, &all->touch), append(from.line, &all->line), append(from.target_m, &all->target_m);
  append(from.approach, &all->approach), append(from.lateral, &all->lateral);
  append(from.standoff_m, &all->standoff_m), append(from.speed_m_s, &all->speed_m_s);
  append(from.session_time_s, &all->session_time_s), append(from.time_s, &all->time_s);
}

absl::Status CopiesError(const session::MeasurementSet& one, const session::MeasurementSet& copy,
                         const std::string& what) {
  return absl::InvalidArgumentError(
      absl::StrCat(copy.origin, ": ", what, one.origin, one.origin == copy.origin ? ", given before" : "",
                   "; no rig repeats like that, and counted twice they would make everything too certain. "
                   "Give every measurement once"));
}

absl::StatusOr<checks::Duplicates> DuplicatesOf(const DiagnosisInput& input) {
  const absl::StatusOr<touches::Observations> o = touches::MakeObservations(input);
  if (!o.ok()) return o.status();
  return checks::FindDuplicates(*o, *input.model);
}

}  // namespace

absl::Status CheckCopies(const std::vector<DiagnosisInput>& sessions) {
  std::vector<std::string> contents;
  for (const DiagnosisInput& input : sessions) {
    contents.push_back(session::TouchContentSha256(*input.set));
    const size_t first = std::find(contents.begin(), contents.end(), contents.back()) - contents.begin();
    if (first + 1 < contents.size())
      return CopiesError(*sessions[first].set, *input.set, "holds the same touches with the same times as ");
  }
  // All as one file.
  DiagnosisInput together = sessions[0];
  auto all = std::make_shared<session::MeasurementSet>();
  all->origin = sessions[0].set->origin;
  all->fingers = sessions[0].set->fingers;
  all->has_poses = all->has_session_time = true;
  std::vector<int> session_of_row;
  int within = 0;
  for (size_t s = 0; s < sessions.size(); ++s) {
    const session::MeasurementSet& set = *sessions[s].set;
    Append(set, all.get());
    all->has_session_time &= set.has_session_time;
    session_of_row.resize(all->size(), static_cast<int>(s));
    together.surfaces.insert(sessions[s].surfaces.begin(), sessions[s].surfaces.end());
    const absl::StatusOr<checks::Duplicates> own = DuplicatesOf(sessions[s]);
    if (!own.ok()) return absl::OkStatus();  // each session says by itself what it lacks
    within += own->rows;
  }
  together.set = all;
  const absl::StatusOr<checks::Duplicates> found = DuplicatesOf(together);
  if (!found.ok() || found->rows <= within) return absl::OkStatus();
  // The first touch of one session that stands in another.
  for (int row = found->example; row < all->size(); ++row)
    for (int other = 0; other < row && session_of_row[other] != session_of_row[row]; ++other) {
      bool equal = true;
      for (int i = 0; i < all->fingers && equal; ++i) equal = all->TimeS(row, i) == all->TimeS(other, i);
      if (!equal || all->target_m[row] != all->target_m[other] || all->approach[row] != all->approach[other])
        continue;
      return CopiesError(*sessions[session_of_row[other]].set, *sessions[session_of_row[row]].set,
                         absl::StrCat(found->rows - within, " touches (touch ", all->touch[row],
                                      " among them) stand to the last digit in "));
    }
  return absl::OkStatus();
}

}  // namespace touchstone::diagnosis
