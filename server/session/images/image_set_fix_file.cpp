// The files of an image set fixed as text, so that what does not change keeps its bytes.
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/csv/fix_text.h"
#include "server/session/csv/plain_csv.h"
#include "server/session/images/image_set_fix.h"

namespace touchstone::session {
namespace {

// A field as CSV: in quotes where it needs them.
std::string AsField(const std::string& text) {
  if (text.find_first_of(",\"") == std::string::npos) return text;
  return absl::StrCat("\"", absl::StrReplaceAll(text, {{"\"", "\"\""}}), "\"");
}

bool SamePicture(const PhotographRow& a, const PhotographRow& b) {
  return a.pixels == b.pixels;
}

// The entry of a placement that a column holds ("eye_x_mm", "up_z"), in the unit of files; false: it holds none.
bool EntryOf(absl::string_view column, const CameraPlacement& placement, double* value) {
  static constexpr absl::string_view kAxes = "xyz";
  for (size_t axis = 0; axis < kAxes.size(); ++axis) {
    const std::string letter(1, kAxes[axis]);
    if (column == absl::StrCat("eye_", letter, "_mm"))
      *value = placement.eye_m[axis] * kMillimetresPerMetre;
    else if (column == absl::StrCat("at_", letter, "_mm"))
      *value = placement.at_m[axis] * kMillimetresPerMetre;
    else if (column == absl::StrCat("up_", letter))
      *value = placement.up[axis];
    else
      continue;
    return true;
  }
  return false;
}

// One field of a row; unchanged where the numbers are. Twelve digits: what stands behind them is rounding.
void FixField(const std::string& column, const ImageSet& before, const PhotographRow& was,
              const ImageSet& after, const PhotographRow& is, std::string* field) {
  if (column == "file" && is.file != was.file) *field = AsField(is.file);
  if (column == "object" && after.objects[is.object] != before.objects[was.object])
    *field = AsField(after.objects[is.object]);
  double old_value = 0, new_value = 0;
  absl::string_view name = column;
  if (absl::ConsumePrefix(&name, "measured_")) {
    if (!is.measured || !was.measured || !EntryOf(name, *was.measured, &old_value)) return;
    EntryOf(name, *is.measured, &new_value);
  } else {
    if (!EntryOf(name, was.commanded, &old_value)) return;
    EntryOf(name, is.commanded, &new_value);
  }
  if (old_value != new_value) *field = absl::StrFormat("%.12g", new_value + 0.0);
}

std::string CameraFile(const CameraIntrinsics& camera) {
  std::string text = absl::StrFormat(
      "{width_px: %d, height_px: %d, fx_px: %.10g, fy_px: %.10g, cx_px: %.10g, cy_px: %.10g", camera.width_px,
      camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px);
  for (const auto& [name, value] : {std::pair<const char*, double>{"k1", camera.k1},
                                    {"k2", camera.k2},
                                    {"p1", camera.p1},
                                    {"p2", camera.p2},
                                    {"k3", camera.k3}})
    if (value != 0) absl::StrAppend(&text, ", ", name, ": ", absl::StrFormat("%.10g", value));
  return text + "}\n";
}

}  // namespace

absl::StatusOr<FixedImageSet> FixImageSet(const ImageSet& set, absl::string_view images_csv,
                                          absl::string_view camera_yaml, const ImageSetFix& fix) {
  FixedImageSet fixed;
  fixed.set = set;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int> left, ApplyFix(fix, &fixed.set));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<PlainCsv> plain,
                              ConvertToPlainCsv(images_csv, set.origin, fix.plain_text));
  if (plain) images_csv = plain->text;
  const int first_line = plain ? plain->skipped_lines + 1 : 1;
  const std::vector<absl::string_view> lines = LinesWithEnds(images_csv);
  absl::string_view header = absl::StripTrailingAsciiWhitespace(lines[0]);
  fixed.images_csv = absl::StrCat(header, "\n");
  absl::ConsumePrefix(&header, "\xEF\xBB\xBF");
  CsvFields columns;
  TOUCHSTONE_RETURN_IF_ERROR(columns.Cut(header));
  for (size_t row = 0; row < left.size(); ++row) {
    const PhotographRow &was = set.photographs[left[row]], &is = fixed.set.photographs[row];
    std::vector<std::string> fields =
        RawFields(absl::StripTrailingAsciiWhitespace(lines[was.line - first_line]));
    for (size_t i = 0; i < std::min(fields.size(), columns.all().size()); ++i)
      FixField(std::string(absl::StripAsciiWhitespace(columns.all()[i])), set, was, fixed.set, is,
               &fields[i]);
    for (size_t i = 0; i < fields.size(); ++i)
      absl::StrAppend(&fixed.images_csv, i > 0 ? "," : "", fields[i]);
    fixed.images_csv += '\n';
    if (fix.changes_pixels() && !SamePicture(was, is)) fixed.changed_pixels[is.file] = is.pixels;
  }
  const std::string before = CameraFile(set.camera), after = CameraFile(fixed.set.camera);
  fixed.camera_yaml = before == after ? std::string(camera_yaml) : after;
  return fixed;
}

}  // namespace touchstone::session
