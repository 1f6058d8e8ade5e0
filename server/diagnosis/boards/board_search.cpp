#include "server/diagnosis/boards/board_search.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/boards/board_diagnosis.h"
#include "server/diagnosis/boards/rules.h"
#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::boards {
namespace {

// A gain is claimed where pictures agree on it: two standard errors over them; a share of the error is not asked, since a
// lens that is off by little shows in a few corners only.
engine::SearchRules RulesOfBoards() {
  engine::SearchRules rules;
  rules.enter_nats = rules.equivalent_nats = kBoardRules.min_gain_nats;
  rules.min_relative_cv_gain = 0;
  rules.min_cv_gain_std_errors = 2;
  return rules;
}

}  // namespace

BoardSearch::BoardSearch(std::unique_ptr<BoardRows> rows)
    : rows_(std::move(rows)), likelihood_(rows_->GroupRows(), nullptr, kBoardRules.floor_px, nullptr) {
  experiment_.observations = rows_.get();
  experiment_.likelihood = &likelihood_;
  likelihood_.SetEliminated(rows_->EliminatedValues());
  all_ = NamedLensEffects();
  for (auto& effect : NamelessLensEffects()) all_.push_back(std::move(effect));
}

absl::StatusOr<std::unique_ptr<BoardSearch>> BoardSearch::Make(const BoardSet& set,
                                                               const model::Model& given) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<BoardRows> rows, BoardRows::Make(set, given));
  return std::unique_ptr<BoardSearch>(new BoardSearch(std::move(rows)));
}

engine::StepwiseSearch BoardSearch::SearchAmong(const Effects& effects) const {
  std::vector<engine::Candidate> candidates;
  for (const auto& effect : effects) {
    engine::Candidate& candidate = candidates.emplace_back();
    candidate.effect = effect;
    candidate.nameless = effects::Catalogue().Find(effect->name) == nullptr;
  }
  return engine::StepwiseSearch(experiment_, std::move(candidates), RulesOfBoards(),
                                [](const std::string&) {});
}

absl::StatusOr<LensFit> BoardSearch::Measured(engine::Fit fit) const {
  LensFit lens;
  TOUCHSTONE_ASSIGN_OR_RETURN(lens.unseen_px2, engine::HeldOutSquaresRefitted(experiment_, fit));
  lens.fit = std::move(fit);
  return lens;
}

absl::StatusOr<std::vector<LensFit>> BoardSearch::Ladder(engine::Fit found, int first) const {
  std::vector<LensFit> ladder;
  for (;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(LensFit lens, Measured(std::move(found)));
    ladder.push_back(std::move(lens));
    const engine::Parameterization& model = ladder.back().fit.model;
    const int effects = static_cast<int>(model.base().effects.size());
    if (effects == first) break;
    TOUCHSTONE_ASSIGN_OR_RETURN(found, engine::FitModel(experiment_, model.Without(effects - 1)));
  }
  std::reverse(ladder.begin(), ladder.end());
  return ladder;
}

absl::StatusOr<std::vector<LensFit>> BoardSearch::FindNamed() const {
  TOUCHSTONE_ASSIGN_OR_RETURN(
      engine::Explanation found,
      SearchAmong(NamedLensEffects()).Run(engine::Parameterization(model::NominalModel(), {}), 0));
  return Ladder(std::move(found.fit), 0);
}

absl::StatusOr<std::vector<LensFit>> BoardSearch::FindNameless(const LensFit& lens) const {
  const int named = static_cast<int>(lens.fit.model.base().effects.size());
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation found,
                              SearchAmong(NamelessLensEffects()).Run(lens.fit.model, named));
  return Ladder(std::move(found.fit), named);
}

absl::StatusOr<LensFit> BoardSearch::FitAll(const LensFit& lens) const {
  engine::Parameterization model = lens.fit.model;
  for (const auto& effect : all_) {
    const std::vector<model::EffectInstance>& present = model.base().effects;
    if (std::none_of(present.begin(), present.end(),
                     [&](const model::EffectInstance& other) { return other.effect->name == effect->name; }))
      model.Add(effect, false);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit fit, engine::FitModel(experiment_, std::move(model)));
  return Measured(std::move(fit));
}

absl::StatusOr<std::vector<engine::SelectedStep>> BoardSearch::Compete(const LensFit& lens) const {
  return engine::FindCompetitors(SearchAmong(all_), {lens.fit, 0}, -1, {});
}

absl::StatusOr<engine::TriedPValues> BoardSearch::TryAll(uint64_t seed) const {
  const engine::StepwiseSearch search = SearchAmong(all_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const engine::GivenAndEffects tried,
                              engine::ColumnsOfEffects(search, model::NominalModel()));
  engine::LinearHypotheses hypotheses(rows_->EliminatedValues(), rows_->GroupRows());
  hypotheses.AddEffects(*rows_, tried.effects);
  Eigen::MatrixXd together(rows_->rows(), 0);
  for (const engine::EffectColumns& effect : tried.effects) {
    together.conservativeResize(Eigen::NoChange, together.cols() + effect.columns.cols());
    together.rightCols(effect.columns.cols()) = effect.columns;
  }
  hypotheses.Add(together);
  const Eigen::VectorXd residual = tried.given.columns.values.col(0);
  if (residual.norm() < kBoardRules.floor_px * std::sqrt(static_cast<double>(rows_->rows())))
    return engine::AgreeingPValues(hypotheses.size());
  return hypotheses.PValues(engine::DataAndNoise(*rows_, residual, seed));
}

double LackOfFitP(const LensFit& less, const LensFit& more) {
  const engine::HeldOutFall fall =
      engine::FallOfHeldOut(less.unseen_px2, more.unseen_px2, kBoardRules.floor_px * kBoardRules.floor_px);
  if (!(fall.std_error > 0)) return fall.mean > 0 ? 0 : 1;
  return StudentTail(fall.mean / fall.std_error, static_cast<double>(more.unseen_px2.size()) - 1);
}

}  // namespace touchstone::diagnosis::boards
