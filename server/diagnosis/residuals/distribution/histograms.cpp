#include "server/diagnosis/residuals/distribution/histograms.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/diagnosis/residuals/distribution/permutation.h"
#include "server/diagnosis/residuals/distribution/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// Values of one quantity under measurement and both models; pose and object of each.
struct ComparedSample {
  std::vector<double> measured, simulated, improved;
  std::vector<int> pose, object;
};

// Times of touch k as the model would report them: with noise that depends on the touch's number alone.
void AddNoise(const touches::Prediction& prediction, int k, const ResidualScale& scale, uint64_t touch,
              std::vector<double>* time_s) {
  RandomStream random(scale.seed, RandomDomain::kDiagnosis, touch, 4);
  for (int i = 0; i < prediction.fingers; ++i)
    (*time_s)[i] = prediction.time_s[size_t(k) * prediction.fingers + i] + scale.sigma_s * random.Normal();
}

bool Complete(const std::vector<double>& times) {
  return std::none_of(times.begin(), times.end(), [](double t) { return std::isnan(t); });
}

void AppendDescriptorUs(const std::vector<double>& time_s, std::vector<double>* values) {
  const auto first = std::min_element(time_s.begin(), time_s.end());
  for (auto t = time_s.begin(); t != time_s.end(); ++t)
    if (t != first) values->push_back((*t - *first) * kMicrosecondsPerSecond);
}

// Descriptors and curvatures of all touches that are complete under measurement and both models.
struct ComparedQuantities {
  ComparedSample descriptor, curvature;
};

ComparedQuantities CollectQuantities(const touches::Observations& observations,
                                     const touches::Prediction& initial, const touches::Prediction& improved,
                                     const ResidualScale& scale) {
  const session::MeasurementSet& set = *observations.set;
  const int fingers = observations.fingers;
  ComparedQuantities all;
  ComparedSample& descriptor = all.descriptor;
  ComparedSample& curvature = all.curvature;
  std::vector<double> measured(fingers), simulated(fingers), better(fingers);
  for (int k = 0; k < observations.size(); ++k) {
    if (!observations.used[k]) continue;
    const int row = observations.row[k];
    const double* times = &observations.time_s[size_t(k) * fingers];
    measured.assign(times, times + fingers);
    AddNoise(initial, k, scale, set.touch[row], &simulated);
    AddNoise(improved, k, scale, set.touch[row], &better);
    if (!Complete(measured) || !Complete(simulated) || !Complete(better)) continue;
    AppendDescriptorUs(measured, &descriptor.measured);
    AppendDescriptorUs(simulated, &descriptor.simulated);
    AppendDescriptorUs(better, &descriptor.improved);
    for (int i = 1; i < fingers; ++i) {
      descriptor.pose.push_back(observations.pose[k]);
      descriptor.object.push_back(observations.object[k]);
    }
    if (fingers == 3) {
      const double factor = set.speed_m_s[row] / (scale.spacing_m * scale.spacing_m);
      const auto curvature_per_m = [&](const std::vector<double>& t) {
        return factor * (t[0] - 2 * t[1] + t[2]);
      };
      curvature.measured.push_back(curvature_per_m(measured));
      curvature.simulated.push_back(curvature_per_m(simulated));
      curvature.improved.push_back(curvature_per_m(better));
      curvature.pose.push_back(observations.pose[k]);
      curvature.object.push_back(observations.object[k]);
    }
  }
  return all;
}

std::vector<ComparedSample> ByObject(const ComparedSample& all, int objects) {
  std::vector<ComparedSample> parts(objects);
  for (size_t n = 0; n < all.measured.size(); ++n) {
    ComparedSample& part = parts[all.object[n]];
    part.measured.push_back(all.measured[n]);
    part.simulated.push_back(all.simulated[n]);
    part.improved.push_back(all.improved[n]);
    part.pose.push_back(all.pose[n]);
  }
  return parts;
}

std::vector<double> Thinned(const std::vector<double>& values) {
  const size_t step = 1 + values.size() / kDistributionRules.max_plotted;
  std::vector<double> some;
  for (size_t n = 0; n < values.size(); n += step) some.push_back(values[n]);
  return some;
}

ComparedHistogram MakeHistogram(HistogramQuantity quantity, const std::string& object,
                                const ComparedSample& sample, uint64_t seed, uint64_t number) {
  ComparedHistogram histogram;
  histogram.quantity = quantity;
  histogram.object = object;
  std::vector<double> pooled = Thinned(sample.measured);
  for (const auto* values : {&sample.simulated, &sample.improved}) {
    const std::vector<double> some = Thinned(*values);
    pooled.insert(pooled.end(), some.begin(), some.end());
  }
  histogram.edges = HistogramEdges(std::move(pooled));
  histogram.measured = HistogramDensity(sample.measured, histogram.edges);
  histogram.simulated = HistogramDensity(sample.simulated, histogram.edges);
  histogram.improved = HistogramDensity(sample.improved, histogram.edges);
  histogram.p_simulated = PosePermutationP(sample.measured, sample.simulated, sample.pose, seed, number);
  histogram.p_improved = sample.improved == sample.simulated
                             ? histogram.p_simulated
                             : PosePermutationP(sample.measured, sample.improved, sample.pose, seed, number);
  return histogram;
}

}  // namespace

std::vector<ComparedHistogram> MakeHistograms(const touches::Observations& observations,
                                              const touches::Prediction& initial,
                                              const touches::Prediction& improved,
                                              const ResidualScale& scale) {
  std::vector<ComparedHistogram> histograms;
  if (observations.fingers < 2) return histograms;
  const ComparedQuantities all = CollectQuantities(observations, initial, improved, scale);
  uint64_t number = 0;
  const auto add = [&](HistogramQuantity quantity, const std::string& object, const ComparedSample& sample) {
    if (!sample.measured.empty())
      histograms.push_back(MakeHistogram(quantity, object, sample, scale.seed, number));
    ++number;
  };
  const int objects = static_cast<int>(observations.objects.size());
  for (const HistogramQuantity quantity : {HistogramQuantity::kDescriptor, HistogramQuantity::kCurvature}) {
    const ComparedSample& sample =
        quantity == HistogramQuantity::kDescriptor ? all.descriptor : all.curvature;
    add(quantity, "", sample);
    if (objects < 2) continue;
    const std::vector<ComparedSample> parts = ByObject(sample, objects);
    for (int o = 0; o < objects; ++o) add(quantity, observations.objects[o], parts[o]);
  }
  return histograms;
}

}  // namespace touchstone::diagnosis::residuals
