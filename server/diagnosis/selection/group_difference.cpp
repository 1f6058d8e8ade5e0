#include "server/diagnosis/selection/group_difference.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/base/text/readable_time.h"
#include "server/base/text/value_text.h"
#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/session/repeats.h"
#include "server/diagnosis/selection/session/round_structure.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/diagnosis/selection/session/session_parts.h"
#include "server/diagnosis/selection/session/time_structure.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kMinSumOfSquares = 1e-300;

// One effect in one part.
struct Difference {
  int effect = -1, part = -1;
  double gain_nats = 0;
  double explained = 0;
  int values = 0;
};

class DifferenceSearch {
 public:
  DifferenceSearch(const Workspace& workspace, const engine::GivenAndEffects& columns,
                   const SelectionResult& found)
      : workspace_(workspace),
        columns_(columns),
        found_(found),
        repeats_(*workspace.searched, *workspace.contrasts) {}

  absl::StatusOr<std::optional<GroupDifference>> Run() {
    if (repeats_.degrees() < kSelectionRules.min_difference_dof) return std::nullopt;
    const double given2 = repeats_.Centred(columns_.given.columns.values.col(0)).squaredNorm();
    // What files and meshes are rounded to has a pattern, and no cause.
    if (std::sqrt(given2 / repeats_.degrees()) < RoundingS(*workspace_.searched)) return std::nullopt;
    ListParts();
    // In the place of all that was found; else beside it, where that has a name: what a curve misses is no part.
    std::vector<Difference> all = TryAll(columns_.given);
    if (all.empty() ||
        all[0].gain_nats < kSelectionRules.ahead + NatsOfFound(parts_[all[0].part].of_rounds)) {
      if (found_.formula >= 0 || NamelessNats() > 0) return std::nullopt;
      all = TryAll(found_.fit);
      if (all.empty() || all[0].gain_nats < kSelectionRules.ahead) return std::nullopt;
    }
    const double p = ChanceOf(all[0]);
    if (p > (parts_[all[0].part].of_rounds ? kSelectionRules.difference_p.value()
                                           : kSelectionRules.stretch_p.value()))
      return std::nullopt;
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool otherwise, SomethingElse(all[0]));
    if (otherwise) return std::nullopt;
    return Describe(all, p);
  }

 private:
  void ListParts() {
    const touches::Observations& searched = *workspace_.searched;
    parts_ = ListSessionParts(*workspace_.observations);
    std::vector<int> touch_of_row(workspace_.input.set->size(), -1);
    for (int k = 0; k < workspace_.observations->size(); ++k)
      touch_of_row[workspace_.observations->row[k]] = k;
    for (const SessionPart& part : parts_) {
      std::vector<char>& has = has_.emplace_back();
      for (const int k : workspace_.contrasts->touches())
        has.push_back(part.has[touch_of_row[searched.row[k]]]);
    }
  }

  double Nats(double before, double after, double values) const {
    return 0.5 * repeats_.degrees() * std::log(before / after) - 0.5 * values * std::log(repeats_.degrees());
  }

  // Of what repeats differ by under the given model, what a fit takes off. Beside an effect of the touch before, every value of a
  // pose differs a little within poses.
  double NatsOf(const engine::Fit& fit) const {
    const Eigen::MatrixXd& columns = fit.columns.values;
    return Nats(repeats_.Centred(columns_.given.columns.values.col(0)).squaredNorm(),
                std::max(repeats_.Centred(columns.col(0)).squaredNorm(), kMinSumOfSquares),
                repeats_.DegreesTaken(columns.rightCols(columns.cols() - 1)));
  }

  // Of the whole explanation. Against rounds, which are known beforehand, a curve pays for each of its knots; against a stretch
  // that was picked as freely, for its choice.
  double NatsOfFound(bool against_rounds) const {
    const double named = NatsOf(found_.without_formula), nameless = NamelessNats();
    if (found_.formula < 0) return named + nameless;
    double price = found_.search->rules().complexity_penalty_nats;
    if (found_.curve && against_rounds) {
      const double values =
          static_cast<double>(found_.curve->knots.size()) * (workspace_.searched->fingers - 1);
      price = 0.5 * values * std::log(repeats_.degrees());
    }
    return std::max(named + nameless, NatsOf(found_.fit) - price);
  }

  // What has no name, stands in no fit, and may say the same.
  double NamelessNats() const {
    double nats = 0;
    if (found_.curve && found_.formula < 0) nats = std::max(nats, found_.curve->gain_nats);
    if (found_.memory) nats = std::max(nats, found_.memory->gain_nats);
    if (found_.partial) nats = std::max(nats, found_.partial->gain_nats);
    return nats;
  }

  bool IsTried(const engine::EffectColumns& effect) const {
    return effect.shared < 0 && effect.extension.object.empty() && !effect.extension.nameless &&
           effect.columns.cols() > 0;
  }

  Eigen::MatrixXd ColumnsOf(const Difference& d) const {
    return repeats_.Centred(repeats_.Only(columns_.effects[d.effect].columns, has_[d.part]));
  }

  // Every effect in every part beside `fit`, the best first.
  std::vector<Difference> TryAll(const engine::Fit& fit) {
    base_ = &fit;
    residuals_ = repeats_.Centred(fit.columns.values.col(0));
    std::vector<Difference> tried;
    const double before = residuals_.squaredNorm();
    for (int effect = 0; effect < static_cast<int>(columns_.effects.size()); ++effect) {
      if (!IsTried(columns_.effects[effect])) continue;
      const double whole = columns_.effects[effect].columns.squaredNorm();
      for (int part = 0; part < static_cast<int>(parts_.size()); ++part) {
        Difference d{effect, part, 0, 0, static_cast<int>(columns_.effects[effect].columns.cols())};
        const Eigen::MatrixXd columns = ColumnsOf(d);
        if (!(columns.squaredNorm() > kSelectionRules.visible * whole)) continue;
        const Eigen::VectorXd right = columns.transpose() * residuals_;
        d.explained = right.dot(SymmetricSolver(columns.transpose() * columns).Solve(right));
        if (!(d.explained > 0)) continue;
        d.gain_nats = Nats(before, std::max(before - d.explained, kMinSumOfSquares), d.values);
        tried.push_back(d);
      }
    }
    tries_ = static_cast<double>(tried.size());
    for (Difference& d : tried) d.gain_nats -= std::log(tries_);
    std::stable_sort(tried.begin(), tried.end(),
                     [](const Difference& a, const Difference& b) { return a.gain_nats > b.gain_nats; });
    return tried;
  }

  // P of such a difference by chance, over all that was tried. Touches of each pose in other orders give what the columns
  // explain of mere scatter: noise that grows on slopes, has tails or moves all fingers together stays with its poses. The
  // degrees of freedom are those that its mean and variance have (Satterthwaite).
  double ChanceOf(const Difference& d) const {
    const Eigen::MatrixXd columns = ColumnsOf(d);
    const double rest = residuals_.squaredNorm() - d.explained, dof = repeats_.degrees() - d.values;
    if (!(dof > 0) || !(rest > 0)) return 1;
    const Scatter scatter = ExplainedInOtherOrders(columns);
    const double mean = std::max(scatter.mean, d.values * rest / dof);
    const double effective =
        scatter.variance > 0
            ? std::clamp(2 * scatter.mean * scatter.mean / scatter.variance, 1.0, 1.0 * d.values)
            : 1;
    return std::min(1.0, FisherTail(d.explained / mean, effective, dof) * tries_);
  }

  // Of the squares that the columns explain of what they leave once touches have changed places.
  struct Scatter {
    double mean = 0, variance = 0;
  };
  Scatter ExplainedInOtherOrders(const Eigen::MatrixXd& columns) const {
    const Eigen::MatrixXd basis = ColumnSpan(columns).Basis();
    const Eigen::VectorXd left = residuals_ - basis * (basis.transpose() * residuals_);
    RandomStream random(workspace_.input.seed, RandomDomain::kDiagnosis);
    double sum = 0, sum2 = 0;
    for (int n = 0; n < kSelectionRules.orders; ++n) {
      const double explained = (basis.transpose() * repeats_.Shuffled(left, &random)).squaredNorm();
      sum += explained, sum2 += explained * explained;
    }
    const double mean = sum / kSelectionRules.orders;
    return {mean, (sum2 - sum * mean) / (kSelectionRules.orders - 1)};
  }

  // An object that lay elsewhere in every round, or what changes slowly: a part is not the whole of it.
  absl::StatusOr<bool> SomethingElse(const Difference& d) const {
    const touches::Observations& o = *workspace_.searched;
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                                workspace_.searched_predictor->Run(base_->model.base(), true, false));
    const std::vector<double> residuals = touches::Residuals(o, details);
    const RoundStructure rounds = FindRoundStructure(o, details, residuals);
    if (rounds.p < kSelectionRules.difference_p && rounds.gain_nats > d.gain_nats) return true;
    const Eigen::MatrixXd columns = repeats_.Only(columns_.effects[d.effect].columns, has_[d.part]);
    const std::vector<double> corrected = workspace_.contrasts->PerFinger(
        base_->columns.values.col(0) - columns * SolutionOf(d), o.time_s.size());
    return FindTimeStructure(o, corrected).p < kSessionRules.time_p;
  }

  Eigen::VectorXd SolutionOf(const Difference& d) const {
    return SolveLeastSquares(ColumnsOf(d), residuals_);
  }

  absl::StatusOr<std::optional<GroupDifference>> Describe(const std::vector<Difference>& all,
                                                          double p) const {
    const Difference& best = all[0];
    TOUCHSTONE_ASSIGN_OR_RETURN(const Fitted fitted, FitIn(best));
    GroupDifference found;
    found.effect = NameOf(best);
    found.part = parts_[best.part].words;
    found.test = {parts_[best.part].of_rounds ? "round" : "touch", p, best.gain_nats};
    found.more = ValuesOf(best, fitted);
    const touches::Observations& o = *workspace_.observations;
    for (int k = 0; k < o.size(); ++k)
      if (parts_[best.part].has[k]) found.rows.push_back(o.row[k]);
    std::vector<std::string> places = {found.part};
    for (const Difference& other : all) {
      if (other.gain_nats < best.gain_nats - kSelectionRules.same) break;
      if (other.part == best.part && other.effect != best.effect &&
          found.also.size() < kSelectionRules.max_also)
        found.also.push_back(NameOf(other));
      if (other.effect == best.effect && other.part != best.part &&
          places.size() < kSelectionRules.max_parts_named)
        places.push_back(parts_[other.part].words);
    }
    found.words = InWords(found, places, best, fitted.left);
    return found;
  }

  std::string NameOf(const Difference& d) const { return columns_.effects[d.effect].extension.name; }

  // The effect in that part, fitted with the simulator in the loop: its response is no line.
  struct Fitted {
    engine::Parameterization start;  // where it changes nothing
    Eigen::VectorXd more;            // beyond the start's last values
    Eigen::MatrixXd columns;         // centred, there
    Eigen::VectorXd left;            // residuals, centred
  };
  absl::StatusOr<Fitted> FitIn(const Difference& d) const {
    const engine::EffectColumns& effect = columns_.effects[d.effect];
    Fitted fitted{effect.extension.start, SolutionOf(d), ColumnsOf(d), {}};
    fitted.left = residuals_ - fitted.columns * fitted.more;
    if (effect.extension.candidate < 0) return fitted;
    fitted.start = base_->model;
    fitted.start.Add(found_.search->candidates()[effect.extension.candidate].effect, false);
    const std::vector<char>& has = has_[d.part];
    const Eigen::VectorXd elsewhere =
        base_->columns.values.col(0) - repeats_.Only(base_->columns.values.leftCols(1), has);
    for (int step = 0; step < kSelectionRules.part_steps; ++step) {
      engine::Parameterization there = fitted.start;
      Eigen::VectorXd point = there.Start();
      point.tail(d.values) += fitted.more;
      const Eigen::VectorXd within = there.Clip(point);
      // A value beyond its bounds, as less of what the given model has, is known by the line alone.
      if (within != point) break;
      there.MoveTo(within);
      TOUCHSTONE_ASSIGN_OR_RETURN(const engine::Fit at,
                                  engine::FitModel(workspace_.experiment, std::move(there), 0));
      const Eigen::VectorXd left =
          repeats_.Centred(elsewhere + repeats_.Only(at.columns.values.leftCols(1), has));
      if (step > 0 && left.squaredNorm() > fitted.left.squaredNorm()) break;
      fitted.left = left;
      fitted.more = at.point.tail(d.values) - fitted.start.Start().tail(d.values);
      fitted.columns = repeats_.Centred(repeats_.Only(at.columns.values.rightCols(d.values), has));
      if (step + 1 < kSelectionRules.part_steps) fitted.more += SolveLeastSquares(fitted.columns, left);
    }
    return fitted;
  }

  // The difference of the effect's values, in the units of files.
  std::vector<engine::ParameterEstimate> ValuesOf(const Difference& d, const Fitted& fitted) const {
    const engine::Parameterization& start = fitted.start;
    const double variance = fitted.left.squaredNorm() / (repeats_.degrees() - d.values);
    const int size = start.size(), own = size - d.values;
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
    covariance.bottomRightCorner(d.values, d.values) =
        variance * SymmetricSolver(fitted.columns.transpose() * fitted.columns)
                       .SolveColumns(Eigen::MatrixXd::Identity(d.values, d.values));
    Eigen::VectorXd point = start.Start();
    const int effect = start.parameters()[own].effect;
    const std::vector<engine::ParameterEstimate> rest = start.Describe(effect, point, covariance);
    point.tail(d.values) += fitted.more;
    std::vector<engine::ParameterEstimate> there = start.Describe(effect, point, covariance);
    for (size_t i = 0; i < there.size(); ++i) there[i].value -= rest[i].value;
    return there;
  }

  // Of what the touches of the part scatter by more than the others, the share that the effect leaves.
  double ExcessLeft(const Difference& d, const Eigen::VectorXd& left) const {
    const std::vector<char>& has = has_[d.part];
    const double share = static_cast<double>(std::count(has.begin(), has.end(), 1)) / has.size();
    const double before = repeats_.Only(residuals_, has).squaredNorm();
    const double after = repeats_.Only(left, has).squaredNorm();
    const double noise = share / (1 - share) * (left.squaredNorm() - after);
    return share < 1 && before > noise ? (after - noise) / (before - noise) : 0;
  }

  // Whether the touches of the part scatter more than the others under the effect that describes it.
  bool IsMoreThan(const Difference& d, const Eigen::VectorXd& left) const {
    const std::vector<char>& has = has_[d.part];
    const double share = static_cast<double>(std::count(has.begin(), has.end(), 1)) / has.size();
    const double there = repeats_.Only(left, has).squaredNorm(), elsewhere = left.squaredNorm() - there;
    const double dof = share * repeats_.degrees() - d.values, others = (1 - share) * repeats_.degrees();
    return dof >= 1 && elsewhere > 0 &&
           FisherTail(there / dof / (elsewhere / others), dof, others) < kSelectionRules.rest_is_more_p;
  }

  std::string InWords(const GroupDifference& found, const std::vector<std::string>& places,
                      const Difference& d, const Eigen::VectorXd& left) const {
    std::vector<std::string> values;
    for (const engine::ParameterEstimate& value : found.more)
      if (std::abs(value.value) > kSelectionRules.clear_errors * value.std_error)
        values.push_back(absl::StrCat(
            value.name, value.entry.empty() ? "" : " ", value.entry, value.value > 0 ? " +" : " ",
            ValueWithError(value.value, value.std_error), value.unit.empty() ? "" : " ", value.unit));
    const auto scatter = [&](double squares) { return TimeInWords(std::sqrt(squares / repeats_.degrees())); };
    std::string words = absl::StrCat("Something was other ", absl::StrJoin(places, ", or "));
    if (values.empty() || left.squaredNorm() > kSelectionRules.max_left * residuals_.squaredNorm() ||
        ExcessLeft(d, left) > kSelectionRules.max_excess_left) {
      absl::StrAppend(&words, ", and no effect says what: touches of one pose differ by ",
                      scatter(residuals_.squaredNorm()), " where those are among them");
    } else {
      absl::StrAppend(&words, ": ", found.effect, " differs there by ", absl::StrJoin(values, ", "));
      if (!found.also.empty())
        absl::StrAppend(&words, " (", absl::StrJoin(found.also, ", "),
                        found.also.size() > 1 ? " say" : " says", " nearly the same)");
      absl::StrAppend(
          &words, ". Touches of one pose differ by ", scatter(residuals_.squaredNorm()), ", and by ",
          scatter(left.squaredNorm()), " once it is taken off",
          IsMoreThan(d, left)
              ? "; that is not the whole of it, for those touches still differ by more than the others"
              : "");
    }
    absl::StrAppend(&words,
                    ". Find what changed, or measure those touches again: everything else "
                    "here was found on the other touches.");
    if (parts_[d.part].of_rounds && workspace_.input.set->round.empty())
      absl::StrAppend(&words, " Round 0 is the first touch of each pose.");
    return words;
  }

  const Workspace& workspace_;
  const engine::GivenAndEffects& columns_;
  const SelectionResult& found_;
  const Repeats repeats_;
  std::vector<SessionPart> parts_;
  std::vector<std::vector<char>> has_;  // of each part, by touch of the contrasts
  const engine::Fit* base_ = nullptr;   // that differences are tried beside
  Eigen::VectorXd residuals_;           // its own, centred
  double tries_ = 1;
};

}  // namespace

absl::StatusOr<std::optional<GroupDifference>> FindGroupDifference(const Workspace& workspace,
                                                                   const engine::GivenAndEffects& columns,
                                                                   const SelectionResult& found) {
  return DifferenceSearch(workspace, columns, found).Run();
}

}  // namespace touchstone::diagnosis::selection
