#include "server/diagnosis/images/search/photo_quality.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "server/base/numbers/distributions.h"
#include "server/base/numbers/normal.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/images/pixels/photo_cells.h"
#include "server/diagnosis/images/search/rules.h"

namespace touchstone::diagnosis::images {

PixelNoise NoiseOfResiduals(const Photographs& p, const std::vector<image::Photo>& expected,
                            ThreadPool* pool) {
  std::vector<NoiseGatherer> gathered(p.size());
  ParallelFor(pool, p.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      std::vector<float> residual = p.measured_grey[k];
      for (size_t i = 0; i < residual.size(); ++i) residual[i] -= expected[k].grey[i];
      gathered[k].Add(residual, p.measured_grey[k], p.width(), p.height(), 1);
    }
  });
  NoiseGatherer all;
  for (const NoiseGatherer& one : gathered) all.Add(one);
  return all.Estimate();
}

engine::NoiseFloor NoiseFloorOfPhotographs(const Photographs& p, const std::vector<image::Photo>& expected,
                                           ThreadPool* pool) {
  engine::NoiseFloor floor;
  const double pixels = static_cast<double>(p.width()) * p.height();
  std::map<int, std::vector<int>> poses;
  for (int k = 0; k < p.size(); ++k) poses[p.pose[k]].push_back(k);
  double squares = 0;
  for (const auto& [pose, members] : poses) {
    if (members.size() < 2) continue;
    for (size_t i = 0; i < p.measured_grey[members[0]].size(); ++i) {
      double sum = 0, sum_of_squares = 0;
      for (const int k : members)
        sum += p.measured_grey[k][i], sum_of_squares += std::pow(p.measured_grey[k][i], 2);
      squares += sum_of_squares - sum * sum / static_cast<double>(members.size());
    }
    floor.degrees_of_freedom += pixels * static_cast<double>(members.size() - 1);
  }
  floor.from_repeats = floor.degrees_of_freedom >= kPhotoSearchRules.min_repeat_pixels;
  if (floor.from_repeats) {
    floor.sigma = std::sqrt(squares / floor.degrees_of_freedom);
  } else {
    const RecordTable record(NoiseOfResiduals(p, expected, pool));
    double variance = 0;
    for (int k = 0; k < p.size(); ++k)
      for (const float grey : expected[k].grey) variance += record.Variance(grey);
    floor.degrees_of_freedom = kPhotoSearchRules.pixel_dof_share * pixels * p.size();
    floor.sigma = std::sqrt(variance / (pixels * std::max(p.size(), 1)));
  }
  const double share = kNormalQuantile975 / std::sqrt(2 * floor.degrees_of_freedom);
  floor.lower = floor.sigma * (1 - share);
  floor.upper = floor.sigma * (1 + share);
  return floor;
}

double ContourPlaceVariance(const Photographs& p, const std::vector<image::Photo>& expected,
                            ThreadPool* pool) {
  std::vector<double> excess(p.size(), 0.0), squares(p.size(), 0.0);
  ParallelFor(pool, p.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      const std::vector<float> contours = ContourSquares(expected[k].grey, p.width(), p.height());
      for (size_t i = 0; i < contours.size(); ++i) {
        if (!(contours[i] > 0)) continue;
        const double residual = static_cast<double>(p.measured_grey[k][i]) - expected[k].grey[i];
        excess[k] += residual * residual - p.record->Variance(expected[k].grey[i]);
        squares[k] += contours[i];
      }
    }
  });
  const double all = std::accumulate(squares.begin(), squares.end(), 0.0);
  if (!(all > 0)) return kUnknownPlacePx2;
  return std::clamp(std::accumulate(excess.begin(), excess.end(), 0.0) / all,
                    kPhotoSearchRules.min_place_px2.value(), kUnknownPlacePx2);
}

double PatchMisfitP(const Photographs& p, const std::vector<image::Photo>& expected, int parameters,
                    ThreadPool* pool) {
  const CellGrid grid = GridOfPicture(p.width(), p.height(), kPhotoSearchRules.patches);
  std::vector<double> squares(p.size());
  ParallelFor(pool, p.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      std::vector<float> residual = p.measured_grey[k];
      for (size_t i = 0; i < residual.size(); ++i) residual[i] -= expected[k].grey[i];
      squares[k] = CellSums(grid, residual.data(), CellWeights(grid, expected[k].grey, *p.record))
                       .cast<double>()
                       .squaredNorm();
    }
  });
  double sum = 0;
  for (const double square : squares) sum += square;
  const double freedom = static_cast<double>(grid.size()) * p.size() - parameters;
  return ChiSquaredTail(sum / kPhotoSearchRules.variance_known, freedom);
}

engine::Quality QualityOfPhotographs(const Photographs& photographs,
                                     const std::vector<image::Photo>& expected, int parameters,
                                     ThreadPool* pool) {
  engine::Quality quality;
  quality.rmse = quality.heldout_rmse = RmseGrey(photographs, expected);
  quality.lack_of_fit_p = PatchMisfitP(photographs, expected, parameters, pool);
  return quality;
}

void AssessByPixels(const Photographs& p, const engine::NoiseFloor& floor, engine::Quality* quality) {
  const double freedom = kPhotoSearchRules.pixel_dof_share * p.width() * p.height() * p.size();
  const double ratio = quality->rmse / (kPhotoSearchRules.contours * floor.sigma);
  if (!(floor.sigma > 0) || ratio <= 1) return;
  quality->lack_of_fit_p = std::min(quality->lack_of_fit_p, ChiSquaredTail(freedom * ratio * ratio, freedom));
}

absl::StatusOr<double> HeldOutRatio(const Photographs& photographs, const PhotoRows& rows,
                                    const engine::Experiment& experiment, const engine::Fit& fit) {
  if (fit.model.size() == 0) return 1;
  engine::Experiment nearly = experiment;
  nearly.near_enough = kPhotoSearchRules.held_out_near;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<std::vector<engine::RefitWithoutPart>> divisions,
                              engine::RefitWithoutParts(nearly, fit));
  const auto squares_of = [&](const model::Model& model,
                              const std::set<int>& which) -> absl::StatusOr<double> {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::vector<double> squares,
        SquaredErrors(photographs, model, std::vector<int>(which.begin(), which.end()), experiment.pool));
    return std::accumulate(squares.begin(), squares.end(), 0.0);
  };
  std::set<int> all;
  for (int row = 0; row < rows.rows(); ++row) all.insert(rows.PhotographOfRow(row));
  TOUCHSTONE_ASSIGN_OR_RETURN(const double seen, squares_of(fit.model.base(), all));
  double largest = seen;
  for (const std::vector<engine::RefitWithoutPart>& refits : divisions) {
    double unseen = 0;
    for (const engine::RefitWithoutPart& refit : refits) {
      std::set<int> which;
      for (const int row : refit.rows) which.insert(rows.PhotographOfRow(row));
      TOUCHSTONE_ASSIGN_OR_RETURN(const double squares, squares_of(refit.fit.model.base(), which));
      unseen += squares;
    }
    largest = std::max(largest, unseen);
  }
  return seen > 0 ? std::sqrt(largest / seen) : 1;
}

double HeldOutExcess(const PhotoSearch& search, const engine::Fit& fit, const Photographs& photographs,
                     double floor_grey) {
  if (fit.model.size() == 0) return 0;
  const double rows = search.rows->rows();
  const double seen = fit.columns.values.col(0).squaredNorm();
  const double unseen = std::max(engine::HeldOutRmse(*search.experiment, fit),
                                 engine::HeldOutRmseByBlock(*search.experiment, fit));
  const double pixels =
      static_cast<double>(photographs.width()) * photographs.height() * search.rows->photographs();
  return std::max(rows * unseen * unseen - seen, 0.0) * floor_grey * floor_grey / pixels;
}

}  // namespace touchstone::diagnosis::images
