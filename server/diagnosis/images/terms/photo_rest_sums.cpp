#include "server/diagnosis/images/terms/photo_rest_sums.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/images/pixels/photo_cells.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/terms/rules.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kBends[kCurveBends] = {1, 4, 16};  // grey levels: of a curve's second differences

// Pixels of one photograph that take part: every `stride`-th along both axes, on alternating places.
template <typename Visit>
void ForPixels(const image::Photo& photo, int stride, Visit&& visit) {
  for (int y = stride / 2; y < photo.height; y += stride)
    for (int x = (stride / 2 + y) % stride; x < photo.width; x += stride) visit(x, y);
}

}  // namespace

RestSums::RestSums(const Photographs& photographs, const model::Model& model,
                   const std::vector<image::Photo>& expected, const PhotoTermDictionary& dictionary,
                   ThreadPool* pool)
    : p_(photographs), model_(model), expected_(expected), dictionary_(dictionary) {
  const double pixels = static_cast<double>(p_.width()) * p_.height() * p_.size();
  stride_ = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / kPhotoTermRules.max_pixels))));
  FindRanges();
  std::vector<PhotoSums> of_photo(p_.size());
  ParallelFor(pool, p_.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) of_photo[k] = Sum(k);
  });
  sums_.assign(p_.poses, Empty());
  objects_.assign(p_.poses, 0);
  for (int k = 0; k < p_.size(); ++k) {
    objects_[p_.pose[k]] = p_.object[k];
    Add(of_photo[k], &sums_[p_.pose[k]]);
  }
}

TermScore RestSums::ScoreTerm(size_t t) const {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(static_cast<int>(dictionary_.terms[t].columns.size()));
  std::vector<PoseSums> poses;
  for (const PhotoSums& pose : sums_) {
    poses.push_back(pose.terms[t]);
    squares += pose.terms[t].squares.diagonal();
  }
  // Wide enough that each column may add prior_grey, root mean square.
  const Eigen::MatrixXd precision =
      (squares.array().max(1e-300) / (weight_ * kPhotoTermRules.prior_grey * kPhotoTermRules.prior_grey))
          .matrix()
          .asDiagonal();
  return ScoreSums(poses, objects_, precision);
}

TermScore RestSums::ScoreCurve(size_t axis) const {
  std::vector<PoseSums> poses;
  for (const PhotoSums& pose : sums_) poses.push_back(pose.curves[axis]);
  TermScore best;
  for (const double bend : kBends) {
    Eigen::MatrixXd precision =
        Eigen::MatrixXd::Identity(kPhotoTermRules.curve_knots, kPhotoTermRules.curve_knots) /
        (kPhotoTermRules.curve_knots * kPhotoTermRules.prior_grey * kPhotoTermRules.prior_grey);
    for (int n = 1; n + 1 < kPhotoTermRules.curve_knots; ++n) {
      Eigen::VectorXd second = Eigen::VectorXd::Zero(kPhotoTermRules.curve_knots);
      second[n - 1] = second[n + 1] = 1, second[n] = -2;
      precision += second * second.transpose() / (bend * bend);
    }
    TermScore score = ScoreSums(poses, objects_, precision);
    if (score.determined && (!best.determined || score.gain_nats > best.gain_nats)) best = std::move(score);
  }
  return best;
}

double RestSums::Nameless() const {
  std::vector<Eigen::VectorXd> squares, cross;
  for (const PhotoSums& pose : sums_) squares.push_back(pose.map_squares), cross.push_back(pose.map_cross);
  const double in_picture = UnseenOfMeans(squares, cross, kPhotoTermRules.prior_grey);
  double on_objects = 0;
  for (size_t object = 0; object < p_.objects.size(); ++object) {
    squares.clear(), cross.clear();
    for (size_t g = 0; g < sums_.size(); ++g)
      if (objects_[g] == static_cast<int>(object))
        squares.push_back(sums_[g].place_squares), cross.push_back(sums_[g].place_cross);
    on_objects += UnseenOfMeans(squares, cross, kPhotoTermRules.prior_grey);
  }
  return std::max(in_picture, on_objects);
}

RestSums::PhotoSums RestSums::Empty() const {
  PhotoSums sums;
  for (const PhotoTerm& term : dictionary_.terms) {
    const int n = static_cast<int>(term.columns.size());
    sums.terms.push_back({Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)});
  }
  for (size_t axis = 0; axis < kCurveAxisCount; ++axis)
    sums.curves.push_back({Eigen::MatrixXd::Zero(kPhotoTermRules.curve_knots, kPhotoTermRules.curve_knots),
                           Eigen::VectorXd::Zero(kPhotoTermRules.curve_knots)});
  sums.map_squares = sums.map_cross =
      Eigen::VectorXd::Zero(kPhotoTermRules.map_cells * kPhotoTermRules.map_cells);
  sums.place_squares = sums.place_cross =
      Eigen::VectorXd::Zero(kImageRules.object_cells * kImageRules.object_cells * kImageRules.object_cells);
  return sums;
}

void RestSums::Add(const PhotoSums& one, PhotoSums* to) {
  for (size_t t = 0; t < one.terms.size(); ++t)
    to->terms[t].squares += one.terms[t].squares, to->terms[t].cross += one.terms[t].cross;
  for (size_t c = 0; c < one.curves.size(); ++c)
    to->curves[c].squares += one.curves[c].squares, to->curves[c].cross += one.curves[c].cross;
  to->map_squares += one.map_squares, to->map_cross += one.map_cross;
  to->place_squares += one.place_squares, to->place_cross += one.place_cross;
}

void RestSums::FindRanges() {
  for (int k = 0; k < p_.size(); ++k) {
    const PixelReader reader(p_, model_, k, expected_[k]);
    ForPixels(expected_[k], stride_, [&](int x, int y) {
      const bool object = expected_[k].mask[static_cast<size_t>(y) * p_.width() + x] != 0;
      const effects::PhotoPixel pixel = reader.At(x, y);
      for (size_t axis = 0; axis < kCurveAxisCount; ++axis) {
        if (kCurveAxes[axis].on_object && !object) continue;
        const double value = kCurveAxes[axis].value(pixel);
        ranges_[axis].low = std::min(ranges_[axis].low, value);
        ranges_[axis].high = std::max(ranges_[axis].high, value);
      }
      ++weight_;
    });
  }
  if (!p_.set->has_session_time) ranges_[kCurveAxisCount - 1] = AxisRange();
}

RestSums::PhotoSums RestSums::Sum(int k) const {
  PhotoSums sums = Empty();
  const image::Photo& photo = expected_[k];
  const PixelReader reader(p_, model_, k, photo);
  // Contours and clipped pixels count little.
  const CellGrid grid{p_.width(), p_.height(), 1};
  const Eigen::VectorXf weights = CellWeights(grid, photo.grey, *p_.record);
  const geometry::Bounds& bounds = p_.surfaces[p_.object[k]]->bounds();
  std::vector<double> values(dictionary_.functions.size());
  ForPixels(photo, stride_, [&](int x, int y) {
    const size_t at = static_cast<size_t>(y) * p_.width() + x;
    const double weight = std::pow(weights[static_cast<int>(at)], 2);
    const double residual = static_cast<double>(p_.measured_grey[k][at]) - photo.grey[at];
    const effects::PhotoPixel pixel = reader.At(x, y);
    for (size_t f = 0; f < values.size(); ++f) values[f] = dictionary_.functions[f](pixel);
    for (size_t t = 0; t < dictionary_.terms.size(); ++t) {
      const std::vector<PhotoTerm::Column>& columns = dictionary_.terms[t].columns;
      double column[2] = {0, 0};
      const size_t n = std::min<size_t>(columns.size(), 2);
      for (size_t i = 0; i < n; ++i)
        column[i] = values[columns[i].function] * (columns[i].times_grey ? pixel.grey : 1);
      PoseSums& sum = sums.terms[t];
      for (size_t i = 0; i < n; ++i) {
        sum.cross[i] += weight * column[i] * residual;
        for (size_t j = 0; j < n; ++j) sum.squares(i, j) += weight * column[i] * column[j];
      }
    }
    for (size_t axis = 0; axis < kCurveAxisCount; ++axis)
      if (ranges_[axis].usable())
        AddToCurve(ranges_[axis], kCurveAxes[axis].value(pixel), weight, residual, &sums.curves[axis]);
    const int cell = y * kPhotoTermRules.map_cells / p_.height() * kPhotoTermRules.map_cells +
                     x * kPhotoTermRules.map_cells / p_.width();
    sums.map_squares[cell] += weight, sums.map_cross[cell] += weight * residual;
    if (photo.mask[at] == 0) return;
    int place = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double extent = std::max(bounds.max_m[axis] - bounds.min_m[axis], 1e-9);
      const double share = (photo.point_m[at][axis] - bounds.min_m[axis]) / extent;
      place = place * kImageRules.object_cells +
              std::clamp(static_cast<int>(share * kImageRules.object_cells), 0, kImageRules.object_cells - 1);
    }
    sums.place_squares[place] += weight, sums.place_cross[place] += weight * residual;
  });
  return sums;
}

void RestSums::AddToCurve(const AxisRange& range, double value, double weight, double residual,
                          PoseSums* sum) {
  const double place = std::clamp((value - range.low) / (range.high - range.low), 0.0, 1.0) *
                       (kPhotoTermRules.curve_knots - 1);
  const int below = std::min(static_cast<int>(place), kPhotoTermRules.curve_knots - 2);
  const double share[2] = {below + 1 - place, place - below};
  for (int i = 0; i < 2; ++i) {
    sum->cross[below + i] += weight * share[i] * residual;
    for (int j = 0; j < 2; ++j) sum->squares(below + i, below + j) += weight * share[i] * share[j];
  }
}

}  // namespace touchstone::diagnosis::images
