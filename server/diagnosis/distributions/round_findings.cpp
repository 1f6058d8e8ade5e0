#include "server/diagnosis/distributions/round_findings.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "server/base/numbers/random.h"
#include "server/base/text/readable_time.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/diagnosis/residuals/distribution/permutation.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::distributions {
namespace {

constexpr int kTests = 4;  // kinds of findings: what every p is paid for

// A touch less its mean over the fingers and less the mean of its pose, s.
struct RepeatedTouch {
  int row = 0, pose = 0, block = 0;  // block: round of its object
  double order = 0;                  // place in the session, less the pose's mean
  std::vector<double> residual_s;    // [finger]
  std::vector<double>
      press_s;  // of the previous touch: its last contact less this finger's, less the pose's mean
};

struct RepeatedTouches {
  std::vector<RepeatedTouch> touches;     // in the order of the session
  std::vector<std::vector<int>> of_pose;  // indices of touches
  int fingers = 0, blocks = 0;
};

void CentreByPose(RepeatedTouches* data) {
  for (const std::vector<int>& members : data->of_pose) {
    const double share = 1.0 / static_cast<double>(members.size());
    double order = 0;
    std::vector<double> residual(data->fingers, 0), press(data->fingers, 0);
    for (const int k : members) {
      order += share * data->touches[k].order;
      for (int i = 0; i < data->fingers; ++i) {
        residual[i] += share * data->touches[k].residual_s[i];
        press[i] += share * data->touches[k].press_s[i];
      }
    }
    for (const int k : members) {
      data->touches[k].order -= order;
      for (int i = 0; i < data->fingers; ++i) {
        data->touches[k].residual_s[i] -= residual[i];
        data->touches[k].press_s[i] -= press[i];
      }
    }
  }
}

// In rounds of one order a touch follows the same pose each time, but for the first of a round: its press differs by
// so much that few touches would decide alone.
void ClipPresses(RepeatedTouches* data) {
  std::vector<double> sizes;
  for (const RepeatedTouch& touch : data->touches)
    for (const double press_s : touch.press_s) sizes.push_back(std::abs(press_s));
  if (sizes.empty()) return;
  std::nth_element(sizes.begin(), sizes.begin() + sizes.size() / 2, sizes.end());
  const double limit_s = kDistributionRules.max_press * sizes[sizes.size() / 2];
  for (RepeatedTouch& touch : data->touches)
    for (double& press_s : touch.press_s) press_s = std::clamp(press_s, -limit_s, limit_s);
}

// Complete touches of objects that go in rounds, poses with two of them at least.
RepeatedTouches CollectRepeats(const PoseFreeExperiment& experiment) {
  const session::MeasurementSet& set = experiment.set;
  RepeatedTouches data;
  data.fingers = set.fingers;
  const auto complete = [&](int row) {
    for (int i = 0; i < set.fingers; ++i)
      if (std::isnan(set.TimeS(row, i))) return false;
    return true;
  };
  for (const PoseFreeObject& object : experiment.objects) {
    if (!object.in_rounds) continue;
    const uint64_t poses_per_round = 6ull * object.plan.faces.samples_per_face;
    std::map<uint64_t, std::vector<RepeatedTouch>> poses;
    for (size_t n = 0; n < object.rows.size(); ++n) {
      const int row = object.rows[n];
      if (!complete(row)) continue;
      RepeatedTouch touch;
      touch.row = row;
      touch.block = data.blocks + static_cast<int>(object.number[n] / poses_per_round);
      touch.order = set.has_session_time ? set.session_time_s[row] : row;
      double mean = 0, last = -INFINITY;
      const bool has_previous = row > 0 && complete(row - 1);
      for (int i = 0; i < set.fingers; ++i) {
        mean += set.TimeS(row, i) / set.fingers;
        if (has_previous) last = std::max(last, set.TimeS(row - 1, i));
      }
      for (int i = 0; i < set.fingers; ++i) {
        touch.residual_s.push_back(set.TimeS(row, i) - mean);
        touch.press_s.push_back(has_previous ? last - set.TimeS(row - 1, i) : 0);
      }
      poses[object.number[n] % poses_per_round].push_back(std::move(touch));
    }
    data.blocks += object.repeats;
    for (auto& [number, touches] : poses) {
      if (touches.size() < 2) continue;
      const int pose = static_cast<int>(data.of_pose.size());
      data.of_pose.emplace_back();
      for (RepeatedTouch& touch : touches) {
        touch.pose = pose;
        data.touches.push_back(std::move(touch));
      }
    }
  }
  std::sort(data.touches.begin(), data.touches.end(),
            [](const RepeatedTouch& a, const RepeatedTouch& b) { return a.row < b.row; });
  for (size_t k = 0; k < data.touches.size(); ++k)
    data.of_pose[data.touches[k].pose].push_back(static_cast<int>(k));
  CentreByPose(&data);
  ClipPresses(&data);
  return data;
}

// What depends on the order, with the residuals of touch source[k] in the place of touch k.
struct OrderStatistics {
  double blocks = 0;          // sum of squares between rounds of objects
  double neighbours = 0;      // sum of products of touches one after the other
  std::vector<double> trend;  // [finger], sum of products with the order
  double press = 0;           // sum of products with the previous press
};

OrderStatistics Statistics(const RepeatedTouches& data, const std::vector<int>& source) {
  OrderStatistics result;
  result.trend.assign(data.fingers, 0);
  std::vector<double> sum(static_cast<size_t>(data.blocks) * data.fingers, 0), count(data.blocks, 0);
  for (size_t k = 0; k < data.touches.size(); ++k) {
    const RepeatedTouch& place = data.touches[k];
    const std::vector<double>& r = data.touches[source[k]].residual_s;
    const bool follows = k > 0 && data.touches[k - 1].row + 1 == place.row;
    count[place.block] += 1;
    for (int i = 0; i < data.fingers; ++i) {
      sum[static_cast<size_t>(place.block) * data.fingers + i] += r[i];
      result.trend[i] += r[i] * place.order;
      result.press += r[i] * place.press_s[i];
      if (follows) result.neighbours += r[i] * data.touches[source[k - 1]].residual_s[i];
    }
  }
  for (int block = 0; block < data.blocks; ++block)
    for (int i = 0; i < data.fingers && count[block] > 0; ++i)
      result.blocks += std::pow(sum[static_cast<size_t>(block) * data.fingers + i], 2) / count[block];
  return result;
}

double NormalTail(double z) {
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

// How far a value is from permuted ones, in their standard deviations.
double ZScore(double observed, const std::vector<double>& permuted) {
  const double mean = std::accumulate(permuted.begin(), permuted.end(), 0.0) / permuted.size();
  double squares = 0;
  for (const double value : permuted) squares += (value - mean) * (value - mean);
  return squares > 0 ? (observed - mean) / std::sqrt(squares / (permuted.size() - 1)) : 0;
}

struct OrderTests {
  double session_p = 1, press_p = 1, neighbours_z = 0, press_z = 0;
};

OrderTests TestOrder(const RepeatedTouches& data, uint64_t seed) {
  std::vector<int> source(data.touches.size());
  std::iota(source.begin(), source.end(), 0);
  const OrderStatistics observed = Statistics(data, source);
  std::vector<double> blocks, neighbours, press;
  std::vector<std::vector<double>> trend(data.fingers);
  RandomStream random(seed, RandomDomain::kDiagnosis, 0, 8);
  for (int n = 0; n < kDistributionRules.order_permutations; ++n) {
    for (const std::vector<int>& members : data.of_pose)
      for (size_t u = members.size() - 1; u > 0; --u)
        std::swap(source[members[u]], source[members[random.Below(u + 1)]]);
    const OrderStatistics permuted = Statistics(data, source);
    blocks.push_back(permuted.blocks), neighbours.push_back(permuted.neighbours),
        press.push_back(permuted.press);
    for (int i = 0; i < data.fingers; ++i) trend[i].push_back(permuted.trend[i]);
  }
  OrderTests tests;
  tests.neighbours_z = ZScore(observed.neighbours, neighbours);
  double best = std::min(NormalTail(tests.neighbours_z), residuals::PermutationP(observed.blocks, blocks));
  for (int i = 0; i < data.fingers; ++i)
    best = std::min(best, 2 * data.fingers * NormalTail(std::abs(ZScore(observed.trend[i], trend[i]))));
  tests.session_p = std::min(1.0, 3 * best);
  // A press that differs within few poses only makes a sum of few terms, which is not normal.
  double squares = 0, fourth = 0;
  for (const RepeatedTouch& touch : data.touches)
    for (const double c : touch.press_s) squares += c * c, fourth += c * c * c * c;
  tests.press_z = ZScore(observed.press, press);
  if (fourth > 0 && squares * squares / fourth >= kDistributionRules.min_effective)
    tests.press_p = std::min(1.0, 2 * NormalTail(std::abs(tests.press_z)));
  return tests;
}

double LogKurtosis(const RepeatedTouches& data) {
  double squares = 0, fourth = 0, count = 0;
  for (const RepeatedTouch& touch : data.touches)
    for (const double r : touch.residual_s) squares += r * r, fourth += r * r * r * r, count += 1;
  return squares > 0 ? std::log(fourth * count / (squares * squares)) : 0;
}

// Of a kurtosis as large in Gaussian noise with the same poses and repeats. Its logarithm is nearly normal; the spread
// is taken a fifth larger for what it is not.
double TailsP(const RepeatedTouches& data, uint64_t seed) {
  std::vector<double> gaussian;
  RepeatedTouches noise = data;
  RandomStream random(seed, RandomDomain::kDiagnosis, 1, 8);
  for (int n = 0; n < kDistributionRules.gaussian_sets; ++n) {
    for (RepeatedTouch& touch : noise.touches) {
      double mean = 0;
      for (double& r : touch.residual_s) mean += (r = random.Normal()) / data.fingers;
      for (double& r : touch.residual_s) r -= mean;
    }
    CentreByPose(&noise);
    gaussian.push_back(LogKurtosis(noise));
  }
  return NormalTail(ZScore(LogKurtosis(data), gaussian) / 1.2);
}

bool HasRole(const model::Model& model, std::initializer_list<model::EffectRole> roles) {
  return std::any_of(model.effects.begin(), model.effects.end(), [&](const model::EffectInstance& instance) {
    return std::count(roles.begin(), roles.end(), instance.effect->role) > 0;
  });
}

// Effects of the catalogue for which `does` holds.
template <typename Predicate>
std::vector<std::string> EffectsThat(const Predicate& does) {
  std::vector<std::string> names;
  for (const auto& effect : effects::TouchEffects())
    if (!effect->parameters.empty() && does(*effect)) names.push_back(effect->name);
  return names;
}

void AddOrder(const RepeatedTouches& data, uint64_t seed, std::vector<RoundFinding>* findings) {
  const OrderTests tests = TestOrder(data, seed);
  const double session_p = std::min(1.0, kTests * tests.session_p);
  if (session_p < kDistributionRules.finding_p)
    findings->push_back(
        {RoundFindingKind::kSession, session_p,
         "Repeats of the same touches change with their place in the session: a drift, an offset "
         "between rounds, noise with a memory, or what the touch before left behind; objects put down anew "
         "would do it, too.",
         EffectsThat([](const model::Effect& effect) {
           return effect.needs.session_time || effect.needs.previous_press ||
                  effect.role == model::EffectRole::kNoiseMemory;
         })});
  const double press_p = std::min(1.0, kTests * tests.press_p);
  if (press_p < kDistributionRules.finding_p)
    findings->push_back(
        {RoundFindingKind::kPreviousPress, press_p,
         absl::StrCat("A finger that was pressed harder in the previous touch comes ",
                      tests.press_z < 0 ? "earlier" : "later",
                      " than in other repeats: it has not fully come back, or readings next to each "
                      "other share an error."),
         EffectsThat([](const model::Effect& effect) {
           return effect.needs.previous_press || effect.role == model::EffectRole::kNoiseMemory;
         })});
}

// Times from the first contact of each complete touch, s; evenly chosen.
std::vector<double> TimesSinceFirst(const session::MeasurementSet& set) {
  std::vector<double> all;
  for (int row = 0; row < set.size(); ++row) {
    double first = INFINITY;
    for (int i = 0; i < set.fingers; ++i)
      if (!std::isnan(set.TimeS(row, i))) first = std::min(first, set.TimeS(row, i));
    for (int i = 0; i < set.fingers; ++i)
      if (set.TimeS(row, i) > first) all.push_back(set.TimeS(row, i) - first);
  }
  std::vector<double> chosen;
  const size_t wanted = std::min<size_t>(kDistributionRules.tick_times.value(), all.size());
  for (size_t n = 0; n < wanted; ++n) chosen.push_back(all[n * all.size() / wanted]);
  return chosen;
}

// How well multiples of a tick fit: 1 if every time is one, near 0 for times of any size.
double Coherence(const std::vector<double>& time_s, double frequency_hz) {
  std::complex<double> sum = 0;
  for (const double t : time_s) sum += std::polar(1.0, 2 * M_PI * frequency_hz * t);
  // The multiples start at zero, so the phase must be zero too.
  return sum.real() / static_cast<double>(time_s.size());
}

}  // namespace

double CommonTick(const std::vector<double>& time_s) {
  if (static_cast<int>(time_s.size()) < kDistributionRules.min_repeated) return 0;
  std::vector<double> sorted = time_s;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2], range = sorted[sorted.size() * 95 / 100];
  if (!(median > 4 * kDistributionRules.min_tick_s)) return 0;
  // The lowest frequency is the tick; its multiples fit as well.
  const double step_hz = 0.1 / range;
  for (double f = 4 / median; f <= 1 / kDistributionRules.min_tick_s; f += step_hz) {
    if (Coherence(time_s, f) < 0.5) continue;
    double best = f, fit = 0;
    // The peak is ten steps wide; its top lies within.
    for (int n = 0; n <= 400; ++n) {
      const double nearby = f + n * step_hz / 20;
      if (const double c = Coherence(time_s, nearby); c > fit) best = nearby, fit = c;
    }
    if (fit > kDistributionRules.tick_coherence) return 1 / best;
  }
  return 0;
}

std::vector<RoundFinding> FindInRounds(const PoseFreeExperiment& experiment) {
  std::vector<RoundFinding> findings;
  const model::Model& given = *experiment.input.model;
  const RepeatedTouches data = CollectRepeats(experiment);
  if (static_cast<int>(data.touches.size()) >= kDistributionRules.min_repeated) {
    AddOrder(data, experiment.input.seed, &findings);
    const double p = std::min(1.0, kTests * TailsP(data, experiment.input.seed));
    if (p < kDistributionRules.finding_p &&
        !HasRole(given, {model::EffectRole::kNoiseTails, model::EffectRole::kNoiseGrowth}))
      findings.push_back(
          {RoundFindingKind::kTails, p,
           "Repeats of the same touches scatter with tails: noise that is larger in some poses, now and then "
           "wild readings, or the first touch of a round, which follows another one than its repeats do.",
           EffectsThat([](const model::Effect& effect) {
             return effect.role == model::EffectRole::kNoiseTails ||
                    effect.role == model::EffectRole::kNoiseGrowth || effect.needs.previous_press;
           })});
  }
  const std::vector<double> times = TimesSinceFirst(experiment.set);
  const double tick_s = CommonTick(times);
  if (tick_s > 0 && !HasRole(given, {model::EffectRole::kQuantisation})) {
    const double fit = Coherence(times, 1 / tick_s);
    const double tried = 10 * times.size() / kDistributionRules.min_tick_s * tick_s;
    findings.push_back(
        {RoundFindingKind::kTicks,
         std::min(1.0, kTests * tried * std::exp(-fit * fit * static_cast<double>(times.size()))),
         absl::StrCat("All times are multiples of ", TimeInWords(tick_s),
                      ": a polling loop, or a file that was rounded."),
         EffectsThat(
             [](const model::Effect& effect) { return effect.role == model::EffectRole::kQuantisation; })});
  }
  return findings;
}

}  // namespace touchstone::diagnosis::distributions
