#include "server/diagnosis/selection/ladder/ladder.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/readable_time.h"
#include "server/diagnosis/engine/competition/candidate_ranking.h"
#include "server/diagnosis/engine/findings.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/selection/curve_competition.h"
#include "server/diagnosis/selection/curves/suggested_rest.h"
#include "server/diagnosis/selection/ladder/climb.h"
#include "server/diagnosis/selection/ladder/doubts.h"
#include "server/diagnosis/selection/ladder/hypotheses.h"
#include "server/diagnosis/selection/ladder/model_posterior.h"
#include "server/diagnosis/selection/ladder/noise_questions.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/diagnosis/selection/ladder/surface_step.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"
#include "server/diagnosis/selection/scatter/touches_set_aside.h"
#include "server/diagnosis/selection/session/moving_object.h"
#include "server/diagnosis/selection/session/round_structure.h"
#include "server/diagnosis/selection/session/time_structure.h"
#include "server/diagnosis/selection/session/turns.h"
#include "server/diagnosis/selection/unsupported_steps.h"
#include "server/diagnosis/touches/noise/ticks.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

// The error as a comparison finds it; the held-out error keeps its ratio to the fit's.
absl::Status SetErrors(const Workspace& workspace, const engine::Fit& fit,
                       engine::RankedCandidate* candidate) {
  TOUCHSTONE_ASSIGN_OR_RETURN(candidate->rmse, ErrorAsCompared(workspace, fit.model.base()));
  candidate->heldout_rmse =
      candidate->rmse * HeldOutRatio(fit, engine::HeldOutRmse(workspace.experiment, fit));
  return absl::OkStatus();
}

// What follows the climb: what the steps leave, which noise, how sure of all this.
class LadderBuilder {
 public:
  LadderBuilder(const Workspace& workspace, const SelectionResult& selection, Climb climb)
      : workspace_(workspace),
        selection_(selection),
        climb_(std::move(climb)),
        ladder_(climb_.ladder),
        observations_(*workspace.observations) {}

  absl::StatusOr<Ladder> Build() {
    TOUCHSTONE_RETURN_IF_ERROR(SetFinal());
    if (selection_.memory) AddMemoryStep(*selection_.memory, observations_, &ladder_);
    TOUCHSTONE_RETURN_IF_ERROR(found_.Ask(Questions()));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        ladder_.candidates,
        engine::RankCandidates(*selection_.search, selection_.initial_model, selection_.initial_effects,
                               [this](const engine::Fit& fit, engine::RankedCandidate* candidate) {
                                 return SetErrors(workspace_, fit, candidate);
                               }));
    if (found_.Leave(engine::Leaves::kBeside)) {
      TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.unexplained,
                                  DescribeUnexplained(workspace_, selection_, ladder_, climb_.with_formula));
      found_.DescribeRest(&*ladder_.unexplained);
    }
    if (found_.Leave(engine::Leaves::kMeans))
      DoubtCarriedByFewPoses(workspace_, selection_.fit, selection_.steps, &ladder_);
    engine::Conclude(found_, ExplainedShare(), &ladder_);
    TOUCHSTONE_RETURN_IF_ERROR(AddPosterior());
    return std::move(ladder_);
  }

 private:
  using H = Hypothesis;

  engine::Hypotheses::Questions Questions() {
    const auto name_time = [this](engine::UnexplainedRest* rest) {
      NameTimeFirst(observations_, ladder_.noise_floor, rest);
    };
    const auto ask = [](auto question) {
      return [question] {
        question();
        return absl::OkStatus();
      };
    };
    return {
        {H::kRandomWalk,
         [=] {
           return found_.AddIf(
               selection_.memory && IsRandomWalk(), H::kRandomWalk,
               "The fingers drift through the whole session, and nothing shows that they revert to a mean: a "
               "walk, or noise whose memory is as long as the session. Find what moves, or make a longer "
               "session.",
               name_time);
         }},
        {H::kCorrelatedNoise,
         [this] { return found_.AddIf(selection_.memory.has_value(), H::kCorrelatedNoise); }},
        {H::kCourse,
         [=] { return found_.AddIf(SharesTime(ladder_.noise_floor), H::kCourse, "", name_time); }},
        {H::kGroup, ask([this] {
           if (selection_.group)
             found_.Add(H::kGroup, selection_.group->words, [this](engine::UnexplainedRest* rest) {
               engine::PutFirst(selection_.group->test, rest);
             });
         })},
        {H::kPartialOffset, ask([this] {
           if (selection_.partial) found_.Add(H::kPartialOffset, selection_.partial->words);
         })},
        {H::kFormula, [this] { return found_.AddIf(selection_.formula >= 0, H::kFormula); }},
        {H::kCurve, ask([this] {
           if (selection_.curve) found_.Add(H::kCurve, CourseInWords(selection_.curve->words));
         })},
        {H::kStrangeValues, ask([this] { AskStrangeValues(); })},
        {H::kTurns, ask([this] { AskTurns(); })},
        {H::kMovingObject, ask([this] { AskMovingObject(); })},
        {H::kRemounted, ask([this] { AskRounds(); })},
        {H::kTicks, ask([this] { AskTicks(); })},
        {H::kFingerTicks, ask([this] { noise_.AskFingerTicks(); })},
        {H::kSetAside, ask([this] { AskSetAside(); })},
        {H::kUnplaced, [this] { return AskSurface(); }},
        {H::kPlay, ask([this] { noise_.AskPlay(); })},
        {H::kMisfit,
         [this] {
           return found_.AddIf(engine::StructureRemains(left_, ladder_.noise_floor.sigma), H::kMisfit);
         }},
        {H::kUnevenScatter, ask([this] { noise_.AskUnevenScatter(); })},
        {H::kRandomDelay, ask([this] { noise_.AskRandomDelay(); })},
        {H::kLopsided, ask([this] { noise_.AskLopsided(); })},
        {H::kNoise, ask([this] { noise_.AddSteps(rounds_.p); })},
        {H::kAbsentMemory, ask([this] { RemoveAbsentMemory(observations_, &ladder_); })},
    };
  }

  // A drift of which the session does not show that it reverts to its mean is no noise of a known memory, unless the given
  // model says so.
  bool IsRandomWalk() const {
    return !RevertsToMean(*selection_.memory) && DeclaredMemoryOf(*workspace_.input.model) == nullptr;
  }

  static std::string CourseInWords(std::string words) {
    if (words.empty()) return words;
    words[0] = absl::ascii_toupper(words[0]);
    return absl::StrCat(words, ".");
  }

  void AskStrangeValues() {
    DoubtUnusualValues(climb_.fit, climb_.steps, &ladder_);
    DoubtTwoSpeeds(workspace_, *climb_.searched, climb_.steps, &ladder_);
    std::string strange = StrangeValuesInWords(climb_.fit, climb_.steps, &ladder_);
    if (!strange.empty()) found_.Add(H::kStrangeValues, std::move(strange));
  }

  void AskTurns() {
    const std::optional<Turns> turns = FindTurns(observations_, climb_.residuals_with_rest);
    if (!turns) return;
    found_.Add(H::kTurns, turns->words,
               [turns = *turns](engine::UnexplainedRest* rest) { NameTurnFirst(turns, rest); });
  }

  void AskMovingObject() {
    const std::optional<MovingObject> moving =
        FindMovingObject(observations_, ladder_.prediction, climb_.residuals_with_rest);
    if (!moving) return;
    found_.Add(H::kMovingObject, moving->words, [this, moving = *moving](engine::UnexplainedRest* rest) {
      NameMotionFirst(observations_, moving, rest);
    });
  }

  void AskRounds() {
    const double sigma_s = ladder_.noise_floor.sigma;
    rounds_ = FindRoundStructure(observations_, ladder_.prediction, ladder_.residuals);
    if (SharesRounds(rounds_, sigma_s))
      found_.Add(H::kRemounted, RoundsInWords(rounds_, sigma_s),
                 [this](engine::UnexplainedRest* rest) { NameRoundFirst(rounds_, rest); });
  }

  void AskTicks() {
    const touches::TouchTicks ticks = touches::FindTouchTicks(observations_);
    if (!ticks.in_part()) return;
    found_.Add(
        Hypothesis::kTicks,
        absl::StrFormat("The times of %d of %d touches lie on ticks of %s, those of the others do not: "
                        "they were read in two ways.",
                        ticks.touches, ticks.compared, TimeInWords(ticks.interval_s)));
  }

  // The errors of the improved model.
  absl::Status SetFinal() {
    TOUCHSTONE_ASSIGN_OR_RETURN(left_, QualityOf(workspace_, *climb_.searched, ladder_.residuals));
    ladder_.final = left_;
    TOUCHSTONE_ASSIGN_OR_RETURN(const double final_s, ErrorAsCompared(workspace_, ladder_.improved));
    SetError(final_s, &ladder_.final);
    if (engine::KeepGivenIfWorse(*workspace_.input.model, climb_.before, ladder_.final, &ladder_))
      ladder_.final = climb_.before;
    return absl::OkStatus();
  }

  void AskSetAside() {
    ladder_.set_aside = AssessTouchesSetAside(observations_, ladder_.residuals, ladder_.final.rmse,
                                              ladder_.noise_floor.sigma);
    if (ladder_.set_aside.is_finding) found_.Add(H::kSetAside, ladder_.set_aside.words);
  }

  const model::EffectInstance* GivenSurface() const {
    for (const model::EffectInstance& e : workspace_.input.model->effects)
      if (e.effect->role == model::EffectRole::kSmoothError) return &e;
    return nullptr;
  }

  // Bumps of the surface may be the last step, where nothing else accounts for them.
  absl::Status AskSurface() {
    if (selection_.fit.hypothesis == 0) return absl::OkStatus();
    const double gain_nats = selection_.surface_error.gain_nats;
    const bool misfit = left_.lack_of_fit_p < kLadderRules.misfit_p;
    if (!(gain_nats > kLadderRules.surface || (misfit && gain_nats > kLadderRules.surface_with_misfit)))
      return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(const SurfaceSupport support, FindSurfaceSupport(workspace_, selection_.fit));
    const model::EffectInstance* given = GivenSurface();
    const double rms_m = selection_.surface_error.rms_m;
    // The model may say that surfaces are as wrong as this.
    const bool as_given = given != nullptr && rms_m < kLadderRules.same_surface * given->values[0];
    if (as_given || support.IsSurface()) {
      left_.lack_of_fit_p = QualityWithoutSurface(workspace_, selection_.fit).lack_of_fit_p;
      ladder_.surface_as_given = as_given;
      if (as_given) return absl::OkStatus();
      if (given == nullptr)
        return AddSurfaceStep(workspace_, selection_, support, left_.lack_of_fit_p, &ladder_);
      RefitSurfaceError(selection_.surface_error, &ladder_);
      return absl::OkStatus();
    }
    if (gain_nats > kLadderRules.surface && support.IsElsewhere())
      found_.Add(H::kUnplaced, support.WordsOfRest());
    return absl::OkStatus();
  }

  // Of the mean square error that is no noise, what the steps take away.
  double ExplainedShare() const {
    return engine::ExplainedShare(
        touches::Rmse(observations_, touches::Residuals(observations_, workspace_.nominal)), left_.rmse,
        ladder_.noise_floor.sigma);
  }

  absl::Status AddPosterior() {
    engine::Fit open = climb_.fit;
    if (const auto everything = WithEverythingFree(climb_.fit, ladder_.improved)) {
      TOUCHSTONE_ASSIGN_OR_RETURN(open, engine::FitModel(workspace_.experiment, *everything, 0));
      TOUCHSTONE_ASSIGN_OR_RETURN(open, FitAll(workspace_, open, 0));
    }
    ladder_.posterior = PosteriorOf(workspace_, open, *climb_.searched, ladder_);
    return absl::OkStatus();
  }

  const Workspace& workspace_;
  const SelectionResult& selection_;
  Climb climb_;
  Ladder& ladder_;  // the climb's
  const touches::Observations& observations_;
  engine::Hypotheses found_{HypothesisRules()};
  engine::Quality left_;  // on the touches that the fits used: what the verdict is about
  RoundStructure rounds_;
  NoiseQuestions noise_{observations_, selection_, climb_.residuals_with_rest, &found_, &ladder_};
};

}  // namespace

absl::StatusOr<Ladder> BuildLadder(const Workspace& workspace, SelectionResult* selection) {
  for (;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(Climb climb, ClimbSteps(workspace, *selection));
    const int effect = climb.without_gain;
    if (effect < 0) {
      if (climb.with_formula || selection->formula < 0)
        return LadderBuilder(workspace, *selection, std::move(climb)).Build();
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool other, UseNearestFormula(workspace, selection));
      if (!other) return LadderBuilder(workspace, *selection, std::move(climb)).Build();
      TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(selection));
      continue;
    }
    // The selection's own index counts the formula's effect.
    const bool behind_formula = selection->formula >= 0 && effect >= selection->formula;
    TOUCHSTONE_RETURN_IF_ERROR(TakeOut(workspace, effect + behind_formula, selection));
    // What the step explained beside others is left over again.
    const bool has_rest =
        selection->formula >= 0 || selection->curve || selection->memory || selection->partial;
    TOUCHSTONE_RETURN_IF_ERROR(has_rest ? FitCurveAnew(workspace, selection)
                                        : CompeteWithCurves(workspace, selection));
    TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(selection));
  }
}

}  // namespace touchstone::diagnosis::selection
