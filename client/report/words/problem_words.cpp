// The kinds of mistakes that a measurement file may have, in words.
#include <map>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "client/report/words/words.h"

namespace touchstone::client {

std::string ProblemName(const v1::DataProblem& problem) {
  return absl::AsciiStrToLower(v1::DataProblem::Kind_Name(problem.kind()));
}

std::string ProblemTitle(const v1::DataProblem& problem) {
  static const std::map<v1::DataProblem::Kind, const char*> kTitles = {
      {v1::DataProblem::FINGER_ORDER, "columns of the fingers exchanged"},
      {v1::DataProblem::LATERAL_REVERSED, "lateral vectors reversed"},
      {v1::DataProblem::APPROACH_REVERSED, "approach vectors reversed"},
      {v1::DataProblem::OBJECT_NAMES, "names of objects exchanged"},
      {v1::DataProblem::WRONG_MESH, "an object's mesh is another's"},
      {v1::DataProblem::FRAME, "another frame"},
      {v1::DataProblem::UNITS_TIME, "times in another unit"},
      {v1::DataProblem::UNITS_LENGTH, "lengths in another unit"},
      {v1::DataProblem::SPEED_FACTOR, "speeds off by a factor"},
      {v1::DataProblem::ROW_SHIFT, "results in the wrong rows"},
      {v1::DataProblem::OBJECT_ORIGIN, "another origin of objects"},
      {v1::DataProblem::DUPLICATES, "rows copied under new numbers"},
      {v1::DataProblem::STALE_ROWS, "rows that repeat the one before"},
      // Of photographs.
      {v1::DataProblem::CHANNEL_ORDER, "red and blue exchanged"},
      {v1::DataProblem::MIRRORED, "mirrored pictures"},
      {v1::DataProblem::ROTATED, "pictures turned"},
      {v1::DataProblem::UNITS_ANGLE, "radians and degrees mixed up"},
      {v1::DataProblem::UP_AXIS, "another axis is up"},
      {v1::DataProblem::EYE_AT, "eye and at exchanged"},
      {v1::DataProblem::WRONG_OBJECT, "another object"},
      {v1::DataProblem::FOCAL_FACTOR, "another focal length"},
      {v1::DataProblem::EXCHANGED, "pictures exchanged"},
      {v1::DataProblem::ODD_PICTURE, "pictures of something else"},
      {v1::DataProblem::SATURATED_TIMES, "times cut off at a largest one"}};
  const auto title = kTitles.find(problem.kind());
  return absl::StrCat(title == kTitles.end() ? "a mistake in the file" : title->second,
                      problem.detail().empty() ? "" : absl::StrCat(" (", problem.detail(), ")"));
}

std::string ShellLines(const std::string& command, int columns) {
  std::string text, line;
  for (const absl::string_view word : absl::StrSplit(command, ' ')) {
    if (!line.empty() && static_cast<int>(line.size() + 1 + word.size()) > columns) {
      absl::StrAppend(&text, line, " \\\n");
      line.clear();
    }
    absl::StrAppend(&line, line.empty() ? "" : " ", word);
  }
  return text + line;
}

}  // namespace touchstone::client
