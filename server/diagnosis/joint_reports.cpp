#include "server/diagnosis/joint_reports.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/checks/data_problems.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/early_verdicts.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/images/photograph_modality.h"
#include "server/diagnosis/joint/shared_effects.h"
#include "server/diagnosis/report/photograph_summary.h"
#include "server/diagnosis/report/write_joint_report.h"
#include "server/diagnosis/residuals/describe_photographs.h"
#include "server/diagnosis/selection/touch_modality.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis {
namespace {

// The model with the effects of photographs alone.
model::Model PhotographPartOf(const model::Model& model) {
  model::Model part = model;
  part.effects.clear();
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->of_photos()) part.effects.push_back(instance);
  return part;
}

// A stretch of the progress of the whole.
DiagnosisContext Stretch(const DiagnosisContext& context, double from, double to) {
  DiagnosisContext part = context;
  if (context.progress)
    part.progress = [&context, from, to](const std::string& stage, double done) {
      return context.progress(stage, from + (to - from) * done);
    };
  return part;
}

class JointDiagnoser {
 public:
  JointDiagnoser(const DiagnosisInput& input, const DiagnosisContext& context)
      : input_(input), context_(context), touches_(input), photographs_(input) {
    touches_.images = nullptr;
    touches_.model = std::make_shared<const model::Model>(selection::TouchPartOf(*input.model));
    photographs_.set = nullptr;
  }

  absl::StatusOr<v1::Report> Run() {
    if (!input_.set->has_poses)
      return absl::InvalidArgumentError(
          absl::StrCat(input_.set->origin,
                       ": touches without poses cannot be diagnosed together with photographs; take "
                       "touches.csv out of the folder and "
                       "diagnose it by itself"));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<engine::DataProblem> problems,
                                checks::FindDataProblems(touches_, Stretch(context_, 0, 0.05)));
    d_.model_name = input_.model->name;
    d_.model_hash = input_.model->Hash();
    TOUCHSTONE_RETURN_IF_ERROR(Measure(*input_.model, &d_.initial));
    if (!problems.empty()) return CheckTouches(problems);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool enough, IsEnoughForBoth());
    d_.shared.in_place = *input_.model;
    d_.shared.heldout.resize(2);
    if (enough) {
      TOUCHSTONE_ASSIGN_OR_RETURN(d_.shared, FindShared());
    }
    if (!d_.shared.conflicts.empty()) return Contradict();
    for (const joint::SharedStep& step : d_.shared.steps) {
      report::JointQuality quality;
      TOUCHSTONE_RETURN_IF_ERROR(Measure(step.model, &quality));
      quality.touches.heldout_rmse = d_.shared.heldout[0].Of(quality.touches.heldout_rmse);
      quality.photographs.heldout_rmse = d_.shared.heldout[1].Of(quality.photographs.heldout_rmse);
      d_.shared_quality.push_back(quality);
    }
    TOUCHSTONE_RETURN_IF_ERROR(DiagnoseEach());
    Improve();
    return report::ToJointReport(d_, *input_.images);
  }

 private:
  // Errors of a model as comparisons find them.
  absl::Status Measure(const model::Model& model, report::JointQuality* quality) const {
    DiagnosisContext quiet;
    quiet.pool = context_.pool;
    quiet.progress = [this](const std::string&, double) {
      return !context_.progress || context_.progress("comparing", 0);
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(quality->touches, selection::CompareTouches(touches_, model, quiet));
    DiagnosisInput photographs = photographs_;
    photographs.model = std::make_shared<const model::Model>(model);
    TOUCHSTONE_ASSIGN_OR_RETURN(const images::PhotographDiagnosis pictures,
                                images::ComparePhotographs(photographs, quiet));
    if (pictures.initial) quality->photographs = *pictures.initial;
    return absl::OkStatus();
  }

  absl::StatusOr<joint::SharedEffects> FindShared() const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto touches,
                                selection::TouchModality::Make(touches_, Stretch(context_, 0.05, 0.15)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto photographs, images::PhotographModality::Make(
                                                            photographs_, Stretch(context_, 0.15, 0.25)));
    const DiagnosisContext both = Stretch(context_, 0.25, 0.5);
    return joint::FindSharedEffects({touches.get(), photographs.get()}, *input_.model, [&](double done) {
      return !both.progress || both.progress("fitting both together", done);
    });
  }

  absl::StatusOr<bool> IsEnoughForBoth() const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto workspace,
                                selection::MakeWorkspace(touches_, Stretch(context_, 0, 0)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const images::Photographs photographs,
                                images::MakePhotographs(photographs_, context_.pool));
    return TouchesNeeded(*workspace->observations) == 0 && photographs.poses >= images::kMinPoses;
  }

  absl::Status DescribePictures(const images::Expectation& expectation) {
    residuals::DescribePhotographs(expectation, input_.seed, context_.pool, &d_.photographs);
    for (std::string& warning : report::PhotographWarnings(d_.photographs, *input_.images))
      d_.photographs.warnings.push_back(std::move(warning));
    return absl::OkStatus();
  }

  absl::Status ComparePictures() {
    images::Expectation expectation;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        d_.photographs, images::ComparePhotographs(photographs_, Stretch(context_, 0.6, 0.9), &expectation));
    return DescribePictures(expectation);
  }

  // A mistake of the touches' file: the photographs beside it are compared.
  absl::StatusOr<v1::Report> CheckTouches(const std::vector<engine::DataProblem>& problems) {
    d_.touches = CheckDataReport(touches_, Stretch(context_, 0.5, 0.6), problems);
    TOUCHSTONE_RETURN_IF_ERROR(ComparePictures());
    return report::ToJointReport(d_, *input_.images);
  }

  // Each kind contradicts the other: how wrong and where, and nothing else.
  absl::StatusOr<v1::Report> Contradict() {
    TOUCHSTONE_ASSIGN_OR_RETURN(d_.touches, Compare(touches_, Stretch(context_, 0.5, 0.6)));
    TOUCHSTONE_RETURN_IF_ERROR(ComparePictures());
    return report::ToJointReport(d_, *input_.images);
  }

  absl::Status DiagnoseEach() {
    DiagnosisInput touches = touches_;
    touches.settled = d_.shared.settled;
    touches.initial_model = touches_.model;
    touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(d_.shared.in_place));
    TOUCHSTONE_ASSIGN_OR_RETURN(d_.touches, Diagnose(touches, Stretch(context_, 0.5, 0.7)));
    DiagnosisInput photographs = photographs_;
    photographs.settled = d_.shared.settled;
    photographs.model = std::make_shared<const model::Model>(d_.shared.in_place);
    images::Expectation expectation;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        d_.photographs, images::DiagnosePhotographs(photographs, Stretch(context_, 0.7, 0.95), &expectation));
    if (!d_.shared.steps.empty()) {
      // Described is what the given model had left, before anything was put in place.
      if (expectation.after.empty()) expectation.after = std::move(expectation.before);
      TOUCHSTONE_ASSIGN_OR_RETURN(
          expectation.before,
          images::ExpectPhotographs(expectation.photographs, *input_.model, true, context_.pool));
    }
    return DescribePictures(expectation);
  }

  // One model that holds what both kinds show.
  void Improve() {
    const auto improved = [this](const std::string& yaml) -> model::Model {
      if (yaml.empty()) return d_.shared.in_place;
      return model::ParseModel(yaml, "the improved model", effects::Catalogue()).value_or(d_.shared.in_place);
    };
    if (d_.shared.steps.empty() && d_.touches.improved_model_yaml.empty() &&
        d_.photographs.improved_model_yaml.empty())
      return;
    model::Model both = selection::TouchPartOf(improved(d_.touches.improved_model_yaml));
    const model::Model pictures = PhotographPartOf(improved(d_.photographs.improved_model_yaml));
    both.effects.insert(both.effects.end(), pictures.effects.begin(), pictures.effects.end());
    both.name = input_.model->name.empty() ? "" : input_.model->name + "_better";
    d_.improved_model_yaml = model::FormatModel(both);
    d_.improved_model_hash = both.Hash();
  }

  const DiagnosisInput& input_;
  const DiagnosisContext& context_;
  DiagnosisInput touches_, photographs_;  // each kind's question, about the given model
  report::JointDiagnosis d_;
};

}  // namespace

absl::StatusOr<v1::Report> DiagnoseJointSet(const DiagnosisInput& input, const DiagnosisContext& context) {
  return JointDiagnoser(input, context).Run();
}

}  // namespace touchstone::diagnosis
