#include "server/diagnosis/distributions/two_samples.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::diagnosis::distributions {
namespace {

bool Complete(const double* times, int fingers) {
  return std::none_of(times, times + fingers, [](double t) { return std::isnan(t); });
}

}  // namespace

TimePoints ToPoints(const std::vector<double>& time_s, int fingers) {
  TimePoints points;
  points.dimensions = fingers - 1;
  for (size_t at = 0; at + fingers <= time_s.size(); at += fingers) {
    const double* t = &time_s[at];
    if (!Complete(t, fingers)) continue;
    double sum = t[0];
    for (int d = 1; d < fingers; ++d) {
      points.value.push_back((sum - d * t[d]) / std::sqrt(d * (d + 1.0)));
      sum += t[d];
    }
  }
  return points;
}

double MeanDistance(const TimePoints& a, const TimePoints& b) {
  const int dimensions = a.dimensions;
  if (a.size() == 0 || b.size() == 0) return 0;
  // By coordinate, so that the inner loop runs over points of b in vectors.
  const int count = b.size();
  std::vector<double> column(b.value.size()), squares(count);
  for (int n = 0; n < count; ++n)
    for (int d = 0; d < dimensions; ++d) column[size_t(d) * count + n] = b.value[size_t(n) * dimensions + d];
  // Within one sample every pair counts twice.
  const bool own = &a == &b;
  double sum = 0;
  for (int m = 0; m < a.size(); ++m) {
    const int first = own ? m + 1 : 0;
    std::fill(squares.begin(), squares.end(), 0);
    for (int d = 0; d < dimensions; ++d) {
      const double at = a.value[size_t(m) * dimensions + d];
      const double* other = &column[size_t(d) * count];
      for (int n = first; n < count; ++n) squares[n] += (other[n] - at) * (other[n] - at);
    }
    for (int n = first; n < count; ++n) squares[n] = std::sqrt(squares[n]);
    for (int n = first; n < count; ++n) sum += squares[n];
  }
  return (own ? 2 : 1) * sum / (double(a.size()) * count);
}

double EnergyDistance(const TimePoints& a, const TimePoints& b, double within_b) {
  return std::max(0.0, 2 * MeanDistance(a, b) - MeanDistance(a, a) - within_b);
}

double KolmogorovDistance(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return 0;
  double largest = 0;
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    const double at = std::min(a[i], b[j]);
    while (i < a.size() && a[i] <= at) ++i;
    while (j < b.size() && b[j] <= at) ++j;
    largest = std::max(largest, std::abs(double(i) / a.size() - double(j) / b.size()));
  }
  return largest;
}

double TouchStatistic::Mean() const {
  double sum = 0;
  for (const double value : sorted) sum += value;
  return sorted.empty() ? 0 : sum / sorted.size();
}

std::vector<TouchStatistic> TouchStatistics(const std::vector<double>& time_s, int fingers, double speed_m_s,
                                            double spacing_m) {
  std::vector<TouchStatistic> list;
  list.push_back({"spread", "us", {}});
  const bool three = fingers == 3;
  if (three) list.push_back({kCurvatureStatistic, "1/m", {}});
  list.push_back(
      {absl::StrCat(model::FingerName(fingers - 1, fingers), " after ", model::FingerName(0, fingers)),
       "us",
       {}});
  if (fingers > 2) list.push_back({"second after first", "us", {}});
  const size_t fractions = list.size();
  for (int i = 0; i < fingers; ++i)
    list.push_back({absl::StrCat("finger ", model::FingerName(i, fingers), " first"), "", {}});

  std::vector<double> sorted(fingers);
  for (size_t at = 0; at + fingers <= time_s.size(); at += fingers) {
    const double* t = &time_s[at];
    if (!Complete(t, fingers)) continue;
    sorted.assign(t, t + fingers);
    std::sort(sorted.begin(), sorted.end());
    size_t s = 0;
    list[s++].sorted.push_back((sorted.back() - sorted.front()) * kMicrosecondsPerSecond);
    if (three) list[s++].sorted.push_back(speed_m_s * (t[0] - 2 * t[1] + t[2]) / (spacing_m * spacing_m));
    list[s++].sorted.push_back((t[fingers - 1] - t[0]) * kMicrosecondsPerSecond);
    if (fingers > 2) list[s++].sorted.push_back((sorted[1] - sorted[0]) * kMicrosecondsPerSecond);
    for (int i = 0; i < fingers; ++i) list[fractions + i].sorted.push_back(t[i] == sorted[0]);
  }
  for (TouchStatistic& statistic : list) std::sort(statistic.sorted.begin(), statistic.sorted.end());
  return list;
}

}  // namespace touchstone::diagnosis::distributions
