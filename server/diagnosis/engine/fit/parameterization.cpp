#include "server/diagnosis/engine/fit/parameterization.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/numbers/normal.h"
#include "server/model/parameter_values.h"

namespace touchstone::diagnosis::engine {
namespace {

// Directions in which the entries of one parameter may move: the unit vectors, or, where the entries sum to
// zero, an orthonormal basis of that plane (Helmert's).
std::vector<std::vector<double>> Directions(const model::ParameterInfo& parameter, int count) {
  std::vector<std::vector<double>> directions;
  if (!parameter.sum_zero) {
    for (int j = 0; j < count; ++j) {
      directions.emplace_back(count, 0.0);
      directions.back()[j] = 1;
    }
    return directions;
  }
  for (int row = 1; row < count; ++row) {
    directions.emplace_back(count, 0.0);
    const double norm = std::sqrt(static_cast<double>(row) * (row + 1));
    for (int j = 0; j < row; ++j) directions.back()[j] = -1 / norm;
    directions.back()[row] = row / norm;
  }
  return directions;
}

}  // namespace

Parameterization::Parameterization(model::Model base, std::vector<std::string> objects)
    : base_(std::move(base)), objects_(std::move(objects)) {
  for (model::EffectInstance& instance : base_.effects)
    if (instance.per_object)
      for (const std::string& object : objects_) instance.object_values.emplace(object, instance.values);
}

bool Parameterization::IsFree(int effect) const {
  return std::any_of(parameters_.begin(), parameters_.end(),
                     [&](const FreeParameter& c) { return c.effect == effect; });
}

void Parameterization::Free(int index, bool refit) {
  if (IsFree(index)) return;
  const model::EffectInstance& instance = base_.effects[index];
  const model::Effect& effect = *instance.effect;
  const int fingers = base_.fingers;
  for (int p = 0; p < static_cast<int>(effect.parameters.size()); ++p) {
    const model::ParameterInfo& parameter = effect.parameters[p];
    const double si = SiFactor(parameter.unit);
    const int count = parameter.Count(fingers), offset = model::ValueOffset(effect, p, fingers);
    for (const std::vector<double>& direction : Directions(parameter, count)) {
      FreeParameter c;
      c.effect = index;
      c.parameter = p;
      c.shape = shapes_++;
      c.weights.assign(instance.values.size(), 0.0);
      for (int j = 0; j < count; ++j) c.weights[offset + j] = direction[j];
      c.scale = parameter.typical * si;
      c.lower = (refit ? parameter.lower : std::max(parameter.lower, parameter.least_claimed)) * si;
      c.upper = parameter.upper * si;
      c.neutral = parameter.sum_zero ? 0 : parameter.neutral * si;
      if (parameter.sum_zero) c.lower = std::min(c.lower, -c.upper);
      c.usual_lower = parameter.usual_lower * si;
      c.usual_upper = parameter.usual_upper * si;
      if (parameter.reciprocal) {
        c.reciprocal = true;
        c.neutral = 0;
        c.scale = 1 / (parameter.typical * si);
        c.lower = 1 / (parameter.upper * si);
        c.upper = 1 / std::max(parameter.lower * si, 1e-3);
      }
      const auto start = [&](const std::vector<double>& values) {
        double sum = 0;
        for (size_t j = 0; j < values.size(); ++j) sum += c.weights[j] * values[j];
        return c.reciprocal ? 1 / sum : sum;
      };
      if (!instance.per_object) {
        if (refit) c.neutral = start(instance.values);
        parameters_.push_back(c);
        continue;
      }
      for (const std::string& object : objects_) {
        if (instance.object_values.count(object) == 0) continue;
        c.object = object;
        if (refit) c.neutral = start(instance.object_values.at(object));
        parameters_.push_back(c);
      }
    }
  }
}

void Parameterization::Add(std::shared_ptr<const model::Effect> effect, bool per_object) {
  model::EffectInstance instance;
  instance.values = effect->NeutralValues(base_.fingers);
  instance.per_object = per_object || effect->always_per_object;
  instance.effect = std::move(effect);
  if (instance.per_object)
    for (const std::string& object : objects_) instance.object_values[object] = instance.values;
  base_.effects.push_back(std::move(instance));
  Free(static_cast<int>(base_.effects.size()) - 1, false);
}

void Parameterization::AddOn(std::shared_ptr<const model::Effect> effect, const std::string& object) {
  model::EffectInstance instance;
  instance.values = effect->NeutralValues(base_.fingers);
  instance.per_object = true;
  instance.object_values[object] = instance.values;
  instance.effect = std::move(effect);
  base_.effects.push_back(std::move(instance));
  const size_t first = parameters_.size();
  Free(static_cast<int>(base_.effects.size()) - 1, false);
  if (parameters_.size() > first)
    parameters_[first].log_prior = -std::log(std::max<double>(1, static_cast<double>(objects_.size())));
}

std::string Parameterization::OnlyObject(int index) const {
  const model::EffectInstance& instance = base_.effects[index];
  const bool one = instance.per_object && instance.object_values.size() == 1 && objects_.size() > 1;
  return one ? instance.object_values.begin()->first : "";
}

void Parameterization::Hold(int index) {
  parameters_.erase(std::remove_if(parameters_.begin(), parameters_.end(),
                                   [&](const FreeParameter& c) { return c.effect == index; }),
                    parameters_.end());
}

Parameterization Parameterization::Without(int index) const {
  Parameterization other = *this;
  other.base_.effects.erase(other.base_.effects.begin() + index);
  other.parameters_.clear();
  for (FreeParameter c : parameters_) {
    if (c.effect == index) continue;
    if (c.effect > index) --c.effect;
    other.parameters_.push_back(std::move(c));
  }
  return other;
}

Eigen::VectorXd Parameterization::Start() const {
  Eigen::VectorXd point(size());
  for (int i = 0; i < size(); ++i) {
    const FreeParameter& c = parameters_[i];
    const model::EffectInstance& instance = base_.effects[c.effect];
    const std::vector<double>& values =
        c.object.empty() ? instance.values : instance.object_values.at(c.object);
    double sum = 0;  // the weights of one parameter's coordinates are orthonormal
    for (size_t j = 0; j < values.size(); ++j) sum += c.weights[j] * values[j];
    point[i] = c.reciprocal ? 1 / sum : sum;
  }
  return point;
}

Eigen::VectorXd Parameterization::Clip(Eigen::VectorXd point) const {
  for (int i = 0; i < size(); ++i)
    point[i] = std::clamp(point[i], parameters_[i].lower, parameters_[i].upper);
  return point;
}

model::Model Parameterization::At(const Eigen::VectorXd& point) const {
  model::Model model = base_;
  // Free values are the sum of their coordinates.
  const auto values_of = [&](const FreeParameter& c) -> std::vector<double>& {
    model::EffectInstance& instance = model.effects[c.effect];
    return c.object.empty() ? instance.values : instance.object_values.at(c.object);
  };
  for (const FreeParameter& c : parameters_)
    for (size_t j = 0; j < c.weights.size(); ++j)
      if (c.weights[j] != 0) values_of(c)[j] = 0;
  for (int i = 0; i < size(); ++i) {
    const FreeParameter& c = parameters_[i];
    const double value = c.reciprocal ? 1 / std::max(point[i], 1e-12) : point[i];
    std::vector<double>& values = values_of(c);
    for (size_t j = 0; j < c.weights.size(); ++j) values[j] += c.weights[j] * value;
  }
  for (const FreeParameter& c : parameters_) {
    const model::Effect& effect = *model.effects[c.effect].effect;
    const model::ParameterInfo& parameter = effect.parameters[c.parameter];
    const int offset = model::ValueOffset(effect, c.parameter, model.fingers);
    const double si = SiFactor(parameter.unit);
    for (int j = 0; j < parameter.Count(model.fingers); ++j) {
      double& value = values_of(c)[offset + j];
      value = std::clamp(value, parameter.lower * si, parameter.upper * si);
    }
  }
  return model;
}

void Parameterization::MoveTo(const Eigen::VectorXd& point) {
  base_ = At(point);
}

std::vector<ParameterEstimate> Parameterization::Describe(int index, const Eigen::VectorXd& point,
                                                          const Eigen::MatrixXd& covariance) const {
  std::vector<ParameterEstimate> described;
  const model::Model model = At(point);
  const model::EffectInstance& instance = model.effects[index];
  const model::Effect& effect = *instance.effect;
  std::vector<std::string> objects = {""};
  if (instance.per_object) objects = objects_;
  if (const std::string only = OnlyObject(index); !only.empty()) objects = {only};
  for (const std::string& object : objects) {
    const std::vector<double>& values = object.empty() ? instance.values : instance.object_values.at(object);
    for (int p = 0; p < static_cast<int>(effect.parameters.size()); ++p) {
      const model::ParameterInfo& parameter = effect.parameters[p];
      const int offset = model::ValueOffset(effect, p, model.fingers);
      for (int j = 0; j < parameter.Count(model.fingers); ++j) {
        // The entry's variance through the coordinates that move it.
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size());
        for (int i = 0; i < size(); ++i) {
          const FreeParameter& c = parameters_[i];
          if (c.effect != index || c.object != object) continue;
          gradient[i] = c.weights[offset + j];
          if (c.reciprocal) gradient[i] *= 1 / (point[i] * point[i]);
        }
        ParameterEstimate value;
        value.name = parameter.name;
        value.unit = std::string(UnitSymbol(parameter.unit));
        value.entry = EntryName(parameter, j, model.fingers);
        value.object = object;
        const double si = SiFactor(parameter.unit);
        value.value = values[offset + j] / si;
        const double variance = covariance.size() > 0 ? gradient.dot(covariance * gradient) : 0;
        value.std_error = std::sqrt(std::max(variance, 0.0)) / si;
        value.lower = std::max(value.value - kNormalQuantile975 * value.std_error, parameter.lower);
        value.upper = std::min(value.value + kNormalQuantile975 * value.std_error, parameter.upper);
        described.push_back(std::move(value));
      }
    }
  }
  return described;
}

}  // namespace touchstone::diagnosis::engine
