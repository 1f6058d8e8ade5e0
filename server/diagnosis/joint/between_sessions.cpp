#include "server/diagnosis/joint/between_sessions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

// What other sessions let expect of one, and how far it lies from their mean, over the distance of the limits.
std::pair<ControlLimits, double> LimitsFrom(const std::vector<SessionEstimate>& others,
                                            const SessionEstimate& own) {
  const BetweenSessions between = EstimateBetweenSessions(others);
  const double distance =
      kJointRules.limit_deviations *
      std::hypot(std::hypot(between.std_deviation, between.mean_std_error), own.std_error);
  const double excess = std::abs(own.value - between.mean) / distance;
  return {{between.mean - distance, between.mean + distance, excess > 1}, excess};
}

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

ControlChart MakeControlChart(const std::vector<SessionEstimate>& sessions) {
  ControlChart chart;
  std::vector<char> inside(sessions.size(), 1);
  const auto others = [&](size_t but) {
    std::vector<SessionEstimate> list;
    for (size_t i = 0; i < sessions.size(); ++i)
      if (inside[i] && i != but) list.push_back(sessions[i]);
    return list;
  };
  if (sessions.size() >= kJointRules.min_for_limits) {
    chart.limits.resize(sessions.size());
    for (size_t left = sessions.size();; --left) {
      size_t farthest = 0;
      double most = 1;
      for (size_t i = 0; i < sessions.size(); ++i) {
        const auto [limits, excess] = LimitsFrom(others(i), sessions[i]);
        chart.limits[i] = limits;
        if (inside[i] && excess > most) farthest = i, most = excess;
      }
      // Of three no one can be told from the other two.
      if (most <= 1 || left < kJointRules.min_for_limits) break;
      inside[farthest] = 0;
    }
  }
  chart.inside = EstimateBetweenSessions(others(sessions.size()));
  return chart;
}

}  // namespace touchstone::diagnosis::joint
