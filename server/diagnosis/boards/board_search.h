// Which terms a lens needs: forward selection by evidence and by pictures that the fit did not see.
#pragma once

#include <vector>

#include "server/diagnosis/boards/board_fit.h"

namespace touchstone::diagnosis::boards {

// A lens with some of LensTerms() fitted.
struct LensChoice {
  std::vector<int> terms;  // indices, in the order of choice
  BoardFit fit;
  double log_evidence = 0;         // up to a constant: BIC over the readings, noise of unknown sigma
  std::vector<double> unseen_px2;  // by picture: UnseenSquares with a lens that was fitted without it
};

std::vector<int> FreeEntries(const std::vector<int>& terms);
LensChoice FitChoice(const BoardSet& set, const BoardFit& start, const std::vector<int>& terms);

// Whether the terms of `more` predict left-out pictures better than those of `less`, picture by picture.
bool PredictsBetter(const LensChoice& more, const LensChoice& less);

// Probability of at least as large a gain on left-out pictures by `more` as these pictures show, if `less` lacked nothing:
// Student's t over pictures of the logarithm of the ratio of the two errors, one-sided.
double LackOfFitP(const LensChoice& less, const LensChoice& more);

// From no term on, of those that are named or of all.
struct LensSearch {
  std::vector<LensChoice> ladder;  // no term, one term, ...
  std::vector<double> gain_nats;   // of each step
};
LensSearch SearchNamed(const BoardSet& set, const BoardFit& start);

double SumOf(const std::vector<double>& squares);

}  // namespace touchstone::diagnosis::boards
