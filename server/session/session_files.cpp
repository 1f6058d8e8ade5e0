#include "server/session/session_files.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "server/base/files/file_writer.h"
#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/images/emulated.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/session_content_checks.h"
#include "server/session/session_measurements.h"

namespace touchstone::session {

absl::Status ExportSessionCsv(const Journal& journal, const std::string& session, const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> touches,
                              SessionMeasurements(journal, session));
  if (touches.empty())
    return absl::FailedPreconditionError(absl::StrCat(
        "session '", session, "' has no touch that is done; there is nothing to write to ", path));
  return WriteFileAtomically(path, FormatMeasurements(touches));
}

absl::StatusOr<SessionContent> ReadSessionCsv(const std::string& path, const ImportOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> measured, ParseMeasurements(text, path));
  if (measured[0].time_s.empty())
    return absl::InvalidArgumentError(absl::StrCat(
        path, ":1: has no time columns (t_l_us, ...): it is a plan; a measurement file was expected"));
  SessionContent content;
  content.touches.resize(measured.size());
  for (size_t k = 0; k < measured.size(); ++k) {
    JournalTouch& touch = content.touches[k];
    touch.id = std::to_string(measured[k].touch);
    touch.number = k;
    touch.object = measured[k].object;
    touch.command = CommandBytes(measured[k].commanded);
    touch.stage = TouchStage::kDone;
    touch.round = measured[k].round;
    touch.face = measured[k].face;
    touch.result.session_time_s =
        measured[k].commanded.has_session_time_s() ? measured[k].commanded.session_time_s() : kNaN;
    touch.result.start_unix_s = kNaN;
    for (const double time_s : measured[k].time_s) {
      JournalFinger& finger = touch.result.fingers.emplace_back();
      finger.contact_time_s = time_s;
      finger.base_from_tip.fill(kNaN);
    }
  }
  JournalSession& session = content.session;
  session.name = options.session;
  session.created_unix_s = options.created_unix_s;
  session.provenance = options.provenance.empty() ? absl::StrCat("imported from ", path) : options.provenance;
  session.emulated = std::any_of(measured.begin(), measured.end(), [](const MeasuredTouch& touch) {
    const auto& covariates = touch.commanded.covariates();
    const auto found = covariates.find(kEmulatedCovariate);
    return found != covariates.end() && std::abs(found->second) > 0;
  });
  session.fingers = static_cast<int>(measured[0].time_s.size());
  session.spacing_m = options.spacing_m;
  TOUCHSTONE_RETURN_IF_ERROR(CheckSessionContent(content, path));
  return content;
}

}  // namespace touchstone::session
