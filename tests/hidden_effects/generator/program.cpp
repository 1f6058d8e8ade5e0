#include "tests/hidden_effects/generator/program.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <memory>
#include <set>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"
#include "server/model/model.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::hidden {
namespace {

constexpr char kOutside[] = "lead_screw";  // of UnlistedKinds
constexpr uint64_t kTriangles = 20'000;    // of a built-in object, as touchstone has them
constexpr double kOutsideMm = 1, kLeadMm = 6;

// Values as files have them, flat.
Hidden HiddenOf(const model::EffectInstance& instance, int fingers) {
  Hidden hidden{instance.effect->name, {}};
  size_t at = 0;
  for (const model::ParameterInfo& parameter : instance.effect->parameters)
    for (int entry = 0; entry < parameter.Count(fingers); ++entry)
      hidden.values.push_back(FromSi(parameter.unit, instance.values[at++]));
  return hidden;
}

absl::Status AddHidden(const model::Model& model, Scenario* scenario) {
  for (const model::EffectInstance& instance : model.effects) {
    const Hidden hidden = HiddenOf(instance, model.fingers);
    if (hidden.effect == "gaussian_noise") {
      scenario->sigma_us = hidden.values[0];
      continue;
    }
    if (instance.effect->formula || instance.effect->lookup || instance.effect->surface_map ||
        instance.per_object)
      return absl::UnimplementedError(absl::StrCat(hidden.effect, ": the oracle has no such effect"));
    scenario->hidden.push_back(hidden);
  }
  return absl::OkStatus();
}

absl::Status ReadObjects(const GeneratorRequest& request, const session::MeasurementSet& plan,
                         Scenario* scenario) {
  for (const std::string& object : plan.objects) {
    const auto file = request.meshes.find(object);
    if (file == request.meshes.end() && !geometry::NamedSupershape(object).ok())
      return absl::NotFoundError(absl::StrCat("object '", object, "': give --mesh ", object, "=FILE"));
    scenario->objects.push_back(std::make_shared<Solid>(object, file == request.meshes.end()
                                                                    ? SupershapeTriangles(object, kTriangles)
                                                                    : ReadTriangles(file->second)));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Set> GenerateForPlan(const GeneratorRequest& request) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::MeasurementSet plan, session::ReadMeasurementSet(request.plan));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(request.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model,
                              model::ParseModel(text, request.model, effects::Catalogue()));
  Scenario scenario;
  for (const std::string& words : request.hide) {
    std::vector<std::string> parts = absl::StrSplit(words, ' ');
    if (parts[0] == "outside") {
      scenario.unlisted.push_back({kOutside, kOutsideMm, kLeadMm});
      continue;
    }
    const std::string effect = parts[0];
    parts.erase(parts.begin());
    TOUCHSTONE_ASSIGN_OR_RETURN(model, model::AddEffect(model, effect, parts, effects::Catalogue()));
  }
  scenario.fingers = model.fingers;
  scenario.spacing_mm = FromSi(Unit::kMillimetre, model.spacing_m);
  scenario.sigma_us = 0;
  TOUCHSTONE_RETURN_IF_ERROR(AddHidden(model, &scenario));
  TOUCHSTONE_RETURN_IF_ERROR(ReadObjects(request, plan, &scenario));
  if (!plan.has_poses) return absl::InvalidArgumentError(absl::StrCat(request.plan, ": has no poses"));
  scenario.standoff_mm = FromSi(Unit::kMillimetre, plan.standoff_m[0]);
  std::vector<Command> commands(plan.size());
  for (int row = 0; row < plan.size(); ++row) {
    Command& command = commands[row];
    command.object = plan.object[row];
    command.target_mm = plan.target_m[row] * 1e3;
    command.approach = plan.approach[row];
    command.lateral = plan.lateral[row];
    command.standoff_mm = FromSi(Unit::kMillimetre, plan.standoff_m[row]);
    command.speed_mm_s = FromSi(Unit::kMillimetre, plan.speed_m_s[row]);
  }
  return GenerateFor(scenario, commands, request.seed);
}

}  // namespace touchstone::hidden
