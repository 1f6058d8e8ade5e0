#include "server/diagnosis/selection/scatter/random_delay.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/units.h"
#include "server/diagnosis/selection/scatter/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

using touches::NoiseModel;
using touches::ReadingGroup;

std::string DelayInWords(const RandomDelay& found, int fingers) {
  const std::string whose = found.noise.finger < 0
                                ? ""
                                : absl::StrCat(" of finger ", model::FingerName(found.noise.finger, fingers));
  const std::string size =
      found.noise.of_length ? absl::StrFormat("%.2g mm of the travel", found.length_m * kMillimetresPerMetre)
                            : absl::StrFormat("%.2g ms", found.noise.size * 1e3);
  const std::string beside = absl::StrFormat("beside normal noise of %.2g ms", found.sigma_s.value * 1e3);
  std::string what;
  switch (found.noise.shape) {
    case DelayShape::kTwoValues:
      what = absl::StrFormat("take one of two values, %s: %.2g %% come %s %s than the others", beside,
                             100 * std::min(found.noise.share, 1 - found.noise.share), size,
                             found.noise.share <= 0.5 ? "later" : "earlier");
      break;
    case DelayShape::kUniform:
      what = absl::StrFormat("are spread evenly over %s, %s", size, beside);
      break;
    case DelayShape::kLate:
    case DelayShape::kEarly:
      what = absl::StrFormat("come %s by an amount that is exponentially distributed, %s on average, %s",
                             found.noise.shape == DelayShape::kLate ? "late" : "early", size, beside);
      break;
  }
  return absl::StrFormat(
      "The times%s %s. No noise of the catalogue does. Look for a contact that bounces, a channel that "
      "answers in two ways, or a loop that polls at times of its own.",
      whose, what);
}

std::vector<ReadingGroup> ThreeFingersOf(const std::vector<ReadingGroup>& all) {
  std::vector<ReadingGroup> complete, kept;
  for (const ReadingGroup& group : all)
    if (group.residual_s.size() >= 3 && group.residual_s.size() <= kMaxDelayedFingers)
      complete.push_back(group);
  const size_t count = std::min(complete.size(), kScatterRules.max_delay_touches.value());
  for (size_t j = 0; j < count; ++j) kept.push_back(complete[complete.size() * j / count]);
  return kept;
}

// Beside noise of these scales: the best two values, and the shape that says more, if one does.
class DelaySearch {
 public:
  DelaySearch(const std::vector<ReadingGroup>& groups, int fingers, double without_nats)
      : groups_(groups),
        fingers_(fingers),
        without_nats_(without_nats),
        speeds_(touches::SpeedsDiffer(groups)) {}

  std::optional<RandomDelay> Best(NoiseModel scales) const {
    const double none_nats = touches::ProfileSigma(groups_, &scales);
    std::optional<RandomDelay> best;
    double handicap = 0;
    for (const bool of_length : {false, true})
      for (int finger = -1; finger < fingers_ && (speeds_ || !of_length); ++finger) {
        const TwoValues two = FitTwoValues(groups_, scales, finger, of_length);
        if (std::min(two.late_readings, two.readings - two.late_readings) < kScatterRules.min_of_each_value)
          continue;
        const double own = (of_length ? kScatterRules.delay_of_length.value() : 0) +
                           (finger >= 0 ? kScatterRules.one_finger.value() : 0);
        if (two.gain_nats - own < (best ? best->gain_nats - handicap : kScatterRules.two_values.value()))
          continue;
        best = RandomDelay{two.noise, {}, 0, false, false, two.gain_nats, ""};
        best->sigma_s.std_error = two.noise.sigma_s / std::sqrt(two.degrees_of_freedom);
        handicap = own;
      }
    if (!best) return std::nullopt;
    best->gain_nats += none_nats - without_nats_;
    const DelayedNoise two_values = best->noise;
    for (const DelayShape shape : {DelayShape::kUniform, DelayShape::kLate, DelayShape::kEarly}) {
      double nats = 0;
      const DelayedNoise noise = FitShape(groups_, scales, shape, two_values, &nats);
      if (nats - without_nats_ <= best->gain_nats) continue;
      best->noise = noise;
      best->gain_nats = nats - without_nats_;
    }
    best->sigma_s.value = best->noise.sigma_s;
    if (best->gain_nats < handicap) return std::nullopt;
    best->ahead = best->gain_nats >= handicap + kScatterRules.delay;
    return best;
  }

 private:
  const std::vector<ReadingGroup>& groups_;
  const int fingers_;
  const double without_nats_;
  const bool speeds_;
};

}  // namespace

std::optional<RandomDelay> FindRandomDelay(const touches::NoiseSample& sample,
                                           const touches::NoiseFindings& noise, int fingers) {
  const std::vector<ReadingGroup> groups = ThreeFingersOf(sample.groups);
  if (groups.size() < kScatterRules.min_delay_touches) return std::nullopt;
  NoiseModel without = noise.model;
  const DelaySearch search(groups, fingers, touches::ProfileSigma(groups, &without));

  std::optional<RandomDelay> best = search.Best({});
  if (best) best->plain_noise = true;
  NoiseModel scales = noise.model;
  scales.shape = touches::NoiseShape::kGaussian;
  if (scales.slope > 0 || scales.length_share > 0 || !scales.channel_scale.empty()) {
    std::optional<RandomDelay> scaled = search.Best(scales);
    if (scaled && (!best || scaled->gain_nats > best->gain_nats + kScatterRules.delay_scales))
      best = std::move(scaled);
  }
  if (!best) return std::nullopt;
  if (best->noise.of_length) best->length_m = best->noise.size / sample.rms_slowness_s_per_m;
  best->words = best->ahead ? DelayInWords(*best, fingers)
                            : "Readings that come late now and then, by a random delay, would look alike.";
  return best;
}

touches::NoiseFindings WithoutDelays(const RandomDelay& delay, touches::NoiseFindings noise) {
  noise.degrees_of_freedom = {};
  noise.sigma_s = delay.sigma_s;
  if (!delay.plain_noise) return noise;
  noise.slope = noise.length_sigma_m = {};
  noise.channel_sigma_s.clear();
  return noise;
}

}  // namespace touchstone::diagnosis::selection
