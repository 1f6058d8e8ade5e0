#include "server/diagnosis/joint_reports.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/diagnosis/answers/early_verdicts.h"
#include "server/diagnosis/checks/data_problems.h"
#include "server/diagnosis/images/photograph_modality.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/joint/shared_effects.h"
#include "server/diagnosis/photograph_reports.h"
#include "server/diagnosis/progress_gate.h"
#include "server/diagnosis/report/join.h"
#include "server/diagnosis/report/kinds/from_photographs.h"
#include "server/diagnosis/selection/touch_modality.h"
#include "server/diagnosis/touch_reports.h"

namespace touchstone::diagnosis {
namespace {

// Where the parts of a joint diagnosis stand in the progress of the whole. Of 93 touches and 12 pictures with a hidden object_pose
// the common search takes two thirds of the time.
constexpr double kChecked = 0.03, kTouchesFitted = 0.08, kPicturesFitted = 0.2, kSharedFound = 0.8,
                 kTouchesDiagnosed = 0.88, kPicturesDiagnosed = 0.97;

// A stretch of the progress of the whole.
DiagnosisContext Stretch(const DiagnosisContext& context, double from, double to) {
  DiagnosisContext part = context;
  if (context.progress)
    part.progress = [&context, from, to](const std::string& stage, double done) {
      return context.progress(stage, from + (to - from) * done);
    };
  return part;
}

// Each kind's question.
DiagnosisInput TouchesOf(const DiagnosisInput& input) {
  DiagnosisInput touches = input;
  touches.images = nullptr;
  return touches;
}

DiagnosisInput PhotographsOf(const DiagnosisInput& input) {
  DiagnosisInput photographs = input;
  photographs.set = nullptr;
  return photographs;
}

class JointDiagnoser {
 public:
  // `gate` is what the context's progress goes through.
  JointDiagnoser(const DiagnosisInput& input, const DiagnosisContext& context, ProgressGate* gate)
      : input_(input),
        context_(context),
        gate_(*gate),
        touches_(TouchesOf(input)),
        photographs_(PhotographsOf(input)) {
    touches_.model = std::make_shared<const model::Model>(selection::TouchPartOf(*input.model));
  }

  absl::StatusOr<report::Diagnosis> Run() {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<engine::DataProblem> problems,
                                checks::FindDataProblems(touches_, Stretch(context_, 0, kChecked)));
    if (problems.empty()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(problems, FindRoundAtAnotherSpeed());
    }
    parts_.model_name = input_.model->name;
    parts_.model_hash = input_.model->Hash();
    TOUCHSTONE_RETURN_IF_ERROR(Measure(*input_.model, &parts_.initial));
    parts_.shared.in_place = *input_.model;
    if (!problems.empty()) {
      // A mistake of the touches' file: the photographs beside it are compared.
      parts_.touches = CheckDataReport(touches_, Stretch(context_, 0.5, 0.6), problems);
      TOUCHSTONE_RETURN_IF_ERROR(ComparePictures());
      return report::Join(std::move(parts_));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool enough, IsEnoughForBoth());
    if (enough) {
      TOUCHSTONE_ASSIGN_OR_RETURN(parts_.shared, FindShared());
    }
    if (!parts_.shared.conflicts.empty()) {
      // Each kind contradicts the other: how wrong and where, and nothing else.
      TOUCHSTONE_ASSIGN_OR_RETURN(
          parts_.touches, CompareTouches(touches_, Stretch(context_, kSharedFound, kTouchesDiagnosed)));
      TOUCHSTONE_RETURN_IF_ERROR(ComparePictures());
      return report::Join(std::move(parts_));
    }
    for (const joint::SharedStep& step : parts_.shared.steps)
      TOUCHSTONE_RETURN_IF_ERROR(Measure(step.model, &parts_.shared_quality.emplace_back()));
    TOUCHSTONE_RETURN_IF_ERROR(DiagnoseEach());
    std::optional<model::Model> improved = Improved();
    CompleteSuggestions();
    report::Diagnosis diagnosis = report::Join(std::move(parts_));
    diagnosis.improved_model = std::move(improved);
    return diagnosis;
  }

 private:
  // One that the touches alone are diagnosed with: an effect that acts in one round looks like a speed by itself.
  absl::StatusOr<std::vector<engine::DataProblem>> FindRoundAtAnotherSpeed() const {
    std::vector<engine::DataProblem> problems = checks::FindRoundAtAnotherSpeed(touches_, context_.pool);
    if (problems.empty()) return problems;
    TOUCHSTONE_ASSIGN_OR_RETURN(const report::Diagnosis alone,
                                DiagnoseTouches(touches_, Stretch(context_, kChecked, kTouchesFitted)));
    if (alone.verdict != engine::Verdict::kCheckData) problems.clear();
    return problems;
  }

  // Errors of a model as comparisons find them.
  absl::Status Measure(const model::Model& model, report::JointQuality* quality) const {
    DiagnosisContext quiet;
    quiet.pool = context_.pool;
    quiet.progress = [this](const std::string&, double) { return gate_.Enter("comparing", 0); };
    DiagnosisInput touches = touches_;
    touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(model));
    TOUCHSTONE_ASSIGN_OR_RETURN(const report::Diagnosis compared, CompareTouches(touches, quiet));
    if (compared.data[0].initial) quality->touches = *compared.data[0].initial;
    DiagnosisInput photographs = photographs_;
    photographs.model = std::make_shared<const model::Model>(model);
    TOUCHSTONE_ASSIGN_OR_RETURN(const images::PhotographDiagnosis found,
                                images::ComparePhotographs(photographs, quiet));
    const report::Diagnosis pictures = report::FromPhotographs(found, *input_.images);
    if (pictures.data[0].initial) quality->photographs = *pictures.data[0].initial;
    return absl::OkStatus();
  }

  absl::StatusOr<joint::SharedEffects> FindShared() {
    // What a kind tells while both are searched says nothing of where the search is.
    bool searching = false;
    const auto until_searching = [&](double from, double to) {
      DiagnosisContext part = Stretch(context_, from, to);
      part.progress = [this, &searching, own = part.progress](const std::string& stage, double done) {
        return searching ? gate_.Continue() : own(stage, done);
      };
      return part;
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto touches, selection::TouchModality::Make(
                                                        touches_, until_searching(kChecked, kTouchesFitted)));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const auto photographs,
        images::PhotographModality::Make(photographs_, until_searching(kTouchesFitted, kPicturesFitted)));
    parts_.nothing_missing = engine::NothingMissingOf({touches.get(), photographs.get()});
    searching = true;
    const DiagnosisContext both = Stretch(context_, kPicturesFitted, kSharedFound);
    return joint::FindSharedEffects({touches.get(), photographs.get()}, *input_.model, both.progress);
  }

  absl::StatusOr<bool> IsEnoughForBoth() const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto workspace,
                                selection::MakeWorkspace(touches_, Stretch(context_, 0, 0)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const images::Photographs photographs,
                                images::MakePhotographs(photographs_, context_.pool));
    return TouchesNeeded(*workspace->observations) == 0 && photographs.poses >= images::kImageRules.min_poses;
  }

  absl::Status ComparePictures() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        parts_.photographs,
        ComparePhotographSet(photographs_, Stretch(context_, kTouchesDiagnosed, kPicturesDiagnosed)));
    return absl::OkStatus();
  }

  absl::Status DiagnoseEach() {
    DiagnosisInput touches = touches_;
    touches.settled = parts_.shared.settled;
    touches.initial_model = touches_.model;
    touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(parts_.shared.in_place));
    TOUCHSTONE_ASSIGN_OR_RETURN(parts_.touches,
                                DiagnoseTouches(touches, Stretch(context_, kSharedFound, kTouchesDiagnosed)));
    DiagnosisInput photographs = photographs_;
    photographs.settled = parts_.shared.settled;
    photographs.model = std::make_shared<const model::Model>(parts_.shared.in_place);
    images::Expectation expectation;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        images::PhotographDiagnosis pictures,
        images::DiagnosePhotographs(photographs, Stretch(context_, kTouchesDiagnosed, kPicturesDiagnosed),
                                    &expectation));
    if (!parts_.shared.steps.empty()) {
      // Described is what the given model had left, before anything was put in place.
      if (expectation.after.empty()) expectation.after = std::move(expectation.before);
      TOUCHSTONE_ASSIGN_OR_RETURN(
          expectation.before,
          images::ExpectPhotographs(expectation.photographs, *input_.model, true, context_.pool));
    }
    parts_.photographs = DescribedPhotographs(photographs_, context_, expectation, &pictures);
    return absl::OkStatus();
  }

  // One model that holds what both kinds show; none: nothing changed.
  std::optional<model::Model> Improved() const {
    const std::optional<model::Model>&touches = parts_.touches.improved_model,
          &pictures = parts_.photographs.improved_model;
    if (parts_.shared.steps.empty() && !touches && !pictures) return std::nullopt;
    return Both(touches ? *touches : parts_.shared.in_place, pictures ? *pictures : parts_.shared.in_place);
  }

  // The effects of touches of the one model, those of photographs of the other.
  model::Model Both(const model::Model& touches, const model::Model& photographs) const {
    model::Model both = selection::TouchPartOf(touches);
    const std::vector<model::EffectInstance> of_pictures = selection::PhotographEffectsOf(photographs);
    both.effects.insert(both.effects.end(), of_pictures.begin(), of_pictures.end());
    both.name = input_.model->name.empty() ? "" : input_.model->name + "_better";
    return both;
  }

  // A suggestion for the rest of one kind stands in the model beside what the other kind has found.
  void CompleteSuggestions() {
    const auto complete = [this](report::Diagnosis* own, const report::Diagnosis& other, bool of_touches) {
      const model::Model& beside = other.improved_model ? *other.improved_model : parts_.shared.in_place;
      for (report::DataReport& data : own->data)
        if (data.unexplained && data.unexplained->model_with) {
          model::Model& with = *data.unexplained->model_with;
          with = of_touches ? Both(with, beside) : Both(beside, with);
        }
    };
    complete(&parts_.touches, parts_.photographs, true);
    complete(&parts_.photographs, parts_.touches, false);
  }

  const DiagnosisInput& input_;
  const DiagnosisContext& context_;
  ProgressGate& gate_;
  DiagnosisInput touches_, photographs_;  // each kind's question, about the given model
  report::JointParts parts_;
};

}  // namespace

absl::StatusOr<report::Diagnosis> CompareJointSet(const DiagnosisInput& input,
                                                  const DiagnosisContext& context) {
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis photographs,
                              ComparePhotographSet(PhotographsOf(input), Stretch(context, 0, 0.5)));
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis touches,
                              CompareTouches(TouchesOf(input), Stretch(context, 0.5, 1)));
  return report::SideBySide(std::move(touches), std::move(photographs));
}

absl::StatusOr<report::Diagnosis> DiagnoseJointSet(const DiagnosisInput& input,
                                                   const DiagnosisContext& outer) {
  ProgressGate gate(outer);
  DiagnosisContext context = outer;
  context.progress = [&gate](const std::string& stage, double done) { return gate.Enter(stage, done); };
  const DiagnosisInput photographs = PhotographsOf(input);
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<report::Diagnosis> data_errors,
                              PhotographDataErrors(photographs, Stretch(context, 0, kChecked)));
  if (data_errors) {
    TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis touches, CompareTouches(TouchesOf(input), context));
    return report::SideBySide(std::move(touches), *std::move(data_errors));
  }
  if (!input.set->has_poses)
    return absl::InvalidArgumentError(
        absl::StrCat(input.set->origin,
                     ": touches without poses cannot be diagnosed together with photographs; take "
                     "touches.csv out of the folder and diagnose it by itself"));
  return JointDiagnoser(input, context, &gate).Run();
}

}  // namespace touchstone::diagnosis
