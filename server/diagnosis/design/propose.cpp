#include "server/diagnosis/design/propose.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/design/linearised_prediction.h"
#include "server/diagnosis/design/touch_candidates.h"

namespace touchstone::diagnosis::design {
namespace {

constexpr int kMaxData = 3000;          // touches that stand for the present data
constexpr int kRunLength = 50;          // in runs, so that a press still reaches the next touch
constexpr int kMaxToVerdict = 100000;   // more touches than that are no advice
constexpr double kMinSeparation = 0.5;  // squared sigmas in all, below which no touch discriminates

// The best model against a competing one: either may be true, and the other is fitted to it.
struct ModelPair {
  SequentialRefit competing, best;
  double separation() const { return 0.5 * (competing.separation() + best.separation()); }
  double Gain(int k) const { return 0.5 * (competing.Gain(k) + best.Gain(k)); }
  // A pair that is as good as discriminated counts less and less.
  double RelativeGain(int k) const { return Gain(k) / (1 + separation()); }
};

// The observations, or runs of them spread over the session.
touches::Observations PresentData(const touches::Observations& observations) {
  std::vector<int> keep;
  const int runs = (observations.size() + kRunLength - 1) / kRunLength;
  const int run_step = std::max(1, (observations.size() + kMaxData - 1) / kMaxData);
  for (int run = 0; run < runs; run += run_step)
    for (int k = run * kRunLength; k < std::min(observations.size(), (run + 1) * kRunLength); ++k)
      keep.push_back(k);
  return PartOf(observations, keep);
}

ProposedTouch TouchOf(const touches::Observations& candidates, int k) {
  const session::MeasurementSet& set = *candidates.set;
  const int row = candidates.row[k];
  ProposedTouch proposed;
  proposed.object = candidates.objects[candidates.object[k]];
  proposed.touch.target_m = set.target_m[row];
  proposed.touch.approach = set.approach[row];
  proposed.touch.lateral = set.lateral[row];
  proposed.touch.standoff_m = set.standoff_m[row];
  proposed.touch.speed_m_s = set.speed_m_s[row];
  proposed.has_session_time = set.has_session_time;
  if (set.has_session_time) proposed.touch.session_time_s = set.session_time_s[row];
  for (const auto& [name, values] : set.covariates) proposed.touch.covariates[name] = values[row];
  return proposed;
}

bool Drifts(const model::Model& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const model::EffectInstance& instance) {
    return instance.effect->needs.session_time;
  });
}

// Chooses touches one after the other, spread over the objects.
class TouchChooser {
 public:
  TouchChooser(const touches::Observations& candidates, const std::vector<CompetingModel>& models,
               const std::vector<LinearisedPrediction>& predictions, int max_touches);
  std::vector<ProposedTouch> Choose();

 private:
  bool alone() const { return models_.size() == 1; }
  int TouchesToVerdict(const std::vector<double>& nats) const;
  double Worth(int k) const;
  int Best() const;  // -1: no candidate is worth anything
  ProposedTouch Propose(int k);

  const touches::Observations& candidates_;
  const std::vector<CompetingModel>& models_;
  const std::vector<LinearisedPrediction>& predictions_;
  const int max_touches_;
  std::vector<ModelPair> pairs_;  // the best model with each other one, or with itself if it is alone
  std::vector<std::vector<double>> nats_;  // [pair][touches so far]: expected log evidence
  std::vector<int> pair_of_purpose_;       // of each proposed touch
  std::vector<char> chosen_;               // [candidate]
  std::vector<int> of_object_;             // chosen touches
};

TouchChooser::TouchChooser(const touches::Observations& candidates, const std::vector<CompetingModel>& models,
                           const std::vector<LinearisedPrediction>& predictions, int max_touches)
    : candidates_(candidates),
      models_(models),
      predictions_(predictions),
      max_touches_(max_touches),
      chosen_(candidates.size(), 0),
      of_object_(candidates.objects.size(), 0) {
  for (size_t j = alone() ? 0 : 1; j < models.size(); ++j)
    pairs_.push_back({SequentialRefit(&predictions[j], &predictions[0]),
                      SequentialRefit(&predictions[0], &predictions[j])});
}

double TouchChooser::Worth(int k) const {
  double worth = 0;
  for (const ModelPair& pair : pairs_)
    worth += alone() ? pair.best.InformationNats(k) : std::log1p(pair.RelativeGain(k));
  return worth;
}

int TouchChooser::Best() const {
  const int objects = static_cast<int>(of_object_.size());
  const int max_per_object = std::max(1, (3 * max_touches_ / 2 + objects - 1) / objects);
  int best = -1;
  double best_worth = 0;
  for (int k = 0; k < candidates_.size(); ++k) {
    if (chosen_[k] || of_object_[candidates_.object[k]] >= max_per_object) continue;
    if (!predictions_[0].predicted[k].allFinite()) continue;
    const double worth = Worth(k);
    if (worth > best_worth) best = k, best_worth = worth;
  }
  return best;
}

ProposedTouch TouchChooser::Propose(int k) {
  ProposedTouch proposed = TouchOf(candidates_, k);
  if (alone()) {
    proposed.purpose = absl::StrCat("learns the values of ", models_[0].name);
    proposed.separation_sigmas = pairs_[0].best.PredictionSigmas(k);
    return proposed;
  }
  // The pair that the touch discriminates best names its purpose.
  const auto pair = std::max_element(
      pairs_.begin(), pairs_.end(),
      [k](const ModelPair& a, const ModelPair& b) { return a.RelativeGain(k) < b.RelativeGain(k); });
  pair_of_purpose_.push_back(static_cast<int>(pair - pairs_.begin()));
  const std::string& other = models_[pair - pairs_.begin() + 1].name;
  proposed.purpose = absl::StrCat("tells ", models_[0].name, " from ", other);
  proposed.separation_sigmas = std::sqrt(pair->Gain(k));
  return proposed;
}

// Half the squared separation is the expected log evidence. Beyond the proposed touches it grows by as much for each.
int TouchChooser::TouchesToVerdict(const std::vector<double>& nats) const {
  for (size_t n = 0; n < nats.size(); ++n)
    if (nats[n] >= kVerdictNats) return static_cast<int>(n) + 1;
  const double needed = std::ceil(kVerdictNats / nats.back() * static_cast<double>(nats.size()));
  return needed <= kMaxToVerdict ? static_cast<int>(needed) : 0;
}

std::vector<ProposedTouch> TouchChooser::Choose() {
  nats_.resize(pairs_.size());
  std::vector<ProposedTouch> proposed;
  for (int n = 0; n < max_touches_; ++n) {
    const int best = Best();
    if (best < 0) break;
    proposed.push_back(Propose(best));
    for (size_t j = 0; j < pairs_.size(); ++j) {
      pairs_[j].competing.Add(best), pairs_[j].best.Add(best);
      nats_[j].push_back(0.5 * pairs_[j].separation());
    }
    chosen_[best] = 1;
    ++of_object_[candidates_.object[best]];
  }
  double separation = 0;
  for (const ModelPair& pair : pairs_) separation = std::max(separation, pair.separation());
  if (!alone() && separation < kMinSeparation) proposed.clear();
  for (size_t n = 0; n < proposed.size() && !alone(); ++n)
    proposed[n].touches_to_verdict = TouchesToVerdict(nats_[pair_of_purpose_[n]]);
  return proposed;
}

}  // namespace

absl::StatusOr<std::vector<ProposedTouch>> ProposeTouches(const touches::Observations& observations,
                                                          const std::vector<CompetingModel>& models,
                                                          double sigma_s, int max_touches, uint64_t seed,
                                                          ThreadPool* pool) {
  if (models.empty())
    return absl::InvalidArgumentError("to propose touches takes at least one fitted model, got none");
  if (!(sigma_s > 0) || max_touches <= 0 || observations.size() == 0) return std::vector<ProposedTouch>();

  CandidateChoice choice;
  choice.seed = seed;
  for (const CompetingModel& competing : models) choice.different_times |= Drifts(*competing.model);
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations candidates,
                              MakeCandidates(observations, *models[0].model, choice, pool));
  if (candidates.size() == 0) return std::vector<ProposedTouch>();

  const touches::Observations present = PresentData(observations);
  const double weight = double(observations.size()) / present.size();
  std::vector<LinearisedPrediction> predictions;
  for (const CompetingModel& competing : models) {
    TOUCHSTONE_ASSIGN_OR_RETURN(LinearisedPrediction prediction,
                                Linearise(*competing.model, present, weight, candidates, sigma_s, pool));
    predictions.push_back(std::move(prediction));
  }
  return TouchChooser(candidates, models, predictions, max_touches).Choose();
}

}  // namespace touchstone::diagnosis::design
