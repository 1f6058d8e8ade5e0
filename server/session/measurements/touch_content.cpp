#include "server/session/measurements/touch_content.h"

#include <absl/strings/string_view.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "server/base/text/text.h"

namespace touchstone::session {
namespace {

constexpr double kPerMetre = 1e9, kPerSecond = 1e9, kPerUnit = 1e7;
constexpr double kMaxExact = 9e18;  // int64 holds it

// Least significant byte first, so that every machine has the same bytes.
void Append(double value, double steps, std::string* bytes) {
  const double scaled = std::clamp(value * steps, -kMaxExact, kMaxExact);
  const auto rounded =
      static_cast<uint64_t>(std::isnan(value) ? std::numeric_limits<int64_t>::min() : std::llround(scaled));
  for (int shift = 0; shift < 64; shift += 8) bytes->push_back(static_cast<char>(rounded >> shift));
}

}  // namespace

std::string TouchContentSha256(const MeasurementSet& set) {
  std::vector<std::string> rows(set.size());
  for (int row = 0; row < set.size(); ++row) {
    std::string& bytes = rows[row];
    if (set.has_poses) {
      for (int axis = 0; axis < 3; ++axis) Append(set.target_m[row][axis], kPerMetre, &bytes);
      for (int axis = 0; axis < 3; ++axis) Append(set.approach[row][axis], kPerUnit, &bytes);
      for (int axis = 0; axis < 3; ++axis) Append(set.lateral[row][axis], kPerUnit, &bytes);
      Append(set.standoff_m[row], kPerMetre, &bytes);
      Append(set.speed_m_s[row], kPerUnit, &bytes);
    }
    for (int finger = 0; finger < set.fingers; ++finger) Append(set.TimeS(row, finger), kPerSecond, &bytes);
  }
  std::sort(rows.begin(), rows.end());
  return Sha256Hex(std::vector<absl::string_view>(rows.begin(), rows.end()));
}

}  // namespace touchstone::session
