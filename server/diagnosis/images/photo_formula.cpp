#include "server/diagnosis/images/photo_formula.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "server/diagnosis/images/photo_cells.h"
#include "server/diagnosis/images/photo_term_scores.h"
#include "server/diagnosis/images/photo_terms.h"
#include "server/diagnosis/selection/ladder.h"
#include "server/effects/lookup.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kMaxPixels = 250'000;   // of all photographs, that sums are taken over
constexpr double kPriorGrey = 10;        // of what a term or a curve adds
constexpr double kPickedNats = 11;       // of a term that was picked from a dictionary
constexpr double kEnterNats = 4.5;       // beyond what is paid
constexpr double kSuggestP = 1e-4;       // all terms and curves paid for
constexpr double kMinHeld = 0.5;         // of what is taken where it was fitted, that unseen poses lose too
constexpr double kOfNameless = 0.8;      // of what the nameless competitor takes from unseen poses
constexpr double kMinExcess = 0.2;       // of the excess error, that a suggestion takes
constexpr double kFormulaOfCurve = 0.9;  // of what a curve takes, from where a formula says the same
constexpr size_t kMaxTried = 4;          // formulas that are simulated
constexpr int kKnots = 9, kMapSide = 12, kPlaceSide = 6;
constexpr double kBends[] = {1, 4, 16};  // grey levels: of a curve's second differences

struct CurveAxis {
  const char* name;
  double (*value)(const effects::PhotoPixel&);
  bool on_object;  // its range is that of the objects' pixels
};
constexpr CurveAxis kAxes[] = {
    {"radius", [](const effects::PhotoPixel& p) { return p.radius; }, false},
    {"row", [](const effects::PhotoPixel& p) { return p.row; }, false},
    {"column", [](const effects::PhotoPixel& p) { return p.column; }, false},
    {"grey", [](const effects::PhotoPixel& p) { return p.grey; }, false},
    {"incidence_deg", [](const effects::PhotoPixel& p) { return p.incidence_deg; }, true},
    {"depth_mm", [](const effects::PhotoPixel& p) { return p.depth_mm; }, true},
    {"session_time_s", [](const effects::PhotoPixel& p) { return p.session_time_s; }, false}};
constexpr size_t kAxisCount = std::size(kAxes);

struct AxisRange {
  double low = INFINITY, high = -INFINITY;
  bool usable() const { return high > low; }
};
using AxisRanges = std::array<AxisRange, kAxisCount>;

// Pixels of one photograph that take part: every `stride`-th along both axes, on alternating places.
template <typename Visit>
void ForPixels(const image::Photo& photo, int stride, Visit&& visit) {
  for (int y = stride / 2; y < photo.height; y += stride)
    for (int x = (stride / 2 + y) % stride; x < photo.width; x += stride) visit(x, y);
}

// The sums of one photograph.
struct PhotoSums {
  std::vector<PoseSums> terms, curves;
  Eigen::VectorXd map_squares, map_cross, place_squares, place_cross;
};

class RestSums {
 public:
  RestSums(const Photographs& photographs, const model::Model& model,
           const std::vector<image::Photo>& expected, const PhotoTermDictionary& dictionary, ThreadPool* pool)
      : p_(photographs), model_(model), expected_(expected), dictionary_(dictionary) {
    const double pixels = static_cast<double>(p_.width()) * p_.height() * p_.size();
    stride_ = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / kMaxPixels))));
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

  const AxisRanges& ranges() const { return ranges_; }

  TermScore ScoreTerm(size_t t) const {
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(static_cast<int>(dictionary_.terms[t].columns.size()));
    std::vector<PoseSums> poses;
    for (const PhotoSums& pose : sums_) {
      poses.push_back(pose.terms[t]);
      squares += pose.terms[t].squares.diagonal();
    }
    // Wide enough that each column may add kPriorGrey, root mean square.
    const Eigen::MatrixXd precision =
        (squares.array().max(1e-300) / (weight_ * kPriorGrey * kPriorGrey)).matrix().asDiagonal();
    return ScoreSums(poses, objects_, precision);
  }

  TermScore ScoreCurve(size_t axis) const {
    std::vector<PoseSums> poses;
    for (const PhotoSums& pose : sums_) poses.push_back(pose.curves[axis]);
    TermScore best;
    for (const double bend : kBends) {
      Eigen::MatrixXd precision =
          Eigen::MatrixXd::Identity(kKnots, kKnots) / (kKnots * kPriorGrey * kPriorGrey);
      for (int n = 1; n + 1 < kKnots; ++n) {
        Eigen::VectorXd second = Eigen::VectorXd::Zero(kKnots);
        second[n - 1] = second[n + 1] = 1, second[n] = -2;
        precision += second * second.transpose() / (bend * bend);
      }
      TermScore score = ScoreSums(poses, objects_, precision);
      if (score.determined && (!best.determined || score.gain_nats > best.gain_nats)) best = std::move(score);
    }
    return best;
  }

  // What grey levels take from unseen poses that stay at their places in the picture, or on the objects.
  double Nameless() const {
    std::vector<Eigen::VectorXd> squares, cross;
    for (const PhotoSums& pose : sums_) squares.push_back(pose.map_squares), cross.push_back(pose.map_cross);
    const double in_picture = UnseenOfMeans(squares, cross, kPriorGrey);
    double on_objects = 0;
    for (size_t object = 0; object < p_.objects.size(); ++object) {
      squares.clear(), cross.clear();
      for (size_t g = 0; g < sums_.size(); ++g)
        if (objects_[g] == static_cast<int>(object))
          squares.push_back(sums_[g].place_squares), cross.push_back(sums_[g].place_cross);
      on_objects += UnseenOfMeans(squares, cross, kPriorGrey);
    }
    return std::max(in_picture, on_objects);
  }

 private:
  PhotoSums Empty() const {
    PhotoSums sums;
    for (const PhotoTerm& term : dictionary_.terms) {
      const int n = static_cast<int>(term.columns.size());
      sums.terms.push_back({Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)});
    }
    for (size_t axis = 0; axis < kAxisCount; ++axis)
      sums.curves.push_back({Eigen::MatrixXd::Zero(kKnots, kKnots), Eigen::VectorXd::Zero(kKnots)});
    sums.map_squares = sums.map_cross = Eigen::VectorXd::Zero(kMapSide * kMapSide);
    sums.place_squares = sums.place_cross = Eigen::VectorXd::Zero(kPlaceSide * kPlaceSide * kPlaceSide);
    return sums;
  }

  static void Add(const PhotoSums& one, PhotoSums* to) {
    for (size_t t = 0; t < one.terms.size(); ++t)
      to->terms[t].squares += one.terms[t].squares, to->terms[t].cross += one.terms[t].cross;
    for (size_t c = 0; c < one.curves.size(); ++c)
      to->curves[c].squares += one.curves[c].squares, to->curves[c].cross += one.curves[c].cross;
    to->map_squares += one.map_squares, to->map_cross += one.map_cross;
    to->place_squares += one.place_squares, to->place_cross += one.place_cross;
  }

  void FindRanges() {
    for (int k = 0; k < p_.size(); ++k) {
      const PixelReader reader(p_, model_, k, expected_[k]);
      ForPixels(expected_[k], stride_, [&](int x, int y) {
        const bool object = expected_[k].mask[static_cast<size_t>(y) * p_.width() + x] != 0;
        const effects::PhotoPixel pixel = reader.At(x, y);
        for (size_t axis = 0; axis < kAxisCount; ++axis) {
          if (kAxes[axis].on_object && !object) continue;
          const double value = kAxes[axis].value(pixel);
          ranges_[axis].low = std::min(ranges_[axis].low, value);
          ranges_[axis].high = std::max(ranges_[axis].high, value);
        }
        ++weight_;
      });
    }
    if (!p_.set->has_session_time) ranges_[kAxisCount - 1] = AxisRange();
  }

  PhotoSums Sum(int k) const {
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
      for (size_t axis = 0; axis < kAxisCount; ++axis)
        if (ranges_[axis].usable())
          AddToCurve(ranges_[axis], kAxes[axis].value(pixel), weight, residual, &sums.curves[axis]);
      const int cell = y * kMapSide / p_.height() * kMapSide + x * kMapSide / p_.width();
      sums.map_squares[cell] += weight, sums.map_cross[cell] += weight * residual;
      if (photo.mask[at] == 0) return;
      int place = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double extent = std::max(bounds.max_m[axis] - bounds.min_m[axis], 1e-9);
        const double share = (photo.point_m[at][axis] - bounds.min_m[axis]) / extent;
        place = place * kPlaceSide + std::clamp(static_cast<int>(share * kPlaceSide), 0, kPlaceSide - 1);
      }
      sums.place_squares[place] += weight, sums.place_cross[place] += weight * residual;
    });
    return sums;
  }

  static void AddToCurve(const AxisRange& range, double value, double weight, double residual,
                         PoseSums* sum) {
    const double place = std::clamp((value - range.low) / (range.high - range.low), 0.0, 1.0) * (kKnots - 1);
    const int below = std::min(static_cast<int>(place), kKnots - 2);
    const double share[2] = {below + 1 - place, place - below};
    for (int i = 0; i < 2; ++i) {
      sum->cross[below + i] += weight * share[i] * residual;
      for (int j = 0; j < 2; ++j) sum->squares(below + i, below + j) += weight * share[i] * share[j];
    }
  }

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

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeCurve(const CurveAxis& axis, const AxisRange& range,
                                                               const Eigen::VectorXd& values) {
  model::LookupSpec spec;
  spec.name = absl::StrCat("rest_", axis.name);
  spec.adds_grey = true;
  spec.stage = model::Stage::kImageSensor;
  spec.covariate = axis.name;
  spec.values.resize(1);
  const auto short_number = [](double value) {
    return std::strtod(absl::StrFormat("%.4g", value).c_str(), nullptr);
  };
  for (int n = 0; n < kKnots; ++n) {
    spec.knots.push_back(short_number(range.low + (range.high - range.low) * n / (kKnots - 1)));
    spec.values[0].push_back(short_number(values[n]));
  }
  return effects::MakeLookupEffect(spec);
}

class RestSearch {
 public:
  RestSearch(const Photographs& photographs, const model::Model& model, const RestErrors& errors,
             ThreadPool* pool)
      : photographs_(photographs), model_(model), errors_(errors), pool_(pool) {}

  // Whether chance hardly brings it about and what it was not fitted to bears it out.
  static bool Holds(const TermScore& score, double paid_nats, double tries, double nameless) {
    return score.determined && score.gain_nats - paid_nats > kEnterNats && score.p * tries < kSuggestP &&
           score.every_object && score.taken_unseen > kMinHeld * score.taken &&
           score.taken_unseen > kOfNameless * nameless;
  }

  // The errors with the effect as comparisons find them; none where it takes too little.
  std::optional<RestSuggestion> Try(const std::shared_ptr<const model::Effect>& effect,
                                    const TermScore& score) const {
    model::Model with = model_;
    model::EffectInstance instance;
    instance.effect = effect;
    instance.values = effect->NeutralValues(with.fingers);
    with.effects.push_back(instance);
    const auto expected = ExpectPhotographs(photographs_, with, false, pool_);
    if (!expected.ok()) return std::nullopt;
    RestSuggestion tried;
    tried.rmse_grey = RmseGrey(photographs_, *expected);
    const double fallen = std::pow(errors_.rmse_grey, 2) - std::pow(tried.rmse_grey, 2);
    const double held = std::min(score.taken_unseen / std::max(score.taken, 1e-300), 1.0);
    const double before2 = std::pow(errors_.heldout_rmse_grey, 2), floor2 = std::pow(errors_.floor_grey, 2);
    const double after2 = std::max(before2 - fallen * held, std::pow(tried.rmse_grey, 2));
    if (!(before2 > floor2)) return std::nullopt;
    tried.heldout_rmse_grey = std::sqrt(after2);
    tried.heldout_gain = std::clamp((before2 - after2) / (before2 - floor2), 0.0, 1.0);
    if (tried.heldout_gain < kMinExcess) return std::nullopt;
    model::Model only = model_;
    const std::string yaml = selection::EffectYaml(only, std::move(instance));
    (effect->formula != nullptr ? tried.formula_yaml : tried.lookup_yaml) = yaml;
    if (effect->formula != nullptr) tried.formula = effect->formula->expression;
    return tried;
  }

 private:
  const Photographs& photographs_;
  const model::Model& model_;
  const RestErrors& errors_;
  ThreadPool* pool_;
};

}  // namespace

std::optional<RestSuggestion> SuggestForRest(const Photographs& photographs, const Photographs& judged,
                                             const model::Model& model, const RestErrors& errors,
                                             ThreadPool* pool) {
  const auto expected = ExpectPhotographs(judged, model, true, pool);
  if (!expected.ok()) return std::nullopt;
  const PhotoTermDictionary dictionary = MakePhotoTerms(judged);
  const RestSums sums(judged, model, *expected, dictionary, pool);
  const double nameless = sums.Nameless();
  const double tries = static_cast<double>(dictionary.terms.size() + kAxisCount);
  const RestSearch search(photographs, model, errors, pool);

  std::optional<RestSuggestion> curve;
  for (size_t axis = 0; axis < kAxisCount; ++axis) {
    if (!sums.ranges()[axis].usable()) continue;
    const TermScore score = sums.ScoreCurve(axis);
    const double paid = std::log(static_cast<double>(kAxisCount * std::size(kBends)));
    if (!RestSearch::Holds(score, paid, tries, nameless)) continue;
    const auto effect = MakeCurve(kAxes[axis], sums.ranges()[axis], score.values);
    if (!effect.ok()) continue;
    std::optional<RestSuggestion> tried = search.Try(*effect, score);
    if (!tried || (curve && tried->heldout_gain <= curve->heldout_gain)) continue;
    tried->covariate = kAxes[axis].name;
    curve = std::move(tried);
  }
  std::vector<std::pair<double, size_t>> order;  // gain beyond what is paid, term
  std::vector<TermScore> scores;
  for (size_t t = 0; t < dictionary.terms.size(); ++t) {
    scores.push_back(sums.ScoreTerm(t));
    const double paid = kPickedNats + dictionary.terms[t].penalty_nats;
    if (RestSearch::Holds(scores[t], paid, tries, nameless))
      order.emplace_back(scores[t].gain_nats - paid, t);
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::optional<RestSuggestion> formula;
  for (size_t n = 0; n < std::min(order.size(), kMaxTried); ++n) {
    const size_t t = order[n].second;
    const TermScore& score = scores[t];
    const auto effect = MakePhotoTermEffect(
        dictionary.terms[t],
        std::vector<double>(score.values.data(), score.values.data() + score.values.size()));
    if (!effect.ok()) continue;
    std::optional<RestSuggestion> tried = search.Try(*effect, score);
    if (!tried || (formula && tried->heldout_gain <= formula->heldout_gain)) continue;
    tried->covariate = dictionary.terms[t].covariate;
    formula = std::move(tried);
  }
  return formula && (!curve || formula->heldout_gain >= kFormulaOfCurve * curve->heldout_gain) ? formula
                                                                                               : curve;
}

}  // namespace touchstone::diagnosis::images
