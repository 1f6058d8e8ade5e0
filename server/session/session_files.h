// A session of a journal as files that other programs read, and such files as sessions that can be kept and
// served again.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"

namespace touchstone::session {

// The measurement file (format: proto/README.md); whole or absent. FAILED_PRECONDITION if no touch is done.
absl::Status ExportSessionCsv(const Journal& journal, const std::string& session, const std::string& path);

// HDF5 in SI: one dataset per column with the attribute "unit", one row per touch that is done (contact_time_s is
// touches x fingers, base_from_tip_position_m touches x fingers x 3, NaN where unknown); pictures under
// /images (PNG files end to end, png_offset says where each begins); what is known of the session under
// /session. Whole or absent.
absl::Status ExportSessionHdf5(const Journal& journal, const std::string& session, const std::string& path);

struct ImportOptions {
  std::string session;      // its name; empty: that of an HDF5 file
  double spacing_m = 0.03;  // of the fingers; a measurement file does not say
  std::string provenance;   // where the touches were made; default: "imported from FILE"
  double created_unix_s = 0;
};

// Files as what Journal::AddSession takes, checked alike (session_content_checks.h): a measurement file with poses, whose
// touch numbers are the ids, ...
absl::StatusOr<SessionContent> ReadSessionCsv(const std::string& path, const ImportOptions& options);
// ... and what ExportSessionHdf5 wrote, as the session that it was; under another name if options.session is not
// empty.
absl::StatusOr<SessionContent> ReadSessionHdf5(const std::string& path, const ImportOptions& options);

}  // namespace touchstone::session
