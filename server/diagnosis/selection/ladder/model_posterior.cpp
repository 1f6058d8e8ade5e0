#include "server/diagnosis/selection/ladder/model_posterior.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/engine/fit/support_points.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/model/parameter_values.h"

namespace touchstone::diagnosis::selection {
namespace {

// Where each effect of a fit's model stands in the improved one, which has lost some and gained others at its
// end; -1: it has lost it.
std::vector<int> PlacesIn(const model::Model& improved, const model::Model& fitted) {
  std::vector<int> places;
  size_t next = 0;
  for (const model::EffectInstance& instance : fitted.effects) {
    const bool same = next < improved.effects.size() && improved.effects[next].effect == instance.effect;
    places.push_back(same ? static_cast<int>(next++) : -1);
  }
  return places;
}

// With the size that rigs show as a normal prior of each parameter.
Eigen::MatrixXd WithPriors(const Eigen::MatrixXd& covariance,
                           const std::vector<engine::FreeParameter>& parameters) {
  Eigen::MatrixXd sum = covariance;
  for (Eigen::Index i = 0; i < sum.rows(); ++i) {
    const double scale = parameters[static_cast<size_t>(i)].scale;
    if (scale > 0) sum(i, i) += scale * scale;
  }
  const Eigen::MatrixXd with = covariance - covariance * SymmetricSolver(sum).SolveColumns(covariance);
  return 0.5 * (with + with.transpose());
}

// The open values of the improved model in the order of its effects, and how they change with the parameters
// of the fit.
struct OpenValues {
  std::vector<uncertainty::OpenValue> values;
  std::vector<Eigen::VectorXd> gradients;
};
OpenValues OpenValuesOf(const engine::Parameterization& model, const model::Model& improved) {
  const std::vector<int> places = PlacesIn(improved, model.base());
  const std::vector<engine::FreeParameter>& parameters = model.parameters();
  std::vector<int> order(parameters.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return parameters[a].effect < parameters[b].effect; });
  OpenValues open;
  std::vector<char> done(parameters.size(), 0);
  for (const int first : order) {
    const engine::FreeParameter& p = parameters[first];
    if (done[first] || places[p.effect] < 0) continue;
    const model::Effect& effect = *improved.effects[places[p.effect]].effect;
    const int offset = model::ValueOffset(effect, p.parameter, improved.fingers);
    for (int entry = 0; entry < effect.parameters[p.parameter].Count(improved.fingers); ++entry) {
      uncertainty::OpenValue value;
      value.effect = places[p.effect], value.parameter = p.parameter, value.entry = entry;
      value.object = p.object;
      Eigen::VectorXd gradient = Eigen::VectorXd::Zero(model.size());
      const model::EffectInstance& instance = improved.effects[value.effect];
      const double now = (p.object.empty() ? instance.values : instance.ValuesFor(p.object))[offset + entry];
      for (size_t i = 0; i < parameters.size(); ++i) {
        const engine::FreeParameter& other = parameters[i];
        if (other.effect != p.effect || other.parameter != p.parameter || other.object != p.object) continue;
        gradient[static_cast<int>(i)] = other.weights[offset + entry] * (other.reciprocal ? -now * now : 1);
        done[i] = 1;
      }
      open.values.push_back(std::move(value));
      open.gradients.push_back(std::move(gradient));
    }
  }
  return open;
}

// The size of the surfaces' errors that the rows allow, averaged over how likely each is: standard deviation
// and length.
std::pair<double, double> SurfaceLeft(const Workspace& workspace, const engine::Fit& fit) {
  const engine::Likelihood& likelihood = *workspace.likelihood;
  std::vector<int> members(static_cast<size_t>(fit.model.size()) + 1);
  for (size_t i = 0; i < members.size(); ++i) members[i] = static_cast<int>(i);
  const size_t count = likelihood.hypotheses().size();
  std::vector<double> logs, sizes_m(count, 0);
  for (size_t s = 0; s < count; ++s) {
    std::vector<Eigen::MatrixXd> grams(count);
    grams[s] = likelihood.Gram(fit.columns, static_cast<int>(s));
    const engine::LaplaceEvidence evidence =
        engine::ComputeLaplaceEvidence(likelihood, grams, members, fit.model.parameters(), fit.point);
    logs.push_back(evidence.log_evidence);
    sizes_m[s] = likelihood.hypotheses()[s].amplitude_over_sigma * evidence.sigma;
  }
  const double all = engine::LogSum(logs);
  double square = 0, log_length = 0;
  for (size_t s = 0; s < count; ++s) {
    const double part = std::exp(logs[s] - all) * sizes_m[s] * sizes_m[s];
    if (!(part > 0)) continue;
    square += part;
    log_length += part * std::log(likelihood.hypotheses()[s].length_m);
  }
  if (!(square > 0)) return {0, 0};
  return {std::sqrt(square), std::exp(log_length / square)};
}

bool KnowsSurfaces(const model::Model& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const model::EffectInstance& instance) {
    return instance.effect->role == model::EffectRole::kSmoothError ||
           instance.effect->surface_map != nullptr;
  });
}

// Contacts that took part, one per pose and finger, spread over each object.
std::map<std::string, uncertainty::MeasuredPlaces> MeasuredPlacesOf(const touches::Observations& o,
                                                                    const touches::Prediction& prediction) {
  std::vector<uncertainty::MeasuredPlaces> all(o.objects.size());
  std::vector<char> seen(static_cast<size_t>(o.poses), 0);
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k] || seen[o.pose[k]]) continue;
    seen[o.pose[k]] = 1;
    for (size_t e = static_cast<size_t>(k) * o.fingers; e < static_cast<size_t>(k + 1) * o.fingers; ++e) {
      if (std::isnan(o.time_s[e]) || !prediction.contact_m[e].allFinite()) continue;
      all[o.object[k]].contact_m.push_back(prediction.contact_m[e]);
      all[o.object[k]].normal.push_back(prediction.normal[e]);
    }
  }
  std::map<std::string, uncertainty::MeasuredPlaces> places;
  for (size_t object = 0; object < all.size(); ++object) {
    uncertainty::MeasuredPlaces& kept = places[o.objects[object]];
    kept.contact_m = engine::SupportPoints(all[object].contact_m, kLadderRules.max_measured_places);
    for (const Eigen::Vector3d& contact_m : kept.contact_m) {
      const auto found = std::find(all[object].contact_m.begin(), all[object].contact_m.end(), contact_m);
      kept.normal.push_back(all[object].normal[static_cast<size_t>(found - all[object].contact_m.begin())]);
    }
  }
  return places;
}

}  // namespace

std::optional<engine::Parameterization> WithEverythingFree(const engine::Fit& fit,
                                                           const model::Model& improved) {
  engine::Parameterization model = fit.model;
  bool changed = false;
  const std::vector<int> places = PlacesIn(improved, model.base());
  for (int index = static_cast<int>(places.size()) - 1; index >= 0; --index) {
    if (places[index] >= 0) continue;
    changed |= model.IsFree(index);
    model = model.Without(index);
  }
  for (int index = 0; index < static_cast<int>(model.base().effects.size()); ++index) {
    const model::Effect& effect = *model.base().effects[index].effect;
    if (!effect.apply || effect.random() || effect.parameters.empty() || model.IsFree(index)) continue;
    model.Free(index, true);
    changed = true;
  }
  if (!changed) return std::nullopt;
  return model;
}

uncertainty::Posterior PosteriorOf(const Workspace& workspace, const engine::Fit& open,
                                   const engine::Fit& searched, const Ladder& ladder) {
  uncertainty::Posterior posterior;
  posterior.model = ladder.improved;
  OpenValues values = OpenValuesOf(open.model, ladder.improved);
  const int n = static_cast<int>(values.values.size());
  posterior.covariance = Eigen::MatrixXd::Zero(n, n);
  if (n > 0) {
    const Eigen::MatrixXd covariance = WithPriors(open.covariance, open.model.parameters());
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j)
        posterior.covariance(i, j) = posterior.covariance(j, i) =
            values.gradients[i].dot(covariance * values.gradients[j]);
  }
  posterior.values = std::move(values.values);
  posterior.repeatability_s = ladder.noise_floor.sigma;
  if (!KnowsSurfaces(ladder.improved))
    std::tie(posterior.surface_rms_m, posterior.surface_length_m) = SurfaceLeft(workspace, searched);
  posterior.measured = MeasuredPlacesOf(*workspace.observations, ladder.prediction);
  return posterior;
}

}  // namespace touchstone::diagnosis::selection
