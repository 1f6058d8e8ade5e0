// Which effects a lens needs, by the search of the engine: the catalogue's first, then those that have no name.
#pragma once

#include <memory>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/boards/board_rows.h"
#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/engine/nothing_missing.h"

namespace touchstone::diagnosis::boards {

// A lens with some effects, in the order in which they were found.
struct LensFit {
  engine::Fit fit;
  std::vector<double> unseen_px2;  // by picture: UnseenSquares with a lens that was fitted without it
};

class BoardSearch {
 public:
  // Errors, and what must outlive it, as BoardRows::Make.
  static absl::StatusOr<std::unique_ptr<BoardSearch>> Make(const BoardSet& set, const model::Model& given);

  // From the nominal lens on, one effect of the catalogue more each.
  absl::StatusOr<std::vector<LensFit>> FindNamed() const;
  // From a lens on, one nameless effect more each.
  absl::StatusOr<std::vector<LensFit>> FindNameless(const LensFit& lens) const;
  // A lens with every effect, named or not.
  absl::StatusOr<LensFit> FitAll(const LensFit& lens) const;
  // What could take the place of each effect of a lens, with a name or without.
  absl::StatusOr<std::vector<engine::SelectedStep>> Compete(const LensFit& lens) const;
  // Every effect, named or not, and all of them together on the nominal lens. `seed`: of the noise that is drawn.
  absl::StatusOr<engine::TriedPValues> TryAll(uint64_t seed) const;

  // Of what a lens leaves: readings less the values of poses and lens.
  int DegreesOfFreedom(const LensFit& lens) const {
    return rows_->rows() - rows_->EliminatedValues() - lens.fit.model.size();
  }
  const engine::Experiment& experiment() const { return experiment_; }

 private:
  using Effects = std::vector<std::shared_ptr<const model::Effect>>;

  explicit BoardSearch(std::unique_ptr<BoardRows> rows);
  engine::StepwiseSearch SearchAmong(const Effects& effects) const;
  // The fits on the way from `first` effects of a model to all that a search has found.
  absl::StatusOr<std::vector<LensFit>> Ladder(engine::Fit found, int first) const;
  absl::StatusOr<LensFit> Measured(engine::Fit fit) const;

  std::unique_ptr<BoardRows> rows_;
  engine::Likelihood likelihood_;
  engine::Experiment experiment_;
  Effects all_;  // those of the catalogue, then the nameless ones
};

// Probability of at least as large a gain on left-out pictures by `more` as these pictures show, if `less` lacked nothing:
// Student's t over pictures of the logarithm of the ratio of the two errors, one-sided.
double LackOfFitP(const LensFit& less, const LensFit& more);

}  // namespace touchstone::diagnosis::boards
