#include "server/diagnosis/engine/detectability.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "server/base/distributions.h"
#include "server/base/normal.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/competition.h"
#include "server/diagnosis/engine/laplace_evidence.h"
#include "server/diagnosis/engine/resemblance.h"
#include "server/model/parameter_values.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr int kMaxSteps = 8;    // towards a size
constexpr double kNear = 0.02;  // of a size, where the steps end
constexpr double kMostOverTypical =
    20;  // sizes over what rigs show: farther off, touches meet other faces, or nothing
constexpr double kMaxGrowth = 30;       // of a size in one step
constexpr int kMaxRivalSteps = 6;       // of Gauss and Newton, to a rival's best values
constexpr double kRivalArrived = 0.05;  // standard errors
constexpr size_t kRivalsCompared = 4;   // by evidence, the most alike first
constexpr double kNoResponse = 1e-6;    // of the noise: rows that do not move
constexpr double kNoResemblance = 0.1;  // correlation of an effect that is no rival

// Columns of one extension among all.
struct Span {
  int extension = 0;
  int first = 0, count = 0;
};

// What an effect of one size leads to.
struct Expected {
  Eigen::VectorXd point;     // of the extension's parameters
  Eigen::VectorXd response;  // rows
  double ratio = 0;          // twice the gain in log likelihood, without noise
  double gain_nats = 0;      // in log evidence, likewise
  double log_evidence = 0, log_likelihood = 0;
  Eigen::MatrixXd covariance;  // of the parameters
  double power = 0;
};

class Detector {
 public:
  Detector(const StepwiseSearch& search, const Fit& given, int initial_effects, double sigma,
           const DetectionQuestion& question)
      : search_(search),
        experiment_(search.experiment()),
        given_(given),
        own_(given.model.size()),
        sigma_(sigma),
        initial_effects_(initial_effects),
        question_(question) {}

  absl::Status Prepare() {
    for (Extension& extension : search_.ListExtensions(given_, initial_effects_))
      if (!extension.rare && extension.object.empty() && !extension.nameless && extension.start.size() > own_)
        extensions_.push_back(std::move(extension));
    Eigen::MatrixXd wide(given_.columns.values.rows(), 0);
    for (size_t m = 0; m < extensions_.size(); ++m) {
      const Extension& extension = extensions_[m];
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const Eigen::MatrixXd columns,
          Derivatives(experiment_, extension.start, extension.start.Start(), given_.predicted, own_));
      spans_.push_back(
          {static_cast<int>(m), static_cast<int>(wide.cols()), static_cast<int>(columns.cols())});
      wide.conservativeResize(Eigen::NoChange, wide.cols() + columns.cols());
      wide.rightCols(columns.cols()) = columns;
    }
    std::vector<int> own(own_);
    std::iota(own.begin(), own.end(), 1);
    all_ = Likelihood::Join(Likelihood::Pick(given_.columns, own), likelihood().Prepare(wide));
    grams_ = Grams(likelihood(), all_);
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<DetectableValue>> Run() {
    std::vector<DetectableValue> values;
    std::set<std::string> seen;
    for (size_t m = 0; m < extensions_.size(); ++m) {
      const Extension& extension = extensions_[m];
      if (extension.candidate < 0 || !extension.start.parameters().back().object.empty() ||
          !seen.insert(extension.name).second ||
          (!question_.effect.empty() && extension.name != question_.effect))
        continue;
      for (int i = own_; i < extension.start.size(); ++i) {
        TOUCHSTONE_ASSIGN_OR_RETURN(DetectableValue value, ValueOf(static_cast<int>(m), i));
        values.push_back(std::move(value));
      }
    }
    return values;
  }

 private:
  const Likelihood& likelihood() const { return *experiment_.likelihood; }

  // What noise alone adds to the residual's inner product under hypothesis s.
  double NoiseSquares(int s) const {
    return sigma_ * sigma_ * (likelihood().rows() - likelihood().hypotheses()[s].effective_dof);
  }

  // The farthest that the parameter goes from its neutral value, and the way there.
  static double Reach(const FreeParameter& p, double* sign) {
    *sign = p.upper - p.neutral >= p.neutral - p.lower ? 1 : -1;
    return std::min(*sign > 0 ? p.upper - p.neutral : p.neutral - p.lower, kMostOverTypical * p.scale);
  }

  // The extension's parameters with value i at a size; the others at their start, or (`together`) at their typical sizes.
  Eigen::VectorXd PointAt(const Extension& extension, int i, double size, bool together) const {
    Eigen::VectorXd point = extension.start.Start();
    for (int j = own_; j < extension.start.size(); ++j) {
      const FreeParameter& p = extension.start.parameters()[j];
      double sign = 1;
      const double reach = Reach(p, &sign);
      if (j == i) point[j] = p.neutral + sign * std::min(size, reach);
      if (j != i && together) point[j] = p.neutral + sign * std::min(p.scale, reach);
    }
    return point;
  }

  // The thresholds of a search in twice the log likelihood. Held-out rows: their squares fall by the likelihood ratio less
  // what the fitted values cost on rows that they were not fitted to (those of one group in three, or of one part in five).
  double RatioNeeded(int values, double occam_nats) const {
    const SearchRules& rules = search_.rules();
    const double rows = likelihood().rows();
    const size_t tried = extensions_.size();
    const double groups = static_cast<double>(experiment_.observations->groups().size());
    const double cost = groups >= 3 ? groups / (groups - 1) : 1.25;
    const double kept = 1 - rules.min_relative_cv_gain;
    return std::max({2 * (rules.enter_nats + occam_nats),
                     ChiSquaredQuantile(1 - rules.family_wise_p / static_cast<double>(tried), values),
                     (1 - kept * kept) * rows + values * (1 + cost)});
  }

  absl::StatusOr<Expected> At(int m, int i, double size, bool together) const {
    const Extension& extension = extensions_[m];
    Expected e;
    e.point = PointAt(extension, i, size, together);
    const model::Model model = extension.start.At(e.point);
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                                experiment_.observations->Predict(model));
    e.response = experiment_.observations->Change(given_.predicted, predicted);
    // Before: nothing stands for the response. After: the effect stands where it acts, and leaves the noise.
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd own,
                                Derivatives(experiment_, extension.start, e.point, predicted, own_));
    const LaplaceEvidence before = Without(e.response);
    const Likelihood::Columns columns = likelihood().Prepare(own);
    std::vector<Eigen::MatrixXd> after;
    for (int s = 0; s < static_cast<int>(grams_.size()); ++s) {
      const int size_of = 1 + extension.start.size();
      Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(size_of, size_of);
      gram(0, 0) = NoiseSquares(s);
      gram.block(1, 1, own_, own_) = grams_[s].topLeftCorner(own_, own_);
      gram.bottomRightCorner(own.cols(), own.cols()) = likelihood().Gram(columns, s);
      if (own_ > 0) {
        const Eigen::MatrixXd cross = likelihood().Cross(OwnColumns(), columns, s);
        gram.block(1, 1 + own_, own_, own.cols()) = cross;
        gram.block(1 + own_, 1, own.cols(), own_) = cross.transpose();
      }
      after.push_back(std::move(gram));
    }
    const LaplaceEvidence with = ComputeLaplaceEvidence(
        likelihood(), after, InOrder(1 + extension.start.size()), extension.start.parameters(), e.point);
    e.log_evidence = with.log_evidence;
    e.log_likelihood = with.log_likelihood;
    e.covariance = with.covariance;
    e.gain_nats = with.log_evidence - before.log_evidence;
    e.ratio = std::max(2 * (with.log_likelihood - before.log_likelihood), 0.0);
    const int values = extension.start.size() - own_;
    e.power = NoncentralChiSquaredTail(RatioNeeded(values, 0.5 * e.ratio - e.gain_nats), values, e.ratio);
    return e;
  }

  Likelihood::Columns OwnColumns() const { return Likelihood::Pick(all_, InOrder(own_)); }

  static std::vector<int> InOrder(int count) {
    std::vector<int> members(count);
    std::iota(members.begin(), members.end(), 0);
    return members;
  }

  // The inner products of a response with noise, the model's own columns and one extension's (-1: none), per hypothesis.
  std::vector<Eigen::MatrixXd> GramsOf(const Eigen::VectorXd& response, int m) const {
    std::vector<int> members = InOrder(own_);
    if (m >= 0)
      for (int j = 0; j < spans_[m].count; ++j) members.push_back(own_ + spans_[m].first + j);
    const Likelihood::Columns truth = likelihood().Prepare(response), some = Likelihood::Pick(all_, members);
    std::vector<Eigen::MatrixXd> grams;
    const int size = static_cast<int>(members.size());
    for (int s = 0; s < static_cast<int>(grams_.size()); ++s) {
      Eigen::MatrixXd gram(1 + size, 1 + size);
      gram(0, 0) = likelihood().Norms(truth, s)[0] + NoiseSquares(s);
      if (size > 0) {
        const Eigen::MatrixXd cross = likelihood().Cross(truth, some, s);
        gram.block(0, 1, 1, size) = cross;
        gram.block(1, 0, size, 1) = cross.transpose();
      }
      for (int a = 0; a < size; ++a)
        for (int b = 0; b < size; ++b) gram(1 + a, 1 + b) = grams_[s](members[a], members[b]);
      grams.push_back(std::move(gram));
    }
    return grams;
  }

  LaplaceEvidence Without(const Eigen::VectorXd& response) const {
    return ComputeLaplaceEvidence(likelihood(), GramsOf(response, -1), InOrder(1 + own_),
                                  given_.model.parameters(), given_.point);
  }
  // To first order from where the extension starts.
  LaplaceEvidence WithLinearRival(const Eigen::VectorXd& response, int m) const {
    const Parameterization& start = extensions_[m].start;
    return ComputeLaplaceEvidence(likelihood(), GramsOf(response, m), InOrder(1 + start.size()),
                                  start.parameters(), start.Start());
  }

  // The extension fitted to a response.
  struct FittedRival {
    Eigen::VectorXd point;
    LaplaceEvidence evidence;
  };
  absl::StatusOr<FittedRival> Fitted(const Eigen::VectorXd& response, int m) const {
    const Parameterization& start = extensions_[m].start;
    FittedRival rival{start.Start(), WithLinearRival(response, m)};
    for (int step = 0; step < kMaxRivalSteps; ++step) {
      const Eigen::VectorXd point = start.Clip(rival.point + rival.evidence.step);
      const Eigen::VectorXd errors = rival.evidence.covariance.diagonal().cwiseMax(0).cwiseSqrt();
      const bool arrived = ((point - rival.point).cwiseAbs().array() <= kRivalArrived * errors.array()).all();
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                                  experiment_.observations->Predict(start.At(point)));
      TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd columns,
                                  Derivatives(experiment_, start, point, predicted, 0));
      Eigen::MatrixXd values(response.size(), 1 + columns.cols());
      values << response - experiment_.observations->Change(given_.predicted, predicted), columns;
      std::vector<Eigen::MatrixXd> grams = Grams(likelihood(), likelihood().Prepare(values));
      for (int s = 0; s < static_cast<int>(grams.size()); ++s) grams[s](0, 0) += NoiseSquares(s);
      rival.point = point;
      rival.evidence =
          ComputeLaplaceEvidence(likelihood(), grams, InOrder(1 + start.size()), start.parameters(), point);
      if (arrived) break;
    }
    return rival;
  }

  // Share of a response's squares that an extension's columns, with the model's own, explain.
  double ShareOf(const Eigen::VectorXd& response, int m) const {
    Eigen::MatrixXd columns(response.size(), own_ + spans_[m].count);
    columns << all_.values.leftCols(own_), all_.values.middleCols(own_ + spans_[m].first, spans_[m].count);
    return ShareExplained(columns, response);
  }

  // The extension that comes nearest to a response in evidence; -1: none resembles it.
  int NearestRival(int m, const Expected& e, double* correlation) const {
    std::vector<std::pair<double, int>> alike;
    for (size_t other = 0; other < extensions_.size(); ++other) {
      if (extensions_[other].name == extensions_[m].name) continue;
      if (!question_.rival.empty() && extensions_[other].name != question_.rival) continue;
      alike.emplace_back(std::sqrt(ShareOf(e.response, static_cast<int>(other))), other);
    }
    std::sort(alike.rbegin(), alike.rend());
    if (alike.size() > kRivalsCompared) alike.resize(kRivalsCompared);
    int nearest = -1;
    double best = -INFINITY;
    for (const auto& [r, other] : alike) {
      if (r < kNoResemblance && question_.rival.empty()) continue;
      const double evidence = WithLinearRival(e.response, other).log_evidence;
      if (evidence <= best) continue;
      best = evidence;
      nearest = other;
      *correlation = r;
    }
    return nearest;
  }

  // Whether a bound ended the way of a rival's values.
  bool IsStopped(int m, const FittedRival& rival) const {
    const Parameterization& start = extensions_[m].start;
    bool at_bound = false;
    for (int j = own_; j < start.size(); ++j) {
      const FreeParameter& p = start.parameters()[j];
      at_bound |= rival.point[j] != p.neutral && (rival.point[j] <= p.lower || rival.point[j] >= p.upper);
    }
    return at_bound;
  }

  // How far a size is from being told apart: the squared size over the one needed; > 1: it is.
  // `alike`: nothing but a bound keeps the rival from doing what the effect does.
  double ToldApart(const Expected& e, int m, const FittedRival& rival, bool alike) const {
    if (alike && IsStopped(m, rival)) return 0;
    const double ahead = e.log_evidence - rival.evidence.log_evidence;
    const double likelier = std::max(e.log_likelihood - rival.evidence.log_likelihood, 0.0);
    const double occam = ahead - likelier;
    // Twice the difference in log likelihood has this mean and, by the noise, four times it for a variance.
    const double z = kNormalQuantile80;
    const double needed = std::max(search_.rules().equivalent_nats - occam, 0.0);
    const double root =
        z + std::sqrt(z * z + 2 * needed);  // of 2 likelier, where likelier - z sqrt(2 likelier) = needed
    return 2 * likelier / std::max(root * root, 1e-12);
  }

  absl::StatusOr<DetectableValue> ValueOf(int m, int i) const {
    const Extension& extension = extensions_[m];
    const FreeParameter& p = extension.start.parameters()[i];
    DetectableValue value;
    value.effect = search_.candidates()[extension.candidate].effect;
    value.parameter = p.parameter;
    int entry = 0;
    double sign = 1;
    const double reach = Reach(p, &sign), typical = std::min(p.scale, reach);
    for (int j = 0; j < static_cast<int>(p.weights.size()); ++j)
      if (std::abs(p.weights[j]) > std::abs(p.weights[entry])) entry = j;
    const model::ParameterInfo& info = value.effect->parameters[p.parameter];
    value.entry =
        EntryName(info, entry - model::ValueOffset(*value.effect, p.parameter, given_.model.base().fingers),
                  given_.model.base().fingers);
    const double weight = std::abs(p.weights[entry]), si = SiFactor(info.unit);
    const auto in_file = [&](double size) { return (p.reciprocal ? 1 / size : weight * size) / si; };
    value.typical = in_file(typical);

    TOUCHSTONE_ASSIGN_OR_RETURN(Expected e, At(m, i, typical, false));
    const bool alone = e.response.norm() > kNoResponse * sigma_ * std::sqrt(likelihood().rows());
    if (!alone) {
      // It acts with the effect's other values only, or not at all.
      TOUCHSTONE_ASSIGN_OR_RETURN(e, At(m, i, typical, true));
    }
    const auto set_error = [&](const Expected& at, double size) {
      const double error = std::sqrt(std::max(at.covariance(i, i), 0.0));
      value.std_error = p.reciprocal ? error / (size * size) / si : in_file(error);
    };
    if (e.response.norm() <= kNoResponse * sigma_ * std::sqrt(likelihood().rows())) return value;
    set_error(e, typical);
    value.with_effect = std::make_shared<const model::Model>(extension.start.At(e.point));
    if (!alone) return value;
    value.power_at_typical = e.power;

    double size = typical;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const bool found, Grow(
                              m, i, reach,
                              [&](const Expected& at) -> absl::StatusOr<double> {
                                const int values = extension.start.size() - own_;
                                const double needed = RatioNeeded(values, 0.5 * at.ratio - at.gain_nats);
                                return at.ratio / NoncentralityForTail(needed, values, kDetectionPower);
                              },
                              &size, &e));
    if (found) {
      value.found_from = in_file(size);
      set_error(e, size);
      value.with_effect = std::make_shared<const model::Model>(extension.start.At(e.point));
    }
    const int rival = NearestRival(m, e, &value.correlation);
    if (rival < 0) {
      value.told_from = value.found_from;
      return value;
    }
    const Extension& other = extensions_[rival];
    value.rival = other.candidate < 0 ? absl::StrCat(kGivenPrefix, other.name) : other.name;
    TOUCHSTONE_ASSIGN_OR_RETURN(const FittedRival fitted, Fitted(e.response, rival));
    value.with_rival = std::make_shared<const model::Model>(other.start.At(fitted.point));
    if (!found) return value;
    const bool alike = 1 - value.correlation * value.correlation < kAlike * kAlike;
    if (ToldApart(e, rival, fitted, alike) < 1) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool told, Grow(
                                                       m, i, reach,
                                                       [&](const Expected& at) -> absl::StatusOr<double> {
                                                         TOUCHSTONE_ASSIGN_OR_RETURN(
                                                             const FittedRival again,
                                                             Fitted(at.response, rival));
                                                         return ToldApart(at, rival, again, alike);
                                                       },
                                                       &size, &e));
      if (!told) return value;
    }
    value.told_from = in_file(size);
    return value;
  }

  // Changes *size until what grows as its square is 1 there. False: it is not, up to `reach`.
  template <typename Measure>
  absl::StatusOr<bool> Grow(int m, int i, double reach, const Measure& measure, double* size,
                            Expected* e) const {
    for (int step = 0; step < kMaxSteps; ++step) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const double reached, measure(*e));
      const double factor = std::clamp(1 / std::sqrt(std::max(reached, 1e-12)), 1 / kMaxGrowth, kMaxGrowth);
      if (std::abs(factor - 1) < kNear) return true;
      if (*size >= reach && factor > 1) return false;
      *size = std::min(*size * factor, reach);
      TOUCHSTONE_ASSIGN_OR_RETURN(*e, At(m, i, *size, false));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const double reached, measure(*e));
    return reached > 1 - 2 * kNear;
  }

  const StepwiseSearch& search_;
  const Experiment& experiment_;
  const Fit& given_;
  const int own_;
  const double sigma_;
  const int initial_effects_;
  const DetectionQuestion& question_;
  std::vector<Extension> extensions_;
  std::vector<Span> spans_;             // of the extensions' columns in all_, after the model's own
  Likelihood::Columns all_;             // the model's own, then every extension's
  std::vector<Eigen::MatrixXd> grams_;  // of all_, by hypothesis
};

}  // namespace

absl::StatusOr<std::vector<DetectableValue>> FindDetectable(const StepwiseSearch& search, const Fit& given,
                                                            int initial_effects, double sigma,
                                                            const DetectionQuestion& question) {
  Detector detector(search, given, initial_effects, sigma, question);
  TOUCHSTONE_RETURN_IF_ERROR(detector.Prepare());
  return detector.Run();
}

}  // namespace touchstone::diagnosis::engine
