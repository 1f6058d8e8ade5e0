#include "server/uncertainty/posterior_message.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"
#include "server/model/parameter_values.h"
#include "server/model/value_names.h"

namespace touchstone::uncertainty {
namespace {

constexpr double kSameValue = 1e-9;  // relative: numbers of the same text

double FileValue(Unit unit, double value_si) {
  return std::stod(FileNumber(unit, value_si));
}

void AddVector(const Eigen::Vector3d& v, double factor, google::protobuf::RepeatedField<float>* to) {
  for (int axis = 0; axis < 3; ++axis) to->Add(static_cast<float>(v[axis] * factor));
}

// Which value of the model an entry of the message names.
absl::StatusOr<OpenValue> ValueFromMessage(const v1::PosteriorValue& message, const std::string& where,
                                           const model::Model& model) {
  if (message.effect_index() >= model.effects.size())
    return absl::InvalidArgumentError(absl::StrCat(where, ".effect_index = ", message.effect_index(),
                                                   ": the model has ", model.effects.size(), " effects"));
  OpenValue value;
  value.effect = static_cast<int>(message.effect_index());
  const model::Effect& effect = *model.effects[value.effect].effect;
  if (model::NameOf(effect) != message.effect())
    return absl::InvalidArgumentError(absl::StrCat(where, ".effect: '", message.effect(), "', but effect ",
                                                   value.effect, " of the model is '", model::NameOf(effect),
                                                   "'"));
  const absl::StatusOr<int> parameter = model::FindParameter(effect, message.parameter());
  if (!parameter.ok())
    return absl::InvalidArgumentError(absl::StrCat(where, ".parameter: ", parameter.status().message()));
  value.parameter = *parameter;
  const model::ParameterInfo& info = effect.parameters[value.parameter];
  value.entry = -1;
  for (int entry = 0; entry < info.Count(model.fingers); ++entry)
    if (model::EntryName(info, entry, model.fingers) == message.finger()) value.entry = entry;
  if (value.entry < 0)
    return absl::InvalidArgumentError(absl::StrCat(where, ".finger: ", effect.name, ".", info.name,
                                                   " has no entry '", message.finger(), "'"));
  value.object = message.object();
  if (message.has_between_sessions())
    value.between_sessions = message.between_sessions() * SiFactor(info.unit);
  return value;
}

absl::StatusOr<MeasuredPlaces> PlacesFromMessage(const v1::MeasuredPlaces& message) {
  if (message.contact_mm_size() != message.normal_size() || message.contact_mm_size() % 3 != 0)
    return absl::InvalidArgumentError(absl::StrCat("posterior.measured of '", message.object(),
                                                   "': ", message.contact_mm_size(),
                                                   " coordinates of contacts and ", message.normal_size(),
                                                   " of normals; as many were expected, three each"));
  MeasuredPlaces places;
  for (int k = 0; k + 2 < message.contact_mm_size(); k += 3) {
    places.contact_m.push_back(
        Eigen::Vector3d(message.contact_mm(k), message.contact_mm(k + 1), message.contact_mm(k + 2)) *
        kMetresPerMillimetre);
    places.normal.emplace_back(message.normal(k), message.normal(k + 1), message.normal(k + 2));
  }
  return places;
}

}  // namespace

v1::ModelPosterior ToMessage(const Posterior& posterior) {
  v1::ModelPosterior message;
  message.set_model_yaml(model::FormatModel(posterior.model));
  message.set_model_hash(posterior.model.Hash());
  const auto factor = [&posterior](size_t i) { return SiFactor(posterior.ParameterOf(i).unit); };
  for (size_t i = 0; i < posterior.values.size(); ++i) {
    const OpenValue& value = posterior.values[i];
    const model::ParameterInfo& parameter = posterior.ParameterOf(i);
    v1::PosteriorValue* to = message.add_values();
    to->set_effect_index(static_cast<uint32_t>(value.effect));
    to->set_effect(model::NameOf(posterior.EffectOf(i)));
    to->set_parameter(parameter.name);
    to->set_finger(model::EntryName(parameter, value.entry, posterior.model.fingers));
    to->set_object(value.object);
    to->set_value(FileValue(parameter.unit, posterior.ValueOf(posterior.model, i)));
    to->set_std_error(posterior.StdError(i) / factor(i));
    to->set_unit(std::string(UnitSymbol(parameter.unit)));
    if (value.between_sessions) to->set_between_sessions(*value.between_sessions / factor(i));
    for (size_t j = 0; j <= i; ++j)
      message.add_covariance(posterior.covariance(static_cast<int>(i), static_cast<int>(j)) /
                             (factor(i) * factor(j)));
  }
  message.set_repeatability(Microseconds(posterior.repeatability_s));
  message.set_unit("us");
  message.set_surface_rms_mm(posterior.surface_rms_m * kMillimetresPerMetre);
  message.set_surface_length_mm(posterior.surface_length_m * kMillimetresPerMetre);
  for (const auto& [object, places] : posterior.measured) {
    v1::MeasuredPlaces* to = message.add_measured();
    to->set_object(object);
    for (const Eigen::Vector3d& contact_m : places.contact_m)
      AddVector(contact_m, kMillimetresPerMetre, to->mutable_contact_mm());
    for (const Eigen::Vector3d& normal : places.normal) AddVector(normal, 1, to->mutable_normal());
  }
  return message;
}

absl::StatusOr<Posterior> FromMessage(const v1::ModelPosterior& message) {
  Posterior posterior;
  if (message.model_yaml().empty())
    return absl::InvalidArgumentError(
        "posterior.model_yaml is empty: it was expected as a report of `touchstone diagnose` has it");
  TOUCHSTONE_ASSIGN_OR_RETURN(
      posterior.model, model::ParseModel(message.model_yaml(), "posterior.model_yaml", effects::Catalogue()));
  if (posterior.model.Hash() != message.model_hash())
    return absl::InvalidArgumentError(
        absl::StrCat("posterior.model_hash is ", message.model_hash().substr(0, 8),
                     ", but the hash of posterior.model_yaml is ", posterior.model.Hash().substr(0, 8),
                     ": one of the two was changed; take the report as it was written"));
  if (!message.unit().empty() && message.unit() != "us")
    return absl::InvalidArgumentError(absl::StrCat("posterior.unit: '", message.unit(),
                                                   "'; \"us\" was expected: only touches have a posterior"));
  const int n = message.values_size();
  if (message.covariance_size() != n * (n + 1) / 2)
    return absl::InvalidArgumentError(absl::StrCat("posterior.covariance has ", message.covariance_size(),
                                                   " numbers; ", n, " values have ", n * (n + 1) / 2));
  for (int i = 0; i < n; ++i) {
    const std::string where = absl::StrCat("posterior.values[", i, "]");
    TOUCHSTONE_ASSIGN_OR_RETURN(OpenValue value, ValueFromMessage(message.values(i), where, posterior.model));
    posterior.values.push_back(std::move(value));
    const double in_model = FileValue(posterior.ParameterOf(i).unit, posterior.ValueOf(posterior.model, i));
    if (!(std::abs(in_model - message.values(i).value()) <= kSameValue * std::abs(in_model)))
      return absl::InvalidArgumentError(
          absl::StrCat(where, ".value = ", message.values(i).value(), ", but the model has ", in_model));
  }
  posterior.covariance.resize(n, n);
  for (int i = 0, k = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j, ++k)
      posterior.covariance(i, j) = posterior.covariance(j, i) = message.covariance(k) *
                                                                SiFactor(posterior.ParameterOf(i).unit) *
                                                                SiFactor(posterior.ParameterOf(j).unit);
  posterior.repeatability_s = message.repeatability() * kSecondsPerMicrosecond;
  posterior.surface_rms_m = message.surface_rms_mm() * kMetresPerMillimetre;
  posterior.surface_length_m = message.surface_length_mm() * kMetresPerMillimetre;
  for (const v1::MeasuredPlaces& places : message.measured()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(posterior.measured[places.object()], PlacesFromMessage(places));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckPosterior(posterior));
  return posterior;
}

v1::UncertaintyBudget ToMessage(const Budget& budget) {
  v1::UncertaintyBudget message;
  message.set_object(budget.object);
  message.set_touches(static_cast<uint32_t>(budget.touches));
  message.set_parameters(budget.parameters);
  message.set_surface(budget.surface);
  message.set_repeatability(budget.repeatability);
  if (budget.reproducibility) message.set_reproducibility(*budget.reproducibility);
  message.set_combined(budget.combined);
  message.set_largest(budget.largest);
  for (const Contribution& contribution : budget.contributions) {
    v1::UncertaintyBudget::Contribution* to = message.add_contributions();
    to->set_name(contribution.name);
    to->set_std_uncertainty(contribution.std_uncertainty);
    to->set_share(contribution.share);
  }
  message.set_beyond_measured(static_cast<uint32_t>(budget.beyond_measured));
  return message;
}

}  // namespace touchstone::uncertainty
