// What the terminal report says of photographs alone.
#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/error_scale.h"

namespace touchstone::client {
namespace {

constexpr int kWorstPictures = 4;

// "0.912", or "0.912 -> 0.985" with an improved model.
std::string BeforeAfter(double before, double after, bool improved, int decimals) {
  return improved && !std::isnan(after)
             ? absl::StrCat(Fixed(before, decimals), " -> ", Fixed(after, decimals))
             : Fixed(before, decimals);
}

std::string Place(const v1::Vector3& v) {
  return absl::StrCat(Fixed(1000 * v.x(), 0), " ", Fixed(1000 * v.y(), 0), " ", Fixed(1000 * v.z(), 0));
}

}  // namespace

void AddSilhouettes(const v1::Report& report, TextLayout* out) {
  const v1::PhotographSummary& summary = MainData(report).photographs();
  if (!MainData(report).has_photographs() || std::isnan(summary.silhouette_iou())) return;
  const bool improved = !report.improved_model_yaml().empty();
  std::string text =
      absl::StrCat("Outlines: overlap (IoU) ",
                   BeforeAfter(summary.silhouette_iou(), summary.silhouette_iou_after(), improved, 3));
  if (!std::isnan(summary.contour_distance_px()))
    absl::StrAppend(
        &text, ", apart by ",
        BeforeAfter(summary.contour_distance_px(), summary.contour_distance_after_px(), improved, 2),
        " px (root mean square).");
  out->Paragraph(text);
}

void AddWorstPhotographs(const v1::Report& report, TextLayout* out) {
  const v1::DataReport& data = MainData(report);
  if (data.photographs().photographs_size() < 2) return;
  std::vector<const v1::PhotographError*> errors;
  for (const v1::PhotographError& error : data.photographs().photographs()) errors.push_back(&error);
  std::stable_sort(errors.begin(), errors.end(),
                   [](const auto* a, const auto* b) { return a->rmse() > b->rmse(); });
  const ErrorScale scale(data);
  const bool improved = !report.improved_model_yaml().empty();
  std::vector<std::vector<TextLayout::Cell>> rows;
  for (size_t k = 0; k < std::min<size_t>(kWorstPictures, errors.size()); ++k) {
    const v1::PhotographError& error = *errors[k];
    rows.push_back(
        {{absl::StrCat("image ", error.image())},
         {error.object()},
         {improved ? scale.Change(error.rmse(), error.rmse_after()) : scale.Text(error.rmse()), true},
         {std::isnan(error.silhouette_iou()) ? ""
                                             : absl::StrCat("outline IoU ", Fixed(error.silhouette_iou(), 3)),
          false, TextLayout::kDim}});
  }
  out->Label("Pictures");
  out->Rows(rows);
}

void AddNextPhotographs(const v1::Report& report, TextLayout* out) {
  std::vector<std::vector<TextLayout::Cell>> rows;
  for (const v1::NextMeasurement& next : report.next()) {
    if (!next.has_photograph()) continue;
    const std::string verdict = CountToVerdict(next);
    rows.push_back(
        {{absl::StrCat("picture of ", next.object())},
         {absl::StrCat("from ", Place(next.photograph().eye_m()), " mm at ", Place(next.photograph().at_m()),
                       " mm")},
         {next.separation() > 0 ? absl::StrCat(Number(next.separation(), 2), " sigmas") : "", true},
         {absl::StrCat(next.purpose(), verdict.empty() ? "" : ": ", verdict), false, TextLayout::kDim}});
  }
  if (!rows.empty()) out->Label("Next");
  out->Rows(rows);
}

}  // namespace touchstone::client
