// Photographs: measured, expected and what is left side by side; the pictures one by one; which to take next.
#include <algorithm>
#include <cmath>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"

namespace touchstone::client {
namespace {

constexpr size_t kMaxListed = 24;  // pictures of the table

std::string Picture(const std::string& png, const std::string& title) {
  if (png.empty()) return "";
  return absl::StrCat("<figure><img src=\"data:image/png;base64,", absl::Base64Escape(png), "\" alt=\"",
                      Escape(title), "\"><figcaption>", Escape(title), "</figcaption></figure>");
}

std::string SideBySide(const v1::Report& report) {
  const bool improved = !report.improved_model_yaml().empty();
  std::string body;
  for (const v1::PhotographMap& map : MainData(report).photographs().maps()) {
    const std::string scale = absl::StrCat("\u00b1", Fixed(map.residual_scale(), 0));
    absl::StrAppend(
        &body, "<h3>Image ", map.image(), ", ", Escape(map.object()), "</h3>\n<div class=\"photos\">",
        Picture(map.measured_png(), "measured"),
        Picture(map.before_png(), improved ? "rendered before" : "rendered"),
        improved ? Picture(map.after_png(), "rendered after") : "",
        Picture(map.residual_before_png(),
                absl::StrCat(improved ? "residual before, " : "residual, ", scale)),
        improved ? Picture(map.residual_after_png(), absl::StrCat("residual after, ", scale)) : "",
        "</div>\n");
  }
  if (body.empty()) return "";
  return absl::StrCat(
      body,
      "<p class=\"note\">Before: as the given model expects the picture, after: as the improved one does. "
      "Residuals are measured minus expected: red where the picture is brighter than expected, blue where "
      "it is darker, white where it is as expected; full colour at the grey levels that the caption gives, "
      "the same before and after.</p>\n");
}

std::string Outlines(const v1::Report& report) {
  const v1::PhotographSummary& s = MainData(report).photographs();
  if (std::isnan(s.silhouette_iou())) return "";
  const bool improved = !report.improved_model_yaml().empty();
  std::string table =
      absl::StrCat("<table class=\"narrow\">",
                   improved ? HeaderRow({"Outline of the object", ">given model", ">improved model"})
                            : HeaderRow({"Outline of the object", ">given model"}),
                   "<tbody>");
  const auto row = [&](const char* name, double before, double after, int decimals, const char* unit) {
    absl::StrAppend(&table, "<tr>", Cell(name), NumberCell(absl::StrCat(Fixed(before, decimals), unit)),
                    improved ? NumberCell(absl::StrCat(Fixed(after, decimals), unit)) : "", "</tr>");
  };
  row("Overlap, measured against expected (IoU)", s.silhouette_iou(), s.silhouette_iou_after(), 3, "");
  row("Distance of the outlines, root mean square", s.contour_distance_px(), s.contour_distance_after_px(), 2,
      " px");
  return Figure(
      absl::StrCat(table, "</tbody></table>"),
      "The measured outline is what stands out of the picture\u2019s background, whose level and "
      "scatter are taken well outside the expected object. Where the object is expected to be as bright "
      "as the background nothing can be told, and nothing is counted.");
}

std::string OneByOne(const v1::Report& report) {
  std::vector<const v1::PhotographError*> errors;
  for (const v1::PhotographError& error : MainData(report).photographs().photographs())
    errors.push_back(&error);
  if (errors.size() < 2) return "";
  std::stable_sort(errors.begin(), errors.end(),
                   [](const auto* a, const auto* b) { return a->rmse() > b->rmse(); });
  const ErrorScale scale(MainData(report));
  const bool improved = !report.improved_model_yaml().empty();
  const double largest = errors[0]->rmse(), floor = NoiseFloorOf(MainData(report)).sigma;
  std::vector<std::string> titles = {"Image", "Object", ">RMSE", ""};
  if (improved) titles.push_back(">with the improved model");
  titles.insert(titles.end(), {">Mean residual", ">Outline IoU", ">Outline apart"});
  std::string table = absl::StrCat("<div class=\"scroll\"><table>", HeaderRow(titles), "<tbody>");
  for (size_t k = 0; k < std::min(errors.size(), kMaxListed); ++k) {
    const v1::PhotographError& error = *errors[k];
    absl::StrAppend(
        &table, "<tr>", Cell(absl::StrCat(error.image())), Cell(Escape(error.object()), "name"),
        NumberCell(scale.Text(error.rmse())),
        Cell(Bar(error.rmse() / largest, "given", floor > 0 ? floor / largest : -1), "barcell narrow"),
        improved ? NumberCell(scale.Text(error.rmse_after())) : "",
        NumberCell(scale.Signed(error.mean_residual())), NumberCell(Fixed(error.silhouette_iou(), 3)),
        NumberCell(std::isnan(error.contour_distance_px())
                       ? "n/a"
                       : absl::StrCat(Fixed(error.contour_distance_px(), 2), " px")),
        "</tr>\n");
  }
  table += "</tbody></table></div>";
  return absl::StrCat(
      "<h3>Picture by picture</h3>\n",
      Figure(table, errors.size() > kMaxListed
                        ? absl::StrCat("The ", kMaxListed, " of ", errors.size(),
                                       " pictures that are off most; all are in the JSON report.")
                        : "All pictures, the worst first."));
}

std::string Place(const v1::Vector3& v, double factor, int decimals) {
  return absl::StrCat(Fixed(factor * v.x(), decimals), " ", Fixed(factor * v.y(), decimals), " ",
                      Fixed(factor * v.z(), decimals));
}

}  // namespace

std::string HtmlPhotographs(const v1::Report& report) {
  if (!MainData(report).has_photographs()) return "";
  return Section("photographs", "Photographs",
                 "A few pictures side by side: those that are off most, and one of middling error.",
                 absl::StrCat(SideBySide(report), Outlines(report), OneByOne(report)));
}

std::string HtmlNextPhotographs(const v1::Report& report) {
  std::string table = absl::StrCat("<div class=\"scroll\"><table>",
                                   HeaderRow({">No.", "Object", ">Eye x y z (mm)", ">At x y z (mm)", ">Up",
                                              ">Apart (sigmas)", "What it is for"}),
                                   "<tbody>");
  int number = 0;
  for (const v1::NextMeasurement& next : report.next()) {
    if (!next.has_photograph()) continue;
    const v1::CameraPose& camera = next.photograph();
    const std::string verdict = CountToVerdict(next);
    absl::StrAppend(
        &table, "<tr>", NumberCell(absl::StrCat(++number)), Cell(Escape(next.object())),
        NumberCell(Place(camera.eye_m(), 1000, 1)), NumberCell(Place(camera.at_m(), 1000, 1)),
        NumberCell(Place(camera.up(), 1, 2)),
        NumberCell(next.separation() > 0 ? Number(next.separation(), 2) : ""),
        Cell(absl::StrCat(Typeset(next.purpose()),
                          verdict.empty() ? "" : absl::StrCat("<br><small>", verdict, "</small>"))),
        "</tr>\n");
  }
  if (number == 0) return "";
  return Section(
      "next-pictures", "Next pictures",
      "Pictures that would discriminate between the remaining explanations.",
      Figure(absl::StrCat(table, "</tbody></table></div>"),
             "Apart: the expected difference between the explanations, in standard deviations of the "
             "noise."));
}

std::string HtmlPhotographMethods(const v1::Report& report) {
  if (!(MainData(report).initial().rmse() > 0)) return "";
  return Section(
      "methods", "How the numbers were computed", "",
      "<dl><dt>Residual</dt><dd>Measured minus expected grey level of a pixel (0 to 255), for the commanded "
      "pose of the "
      "camera; of colour pictures the mean of the three channels.</dd>"
      "<dt>RMSE</dt><dd>Square root of the mean squared residual over all pixels of all pictures.</dd>"
      "<dt>Noise floor</dt><dd>The standard deviation of one pixel among repeats of the same picture; "
      "without repeats an "
      "upper bound, from what neighbouring pixels differ by.</dd>"
      "<dt>Excess error</dt><dd>The mean square error beyond the noise floor\u2019s.</dd>"
      "<dt>Unseen pictures</dt><dd>Pictures left out of a fit that is made anew without them, group by "
      "group; of the "
      "groups the largest error.</dd>"
      "<dt>Lack-of-fit p</dt><dd>Probability of at least this much misfit beyond the noise if nothing were "
      "missing.</dd>"
      "<dt>Mean residual</dt><dd>Positive: the picture is brighter than the model says.</dd></dl>\n");
}

}  // namespace touchstone::client
