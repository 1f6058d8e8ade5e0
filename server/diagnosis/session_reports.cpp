#include "server/diagnosis/session_reports.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <chrono>
#include <set>

#include "server/base/status.h"
#include "server/diagnosis/answers/early_verdicts.h"
#include "server/diagnosis/answers/session_copies.h"
#include "server/diagnosis/answers/session_poses.h"
#include "server/diagnosis/answers/session_posterior.h"
#include "server/diagnosis/answers/session_rests.h"
#include "server/diagnosis/answers/uncertainty_reports.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/report/join.h"
#include "server/diagnosis/report/kinds/from_sessions.h"
#include "server/diagnosis/report/kinds/from_touches.h"
#include "server/diagnosis/report/words/rules.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/diagnosis/selection/touch_modality.h"
#include "server/diagnosis/touch_reports.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis {
namespace {

using engine::Verdict;

absl::Status CheckSessions(const std::vector<DiagnosisInput>& sessions) {
  for (const DiagnosisInput& input : sessions) {
    if (input.images != nullptr || input.set == nullptr)
      return absl::InvalidArgumentError(
          "several sessions are compared by their touches; give photographs alone, one set of them");
    if (!input.set->has_poses)
      return absl::InvalidArgumentError(
          absl::StrCat(input.set->origin,
                       ": has touches without poses, which several sessions cannot be compared by; "
                       "compare it by itself"));
    if (input.other_model != nullptr)
      return absl::InvalidArgumentError("several sessions take one model; two were given");
    if (input.set->fingers != sessions[0].set->fingers)
      return absl::InvalidArgumentError(absl::StrCat(
          input.set->origin, ": has times of ", input.set->fingers, " fingers, and ", sessions[0].set->origin,
          " of ", sessions[0].set->fingers, "; sessions of one rig were expected"));
  }
  return CheckCopies(sessions);
}

class SessionsReporter {
 public:
  SessionsReporter(const std::vector<DiagnosisInput>& sessions, const DiagnosisContext& context)
      : sessions_(sessions), context_(context) {
    diagnosis_.model_name = given().name;
    diagnosis_.model_hash = given().Hash();
    diagnosis_.sessions.emplace();
    diagnosis_.sessions->count = count();
  }

  absl::StatusOr<report::Diagnosis> Compare() {
    for (int s = 0; s < count(); ++s) {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          report::Diagnosis compared,
          CompareTouches(sessions_[s], Stretch(0.9 * s / count(), 0.9 * (s + 1) / count())));
      AddData(std::move(compared));
    }
    TOUCHSTONE_RETURN_IF_ERROR(CompareSamePoses());
    Summarize();
    return std::move(diagnosis_);
  }

  absl::StatusOr<report::Diagnosis> Diagnose() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool mistaken, FindMistakes());
    if (mistaken) return std::move(diagnosis_);
    TOUCHSTONE_RETURN_IF_ERROR(Search());
    if (modalities_.size() < 2) return TooLittle();
    std::vector<const engine::Modality*> taking_part;
    for (const auto& modality : modalities_) taking_part.push_back(modality.get());
    report::SetNothingMissing(engine::NothingMissingOf(taking_part), &diagnosis_);
    TOUCHSTONE_ASSIGN_OR_RETURN(diagnosis_.sessions->changes, FindChanges(taking_part));
    PutPhotographEffectsBack();
    for (int s = 0; s < count(); ++s) TOUCHSTONE_RETURN_IF_ERROR(DiagnoseOne(s));
    if (diagnosis_.verdict == Verdict::kCheckData) return MistakenAfterAll();
    AddSteps();
    TOUCHSTONE_RETURN_IF_ERROR(CompareSamePoses());
    AssessAll();
    TOUCHSTONE_RETURN_IF_ERROR(AddReproducibility());
    Summarize();
    return std::move(diagnosis_);
  }

 private:
  int count() const { return static_cast<int>(sessions_.size()); }
  const model::Model& given() const { return *sessions_[0].model; }
  const joint::SessionChanges& changes() const { return *diagnosis_.sessions->changes; }
  const std::vector<int>& taking_part() const { return diagnosis_.sessions->taking_part; }
  std::string Name(int session) const { return report::SessionName(diagnosis_.data, session); }
  // The place of a session among those that take part; -1: it does not.
  int PlaceOf(int session) const {
    const auto found = std::find(taking_part().begin(), taking_part().end(), session);
    return found == taking_part().end() ? -1 : static_cast<int>(found - taking_part().begin());
  }

  DiagnosisContext Stretch(double from, double to) const {
    DiagnosisContext part = context_;
    if (context_.progress)
      part.progress = [this, from, to](const std::string& stage, double done) {
        return context_.progress(stage, from + (to - from) * done);
      };
    return part;
  }

  void AddData(report::Diagnosis one) {
    diagnosis_.data.push_back(std::move(one.data[0]));
    for (std::string& warning : one.warnings)
      if (std::find(diagnosis_.warnings.begin(), diagnosis_.warnings.end(), warning) ==
          diagnosis_.warnings.end())
        diagnosis_.warnings.push_back(std::move(warning));
    diagnosis_.duration_s += one.duration_s;
  }

  // What each session says by itself; a mistake of any file ends all: no step is claimed beside it.
  absl::StatusOr<bool> FindMistakes() {
    bool any = false;
    for (int s = 0; s < count(); ++s) {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          report::Diagnosis one,
          DiagnoseTouches(sessions_[s], Stretch(0.3 * s / count(), 0.3 * (s + 1) / count())));
      any |= one.verdict == Verdict::kCheckData;
      alone_.push_back(std::move(one));
    }
    if (!any) return false;
    for (int s = 0; s < count(); ++s) {
      if (alone_[s].verdict == Verdict::kCheckData) {
        AddMistakes(alone_[s], s);
        AddData(std::move(alone_[s]));
        continue;
      }
      TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis one, CompareTouches(sessions_[s], Stretch(0.3, 0.9)));
      AddData(std::move(one));
    }
    SayMistakes();
    return true;
  }
  void AddMistakes(const report::Diagnosis& one, int session) {
    for (report::DataProblem problem : one.data_problems) {
      problem.data_index = session;
      diagnosis_.data_problems.push_back(std::move(problem));
    }
  }
  void SayMistakes() {
    diagnosis_.verdict = Verdict::kCheckData;
    std::vector<std::string> sentences;
    for (const report::DataProblem& problem : diagnosis_.data_problems)
      sentences.push_back(absl::StrCat(Name(problem.data_index), ": ", problem.words));
    sentences.push_back("Nothing is claimed of what changed between the sessions until that is mended.");
    diagnosis_.summary = absl::StrJoin(sentences, " ");
  }
  // One that shows only once the effects of all sessions are in place.
  report::Diagnosis MistakenAfterAll() {
    diagnosis_.sessions->changes.reset();
    report::SetNothingMissing(std::nullopt, &diagnosis_);
    for (report::DataReport& data : diagnosis_.data) data.final = data.initial;
    SayMistakes();
    return std::move(diagnosis_);
  }

  // What each session with enough touches is explained by alone.
  absl::Status Search() {
    for (int s = 0; s < count(); ++s) {
      if (IsTooLittle(s)) continue;
      DiagnosisInput touches = sessions_[s];
      touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(given()));
      TOUCHSTONE_ASSIGN_OR_RETURN(
          modalities_.emplace_back(),
          selection::TouchModality::Make(touches,
                                         Stretch(0.3 + 0.2 * s / count(), 0.3 + 0.2 * (s + 1) / count())));
      diagnosis_.sessions->taking_part.push_back(s);
      std::set<std::string>& claimed = claimed_.emplace_back();
      for (const report::Step& step : alone_[s].steps) claimed.insert(step.effect);
    }
    return absl::OkStatus();
  }
  bool IsTooLittle(int session) const { return alone_[session].verdict == Verdict::kTooLittleData; }

  absl::StatusOr<report::Diagnosis> TooLittle() {
    std::vector<std::string> names;
    for (int s = 0; s < count(); ++s) {
      if (IsTooLittle(s)) {
        AddData(std::move(alone_[s]));
        names.push_back(absl::StrCat(report::SessionName(diagnosis_.data, s), " needs ",
                                     diagnosis_.data[s].needed, " touches"));
        continue;
      }
      TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis one, CompareTouches(sessions_[s], Stretch(0.5, 0.9)));
      AddData(std::move(one));
    }
    diagnosis_.verdict = Verdict::kTooLittleData;
    diagnosis_.summary = absl::StrCat(
        "Two sessions with enough touches are needed to say what changed: ", absl::StrJoin(names, ", "), ".");
    return std::move(diagnosis_);
  }

  absl::StatusOr<joint::SessionChanges> FindChanges(
      const std::vector<const engine::Modality*>& sessions) const {
    const DiagnosisContext all = Stretch(0.5, 0.6);
    return joint::FindSessionChanges(sessions, claimed_, [&](double done) {
      return !all.progress || all.progress("fitting all sessions together", done);
    });
  }

  void PutPhotographEffectsBack() {
    const std::vector<model::EffectInstance> effects = selection::PhotographEffectsOf(given());
    joint::SessionChanges& found = *diagnosis_.sessions->changes;
    const auto put_back = [&](std::vector<model::Model>* models) {
      for (model::Model& model : *models)
        model.effects.insert(model.effects.end(), effects.begin(), effects.end());
    };
    put_back(&found.models);
    for (joint::SessionStep& step : found.steps) put_back(&step.models);
  }

  // A session under its own model: how wrong, where, and what is still missing.
  absl::Status DiagnoseOne(int s) {
    const double from = 0.6 + 0.35 * s / count(), to = 0.6 + 0.35 * (s + 1) / count();
    const int place = PlaceOf(s);
    TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis compared,
                                CompareTouches(sessions_[s], Stretch(from, from)));
    if (place < 0) {
      TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis little, DiagnoseTouches(sessions_[s], Stretch(from, to)));
      AddData(std::move(little));
      diagnosis_.warnings.push_back(absl::StrCat(Name(s),
                                                 " takes no part in what is said of all sessions: it needs ",
                                                 diagnosis_.data[s].needed, " touches"));
      return absl::OkStatus();
    }
    DiagnosisInput input = sessions_[s];
    const model::Model own = changes().models[place];
    input.model = std::make_shared<const model::Model>(own);
    input.initial_model = std::make_shared<const model::Model>(selection::TouchPartOf(given()));
    for (const model::EffectInstance& instance : own.effects)
      if (instance.effect->apply && !instance.effect->random())
        input.settled.push_back(engine::NameOf(*instance.effect));
    TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis one, DiagnoseTouches(input, Stretch(from, to)));
    diagnosis_.verdict =
        report::WorseOf(diagnosis_.verdict, rests_.Add(one, s, &diagnosis_.sessions->changes->models[place]));
    // Of the model that the report ends with, as far as the last session's touches know it.
    if (s == taking_part().back() && AsksForNoiseAlone(one)) {
      diagnosis_.posterior = one.posterior;
      last_session_ = s;
    }
    AddMistakes(one, s);
    report::DataReport& data = one.data[0];
    const double ratio = changes().heldout[place].ratio;
    data.final = data.initial;
    if (data.final && changes().moved()) data.final->heldout_rmse = ratio * data.final->rmse;
    data.initial = compared.data[0].initial;
    data.after_step.clear();
    if (changes().moved()) data.candidates.clear();  // beside the effects that are in place
    for (const joint::SessionStep& step : changes().steps) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const engine::Quality quality,
                                  modalities_[place]->Compare(step.models[place]));
      data.after_step.push_back(report::InMicroseconds(quality));
      data.after_step.back().heldout_rmse = ratio * data.after_step.back().rmse;
    }
    if (data.noise_floor && data.initial)
      data.reducible_share = report::ReducibleShare(*data.noise_floor, data.initial->rmse);
    AddData(std::move(one));
    return absl::OkStatus();
  }

  void AddSteps() {
    for (const joint::SessionStep& found : changes().steps) {
      report::Step step = report::StepOfSessions(found, changes(), Name(taking_part().back()));
      engine::AddConfounded(step, &diagnosis_.confounded);
      diagnosis_.steps.push_back(std::move(step));
    }
    for (report::Step step : rests_.noise_steps()) {
      step.model = changes().models.back();
      diagnosis_.steps.push_back(std::move(step));
      // Noise moves no error.
      for (const int s : taking_part()) {
        report::DataReport& data = diagnosis_.data[s];
        if (data.final) data.after_step.push_back(*data.final);
      }
    }
    diagnosis_.refitted = changes().refitted;
    if (!changes().moved() && !rests_.changed_noise()) return;
    diagnosis_.improved_model = changes().models.back();
    diagnosis_.improved_model->name = given().name.empty() ? "" : given().name + "_better";
  }

  absl::Status CompareSamePoses() {
    std::vector<SessionOnPoses> all;
    for (int s = 0; s < count(); ++s) {
      SessionOnPoses& one = all.emplace_back();
      one.input = sessions_[s];
      const auto part = [](const model::Model& model) {
        return std::make_shared<const model::Model>(selection::TouchPartOf(model));
      };
      one.input.model = part(given());
      const int place = diagnosis_.sessions->changes ? PlaceOf(s) : -1;
      one.own = place >= 0 ? part(changes().models[place]) : one.input.model;
      one.noise_floor = diagnosis_.data[s].noise_floor;
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(diagnosis_.sessions->same_poses, CompareSharedPoses(all, Stretch(0.95, 1)));
    return absl::OkStatus();
  }

  // Budgets on the last session's touches, with what differs between sessions.
  absl::Status AddReproducibility() {
    if (!diagnosis_.posterior) return absl::OkStatus();
    uncertainty::Posterior& posterior = *diagnosis_.posterior;
    AddBetweenSessions(changes().effects, &posterior);
    if (diagnosis_.improved_model) posterior.model.name = diagnosis_.improved_model->name;
    TOUCHSTONE_ASSIGN_OR_RETURN(const report::Diagnosis budgets,
                                UncertaintyOfPlan(sessions_[last_session_], posterior, Stretch(1, 1)));
    diagnosis_.uncertainty = budgets.uncertainty;
    AddMisfitOfTouches(diagnosis_.data[last_session_], &diagnosis_.uncertainty);
    WarnOfBounds(posterior, &diagnosis_.warnings);
    return absl::OkStatus();
  }

  // What all sessions together say.
  void AssessAll() {
    if (!changes().steps.empty())
      diagnosis_.verdict = report::WorseOf(diagnosis_.verdict, Verdict::kMissingEffects);
    else if (changes().moved())
      diagnosis_.verdict = report::WorseOf(diagnosis_.verdict, Verdict::kWrongValues);
    for (const report::Sessions::Pair& pair : diagnosis_.sessions->same_poses)
      if (pair.left.poses > 0 && pair.left.p < report::kWordsRules.same_poses_p)
        diagnosis_.verdict = report::WorseOf(diagnosis_.verdict, Verdict::kUnexplained);
  }

  void Summarize() {
    diagnosis_.sessions->words =
        report::SessionsInWords(*diagnosis_.sessions, diagnosis_.data, rests_.unexplained());
    diagnosis_.summary = report::SummarizeSessions(diagnosis_, rests_.asked_by_one());
  }

  const std::vector<DiagnosisInput>& sessions_;
  const DiagnosisContext& context_;
  report::Diagnosis diagnosis_;
  std::vector<report::Diagnosis> alone_;                               // of every session by itself
  std::vector<std::unique_ptr<selection::TouchModality>> modalities_;  // of those that take part
  joint::ClaimedEffects claimed_;                                      // likewise
  SessionRests rests_;
  int last_session_ = 0;  // whose touches the posterior is of
};

}  // namespace

absl::StatusOr<report::Diagnosis> CompareSessions(const std::vector<DiagnosisInput>& sessions,
                                                  const DiagnosisContext& context) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckSessions(sessions));
  return SessionsReporter(sessions, context).Compare();
}

absl::StatusOr<report::Diagnosis> DiagnoseSessions(const std::vector<DiagnosisInput>& sessions,
                                                   const DiagnosisContext& context) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckSessions(sessions));
  return SessionsReporter(sessions, context).Diagnose();
}

}  // namespace touchstone::diagnosis
