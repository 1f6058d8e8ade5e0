#include "server/base/numbers/distributions.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/gamma.hpp>
#include <boost/math/distributions/non_central_chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/beta.hpp>

namespace touchstone {

double ChiSquaredTail(double x, double degrees_of_freedom) {
  return x > 0 && degrees_of_freedom > 0 ? boost::math::gamma_q(0.5 * degrees_of_freedom, 0.5 * x) : 1;
}

double ChiSquaredQuantile(double p, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), p);
}

double NoncentralChiSquaredTail(double x, double degrees_of_freedom, double noncentrality) {
  if (!(x > 0)) return 1;
  if (!(noncentrality > 0)) return ChiSquaredTail(x, degrees_of_freedom);
  return boost::math::cdf(
      boost::math::complement(boost::math::non_central_chi_squared(degrees_of_freedom, noncentrality), x));
}

double NoncentralityForTail(double x, double degrees_of_freedom, double p) {
  if (ChiSquaredTail(x, degrees_of_freedom) >= p) return 0;
  // boost's complement of find_non_centrality takes the upper tail.
  return boost::math::non_central_chi_squared::find_non_centrality(
      boost::math::complement(degrees_of_freedom, x, p));
}

double StudentTail(double t, double degrees_of_freedom) {
  return boost::math::cdf(boost::math::complement(boost::math::students_t(degrees_of_freedom), t));
}

double StudentQuantile(double p, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::students_t(degrees_of_freedom), p);
}

double FisherTail(double f, double numerator_degrees_of_freedom, double denominator_degrees_of_freedom) {
  return boost::math::cdf(boost::math::complement(
      boost::math::fisher_f(numerator_degrees_of_freedom, denominator_degrees_of_freedom), f));
}

double GammaTail(double x, double mean, double variance) {
  const boost::math::gamma_distribution<> distribution(mean * mean / variance, variance / mean);
  return boost::math::cdf(boost::math::complement(distribution, x));
}

double BetaQuantile(double p, double a, double b) {
  return boost::math::ibeta_inv(a, b, p);
}

}  // namespace touchstone
