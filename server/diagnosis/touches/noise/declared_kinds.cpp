// What a model says of its noise, against what the search has found.
#include <algorithm>
#include <cmath>

#include "server/diagnosis/touches/noise/noise_search.h"
#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::touches {

bool NoiseSearch::Declared(Kind kind) const {
  if (kind == kGrowth) return declared_.slope.has_value();
  if (kind == kLength) return declared_.length_sigma_m.has_value();
  return !declared_.channel_sigma_s.empty();
}

NoiseModel NoiseSearch::AsDeclared(Kind kind) const {
  NoiseModel told = best_.model;
  const double length_s = declared_.length_sigma_m.value_or(0) * sample_.rms_slowness_s_per_m;
  const double variance = std::max(declared_.sigma_s * declared_.sigma_s + length_s * length_s, 1e-24);
  if (kind == kGrowth) told.slope = *declared_.slope;
  if (kind == kLength) told.length_share = std::min(length_s * length_s / variance, 1.0);
  if (kind == kChannels) {
    told.channel_scale.clear();
    for (const double beyond_s : declared_.channel_sigma_s)
      told.channel_scale.push_back(std::sqrt(1 + beyond_s * beyond_s / variance));
  }
  return told;
}

// Tails that the model has: are they there, and as heavy?
void NoiseSearch::JudgeDeclaredTails() {
  if (!declared_.degrees_of_freedom || !best_.gaussian()) return;
  NoiseModel gaussian = best_.model, told = best_.model;
  const double without = ProfileSigma(part_, &gaussian);
  told.shape = NoiseShape::kStudent;
  told.degrees_of_freedom = *declared_.degrees_of_freedom;
  if (without - ProfileSigma(part_, &told) < kNoiseRules.declared_excluded) return;
  Description student = FitStudent(best_);
  student.tails.gain_nats = student.log_likelihood - without;
  if (student.tails.gain_nats >= kNoiseRules.declared_gain)
    best_ = std::move(student);
  else
    found_->degrees_of_freedom.absent = true;
}

// Growth, lengths and channels that the model has and the data do not.
void NoiseSearch::JudgeDeclaredScales() {
  const std::vector<ReadingGroup>& groups = GroupsOfShape();
  for (const Kind kind : {kGrowth, kLength, kChannels}) {
    if (!Declared(kind) || best_.has[kind] || !Possible(kind)) continue;
    NoiseModel without = best_.model, told = AsDeclared(kind);
    if (ProfileSigma(groups, &without) - ProfileSigma(groups, &told) < kNoiseRules.declared_excluded)
      continue;
    (kind == kGrowth   ? found_->slope.absent
     : kind == kLength ? found_->length_sigma_m.absent
                       : found_->channels_absent) = true;
  }
}

}  // namespace touchstone::diagnosis::touches
