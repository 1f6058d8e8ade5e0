// Sums over the pixels of what a model of photographs leaves, by pose: what formulas and curves are scored by.
#pragma once

#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/images/terms/photo_term_scores.h"
#include "server/diagnosis/images/terms/photo_terms.h"
#include "server/diagnosis/images/terms/rules.h"

namespace touchstone::diagnosis::images {

inline constexpr int kCurveBends = 3;  // stiffnesses of a curve that are tried

// What a curve may run along.
struct CurveAxis {
  const char* name;
  double (*value)(const effects::PhotoPixel&);
  bool on_object;  // its range is that of the objects' pixels
};
inline constexpr CurveAxis kCurveAxes[] = {
    {"radius", [](const effects::PhotoPixel& p) { return p.radius; }, false},
    {"row", [](const effects::PhotoPixel& p) { return p.row; }, false},
    {"column", [](const effects::PhotoPixel& p) { return p.column; }, false},
    {"grey", [](const effects::PhotoPixel& p) { return p.grey; }, false},
    {"incidence_deg", [](const effects::PhotoPixel& p) { return p.incidence_deg; }, true},
    {"depth_mm", [](const effects::PhotoPixel& p) { return p.depth_mm; }, true},
    {"session_time_s", [](const effects::PhotoPixel& p) { return p.session_time_s; }, false}};
inline constexpr size_t kCurveAxisCount = std::size(kCurveAxes);

struct AxisRange {
  double low = INFINITY, high = -INFINITY;
  bool usable() const { return high > low; }
};
using AxisRanges = std::array<AxisRange, kCurveAxisCount>;

class RestSums {
 public:
  RestSums(const Photographs& photographs, const model::Model& model,
           const std::vector<image::Photo>& expected, const PhotoTermDictionary& dictionary,
           ThreadPool* pool);

  const AxisRanges& ranges() const { return ranges_; }

  // Of a term of the dictionary, and of a curve along an axis, of its stiffnesses the most probable.
  TermScore ScoreTerm(size_t t) const;
  TermScore ScoreCurve(size_t axis) const;

  // What grey levels take from unseen poses that stay at their places in the picture, or on the objects.
  double Nameless() const;

 private:
  // The sums of one photograph.
  struct PhotoSums {
    std::vector<PoseSums> terms, curves;
    Eigen::VectorXd map_squares, map_cross, place_squares, place_cross;
  };

  PhotoSums Empty() const;
  static void Add(const PhotoSums& one, PhotoSums* to);
  void FindRanges();
  PhotoSums Sum(int k) const;
  static void AddToCurve(const AxisRange& range, double value, double weight, double residual, PoseSums* sum);

  const Photographs& p_;
  const model::Model& model_;
  const std::vector<image::Photo>& expected_;
  const PhotoTermDictionary& dictionary_;
  int stride_ = 1;
  double weight_ = 0;  // pixels
  AxisRanges ranges_;
  std::vector<PhotoSums> sums_;  // [pose]
  std::vector<int> objects_;     // [pose]
};

}  // namespace touchstone::diagnosis::images
