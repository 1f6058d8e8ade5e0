#include "client/cli/common/common.h"

#include <absl/strings/match.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "client/cli/common/progress_bar.h"
#include "client/cli/common/terminal.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::cli {

namespace {

constexpr uint64_t kMaxModelBytes = 16 << 20;

}  // namespace

ExitCode ExitCodeOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kDone;
    case absl::StatusCode::kUnavailable:
      return kUnreachable;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kOutOfRange:
    case absl::StatusCode::kAlreadyExists:
      return kBadInput;
    default:
      return kRefused;
  }
}

absl::StatusOr<v1::Vector3> ParseVector(const std::string& name, const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  const auto wrong = [&](absl::string_view why) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, ": '", text, "' ", why, "; three numbers with commas were expected, for instance 0,0,-1"));
  };
  if (parts.size() != 3)
    return wrong(absl::StrCat("has ", parts.size(), parts.size() == 1 ? " part" : " parts"));
  double values[3];
  for (int i = 0; i < 3; ++i) {
    const absl::StatusOr<double> value = ParseNumber(parts[i]);
    if (!value.ok()) return wrong(absl::StrCat("is no vector: ", value.status().message()));
    values[i] = *value;
  }
  v1::Vector3 vector;
  vector.set_x(values[0]);
  vector.set_y(values[1]);
  vector.set_z(values[2]);
  return vector;
}

absl::StatusOr<v1::Vector3> ParseMillimetres(const std::string& name, const std::string& text) {
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::Vector3 v, ParseVector(name, text));
  v.set_x(ToSi(Unit::kMillimetre, v.x()));
  v.set_y(ToSi(Unit::kMillimetre, v.y()));
  v.set_z(ToSi(Unit::kMillimetre, v.z()));
  return v;
}

absl::StatusOr<v1::ModelRef> ParseModelRef(const std::string& text) {
  v1::ModelRef ref;
  if (text.empty()) return ref;
  const std::filesystem::path path(text);
  const bool looks_like_file =
      text.find('/') != std::string::npos || path.extension() == ".yaml" || path.extension() == ".yml";
  if (looks_like_file) {
    TOUCHSTONE_ASSIGN_OR_RETURN(*ref.mutable_yaml(), ReadFile(text, kMaxModelBytes));
    // What is wrong with it is said here, where the file has a name.
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const model::Model model,
        model::ParseModel(ref.yaml(), text, effects::Catalogue(), model::FilesBeside(text)));
    // A server cannot read files that a model names: their content goes along.
    if (absl::StrContains(ref.yaml(), "surface_map")) ref.set_yaml(model::FormatModel(model));
    return ref;
  }
  std::error_code ignored;
  if (path.has_extension() && std::filesystem::is_regular_file(path, ignored))
    return absl::InvalidArgumentError(
        absl::StrCat("model: '", text, "' is a file, but no model file: the name of one ends in .yaml"));
  const bool hex = text.size() >= 8 && text.size() <= 64 &&
                   text.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (hex)
    ref.set_hash(text);
  else
    ref.set_name(text);
  return ref;
}

std::vector<std::string> SplitCommas(const std::vector<std::string>& texts) {
  std::vector<std::string> result;
  for (const std::string& text : texts)
    for (const absl::string_view part : absl::StrSplit(text, ','))
      if (!part.empty()) result.emplace_back(part);
  return result;
}

absl::StatusOr<std::string> OneOf(const std::string& name, const std::string& text,
                                  const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), text) != known.end()) return text;
  return absl::InvalidArgumentError(absl::StrCat(name, ": '", text, "' is unknown", DidYouMean(text, known)));
}

constexpr size_t kBelow = 4;  // where a column begins that stands below its row

std::string Table::Text() const {
  std::vector<size_t> widths = Widths();
  size_t total = 0;
  for (const size_t width : widths) total += width + 2;
  // Without room for all columns the last one stands below its row.
  const bool last_below = widths.size() > 2 && total > TextWidth() + 2;
  if (last_below) widths.pop_back();
  std::string text;
  for (const auto& row : rows_) {
    std::vector<std::vector<std::string>> cells;
    size_t lines = 1;
    for (size_t i = 0; i < std::min(row.size(), widths.size()); ++i) {
      cells.push_back(absl::StrSplit(Wrap(row[i], widths[i], 0), '\n'));
      lines = std::max(lines, cells.back().size());
    }
    for (size_t line = 0; line < lines; ++line) {
      std::string shown;
      for (size_t i = 0, begins = 0; i < cells.size(); begins += widths[i] + 2, ++i) {
        if (line >= cells[i].size()) continue;
        shown.append(begins > shown.size() ? begins - shown.size() : 0, ' ');
        shown += cells[i][line];
      }
      shown.erase(shown.find_last_not_of(' ') + 1);
      absl::StrAppend(&text, shown, "\n");
    }
    if (last_below && row.size() > widths.size())
      absl::StrAppend(&text, std::string(kBelow, ' '), Wrap(row.back(), TextWidth(), kBelow), "\n");
  }
  return text;
}

std::vector<size_t> Table::Widths() const {
  std::vector<size_t> widths, longest_word;
  for (const auto& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()));
    longest_word.resize(widths.size());
    for (size_t i = 0; i < row.size(); ++i) {
      widths[i] = std::max(widths[i], row[i].size());
      for (const absl::string_view word : absl::StrSplit(row[i], ' '))
        longest_word[i] = std::max(longest_word[i], word.size());
    }
  }
  size_t total = 0;
  for (const size_t width : widths) total += width + 2;
  for (; total > TextWidth() + 2; --total) {
    size_t* widest = nullptr;
    for (size_t i = 0; i < widths.size(); ++i)
      if (widths[i] > longest_word[i] && (widest == nullptr || widths[i] > *widest)) widest = &widths[i];
    if (widest == nullptr) break;
    --*widest;
  }
  return widths;
}

std::string Rounded(double value) {
  char text[32];
  constexpr double kWholeFrom = 1000;
  const bool whole = std::abs(value) >= kWholeFrom && std::abs(value) < 1e15;
  std::snprintf(text, sizeof text, whole ? "%.0f" : "%.4g", value);
  return text;
}

std::string Counted(uint64_t count, const std::string& one, const std::string& many) {
  return absl::StrCat(count, " ", count == 1 ? one : many);
}

std::string UtcText(double unix_s) {
  const auto seconds = static_cast<std::time_t>(unix_s);
  std::tm parts{};
  char text[32] = "";
  if (::gmtime_r(&seconds, &parts) != nullptr)
    std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S UTC", &parts);
  return text;
}

std::string FromJournalText(size_t count, size_t all, double first_unix_s) {
  return absl::StrCat(count, " of ", Counted(all, "touch", "touches"), count == 1 ? " comes" : " come",
                      " from the gateway's journal",
                      first_unix_s > 0 ? ", made at " + UtcText(first_unix_s) : "");
}

void PrintJson(const Json& json) {
  ProgressBar::ClearShown();
  std::printf("%s\n", EscapeInJson(json.dump(2, ' ', false, Json::error_handler_t::replace)).c_str());
}

}  // namespace touchstone::cli
