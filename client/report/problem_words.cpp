// The kinds of mistakes that a measurement file may have, in words.
#include <map>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "client/report/words.h"

namespace touchstone::client {

std::string ProblemTitle(const v1::DataProblem& problem) {
  static const std::map<std::string, const char*> kTitles = {
      {"finger_order", "columns of the fingers exchanged"},
      {"lateral_reversed", "lateral vectors reversed"},
      {"approach_reversed", "approach vectors reversed"},
      {"object_names", "names of objects exchanged"},
      {"wrong_mesh", "an object's mesh is another's"},
      {"frame", "another frame"},
      {"units_time", "times in another unit"},
      {"units_length", "lengths in another unit"},
      {"speed_factor", "speeds off by a factor"},
      {"row_shift", "results in the wrong rows"},
      {"object_origin", "another origin of objects"},
      {"duplicates", "rows copied under new numbers"},
      // Of photographs.
      {"channel_order", "red and blue exchanged"},
      {"mirrored", "mirrored pictures"},
      {"rotated", "pictures turned"},
      {"units_angle", "radians and degrees mixed up"},
      {"up_axis", "another axis is up"},
      {"eye_at", "eye and at exchanged"},
      {"wrong_object", "another object"},
      {"focal_factor", "another focal length"}};
  const auto title = kTitles.find(problem.kind());
  return absl::StrCat(title == kTitles.end() ? problem.kind() : title->second,
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
