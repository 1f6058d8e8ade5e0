#include "server/diagnosis/images/photograph_modality.h"

#include "server/base/status.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/images/photo_quality.h"

namespace touchstone::diagnosis::images {

absl::StatusOr<std::unique_ptr<PhotographModality>> PhotographModality::Make(
    const DiagnosisInput& input, const DiagnosisContext& context) {
  std::unique_ptr<PhotographModality> made(new PhotographModality());
  made->input_ = input;
  made->input_.set = nullptr;
  made->context_ = context;
  TOUCHSTONE_ASSIGN_OR_RETURN(made->photographs_, MakePhotographs(made->input_, context.pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(made->found_,
                              SelectPhotoExplanation(made->input_, made->photographs_, context));
  return made;
}

absl::StatusOr<engine::FinalRows> PhotographModality::RowsNear(const engine::Fit& fit) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(PolishRows made, MakePolishRows(*found_.photographs, fit, context_));
  auto rows = std::make_shared<PolishRows>(std::move(made));
  engine::FinalRows final = {rows->experiment, rows};
  return final;
}

Eigen::MatrixXd PhotographModality::CovarianceOf(const engine::Experiment& experiment,
                                                 const engine::Fit& fit) const {
  return CovarianceBetweenBlocks(experiment, fit);
}

absl::StatusOr<engine::Quality> PhotographModality::Compare(const model::Model& model) const {
  DiagnosisInput input = input_;
  input.model = std::make_shared<const model::Model>(model);
  TOUCHSTONE_ASSIGN_OR_RETURN(const PhotographDiagnosis compared, ComparePhotographs(input, context_));
  return compared.initial ? *compared.initial : engine::Quality();
}

absl::StatusOr<engine::HeldOutError> PhotographModality::HeldOut(const engine::Fit& searched,
                                                                 const engine::Fit& final) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(photographs_, final.model.base(), false, context_.pool));
  const engine::NoiseFloor floor = NoiseFloorOfPhotographs(photographs_, expected, context_.pool);
  engine::HeldOutError error;
  error.excess_squares = HeldOutExcess(found_.fine, searched, photographs_, floor.sigma);
  return error;
}

}  // namespace touchstone::diagnosis::images
