#include "server/diagnosis/selection/search.h"

#include <Eigen/Cholesky>

#include <absl/strings/str_cat.h>
#include <boost/math/special_functions/gamma.hpp>

#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/base/status.h"

namespace touchstone {
namespace {

constexpr int kFolds = 5;
constexpr double kNearForecast = 40;  // nats: candidates this far behind the best forecast are not fitted
constexpr double kVisible = 1e-9;     // s of change at the typical size
constexpr int kFormulaStarts = 8;

// P(chi^2_q > x)
double ChiSquaredTail(double x, int q) {
  if (x <= 0 || q <= 0) return 1;
  return boost::math::gamma_q(0.5 * q, 0.5 * x);
}

}  // namespace

bool Search::Accepts(const Fit& before, const Fit& after, size_t moves) const {
  // So few numbers are followed by anything.
  if (experiment_.contrasts->rows() < rules_.min_rows_a_value * (after.model.size() + 1)) return false;
  if (after.evidence - before.evidence < rules_.enter_nats) return false;
  const double ratio = 2 * (after.log_likelihood - before.log_likelihood);
  const int added = std::max(after.model.size() - before.model.size(), 1);
  if (static_cast<double>(moves) * ChiSquaredTail(ratio, added) > rules_.family_wise_p) return false;
  return HeldoutRmse(after) < (1 - rules_.practical) * HeldoutRmse(before);
}

double Search::HeldoutRmse(const Fit& fit) const {
  const Contrasts& contrasts = *experiment_.contrasts;
  const Observations& o = *experiment_.observations;
  const Eigen::MatrixXd& columns = fit.columns.values;
  const int n = static_cast<int>(columns.rows()), p = fit.model.size();
  if (n == 0) return 0;
  const Eigen::VectorXd r = columns.col(0);
  if (p == 0) return std::sqrt(r.squaredNorm() / n);

  // Left out by object; by pose where objects are few or have values of their own.
  const bool own_values = std::any_of(fit.model.coordinates().begin(), fit.model.coordinates().end(),
                                      [](const Coordinate& c) { return !c.object.empty(); });
  const bool by_object = o.objects.size() >= 3 && !own_values;
  const int folds = by_object ? static_cast<int>(o.objects.size()) : kFolds;
  std::vector<std::vector<int>> rows(folds);
  for (int row = 0; row < n; ++row) {
    const int k = contrasts.touches()[contrasts.touch_of_row()[row]];
    rows[by_object ? o.object[k] : o.pose[k] % kFolds].push_back(row);
  }
  const Eigen::MatrixXd j = columns.rightCols(p);
  const Eigen::MatrixXd all = j.transpose() * j;
  const Eigen::VectorXd target = j.transpose() * r;
  const double variance = r.squaredNorm() / n;
  double sum = 0;
  for (const std::vector<int>& fold : rows) {
    if (fold.empty()) continue;
    Eigen::MatrixXd jf(fold.size(), p);
    Eigen::VectorXd rf(fold.size());
    for (size_t k = 0; k < fold.size(); ++k) jf.row(k) = j.row(fold[k]), rf[k] = r[fold[k]];
    Eigen::MatrixXd rest = all - jf.transpose() * jf;
    for (int i = 0; i < p; ++i) {
      const double scale = fit.model.coordinates()[i].scale;
      rest(i, i) += variance / (scale * scale);  // what the other touches leave open stays where it is
    }
    const Eigen::VectorXd step = rest.ldlt().solve(target - jf.transpose() * rf);
    sum += (rf - jf * step).squaredNorm();
  }
  return std::sqrt(sum / n);
}

absl::StatusOr<std::vector<Move>> Search::Score(const Fit& fit, int given) const {
  std::vector<Move> moves;
  const Model& model = fit.model.base();
  for (int index = 0; index < given; ++index) {
    if (fit.model.IsFree(index) || IsRandomEffect(*model.effects[index].effect)) continue;
    Move move;
    move.name = NameOf(*model.effects[index].effect);
    move.start = fit.model;
    move.start.Free(index, true);
    moves.push_back(std::move(move));
  }
  for (int c = 0; c < static_cast<int>(candidates_.size()); ++c) {
    const std::string name = NameOf(*candidates_[c].effect);
    const bool present = std::any_of(model.effects.begin(), model.effects.end(),
                                     [&](const EffectInstance& e) { return NameOf(*e.effect) == name; });
    if (present) continue;
    Move move;
    move.candidate = c;
    move.name = name;
    move.start = fit.model;
    move.start.Add(candidates_[c].effect, candidates_[c].per_object);
    moves.push_back(std::move(move));
  }

  // One wide matrix: the residual, the fit's own columns, and every move's.
  const int own = fit.model.size();
  Likelihood::Columns all = fit.columns;
  std::vector<int> first_column;
  Eigen::MatrixXd wide(fit.columns.values.rows(), 0);
  for (Move& move : moves) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd columns,
                                Derivatives(experiment_, move.start, move.start.Start(), fit.time_s, own));
    first_column.push_back(1 + own + static_cast<int>(wide.cols()));
    const int at = static_cast<int>(wide.cols());
    wide.conservativeResize(Eigen::NoChange, at + columns.cols());
    wide.rightCols(columns.cols()) = columns;
    for (int i = 0; i < columns.cols(); ++i)
      move.visible |= columns.col(i).norm() * move.start.coordinates()[own + i].scale >
                      kVisible * std::sqrt(static_cast<double>(columns.rows()));
  }
  const Likelihood& likelihood = *experiment_.likelihood;
  all = Likelihood::Join(all, likelihood.Prepare(wide));
  std::vector<Eigen::MatrixXd> grams(likelihood.surfaces().size());
  const auto gram = [&](int begin, int end) {
    for (int s = begin; s < end; ++s) grams[s] = likelihood.Gram(all, s);
  };
  ParallelFor(experiment_.pool, static_cast<int>(grams.size()), 4, gram);

  const auto judge = [&](int begin, int end) {
    for (int m = begin; m < end; ++m) {
      Move& move = moves[m];
      std::vector<int> members;
      for (int i = 0; i <= own; ++i) members.push_back(i);
      for (int i = own; i < move.start.size(); ++i) members.push_back(first_column[m] + i - own);
      move.evidence =
          Judge(likelihood, grams, members, move.start.coordinates(), move.start.Start()).evidence;
    }
  };
  ParallelFor(experiment_.pool, static_cast<int>(moves.size()), 1, judge);
  return moves;
}

absl::StatusOr<Fit> Search::FitMove(const Move& move) const {
  std::vector<FreeModel> starts = {move.start};
  const Effect* effect = move.candidate >= 0 ? candidates_[move.candidate].effect.get() : nullptr;
  const int size = move.start.size();
  if (effect != nullptr && move.start.coordinates().back().inverse) {
    // A ramp that ends before the first contact leaves no trace: start where it does not.
    const Observations& o = *experiment_.observations;
    const double speed_m_s = o.set->speed_m_s[o.row[0]], travel_m = o.set->standoff_m[o.row[0]];
    for (const double share : {0.7, 1.3}) {
      Eigen::VectorXd point = move.start.Start();
      point[size - 1] = 2 * share * travel_m / (speed_m_s * speed_m_s);
      starts.push_back(move.start);
      starts.back().MoveTo(starts.back().Clip(point));
    }
  }
  if (effect != nullptr && effect->formula != nullptr && candidates_[move.candidate].of_user) {
    // Nothing is known of a user's formula: starts all over its bounds.
    for (int k = 0; k < kFormulaStarts; ++k) {
      Eigen::VectorXd point = move.start.Start();
      RandomStream random(k, RandomDomain::kDiagnosis, 77);
      for (int i = 0; i < size; ++i) {
        const Coordinate& c = move.start.coordinates()[i];
        if (c.effect == static_cast<int>(move.start.base().effects.size()) - 1)
          point[i] = random.Uniform(c.lower, c.upper);
      }
      starts.push_back(move.start);
      starts.back().MoveTo(point);
    }
  }
  absl::StatusOr<Fit> best = absl::InternalError("no fit");
  for (FreeModel& start : starts) {
    absl::StatusOr<Fit> fit = FitModel(experiment_, std::move(start));
    if (!fit.ok() && fit.status().code() == absl::StatusCode::kCancelled) return fit;
    if (fit.ok() && (!best.ok() || fit->evidence > best->evidence)) best = std::move(fit);
    if (!best.ok() && !fit.ok()) best = fit.status();
  }
  return best;
}

absl::StatusOr<bool> Search::Grow(Explanation* explanation) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Move> moves, Score(explanation->fit, explanation->given));
  std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) { return a.evidence > b.evidence; });
  absl::StatusOr<Fit> best = absl::NotFoundError("");
  int fitted = 0;
  for (const Move& move : moves) {
    const bool ramp = !move.visible && move.start.coordinates().back().inverse;
    const bool user = move.candidate >= 0 && candidates_[move.candidate].of_user;
    const bool near = move.visible && fitted < rules_.max_refits &&
                      move.evidence > moves[0].evidence - kNearForecast &&
                      move.evidence > explanation->fit.evidence;
    if (!near && !ramp && !user) continue;
    progress_(absl::StrCat("fitting ", move.name));
    fitted += near;
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit, FitMove(move));
    if (!best.ok() || fit.evidence > best->evidence) best = std::move(fit);
  }
  if (!best.ok() || !Accepts(explanation->fit, *best, moves.size())) return false;
  explanation->fit = *std::move(best);
  return true;
}

absl::StatusOr<Fit> Search::WithoutEffect(const Explanation& explanation, int index) const {
  // Other effects of the given model stay as free as they are.
  return FitModel(experiment_, explanation.fit.model.Without(index));
}

absl::StatusOr<bool> Search::Shrink(Explanation* explanation) const {
  for (int index = static_cast<int>(explanation->fit.model.base().effects.size()) - 1;
       index >= explanation->given; --index) {
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit, WithoutEffect(*explanation, index));
    if (explanation->fit.evidence - fit.evidence >= rules_.enter_nats) continue;
    explanation->fit = std::move(fit);
    return true;
  }
  return false;
}

absl::StatusOr<std::vector<Alternative>> Search::Alternatives(const Explanation& explanation,
                                                              int index) const {
  const Effect& own = *explanation.fit.model.base().effects[index].effect;
  // The other effects stay where they are: what takes this one's place finds them so.
  TOUCHSTONE_ASSIGN_OR_RETURN(const Fit without,
                              FitModel(experiment_, explanation.fit.model.Without(index), 0));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Move> moves, Score(without, explanation.given));
  std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) { return a.evidence > b.evidence; });
  std::vector<Alternative> alternatives;
  alternatives.push_back(
      {NameOf(own), explanation.fit.model.base().effects[index].per_object, explanation.fit});
  int fitted = 0;
  for (const Move& move : moves) {
    if (move.candidate < 0 || !move.visible || fitted >= rules_.max_refits) continue;
    if (move.name == NameOf(own) &&
        candidates_[move.candidate].per_object == explanation.fit.model.base().effects[index].per_object)
      continue;
    if (move.evidence < explanation.fit.evidence - kNearForecast) continue;
    progress_(absl::StrCat("trying ", move.name, " instead of ", NameOf(own)));
    ++fitted;
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit, FitMove(move));
    alternatives.push_back({move.name, candidates_[move.candidate].per_object, std::move(fit)});
  }
  std::sort(alternatives.begin() + 1, alternatives.end(),
            [](const Alternative& a, const Alternative& b) { return a.fit.evidence > b.fit.evidence; });
  return alternatives;
}

absl::StatusOr<bool> Search::Exchange(Explanation* explanation) const {
  for (int index = explanation->given; index < static_cast<int>(explanation->fit.model.base().effects.size());
       ++index) {
    if (explanation->fit.model.base().effects[index].effect->formula != nullptr) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Alternative> alternatives, Alternatives(*explanation, index));
    if (alternatives.size() < 2 || alternatives[1].fit.evidence <= explanation->fit.evidence + 0.5) continue;
    explanation->fit = std::move(alternatives[1].fit);
    return true;
  }
  return false;
}

absl::StatusOr<Explanation> Search::Run(FreeModel start, int given) const {
  Explanation explanation;
  explanation.given = given;
  TOUCHSTONE_ASSIGN_OR_RETURN(explanation.fit, FitModel(experiment_, std::move(start)));
  for (int step = 0; step < rules_.max_steps; ++step) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool grown, Grow(&explanation));
    if (!grown) break;
    // Two true effects together may have let in a third that mixes them.
    if (explanation.fit.model.base().effects.size() < 2) continue;
    for (int tries = 0; tries < 3; ++tries) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool exchanged, Exchange(&explanation));
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool shrunk, Shrink(&explanation));
      if (!exchanged && !shrunk) break;
    }
  }
  return explanation;
}

}  // namespace touchstone
