#include "server/uncertainty/predicted_times.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/matern.h"
#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/effects/contact/surface_departure.h"
#include "server/geometry/surface/surface.h"
#include "server/model/value_names.h"

namespace touchstone::uncertainty {
namespace {

constexpr double kStepOfFixed = 1e-3;  // of the typical size: the step of a value without a standard error
constexpr double kMinDegrees = 2.2;    // of Student's t: with fewer its variance is (nearly) infinite
constexpr double kUniformVariance = 1.0 / 12;  // of an interval of length 1

// Of each finger's error less the mean over the fingers that met the object, for independent errors.
void AddIndependent(const std::vector<double>& variances, const std::vector<int>& fingers, double* squares) {
  const double n = static_cast<double>(fingers.size());
  double sum = 0;
  for (const int finger : fingers) sum += variances[finger];
  for (const int finger : fingers) squares[finger] += variances[finger] * (1 - 2 / n) + sum / (n * n);
}

// Covariance of the departures of a surface of which only the size is known, m^2.
Eigen::MatrixXd UnknownSurface(const std::vector<Eigen::Vector3d>& places, double rms_m, double length_m) {
  const int n = static_cast<int>(places.size());
  Eigen::MatrixXd covariance(n, n);
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < n; ++b)
      covariance(a, b) = rms_m * rms_m * Matern52((places[a] - places[b]).norm(), length_m);
  return covariance;
}

// The fingers of a touch that meet the object; none if fewer than two do.
std::vector<int> FingersOf(const effects::TouchBatch& batch, int touch) {
  std::vector<int> fingers;
  for (int finger = 0; finger < batch.fingers(); ++finger)
    if (!std::isnan(batch.contact_time_s[batch.At(finger, touch)])) fingers.push_back(finger);
  if (fingers.size() < 2) fingers.clear();
  return fingers;
}

}  // namespace

PredictedTimes::PredictedTimes(std::shared_ptr<const Posterior> posterior)
    : posterior_(std::move(posterior)), whole_(std::make_shared<const model::Model>(posterior_->model)) {
  const Posterior& p = *posterior_;
  int last = -1;
  for (size_t i = 0; i < p.values.size(); ++i) {
    if (p.values[i].effect != last) effects_.push_back(model::NameOf(p.EffectOf(i)));
    last = p.values[i].effect;
    effect_of_value_.push_back(static_cast<int>(effects_.size()) - 1);
    const model::ParameterInfo& parameter = p.ParameterOf(i);
    const double error = p.StdError(i);
    const double step = error > 0 ? error : kStepOfFixed * parameter.typical * SiFactor(parameter.unit);
    const double value = p.ValueOf(p.model, i);
    const double below = std::max(value - step, std::min(p.Lower(i), value));
    const double above = std::min(value + step, std::max(p.Upper(i), value));
    const auto at = [&](double to) {
      model::Model model = p.model;
      p.SetValue(i, to, &model);
      return touch::TouchSimulator(std::make_shared<const model::Model>(model::DeterministicPart(model)));
    };
    moved_.push_back({below, above, above > below ? step / (above - below) : 0, at(below), at(above)});
    step_.push_back(step);
    has_reproducibility_ |= p.values[i].between_sessions.has_value();
  }
  for (const model::EffectInstance& instance : p.model.effects)
    if (instance.effect->surface_map)
      for (const auto& [object, map] : instance.effect->surface_map->objects)
        maps_.emplace(object, effects::SurfaceDeparture(map));
}

absl::Status PredictedTimes::Run(const touch::TouchSimulator& simulator, const Fill& fill,
                                 Workspace* workspace, std::vector<double>* time_s) const {
  effects::TouchBatch& batch = workspace->batch;
  fill(simulator, &batch);
  TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace->touch));
  TOUCHSTONE_RETURN_IF_ERROR(simulator.RunSensor(&batch, &workspace->touch));
  *time_s = batch.reported_time_s;
  return absl::OkStatus();
}

// By how much every finger's time changes with one step of each value that acts on the object.
absl::Status PredictedTimes::FindChanges(const Fill& fill, const std::string& object,
                                         Workspace* workspace) const {
  workspace->values.clear();
  workspace->changes_s.clear();
  for (size_t i = 0; i < posterior_->values.size(); ++i) {
    const std::string& own = posterior_->values[i].object;
    if ((!own.empty() && own != object) || moved_[i].per_error == 0) continue;
    TOUCHSTONE_RETURN_IF_ERROR(Run(moved_[i].at_below, fill, workspace, &workspace->time_s));
    TOUCHSTONE_RETURN_IF_ERROR(Run(moved_[i].at_above, fill, workspace, &workspace->moved_s));
    std::vector<double> change_s(workspace->time_s.size());
    for (size_t e = 0; e < change_s.size(); ++e) {
      const double change = (workspace->moved_s[e] - workspace->time_s[e]) * moved_[i].per_error;
      change_s[e] = std::isfinite(change) ? change : 0;  // one of the two meets nothing
    }
    workspace->values.push_back(i);
    workspace->changes_s.push_back(std::move(change_s));
  }
  return absl::OkStatus();
}

absl::Status PredictedTimes::Evaluate(const Fill& fill, Workspace* workspace, TimeUncertainty* result) const {
  std::vector<double> reported_s;
  // What acts on the object is known once it is filled in.
  fill(whole_, &workspace->batch);
  TOUCHSTONE_RETURN_IF_ERROR(FindChanges(fill, workspace->batch.surface->name(), workspace));
  TOUCHSTONE_RETURN_IF_ERROR(Run(whole_, fill, workspace, &reported_s));
  const effects::TouchBatch& batch = workspace->batch;
  const size_t entries = static_cast<size_t>(batch.size()) * batch.fingers();
  result->fingers = batch.fingers();
  // Squares first, roots in the end.
  for (auto* column :
       {&result->parameters_s, &result->surface_s, &result->repeatability_s, &result->reproducibility_s})
    column->assign(entries, 0);
  result->combined_s.assign(entries, NAN);
  result->effects_s.assign(effects_.size(), std::vector<double>(entries, 0));
  result->beyond_measured.assign(entries, 0);
  result->contact_m.assign(entries, Eigen::Vector3d::Constant(NAN));
  CombineValues(*workspace, result);
  AddSurface(batch, result);
  AddRepeatability(batch, result);
  FindBeyond(batch, result);
  for (int touch = 0; touch < batch.size(); ++touch) {
    std::vector<char> meets(batch.fingers(), 0);
    for (const int finger : FingersOf(batch, touch)) meets[finger] = 1;
    for (int finger = 0; finger < batch.fingers(); ++finger) {
      const size_t e = static_cast<size_t>(touch) * batch.fingers() + finger;
      double sum = 0;
      for (auto* column : {&result->parameters_s, &result->surface_s, &result->repeatability_s,
                           &result->reproducibility_s}) {
        sum += (*column)[e];
        (*column)[e] = meets[finger] ? std::sqrt((*column)[e]) : NAN;
      }
      for (std::vector<double>& column : result->effects_s)
        column[e] = meets[finger] ? std::sqrt(column[e]) : NAN;
      if (meets[finger]) result->combined_s[e] = std::sqrt(sum);
    }
  }
  return absl::OkStatus();
}

void PredictedTimes::CombineValues(const Workspace& workspace, TimeUncertainty* result) const {
  const effects::TouchBatch& batch = workspace.batch;
  const int n = static_cast<int>(workspace.values.size());
  // Correlations; a value whose step stands for no standard error has none and counts for nothing but other
  // sessions.
  Eigen::MatrixXd correlation(n, n);
  Eigen::VectorXd between(n);
  for (int a = 0; a < n; ++a) {
    const size_t i = workspace.values[a];
    between[a] = posterior_->values[i].between_sessions.value_or(0) / step_[i];
    for (int b = 0; b < n; ++b) {
      const size_t j = workspace.values[b];
      correlation(a, b) =
          posterior_->covariance(static_cast<int>(i), static_cast<int>(j)) / (step_[i] * step_[j]);
    }
  }
  Eigen::VectorXd z(n);
  for (int touch = 0; touch < batch.size(); ++touch) {
    const std::vector<int> fingers = FingersOf(batch, touch);
    for (const int finger : fingers) {
      const size_t e = static_cast<size_t>(touch) * batch.fingers() + finger;
      for (int a = 0; a < n; ++a) {
        double mean = 0;
        for (const int other : fingers) mean += workspace.changes_s[a][batch.At(other, touch)];
        z[a] = workspace.changes_s[a][batch.At(finger, touch)] - mean / static_cast<double>(fingers.size());
      }
      result->parameters_s[e] = std::max(z.dot(correlation * z), 0.0);
      result->reproducibility_s[e] = z.cwiseProduct(between).squaredNorm();
      // Values of one effect follow each other.
      for (int first = 0, end = 0; first < n; first = end) {
        const int effect = effect_of_value_[workspace.values[first]];
        while (end < n && effect_of_value_[workspace.values[end]] == effect) ++end;
        const auto own = z.segment(first, end - first);
        result->effects_s[effect][e] =
            std::max(own.dot(correlation.block(first, first, end - first, end - first) * own), 0.0);
      }
    }
  }
}

void PredictedTimes::AddSurface(const effects::TouchBatch& batch, TimeUncertainty* result) const {
  const std::string& object = batch.surface->name();
  const auto map = maps_.find(object);
  double rms_m = posterior_->surface_rms_m, length_m = posterior_->surface_length_m;
  for (const model::EffectInstance& instance : posterior_->model.effects) {
    if (instance.effect->role != model::EffectRole::kSmoothError) continue;
    const absl::Span<const double> values = instance.ValuesFor(object);
    rms_m = values[0], length_m = values[1];
  }
  if (map == maps_.end() && !(rms_m > 0 && length_m > 0)) return;
  for (int touch = 0; touch < batch.size(); ++touch) {
    const std::vector<int> fingers = FingersOf(batch, touch);
    if (fingers.empty()) continue;
    std::vector<Eigen::Vector3d> places;
    Eigen::VectorXd per_m(static_cast<int>(fingers.size()));  // change of the time with the departure
    for (const int finger : fingers) {
      const int entry = batch.At(finger, touch);
      per_m[static_cast<int>(places.size())] =
          batch.time_per_travel_s_m[entry] * batch.clock_factor /
          std::max(batch.cos_incidence[entry], effects::kMinDepartureCosine);
      places.push_back(effects::ContactInMesh(batch, entry));
    }
    const Eigen::MatrixXd departures =
        map != maps_.end() ? map->second.CovarianceAt(places) : UnknownSurface(places, rms_m, length_m);
    const Eigen::MatrixXd covariance = per_m.asDiagonal() * departures * per_m.asDiagonal();
    const double n = static_cast<double>(fingers.size());
    for (size_t i = 0; i < fingers.size(); ++i) {
      const int row = static_cast<int>(i);
      result->surface_s[static_cast<size_t>(touch) * batch.fingers() + fingers[i]] = std::max(
          covariance(row, row) - 2 * covariance.row(row).sum() / n + covariance.sum() / (n * n), 0.0);
    }
  }
}

void PredictedTimes::AddRepeatability(const effects::TouchBatch& batch, TimeUncertainty* result) const {
  const bool silent = !batch.any_noise && batch.wander_sigma_s == 0 && batch.poll_interval_s == 0;
  const double tails = batch.degrees_of_freedom > 0
                           ? std::max(batch.degrees_of_freedom, kMinDegrees) /
                                 (std::max(batch.degrees_of_freedom, kMinDegrees) - 2)
                           : 1;
  std::vector<double> variances(batch.fingers());
  for (int touch = 0; touch < batch.size(); ++touch) {
    for (int finger = 0; finger < batch.fingers(); ++finger) {
      // The sensor stage has multiplied the noise by its growth.
      const double sigma_s = batch.noise_sigma_s[batch.At(finger, touch)];
      const double before_clock = sigma_s * sigma_s * tails + batch.wander_sigma_s * batch.wander_sigma_s;
      variances[finger] = silent ? posterior_->repeatability_s * posterior_->repeatability_s
                                 : before_clock * batch.clock_factor * batch.clock_factor +
                                       kUniformVariance * batch.poll_interval_s * batch.poll_interval_s;
    }
    AddIndependent(variances, FingersOf(batch, touch),
                   &result->repeatability_s[static_cast<size_t>(touch) * batch.fingers()]);
  }
}

void PredictedTimes::FindBeyond(const effects::TouchBatch& batch, TimeUncertainty* result) const {
  const auto measured = posterior_->measured.find(batch.surface->name());
  const geometry::Bounds& bounds = batch.surface->bounds();
  const double near_m = kNearShare * (bounds.max_m - bounds.min_m).norm();
  for (int touch = 0; touch < batch.size(); ++touch)
    for (const int finger : FingersOf(batch, touch)) {
      const int from = batch.At(finger, touch);
      const size_t e = static_cast<size_t>(touch) * batch.fingers() + finger;
      result->contact_m[e] = batch.contact_m[from];
      bool near = false;
      for (size_t k = 0;
           measured != posterior_->measured.end() && k < measured->second.contact_m.size() && !near; ++k)
        near = (measured->second.contact_m[k] - batch.contact_m[from]).norm() <= near_m &&
               measured->second.normal[k].dot(batch.normal[from]) >= kNearCosine;
      result->beyond_measured[e] = !near;
    }
}

}  // namespace touchstone::uncertainty
