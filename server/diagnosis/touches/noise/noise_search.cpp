#include "server/diagnosis/touches/noise/noise_search.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "server/diagnosis/touches/noise/golden_section.h"
#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::touches {
namespace {

// Standard error from the curvature of a log likelihood at its maximum.
double CurvatureError(const std::function<double(double)>& f, double at, double step) {
  const double bend = f(at + step) + f(at - step) - 2 * f(at);
  return bend < 0 ? step / std::sqrt(-bend) : 0;
}

std::vector<ReadingGroup> Thinned(const std::vector<ReadingGroup>& all) {
  if (all.size() <= kNoiseRules.max_part) return all;
  std::vector<ReadingGroup> part;
  for (size_t j = 0; j < kNoiseRules.max_part; ++j)
    part.push_back(all[all.size() * j / kNoiseRules.max_part]);
  return part;
}

double ContrastsOf(const std::vector<ReadingGroup>& groups) {
  double contrasts = 0;
  for (const ReadingGroup& group : groups) contrasts += static_cast<double>(group.residual_s.size()) - 1;
  return contrasts;
}

// Excess kurtosis of residuals in units of their own scale, over its spread by chance.
double Kurtosis(const std::vector<ReadingGroup>& groups, const NoiseModel& model) {
  double second = 0, fourth = 0, count = 0;
  for (const ReadingGroup& group : groups) {
    const double n = static_cast<double>(group.residual_s.size());
    for (size_t i = 0; i < group.residual_s.size(); ++i) {
      const double x = group.residual_s[i] / std::sqrt(1 - 1 / n) / RelativeScale(group, i, model);
      second += x * x, fourth += x * x * x * x, count += 1;
    }
  }
  if (count < 20 || second <= 0) return 0;
  return (fourth * count / (second * second) - 3) / std::sqrt(24 / count);
}

// Sigma from the median of what residuals are in units of their own scale; sigma itself where that is 0.
double MedianSigma(const std::vector<ReadingGroup>& groups, const NoiseModel& model) {
  constexpr double kMedianOfNormal = 0.6745;
  std::vector<double> sizes;
  for (const ReadingGroup& group : groups) {
    const double n = static_cast<double>(group.residual_s.size());
    for (size_t i = 0; i < group.residual_s.size(); ++i)
      sizes.push_back(std::abs(group.residual_s[i]) / std::sqrt(1 - 1 / n) / RelativeScale(group, i, model));
  }
  const auto middle = sizes.begin() + static_cast<long>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle > 0 ? *middle / kMedianOfNormal : model.sigma_s;
}

// Groups with a reading that is more likely an outlier than not.
void FindOutliers(const std::vector<ReadingGroup>& groups, const NoiseModel& model, NoiseFindings* found) {
  std::vector<double> off;  // in scales
  for (const ReadingGroup& group : groups) {
    if (OutlierProbability(group, model) <= 0.5) continue;
    found->outliers.push_back(group.index);
    off.push_back(0);
    for (size_t i = 0; i < group.residual_s.size(); ++i)
      off.back() = std::max(off.back(), std::abs(group.residual_s[i]) / RelativeScale(group, i, model));
  }
  if (off.empty()) return;
  const double farthest = *std::max_element(off.begin(), off.end());
  for (size_t j = 0; j < off.size(); ++j)
    if (off[j] > kNoiseRules.beside_farthest * farthest)
      found->farthest_outliers.push_back(found->outliers[j]);
}

}  // namespace

NoiseSearch::NoiseSearch(const NoiseSample& sample, const DeclaredNoise& declared, NoiseFindings* found)
    : sample_(sample), declared_(declared), part_(Thinned(sample.groups)), found_(found) {
  best_.log_likelihood = ProfileSigma(sample_.groups, &best_.model);
}

const std::vector<ReadingGroup>& NoiseSearch::GroupsOfShape() const {
  return best_.gaussian() ? sample_.groups : part_;
}

double NoiseSearch::shape_dof() const {
  return std::max(ContrastsOf(GroupsOfShape()), 1.0);
}

bool NoiseSearch::Possible(Kind kind) const {
  if (kind == kGrowth) return true;
  // Two channels show one variance only.
  if (kind == kChannels) return sample_.channels >= 3;
  return SpeedsDiffer(sample_.groups);
}

double NoiseSearch::Threshold(Kind kind) const {
  if (Declared(kind)) return kNoiseRules.declared_gain;
  const double further = kind == kChannels ? sample_.channels - 2 : 0;
  return (sample_.repeats.size() >= kNoiseRules.min_repeats || kind == kGrowth
              ? kNoiseRules.enter.value()
              : kNoiseRules.without_repeats.value()) +
         further;
}

NoiseSearch::Description NoiseSearch::Fit(Kind kind, const Description& from) const {
  Description trial = from;
  trial.has[kind] = true;
  NoiseModel& model = trial.model;
  const auto at = [&](double x) {
    (kind == kGrowth ? model.slope : model.length_share) = kind == kGrowth ? std::exp(x) : x;
    return ProfileSigma(sample_.groups, &model);
  };
  if (kind == kGrowth) {
    at(Maximise(at, std::log(kNoiseRules.min_slope.value()), std::log(kNoiseRules.max_slope.value()), 20,
                &trial.log_likelihood));
  } else if (kind == kLength) {
    // A noise of lengths alone is simpler than one beside a noise of times.
    double beside = 0;
    const double share = Maximise(at, 0, 1, 20, &beside);
    trial.log_likelihood = at(1);
    if (trial.log_likelihood < beside - kNoiseRules.times_beside_lengths) trial.log_likelihood = at(share);
  } else {
    FitChannels(&trial);
  }
  trial.gain_nats[kind] = trial.log_likelihood - from.log_likelihood;
  return trial;
}

// One channel after the other in ever smaller ranges; where one channel that differs from all others says nearly as
// much, it is that one. The quietest gets scale 1.
void NoiseSearch::FitChannels(Description* trial) const {
  std::vector<double>& scales = trial->model.channel_scale;
  const auto climb = [&](size_t channel, double range) {
    const double centre = std::log(scales[channel]);
    const auto at = [&](double log_scale) {
      scales[channel] = std::exp(log_scale);
      return ProfileSigma(sample_.groups, &trial->model);
    };
    at(Maximise(at, centre - range, centre + range, 10, &trial->log_likelihood));
  };
  const std::vector<double> alike(sample_.channels, 1.0);
  std::vector<double> one;
  double one_log_likelihood = -INFINITY;
  for (size_t channel = 0; channel < alike.size(); ++channel) {
    scales = alike;
    for (const double range : {std::log(kNoiseRules.max_scale.value()), 0.3, 0.05}) climb(channel, range);
    if (trial->log_likelihood <= one_log_likelihood) continue;
    one_log_likelihood = trial->log_likelihood;
    one = scales;
  }
  // From the best single one on, so that all of them are never worse.
  scales = one;
  for (const double range : {std::log(kNoiseRules.max_scale.value()), 0.3, 0.05})
    for (size_t channel = 0; channel < alike.size(); ++channel) climb(channel, range);
  if (trial->log_likelihood < one_log_likelihood + kNoiseRules.declared_gain) scales = one;
  const double quietest = *std::min_element(scales.begin(), scales.end());
  for (double& scale : scales) scale /= quietest;
  trial->log_likelihood = ProfileSigma(sample_.groups, &trial->model);
}

bool NoiseSearch::RepeatsAgree(const NoiseModel& with, const NoiseModel& without, double gain_nats) const {
  if (sample_.repeats.size() < kNoiseRules.min_repeats) return true;
  NoiseModel one = with, other = without;
  one.shape = other.shape = NoiseShape::kGaussian;
  const double repeats_nats = ProfileSigma(sample_.repeats, &one) - ProfileSigma(sample_.repeats, &other);
  return repeats_nats > std::max(kNoiseRules.repeats_gain.value(), kNoiseRules.repeats_share * gain_nats);
}

// Forward selection among what the scale may depend on.
NoiseSearch::Description NoiseSearch::WithKinds(Description from) const {
  for (int round = 0; round < kKinds; ++round) {
    Description best;
    double best_excess = 0;
    for (const Kind kind : {kGrowth, kLength, kChannels}) {
      if (from.has[kind] || !Possible(kind)) continue;
      Description trial = Fit(kind, from);
      const double excess = trial.gain_nats[kind] - Threshold(kind);
      if (excess <= best_excess || !RepeatsAgree(trial.model, from.model, trial.gain_nats[kind])) continue;
      best = std::move(trial), best_excess = excess;
    }
    if (best_excess == 0) break;
    from = std::move(best);
  }
  return from;
}

bool NoiseSearch::TailsLookHeavy(const NoiseModel& model) const {
  return Kurtosis(sample_.groups, model) > kNoiseRules.kurtosis &&
         (sample_.repeats.size() < kNoiseRules.min_repeats ||
          Kurtosis(sample_.repeats, model) > kNoiseRules.repeats_kurtosis);
}

NoiseSearch::Description NoiseSearch::FitStudent(const Description& from) const {
  Description fit = from;
  fit.model.shape = NoiseShape::kStudent;
  const auto at = [&](double log_dof) {
    fit.model.degrees_of_freedom = std::exp(log_dof);
    fit.model.sigma_s = from.model.sigma_s;
    return ProfileSigma(part_, &fit.model);
  };
  const double log_dof = Maximise(at, std::log(1.2), std::log(60.0), 9, &fit.log_likelihood);
  const double relative_error = CurvatureError(at, log_dof, 0.1);
  at(log_dof);
  fit.tails = {fit.model.degrees_of_freedom, fit.model.degrees_of_freedom * relative_error};
  return fit;
}

// The best mixture of noise and outliers on a grid.
NoiseSearch::Description NoiseSearch::FitMixture(const Description& from) const {
  Description best = from;
  best.log_likelihood = -INFINITY;
  for (const double width : {6.0, 15.0, 40.0, 100.0})
    for (const double share : {0.002, 0.007, 0.02, 0.05}) {
      NoiseModel at = from.model;
      at.shape = NoiseShape::kMixture;
      at.width = width, at.share = share;
      const double value = ProfileSigma(part_, &at);
      if (value > best.log_likelihood) best.log_likelihood = value, best.model = at;
    }
  return best;
}

NoiseSearch::Description NoiseSearch::WithTails(const Description& plain) const {
  if (!TailsLookHeavy(plain.model)) return plain;
  // A few wild outliers leave nothing of the usual sigma: the search for it begins at the median.
  Description from = plain;
  from.model.sigma_s = MedianSigma(part_, plain.model);
  NoiseModel gaussian = from.model;
  const double before = ProfileSigma(part_, &gaussian);
  Description student = FitStudent(from), mixture = FitMixture(from);
  student.tails.gain_nats = student.log_likelihood - before;
  if (student.tails.gain_nats >= kNoiseRules.enter && student.log_likelihood >= mixture.log_likelihood - 3)
    return student;
  return mixture.log_likelihood - before >= kNoiseRules.enter ? mixture : plain;
}

// Log likelihood on the part, less what the parameters must earn.
double NoiseSearch::Score(const Description& description) const {
  NoiseModel model = description.model;
  double score =
      description.gaussian() ? ProfileSigma(part_, &model) : description.log_likelihood - kNoiseRules.enter;
  for (const Kind kind : {kGrowth, kLength, kChannels})
    if (description.has[kind]) score -= Threshold(kind);
  return score;
}

// Tails may have looked like a slope, or like one loud channel.
void NoiseSearch::DropKindsThatTailsExplain() {
  bool dropped = false;
  for (const Kind kind : {kGrowth, kLength, kChannels}) {
    if (!best_.has[kind]) continue;
    NoiseModel with = best_.model, without = best_.model;
    if (kind == kGrowth) without.slope = 0;
    if (kind == kLength) without.length_share = 0;
    if (kind == kChannels) without.channel_scale.clear();
    best_.gain_nats[kind] = ProfileSigma(part_, &with) - ProfileSigma(part_, &without);
    if (best_.gain_nats[kind] >= Threshold(kind)) continue;
    best_.has[kind] = false;
    best_.model = without;
    dropped = true;
  }
  if (!dropped || best_.model.shape != NoiseShape::kStudent) return;
  const double gain = best_.tails.gain_nats;
  best_ = FitStudent(best_);
  best_.tails.gain_nats = gain;
}

void NoiseSearch::DescribeGrowth() {
  NoiseModel at = best_.model;
  const auto by_slope = [&](double slope) {
    at.slope = slope;
    at.sigma_s = best_.model.sigma_s;
    return ProfileSigma(GroupsOfShape(), &at);
  };
  found_->slope = {best_.model.slope, CurvatureError(by_slope, best_.model.slope, 0.05 * best_.model.slope),
                   best_.gain_nats[kGrowth]};
}

// The two parts of a variance, times and lengths.
void NoiseSearch::DescribeLength() {
  NoiseModel at = best_.model;
  const auto by_share = [&](double share) {
    at.length_share = share;
    at.sigma_s = best_.model.sigma_s;
    return ProfileSigma(GroupsOfShape(), &at);
  };
  const double share = best_.model.length_share;
  const double error = std::max(
      CurvatureError(by_share, std::clamp(share, kNoiseRules.share_step.value(), 1 - kNoiseRules.share_step),
                     kNoiseRules.share_step.value()),
      1 / shape_dof());
  const auto root_error = [&](double part) { return error / (2 * std::sqrt(std::max(part, error))); };
  const double length_m = best_.model.sigma_s / sample_.rms_slowness_s_per_m;
  found_->length_sigma_m = {length_m * std::sqrt(share),
                            length_m * std::hypot(root_error(share), 1 / std::sqrt(2 * shape_dof())),
                            best_.gain_nats[kLength]};
  found_->sigma_s = {best_.model.sigma_s * std::sqrt(1 - share), best_.model.sigma_s * root_error(1 - share)};
  found_->sigma_s.absent = share == 1;
}

// What each channel has beyond the quietest, in quadrature.
void NoiseSearch::DescribeChannels() {
  const double relative_error = std::sqrt(sample_.channels / (2 * shape_dof()));
  for (const double scale : best_.model.channel_scale) {
    const double square = scale * scale, beyond = std::max(square - 1, 0.0);
    // Of the difference of two variances, each known to twice the relative error of its root.
    const double error = 2 * relative_error * std::hypot(square, 1.0);
    found_->channel_sigma_s.push_back({best_.model.sigma_s * std::sqrt(beyond),
                                       best_.model.sigma_s * error / (2 * std::sqrt(std::max(beyond, error))),
                                       best_.gain_nats[kChannels]});
  }
}

void NoiseSearch::Run() {
  const Description plain = best_;
  best_ = WithKinds(plain);
  // A loud channel may look like tails, and tails like a loud channel: both orders are tried.
  if (TailsLookHeavy(plain.model)) {
    const bool any_kind = best_.has[kGrowth] || best_.has[kLength] || best_.has[kChannels];
    Description tails_alone = WithTails(plain);
    const Description with_kinds = any_kind ? WithTails(best_) : tails_alone;
    best_ = any_kind && Score(with_kinds) > Score(tails_alone) ? with_kinds : std::move(tails_alone);
    if (!best_.gaussian()) DropKindsThatTailsExplain();
    if (best_.model.shape == NoiseShape::kMixture) FindOutliers(sample_.groups, best_.model, found_);
  }
  JudgeDeclaredTails();
  JudgeDeclaredScales();
  ProfileSigma(GroupsOfShape(), &best_.model);
  const bool absent = found_->degrees_of_freedom.absent;
  found_->degrees_of_freedom = best_.tails;
  found_->degrees_of_freedom.absent = absent;
  found_->sigma_s = {best_.model.sigma_s, best_.model.sigma_s / std::sqrt(2 * shape_dof())};
  // Slope and tails share what is known of the scale, channels divide it.
  if (best_.has[kGrowth]) found_->sigma_s.std_error *= 2;
  if (best_.tails.gain_nats > 0) found_->sigma_s.std_error *= 1.6;
  if (best_.has[kChannels]) found_->sigma_s.std_error *= std::sqrt(sample_.channels);
  if (best_.has[kGrowth]) DescribeGrowth();
  if (best_.has[kLength]) DescribeLength();
  if (best_.has[kChannels]) DescribeChannels();
}

}  // namespace touchstone::diagnosis::touches
