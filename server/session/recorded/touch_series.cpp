#include "server/session/recorded/touch_series.h"

#include <absl/strings/str_cat.h>

namespace touchstone::session {

absl::StatusOr<v1::TouchSeries> ParseSeries(const JournalSeries& series, const std::string& where) {
  if (series.encoding != kSeriesEncoding)
    return absl::DataLossError(absl::StrCat(where, ": its series is encoded as '", series.encoding,
                                            "'; this program reads '", kSeriesEncoding, "'"));
  v1::TouchSeries states;
  const bool read = states.ParseFromString(series.columns);
  const int count = states.time_s_size();
  if (!read || states.joints_rad_size() != 6 * count || states.base_from_tip_size() != 6 * count ||
      states.tip_force_n_size() != 3 * count)
    return absl::DataLossError(absl::StrCat(where, ": its series cannot be read"));
  return states;
}

}  // namespace touchstone::session
