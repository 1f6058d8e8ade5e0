#include "server/diagnosis/distributions/pose_free_description.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/normal.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/rules.h"

namespace touchstone::diagnosis::distributions {
namespace {

// Contact times relative to the first finger's, in us: the contrasts of a sample's points undone (Helmert's
// rows are orthonormal).
std::vector<double> DescriptorsUs(const PoseFreeSample& sample, int fingers) {
  std::vector<double> values;
  std::vector<double> time_s(fingers);
  for (int n = 0; n < sample.points.size(); ++n) {
    const double* contrast = &sample.points.value[size_t(n) * (fingers - 1)];
    std::fill(time_s.begin(), time_s.end(), 0);
    for (int d = 1; d < fingers; ++d) {
      const double unit = contrast[d - 1] / std::sqrt(d * (d + 1.0));
      for (int i = 0; i < d; ++i) time_s[i] += unit;
      time_s[d] -= d * unit;
    }
    const auto first = std::min_element(time_s.begin(), time_s.end());
    for (auto t = time_s.begin(); t != time_s.end(); ++t)
      if (t != first) values.push_back((*t - *first) * kMicrosecondsPerSecond);
  }
  return values;
}

std::vector<double> Curvatures(const PoseFreeSample& sample) {
  for (const TouchStatistic& statistic : sample.statistics)
    if (statistic.name == kCurvatureStatistic) return statistic.sorted;
  return {};
}

residuals::ComparedHistogram HistogramOf(residuals::HistogramQuantity quantity, const std::string& object,
                                         const std::vector<double>& measured,
                                         const std::vector<double>& simulated, double p_value) {
  residuals::ComparedHistogram histogram;
  histogram.quantity = quantity;
  histogram.object = object;
  std::vector<double> pooled = measured;
  pooled.insert(pooled.end(), simulated.begin(), simulated.end());
  histogram.edges = residuals::HistogramEdges(std::move(pooled));
  histogram.measured = residuals::HistogramDensity(measured, histogram.edges);
  histogram.simulated = residuals::HistogramDensity(simulated, histogram.edges);
  histogram.improved = histogram.simulated;
  histogram.p_simulated = histogram.p_improved = p_value;
  return histogram;
}

// Histograms of one quantity; `measure` is its place among the distances.
void AppendHistograms(const PoseFreeExperiment& experiment, const PoseFreeRank& rank,
                      residuals::HistogramQuantity quantity, int measure,
                      std::vector<residuals::ComparedHistogram>* histograms) {
  const auto values = [&](const PoseFreeSample& sample) {
    return quantity == residuals::HistogramQuantity::kCurvature
               ? Curvatures(sample)
               : DescriptorsUs(sample, experiment.set.fingers);
  };
  const size_t objects = experiment.objects.size();
  std::vector<double> all_measured, all_simulated;
  std::vector<residuals::ComparedHistogram> by_object;
  for (size_t o = 0; o < objects; ++o) {
    const std::vector<double> measured = values(experiment.measured[o]),
                              simulated = values(rank.reference()[o]);
    all_measured.insert(all_measured.end(), measured.begin(), measured.end());
    all_simulated.insert(all_simulated.end(), simulated.begin(), simulated.end());
    if (objects < 2 || measured.empty() || simulated.empty()) continue;
    const std::vector<double> distances = PoseFreeDistances(experiment.measured[o], rank.reference()[o]);
    by_object.push_back(HistogramOf(quantity, experiment.set.objects[o], measured, simulated,
                                    rank.Null(o).P(measure, distances[measure])));
  }
  if (all_measured.empty() || all_simulated.empty()) return;
  histograms->push_back(HistogramOf(quantity, "", all_measured, all_simulated,
                                    rank.Null(objects).P(measure, rank.distances()[measure])));
  histograms->insert(histograms->end(), by_object.begin(), by_object.end());
}

}  // namespace

PoseFreeRows CountRows(const PoseFreeExperiment& experiment) {
  const session::MeasurementSet& set = experiment.set;
  PoseFreeRows rows;
  rows.rounds = experiment.objects[0].in_rounds ? experiment.objects[0].repeats : 0;
  rows.thinned = set.size();
  for (const PoseFreeObject& object : experiment.objects) {
    rows.thinned -= static_cast<int>(object.rows.size());
    for (const int row : object.rows) {
      int missing = 0;
      for (int i = 0; i < set.fingers; ++i) missing += std::isnan(set.TimeS(row, i));
      rows.missed_contacts += missing;
      rows.compared += missing == 0;
      if (missing == 0) continue;
      ++rows.incomplete;
      if (rows.incomplete_examples.size() < kDistributionRules.max_examples)
        rows.incomplete_examples.push_back(set.touch[row]);
    }
  }
  return rows;
}

std::optional<RoundNoise> NoiseOfRounds(const PoseFreeExperiment& experiment) {
  const RoundScatter& scatter = experiment.scatter;
  if (!experiment.noise_is_known() || !(scatter.sigma_s > 0)) return std::nullopt;
  RoundNoise noise;
  noise.sigma_s = scatter.sigma_s;
  noise.std_error_s = scatter.sigma_s / std::sqrt(2 * scatter.degrees_of_freedom);
  noise.lower_s = scatter.sigma_s - kNormalQuantile975 * noise.std_error_s;
  noise.upper_s = scatter.sigma_s + kNormalQuantile975 * noise.std_error_s;
  noise.degrees_of_freedom = scatter.degrees_of_freedom;
  return noise;
}

std::vector<StatisticComparison> CompareStatistics(const PoseFreeExperiment& experiment,
                                                   const PoseFreeRank& rank) {
  const size_t objects = experiment.objects.size();
  const PoseFreeNull null = rank.Null(objects);
  std::vector<StatisticComparison> comparisons;
  for (size_t s = 0; s < rank.reference()[0].statistics.size(); ++s) {
    StatisticComparison comparison;
    comparison.name = rank.reference()[0].statistics[s].name;
    comparison.unit = rank.reference()[0].statistics[s].unit;
    double measured = 0, simulated = 0, weight = 0;
    for (size_t o = 0; o < objects; ++o) {
      const double touches = experiment.measured[o].points.size();
      measured += touches * experiment.measured[o].statistics[s].Mean();
      simulated += touches * rank.reference()[o].statistics[s].Mean();
      weight += touches;
    }
    comparison.measured = measured / weight;
    comparison.simulated = simulated / weight;
    comparison.p_value = null.P(static_cast<int>(s) + 1, rank.distances()[s + 1]);
    comparisons.push_back(std::move(comparison));
  }
  return comparisons;
}

std::vector<residuals::ComparedHistogram> ComparePoseFreeHistograms(const PoseFreeExperiment& experiment,
                                                                    const PoseFreeRank& rank) {
  // The distances are those of the energy, the spread and, with three fingers, the curvature.
  constexpr int kEnergyMeasure = 0, kCurvatureMeasure = 2;
  std::vector<residuals::ComparedHistogram> histograms;
  AppendHistograms(experiment, rank, residuals::HistogramQuantity::kDescriptor, kEnergyMeasure, &histograms);
  if (experiment.set.fingers == 3)
    AppendHistograms(experiment, rank, residuals::HistogramQuantity::kCurvature, kCurvatureMeasure,
                     &histograms);
  return histograms;
}

std::string PlanInWords(const PoseFreeExperiment& experiment, const AssumedPoses& poses, bool fitted) {
  const PoseFreeObject& first = experiment.objects[0];
  const touch::FacesPlan faces = WithPoses(first.plan, poses).faces;
  return absl::StrCat("faces of the bounding box, ", faces.samples_per_face, " poses per face, ",
                      first.repeats, first.repeats == 1 ? " touch" : " touches", " per pose, tilt up to ",
                      std::round(10 * faces.max_tilt_rad / kRadiansPerDegree) / 10, " deg, spread over ",
                      std::lround(100 * faces.spread), " % of the face", fitted ? " (what fits best)" : "",
                      ", standoff ", FromSi(Unit::kMillimetre, faces.standoff_m), " mm, ",
                      FromSi(Unit::kMillimetrePerSecond, experiment.speed_m_s), " mm/s");
}

}  // namespace touchstone::diagnosis::distributions
