#include "server/diagnosis/selection/scatter/uneven_scatter.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "server/base/units.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/competition/uneven_parts.h"
#include "server/diagnosis/selection/scatter/rules.h"
#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

using touches::NoiseModel;
using touches::NoiseShape;
using touches::ReadingGroup;

constexpr int kScatterQuarters = 4;
constexpr double kTails[] = {2, 4, 8, 20};  // degrees of freedom that are tried

// One way to part the touches. part[k]: of each touch, -1: of none.
struct Partition {
  std::string covariate, by;  // "object"; "on the object"
  std::vector<std::string> names;
  std::vector<int> part;
};

const char* const kQuarterNames[] = {"first", "second", "third", "last"};

// Quarters of the used touches by a value.
Partition Quarters(const touches::Observations& o, const std::vector<double>& value, std::string covariate,
                   std::string by, const std::string& quarter_of) {
  Partition found{std::move(covariate), std::move(by), {}, std::vector<int>(o.size(), -1)};
  std::vector<double> sorted;
  for (int k = 0; k < o.size(); ++k)
    if (o.used[k] && std::isfinite(value[k])) sorted.push_back(value[k]);
  std::sort(sorted.begin(), sorted.end());
  if (sorted.empty()) return found;
  for (int k = 0; k < o.size(); ++k) {
    if (!std::isfinite(value[k])) continue;
    int quarter = 0;
    while (quarter + 1 < kScatterQuarters &&
           value[k] >= sorted[sorted.size() * (quarter + 1) / kScatterQuarters])
      ++quarter;
    found.part[k] = quarter;
  }
  for (const char* name : kQuarterNames)
    found.names.push_back(absl::StrCat("the ", name, " quarter", quarter_of));
  return found;
}

Partition ByValue(const touches::Observations& o, const std::vector<double>& value, std::string covariate,
                  std::string by, const char* before, const char* after) {
  Partition found{std::move(covariate), std::move(by), {}, std::vector<int>(o.size(), -1)};
  std::map<double, int> parts;
  for (const double x : value) parts.emplace(x, 0);
  if (static_cast<int>(parts.size()) > kScatterRules.max_parts) return found;
  for (auto& [x, part] : parts) {
    part = static_cast<int>(found.names.size());
    found.names.push_back(absl::StrFormat("%s%g%s", before, x, after));
  }
  for (int k = 0; k < o.size(); ++k) found.part[k] = parts[value[k]];
  return found;
}

std::vector<Partition> PartitionsOf(const touches::Observations& o, const touches::Prediction& d) {
  const int n = o.size();
  std::vector<double> order(n), round(n), speed(n), face(n), height(n), travel(n, NAN);
  const std::vector<int> rounds = touches::RoundsOfTouches(o);
  for (int k = 0; k < n; ++k) {
    order[k] = k;
    round[k] = rounds[k];
    speed[k] = o.set->speed_m_s[o.row[k]] * kMillimetresPerMetre;
    face[k] = o.set->face.empty() ? 0 : o.set->face[o.row[k]];
    height[k] = o.set->approach[o.row[k]].z();
    double sum = 0;
    for (int i = 0; i < o.fingers; ++i) sum += d.travel_m[static_cast<size_t>(k) * o.fingers + i];
    travel[k] = sum / o.fingers;
  }
  const std::string time = o.set->has_session_time ? "session_time_s" : "touch";
  std::vector<Partition> found;
  found.push_back({"object", "the object", o.objects, o.object});
  found.push_back(Quarters(o, order, time, "the place in the session", " of the session"));
  found.push_back(ByValue(o, round, "round", "the round", "round ", ""));
  found.push_back(ByValue(o, speed, "speed_mm_s", "the speed", "", " mm/s"));
  found.push_back(ByValue(o, face, "face", "the face", "face ", ""));
  found.push_back(Quarters(o, travel, "travel_mm", "the travel", ", from the shortest travel on"));
  found.push_back(
      Quarters(o, height, "approach_z", "the direction of the approach", ", from straight down to up"));
  return found;
}

using ScatterParts = std::vector<std::vector<ReadingGroup>>;

// The readings of each part that has enough of them; names[j] of the parts that stay.
ScatterParts ScatterPartsOf(const std::vector<ReadingGroup>& groups, const Partition& partition,
                            std::vector<std::string>* names) {
  ScatterParts all(partition.names.size()), kept;
  for (const ReadingGroup& group : groups)
    if (partition.part[group.index] >= 0) all[partition.part[group.index]].push_back(group);
  for (size_t j = 0; j < all.size(); ++j) {
    if (static_cast<int>(all[j].size()) < kScatterRules.min_touches_of_part) continue;
    names->push_back(partition.names[j]);
    kept.push_back(std::move(all[j]));
  }
  return kept;
}

// Best log likelihood with a scale for each part.
double PartsLogLikelihood(const ScatterParts& parts, NoiseModel model, std::vector<double>* scale_s) {
  scale_s->clear();
  double sum = 0;
  for (const std::vector<ReadingGroup>& part : parts) {
    NoiseModel own = model;
    if (own.shape != NoiseShape::kGaussian) {
      // The search for a scale of tails begins at that of a normal distribution.
      NoiseModel gaussian = own;
      gaussian.shape = NoiseShape::kGaussian;
      touches::ProfileSigma(part, &gaussian);
      own.sigma_s = gaussian.sigma_s;
    }
    sum += touches::ProfileSigma(part, &own);
    scale_s->push_back(own.sigma_s);
  }
  return sum;
}

struct ScaleFit {
  double gaussian = 0, any = 0;  // log likelihoods: normal, and with the tails that fit best
  std::vector<double> scale_s;   // of the better of both
};

ScaleFit FitScales(const ScatterParts& parts, NoiseModel model) {
  ScaleFit found;
  model.shape = NoiseShape::kGaussian;
  found.any = found.gaussian = PartsLogLikelihood(parts, model, &found.scale_s);
  model.shape = NoiseShape::kStudent;
  for (const double degrees_of_freedom : kTails) {
    model.degrees_of_freedom = degrees_of_freedom;
    std::vector<double> scale_s;
    const double here = PartsLogLikelihood(parts, model, &scale_s);
    if (here <= found.any) continue;
    found.any = here;
    found.scale_s = std::move(scale_s);
  }
  return found;
}

double GaussianGain(const ScatterParts& parts, const std::vector<ReadingGroup>& all, NoiseModel model) {
  model.shape = NoiseShape::kGaussian;
  std::vector<double> scale_s;
  return PartsLogLikelihood(parts, model, &scale_s) - PartsLogLikelihood({all}, model, &scale_s);
}

// One less the share of poses among the touches.
double OwnScatterShare(const touches::Observations& o, const std::vector<ReadingGroup>& groups) {
  std::set<int> poses;
  for (const ReadingGroup& group : groups) poses.insert(o.pose[group.index]);
  return 1 - static_cast<double>(poses.size()) / static_cast<double>(groups.size());
}

// Nothing where one scatter says the same. The p-value is of this partition alone.
std::optional<UnevenScatter> CompareScatter(const std::vector<ReadingGroup>& groups,
                                            const Partition& partition, const NoiseModel& model,
                                            double own_share) {
  std::vector<std::string> names;
  const ScatterParts parts = ScatterPartsOf(groups, partition, &names);
  if (parts.size() < 2) return std::nullopt;
  std::vector<ReadingGroup> together;
  for (const auto& part : parts) together.insert(together.end(), part.begin(), part.end());
  const double count = static_cast<double>(parts.size()), touches = static_cast<double>(together.size());
  // Heavy tails make parts differ by chance: what differs with them differs without.
  if (own_share * GaussianGain(parts, together, model) < engine::EnoughToBeUneven(count, touches))
    return std::nullopt;
  const ScaleFit one = FitScales({together}, model), each = FitScales(parts, model);
  const double gain = own_share * (each.any - one.any);
  const auto [low, high] = std::minmax_element(each.scale_s.begin(), each.scale_s.end());
  const std::optional<engine::CovariateTest> test =
      engine::TestUneven(partition.covariate, gain, count, touches, *low, *high);
  if (!test) return std::nullopt;
  UnevenScatter found;
  for (size_t j = 0; j < parts.size(); ++j)
    found.parts.push_back({names[j], each.scale_s[j], static_cast<int>(parts[j].size())});
  found.test = *test;
  found.tails_remain = each.any - each.gaussian > touches::kNoiseRules.enter;
  return found;
}

// What is compared: every finger, or one against the mean of the others, where what scatters is this finger alone.
struct View {
  int finger = -1;
  std::vector<ReadingGroup> groups;
  NoiseModel model;
};

View OneAgainstOthers(const std::vector<ReadingGroup>& groups, const NoiseModel& model, int finger) {
  View view{finger, {}, model};
  const auto scale = [&](int channel) {
    return model.channel_scale.empty() ? 1.0 : model.channel_scale[channel];
  };
  double others_squared = 0;
  for (const ReadingGroup& group : groups) {
    const size_t n = group.residual_s.size();
    const auto own = std::find(group.channel.begin(), group.channel.end(), finger);
    if (own == group.channel.end() || n < 3) continue;
    const size_t at = static_cast<size_t>(own - group.channel.begin());
    const double others = static_cast<double>(n - 1);
    double residual_s = 0, growth = 0, squared = 0;
    for (size_t i = 0; i < n; ++i) {
      if (i == at) continue;
      residual_s += group.residual_s[i] / others, growth += group.growth[i] / others;
      squared += std::pow(scale(group.channel[i]) / others, 2);
    }
    others_squared = std::max(others_squared, squared);
    view.groups.push_back({group.index,
                           {group.residual_s[at], residual_s},
                           {group.growth[at], growth},
                           {0, 1},
                           group.slowness});
  }
  view.model.channel_scale = {scale(finger), std::sqrt(others_squared)};
  return view;
}

std::string ScatterInWords(const UnevenScatter& found, const std::string& by, int fingers) {
  std::vector<std::string> parts;
  for (const UnevenScatter::Part& part : found.parts)
    parts.push_back(absl::StrFormat("%s %.2g ms", part.name, part.scale_s * 1e3));
  const std::string whose =
      found.finger < 0 ? "" : absl::StrCat(" of finger ", model::FingerName(found.finger, fingers));
  return absl::StrCat("The times", whose, " scatter by an amount that depends on ", by, ": ",
                      absl::StrJoin(parts, ", "), ".");
}

std::string AlikeInWords(const std::vector<std::string>& alike) {
  if (alike.empty()) return "";
  std::string same = absl::StrJoin(alike, " and ");
  same[0] = absl::ascii_toupper(same[0]);
  return absl::StrCat(" ", same, " would say nearly the same: touch in another order.");
}

// The partition that one scatter describes worst; nothing where none does. `tried`: comparisons in all.
std::optional<UnevenScatter> WorstPartition(const View& view, const std::vector<Partition>& partitions,
                                            double own_share, double tried, int fingers) {
  std::vector<UnevenScatter> found;
  std::vector<std::string> by;
  for (const Partition& partition : partitions) {
    std::optional<UnevenScatter> here = CompareScatter(view.groups, partition, view.model, own_share);
    if (!here) continue;
    here->finger = view.finger;
    here->test.p = std::min(1.0, here->test.p * tried);
    found.push_back(*std::move(here));
    by.push_back(partition.by);
  }
  if (found.empty()) return std::nullopt;
  size_t best = 0;
  for (size_t j = 1; j < found.size(); ++j)
    if (found[j].test.gain_nats > found[best].test.gain_nats) best = j;
  UnevenScatter& scatter = found[best];
  std::vector<std::string> alike;
  for (size_t j = 0; j < found.size(); ++j) {
    if (j == best ||
        found[j].test.gain_nats < engine::kCompetitionRules.alike_uneven_share * scatter.test.gain_nats)
      continue;
    scatter.alike.push_back(found[j].test);
    alike.push_back(by[j]);
  }
  scatter.words = absl::StrCat(
      ScatterInWords(scatter, by[best], fingers), AlikeInWords(alike),
      " No noise of the catalogue does. Find what differs there, or diagnose the parts by themselves.");
  return std::move(scatter);
}

}  // namespace

std::optional<UnevenScatter> FindUnevenScatter(const touches::Observations& o, const touches::Prediction& d,
                                               const touches::NoiseSample& sample,
                                               const touches::NoiseFindings& noise) {
  if (d.travel_m.size() != static_cast<size_t>(o.size()) * o.fingers || noise.poll_interval_s.gain_nats > 0)
    return std::nullopt;
  const std::vector<ReadingGroup>& source =
      sample.repeats.size() >= touches::kNoiseRules.min_repeats ? sample.repeats : sample.groups;
  // What a mean over repeats has followed says nothing of their scatter.
  const double own_share = &source == &sample.repeats ? OwnScatterShare(o, source) : 1;
  std::vector<ReadingGroup> groups;
  const size_t kept = std::min(source.size(), kScatterRules.max_uneven_touches.value());
  for (size_t j = 0; j < kept; ++j) groups.push_back(source[source.size() * j / kept]);

  const std::vector<Partition> partitions = PartitionsOf(o, d);
  std::vector<View> views = {{-1, groups, noise.model}};
  if (o.fingers > 2)
    for (int finger = 0; finger < o.fingers; ++finger)
      views.push_back(OneAgainstOthers(groups, noise.model, finger));
  const double tried = static_cast<double>(partitions.size() * views.size());
  std::optional<UnevenScatter> worst;
  for (const View& view : views) {
    std::optional<UnevenScatter> here = WorstPartition(view, partitions, own_share, tried, o.fingers);
    if (here && (!worst || here->test.gain_nats > worst->test.gain_nats + kScatterRules.one_finger))
      worst = std::move(here);
  }
  return worst;
}

void NameUnevenScatter(const UnevenScatter& scatter, bool rest_of_means, engine::UnexplainedRest* rest) {
  std::vector<engine::CovariateTest> own = {scatter.test};
  own.insert(own.end(), scatter.alike.begin(), scatter.alike.end());
  std::vector<engine::CovariateTest>& all = rest->covariates;
  const auto has = [&](const engine::CovariateTest& test) {
    return std::any_of(all.begin(), all.end(), [&](const auto& other) { return other.name == test.name; });
  };
  own.erase(std::remove_if(own.begin(), own.end(), has), own.end());
  all.insert(rest_of_means ? all.end() : all.begin(), own.begin(), own.end());
}

}  // namespace touchstone::diagnosis::selection
