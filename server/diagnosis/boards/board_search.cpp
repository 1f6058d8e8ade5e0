#include "server/diagnosis/boards/board_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/base/distributions.h"
#include "server/diagnosis/boards/board_diagnosis.h"

namespace touchstone::diagnosis::boards {
namespace {

// Of the mean over pictures of the logarithm of the ratio of two errors, in its standard errors.
constexpr double kMinPicturesAgree = 2;

bool Holds(const std::vector<int>& terms, int term) {
  return std::find(terms.begin(), terms.end(), term) != terms.end();
}

std::vector<int> Without(std::vector<int> terms, int term) {
  terms.erase(std::remove(terms.begin(), terms.end(), term), terms.end());
  return terms;
}

// Of the logarithm of a left-out picture's error, from one lens to the other.
struct MeanFall {
  double mean = 0, std_error = 0;
};

MeanFall MeanFallOf(const LensChoice& from, const LensChoice& to) {
  const double count = static_cast<double>(from.unseen_px2.size());
  double sum = 0, squares = 0;
  for (size_t i = 0; i < from.unseen_px2.size(); ++i) {
    const double fall = std::log((from.unseen_px2[i] + 1e-9) / (to.unseen_px2[i] + 1e-9));
    sum += fall, squares += fall * fall;
  }
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean) / (count - 1))};
}

}  // namespace

double SumOf(const std::vector<double>& squares) {
  return std::accumulate(squares.begin(), squares.end(), 0.0);
}

std::vector<int> FreeEntries(const std::vector<int>& terms) {
  std::vector<int> free;
  for (const int term : terms)
    free.insert(free.end(), LensTerms()[term].entries.begin(), LensTerms()[term].entries.end());
  return free;
}

LensChoice FitChoice(const BoardSet& set, const BoardFit& start, const std::vector<int>& terms) {
  const int pictures = static_cast<int>(set.pictures.size());
  const std::vector<int> free = FreeEntries(terms);
  LensChoice choice;
  choice.terms = terms;
  BoardFit from = start;
  // What is not free any more goes back to the nominal lens.
  for (int entry = 0; entry < kLensEntries; ++entry)
    if (std::find(free.begin(), free.end(), entry) == free.end()) from.lens[entry] = 0;
  choice.fit = FitBoards(set, from, free);
  const double readings = 2.0 * pictures * set.board.corners();
  // Corners that are met exactly (made up ones) have no likelihood: nothing is better than a thousandth of a pixel.
  const double variance = std::max(choice.fit.sum_px2 / readings, 1e-6);
  choice.log_evidence =
      -0.5 * readings * std::log(variance) - 0.5 * static_cast<double>(free.size()) * std::log(readings);
  for (int i = 0; i < pictures; ++i) {
    std::vector<double> others(pictures, 1.0);
    others[i] = 0;
    const BoardFit left_out = free.empty() ? choice.fit : FitBoards(set, choice.fit, free, others);
    choice.unseen_px2.push_back(UnseenSquares(set, left_out, i));
  }
  return choice;
}

bool PredictsBetter(const LensChoice& more, const LensChoice& less) {
  if (!(SumOf(more.unseen_px2) < SumOf(less.unseen_px2))) return false;
  const MeanFall fall = MeanFallOf(less, more);
  return fall.mean > kMinPicturesAgree * fall.std_error;
}

double LackOfFitP(const LensChoice& less, const LensChoice& more) {
  const MeanFall fall = MeanFallOf(less, more);
  if (!(fall.std_error > 0)) return fall.mean > 0 ? 0 : 1;
  return StudentTail(fall.mean / fall.std_error, static_cast<double>(more.unseen_px2.size()) - 1);
}

LensSearch SearchNamed(const BoardSet& set, const BoardFit& start) {
  LensSearch search;
  search.ladder.push_back(FitChoice(set, start, {}));
  for (;;) {
    const LensChoice& now = search.ladder.back();
    std::optional<LensChoice> best;
    for (int term = 0; term < static_cast<int>(LensTerms().size()); ++term) {
      if (!LensTerms()[term].named || Holds(now.terms, term)) continue;
      std::vector<int> terms = now.terms;
      terms.push_back(term);
      LensChoice tried = FitChoice(set, now.fit, terms);
      if (!best.has_value() || tried.log_evidence > best->log_evidence) best = std::move(tried);
    }
    if (!best.has_value()) break;
    const double gain = best->log_evidence - now.log_evidence;
    if (gain < kMinGainNats || !PredictsBetter(*best, now)) break;
    search.gain_nats.push_back(gain);
    search.ladder.push_back(std::move(*best));
  }
  // What the later steps have made needless goes, and the ladder is climbed anew without it.
  for (size_t k = 0; search.ladder.back().terms.size() > 1 && k < search.ladder.back().terms.size();) {
    const LensChoice& last = search.ladder.back();
    const std::vector<int> fewer = Without(last.terms, last.terms[k]);
    LensChoice without = FitChoice(set, last.fit, fewer);
    if (last.log_evidence - without.log_evidence >= kMinGainNats) {
      ++k;
      continue;
    }
    search.ladder.resize(1);
    search.gain_nats.clear();
    for (size_t count = 1; count <= fewer.size(); ++count) {
      search.ladder.push_back(FitChoice(set, search.ladder.back().fit,
                                        {fewer.begin(), fewer.begin() + static_cast<long>(count)}));
      search.gain_nats.push_back(search.ladder.back().log_evidence - search.ladder[count - 1].log_evidence);
    }
    k = 0;
  }
  return search;
}

}  // namespace touchstone::diagnosis::boards
