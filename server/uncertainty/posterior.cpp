#include "server/uncertainty/posterior.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/model/parameter_values.h"

namespace touchstone::uncertainty {
namespace {

constexpr double kZeroPivot = 1e-10;    // of a value's variance: what is left of it is rounding
constexpr double kNotSymmetric = 1e-6;  // of two standard errors
constexpr int kMaxValues = 2000;

// L of a semidefinite matrix: columns of what others determine are zero. In the order of the values, so that
// the bits are the same everywhere.
Eigen::MatrixXd SemidefiniteFactor(const Eigen::MatrixXd& matrix) {
  const int n = static_cast<int>(matrix.rows());
  Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(n, n);
  for (int j = 0; j < n; ++j) {
    double pivot = matrix(j, j);
    for (int k = 0; k < j; ++k) pivot -= lower(j, k) * lower(j, k);
    if (!(pivot > kZeroPivot * matrix(j, j))) continue;
    lower(j, j) = std::sqrt(pivot);
    for (int i = j + 1; i < n; ++i) {
      double sum = matrix(i, j);
      for (int k = 0; k < j; ++k) sum -= lower(i, k) * lower(j, k);
      lower(i, j) = sum / lower(j, j);
    }
  }
  return lower;
}

}  // namespace

double Posterior::ValueOf(const model::Model& of, size_t value) const {
  const OpenValue& v = values[value];
  const model::EffectInstance& instance = of.effects[v.effect];
  const int offset = model::ValueOffset(*instance.effect, v.parameter, of.fingers) + v.entry;
  return v.object.empty() ? instance.values[offset] : instance.ValuesFor(v.object)[offset];
}

void Posterior::SetValue(size_t value, double to, model::Model* of) const {
  const OpenValue& v = values[value];
  model::EffectInstance& instance = of->effects[v.effect];
  std::vector<double>& own = v.object.empty()
                                 ? instance.values
                                 : instance.object_values.emplace(v.object, instance.values).first->second;
  own[model::ValueOffset(*instance.effect, v.parameter, of->fingers) + v.entry] = to;
}

const model::ParameterInfo& Posterior::ParameterOf(size_t value) const {
  return EffectOf(value).parameters[values[value].parameter];
}

double Posterior::StdError(size_t value) const {
  const int i = static_cast<int>(value);
  return std::sqrt(std::max(covariance(i, i), 0.0));
}

double Posterior::Lower(size_t value) const {
  const model::ParameterInfo& parameter = ParameterOf(value);
  const double lower = parameter.sum_zero ? std::min(parameter.lower, -parameter.upper) : parameter.lower;
  return lower * SiFactor(parameter.unit);
}

double Posterior::Upper(size_t value) const {
  const model::ParameterInfo& parameter = ParameterOf(value);
  return parameter.upper * SiFactor(parameter.unit);
}

absl::Status CheckPosterior(const Posterior& posterior) {
  const int n = static_cast<int>(posterior.values.size());
  if (n > kMaxValues)
    return absl::InvalidArgumentError(
        absl::StrCat("posterior.values has ", n, " entries: at most ", kMaxValues));
  if (posterior.covariance.rows() != n || posterior.covariance.cols() != n)
    return absl::InvalidArgumentError(absl::StrCat("posterior.covariance is of ", posterior.covariance.rows(),
                                                   " values, but the posterior has ", n));
  for (int i = 0; i < n; ++i) {
    const OpenValue& v = posterior.values[i];
    const std::string where = absl::StrCat("posterior.values[", i, "]");
    if (v.effect < 0 || v.effect >= static_cast<int>(posterior.model.effects.size()))
      return absl::InvalidArgumentError(absl::StrCat(where, ".effect_index = ", v.effect, ": the model has ",
                                                     posterior.model.effects.size(), " effects"));
    const model::EffectInstance& instance = posterior.model.effects[v.effect];
    const model::Effect& effect = *instance.effect;
    if (v.parameter < 0 || v.parameter >= static_cast<int>(effect.parameters.size()) || v.entry < 0 ||
        v.entry >= effect.parameters[v.parameter].Count(posterior.model.fingers))
      return absl::InvalidArgumentError(absl::StrCat(where, ": ", effect.name, " has no such parameter"));
    if (!v.object.empty() && !instance.per_object)
      return absl::InvalidArgumentError(absl::StrCat(
          where, ": ", effect.name, " has one value for all objects, not one of '", v.object, "'"));
    for (int j = 0; j < n; ++j)
      if (!std::isfinite(posterior.covariance(i, j)))
        return absl::InvalidArgumentError(
            absl::StrCat("posterior.covariance of values ", i, " and ", j, " is no number"));
    if (posterior.covariance(i, i) < 0)
      return absl::InvalidArgumentError(absl::StrCat(where, ": its variance is negative"));
    for (int j = 0; j < i; ++j)
      if (std::abs(posterior.covariance(i, j)) >
          (1 + kNotSymmetric) * posterior.StdError(i) * posterior.StdError(j))
        return absl::InvalidArgumentError(absl::StrCat("posterior.covariance of values ", i, " and ", j,
                                                       ": their correlation lies beyond 1"));
  }
  for (const double number : {posterior.repeatability_s, posterior.surface_rms_m, posterior.surface_length_m})
    if (!std::isfinite(number) || number < 0)
      return absl::InvalidArgumentError(
          absl::StrCat("posterior: ", number, " is no standard deviation or length; 0 or more was expected"));
  if (posterior.surface_rms_m > 0 && !(posterior.surface_length_m > 0))
    return absl::InvalidArgumentError(
        "posterior.surface_length_mm: a length above 0 was expected beside surface_rms_mm");
  return absl::OkStatus();
}

ModelDraws::ModelDraws(std::shared_ptr<const Posterior> posterior, uint64_t seed)
    : posterior_(std::move(posterior)), seed_(seed) {
  const int n = static_cast<int>(posterior_->values.size());
  means_.resize(n);
  Eigen::VectorXd slope = Eigen::VectorXd::Ones(n);  // of what is normal over the value
  for (int i = 0; i < n; ++i) {
    const double value = posterior_->ValueOf(posterior_->model, i);
    const bool reciprocal = posterior_->ParameterOf(i).reciprocal;
    means_[i] = reciprocal ? 1 / value : value;
    if (reciprocal) slope[i] = -1 / (value * value);
  }
  factor_ = SemidefiniteFactor(slope.asDiagonal() * posterior_->covariance * slope.asDiagonal());
}

absl::StatusOr<ModelDraws::Draw> ModelDraws::Of(uint64_t index) const {
  const size_t n = posterior_->values.size();
  std::string beyond;
  for (int attempt = 0; attempt < kMaxDraws; ++attempt) {
    RandomStream random(seed_, RandomDomain::kModelDraw, index, attempt);
    std::vector<double> deviates(n);
    for (double& deviate : deviates) deviate = random.Normal();
    model::Model model = posterior_->model;
    Draw draw;
    bool within = true;
    for (size_t i = 0; i < n && within; ++i) {
      const int row = static_cast<int>(i);
      double value = means_[row];
      for (int k = 0; k <= row; ++k) value += factor_(row, k) * deviates[static_cast<size_t>(k)];
      const model::ParameterInfo& parameter = posterior_->ParameterOf(i);
      if (parameter.reciprocal) value = 1 / value;
      within = value >= posterior_->Lower(i) && value <= posterior_->Upper(i);
      // A value that nothing is open about stays, wherever it lies.
      within |= factor_.row(row).isZero(0);
      if (!within) beyond = absl::StrCat(posterior_->EffectOf(i).name, ".", parameter.name);
      posterior_->SetValue(i, value, &model);
      draw.values.push_back(value / SiFactor(parameter.unit));
    }
    if (!within) continue;
    draw.model = std::make_shared<const model::Model>(std::move(model));
    return draw;
  }
  return absl::FailedPreconditionError(
      absl::StrCat("sample ", index, ": none of ", kMaxDraws,
                   " draws of the model's posterior lies within the bounds of every "
                   "value; the last left those of ",
                   beyond, ": measure more, or leave draw_models out"));
}

}  // namespace touchstone::uncertainty
