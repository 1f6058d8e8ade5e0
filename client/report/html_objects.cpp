// Residuals on the objects' surfaces: still pictures from two sides, before and after, and the numbers for
// the picture that the script turns.
#include <algorithm>
#include <cmath>
#include <map>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <nlohmann/json.hpp>

#include "client/report/html_page.h"
#include "client/report/svg_object.h"
#include "client/report/words.h"
#include "server/base/printable.h"

namespace touchstone::client {
namespace {

constexpr int kColours = 7;
constexpr size_t kMaxSurfacePoints = 6000;  // of all objects together
constexpr size_t kMaxObjects = 12;

struct Object {
  const v1::ObjectOutline* outline = nullptr;
  std::vector<const v1::SurfacePoint*> points;
};

std::map<std::string, Object> Objects(const v1::DataReport& touches, std::vector<std::string>* order) {
  std::map<std::string, Object> objects;
  const size_t step = 1 + touches.surface_points_size() / kMaxSurfacePoints;
  for (const v1::ObjectOutline& outline : touches.outlines()) {
    if (objects.count(outline.object()) == 0) order->push_back(outline.object());
    objects[outline.object()].outline = &outline;
  }
  for (int i = 0; i < touches.surface_points_size(); i += step) {
    const v1::SurfacePoint& point = touches.surface_points(i);
    if (!std::isfinite(point.x_mm() + point.y_mm() + point.z_mm())) continue;
    if (objects.count(point.object()) == 0) order->push_back(point.object());
    objects[point.object()].points.push_back(&point);
  }
  return objects;
}

// Half the width of the colour scale: 98 % of the residuals before lie within; the seven colours begin at
// round numbers.
double ColourLimit(const v1::DataReport& touches) {
  std::vector<double> sizes;
  for (const v1::SurfacePoint& point : touches.surface_points()) {
    if (std::isfinite(point.residual())) sizes.push_back(std::abs(point.residual()));
  }
  if (sizes.empty()) return 1;
  const size_t rank = sizes.size() * 98 / 100;
  std::nth_element(sizes.begin(), sizes.begin() + rank, sizes.end());
  if (!(sizes[rank] > 0)) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(sizes[rank])));
  for (const double step : {1.05, 1.4, 2.1, 2.8, 3.5, 4.2, 5.6, 7.0, 8.4, 10.5}) {
    if (sizes[rank] <= step * power) return step * power;
  }
  return 10 * power;
}

int Colour(double residual_us, double limit_us) {
  return std::clamp(static_cast<int>(std::floor((residual_us / limit_us + 1) / 2 * kColours)), 0,
                    kColours - 1);
}

std::string Scale(double limit_us) {
  const TimeUnit unit = UnitOfTime(limit_us);
  std::string svg = absl::StrCat(
      "<svg class=\"map scale\" style=\"max-width:26rem\" viewBox=\"0 0 420 44\" role=\"img\" "
      "aria-label=\"Colour scale: purple early, grey none, orange late\">");
  for (int i = 0; i < kColours; ++i) {
    absl::StrAppend(&svg, "<rect class=\"d", i, "\" x=\"", 60 * i, "\" width=\"60\" height=\"12\"/>");
  }
  for (int i = 1; i < kColours; ++i) {
    const double edge = limit_us * (2.0 * i / kColours - 1) * unit.per_us;
    absl::StrAppend(&svg, "<text text-anchor=\"middle\" x=\"", 60 * i, "\" y=\"26\">",
                    Typeset(absl::StrCat(edge > 0 ? "+" : "", Number(edge, 2))), "</text>");
  }
  return absl::StrCat(svg,
                      "<text x=\"0\" y=\"41\">earlier than simulated</text><text x=\"210\" y=\"41\" "
                      "text-anchor=\"middle\">",
                      Typeset(absl::StrCat("residual, ", unit.symbol)),
                      "</text><text x=\"420\" y=\"41\" text-anchor=\"end\">later</text></svg>");
}

std::string Dots(const ObjectPicture& picture, const View& view, const Object& object, bool after,
                 double limit_us) {
  const long width = std::lround(std::clamp(9 * std::sqrt(500.0 / (1 + object.points.size())), 8.0, 16.0));
  std::string paths[kColours], out;
  for (const v1::SurfacePoint* point : object.points) {
    const double residual = after ? point->after() : point->residual();
    const Vector at = {point->x_mm(), point->y_mm(), point->z_mm()};
    if (!std::isfinite(residual) || !picture.Visible(view, at)) continue;
    const ObjectPicture::Projected p = picture.Project(view, at);
    absl::StrAppend(&paths[Colour(residual, limit_us)], "M", std::lround(p.x), " ", std::lround(p.y), "h0");
  }
  // Few contacts are drawn larger, so that their colours can be seen. Small residuals below, large ones on
  // top.
  for (const int colour : {3, 2, 4, 1, 5, 0, 6}) {
    if (!paths[colour].empty())
      absl::StrAppend(&out, "<path class=\"dot d", colour, "\" stroke-width=\"", width, "\" d=\"",
                      paths[colour], "\"/>");
  }
  return out;
}

// Four still pictures of one object: given and improved, from the front and from behind.
std::string Stills(const std::string& name, const Object& object, int number, bool improved,
                   double limit_us) {
  std::vector<Vector> points;
  for (const v1::SurfacePoint* point : object.points)
    points.push_back({point->x_mm(), point->y_mm(), point->z_mm()});
  const v1::ObjectOutline none;
  const ObjectPicture picture(object.outline != nullptr ? *object.outline : none, points);
  std::string out = absl::StrCat("<div class=\"block\"><h4>", Escape(name), "</h4><div class=\"grid maps\">");
  for (const bool after : {false, true}) {
    if (after && !improved) break;
    for (const bool back : {false, true}) {
      const View view = back ? kBackView : kFrontView;
      const std::string id = absl::StrCat("o", number, back ? "b" : "f");
      const std::string words = absl::StrCat(after ? "improved" : "given", " model, from ",
                                             back ? "behind and below" : "the front and above");
      // The body is drawn once and shown again.
      const std::string body = after ? absl::StrCat("<use href=\"#", id, "\"/>")
                                     : absl::StrCat("<g id=\"", id, "\">", picture.Faces(view), "</g>");
      out += Figure(
          absl::StrCat("<svg class=\"map\" viewBox=\"0 0 400 400\" role=\"img\" aria-label=\"Residuals on ",
                       Escape(name), ", ", words, "\">", body, Dots(picture, view, object, after, limit_us),
                       "</svg>"),
          absl::StrCat(after ? "improved" : "given", back ? ", back" : ", front"));
    }
  }
  return out + "</div></div>\n";
}

// What the script turns: whole tenths of millimetres and whole microseconds keep it small.
std::string Data(const v1::DataReport& touches, const std::map<std::string, Object>& objects,
                 const std::vector<std::string>& order, double limit_us, bool improved) {
  nlohmann::json data = {
      {"limit_us", limit_us}, {"improved", improved}, {"fingers", nlohmann::json::array()}};
  data["unit"] = UnitOfTime(limit_us).symbol;
  data["per_us"] = UnitOfTime(limit_us).per_us;
  for (const std::string& finger : touches.fingers()) data["fingers"].push_back(finger);
  const auto whole = [](double value) { return std::isfinite(value) ? std::lround(value) : 0L; };
  for (const std::string& name : order) {
    const Object& object = objects.at(name);
    nlohmann::json one = {{"name", name},
                          {"v", nlohmann::json::array()},
                          {"t", nlohmann::json::array()},
                          {"p", nlohmann::json::array()},
                          {"r", nlohmann::json::array()},
                          {"a", nlohmann::json::array()},
                          {"f", nlohmann::json::array()}};
    if (object.outline != nullptr) {
      for (const float x : object.outline->vertices_mm()) one["v"].push_back(whole(10 * x));
      for (const uint32_t corner : object.outline->triangles()) one["t"].push_back(corner);
    }
    for (const v1::SurfacePoint* point : object.points) {
      for (const double x : {point->x_mm(), point->y_mm(), point->z_mm()}) one["p"].push_back(whole(10 * x));
      one["r"].push_back(whole(point->residual()));
      one["a"].push_back(whole(point->after()));
      one["f"].push_back(point->finger());
    }
    data["objects"].push_back(std::move(one));
  }
  // "</script>" in a name must not end the element.
  return absl::StrReplaceAll(
      EscapeInJson(data.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)),
      {{"<", "\\u003c"}, {">", "\\u003e"}, {"&", "\\u0026"}});
}

}  // namespace

std::string HtmlObjects(const v1::Report& report) {
  const auto found = std::find_if(report.data().begin(), report.data().end(),
                                  [](const v1::DataReport& data) { return data.surface_points_size() > 0; });
  if (found == report.data().end()) return "";
  const v1::DataReport& touches = *found;
  std::vector<std::string> order;
  const std::map<std::string, Object> objects = Objects(touches, &order);
  const double limit_us = ColourLimit(touches);
  const bool improved = !report.improved_model_yaml().empty();
  size_t shown = 0;
  for (const auto& [name, object] : objects) shown += object.points.size();

  std::string body = absl::StrCat(Scale(limit_us),
                                  "<div id=\"stage\"><div class=\"row\"><label>Object <select "
                                  "id=\"which\"></select></label><span role=\"group\" "
                                  "aria-label=\"Model\" id=\"when\"></span><span role=\"group\" "
                                  "aria-label=\"Finger\" id=\"who\"></span></div>"
                                  "<canvas id=\"turn\" tabindex=\"0\" role=\"img\" aria-label=\"Residuals on "
                                  "the object; turn it by dragging or with "
                                  "the arrow keys\"></canvas><p class=\"legend\" id=\"readout\" "
                                  "aria-live=\"polite\">Drag, or use the arrow keys, to "
                                  "turn it.</p></div>\n");
  for (size_t i = 0; i < order.size() && i < kMaxObjects; ++i) {
    body += Stills(order[i], objects.at(order[i]), static_cast<int>(i), improved, limit_us);
  }
  absl::StrAppend(
      &body,
      "<p class=\"note\">Each dot is one finger\u2019s contact, at the point where the given "
      "model puts it, coloured by its residual. Front: seen from the front and above; back: from behind and "
      "below. ",
      Count(shown), " of ", Count(touches.surface_points_size()), " contacts are drawn");
  if (order.size() > kMaxObjects)
    absl::StrAppend(&body, ", stills of the first ", kMaxObjects, " objects only");
  absl::StrAppend(&body, ".</p>\n<script type=\"application/json\" id=\"objects-data\">",
                  Data(touches, objects, order, limit_us, improved), "</script>\n");
  return Section("objects", "On the object", "Where on the surface the model is early or late.", body);
}

}  // namespace touchstone::client
