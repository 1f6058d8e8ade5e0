#include "server/session/journal/journal_views.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::session {

absl::Status InsertView(SqliteFile* file, int64_t image_id, const JournalView& view) {
  SqliteStatement insert = file->Prepare(
      "INSERT INTO image_view(image_id, eye_x_m, eye_y_m, eye_z_m, at_x_m, at_y_m, at_z_m, up_x, up_y, up_z, "
      "object_x_m, object_y_m, object_z_m, object_rotation_x_rad, object_rotation_y_rad, "
      "object_rotation_z_rad, session_time_s, fx_px, fy_px, cx_px, cy_px, distortion) "
      "VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.Bind(image_id);
  for (const std::array<double, 3>* point : {&view.eye_m, &view.at_m, &view.up})
    for (const double value : *point) insert.Bind(value);
  for (const double value : view.base_from_object) insert.Bind(value);
  insert.Bind(view.session_time_s);
  insert.Bind(view.fx_px).Bind(view.fy_px).Bind(view.cx_px).Bind(view.cy_px);
  insert.Bind(absl::string_view(
      absl::StrJoin(view.distortion, " ", [](std::string* out, double k) { *out += ShortestNumber(k); })));
  return insert.Run();
}

absl::StatusOr<std::optional<JournalView>> ReadView(SqliteFile* file, int64_t image_id) {
  SqliteStatement row = file->Prepare(
      "SELECT eye_x_m, eye_y_m, eye_z_m, at_x_m, at_y_m, at_z_m, up_x, up_y, up_z, object_x_m, object_y_m, "
      "object_z_m, object_rotation_x_rad, object_rotation_y_rad, object_rotation_z_rad, session_time_s, "
      "fx_px, fy_px, cx_px, cy_px, distortion FROM image_view WHERE image_id = ?");
  row.Bind(image_id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found) return std::optional<JournalView>();
  JournalView view;
  int column = 0;
  for (std::array<double, 3>* point : {&view.eye_m, &view.at_m, &view.up})
    for (double& value : *point) value = row.Double(column++);
  for (double& value : view.base_from_object) value = row.Double(column++);
  for (double* value : {&view.session_time_s, &view.fx_px, &view.fy_px, &view.cx_px, &view.cy_px})
    *value = row.Double(column++);
  for (const absl::string_view word : absl::StrSplit(row.Text(column), ' ', absl::SkipEmpty()))
    if (double k = 0; absl::SimpleAtod(word, &k))
      view.distortion.push_back(k);
    else
      return absl::DataLossError(absl::StrCat("journal ", file->path(),
                                              ": the lens of a picture has the coefficient '", word,
                                              "'; a number was expected"));
  return std::optional<JournalView>(std::move(view));
}

}  // namespace touchstone::session
