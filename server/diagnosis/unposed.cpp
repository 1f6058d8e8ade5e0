#include "server/diagnosis/unposed.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/histogram.h"
#include "server/diagnosis/unposed_distances.h"
#include "server/diagnosis/unposed_effects.h"
#include "server/diagnosis/unposed_plan.h"
#include "server/diagnosis/where.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

constexpr int kMeasuredTouches = 1500;       // at most, all objects together
constexpr int kReferenceTouches = 3000;      // about, all objects together
constexpr int kMostReferenceAnObject = 900;  // distances among them grow with their square
constexpr int kFirstSets = 99;               // made by the model; more only if the first look suspicious
constexpr int kAllSets = 499;
constexpr double kSuspicious = 0.1;
constexpr double kSmallP = 0.005;  // below it the model is not compatible
constexpr double kFewDegrees = 20;
constexpr uint64_t kReferenceSeed = 1;  // sets are 2, 3, ...

class UnposedComparison {
 public:
  UnposedComparison(const DiagnosisInput& input, const DiagnosisContext& context)
      : input_(input), context_(context), set_(*input.set), model_(input.model) {}

  absl::StatusOr<v1::Report> Run(bool diagnose);

 private:
  absl::Status Prepare();
  absl::Status CompareSizes();
  void EstimateNoise();
  absl::Status MakeNull();
  absl::Status FitPlan();
  absl::Status RankAmongSets();
  absl::Status MakeSets(int until);
  absl::StatusOr<std::vector<UnposedSample>> MakeReference(const std::shared_ptr<const Model>& model) const;
  absl::StatusOr<std::vector<UnposedSample>> MakeSet(uint64_t number) const;
  absl::StatusOr<std::vector<double>> TimesOfSet(const std::shared_ptr<const Model>& model, int object,
                                                 bool reference, uint64_t number) const;
  std::vector<double> MeasuredTimes(int object) const;
  bool Progress(const std::string& stage, double done) const {
    return !context_.progress || context_.progress(stage, done);
  }
  std::string PlanInWords() const;
  void FillData(v1::Report* report) const;
  void FillNoise(v1::Report* report) const;
  void FillHistograms(v1::Report* report) const;
  void FillWarnings(v1::Report* report) const;
  absl::Status Judge(v1::Report* report);

  const DiagnosisInput& input_;
  const DiagnosisContext& context_;
  const MeasurementSet& set_;
  double speed_m_s_ = kDefaultSpeedMS;
  std::vector<UnposedObject> objects_;
  double size_ratio_ = 1;               // of measured to simulated times, where it is absurd
  double scatter_s_ = 0, degrees_ = 0;  // among rounds
  std::shared_ptr<const Model> model_;  // with the noise that the rounds show
  bool plan_fitted_ = false;
  bool noise_changed_ = false, noise_is_new_ = false;
  std::vector<UnposedSample> measured_, reference_;
  std::vector<std::vector<std::vector<double>>> sets_;  // [set][object + 1][measure]; the last: all objects
  double p_ = 1;
};

absl::Status UnposedComparison::Prepare() {
  if (set_.size() == 0) return absl::InvalidArgumentError(absl::StrCat(set_.origin, ": holds no touch"));
  if (set_.fingers != input_.model->fingers)
    return absl::InvalidArgumentError(absl::StrCat(set_.origin, ": has times of ", set_.fingers,
                                                   " fingers, the model '", input_.model->name, "' has ",
                                                   input_.model->fingers, ": they must agree"));
  if (set_.fingers < 2)
    return absl::InvalidArgumentError(
        absl::StrCat(set_.origin, ": one finger alone has no relative times, there is nothing to compare"));
  if (set_.speed_m_s.size() == static_cast<size_t>(set_.size())) {
    std::vector<double> speeds = set_.speed_m_s;
    std::nth_element(speeds.begin(), speeds.begin() + speeds.size() / 2, speeds.end());
    speed_m_s_ = speeds[speeds.size() / 2];
  }
  const int objects = static_cast<int>(set_.objects.size());
  for (int o = 0; o < objects; ++o) {
    const auto surface = input_.surfaces.find(set_.objects[o]);
    if (surface == input_.surfaces.end())
      return absl::InvalidArgumentError(absl::StrCat(set_.origin, ": object '", set_.objects[o],
                                                     "' has no mesh: give --mesh ", set_.objects[o],
                                                     "=FILE"));
    objects_.push_back(
        SupposePlan(set_, o, surface->second, speed_m_s_, std::max(24, kMeasuredTouches / objects)));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CompareSizes());
  if (size_ratio_ == 1) EstimateNoise();
  for (int o = 0; o < objects; ++o)
    measured_.push_back(MakeUnposedSample(MeasuredTimes(o), set_.fingers, speed_m_s_, model_->spacing_m));
  return absl::OkStatus();
}

// Times that no speed could give are in another unit than they should be; noise is not to make up for that.
absl::Status UnposedComparison::CompareSizes() {
  double measured = 0, simulated = 0;
  for (size_t o = 0; o < objects_.size(); ++o) {
    const auto spread = [&](const std::vector<double>& time_s) {
      return TouchStatistics(time_s, set_.fingers, speed_m_s_, model_->spacing_m)[0].Mean();
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> time_s,
                                TimesOfSet(model_, static_cast<int>(o), false, kReferenceSeed));
    measured += spread(MeasuredTimes(static_cast<int>(o)));
    simulated += spread(time_s);
  }
  if (simulated > 0 && (measured > 100 * simulated || measured < 0.01 * simulated))
    size_ratio_ = measured / simulated;
  return absl::OkStatus();
}

// What repeats of a pose scatter needs no pose to be known.
void UnposedComparison::EstimateNoise() {
  scatter_s_ = ScatterAmongRounds(set_, objects_, &degrees_);
  if (degrees_ < kFewDegrees || scatter_s_ == 0) return;
  auto model = std::make_shared<Model>(*input_.model);
  for (EffectInstance& instance : model->effects) {
    if (instance.effect->name != "gaussian_noise") continue;
    const double sigma_s = instance.ValuesFor(set_.objects[0])[0];
    // Three standard errors off.
    if (std::abs(scatter_s_ - sigma_s) < 3 * scatter_s_ / std::sqrt(2 * degrees_)) return;
    instance.values[0] = scatter_s_;
    instance.object_values.clear();
    noise_changed_ = true;
    noise_is_new_ = sigma_s == 0;
    model_ = model;
    return;
  }
  EffectInstance noise;
  noise.effect = Catalogue().Find("gaussian_noise");
  noise.values = {scatter_s_};
  model->effects.push_back(std::move(noise));
  noise_changed_ = noise_is_new_ = true;
  model_ = model;
}

std::vector<double> UnposedComparison::MeasuredTimes(int object) const {
  std::vector<double> time_s;
  for (const int row : objects_[object].rows)
    for (int i = 0; i < set_.fingers; ++i) time_s.push_back(set_.TimeS(row, i));
  return time_s;
}

absl::StatusOr<std::vector<double>> UnposedComparison::TimesOfSet(const std::shared_ptr<const Model>& model,
                                                                  int object, bool reference,
                                                                  uint64_t number) const {
  const UnposedObject& like = objects_[object];
  // Every object of every set has poses of its own.
  const uint64_t seed = RandomBlock(input_.seed, RandomDomain::kDiagnosis, number, object, 7)[0];
  if (!reference) return SimulateUnposed(model, like.surface, like.plan, like.number, seed);
  Plan plan = like.plan;
  plan.faces.rounds = 1;
  plan.faces.samples_per_face = std::clamp(kReferenceTouches / 6 / static_cast<int>(set_.objects.size()), 10,
                                           kMostReferenceAnObject / 6);
  std::vector<uint64_t> numbers(6 * plan.faces.samples_per_face);
  for (size_t n = 0; n < numbers.size(); ++n) numbers[n] = n;
  return SimulateUnposed(model, like.surface, plan, numbers, seed);
}

absl::StatusOr<std::vector<UnposedSample>> UnposedComparison::MakeReference(
    const std::shared_ptr<const Model>& model) const {
  std::vector<UnposedSample> samples;
  for (size_t o = 0; o < objects_.size(); ++o) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> time_s,
                                TimesOfSet(model, static_cast<int>(o), true, kReferenceSeed));
    samples.push_back(MakeUnposedSample(time_s, set_.fingers, speed_m_s_, model->spacing_m));
  }
  return samples;
}

absl::StatusOr<std::vector<UnposedSample>> UnposedComparison::MakeSet(uint64_t number) const {
  std::vector<UnposedSample> samples;
  for (size_t o = 0; o < objects_.size(); ++o) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> time_s,
                                TimesOfSet(model_, static_cast<int>(o), false, number));
    // A finger that reported nothing in the set does so here.
    const std::vector<double> measured = MeasuredTimes(static_cast<int>(o));
    for (size_t t = 0; t < time_s.size(); ++t)
      if (std::isnan(measured[t])) time_s[t] = NAN;
    samples.push_back(MakeUnposedSample(time_s, set_.fingers, speed_m_s_, model_->spacing_m));
  }
  return samples;
}

absl::Status UnposedComparison::MakeSets(int until) {
  const int from = static_cast<int>(sets_.size());
  sets_.resize(until);
  std::vector<absl::Status> status(until);
  const auto make = [&](int begin, int end) {
    for (int n = begin; n < end; ++n) {
      auto set = MakeSet(kReferenceSeed + 1 + n);
      if (!set.ok()) {
        status[n] = set.status();
        continue;
      }
      for (size_t o = 0; o < objects_.size(); ++o)
        sets_[n].push_back(UnposedDistances((*set)[o], reference_[o]));
      sets_[n].push_back(UnposedDistances(*set, reference_));
    }
  };
  const int portion = 10;
  for (int begin = from; begin < until; begin += portion) {
    if (!Progress("simulating sets", double(begin) / kAllSets)) return absl::CancelledError("cancelled");
    const int end = std::min(until, begin + portion);
    if (context_.pool)
      context_.pool->ParallelFor(end - begin, 1, [&](int a, int b) { make(begin + a, begin + b); });
    else
      make(begin, end);
  }
  for (const absl::Status& each : status) TOUCHSTONE_RETURN_IF_ERROR(each);
  return absl::OkStatus();
}

// The distances of one object (or of all: the last) in every set.
UnposedNull NullOf(const std::vector<std::vector<std::vector<double>>>& sets, size_t object) {
  std::vector<std::vector<double>> distances;
  for (const auto& set : sets) distances.push_back(set[object]);
  return UnposedNull(std::move(distances));
}

// p of the measured set among sets made under the plan as it stands; more sets only where it matters.
absl::Status UnposedComparison::RankAmongSets() {
  sets_.clear();
  TOUCHSTONE_ASSIGN_OR_RETURN(reference_, MakeReference(model_));
  const std::vector<double> distances = UnposedDistances(measured_, reference_);
  for (const int sets : {kFirstSets, kAllSets}) {
    TOUCHSTONE_RETURN_IF_ERROR(MakeSets(sets));
    p_ = NullOf(sets_, objects_.size()).P(distances);
    if (p_ > kSuspicious) break;
  }
  return absl::OkStatus();
}

// How far the touches were tilted and spread is unknown. What another tilt or spread explains is no error of
// the model: so the most favourable one is taken. That makes p too large rather than too small.
absl::Status UnposedComparison::FitPlan() {
  double best = UnposedDistances(measured_, reference_)[0];
  const auto attempt = [&](double tilt_deg, double spread, FacesPlan* best_plan) -> absl::Status {
    for (UnposedObject& object : objects_) {
      object.plan.faces.most_tilt_rad = tilt_deg * kRadiansPerDegree;
      object.plan.faces.spread = spread;
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<UnposedSample> reference, MakeReference(model_));
    const double distance = UnposedDistances(measured_, reference)[0];
    if (distance < best) best = distance, *best_plan = objects_[0].plan.faces;
    return absl::OkStatus();
  };
  FacesPlan coarse = objects_[0].plan.faces;
  for (const double tilt_deg : {5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0})
    for (const double spread : {0.4, 0.6, 0.8})
      TOUCHSTONE_RETURN_IF_ERROR(attempt(tilt_deg, spread, &coarse));
  FacesPlan fine = coarse;
  for (const double tilt_deg : {-2.5, 0.0, 2.5})
    for (const double spread : {-0.1, 0.0, 0.1})
      TOUCHSTONE_RETURN_IF_ERROR(
          attempt(coarse.most_tilt_rad / kRadiansPerDegree + tilt_deg, coarse.spread + spread, &fine));
  for (UnposedObject& object : objects_) {
    object.plan.faces.most_tilt_rad = fine.most_tilt_rad;
    object.plan.faces.spread = fine.spread;
  }
  plan_fitted_ = true;
  return absl::OkStatus();
}

absl::Status UnposedComparison::MakeNull() {
  TOUCHSTONE_RETURN_IF_ERROR(RankAmongSets());
  if (p_ > kSuspicious) return absl::OkStatus();
  TOUCHSTONE_RETURN_IF_ERROR(FitPlan());
  return RankAmongSets();
}

std::string UnposedComparison::PlanInWords() const {
  const UnposedObject& first = objects_[0];
  const FacesPlan& faces = first.plan.faces;
  return absl::StrCat("faces of the bounding box, ", faces.samples_per_face, " poses a face, ", first.repeats,
                      first.repeats == 1 ? " touch" : " touches", " a pose, tilt up to ",
                      std::round(10 * faces.most_tilt_rad / kRadiansPerDegree) / 10, " deg, spread over ",
                      std::lround(100 * faces.spread), " % of the face",
                      plan_fitted_ ? " (what fits best)" : "", ", standoff ",
                      FromSi(Unit::kMillimetre, faces.standoff_m), " mm, ",
                      FromSi(Unit::kMillimetrePerSecond, speed_m_s_), " mm/s");
}

void UnposedComparison::FillData(v1::Report* report) const {
  report->set_model_name(input_.model->name);
  report->set_model_hash(input_.model->Hash());
  for (int i = 0; i < set_.fingers; ++i) report->add_fingers(FingerName(i, set_.fingers));
  v1::DataSummary* data = report->mutable_data();
  data->set_rows(set_.size());
  data->set_origin(set_.origin);
  *data->mutable_objects() = {set_.objects.begin(), set_.objects.end()};
  data->set_rounds(objects_[0].in_rounds ? objects_[0].repeats : 0);

  // Every row is either compared, or thinned out, or lacks a finger.
  int compared = 0, taken = 0, missed = 0, incomplete = 0;
  v1::UnusedRows unused;
  for (const UnposedObject& object : objects_) {
    taken += static_cast<int>(object.rows.size());
    for (const int row : object.rows) {
      int missing = 0;
      for (int i = 0; i < set_.fingers; ++i) missing += std::isnan(set_.TimeS(row, i));
      missed += missing;
      compared += missing == 0;
      if (missing == 0) continue;
      ++incomplete;
      if (unused.examples_size() < 5) unused.add_examples(set_.touch[row]);
    }
  }
  report->set_touches(compared);
  data->set_missed_contacts(missed);
  if (incomplete > 0) {
    unused.set_rows(incomplete);
    unused.set_reason("a finger reported nothing: without poses only whole touches can be compared");
    *data->add_unused() = unused;
  }
  if (taken < set_.size()) {
    v1::UnusedRows* thinned = data->add_unused();
    thinned->set_rows(set_.size() - taken);
    thinned->set_reason("more touches than the comparison of distributions needs: thinned by whole poses");
  }
}

void UnposedComparison::FillNoise(v1::Report* report) const {
  if (degrees_ >= kFewDegrees && scatter_s_ > 0) {
    const double error = scatter_s_ / std::sqrt(2 * degrees_);
    report->set_noise_floor_us(scatter_s_ * 1e6);
    v1::NoiseFloor* floor = report->mutable_noise_floor();
    floor->set_sigma_us(scatter_s_ * 1e6);
    floor->set_degrees_of_freedom(static_cast<uint32_t>(degrees_));
    floor->set_lower_us((scatter_s_ - 1.96 * error) * 1e6);
    floor->set_upper_us((scatter_s_ + 1.96 * error) * 1e6);
    floor->set_from_repeats(true);
  }
}

void UnposedComparison::FillHistograms(v1::Report* report) const {
  const auto descriptors = [&](const UnposedSample& sample) {
    // Points back into times less the first's: contrasts undone, Helmert's rows are orthonormal.
    std::vector<double> values;
    const int fingers = set_.fingers;
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
    if (bend && set_.fingers != 3) break;
    std::vector<double> all_measured, all_simulated;
    std::vector<std::pair<std::vector<double>, std::vector<double>>> parts;
    for (size_t o = 0; o < objects_.size(); ++o) {
      parts.emplace_back(bend ? curvature(measured_[o]) : descriptors(measured_[o]),
                         bend ? curvature(reference_[o]) : descriptors(reference_[o]));
      all_measured.insert(all_measured.end(), parts[o].first.begin(), parts[o].first.end());
      all_simulated.insert(all_simulated.end(), parts[o].second.begin(), parts[o].second.end());
    }
    const std::vector<double> distances = UnposedDistances(measured_, reference_);
    add(quantity, "", all_measured, all_simulated,
        NullOf(sets_, objects_.size()).P(measure, distances[measure]));
    if (objects_.size() < 2) continue;
    for (size_t o = 0; o < objects_.size(); ++o) {
      if (measured_[o].points.size() == 0) continue;
      const std::vector<double> apart = UnposedDistances(measured_[o], reference_[o]);
      add(quantity, set_.objects[o], parts[o].first, parts[o].second,
          NullOf(sets_, o).P(measure, apart[measure]));
    }
  }
}

void UnposedComparison::FillWarnings(v1::Report* report) const {
  report->add_warnings(
      "no poses: times are compared as distributions, which is about two orders weaker than touch by touch; "
      "where "
      "on the object the model fails, and which effect is missing, cannot be known");
  report->add_warnings(absl::StrCat("no poses: the set is supposed to be made like this: ", PlanInWords(),
                                    "; another protocol or speed shows as a difference, too"));
  if (degrees_ < kFewDegrees) {
    const bool noise =
        std::any_of(model_->effects.begin(), model_->effects.end(),
                    [](const EffectInstance& e) { return e.effect->name == "gaussian_noise"; });
    report->add_warnings(noise ? "no rounds can be told apart: the noise is taken from the model as it is"
                               : "no rounds can be told apart and the model has no noise: nothing is known "
                                 "about the noise, and its lack may be all that differs");
  }
  if (size_ratio_ != 1)
    report->add_warnings(absl::StrCat("the measured times are ", absl::StrFormat("%.2g", size_ratio_),
                                      " times the simulated ones: is their unit us, and the mesh's mm?"));
}

absl::Status UnposedComparison::Judge(v1::Report* report) {
  const double error_us = scatter_s_ / std::sqrt(2 * std::max(1.0, degrees_)) * 1e6;
  const auto fill_noise = [&](v1::ParameterValue* value) {
    value->set_name("sigma_us");
    value->set_unit("us");
    value->set_value(scatter_s_ * 1e6);
    value->set_std_error(error_us);
    value->set_lower(scatter_s_ * 1e6 - 1.96 * error_us);
    value->set_upper(scatter_s_ * 1e6 + 1.96 * error_us);
  };
  std::string noise_words;
  if (noise_is_new_) {
    v1::Step* step = report->add_steps();
    step->set_effect("gaussian_noise");
    step->set_probability(1);
    step->set_scope("rig");
    step->set_lack_of_fit_p(p_);
    const auto effect = Catalogue().Find("gaussian_noise");
    step->set_meaning(effect->meaning);
    step->set_check_on_rig(effect->check_on_rig);
    step->set_remedy(effect->remedy);
    fill_noise(step->add_parameters());
    noise_words = absl::StrCat("Rounds of the same poses scatter by ", TimeInWords(scatter_s_),
                               " a finger; the model has no noise. ");
  } else if (noise_changed_) {
    v1::Refit* refit = report->add_refitted();
    refit->set_effect("gaussian_noise");
    fill_noise(refit->add_parameters());
    noise_words = absl::StrCat("Rounds of the same poses scatter by ", TimeInWords(scatter_s_),
                               " a finger, not as the model says. ");
  }
  if (noise_changed_) {
    report->set_improved_model_yaml(FormatModel(*model_));
    report->set_improved_model_hash(model_->Hash());
  }

  if (p_ > kSmallP) {
    report->set_verdict(noise_is_new_ ? v1::Report::MISSING_EFFECTS : v1::Report::ADEQUATE);
    report->set_summary(absl::StrCat(
        noise_words, "As distributions, the measured times and those of the model ",
        noise_changed_ ? "with that noise " : "", "do not differ (p = ", absl::StrFormat("%.2g", p_),
        "). That says little: without poses only large errors show."));
    return absl::OkStatus();
  }

  // What would make it compatible.
  report->set_verdict(v1::Report::UNEXPLAINED);
  const UnposedNull null = NullOf(sets_, objects_.size());
  const MisfitOfModel misfit = [&](std::shared_ptr<const Model> model) -> absl::StatusOr<UnposedMisfit> {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<UnposedSample> reference, MakeReference(model));
    const std::vector<double> distances = UnposedDistances(measured_, reference);
    return UnposedMisfit{distances[0], null.P(distances)};
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::vector<CompatibleEffect> compatible,
      FindCompatibleEffects(*model_, input_.also, misfit, context_.pool,
                            [&](double done) { return Progress("trying effects", 0.5 + 0.5 * done); }));
  std::vector<std::string> words;
  for (const CompatibleEffect& effect : compatible) {
    report->mutable_distributions()->add_compatible_effects(effect.effect);
    words.push_back(absl::StrCat(effect.effect, " (", effect.values, ")"));
  }
  report->set_summary(absl::StrCat(
      noise_words, "As distributions, the measured times differ from the model's (p = ",
      absl::StrFormat("%.2g", p_), "). ",
      words.empty()
          ? "No single effect of the catalogue would make them alike: there may be several, or another "
            "protocol or speed. "
          : absl::StrCat("Compatible effects are ", absl::StrJoin(words, ", "),
                         "; which of them it is, if it is one, times alone cannot tell. "),
      "To know more, write down the poses of the touches."));
  return absl::OkStatus();
}

absl::StatusOr<v1::Report> UnposedComparison::Run(bool diagnose) {
  v1::Report report;
  TOUCHSTONE_RETURN_IF_ERROR(Prepare());
  FillData(&report);
  if (report.touches() == 0)
    return absl::InvalidArgumentError(absl::StrCat(
        set_.origin, ": no touch has a time of every finger; without poses there is nothing to compare"));
  TOUCHSTONE_RETURN_IF_ERROR(MakeNull());

  v1::DistributionComparison* distributions = report.mutable_distributions();
  const UnposedNull null = NullOf(sets_, objects_.size());
  const std::vector<double> distances = UnposedDistances(measured_, reference_);
  distributions->set_energy_distance(distances[0] * 1e6);
  distributions->set_p(null.P(0, distances[0]));
  distributions->set_plan(PlanInWords());
  int simulated = 0;
  for (const UnposedSample& sample : reference_) simulated += sample.points.size();
  distributions->set_simulated_touches(simulated);
  for (size_t s = 0; s < reference_[0].statistics.size(); ++s) {
    v1::StatisticTest* test = distributions->add_statistics();
    test->set_name(reference_[0].statistics[s].name);
    test->set_unit(reference_[0].statistics[s].unit);
    // Objects weigh as in the set, on both sides.
    double measured = 0, model = 0, weight = 0;
    for (size_t o = 0; o < objects_.size(); ++o) {
      const double touches = measured_[o].points.size();
      measured += touches * measured_[o].statistics[s].Mean();
      model += touches * reference_[o].statistics[s].Mean();
      weight += touches;
    }
    test->set_measured(measured / weight);
    test->set_simulated(model / weight);
    test->set_p(null.P(static_cast<int>(s) + 1, distances[s + 1]));
  }
  report.mutable_initial()->set_lack_of_fit_p(p_);
  FillNoise(&report);
  FillHistograms(&report);
  FillWarnings(&report);
  if (diagnose) {
    TOUCHSTONE_RETURN_IF_ERROR(Judge(&report));
    report.mutable_final()->set_lack_of_fit_p(p_);
  } else {
    report.set_summary(absl::StrCat("As distributions, the measured times ",
                                    p_ > kSmallP ? "do not differ" : "differ",
                                    " from the model's (p = ", absl::StrFormat("%.2g", p_), ")."));
  }
  Progress("done", 1);
  return report;
}

}  // namespace

absl::StatusOr<v1::Report> CompareUnposed(const DiagnosisInput& input, const DiagnosisContext& context,
                                          bool diagnose) {
  return UnposedComparison(input, context).Run(diagnose);
}

}  // namespace touchstone
