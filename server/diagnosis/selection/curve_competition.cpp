#include "server/diagnosis/selection/curve_competition.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "server/base/status.h"
#include "server/diagnosis/selection/curves/curve_effect.h"
#include "server/diagnosis/selection/memory_competition.h"
#include "server/diagnosis/selection/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// A fit of named effects, and a curve over it.
struct WithCurve {
  engine::Fit fit;
  NamelessCurve curve;
  double total() const { return fit.log_evidence + curve.gain_nats; }
};

class Competition {
 public:
  Competition(const Workspace& workspace, SelectionResult* result)
      : workspace_(workspace), result_(*result) {}

  // From the first row to the first that settles how the rest is explained.
  absl::Status Run() {
    for (const Stage& stage : kStages) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool settled, (this->*stage.settles)());
      if (settled) break;
    }
    return absl::OkStatus();
  }

 private:
  struct Stage {
    const char* explanation;
    const char* why_here;
    absl::StatusOr<bool> (Competition::*settles)();
  };
  static const std::vector<Stage> kStages;

  // Curves over what stays of the effects; the best of them.
  absl::StatusOr<bool> FindCurves() {
    named_ = result_.without_formula;
    TOUCHSTONE_ASSIGN_OR_RETURN(result_.curves, CurvesOver(named_, ""));
    TOUCHSTONE_RETURN_IF_ERROR(ReplaceOvertaken(&named_));
    int tried = 0;
    for (const NamelessCurve& curve : result_.curves) {
      if (tried == kSelectionRules.max_curves_tried || !IsSignificant(curve)) break;
      WithCurve with{named_, curve};
      TOUCHSTONE_RETURN_IF_ERROR(DropSuperfluous(&with));
      if (!best_ || best_->total() < with.total()) best_ = std::move(with);
      ++tried;
    }
    return false;
  }

  absl::StatusOr<bool> IsMemoryWithoutCurve() {
    if (best_) return false;
    TOUCHSTONE_RETURN_IF_ERROR(LookForMemory(workspace_, named_, &result_));
    return true;
  }

  // The formula stays; a curve of its covariate is given beside it.
  absl::StatusOr<bool> IsFormula() {
    if (result_.formula < 0 || !FormulaSaysTheSame(*best_)) return false;
    for (const NamelessCurve& curve : result_.curves)
      if (curve.covariate == result_.term.covariate) result_.curve = curve;
    return true;
  }

  absl::StatusOr<bool> IsMemoryInPlaceOfCourse() {
    if (!best_->curve.of_time) return false;
    return TakeNoiseWithMemory(workspace_, best_->fit, best_->curve.gain_nats, &result_);
  }

  absl::StatusOr<std::vector<NamelessCurve>> CurvesOver(const engine::Fit& fit,
                                                        const std::string& only) const {
    if (workspace_.experiment.cancelled && workspace_.experiment.cancelled())
      return absl::CancelledError("the diagnosis was cancelled");
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                                workspace_.searched_predictor->Run(fit.model.base(), true, true));
    return ScoreCurves(workspace_.experiment, *workspace_.rows, fit, details, only);
  }

  // An offset that a part of the touches has, in the place of constants and drifts of each finger.
  absl::StatusOr<bool> IsPartialOffset() {
    if (result_.formula >= 0) return false;
    engine::Parameterization rest = result_.fit.model;
    for (int index = static_cast<int>(rest.base().effects.size()) - 1; index >= result_.initial_effects;
         --index)
      if (IsPerFinger(*rest.base().effects[index].effect)) rest = rest.Without(index);
    engine::Fit fit = result_.fit;
    if (rest.base().effects.size() < fit.model.base().effects.size()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(fit, engine::FitModel(workspace_.experiment, std::move(rest)));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.searched_predictor->Run(fit.model.base(), false, false));
    const touches::Observations& o = *workspace_.searched;
    result_.partial = FindPartialOffset(o, touches::Residuals(o, prediction));
    if (!result_.partial) return false;
    result_.fit = result_.without_formula = std::move(fit);
    return true;
  }

  // A curve of time (of the previous press, for effects of that) in the place of named effects: of all together, then
  // of each. A constant per finger may be the mean of a course, a drift its trend.
  absl::Status ReplaceOvertaken(engine::Fit* named) {
    std::vector<int> steps;
    for (int index = result_.initial_effects; index < static_cast<int>(named->model.base().effects.size());
         ++index)
      steps.push_back(index);
    if (steps.size() > 1) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool replaced, Overtake(steps, named));
      if (replaced) return absl::OkStatus();
    }
    for (auto index = steps.rbegin(); index != steps.rend(); ++index)
      TOUCHSTONE_RETURN_IF_ERROR(Overtake({*index}, named).status());
    return absl::OkStatus();
  }

  static bool IsPerFinger(const model::Effect& effect) {
    return effect.parameters.size() == 1 && effect.parameters[0].arity == model::Arity::kPerFinger;
  }

  static double OneFingerNats(const model::Effect& effect, const NamelessCurve& curve) {
    if (!IsPerFinger(effect)) return -INFINITY;
    return effect.needs.session_time ? curve.one_finger_line_nats : curve.one_finger_constant_nats;
  }

  // The mean and trend of correlated noise look like a constant and a drift of each finger.
  absl::Status NoteCorrelatedNoise(int index, const engine::Fit& named, const engine::Fit& without) {
    const model::Effect& effect = *named.model.base().effects[index].effect;
    if (!IsPerFinger(effect) || named.log_evidence - without.log_evidence > kSelectionRules.beyond_correlated)
      return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<NoiseMemory> with, MemoryOf(workspace_, named));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<NoiseMemory> alone, MemoryOf(workspace_, without));
    if (!with || !alone) return absl::OkStatus();
    const double own = std::max(with->white_log_likelihood, with->log_likelihood - with->complexity_nats) -
                       0.5 * (workspace_.searched->fingers - 1) * with->complexity_nats;
    const double ahead_nats = alone->log_likelihood - alone->complexity_nats - own;
    NoteRival(engine::NameOf(effect),
              {ahead_nats, "Correlated noise of the fingers would say nearly the same."}, &result_);
    return absl::OkStatus();
  }

  static std::string RivalInWords(const NamelessCurve& curve) {
    return absl::StrCat("A course in time would say nearly the same: ",
                        curve.words.empty() ? absl::StrCat("a curve of ", curve.covariate) : curve.words,
                        ".");
  }

  // Whether the effects are worth more with a curve beside them than a curve in their place is, whose evidence is
  // `without_nats`. The mean and trend of a course are constants and drifts of fingers.
  bool StandsBeside(const std::vector<int>& steps, const engine::Fit& named,
                    const std::vector<NamelessCurve>& beside, double without_nats) const {
    if (beside.empty()) return false;
    const bool per_finger = std::any_of(steps.begin(), steps.end(), [&](int index) {
      return IsPerFinger(*named.model.base().effects[index].effect);
    });
    const double with_nats = named.log_evidence + std::max(0.0, beside[0].gain_nats);
    return with_nats - without_nats >
           (per_finger ? kSelectionRules.beyond_correlated.value() : kSelectionRules.beside_curve.value());
  }

  // Takes the effects out where a curve in their place is ahead of them; else notes by how much it is behind.
  absl::StatusOr<bool> Overtake(const std::vector<int>& steps, engine::Fit* named) {
    engine::Parameterization rest = named->model;
    std::string covariate = workspace_.input.set->has_session_time ? "session_time_s" : "touch";
    std::vector<std::string> names;
    for (auto index = steps.rbegin(); index != steps.rend(); ++index) {
      const model::Effect& effect = *named->model.base().effects[*index].effect;
      if (steps.size() == 1 && effect.needs.previous_press) covariate = "previous_press_mm";
      names.push_back(engine::NameOf(effect));
      rest = rest.Without(*index);
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit without,
                                engine::FitModel(workspace_.experiment, std::move(rest)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<NamelessCurve> curves, CurvesOver(without, covariate));
    if (curves.empty()) return false;
    // An effect of one finger may say as much as a course of one finger does, in as few values.
    double own = named->log_evidence;
    if (steps.size() == 1)
      own = std::max(own, without.log_evidence +
                              OneFingerNats(*named->model.base().effects[steps[0]].effect, curves[0]));
    const double behind = without.log_evidence - own;
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<NamelessCurve> beside, CurvesOver(*named, covariate));
    const bool stands = StandsBeside(steps, *named, beside, without.log_evidence + curves[0].gain_nats);
    // What a curve says beside the effects as well is no rival of theirs.
    const double any_beside = stands && !beside.empty() ? std::max(0.0, beside[0].any_gain_nats) : 0;
    for (const std::string& name : names)
      NoteRival(name, {behind + curves[0].any_gain_nats - any_beside, RivalInWords(curves[0])}, &result_);
    if (steps.size() == 1) TOUCHSTONE_RETURN_IF_ERROR(NoteCorrelatedNoise(steps[0], *named, without));
    if (stands || !IsSignificant(curves[0]) || behind + curves[0].gain_nats < kSelectionRules.overtaken)
      return false;
    *named = std::move(without);
    TOUCHSTONE_ASSIGN_OR_RETURN(result_.curves, CurvesOver(*named, ""));
    return true;
  }

  // Effects that the curve makes superfluous leave one by one, the most superfluous first.
  absl::Status DropSuperfluous(WithCurve* with) const {
    for (;;) {
      WithCurve best = *with;
      bool dropped = false;
      for (int index = static_cast<int>(with->fit.model.base().effects.size()) - 1;
           index >= result_.initial_effects; --index) {
        WithCurve trial;
        TOUCHSTONE_ASSIGN_OR_RETURN(trial.fit,
                                    engine::FitModel(workspace_.experiment, with->fit.model.Without(index)));
        TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<NamelessCurve> curves,
                                    CurvesOver(trial.fit, with->curve.covariate));
        if (curves.empty()) continue;
        trial.curve = curves[0];
        if (trial.total() < (dropped ? best.total() : with->total() - kSelectionRules.beside_curve)) continue;
        best = std::move(trial);
        dropped = true;
      }
      if (!dropped) return absl::OkStatus();
      *with = std::move(best);
    }
  }

  // In fewer words, and without named effects that the curve does without.
  bool FormulaSaysTheSame(const WithCurve& with) const {
    const auto named = [&](const engine::Fit& fit) {
      return static_cast<double>(fit.model.base().effects.size()) - result_.initial_effects;
    };
    const double dropped = named(result_.without_formula) - named(with.fit);
    return result_.fit.log_evidence >
           with.total() - kSelectionRules.formula_behind + kSelectionRules.dropped * dropped;
  }

  // The curve becomes an effect of the model, where its covariate is one that models know.
  absl::StatusOr<bool> IsCurve() {
    const WithCurve& with = *best_;
    TOUCHSTONE_ASSIGN_OR_RETURN(result_.curves, CurvesOver(with.fit, ""));
    result_.curve = with.curve;
    if (with.curve.covariate == "touch") {
      // Models know session times and not rows: without such times there is nothing to add.
      result_.fit = result_.without_formula = with.fit;
      result_.formula = -1;
      return true;
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto effect, MakeCurveEffect(with.curve));
    engine::Parameterization start = with.fit.model;
    start.Add(effect, false);
    TOUCHSTONE_ASSIGN_OR_RETURN(result_.fit, engine::FitModel(workspace_.experiment, std::move(start)));
    result_.formula = static_cast<int>(result_.fit.model.base().effects.size()) - 1;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        result_.without_formula,
        engine::FitModel(workspace_.experiment, result_.fit.model.Without(result_.formula)));
    result_.term = FormulaTerm();
    result_.term.covariate = with.curve.covariate;
    return true;
  }

  const Workspace& workspace_;
  SelectionResult& result_;
  engine::Fit named_;              // without a formula, and without effects that a curve took the place of
  std::optional<WithCurve> best_;  // none: no curve is significant
};

const std::vector<Competition::Stage> Competition::kStages = {
    {"an offset of a part of the touches",
     "It is one value where constants and drifts of fingers are several.", &Competition::IsPartialOffset},
    {"curves", "What follows is compared with the best of them.", &Competition::FindCurves},
    {"noise with memory, without a curve", "Repeats may share a course that no curve follows.",
     &Competition::IsMemoryWithoutCurve},
    {"a formula", "It says the same in fewer words.", &Competition::IsFormula},
    {"noise with memory, in the place of a course",
     "A curve only traces what another session would not repeat.", &Competition::IsMemoryInPlaceOfCourse},
    {"a curve", "Nothing shorter says the same.", &Competition::IsCurve}};

}  // namespace

absl::Status CompeteWithCurves(const Workspace& workspace, SelectionResult* result) {
  return Competition(workspace, result).Run();
}

}  // namespace touchstone::diagnosis::selection
