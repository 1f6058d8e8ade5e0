#include "server/diagnosis/design/sequential_choice.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/design/rules.h"

namespace touchstone::diagnosis::design {
namespace {

// The best model against a competing one: either may be true, and the other is fitted to it.
struct ModelPair {
  SequentialRefit competing, best;
  double separation() const { return 0.5 * (competing.separation() + best.separation()); }
  double Gain(int k) const { return 0.5 * (competing.Gain(k) + best.Gain(k)); }
  // A pair that is as good as discriminated counts less and less.
  double RelativeGain(int k) const { return tied ? 0 : Gain(k) / (1 + separation()); }

  bool tied = false;  // no measurement tells the two apart: numbers of measurements would be made up
};

// Whether a model imitates the best one, so that no measurement speaks against it: fitted to all candidates as that predicts
// them, whatever the present data say of its values, it leaves less than a verdict needs, or nothing but the curvature of
// what is linearised here.
bool Imitates(const LinearisedPrediction& fitted, const LinearisedPrediction& truth) {
  const Eigen::Index values = fitted.covariance.rows();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(values, values);
  Eigen::VectorXd cross = Eigen::VectorXd::Zero(values);
  double apart = 0;
  for (size_t k = 0; k < fitted.predicted.size(); ++k) {
    const Eigen::VectorXd difference = truth.predicted[k] - fitted.predicted[k];
    if (!difference.allFinite() || !fitted.derivative[k].allFinite()) continue;
    gram += fitted.derivative[k].transpose() * fitted.derivative[k];
    cross += fitted.derivative[k].transpose() * difference;
    apart += difference.squaredNorm();
  }
  gram.diagonal().array() += kDesignRules.negligible_prior.value();
  const double left = apart - cross.dot(SymmetricSolver(gram).Solve(cross));
  return 0.5 * left < kDesignRules.verdict_nats || left < kDesignRules.curvature_share * apart;
}

// Chooses measurements one after the other, spread over the objects.
class MeasurementChooser {
 public:
  MeasurementChooser(const std::vector<std::string>& names,
                     const std::vector<LinearisedPrediction>& predictions, const std::vector<int>& objects,
                     int object_count, const ChoiceRules& rules);
  std::vector<ChosenMeasurement> Choose();

 private:
  bool alone() const { return names_.size() == 1; }
  int ToVerdict(const std::vector<double>& nats) const;
  double Worth(int k) const;
  int Best() const;  // -1: no candidate is worth anything
  ChosenMeasurement Describe(int k);

  const std::vector<std::string>& names_;
  const std::vector<LinearisedPrediction>& predictions_;
  const std::vector<int>& objects_;
  const ChoiceRules rules_;
  std::vector<ModelPair> pairs_;  // the best model with each other one, or with itself if it is alone
  std::vector<std::vector<double>> nats_;  // [pair][measurements so far]: expected log evidence
  std::vector<int> pair_of_purpose_;       // of each chosen measurement
  std::vector<char> chosen_;               // [candidate]
  std::vector<int> of_object_;             // chosen measurements
};

MeasurementChooser::MeasurementChooser(const std::vector<std::string>& names,
                                       const std::vector<LinearisedPrediction>& predictions,
                                       const std::vector<int>& objects, int object_count,
                                       const ChoiceRules& rules)
    : names_(names),
      predictions_(predictions),
      objects_(objects),
      rules_(rules),
      chosen_(objects.size(), 0),
      of_object_(object_count, 0) {
  for (size_t j = alone() ? 0 : 1; j < names.size(); ++j)
    pairs_.push_back({SequentialRefit(&predictions[j], &predictions[0]),
                      SequentialRefit(&predictions[0], &predictions[j])});
  for (size_t pair = 0; pair < pairs_.size() && !alone(); ++pair)
    pairs_[pair].tied = Imitates(predictions[pair + 1], predictions[0]);
}

double MeasurementChooser::Worth(int k) const {
  double worth = 0;
  for (const ModelPair& pair : pairs_)
    worth += alone() ? pair.best.InformationNats(k) : std::log1p(pair.RelativeGain(k));
  return worth;
}

int MeasurementChooser::Best() const {
  const int objects = static_cast<int>(of_object_.size());
  const int max_per_object = std::max(1, (3 * rules_.max_choices / 2 + objects - 1) / objects);
  int best = -1;
  double best_worth = 0;
  for (size_t k = 0; k < objects_.size(); ++k) {
    if (chosen_[k] || of_object_[objects_[k]] >= max_per_object) continue;
    if (!predictions_[0].predicted[k].allFinite()) continue;
    const double worth = Worth(static_cast<int>(k));
    if (worth > best_worth) best = static_cast<int>(k), best_worth = worth;
  }
  return best;
}

ChosenMeasurement MeasurementChooser::Describe(int k) {
  ChosenMeasurement chosen;
  chosen.candidate = k;
  if (alone()) {
    chosen.purpose = absl::StrCat("learns the values of ", names_[0]);
    chosen.separation_sigmas = pairs_[0].best.PredictionSigmas(k);
    return chosen;
  }
  // The pair that the measurement discriminates best names its purpose.
  const auto pair = std::max_element(
      pairs_.begin(), pairs_.end(),
      [k](const ModelPair& a, const ModelPair& b) { return a.RelativeGain(k) < b.RelativeGain(k); });
  pair_of_purpose_.push_back(static_cast<int>(pair - pairs_.begin()));
  const std::string& other = names_[pair - pairs_.begin() + 1];
  chosen.purpose = absl::StrCat("tells ", names_[0], " from ", other);
  chosen.separation_sigmas = std::sqrt(pair->Gain(k));
  return chosen;
}

// Half the squared separation is the expected log evidence. Beyond the chosen ones it grows by as much for each.
int MeasurementChooser::ToVerdict(const std::vector<double>& nats) const {
  for (size_t n = 0; n < nats.size(); ++n)
    if (nats[n] >= kDesignRules.verdict_nats) return static_cast<int>(n) + 1;
  const double needed = std::ceil(kDesignRules.verdict_nats / nats.back() * static_cast<double>(nats.size()));
  return needed <= kDesignRules.max_to_verdict ? static_cast<int>(needed) : 0;
}

std::vector<ChosenMeasurement> MeasurementChooser::Choose() {
  nats_.resize(pairs_.size());
  std::vector<ChosenMeasurement> all;
  for (int n = 0; n < rules_.max_choices; ++n) {
    const int best = Best();
    if (best < 0) break;
    all.push_back(Describe(best));
    for (size_t j = 0; j < pairs_.size(); ++j) {
      pairs_[j].competing.Add(best), pairs_[j].best.Add(best);
      nats_[j].push_back(0.5 * pairs_[j].separation());
    }
    chosen_[best] = 1;
    ++of_object_[objects_[best]];
  }
  double separation = 0;
  for (const ModelPair& pair : pairs_) separation = std::max(separation, pair.separation());
  if (!alone() && separation < rules_.min_separation) all.clear();
  for (size_t n = 0; n < all.size() && !alone(); ++n)
    all[n].to_verdict = ToVerdict(nats_[pair_of_purpose_[n]]);
  return all;
}

}  // namespace

std::vector<ChosenMeasurement> ChooseMeasurements(const std::vector<std::string>& names,
                                                  const std::vector<LinearisedPrediction>& predictions,
                                                  const std::vector<int>& objects, int object_count,
                                                  const ChoiceRules& rules) {
  if (names.empty() || objects.empty() || rules.max_choices <= 0) return {};
  return MeasurementChooser(names, predictions, objects, object_count, rules).Choose();
}

}  // namespace touchstone::diagnosis::design
