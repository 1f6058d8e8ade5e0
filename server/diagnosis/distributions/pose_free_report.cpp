#include "server/diagnosis/distributions/pose_free_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/residuals/histogram_bins.h"

namespace touchstone {
namespace {

void FillNoise(const UnposedCase& the_case, v1::Report* report) {
  if (the_case.degrees >= UnposedCase::kFewDegrees && the_case.scatter_s > 0) {
    const double error = the_case.scatter_s / std::sqrt(2 * the_case.degrees);
    report->set_noise_floor_us(the_case.scatter_s * 1e6);
    v1::NoiseFloor* floor = report->mutable_noise_floor();
    floor->set_sigma_us(the_case.scatter_s * 1e6);
    floor->set_degrees_of_freedom(static_cast<uint32_t>(the_case.degrees));
    floor->set_lower_us((the_case.scatter_s - 1.96 * error) * 1e6);
    floor->set_upper_us((the_case.scatter_s + 1.96 * error) * 1e6);
    floor->set_from_repeats(true);
  }
}

void FillHistograms(const UnposedCase& the_case, const UnposedRank& rank, v1::Report* report) {
  const auto descriptors = [&](const UnposedSample& sample) {
    // Points back into times less the first's: contrasts undone, Helmert's rows are orthonormal.
    std::vector<double> values;
    const int fingers = the_case.set.fingers;
    std::vector<double> time(fingers);
    for (int n = 0; n < sample.points.size(); ++n) {
      const double* y = &sample.points.value[size_t(n) * (fingers - 1)];
      std::fill(time.begin(), time.end(), 0);
      for (int d = 1; d < fingers; ++d) {
        const double unit = y[d - 1] / std::sqrt(d * (d + 1.0));
        for (int i = 0; i < d; ++i) time[i] += unit;
        time[d] -= d * unit;
      }
      const auto first = std::min_element(time.begin(), time.end());
      for (auto t = time.begin(); t != time.end(); ++t)
        if (t != first) values.push_back((*t - *first) * 1e6);
    }
    return values;
  };
  const auto curvature = [](const UnposedSample& sample) {
    for (const TouchStatistic& statistic : sample.statistics)
      if (statistic.name == "curvature_per_m") return statistic.sorted;
    return std::vector<double>();
  };
  const auto add = [&](const std::string& quantity, const std::string& object, std::vector<double> measured,
                       std::vector<double> simulated, double p) {
    if (measured.empty() || simulated.empty()) return;
    std::vector<double> pooled = measured;
    pooled.insert(pooled.end(), simulated.begin(), simulated.end());
    const std::vector<double> edges = HistogramEdges(std::move(pooled));
    v1::Histogram* histogram = report->add_histograms();
    histogram->set_quantity(quantity);
    histogram->set_object(object);
    const auto density = HistogramDensity(measured, edges), model = HistogramDensity(simulated, edges);
    *histogram->mutable_edges() = {edges.begin(), edges.end()};
    *histogram->mutable_measured() = {density.begin(), density.end()};
    *histogram->mutable_simulated() = {model.begin(), model.end()};
    *histogram->mutable_improved() = {model.begin(), model.end()};
    histogram->set_p_simulated(p);
    histogram->set_p_improved(p);
  };
  for (const bool bend : {false, true}) {
    const std::string quantity = bend ? "curvature_per_m" : "descriptor_us";
    const int measure = bend ? 2 : 0;  // of the distances: energy, spread, curvature, ...
    if (bend && the_case.set.fingers != 3) break;
    std::vector<double> all_measured, all_simulated;
    std::vector<std::pair<std::vector<double>, std::vector<double>>> parts;
    for (size_t o = 0; o < the_case.objects.size(); ++o) {
      parts.emplace_back(bend ? curvature(the_case.measured[o]) : descriptors(the_case.measured[o]),
                         bend ? curvature(rank.reference()[o]) : descriptors(rank.reference()[o]));
      all_measured.insert(all_measured.end(), parts[o].first.begin(), parts[o].first.end());
      all_simulated.insert(all_simulated.end(), parts[o].second.begin(), parts[o].second.end());
    }
    const std::vector<double>& distances = rank.distances();
    add(quantity, "", all_measured, all_simulated,
        rank.Null(the_case.objects.size()).P(measure, distances[measure]));
    if (the_case.objects.size() < 2) continue;
    for (size_t o = 0; o < the_case.objects.size(); ++o) {
      if (the_case.measured[o].points.size() == 0) continue;
      const std::vector<double> apart = UnposedDistances(the_case.measured[o], rank.reference()[o]);
      add(quantity, the_case.set.objects[o], parts[o].first, parts[o].second,
          rank.Null(o).P(measure, apart[measure]));
    }
  }
}

void FillWarnings(const UnposedCase& the_case, const std::string& plan, v1::Report* report) {
  report->add_warnings(
      "no poses: times are compared as distributions, which is about two orders weaker than touch by touch; "
      "where on the object the model fails, and which effect is missing, cannot be known");
  report->add_warnings(absl::StrCat("no poses: the set is supposed to be made like this: ", plan,
                                    "; another protocol or speed shows as a difference, too"));
  if (the_case.degrees < UnposedCase::kFewDegrees) {
    const bool noise =
        std::any_of(the_case.model->effects.begin(), the_case.model->effects.end(),
                    [](const EffectInstance& e) { return e.effect->name == "gaussian_noise"; });
    report->add_warnings(noise ? "no rounds can be told apart: the noise is taken from the model as it is"
                               : "no rounds can be told apart and the model has no noise: nothing is known "
                                 "about the noise, and its lack may be all that differs");
  }
  if (the_case.size_ratio != 1)
    report->add_warnings(absl::StrCat("the measured times are ", absl::StrFormat("%.2g", the_case.size_ratio),
                                      " times the simulated ones: is their unit us, and the mesh's mm?"));
}

}  // namespace

std::string PlanInWords(const UnposedCase& the_case, const SupposedPoses& poses, bool fitted) {
  const UnposedObject& first = the_case.objects[0];
  const FacesPlan faces = WithPoses(first.plan, poses).faces;
  return absl::StrCat("faces of the bounding box, ", faces.samples_per_face, " poses a face, ", first.repeats,
                      first.repeats == 1 ? " touch" : " touches", " a pose, tilt up to ",
                      std::round(10 * faces.max_tilt_rad / kRadiansPerDegree) / 10, " deg, spread over ",
                      std::lround(100 * faces.spread), " % of the face", fitted ? " (what fits best)" : "",
                      ", standoff ", FromSi(Unit::kMillimetre, faces.standoff_m), " mm, ",
                      FromSi(Unit::kMillimetrePerSecond, the_case.speed_m_s), " mm/s");
}

void FillUnposedData(const UnposedCase& the_case, v1::Report* report) {
  report->set_model_name(the_case.input.model->name);
  report->set_model_hash(the_case.input.model->Hash());
  for (int i = 0; i < the_case.set.fingers; ++i) report->add_fingers(FingerName(i, the_case.set.fingers));
  v1::DataSummary* data = report->mutable_data();
  data->set_rows(the_case.set.size());
  data->set_origin(the_case.set.origin);
  *data->mutable_objects() = {the_case.set.objects.begin(), the_case.set.objects.end()};
  data->set_rounds(the_case.objects[0].in_rounds ? the_case.objects[0].repeats : 0);

  // Every row is either compared, or thinned out, or lacks a finger.
  int compared = 0, taken = 0, missed = 0, incomplete = 0;
  v1::UnusedRows unused;
  for (const UnposedObject& object : the_case.objects) {
    taken += static_cast<int>(object.rows.size());
    for (const int row : object.rows) {
      int missing = 0;
      for (int i = 0; i < the_case.set.fingers; ++i) missing += std::isnan(the_case.set.TimeS(row, i));
      missed += missing;
      compared += missing == 0;
      if (missing == 0) continue;
      ++incomplete;
      if (unused.examples_size() < 5) unused.add_examples(the_case.set.touch[row]);
    }
  }
  report->set_touches(compared);
  data->set_missed_contacts(missed);
  if (incomplete > 0) {
    unused.set_rows(incomplete);
    unused.set_reason("a finger reported nothing: without poses only whole touches can be compared");
    *data->add_unused() = unused;
  }
  if (taken < the_case.set.size()) {
    v1::UnusedRows* thinned = data->add_unused();
    thinned->set_rows(the_case.set.size() - taken);
    thinned->set_reason("more touches than the comparison of distributions needs: thinned by whole poses");
  }
  FillNoise(the_case, report);
}

void FillUnposedComparison(const UnposedCase& the_case, const UnposedRank& rank, bool poses_fitted,
                           v1::Report* report) {
  const std::string plan = PlanInWords(the_case, rank.poses(), poses_fitted);
  v1::DistributionComparison* distributions = report->mutable_distributions();
  const UnposedNull null = rank.Null(the_case.objects.size());
  const std::vector<double>& distances = rank.distances();
  distributions->set_energy_distance(distances[0] * 1e6);
  distributions->set_p(null.P(0, distances[0]));
  distributions->set_plan(plan);
  int simulated = 0;
  for (const UnposedSample& sample : rank.reference()) simulated += sample.points.size();
  distributions->set_simulated_touches(simulated);
  for (size_t s = 0; s < rank.reference()[0].statistics.size(); ++s) {
    v1::StatisticTest* test = distributions->add_statistics();
    test->set_name(rank.reference()[0].statistics[s].name);
    test->set_unit(rank.reference()[0].statistics[s].unit);
    // Objects weigh as in the set, on both sides.
    double measured = 0, model = 0, weight = 0;
    for (size_t o = 0; o < the_case.objects.size(); ++o) {
      const double touches = the_case.measured[o].points.size();
      measured += touches * the_case.measured[o].statistics[s].Mean();
      model += touches * rank.reference()[o].statistics[s].Mean();
      weight += touches;
    }
    test->set_measured(measured / weight);
    test->set_simulated(model / weight);
    test->set_p(null.P(static_cast<int>(s) + 1, distances[s + 1]));
  }
  report->mutable_initial()->set_lack_of_fit_p(rank.p());
  FillHistograms(the_case, rank, report);
  FillWarnings(the_case, plan, report);
}

}  // namespace touchstone
