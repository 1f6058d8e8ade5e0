#include "server/diagnosis/selection/curve_competition.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/diagnosis/selection/session/time_structure.h"
#include "server/effects/formula/lookup.h"

namespace touchstone::diagnosis::selection {
namespace {

// A fit of named effects, and a curve over it.
struct WithCurve {
  engine::Fit fit;
  NamelessCurve curve;
  double total() const { return fit.log_evidence + curve.gain_nats; }
};

// To a multiple of a power of ten; such a power is exact upwards only.
double RoundedToDigits(double value, double unit) {
  return unit >= 1 ? std::round(value / unit) * unit : std::round(value / unit) / std::round(1 / unit);
}

class Competition {
 public:
  Competition(const Workspace& workspace, SelectionResult* result)
      : workspace_(workspace), result_(*result) {}

  absl::Status Run() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool partial, IsPartial());
    if (partial) return absl::OkStatus();
    engine::Fit named = result_.without_formula;
    TOUCHSTONE_ASSIGN_OR_RETURN(result_.curves, CurvesOver(named, ""));
    TOUCHSTONE_RETURN_IF_ERROR(ReplaceOvertaken(&named));
    std::vector<WithCurve> found;
    for (const NamelessCurve& curve : result_.curves) {
      if (static_cast<int>(found.size()) == kSelectionRules.max_curves_tried || !IsSignificant(curve)) break;
      WithCurve with{named, curve};
      TOUCHSTONE_RETURN_IF_ERROR(DropSuperfluous(&with));
      found.push_back(std::move(with));
    }
    const auto best =
        std::max_element(found.begin(), found.end(),
                         [](const WithCurve& a, const WithCurve& b) { return a.total() < b.total(); });
    if (best == found.end()) return LookForMemory(named);
    if (result_.formula >= 0 && FormulaSaysTheSame(*best)) return DescribeBesideFormula();
    if (best->curve.of_time) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool correlated, IsNoiseWithMemory(*best));
      if (correlated) return absl::OkStatus();
    }
    return Adopt(*best);
  }

 private:
  absl::StatusOr<std::vector<NamelessCurve>> CurvesOver(const engine::Fit& fit,
                                                        const std::string& only) const {
    if (workspace_.experiment.cancelled && workspace_.experiment.cancelled())
      return absl::CancelledError("the diagnosis was cancelled");
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                                workspace_.searched_predictor->Run(fit.model.base(), true, true));
    return ScoreCurves(workspace_.experiment, *workspace_.rows, fit, details, only);
  }

  // An offset that a part of the touches has, in the place of constants and drifts of each finger.
  absl::StatusOr<bool> IsPartial() {
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

  void NoteRival(const std::string& name, double ahead_nats, const std::string& words) {
    const auto [rival, is_new] = result_.nameless_rivals.try_emplace(name);
    if (!is_new && rival->second.ahead_nats >= ahead_nats) return;
    rival->second = {ahead_nats, words};
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
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<NoiseMemory> with, MemoryOf(named));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<NoiseMemory> alone, MemoryOf(without));
    if (!with || !alone) return absl::OkStatus();
    const double own = std::max(with->white_log_likelihood, with->log_likelihood - with->complexity_nats) -
                       0.5 * (workspace_.searched->fingers - 1) * with->complexity_nats;
    const double ahead_nats = alone->log_likelihood - alone->complexity_nats - own;
    NoteRival(engine::NameOf(effect), ahead_nats,
              "Correlated noise of the fingers would say nearly the same.");
    return absl::OkStatus();
  }

  absl::StatusOr<std::optional<NoiseMemory>> MemoryOf(const engine::Fit& fit) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.searched_predictor->Run(fit.model.base(), false, false));
    const touches::Observations& o = *workspace_.searched;
    return FindNoiseMemory(o, touches::Residuals(o, prediction));
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
      NoteRival(name, behind + curves[0].any_gain_nats - any_beside, RivalInWords(curves[0]));
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

  // Correlated noise has no course that another session would repeat: it is noise, which a curve only traces.
  absl::StatusOr<bool> IsNoiseWithMemory(const WithCurve& with) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<NoiseMemory> memory, MemoryOf(with.fit));
    if (!memory) return false;
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool declared, IsDeclaredMemory(with.fit));
    const double course = std::max({with.curve.gain_nats, memory->step_gain_nats, memory->period_gain_nats});
    if (declared ? course > memory->gain_nats + kSelectionRules.memory_ahead ||
                       memory->smooth_gain_nats > memory->gain_nats + kSelectionRules.memory_ahead
                 : !memory->everywhere || memory->gain_nats < course + kSelectionRules.memory_ahead ||
                       memory->gain_nats < memory->smooth_gain_nats + kSelectionRules.memory_rougher)
      return false;
    result_.fit = with.fit;
    TOUCHSTONE_RETURN_IF_ERROR(DropWhatIsCorrelated(&*memory));
    result_.memory = std::move(memory);
    result_.without_formula = result_.fit;
    result_.formula = -1;
    return true;
  }

  // Whether the given model has correlated noise that the residuals do not rule out: it is what a course must be ahead of.
  absl::StatusOr<bool> IsDeclaredMemory(const engine::Fit& fit) const {
    const model::EffectInstance* declared = DeclaredMemoryOf(*workspace_.input.model);
    if (declared == nullptr) return false;
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.searched_predictor->Run(fit.model.base(), false, false));
    const touches::Observations& o = *workspace_.searched;
    return !AssessDeclaredMemory(o, touches::Residuals(o, prediction), declared->values[0],
                                 declared->values[1])
                .absent;
  }

  // Effects that were found under noise without memory must be worth their values under correlated noise too.
  absl::Status DropWhatIsCorrelated(NoiseMemory* memory) {
    for (int index = static_cast<int>(result_.fit.model.base().effects.size()) - 1;
         index >= result_.initial_effects; --index) {
      TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit without,
                                  engine::FitModel(workspace_.experiment, result_.fit.model.Without(index)));
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<NoiseMemory> other, MemoryOf(without));
      if (!other || other->log_likelihood < memory->log_likelihood - kSelectionRules.worth_under_memory)
        continue;
      result_.fit = std::move(without);
      *memory = *other;
    }
    return absl::OkStatus();
  }

  // No curve says how, but repeats share a course in time, or the given model says that they do.
  absl::Status LookForMemory(const engine::Fit& named) {
    if (result_.formula >= 0) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool declared, IsDeclaredMemory(named));
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.searched_predictor->Run(named.model.base(), false, false));
    const touches::Observations& o = *workspace_.searched;
    if (!declared && !(FindTimeStructure(o, touches::Residuals(o, prediction)).p < kSessionRules.time_p))
      return absl::OkStatus();
    return IsNoiseWithMemory({named, NamelessCurve()}).status();
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

  // The formula stays; a curve of its covariate is given beside it.
  absl::Status DescribeBesideFormula() {
    for (const NamelessCurve& curve : result_.curves)
      if (curve.covariate == result_.term.covariate) result_.curve = curve;
    return absl::OkStatus();
  }

  absl::Status Adopt(const WithCurve& with) {
    TOUCHSTONE_ASSIGN_OR_RETURN(result_.curves, CurvesOver(with.fit, ""));
    result_.curve = with.curve;
    if (with.curve.covariate == "touch") {
      // Models know session times and not rows: without such times there is nothing to add.
      result_.fit = result_.without_formula = with.fit;
      result_.formula = -1;
      return absl::OkStatus();
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
    return absl::OkStatus();
  }

  const Workspace& workspace_;
  SelectionResult& result_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeCurveEffect(const NamelessCurve& curve) {
  model::LookupSpec spec;
  spec.name = NameOfRest(curve.covariate);
  spec.adds_time = curve.adds_time;
  spec.stage = curve.adds_time ? model::Stage::kSensor : model::Stage::kMotion;
  spec.covariate = curve.covariate;
  const double range = curve.knots.back() - curve.knots.front();
  const double knot_unit = std::pow(10.0, std::floor(std::log10(std::max(range, 1e-12))) - 5);
  for (const double knot : curve.knots) spec.knots.push_back(RoundedToDigits(knot, knot_unit));
  const double value_unit = curve.adds_time ? 0.1 : 1e-5;  // us; mm
  for (const std::vector<double>& values : curve.values) {
    spec.values.emplace_back();
    for (const double value : values) spec.values.back().push_back(RoundedToDigits(value, value_unit));
  }
  return effects::MakeLookupEffect(spec);
}

absl::Status CompeteWithCurves(const Workspace& workspace, SelectionResult* result) {
  return Competition(workspace, result).Run();
}

}  // namespace touchstone::diagnosis::selection
