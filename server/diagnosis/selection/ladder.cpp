#include "server/diagnosis/selection/ladder.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/readable_time.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/candidate_ranking.h"
#include "server/diagnosis/engine/findings.h"
#include "server/diagnosis/engine/held_out.h"
#include "server/diagnosis/selection/declared_noise.h"
#include "server/diagnosis/selection/doubts.h"
#include "server/diagnosis/selection/dropouts.h"
#include "server/diagnosis/selection/pose_scatter.h"
#include "server/diagnosis/selection/round_structure.h"
#include "server/diagnosis/selection/session_order.h"
#include "server/diagnosis/selection/surface_step.h"
#include "server/diagnosis/selection/time_structure.h"
#include "server/diagnosis/selection/touches_set_aside.h"
#include "server/diagnosis/selection/uneven_scatter.h"
#include "server/diagnosis/selection/unsupported_steps.h"
#include "server/diagnosis/touches/ticks.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSurfaceNats = 5;        // evidence that asks for a surface error by itself
constexpr double kSurfaceWithMisfit = 1;  // ... and where the lack of fit says that something is left
constexpr double kMisfitP = 1e-2;
constexpr double kRoundsPossibleP =
    0.05;  // of agreement within rounds, for a doubt of what scatter looks like
constexpr double kMaxBesideMotion = 0.5;  // probability of noise where an object that moves would look alike
constexpr double kMaxAtTwoSpeeds =
    0.5;  // probability of either of two effects that two speeds cannot tell from another
constexpr double kSameSurface =
    2.5;  // ratio of two sizes of bumps that may be the same: an object has few of them

// The fit on every touch, where the search saw a part of them and no surface error stands in the way.
absl::StatusOr<engine::Fit> FitAll(const Workspace& workspace, const engine::Fit& fit) {
  if (!workspace.thinned || fit.hypothesis != 0 || fit.model.size() == 0) return fit;
  const touches::Observations& o = *workspace.observations;
  const touches::Contrasts contrasts = WeighedContrasts(workspace, o, workspace.nominal.time_s);
  const engine::Likelihood likelihood(
      touches::FirstRowsOfObjects(contrasts, static_cast<int>(o.objects.size())), nullptr, 0, nullptr);
  const touches::TouchObservationModel rows(o, *workspace.predictor, contrasts, workspace.nominal.time_s);
  engine::Experiment all = workspace.experiment;
  all.observations = &rows;
  all.likelihood = &likelihood;
  all.pool = nullptr;  // the predictor has the threads
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit whole, engine::FitModel(all, fit.model));
  whole.columns = fit.columns;  // held-out errors come from the search's touches
  return whole;
}

// The error as a comparison finds it; the held-out error keeps its ratio to the fit's.
absl::Status SetErrors(const Workspace& workspace, const engine::Fit& fit,
                       engine::RankedCandidate* candidate) {
  TOUCHSTONE_ASSIGN_OR_RETURN(candidate->rmse, ErrorAsCompared(workspace, fit.model.base()));
  candidate->heldout_rmse =
      candidate->rmse * HeldOutRatio(fit, engine::HeldOutRmse(workspace.experiment, fit));
  return absl::OkStatus();
}

// The steps by their effects' indices in the model without the formula.
std::vector<engine::SelectedStep> StepsWithoutFormula(const SelectionResult& selection) {
  std::vector<engine::SelectedStep> steps = selection.steps;
  for (engine::SelectedStep& step : steps)
    if (selection.formula >= 0 && step.effect > selection.formula) --step.effect;
  return steps;
}

class LadderBuilder {
 public:
  LadderBuilder(const Workspace& workspace, const SelectionResult& selection)
      : workspace_(workspace),
        selection_(selection),
        saved_(has_formula() ? selection.without_formula : selection.fit),
        steps_(StepsWithoutFormula(selection)) {}

  // The effects with their errors. Returns the effect of the selection that is no step (engine::StepWithoutGain); -1: none.
  absl::StatusOr<int> Climb() {
    TOUCHSTONE_RETURN_IF_ERROR(Improve());
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    TOUCHSTONE_ASSIGN_OR_RETURN(
        before_, QualityOfModel(workspace_, selection_.initial_model, *workspace_.input.model));
    const int step = engine::StepWithoutGain(before_, engine::QualitiesOf(ladder_.steps));
    if (step < 0) return -1;
    const int effect = climbed_[step];
    return effect + (has_formula() && effect >= selection_.formula);
  }

  absl::StatusOr<Ladder> Build() {
    DoubtUnusualValues(fit_, steps_, &ladder_);
    DoubtTwoSpeeds();
    doubts_ = DoubtsOf(fit_, steps_, &ladder_);
    QuestionRounds();
    ticks_ = touches::FindTouchTicks(*workspace_.observations);
    TOUCHSTONE_ASSIGN_OR_RETURN(left_, QualityOf(workspace_, saved_, ladder_.residuals));
    ladder_.final = left_;
    TOUCHSTONE_ASSIGN_OR_RETURN(const double final_s, ErrorAsCompared(workspace_, ladder_.improved));
    SetError(final_s, &ladder_.final);
    if (ladder_.steps.empty() && ladder_.values_wrong && ladder_.final.rmse > before_.rmse) KeepGiven();
    ladder_.set_aside = AssessTouchesSetAside(*workspace_.observations, ladder_.residuals, ladder_.final.rmse,
                                              ladder_.noise_floor.sigma);
    TOUCHSTONE_RETURN_IF_ERROR(JudgeSurface());
    if (selection_.memory) AddMemoryStep(*selection_.memory, &ladder_);
    // Where the object lay elsewhere in every round, what the scatter looks like is no property of the sensor.
    const size_t steps = ladder_.steps.size();
    if (!selection_.memory && !doubts_.remounted && !selection_.partial)
      pose_scatter_ =
          FindPoseScatter(*workspace_.observations, ladder_.prediction, ladder_.residuals, selection_.noise);
    if (!doubts_.remounted && !selection_.partial && !ladder_.noise_floor.is_rounding && !PlayRemains()) {
      touches::NoiseFindings noise = selection_.noise;
      uneven_ = UnevenScatterOfNoise();
      if (uneven_ && !uneven_->tails_remain) noise.degrees_of_freedom = {};
      AddNoiseSteps(std::move(noise), selection_.memory.has_value(), &ladder_);
    }
    QuestionNoise(steps);
    if (!selection_.memory && !doubts_.remounted) RemoveAbsentMemory(*workspace_.observations, &ladder_);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        ladder_.candidates,
        engine::RankCandidates(*selection_.search, selection_.initial_model, selection_.initial_effects,
                               [this](const engine::Fit& fit, engine::RankedCandidate* candidate) {
                                 return SetErrors(workspace_, fit, candidate);
                               }));
    const bool rest = has_formula() || StructureRemains() || selection_.curve || TimeStructureRemains() ||
                      Walks() || selection_.partial || unplaced_ || doubts_.any() ||
                      ladder_.set_aside.is_finding || ticks_.in_part() || selection_.group || PlayRemains();
    if (rest || uneven_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.unexplained,
                                  DescribeUnexplained(workspace_, selection_, ladder_.final,
                                                      ladder_.noise_floor.sigma, with_formula_));
      if (TimeStructureRemains() || Walks())
        NameTimeFirst(*workspace_.observations, ladder_.noise_floor, &*ladder_.unexplained);
      if (selection_.group)
        ladder_.unexplained->covariates.insert(ladder_.unexplained->covariates.begin(),
                                               selection_.group->test);
      if (doubts_.remounted) NameRoundFirst(rounds_, &*ladder_.unexplained);
      if (uneven_) NameUnevenScatter(*uneven_, rest, &*ladder_.unexplained);
      ladder_.unexplained->words = WordsOfRest();
      // An uneven scatter says nothing against effects, which move means.
      if (rest)
        engine::DoubtBesideRest(engine::MostBesideRest(ExplainedShare(), doubts_.any()), &ladder_.steps,
                                &ladder_.candidates);
    }
    ladder_.verdict = rest || uneven_          ? engine::Verdict::kUnexplained
                      : !ladder_.steps.empty() ? engine::Verdict::kMissingEffects
                      : ladder_.values_wrong   ? engine::Verdict::kWrongValues
                                               : engine::Verdict::kAdequate;
    if (ladder_.changed && !ladder_.improved.name.empty()) ladder_.improved.name += "_better";
    return std::move(ladder_);
  }

 private:
  bool has_formula() const { return selection_.formula >= 0; }

  // The improved model: everything but the formula, fitted without it; its residuals, and the noise floor of the best model.
  absl::Status Improve() {
    const touches::Observations& o = *workspace_.observations;
    TOUCHSTONE_ASSIGN_OR_RETURN(fit_, FitAll(workspace_, saved_));
    ladder_.improved = fit_.model.base();
    engine::RoundValues(fit_, &ladder_.improved);
    ladder_.changed = !steps_.empty();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int> superfluous, DescribeGiven());
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.prediction, workspace_.predictor->Run(ladder_.improved, true, true));
    ladder_.residuals = touches::Residuals(o, ladder_.prediction);
    std::vector<double> best = ladder_.residuals;
    if (has_formula()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const engine::Fit whole, FitAll(workspace_, selection_.fit));
      with_formula_ = whole.model.base();
      engine::RoundValues(whole, &*with_formula_);
      for (const int index : superfluous)
        with_formula_->effects.erase(with_formula_->effects.begin() + index);
      TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction with,
                                  workspace_.predictor->Run(*with_formula_, false, false));
      best = touches::Residuals(o, with);
    }
    ladder_.noise_floor = NoiseFloorOf(o, best, fit_.model.size());
    AddTimeStructure(o, best, &ladder_.noise_floor);
    ladder_.noise_floor.declared = DeclaredSigma(*workspace_.input.model);
    ladder_.dropouts = DropoutsInWords(o, ladder_.prediction);
    return absl::OkStatus();
  }

  // New values that compare worse are none.
  void KeepGiven() {
    ladder_.improved = *workspace_.input.model;
    ladder_.final = before_;
    ladder_.refitted.clear(), ladder_.superfluous.clear();
    ladder_.values_wrong = ladder_.changed = false;
  }

  // Values of the given model's effects that were set free: new ones, or zero as far as the data can tell.
  // Returns the indices of the latter, largest first.
  absl::StatusOr<std::vector<int>> DescribeGiven() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        engine::GivenEffects given,
        engine::DescribeGivenEffects(workspace_.experiment, saved_, fit_, fit_.covariance,
                                     *workspace_.input.model, workspace_.observations->objects));
    for (const int index : given.superfluous)
      ladder_.improved.effects.erase(ladder_.improved.effects.begin() + index);
    ladder_.values_wrong = given.changed();
    ladder_.changed |= given.changed();
    ladder_.superfluous = std::move(given.superfluous_names);
    ladder_.refitted = std::move(given.refitted);
    return given.superfluous;
  }

  absl::Status DescribeSteps() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::vector<engine::OrderedStep> ordered,
        engine::OrderSteps(workspace_.experiment, {saved_, selection_.initial_effects}, -1, steps_));
    for (const engine::OrderedStep& step : ordered) TOUCHSTONE_RETURN_IF_ERROR(DescribeStep(step));
    return absl::OkStatus();
  }

  absl::Status DescribeStep(const engine::OrderedStep& ordered) {
    engine::LadderStep step = engine::DescribeStep(fit_, fit_.covariance, *ordered.step);
    engine::AddConfounded(step, &ladder_.confounded);
    AddOrder(ordered.step->effect, &step);
    step.model = ordered.whole ? ladder_.improved : ordered.fit.model.base();
    TOUCHSTONE_ASSIGN_OR_RETURN(step.quality, QualityOfModel(workspace_, ordered.fit, step.model));
    climbed_.push_back(ordered.step->effect);
    ladder_.steps.push_back(std::move(step));
    return absl::OkStatus();
  }

  // Objects have sizes and places of their own; what belongs to the rig and differs between objects may differ in time.
  void AddOrder(int effect, engine::LadderStep* step) const {
    const model::EffectInstance& instance = saved_.model.base().effects[effect];
    if (!instance.per_object || instance.effect->often_per_object) return;
    const std::string words =
        OrderInWords(*workspace_.observations, saved_.model.OnlyObject(effect), step->parameters);
    if (!words.empty()) engine::AddWords(words, step);
  }

  // Two effects that two speeds cannot tell from a third dependence on the speed.
  void DoubtTwoSpeeds() {
    for (const auto& [one, other] : PairsAtTwoSpeeds(*workspace_.searched, TouchOfRow(), saved_, steps_)) {
      const std::string names[] = {NameOfStep(one), NameOfStep(other)};
      for (engine::LadderStep& step : ladder_.steps) {
        if (step.effect != names[0] && step.effect != names[1]) continue;
        engine::AddWords(absl::StrCat("At two speeds, whatever depends on the speed is some sum of ",
                                      names[0], " and ", names[1], ": measure at a third one."),
                         &step);
        step.probability = std::min(step.probability, kMaxAtTwoSpeeds);
      }
    }
  }
  std::string NameOfStep(size_t step) const {
    return engine::NameOf(*saved_.model.base().effects[steps_[step].effect].effect);
  }
  // The touch of each row of the search.
  std::vector<int> TouchOfRow() const {
    std::vector<int> touches;
    for (const int t : workspace_.contrasts->touch_of_row())
      touches.push_back(workspace_.contrasts->touches()[t]);
    return touches;
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
    const double sigma_s = ladder_.noise_floor.sigma;
    rounds_ = FindRoundStructure(*workspace_.observations, ladder_.prediction, ladder_.residuals);
    if (!SharesRounds(rounds_, sigma_s)) return;
    doubts_.remounted = true;
    doubts_.words = RoundsInWords(rounds_, sigma_s);
  }

  // Of the noise, from step `first` on, what an object that moves would look like.
  void QuestionNoise(size_t first) {
    for (size_t j = first; j < ladder_.steps.size(); ++j) {
      engine::LadderStep& step = ladder_.steps[j];
      if (rounds_.p < kRoundsPossibleP) {
        step.probability = std::min(step.probability, kMaxBesideMotion);
        step.words = "Repeats agree within rounds: an object put down anew each round would look alike.";
      }
      const auto level = effects::FindByRole(model::EffectRole::kNoiseLevel);
      if (!pose_scatter_ || step.effect == level->name) continue;
      step.probability = std::min(step.probability, kMaxBesideMotion);
      engine::AddWords(pose_scatter_->words, &step);
    }
  }

  // Where something else makes touches scatter, parts of the set scatter differently for that reason.
  std::optional<UnevenScatter> UnevenScatterOfNoise() const {
    const bool misfit =
        has_formula() || StructureRemains() || unplaced_ || doubts_.any() || selection_.fit.hypothesis != 0;
    if (selection_.memory || SharesTime(ladder_.noise_floor) || (!ladder_.noise_floor.from_repeats && misfit))
      return std::nullopt;
    return FindUnevenScatter(*workspace_.observations, ladder_.prediction, ladder_.residuals,
                             selection_.noise);
  }

  // Repeats scatter as no noise of the fingers does.
  bool PlayRemains() const { return pose_scatter_ && pose_scatter_->ahead; }

  bool StructureRemains() const {
    // Under a wander repeats are alike by chance, and the test of their scatter does not hold.
    return !has_formula() && !selection_.memory && engine::StructureRemains(left_, ladder_.noise_floor.sigma);
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
    if (selection_.group) return selection_.group->words;
    if (selection_.partial) return selection_.partial->words;
    if (Walks())
      return "The fingers wander through the whole session, and nothing shows that they come back: a walk, "
             "or noise "
             "whose memory is as long as the session. Find what moves, or make a longer session.";
    const std::string words = unplaced_                      ? support_.WordsOfRest()
                              : doubts_.any()                ? doubts_.words
                              : uneven_                      ? uneven_->words
                              : ladder_.set_aside.is_finding ? ladder_.set_aside.words
                              : ticks_.in_part()             ? TicksInWords()
                              : PlayRemains()                ? pose_scatter_->words
                                                             : "";
    if (!selection_.curve || selection_.curve->words.empty()) return words;
    std::string course = absl::StrCat(selection_.curve->words, ".");
    course[0] = absl::ascii_toupper(course[0]);
    return words.empty() ? course : absl::StrCat(course, " ", words);
  }

  std::string TicksInWords() const {
    return absl::StrFormat(
        "The times of %d of %d touches lie on ticks of %s, those of the others do not: they were read in two "
        "ways.",
        ticks_.touches, ticks_.compared, TimeInWords(ticks_.interval_s));
  }

  // Of the mean square error that is no noise, what the steps take away.
  double ExplainedShare() const {
    const touches::Observations& o = *workspace_.observations;
    return engine::ExplainedShare(touches::Rmse(o, touches::Residuals(o, workspace_.nominal)), left_.rmse,
                                  ladder_.noise_floor.sigma);
  }

  // Repeats that share a course in time are not noise.
  bool TimeStructureRemains() const { return !selection_.memory && SharesTime(ladder_.noise_floor); }

  const Workspace& workspace_;
  const SelectionResult& selection_;
  const engine::Fit& saved_;  // without the formula, on the touches of the search
  const std::vector<engine::SelectedStep> steps_;
  std::vector<int> climbed_;  // the effect of each of the ladder's steps, by its index in saved_
  engine::Fit fit_;           // as saved_, on all touches
  std::optional<model::Model> with_formula_;
  engine::Quality before_;  // of the model as it was given
  engine::Quality left_;    // on the touches that the fits used: what the verdict is about
  Doubts doubts_;
  RoundStructure rounds_;
  SurfaceSupport support_;
  std::optional<PoseScatter> pose_scatter_;
  std::optional<UnevenScatter> uneven_;
  touches::TouchTicks ticks_;
  bool unplaced_ = false;  // a misfit repeats with the pose, but not with the place on the surface
  Ladder ladder_;
};

}  // namespace

absl::StatusOr<Ladder> BuildLadder(const Workspace& workspace, SelectionResult* selection) {
  for (;;) {
    LadderBuilder builder(workspace, *selection);
    TOUCHSTONE_ASSIGN_OR_RETURN(const int effect, builder.Climb());
    if (effect < 0) return builder.Build();
    TOUCHSTONE_RETURN_IF_ERROR(TakeOut(workspace, effect, selection));
    TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(selection));
  }
}

}  // namespace touchstone::diagnosis::selection
