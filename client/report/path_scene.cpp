#include "client/report/path_scene.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace touchstone::client {
namespace {

// The viewer stands before the object, to the right and above: the arm's base is at the back.
constexpr double kAzimuth = -52 * kRadiansPerDegree, kElevation = 26 * kRadiansPerDegree;
constexpr double kInset = 34;           // px, of what is drawn from the frame
constexpr double kNumberedAtMost = 40;  // more possible touches than these are not numbered
constexpr size_t kFirstWrist = 3, kLastWrist = 5;

// The faces of a box by the indices of their corners, and the edges.
constexpr int kBoxFaces[6][4] = {{0, 2, 6, 4}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                 {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 5, 7, 6}};
constexpr int kBoxEdges[12][2] = {{0, 1}, {0, 2}, {0, 4}, {1, 3}, {1, 5}, {2, 3},
                                  {2, 6}, {3, 7}, {4, 5}, {4, 6}, {5, 7}, {6, 7}};

std::array<Eigen::Vector3d, 8> CornersOf(const Eigen::Vector3d& least, const Eigen::Vector3d& greatest) {
  std::array<Eigen::Vector3d, 8> corners;
  for (int k = 0; k < 8; ++k)
    corners[static_cast<size_t>(k)] = {k & 1 ? greatest.x() : least.x(), k & 2 ? greatest.y() : least.y(),
                                       k & 4 ? greatest.z() : least.z()};
  return corners;
}

class Scene {
 public:
  Scene(const SceneFrame& frame, const std::vector<Eigen::Vector3d>& shown) : frame_(frame) {
    right_ = {-std::sin(kAzimuth), std::cos(kAzimuth), 0};
    towards_ = {std::cos(kElevation) * std::cos(kAzimuth), std::cos(kElevation) * std::sin(kAzimuth),
                std::sin(kElevation)};
    up_ = towards_.cross(right_);
    Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
    for (const Eigen::Vector3d& point : shown) {
      if (!point.allFinite()) continue;
      const Eigen::Vector2d flat(point.dot(right_), point.dot(up_));
      low = low.cwiseMin(flat), high = high.cwiseMax(flat);
    }
    if (low.x() > high.x()) low.setConstant(-0.1), high.setConstant(0.1);
    const Eigen::Vector2d size = (high - low).cwiseMax(0.02);
    scale_ = std::min((frame.width - 2 * kInset) / size.x(), (frame.height - 2 * kInset - 20) / size.y());
    centre_ = 0.5 * (low + high);
  }

  Eigen::Vector2d At(const Eigen::Vector3d& point_m) const {
    return {frame_.left + frame_.width / 2 + scale_ * (point_m.dot(right_) - centre_.x()),
            frame_.top + frame_.height / 2 + 10 - scale_ * (point_m.dot(up_) - centre_.y())};
  }
  bool FacesViewer(const std::array<Eigen::Vector3d, 8>& corners, int face) const {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero(), centre = Eigen::Vector3d::Zero();
    for (const int corner : kBoxFaces[face]) middle += corners[static_cast<size_t>(corner)] / 4;
    for (const Eigen::Vector3d& corner : corners) centre += corner / 8;
    return (middle - centre).dot(towards_) > 0;
  }
  std::string Line(const char* style, const std::vector<Eigen::Vector3d>& points,
                   const char* more = "") const {
    std::string text = absl::StrCat("<polyline class=\"", style, "\" ", more, " points=\"");
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector2d at = At(point);
      absl::StrAppendFormat(&text, "%.1f,%.1f ", at.x(), at.y());
    }
    return text + "\"/>\n";
  }
  std::string Dot(const char* style, const Eigen::Vector3d& point, double radius) const {
    const Eigen::Vector2d at = At(point);
    return absl::StrFormat("<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n", style, at.x(),
                           at.y(), radius);
  }
  std::string Square(const char* style, const Eigen::Vector3d& point, double side) const {
    const Eigen::Vector2d at = At(point);
    return absl::StrFormat("<rect class=\"%s\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
                           style, at.x() - side / 2, at.y() - side / 2, side, side);
  }
  std::string Text(const char* style, const Eigen::Vector3d& point, double dx, double dy,
                   const std::string& text) const {
    const Eigen::Vector2d at = At(point);
    return absl::StrFormat("<text class=\"%s\" x=\"%.1f\" y=\"%.1f\">%s</text>\n", style, at.x() + dx,
                           at.y() + dy, text);
  }
  std::string Box(const char* style, const std::array<Eigen::Vector3d, 8>& corners, bool front) const {
    std::string svg;
    for (int face = 0; face < 6; ++face) {
      if (FacesViewer(corners, face) != front) continue;
      std::vector<Eigen::Vector3d> round;
      for (const int corner : kBoxFaces[face]) round.push_back(corners[static_cast<size_t>(corner)]);
      round.push_back(round.front());
      absl::StrAppend(&svg, Line(style, round));
    }
    return svg;
  }
  std::string Wires(const char* style, const std::array<Eigen::Vector3d, 8>& corners) const {
    std::string svg;
    for (const auto& edge : kBoxEdges)
      absl::StrAppend(
          &svg, Line(style, {corners[static_cast<size_t>(edge[0])], corners[static_cast<size_t>(edge[1])]}));
    return svg;
  }
  // Squares on a level, as far as the points lie.
  std::string Floor(const std::array<Eigen::Vector3d, 8>& over, double square_m, double beyond_m) const {
    Eigen::Vector3d least = over[0], greatest = over[0];
    for (const Eigen::Vector3d& corner : over)
      least = least.cwiseMin(corner), greatest = greatest.cwiseMax(corner);
    const double z = least.z();
    const auto whole = [&](double at_m) { return std::round(at_m / square_m) * square_m; };
    const double x0 = whole(least.x() - beyond_m), x1 = whole(greatest.x() + beyond_m);
    const double y0 = whole(least.y() - beyond_m), y1 = whole(greatest.y() + beyond_m);
    std::string svg;
    for (double x = x0; x < x1 + square_m / 2; x += square_m)
      absl::StrAppend(&svg, Line("floor", {{x, y0, z}, {x, y1, z}}));
    for (double y = y0; y < y1 + square_m / 2; y += square_m)
      absl::StrAppend(&svg, Line("floor", {{x0, y, z}, {x1, y, z}}));
    return svg;
  }
  // The directions of the base frame, in a corner of the frame; or where it is.
  std::string Axes(const Eigen::Vector2d& at, double length) const {
    std::string svg;
    const char* const names[] = {"x", "y", "z"};
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
      const Eigen::Vector2d flat(length * axis.dot(right_), -length * axis.dot(up_));
      absl::StrAppendFormat(
          &svg,
          "<path class=\"axis axis%s\" d=\"M%.1f %.1fl%.1f %.1f\"/><text class=\"axisname\" "
          "text-anchor=\"middle\" x=\"%.1f\" y=\"%.1f\">%s</text>\n",
          names[k], at.x(), at.y(), flat.x(), flat.y(), at.x() + 1.32 * flat.x(),
          at.y() + 1.32 * flat.y() + 4, names[k]);
    }
    return svg;
  }
  std::string Around(const std::string& name, const std::string& note, const std::string& inside) const {
    return absl::StrFormat(
        "<clipPath id=\"%s\"><rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
        "rx=\"6\"/></clipPath>\n"
        "<rect class=\"panel\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" rx=\"6\"/>\n"
        "<g clip-path=\"url(#%s)\">\n%s</g>\n<text class=\"view\" x=\"%.1f\" y=\"%.1f\">%s</text>\n"
        "<text class=\"tick\" text-anchor=\"end\" x=\"%.1f\" y=\"%.1f\">%s</text>\n",
        frame_.id, frame_.left, frame_.top, frame_.width, frame_.height, frame_.left, frame_.top,
        frame_.width, frame_.height, frame_.id, inside, frame_.left + 14, frame_.top + 24, name,
        frame_.left + frame_.width - 12, frame_.top + frame_.height - 12, note);
  }
  Eigen::Vector2d Corner() const { return {frame_.left + 48, frame_.top + frame_.height - 42}; }

 private:
  SceneFrame frame_;
  Eigen::Vector3d right_, up_, towards_;
  Eigen::Vector2d centre_;
  double scale_ = 1;
};

bool HasApproach(const DrawnTouch& touch) {
  return touch.possible && touch.transit_poses >= 1 && touch.path.size() > touch.transit_poses;
}

std::string Approach(const Scene& scene, const DrawnTouch& touch, bool numbered) {
  const Eigen::Vector3d &start = touch.path[touch.transit_poses - 1], &end = touch.path.back();
  // To the target, where a contact is expected; beyond it the arm only goes if there is none.
  const Eigen::Vector3d target = touch.target_m.value_or(end);
  std::string svg = scene.Line("beyond", {target, end});
  if (touch.start.tips.size() > 1)
    absl::StrAppend(&svg, scene.Line("fingers", {touch.start.tips.front(), touch.start.tips.back()}));
  absl::StrAppend(&svg, scene.Line("approach", {start, target}, "marker-end=\"url(#arrow)\""),
                  scene.Dot(touch.notes.empty() ? "start" : "start noted", start, numbered ? 2.6 : 1.6));
  if (numbered) absl::StrAppend(&svg, scene.Text("number", start, 6, -5, absl::StrCat(touch.number)));
  return svg;
}

std::string Impossible(const Scene& scene, const DrawnTouch& touch) {
  if (!touch.target_m.has_value() && touch.path.empty()) return "";
  const Eigen::Vector3d at = touch.target_m.has_value() ? *touch.target_m : touch.path.back();
  const Eigen::Vector2d flat = scene.At(at);
  return absl::StrFormat("<path class=\"bad\" d=\"M%.1f %.1fl10 10m0 -10l-10 10\"/>", flat.x() - 5,
                         flat.y() - 5) +
         scene.Text("badnumber", at, 8, -4, absl::StrCat(touch.number));
}

std::string Arm(const Scene& scene, const DrawnPosture& posture) {
  const Eigen::Vector3d& flange = posture.links.back();
  std::string svg = scene.Line("arm", posture.links);
  if (!posture.tips.empty()) {
    absl::StrAppend(&svg, scene.Line("tool", {flange, posture.tips[posture.tips.size() / 2]}));
    absl::StrAppend(&svg, scene.Line("tool", {posture.tips.front(), posture.tips.back()}));
  }
  for (size_t i = 1; i < posture.links.size(); ++i)
    absl::StrAppend(&svg,
                    scene.Dot(i >= kFirstWrist && i <= kLastWrist ? "wrist" : "joint", posture.links[i], 4));
  if (posture.camera.has_value())
    absl::StrAppend(&svg, scene.Line("tool", {flange, *posture.camera}),
                    scene.Square("camera", *posture.camera, 9));
  return svg;
}

}  // namespace

std::string DrawCloseUp(const SceneFrame& frame, const DrawnFace& face) {
  std::vector<Eigen::Vector3d> shown;
  if (face.object.has_value()) shown.assign(face.object->begin(), face.object->end());
  size_t possible = 0;
  for (const DrawnTouch& touch : face.touches) {
    if (touch.target_m.has_value()) shown.push_back(*touch.target_m);
    possible += touch.possible ? 1 : 0;
    if (!HasApproach(touch)) continue;
    shown.push_back(touch.path[touch.transit_poses - 1]);
    shown.insert(shown.end(), touch.start.tips.begin(), touch.start.tips.end());
  }
  const Scene scene(frame, shown);
  const bool numbered = possible <= kNumberedAtMost;
  std::string svg;
  if (face.object.has_value())
    absl::StrAppend(&svg, scene.Floor(*face.object, 0.05, 0.1),
                    scene.Box("object back", *face.object, false));
  for (const DrawnTouch& touch : face.touches)
    if (touch.possible && touch.transit_poses >= 2 && touch.path.size() >= touch.transit_poses)
      absl::StrAppend(
          &svg, scene.Line("transit", {touch.path.begin(), touch.path.begin() + static_cast<std::ptrdiff_t>(
                                                                                    touch.transit_poses)}));
  std::string approaches;
  for (const DrawnTouch& touch : face.touches)
    if (HasApproach(touch)) absl::StrAppend(&approaches, Approach(scene, touch, numbered));
  absl::StrAppend(&svg, numbered ? "<g>" : "<g class=\"many\">", approaches, "</g>\n");
  if (face.object.has_value()) absl::StrAppend(&svg, scene.Box("object front", *face.object, true));
  // What is wrong is drawn last, over everything.
  for (const DrawnTouch& touch : face.touches)
    if (!touch.possible) absl::StrAppend(&svg, Impossible(scene, touch));
  absl::StrAppend(&svg, scene.Axes(scene.Corner(), 26));
  return scene.Around(
      "Approaches", face.object.has_value() ? "base frame; squares of 50 mm under the object" : "base frame",
      svg);
}

std::string DrawOverview(const SceneFrame& frame, const DrawnFace& face, const PathDrawing& drawing) {
  std::vector<Eigen::Vector3d> shown = {Eigen::Vector3d::Zero()};
  std::optional<std::array<Eigen::Vector3d, 8>> limits;
  if (drawing.limits.has_value()) {
    limits = CornersOf(drawing.limits->first, drawing.limits->second);
    shown.insert(shown.end(), limits->begin(), limits->end());
  }
  if (face.object.has_value()) shown.insert(shown.end(), face.object->begin(), face.object->end());
  const DrawnTouch* first = nullptr;
  for (const DrawnTouch& touch : face.touches) {
    if (touch.start.links.size() <= kLastWrist) continue;
    if (first == nullptr) first = &touch;
    shown.insert(shown.end(), touch.start.links.begin(), touch.start.links.end());
  }
  const Scene scene(frame, shown);
  std::string svg;
  if (limits.has_value()) absl::StrAppend(&svg, scene.Floor(*limits, 0.1, 0), scene.Wires("limits", *limits));
  if (face.object.has_value())
    absl::StrAppend(&svg, scene.Box("object back", *face.object, false),
                    scene.Box("object front", *face.object, true));
  for (const DrawnTouch& touch : face.touches) {
    if (touch.start.links.size() <= kLastWrist || &touch == first) continue;
    absl::StrAppend(&svg, scene.Dot("wrist faint", touch.start.links[kLastWrist], 2));
    if (touch.start.camera.has_value())
      absl::StrAppend(&svg, scene.Square("camera faint", *touch.start.camera, 4));
  }
  absl::StrAppend(&svg, scene.Axes(scene.At(Eigen::Vector3d::Zero()), 34));
  if (first != nullptr) absl::StrAppend(&svg, Arm(scene, first->start));
  return scene.Around(
      first == nullptr ? "The rig" : absl::StrCat("The arm at the start of touch ", first->number),
      limits.has_value() ? "base frame at the arm's base; squares of 100 mm on the limits' floor"
                         : "base frame at the arm's base",
      svg);
}

}  // namespace touchstone::client
