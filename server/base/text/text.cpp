#include "server/base/text/text.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>

#include "server/base/status.h"
#include "server/base/text/sha256.h"

namespace touchstone {
namespace {

// Levenshtein distance with adjacent transpositions counted as one edit.
size_t EditDistance(absl::string_view a, absl::string_view b) {
  std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    for (size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::string DidYouMean(absl::string_view word, const std::vector<std::string>& known) {
  if (known.empty()) return "";
  // No name is so long, and the time grows with the square of it.
  constexpr size_t kLongestWord = 256;
  if (word.size() > kLongestWord) word = word.substr(0, kLongestWord);
  const std::string* best = nullptr;
  size_t best_distance = std::max<size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    size_t distance = EditDistance(word, candidate);
    // A long enough prefix, or the same name without its unit suffix, is as good as one edit.
    if (word.size() >= 3 && (candidate.rfind(std::string(word), 0) == 0))
      distance = std::min<size_t>(distance, 1);
    // What shares no letter is not near, however short it is.
    if (distance >= std::max(word.size(), candidate.size())) continue;
    if (distance < best_distance) best = &candidate, best_distance = distance;
  }
  if (best != nullptr) return absl::StrCat(", did you mean '", *best, "'?");
  constexpr size_t kMax = 12;
  const size_t shown = std::min(kMax, known.size());
  std::string list = absl::StrJoin(known.begin(), known.begin() + shown, ", ");
  if (shown < known.size()) absl::StrAppend(&list, ", ... (", known.size(), " in all)");
  return absl::StrCat("; known: ", list);
}

std::string Sha256Hex(const std::vector<absl::string_view>& pieces) {
  Sha256 digest;
  for (const absl::string_view piece : pieces) digest.Add(piece);
  return digest.Hex();
}

std::string Sha256Hex(absl::string_view data) {
  return Sha256Hex(std::vector<absl::string_view>{data});
}

absl::StatusOr<std::string> Sha256HexOfFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat(path, ": cannot be read: ", std::strerror(errno)));
  Sha256 digest;
  std::vector<char> block(1 << 20);
  while (file) {
    file.read(block.data(), block.size());
    digest.Add({block.data(), static_cast<size_t>(file.gcount())});
  }
  if (file.bad()) return absl::DataLossError(absl::StrCat(path, ": reading failed"));
  return digest.Hex();
}

std::string ShortestNumber(double value) {
  char buffer[64];
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, value);
  return std::string(buffer, result.ptr);
}

std::string DurationInWords(double seconds) {
  const auto whole = static_cast<long long>(std::ceil(std::max(seconds, 0.0)));
  if (whole < 60) return absl::StrCat(whole, " s");
  if (whole < 3600) return absl::StrCat(whole / 60, " min ", whole % 60, " s");
  return absl::StrCat(whole / 3600, " h ", whole % 3600 / 60, " min");
}

absl::StatusOr<double> ParseNumber(absl::string_view text) {
  double value = 0;
  if (!absl::SimpleAtod(text, &value) && !absl::SimpleAtod(WithPlainSigns(text), &value))
    return absl::InvalidArgumentError(WhyNoNumber(text));
  if (!std::isfinite(value))
    return absl::InvalidArgumentError(absl::StrCat("'", text, "' is not a finite number"));
  return value;
}

absl::StatusOr<std::string> ReadFile(const std::string& path, uint64_t limit_bytes) {
  struct stat info;
  if (::stat(path.c_str(), &info) != 0)
    return absl::NotFoundError(absl::StrCat(path, ": ", std::strerror(errno)));
  if (!S_ISREG(info.st_mode)) return absl::InvalidArgumentError(absl::StrCat(path, ": is not a file"));
  if (static_cast<uint64_t>(info.st_size) > limit_bytes)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": has ", info.st_size, " bytes; at most ", limit_bytes, " are read"));
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat(path, ": cannot be read: ", std::strerror(errno)));
  std::string data(info.st_size, '\0');
  file.read(data.data(), data.size());
  if (file.gcount() != static_cast<std::streamsize>(data.size()))
    return absl::DataLossError(
        absl::StrCat(path, ": ended after ", file.gcount(), " of ", data.size(), " bytes"));
  return data;
}

}  // namespace touchstone
