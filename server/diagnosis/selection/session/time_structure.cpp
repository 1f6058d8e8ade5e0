#include "server/diagnosis/selection/session/time_structure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "server/base/numbers/random.h"
#include "server/diagnosis/selection/session/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// Residuals less the mean of their pose (touches with the same fingers), scaled to the variance of single ones.
struct CentredTouches {
  int fingers = 0;
  std::vector<int> touch;                       // in the order of the session
  std::vector<std::vector<int>> repeats;        // positions in `touch` that may change places
  std::vector<double> value;                    // [position * fingers + finger]
  std::vector<int> dof;                         // of a touch: fingers - 1
  std::vector<std::pair<int, int>> neighbours;  // positions
};

CentredTouches Centre(const touches::Observations& o, const std::vector<double>& residuals) {
  CentredTouches c;
  c.fingers = o.fingers;
  std::map<std::pair<int, uint32_t>, std::vector<int>> groups;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    uint32_t mask = 0;
    for (int i = 0; i < o.fingers; ++i)
      if (!std::isnan(residuals[static_cast<size_t>(k) * o.fingers + i])) mask |= 1u << i;
    if (mask != 0) groups[{o.pose[k], mask}].push_back(k);
  }
  std::vector<int> position(o.size(), -1);
  std::vector<double> scale(o.size(), 0);
  for (const auto& [key, members] : groups)
    for (const int k : members)
      if (members.size() > 1) scale[k] = std::sqrt(members.size() / (members.size() - 1.0));
  for (int k = 0; k < o.size(); ++k) {
    if (scale[k] == 0) continue;
    position[k] = static_cast<int>(c.touch.size());
    c.touch.push_back(k);
  }
  c.value.assign(c.touch.size() * o.fingers, 0);
  c.dof.assign(c.touch.size(), 0);
  for (const auto& [key, members] : groups) {
    if (members.size() < 2) continue;
    c.repeats.emplace_back();
    for (int i = 0; i < o.fingers; ++i) {
      if (!((key.second >> i) & 1)) continue;
      double mean = 0;
      for (const int k : members) mean += residuals[static_cast<size_t>(k) * o.fingers + i] / members.size();
      for (const int k : members) {
        c.value[static_cast<size_t>(position[k]) * o.fingers + i] =
            scale[k] * (residuals[static_cast<size_t>(k) * o.fingers + i] - mean);
        ++c.dof[position[k]];
      }
    }
    for (const int k : members) --c.dof[position[k]], c.repeats.back().push_back(position[k]);
  }
  for (size_t n = 1; n < c.touch.size(); ++n) {
    // Across a new session nothing is continued; a touch or two left out between them does no harm.
    const int k = c.touch[n];
    if (o.previous[k] >= 0 && o.pose[k] != o.pose[c.touch[n - 1]] && k - c.touch[n - 1] <= 3)
      c.neighbours.emplace_back(static_cast<int>(n) - 1, static_cast<int>(n));
  }
  return c;
}

// Sums over neighbours of products, by finger. `at[position]`: whose values stand there.
std::vector<double> Products(const CentredTouches& c, const std::vector<int>& at) {
  std::vector<double> sums(c.fingers, 0.0);
  for (const auto& [a, b] : c.neighbours)
    for (int i = 0; i < c.fingers; ++i)
      sums[i] += c.value[static_cast<size_t>(at[a]) * c.fingers + i] *
                 c.value[static_cast<size_t>(at[b]) * c.fingers + i];
  return sums;
}

// How many standard deviations the first of the values is above the mean of the others.
double ZOfFirst(const std::vector<double>& values) {
  const double count = static_cast<double>(values.size()) - 1;
  const double mean = std::accumulate(values.begin() + 1, values.end(), 0.0) / count;
  double squares = 0;
  for (size_t n = 1; n < values.size(); ++n) squares += (values[n] - mean) * (values[n] - mean);
  const double deviation = std::sqrt(squares / (count - 1));
  return deviation > 0 ? (values[0] - mean) / deviation : 0;
}

void FindSigma(const CentredTouches& c, TimeStructure* found) {
  std::vector<double> squares(c.fingers, 0.0);
  double all = 0, dof = 0;
  for (const auto& [a, b] : c.neighbours) {
    for (int i = 0; i < c.fingers; ++i) {
      const double difference =
          c.value[static_cast<size_t>(b) * c.fingers + i] - c.value[static_cast<size_t>(a) * c.fingers + i];
      squares[i] += difference * difference;
      all += difference * difference;
    }
    dof += c.dof[a] + c.dof[b];
  }
  found->sigma_s = dof > 0 ? std::sqrt(all / dof) : 0;
  for (const double sum : squares)
    found->finger_sigma_s.push_back(std::sqrt(sum / (2.0 * c.neighbours.size())));
}

}  // namespace

TimeStructure FindTimeStructure(const touches::Observations& o, const std::vector<double>& residuals) {
  TimeStructure found;
  const CentredTouches c = Centre(o, residuals);
  found.neighbours = static_cast<int>(c.neighbours.size());
  found.finger_z.assign(o.fingers, 0);
  if (found.neighbours < kSessionRules.min_neighbours) return found;
  std::vector<int> at(c.touch.size());
  std::iota(at.begin(), at.end(), 0);
  std::vector<std::vector<double>> by_finger(o.fingers);
  std::vector<double> totals;
  RandomStream random(0, RandomDomain::kDiagnosis, /*index=*/1);
  const int permutations =
      std::clamp(kSessionRules.permuted_touches / static_cast<int>(c.touch.size()),
                 kSessionRules.min_time_permutations.value(), kSessionRules.max_time_permutations.value());
  for (int n = 0; n <= permutations; ++n) {
    if (n > 0)
      for (const std::vector<int>& places : c.repeats)
        for (size_t j = places.size() - 1; j > 0; --j)
          std::swap(at[places[j]], at[places[random.Below(j + 1)]]);
    const std::vector<double> sums = Products(c, at);
    totals.push_back(std::accumulate(sums.begin(), sums.end(), 0.0));
    for (int i = 0; i < o.fingers; ++i) by_finger[i].push_back(sums[i]);
  }
  found.z = ZOfFirst(totals);
  found.p = 0.5 * std::erfc(found.z / std::sqrt(2.0));
  for (int i = 0; i < o.fingers; ++i) found.finger_z[i] = ZOfFirst(by_finger[i]);
  FindSigma(c, &found);
  return found;
}

void AddTimeStructure(const touches::Observations& o, const std::vector<double>& residuals,
                      engine::NoiseFloor* floor) {
  const TimeStructure found = FindTimeStructure(o, residuals);
  floor->sigma_without_time = found.sigma_s;
  floor->time_structure_z = found.z;
  floor->time_structure_p = found.p;
}

bool SharesTime(const engine::NoiseFloor& floor) {
  return floor.from_repeats && floor.time_structure_p < kSessionRules.time_p &&
         floor.sigma_without_time < (1 - kSessionRules.negligible_time) * floor.sigma;
}

void NameTimeFirst(const touches::Observations& o, const engine::NoiseFloor& floor,
                   engine::UnexplainedRest* rest) {
  engine::PutFirst(
      {touches::NameOfTime(o), floor.time_structure_p, 0.5 * floor.time_structure_z * floor.time_structure_z},
      rest);
}

}  // namespace touchstone::diagnosis::selection
