#include "server/diagnosis/selection/quality.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>

#include <algorithm>
#include <cmath>

namespace touchstone {
namespace {

constexpr double kMinDegrees = 8;

}  // namespace

bool HasRepeats(const SumOfSquares& error) {
  return error.degrees >= kMinDegrees;
}

double LackOfFitP(const Observations& o, const std::vector<double>& residuals, double parameters) {
  const SumOfSquares pure = PureErrorOf(o, residuals), total = TotalSquares(o, residuals);
  const double degrees = total.degrees - pure.degrees - parameters;
  if (!HasRepeats(pure) || degrees < 1 || !(pure.sum_of_squares > 0)) return 1;
  const double f = std::max(total.sum_of_squares - pure.sum_of_squares, 0.0) / degrees /
                   (pure.sum_of_squares / pure.degrees);
  return boost::math::cdf(boost::math::complement(boost::math::fisher_f(degrees, pure.degrees), f));
}

v1::Quality QualityOf(const Study& study, const Search& search, const Fit& fit,
                      const std::vector<double>& residuals, bool surface) {
  v1::Quality quality;
  const Observations& o = *study.observations;
  double rmse = Rmse(o, residuals);
  const double own = std::sqrt(fit.columns.values.col(0).squaredNorm() /
                               std::max<double>(1, static_cast<double>(fit.columns.values.rows())));
  const double share = own > 0 ? search.HeldoutRmse(fit) / own : 1;
  const SumOfSquares pure = PureErrorOf(o, residuals);
  if (surface) {
    const std::vector<double> left = ResidualsWithoutSurface(study, fit);
    const double taken = study.likelihood->surfaces()[fit.surface].degrees + fit.model.size();
    const SumOfSquares total = TotalSquares(*study.searched, left);
    rmse = std::sqrt(total.sum_of_squares / std::max(total.degrees - taken, 1.0));
    quality.set_lack_of_fit_p(LackOfFitP(*study.searched, left, taken));
  } else if (HasRepeats(pure)) {
    quality.set_lack_of_fit_p(LackOfFitP(o, residuals, fit.model.size()));
  } else {
    // Without repeats: how much better a smooth remainder explains the residuals than none.
    const double gain = std::max(SurfaceEvidence(study, fit), 0.0);
    quality.set_lack_of_fit_p(
        0.5 * boost::math::cdf(boost::math::complement(boost::math::chi_squared(1), 2 * gain)) +
        (gain > 0 ? 0 : 0.5));
  }
  quality.set_rmse_us(rmse * 1e6);
  quality.set_heldout_rmse_us(rmse * share * 1e6);
  return quality;
}

v1::NoiseFloor NoiseFloorOf(const Observations& o, const std::vector<double>& best,
                            double fitted_parameters) {
  v1::NoiseFloor floor;
  SumOfSquares error = PureErrorOf(o, best);
  floor.set_from_repeats(HasRepeats(error));
  if (!floor.from_repeats()) {
    error = TotalSquares(o, best);
    error.degrees = std::max(error.degrees - fitted_parameters, 1.0);
  }
  const double sigma = error.degrees > 0 ? std::sqrt(error.sum_of_squares / error.degrees) : 0;
  floor.set_sigma_us(sigma * 1e6);
  floor.set_degrees_of_freedom(static_cast<uint32_t>(error.degrees));
  if (error.degrees >= 1) {
    const boost::math::chi_squared distribution(error.degrees);
    floor.set_lower_us(sigma * 1e6 * std::sqrt(error.degrees / boost::math::quantile(distribution, 0.975)));
    floor.set_upper_us(sigma * 1e6 * std::sqrt(error.degrees / boost::math::quantile(distribution, 0.025)));
  }
  return floor;
}

}  // namespace touchstone
