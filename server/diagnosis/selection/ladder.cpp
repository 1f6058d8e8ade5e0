#include "server/diagnosis/selection/ladder.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/selection/declared_noise.h"
#include "server/diagnosis/selection/doubts.h"
#include "server/diagnosis/selection/dropouts.h"
#include "server/diagnosis/selection/round_structure.h"
#include "server/diagnosis/selection/surface_step.h"
#include "server/diagnosis/selection/time_structure.h"
#include "server/diagnosis/selection/where_in_words.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSurfaceNats = 5;        // evidence that asks for a surface error by itself
constexpr double kSurfaceWithMisfit = 1;  // ... and where the lack of fit says that something is left
constexpr double kMisfitP = 1e-2;
constexpr double kUnexplainedP = 1e-4;      // of the lack of fit, for a rest without a name
constexpr double kUnexplainedShare = 0.01;  // of the floor that such a rest must add
constexpr double kRoundsPossibleP =
    0.05;                          // of agreement within rounds, for a doubt of what scatter looks like
constexpr double kZeroErrors = 2;  // standard errors of a value that may be zero
constexpr double kZero = 1e-6;     // ... or this share of the typical size
constexpr double kSameSurface =
    2.5;  // ratio of two sizes of bumps that may be the same: an object has few of them

// The fit on every touch, where the search saw a part of them and no surface error stands in the way.
absl::StatusOr<inference::Fit> FitAll(const Workspace& workspace, const inference::Fit& fit) {
  if (!workspace.thinned || fit.hypothesis != 0 || fit.model.size() == 0) return fit;
  const touches::Observations& o = *workspace.observations;
  const touches::Contrasts contrasts = WeighedContrasts(workspace, o, workspace.nominal.time_s);
  const inference::Likelihood likelihood(
      touches::FirstRowsOfObjects(contrasts, static_cast<int>(o.objects.size())), nullptr, 0, nullptr);
  const touches::TouchObservationModel rows(o, *workspace.predictor, contrasts, workspace.nominal.time_s);
  inference::Experiment all = workspace.experiment;
  all.observations = &rows;
  all.likelihood = &likelihood;
  all.pool = nullptr;  // the predictor has the threads
  TOUCHSTONE_ASSIGN_OR_RETURN(inference::Fit whole, inference::FitModel(all, fit.model));
  whole.columns = fit.columns;  // held-out errors come from the search's touches
  return whole;
}

// The model with only those of its further effects that are in `kept`.
inference::Parameterization Only(const inference::Parameterization& model, int initial_effects,
                                 const std::vector<int>& kept) {
  inference::Parameterization part = model;
  for (int index = static_cast<int>(model.base().effects.size()) - 1; index >= initial_effects; --index)
    if (std::find(kept.begin(), kept.end(), index) == kept.end()) part = part.Without(index);
  return part;
}

}  // namespace

void AddTexts(const model::Effect& effect, LadderStep* step) {
  step->meaning = effect.meaning;
  step->check_on_rig = effect.check_on_rig;
  step->remedy = effect.remedy;
}

namespace {

class LadderBuilder {
 public:
  LadderBuilder(const Workspace& workspace, const SelectionResult& selection)
      : workspace_(workspace), selection_(selection) {}

  absl::StatusOr<Ladder> Build() {
    TOUCHSTONE_RETURN_IF_ERROR(Improve());
    DescribeRefits();
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    DoubtUnusualValues(fit_, selection_, &ladder_);
    doubts_ = DoubtsOf(fit_, selection_, &ladder_);
    QuestionRounds();
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.final,
                                QualityOf(workspace_, selection_.without_formula, ladder_.residuals));
    left_ = ladder_.final;
    TOUCHSTONE_RETURN_IF_ERROR(SetErrorsAsCompared(workspace_, ladder_.improved, &ladder_.final));
    TOUCHSTONE_RETURN_IF_ERROR(JudgeSurface());
    if (selection_.memory) AddMemoryStep(*selection_.memory, &ladder_);
    // Where the object lay elsewhere in every round, what the scatter looks like is no property of the sensor.
    const size_t steps = ladder_.steps.size();
    if (!doubts_.remounted && !selection_.partial)
      AddNoiseSteps(selection_.noise, selection_.memory.has_value(), &ladder_);
    if (rounds_.p < kRoundsPossibleP)
      for (size_t j = steps; j < ladder_.steps.size(); ++j) {
        ladder_.steps[j].probability = std::min(ladder_.steps[j].probability, 0.5);
        ladder_.steps[j].words =
            "Repeats agree within rounds: an object put down anew each round would look alike.";
      }
    if (!selection_.memory && !doubts_.remounted) RemoveAbsentMemory(*workspace_.observations, &ladder_);
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.candidates, RankCandidates(workspace_, selection_));
    const bool rest = StructureRemains() || selection_.curve || TimeStructureRemains() || Walks() ||
                      selection_.partial || unplaced_ || doubts_.any();
    if (has_formula() || rest) {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          ladder_.unexplained,
          DescribeUnexplained(workspace_, selection_, ladder_.final, ladder_.noise_floor.sigma_s));
      if (TimeStructureRemains() || Walks())
        NameTimeFirst(*workspace_.observations, ladder_.noise_floor, &*ladder_.unexplained);
      if (doubts_.remounted) NameRoundFirst(rounds_, &*ladder_.unexplained);
      ladder_.unexplained->words = WordsOfRest();
      Doubt(ExplainedShare(), doubts_, &ladder_);
    }
    ladder_.verdict = has_formula() || rest    ? Verdict::kUnexplained
                      : !ladder_.steps.empty() ? Verdict::kMissingEffects
                      : ladder_.values_wrong   ? Verdict::kWrongValues
                                               : Verdict::kAdequate;
    if (ladder_.changed && !ladder_.improved.name.empty()) ladder_.improved.name += "_better";
    return std::move(ladder_);
  }

 private:
  bool has_formula() const { return selection_.formula >= 0; }

  // The improved model: everything but the formula; its residuals, and the noise floor.
  absl::Status Improve() {
    const touches::Observations& o = *workspace_.observations;
    TOUCHSTONE_ASSIGN_OR_RETURN(fit_, FitAll(workspace_, selection_.fit));
    model::Model whole = fit_.model.base();
    RoundValues(fit_, &whole);
    ladder_.improved = whole;
    if (has_formula()) ladder_.improved.effects.erase(ladder_.improved.effects.begin() + selection_.formula);
    ladder_.changed = !selection_.steps.empty();
    TOUCHSTONE_RETURN_IF_ERROR(RemoveSuperfluous());
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.prediction, workspace_.predictor->Run(ladder_.improved, true, true));
    ladder_.residuals = touches::Residuals(o, ladder_.prediction);
    std::vector<double> best = ladder_.residuals;
    if (has_formula()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction with,
                                  workspace_.predictor->Run(whole, false, false));
      best = touches::Residuals(o, with);
    }
    ladder_.noise_floor = NoiseFloorOf(o, best, fit_.model.size());
    AddTimeStructure(o, best, &ladder_.noise_floor);
    ladder_.noise_floor.declared_s = DeclaredSigma(*workspace_.input.model);
    ladder_.dropouts = DropoutsInWords(o, ladder_.prediction);
    return absl::OkStatus();
  }

  // Effects of the given model whose values, set free, are zero as far as the data can tell.
  absl::Status RemoveSuperfluous() {
    for (int index = static_cast<int>(workspace_.input.model->effects.size()) - 1; index >= 0; --index) {
      if (!fit_.model.IsFree(index)) continue;
      const model::Effect& effect = *fit_.model.base().effects[index].effect;
      bool zero = true;
      for (const inference::ParameterEstimate& e : fit_.model.Describe(index, fit_.point, fit_.covariance))
        for (const model::ParameterInfo& parameter : effect.parameters)
          if (parameter.name == e.name)
            zero &=
                !parameter.reciprocal && std::abs(e.value - parameter.neutral) <=
                                             std::max(kZeroErrors * e.std_error, kZero * parameter.typical);
      if (!zero) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const inference::Fit without,
          inference::FitModel(workspace_.experiment, selection_.fit.model.Without(index)));
      if (without.log_evidence < selection_.fit.log_evidence) continue;
      superfluous_.push_back(index);
      ladder_.superfluous.push_back(inference::NameOf(effect));
      ladder_.improved.effects.erase(ladder_.improved.effects.begin() + index);
      ladder_.values_wrong = true;
      ladder_.changed = true;
    }
    return absl::OkStatus();
  }

  void DescribeRefits() {
    const model::Model& before = *workspace_.input.model;
    const inference::Parameterization initial(before, workspace_.observations->objects);
    for (int index = 0; index < static_cast<int>(before.effects.size()); ++index) {
      if (!fit_.model.IsFree(index)) continue;
      if (std::find(superfluous_.begin(), superfluous_.end(), index) != superfluous_.end()) continue;
      const std::vector<inference::ParameterEstimate> old =
          initial.Describe(index, Eigen::VectorXd(), Eigen::MatrixXd());
      RefittedEffect refit;
      refit.effect = inference::NameOf(*before.effects[index].effect);
      refit.parameters = fit_.model.Describe(index, fit_.point, fit_.covariance);
      for (size_t j = 0; j < refit.parameters.size() && j < old.size(); ++j)
        refit.parameters[j].before = old[j].value;
      ladder_.refitted.push_back(std::move(refit));
      ladder_.values_wrong = true;
      ladder_.changed = true;
    }
  }

  // Steps in the order in which they explain most.
  absl::Status DescribeSteps() {
    std::vector<int> kept, open;
    for (const SelectedStep& step : selection_.steps) open.push_back(step.effect);
    while (!open.empty()) {
      absl::StatusOr<inference::Fit> next = absl::NotFoundError("");
      size_t chosen = 0;
      for (size_t j = 0; j < open.size(); ++j) {
        TOUCHSTONE_ASSIGN_OR_RETURN(inference::Fit trial, FitWith(kept, open[j], open.size() == 1));
        if (next.ok() && trial.log_evidence <= next->log_evidence) continue;
        next = std::move(trial);
        chosen = j;
      }
      kept.push_back(open[chosen]);
      open.erase(open.begin() + static_cast<long>(chosen));
      TOUCHSTONE_RETURN_IF_ERROR(DescribeStep(kept.back(), *next));
    }
    return absl::OkStatus();
  }

  // The fit with the steps kept so far and one more; the last one is the whole fit.
  absl::StatusOr<inference::Fit> FitWith(std::vector<int> kept, int further, bool last) const {
    if (last && !has_formula()) return selection_.fit;
    kept.push_back(further);
    return inference::FitModel(workspace_.experiment,
                               Only(selection_.fit.model, selection_.initial_effects, kept));
  }

  absl::Status DescribeStep(int index, const inference::Fit& with_it) {
    const SelectedStep& from = *std::find_if(selection_.steps.begin(), selection_.steps.end(),
                                             [&](const SelectedStep& s) { return s.effect == index; });
    const model::EffectInstance& instance = fit_.model.base().effects[index];
    LadderStep step;
    step.effect = inference::NameOf(*instance.effect);
    step.scope = instance.per_object ? EffectScope::kObject : EffectScope::kRig;
    AddTexts(*instance.effect, &step);
    step.probability = from.probability;
    step.words = from.words;
    step.gain_nats = from.gain_nats;
    step.parameters = fit_.model.Describe(index, fit_.point, fit_.covariance);
    if (const std::string where = WhereInWords(fit_, from); !where.empty())
      step.words = absl::StrCat(where, step.words.empty() ? "" : " ", step.words);
    std::vector<std::string> equivalent = {step.effect};
    for (const CompetingEffect& other : from.competing)
      if (other.equivalent && std::find(equivalent.begin(), equivalent.end(), other.name) == equivalent.end())
        equivalent.push_back(other.name);
    step.equivalent.assign(equivalent.begin() + 1, equivalent.end());
    for (const CompetingEffect& other : from.competing)
      if (other.stopped && other.per_object == instance.per_object &&
          other.object == fit_.model.OnlyObject(index))
        step.words += absl::StrCat(step.words.empty() ? "" : " ", other.name,
                                   " would do as well with a value beyond its bound.");
    if (!step.equivalent.empty()) {
      step.discriminating_measurement = DiscriminatingMeasurement(equivalent);
      ladder_.confounded.push_back({equivalent, step.discriminating_measurement});
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.predictor->Run(with_it.model.base(), false, false));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        step.quality,
        QualityOf(workspace_, with_it, touches::Residuals(*workspace_.observations, prediction)));
    step.model = with_it.model.base();
    TOUCHSTONE_RETURN_IF_ERROR(SetErrorsAsCompared(workspace_, step.model, &step.quality));
    ladder_.steps.push_back(std::move(step));
    return absl::OkStatus();
  }

  const model::EffectInstance* GivenSurface() const {
    for (const model::EffectInstance& e : workspace_.input.model->effects)
      if (e.effect->role == model::EffectRole::kSmoothError) return &e;
    return nullptr;
  }

  // Bumps of the surface may be the last step, where nothing else accounts for them.
  absl::Status JudgeSurface() {
    const double gain_nats = selection_.surface_error.gain_nats;
    const bool misfit = left_.lack_of_fit_p < kMisfitP;
    const bool asked = selection_.fit.hypothesis != 0 &&
                       (gain_nats > kSurfaceNats || (misfit && gain_nats > kSurfaceWithMisfit));
    // Where a curve of one covariate or a wander takes part, bumps are no explanation of what is left.
    if (!asked || doubts_.any() || selection_.curve || selection_.memory || selection_.partial)
      return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(support_, FindSurfaceSupport(workspace_, selection_.fit));
    const model::EffectInstance* given = GivenSurface();
    const double rms_m = selection_.surface_error.rms_m;
    if (given != nullptr && rms_m < kSameSurface * given->values[0]) {
      // The model says that surfaces are as wrong as this.
      left_.lack_of_fit_p = QualityWithoutSurface(workspace_, selection_.fit).lack_of_fit_p;
      return absl::OkStatus();
    }
    if (support_.IsSurface()) {
      left_.lack_of_fit_p = QualityWithoutSurface(workspace_, selection_.fit).lack_of_fit_p;
      if (given != nullptr) {
        RefitSurfaceError(selection_.surface_error, &ladder_);
        return absl::OkStatus();
      }
      return AddSurfaceStep(workspace_, selection_, support_, left_.lack_of_fit_p, &ladder_);
    }
    unplaced_ = gain_nats > kSurfaceNats && support_.IsElsewhere();
    return absl::OkStatus();
  }

  // Whether repeats agree within rounds: a curve of time or a wander would look alike.
  void QuestionRounds() {
    if (selection_.curve || selection_.memory || selection_.partial) return;
    const double sigma_s = ladder_.noise_floor.sigma_s;
    rounds_ = FindRoundStructure(*workspace_.observations, ladder_.prediction, ladder_.residuals);
    if (!SharesRounds(rounds_, sigma_s)) return;
    doubts_.remounted = true;
    doubts_.words = RoundsInWords(rounds_, sigma_s);
  }

  bool StructureRemains() const {
    // Under a wander repeats are alike by chance, and the test of their scatter does not hold.
    return !has_formula() && !selection_.memory && left_.lack_of_fit_p < kUnexplainedP &&
           left_.rmse_s > (1 + kUnexplainedShare) * ladder_.noise_floor.sigma_s;
  }

  // A wander of which the session does not show that it comes back is no noise of a known memory.
  bool Walks() const {
    const auto& given = workspace_.input.model->effects;
    return selection_.memory && !Forgets(*selection_.memory) &&
           std::none_of(given.begin(), given.end(), [](const model::EffectInstance& instance) {
             return instance.effect->role == model::EffectRole::kNoiseMemory;
           });
  }

  std::string WordsOfRest() const {
    if (selection_.partial) return selection_.partial->words;
    if (Walks())
      return "The fingers wander through the whole session, and nothing shows that they come back: a walk, "
             "or noise "
             "whose memory is as long as the session. Find what moves, or make a longer session.";
    const std::string words = unplaced_ ? support_.WordsOfRest() : doubts_.words;
    if (!selection_.curve || selection_.curve->words.empty()) return words;
    std::string course = absl::StrCat(selection_.curve->words, ".");
    course[0] = absl::ascii_toupper(course[0]);
    return words.empty() ? course : absl::StrCat(course, " ", words);
  }

  // Of the mean square error that is no noise, what the steps take away.
  double ExplainedShare() const {
    const double floor_s2 = ladder_.noise_floor.sigma_s * ladder_.noise_floor.sigma_s;
    const touches::Observations& o = *workspace_.observations;
    const double before_s2 =
        std::pow(touches::Rmse(o, touches::Residuals(o, workspace_.nominal)), 2) - floor_s2;
    const double after_s2 = left_.rmse_s * left_.rmse_s - floor_s2;
    return before_s2 > 0 ? std::clamp(1 - after_s2 / before_s2, 0.0, 1.0) : 0;
  }

  // Repeats that share a course in time are not noise.
  bool TimeStructureRemains() const { return !selection_.memory && SharesTime(ladder_.noise_floor); }

  const Workspace& workspace_;
  const SelectionResult& selection_;
  inference::Fit fit_;            // on all touches
  Quality left_;                  // on the touches that the fits used: what the verdict is about
  std::vector<int> superfluous_;  // effects of the given model
  Doubts doubts_;
  RoundStructure rounds_;
  SurfaceSupport support_;
  bool unplaced_ = false;  // a misfit repeats with the pose, but not with the place on the surface
  Ladder ladder_;
};

}  // namespace

absl::StatusOr<Ladder> BuildLadder(const Workspace& workspace, const SelectionResult& selection) {
  return LadderBuilder(workspace, selection).Build();
}

}  // namespace touchstone::diagnosis::selection
