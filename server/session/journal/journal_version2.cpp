#include "server/session/journal/journal_version2.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/journal/journal_schema.h"

namespace touchstone::session {

const char kNoViews[] = R"sql(
PRAGMA temp_store = MEMORY;
CREATE TEMP VIEW image_view AS
  SELECT 0 AS image_id, 0 AS eye_x_m, 0 AS eye_y_m, 0 AS eye_z_m, 0 AS at_x_m, 0 AS at_y_m, 0 AS at_z_m,
    0 AS up_x, 0 AS up_y, 0 AS up_z, 0 AS object_x_m, 0 AS object_y_m, 0 AS object_z_m,
    0 AS object_rotation_x_rad, 0 AS object_rotation_y_rad, 0 AS object_rotation_z_rad, 0 AS session_time_s,
    0 AS fx_px, 0 AS fy_px, 0 AS cx_px, 0 AS cy_px, '' AS distortion
  WHERE 0;
)sql";

namespace {

// A damaged number must not make pictures lose their views.
absl::Status WantNoViews(SqliteFile* file) {
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const int64_t later, file->Number("SELECT count(*) FROM main.sqlite_master WHERE name = 'image_view'"));
  if (later == 0) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("journal ", file->path(),
                   " is damaged: it calls itself version 2 and has tables of a later one; ", kRescueTheFile));
}

}  // namespace

absl::Status ReadAsVersion2(SqliteFile* file) {
  TOUCHSTONE_RETURN_IF_ERROR(WantNoViews(file));
  return file->Run(kNoViews);
}

absl::Status MigrateFromVersion2(SqliteFile* file) {
  TOUCHSTONE_RETURN_IF_ERROR(WantNoViews(file));
  return file->Transact([&]() -> absl::Status {
    TOUCHSTONE_RETURN_IF_ERROR(file->Run(kViewSchema));
    static const std::string version = absl::StrCat("PRAGMA user_version = ", kJournalVersion);
    return file->Run(version.c_str());
  });
}

}  // namespace touchstone::session
