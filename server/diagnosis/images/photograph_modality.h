// Photographs as one kind of measurement among several (engine/modality.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/engine/modality.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {

class PhotographModality : public engine::Modality {
 public:
  // Searches for what the photographs alone are explained by: `input.images`, of enough poses for a verdict. Errors:
  // CANCELLED, and as MakePhotographs.
  static absl::StatusOr<std::unique_ptr<PhotographModality>> Make(const DiagnosisInput& input,
                                                                  const DiagnosisContext& context);

  std::string name() const override { return "photographs"; }
  const model::Model& given() const override { return *input_.model; }
  const std::vector<std::string>& objects() const override { return photographs_.objects; }
  bool Sees(const model::Effect& effect) const override { return ShowsInPhotographs(effect); }
  const engine::Experiment& experiment() const override { return *found_.fine.experiment; }
  const std::vector<engine::Candidate>& candidates() const override {
    return found_.fine.search->candidates();
  }
  const engine::Fit& alone() const override { return found_.fit; }
  const engine::TriedPValues& tried() const override { return found_.tried; }
  // Of every photograph, contours trusted as what the fit leaves shows.
  absl::StatusOr<engine::FinalRows> RowsNear(const engine::Fit& fit) const override;
  Eigen::MatrixXd CovarianceOf(const engine::Experiment& experiment, const engine::Fit& fit) const override;
  absl::StatusOr<engine::Quality> Compare(const model::Model& model) const override;
  absl::StatusOr<engine::HeldOutError> HeldOut(const engine::Fit& searched,
                                               const engine::Fit& final) const override;

 private:
  PhotographModality() = default;
  DiagnosisInput input_;
  DiagnosisContext context_;
  Photographs photographs_;
  PhotoSelection found_;
};

}  // namespace touchstone::diagnosis::images
