#include "server/diagnosis/joint/between_sessions.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace touchstone::diagnosis::joint {
namespace {

constexpr double kLimitDeviations = 3;  // Shewhart's limits

}  // namespace

BetweenSessions EstimateBetweenSessions(const std::vector<SessionEstimate>& sessions) {
  const auto weighted = [&](double variance) {
    double sum = 0, weights = 0;
    for (const SessionEstimate& one : sessions) {
      const double weight = 1 / (one.std_error * one.std_error + variance);
      sum += weight * one.value, weights += weight;
    }
    return std::pair{weights > 0 ? sum / weights : 0, weights};
  };
  BetweenSessions between;
  if (sessions.empty()) return between;
  const auto [fixed, weights] = weighted(0);
  double q = 0, squares = 0;
  for (const SessionEstimate& one : sessions) {
    const double weight = 1 / (one.std_error * one.std_error);
    q += weight * (one.value - fixed) * (one.value - fixed);
    squares += weight * weight;
  }
  const double degrees = static_cast<double>(sessions.size()) - 1;
  const double scale = weights - squares / weights;
  const double variance = scale > 0 ? std::max(0.0, (q - degrees) / scale) : 0;
  const auto [mean, all] = weighted(variance);
  between.mean = mean;
  between.mean_std_error = 1 / std::sqrt(all);
  between.std_deviation = std::sqrt(variance);
  return between;
}

ControlLimits LimitsOfSession(const std::vector<SessionEstimate>& sessions, size_t session) {
  std::vector<SessionEstimate> others = sessions;
  others.erase(others.begin() + static_cast<long>(session));
  const BetweenSessions between = EstimateBetweenSessions(others);
  const SessionEstimate& own = sessions[session];
  const double deviation =
      std::hypot(std::hypot(between.std_deviation, between.mean_std_error), own.std_error);
  ControlLimits limits;
  limits.lower = between.mean - kLimitDeviations * deviation;
  limits.upper = between.mean + kLimitDeviations * deviation;
  limits.outside = own.value < limits.lower || own.value > limits.upper;
  return limits;
}

}  // namespace touchstone::diagnosis::joint
