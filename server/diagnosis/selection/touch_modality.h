// Touches as one kind of measurement among several (engine/modality.h).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/engine/modality.h"
#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// The model as touches see it: without effects of photographs.
model::Model TouchPartOf(const model::Model& model);
// Its effects of photographs.
std::vector<model::EffectInstance> PhotographEffectsOf(const model::Model& model);

class TouchModality : public engine::Modality {
 public:
  // Searches for what the touches alone are explained by. `input.set` has poses, and enough touches for a verdict; the
  // effects of photographs that its model may have take no part. Errors: CANCELLED, and as MakeWorkspace.
  static absl::StatusOr<std::unique_ptr<TouchModality>> Make(const DiagnosisInput& input,
                                                             const DiagnosisContext& context);

  std::string name() const override { return "touches"; }
  const model::Model& given() const override { return *workspace_->input.model; }
  const std::vector<std::string>& objects() const override { return workspace_->searched->objects; }
  bool Sees(const model::Effect& effect) const override { return static_cast<bool>(effect.apply); }
  const engine::Experiment& experiment() const override { return workspace_->experiment; }
  const std::vector<engine::Candidate>& candidates() const override { return found_.search->candidates(); }
  const engine::Fit& alone() const override { return found_.fit; }
  const engine::TriedPValues& tried() const override { return found_.tried; }
  const engine::SelectedStep* FoundAlone(const std::string& effect) const override;
  // Every touch, those that the search left out marked, as it was at the end of the search.
  const Workspace& workspace() const { return *workspace_; }
  absl::StatusOr<engine::Quality> Compare(const model::Model& model) const override;

 private:
  TouchModality() = default;
  DiagnosisContext context_;
  std::unique_ptr<Workspace> workspace_;
  SelectionResult found_;
};

}  // namespace touchstone::diagnosis::selection
