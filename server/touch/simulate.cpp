#include "server/touch/simulate.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/status.h"
#include "server/touch/batch_row.h"

namespace touchstone::touch {
namespace {

absl::Status FormulaStatus(const effects::TouchBatch& batch) {
  return batch.formula_error.empty() ? absl::OkStatus() : absl::InvalidArgumentError(batch.formula_error);
}

}  // namespace

TouchSimulator::TouchSimulator(std::shared_ptr<const model::Model> model) : model_(std::move(model)) {
  for (const model::EffectInstance& instance : model_->effects) {
    const model::EffectNeeds& needs = instance.effect->needs;
    needs_previous_press_ |= needs.previous_press;
    needs_curvature_ |= needs.curvature;
    for (const std::string& name : needs.covariates)
      if (std::find(needed_covariates_.begin(), needed_covariates_.end(), name) == needed_covariates_.end())
        needed_covariates_.push_back(name);
  }
}

void TouchSimulator::Prepare(int size, effects::TouchBatch* batch) const {
  batch->Reset(size, model_->fingers);
  batch->spacing_m = model_->spacing_m;
}

void TouchSimulator::ApplyStage(model::Stage stage, bool before_cast, effects::TouchBatch* batch) const {
  for (const model::EffectInstance& instance : model_->effects) {
    if (instance.effect->stage != stage || instance.effect->before_cast != before_cast) continue;
    instance.effect->apply(instance.ValuesFor(batch->surface->name()), *batch);
  }
}

absl::Status TouchSimulator::RunToMotion(effects::TouchBatch* batch, TouchWorkspace* workspace) const {
  TOUCHSTONE_CHECK(batch->surface != nullptr);
  for (const std::string& name : needed_covariates_) {
    const auto found = batch->covariates.find(name);
    if (found == batch->covariates.end() || static_cast<int>(found->second.size()) != batch->size())
      return absl::InvalidArgumentError(absl::StrCat(
          "the model's formula uses ", name, ", which the touches do not carry: give covariates['", name,
          "'] with every touch (a column ", name, " in the plan), or use another model"));
  }
  ApplyStage(model::Stage::kPose, false, batch);
  ApplyStage(model::Stage::kContact, true, batch);
  PoseLines(*batch, workspace);
  FindContacts(needs_curvature_, batch, workspace);
  ApplyStage(model::Stage::kContact, false, batch);
  FindFirstFingers(batch);
  ApplyStage(model::Stage::kMotion, false, batch);
  TravelToTime(batch);
  return FormulaStatus(*batch);
}

absl::Status TouchSimulator::RunSensor(effects::TouchBatch* batch, TouchWorkspace* workspace) const {
  batch->reported_time_s = batch->contact_time_s;
  ApplyStage(model::Stage::kSensor, false, batch);
  ReportTimes(batch, workspace);
  return FormulaStatus(*batch);
}

absl::Status TouchSimulator::Run(effects::TouchBatch* batch, TouchWorkspace* workspace) const {
  TOUCHSTONE_RETURN_IF_ERROR(RunToMotion(batch, workspace));
  return RunSensor(batch, workspace);
}

bool Descriptor(const effects::TouchBatch& batch, int touch, double* descriptor_s) {
  return ForDescriptor(batch.reported_time_s.data() + touch, batch.size(), batch.fingers(),
                       [&](int finger, double relative_s) { descriptor_s[finger] = relative_s; });
}

}  // namespace touchstone::touch
