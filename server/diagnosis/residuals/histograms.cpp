// Descriptors and local curvature, measured against simulated (the seed's figure 8), an object and all.
#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/diagnosis/residuals/describe_residuals.h"
#include "server/diagnosis/residuals/histogram_bins.h"
#include "server/diagnosis/residuals/permutation.h"

namespace touchstone {
namespace {

constexpr int kMaxPosesTested = 20000;
constexpr int kPermutations = 499;
constexpr int kRanks = 256;             // into how many parts the test sorts the values
constexpr size_t kMaxPlotted = 200000;  // values a side whose quantiles set the edges

// Values of one quantity, the poses they belong to, and the objects.
struct Sample {
  std::vector<double> measured, simulated, improved;
  std::vector<int> pose, object;
};

// Times as the model would report them: with noise, the same for both models, drawn by the touch's number.
void Simulate(const Prediction& prediction, int k, const ResidualScale& scale, uint64_t touch,
              std::vector<double>* times) {
  RandomStream random(scale.seed, RandomDomain::kDiagnosis, touch, 4);
  for (int i = 0; i < prediction.fingers; ++i)
    (*times)[i] = prediction.time_s[size_t(k) * prediction.fingers + i] + scale.sigma_s * random.Normal();
}

bool Complete(const std::vector<double>& times) {
  return std::none_of(times.begin(), times.end(), [](double t) { return std::isnan(t); });
}

void AddDescriptor(const std::vector<double>& times, std::vector<double>* values) {
  const auto first = std::min_element(times.begin(), times.end());
  for (auto t = times.begin(); t != times.end(); ++t)
    if (t != first) values->push_back((*t - *first) * 1e6);
}

// Were measured and simulated drawn from one distribution, they could change places, in every pose: all of
// its touches at once, whatever they share. The statistic is the mean square gap between the two
// cumulative histograms over fine ranks (Cramer and von Mises).
double SwapP(const std::vector<double>& a, const std::vector<double>& b, const std::vector<int>& pose,
             uint64_t seed, uint64_t number) {
  if (a.empty()) return 1;
  std::vector<double> pooled = a;
  pooled.insert(pooled.end(), b.begin(), b.end());
  std::sort(pooled.begin(), pooled.end());
  std::vector<double> ends;
  for (int r = 1; r < kRanks; ++r) ends.push_back(pooled[pooled.size() * r / kRanks]);
  const auto rank = [&](double value) {
    return static_cast<int>(std::upper_bound(ends.begin(), ends.end(), value) - ends.begin());
  };

  // Values in the order of their poses, with where each pose ends.
  struct Pair {
    int pose, a, b;
  };
  std::vector<Pair> pairs;
  for (size_t n = 0; n < a.size(); ++n) pairs.push_back({pose[n], rank(a[n]), rank(b[n])});
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) { return x.pose < y.pose; });
  std::vector<size_t> pose_end;
  for (size_t n = 1; n <= pairs.size(); ++n)
    if (n == pairs.size() || pairs[n].pose != pairs[n - 1].pose) pose_end.push_back(n);
  if (pose_end.size() > kMaxPosesTested) pose_end.resize(kMaxPosesTested);

  std::vector<int> difference(kRanks);
  const auto gap = [&](auto sign) {
    std::fill(difference.begin(), difference.end(), 0);
    size_t n = 0;
    for (const size_t end : pose_end) {
      const int s = sign();
      for (; n < end; ++n) difference[pairs[n].a] += s, difference[pairs[n].b] -= s;
    }
    double sum = 0, squares = 0;
    for (const int d : difference) sum += d, squares += sum * sum;
    return squares;
  };
  const double observed = gap([] { return 1; });
  RandomStream random(seed, RandomDomain::kDiagnosis, number, 5);
  std::vector<double> permuted(kPermutations);
  for (double& value : permuted) {
    uint64_t bits = 0;
    int left = 0;
    value = gap([&] {
      if (left == 0) bits = random.Word(), left = 64;
      --left;
      const int s = bits & 1 ? 1 : -1;
      bits >>= 1;
      return s;
    });
  }
  return PermutationP(observed, permuted);
}

std::vector<double> Thinned(const std::vector<double>& values) {
  const size_t step = 1 + values.size() / kMaxPlotted;
  std::vector<double> some;
  for (size_t n = 0; n < values.size(); n += step) some.push_back(values[n]);
  return some;
}

void AddHistogram(const std::string& quantity, const std::string& object, const Sample& sample,
                  const ResidualScale& scale, uint64_t number, v1::Report* report) {
  if (sample.measured.empty()) return;
  v1::Histogram* histogram = report->add_histograms();
  histogram->set_quantity(quantity);
  histogram->set_object(object);
  std::vector<double> pooled = Thinned(sample.measured);
  for (const auto* values : {&sample.simulated, &sample.improved}) {
    const std::vector<double> some = Thinned(*values);
    pooled.insert(pooled.end(), some.begin(), some.end());
  }
  const std::vector<double> edges = HistogramEdges(std::move(pooled));
  *histogram->mutable_edges() = {edges.begin(), edges.end()};
  const auto measured = HistogramDensity(sample.measured, edges);
  const auto simulated = HistogramDensity(sample.simulated, edges);
  const auto improved = HistogramDensity(sample.improved, edges);
  *histogram->mutable_measured() = {measured.begin(), measured.end()};
  *histogram->mutable_simulated() = {simulated.begin(), simulated.end()};
  *histogram->mutable_improved() = {improved.begin(), improved.end()};
  histogram->set_p_simulated(SwapP(sample.measured, sample.simulated, sample.pose, scale.seed, number));
  histogram->set_p_improved(sample.improved == sample.simulated
                                ? histogram->p_simulated()
                                : SwapP(sample.measured, sample.improved, sample.pose, scale.seed, number));
}

}  // namespace

void DescribeHistograms(const Observations& observations, const Prediction& initial,
                        const Prediction& improved, const ResidualScale& scale, v1::Report* report) {
  const MeasurementSet& set = *observations.set;
  const int fingers = observations.fingers;
  if (fingers < 2) return;
  Sample descriptor, curvature;
  std::vector<double> measured(fingers), simulated(fingers), better(fingers);
  for (int k = 0; k < observations.size(); ++k) {
    if (!observations.used[k]) continue;
    const int row = observations.row[k];
    const double* times = &observations.time_s[size_t(k) * fingers];
    measured.assign(times, times + fingers);
    Simulate(initial, k, scale, set.touch[row], &simulated);
    Simulate(improved, k, scale, set.touch[row], &better);
    if (!Complete(measured) || !Complete(simulated) || !Complete(better)) continue;
    AddDescriptor(measured, &descriptor.measured);
    AddDescriptor(simulated, &descriptor.simulated);
    AddDescriptor(better, &descriptor.improved);
    for (int i = 1; i < fingers; ++i) {
      descriptor.pose.push_back(observations.pose[k]);
      descriptor.object.push_back(observations.object[k]);
    }
    if (fingers == 3) {
      // DESIGN 8: positive where the surface is convex.
      const double factor = set.speed_m_s[row] / (scale.spacing_m * scale.spacing_m);
      const auto bend = [&](const std::vector<double>& t) { return factor * (t[0] - 2 * t[1] + t[2]); };
      curvature.measured.push_back(bend(measured));
      curvature.simulated.push_back(bend(simulated));
      curvature.improved.push_back(bend(better));
      curvature.pose.push_back(observations.pose[k]);
      curvature.object.push_back(observations.object[k]);
    }
  }

  uint64_t number = 0;
  const int objects = static_cast<int>(observations.objects.size());
  for (const auto& [quantity, all] :
       {std::make_pair("descriptor_us", &descriptor), std::make_pair("curvature_per_m", &curvature)}) {
    AddHistogram(quantity, "", *all, scale, number++, report);
    if (objects < 2) continue;
    std::vector<Sample> parts(objects);
    for (size_t n = 0; n < all->measured.size(); ++n) {
      Sample& part = parts[all->object[n]];
      part.measured.push_back(all->measured[n]);
      part.simulated.push_back(all->simulated[n]);
      part.improved.push_back(all->improved[n]);
      part.pose.push_back(all->pose[n]);
    }
    for (int o = 0; o < objects; ++o)
      AddHistogram(quantity, observations.objects[o], parts[o], scale, number++, report);
  }
}

}  // namespace touchstone
