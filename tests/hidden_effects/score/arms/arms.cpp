#include "tests/hidden_effects/score/arms/arms.h"

#include <algorithm>
#include <random>

#include "server/base/units.h"
#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/generator/unlisted.h"
#include "tests/hidden_effects/score/arms/strengths.h"

namespace touchstone::hidden {
namespace {

constexpr double kSpeed = 20;

// 5 objects x 48 poses x 4 rounds.
Scenario FullSet(const TestObjects& objects) {
  Scenario scenario;
  scenario.objects = objects.solids;
  return scenario;
}

double Part(std::mt19937_64& random) {
  return std::uniform_real_distribution<double>(0, 1)(random);
}

template <typename T>
T Pick(const std::vector<T>& from, std::mt19937_64& random) {
  return from[random() % from.size()];
}

Scenario Bumpy(const TestObjects& objects, uint64_t seed, double sigmas) {
  auto random = Stream(seed, "kind");
  Scenario scenario = FullSet(objects);
  const double sigma_mm = scenario.sigma_us * kSecondsPerMicrosecond * kSpeed;
  scenario.hidden.push_back({"surface_error", {sigmas * sigma_mm, 12 + 28 * Part(random)}});
  return scenario;
}

Scenario Weak(const TestObjects& objects, uint64_t seed) {
  auto random = Stream(seed, "kind");
  Scenario scenario = FullSet(objects);
  const std::string effect = Pick(EffectsOfExpectation(), random);
  scenario.hidden = {WeakEffect(effect, scenario, seed, 10 + 5 * Part(random))};
  return scenario;
}

// Whether two effects fit alike at one speed, or add up to what one of them could do alone.
bool SameClass(const std::string& a, const std::string& b) {
  static const std::vector<std::vector<std::string>> kClasses = {
      {"speed_error", "clock_skew", "contact_slowdown"},
      {"channel_latency", "finger_length", "tool_tilt"},
      {"gravity_sag", "object_pose"}};
  return std::any_of(kClasses.begin(), kClasses.end(), [&](const auto& names) {
    return std::count(names.begin(), names.end(), a) > 0 && std::count(names.begin(), names.end(), b) > 0;
  });
}

// `count` different effects, no two of which fit alike.
Scenario Realistic(Scenario scenario, uint64_t seed, int count) {
  auto random = Stream(seed, "kind");
  std::vector<std::string> pool = EffectsOfExpectation();
  pool.push_back("surface_error");
  pool.insert(pool.end(), EffectsOfScatter().begin(), EffectsOfScatter().end());
  std::vector<Hidden> hidden;
  while (static_cast<int>(hidden.size()) < count) {
    const std::string effect = Pick(pool, random);
    const bool clash = std::any_of(hidden.begin(), hidden.end(), [&](const Hidden& other) {
      return other.effect == effect || SameClass(other.effect, effect);
    });
    if (!clash) hidden.push_back(RealisticEffect(effect, scenario, seed + hidden.size() * 7919));
  }
  scenario.hidden = hidden;
  return scenario;
}

Scenario LatencyOrLength(const TestObjects& objects, uint64_t seed, bool second_speed) {
  auto random = Stream(seed, "kind");
  Scenario scenario = FullSet(objects);
  if (second_speed) scenario.speeds_mm_s = {kSpeed, 50}, scenario.speed_by_round = random() % 2;
  const std::string effect = Pick<std::string>({"channel_latency", "finger_length"}, random);
  scenario.hidden = {RealisticEffect(effect, scenario, seed)};
  return scenario;
}

Scenario StretchedTime(const TestObjects& objects, uint64_t seed) {
  auto random = Stream(seed, "kind");
  Scenario scenario = FullSet(objects);
  if (random() % 2) scenario.speeds_mm_s = {kSpeed, 50};
  const std::string effect = Pick<std::string>({"speed_error", "clock_skew", "contact_slowdown"}, random);
  scenario.hidden = {RealisticEffect(effect, scenario, seed)};
  return scenario;
}

Scenario OffCatalogue(const TestObjects& objects, uint64_t seed) {
  auto random = Stream(seed, "kind");
  Scenario scenario = FullSet(objects);
  const std::string name = UnlistedKinds()[random() % UnlistedKinds().size()].name;
  scenario.with_temperature = name == "warm_bar" || random() % 2;
  scenario.unlisted = {UnlistedEffect(name, scenario, seed, 0.8 + 0.7 * Part(random))};
  return scenario;
}

// Nothing hidden in half of the sets, one realistic effect in the others.
Scenario Halves(Scenario scenario, uint64_t seed) {
  auto random = Stream(seed, "halves");
  return random() % 2 ? Realistic(scenario, seed, 1) : scenario;
}

Scenario WrongValue(const TestObjects& objects, uint64_t seed) {
  auto random = Stream(seed, "kind");
  Scenario scenario = FullSet(objects);
  const std::string effect =
      Pick<std::string>({"tip_radius", "oblique_slip", "object_push", "finger_spacing"}, random);
  scenario.hidden = {RealisticEffect(effect, scenario, seed)};
  scenario.in_model = {{effect, {scenario.hidden[0].values[0] * (random() % 2 ? 0.5 : 1.6)}}};
  return scenario;
}

Scenario NoiseMissing(const TestObjects& objects) {
  Scenario scenario = FullSet(objects);
  scenario.sigma_us = 47'790;
  scenario.noise_in_model = false;
  return scenario;
}

constexpr int kCopies = 1;  // per set: the sets are many

std::vector<Arm> MakeArms() {
  using W = const TestObjects&;
  std::vector<Arm> arms = {
      {"nothing", Kind::kNothing, 400, [](W w, uint64_t) { return FullSet(w); }, {}},
      {"bumps of 0.25 sigma",
       Kind::kNothing,
       200,
       [](W w, uint64_t s) { return Bumpy(w, s, 0.25); },
       {"surface_error"}},
      {"bumps of 0.5 sigma",
       Kind::kNothing,
       200,
       [](W w, uint64_t s) { return Bumpy(w, s, 0.5); },
       {"surface_error"}},
      {"one weak", Kind::kEffects, 200, Weak, {}},
      {"one",
       Kind::kEffects,
       200,
       [](W w, uint64_t s) { return Realistic(FullSet(w), s, 1); },
       {},
       Strength::kNone,
       false,
       kCopies},
      {"two", Kind::kEffects, 100, [](W w, uint64_t s) { return Realistic(FullSet(w), s, 2); }, {}},
      {"three", Kind::kEffects, 60, [](W w, uint64_t s) { return Realistic(FullSet(w), s, 3); }, {}},
      {"latency or length, one speed",
       Kind::kIndistinguishable,
       40,
       [](W w, uint64_t s) { return LatencyOrLength(w, s, false); },
       {}},
      {"latency or length, two speeds",
       Kind::kEffects,
       40,
       [](W w, uint64_t s) { return LatencyOrLength(w, s, true); },
       {}},
      {"stretched time", Kind::kIndistinguishable, 40, StretchedTime, {}},
      {"unlisted", Kind::kUnlisted, 140, OffCatalogue, {}},
      {"wrong value", Kind::kWrongValue, 40, WrongValue, {}},
      {"noise missing", Kind::kNoiseMissing, 20, [](W w, uint64_t) { return NoiseMissing(w); }, {}},
      {"one object",
       Kind::kEffects,
       40,
       [](W w, uint64_t s) {
         Scenario scenario = FullSet(w);
         scenario.objects = {w.solids[s % w.solids.size()]};
         return Halves(scenario, s);
       },
       {}},
      {"48 touches",
       Kind::kEffects,
       40,
       [](W w, uint64_t s) {
         Scenario scenario = FullSet(w);
         scenario.objects.resize(2), scenario.poses = 12, scenario.rounds = 2;
         return Halves(scenario, s);
       },
       {}},
      {"two speeds",
       Kind::kEffects,
       40,
       [](W w, uint64_t s) {
         Scenario scenario = FullSet(w);
         scenario.speeds_mm_s = {kSpeed, 35}, scenario.speed_by_round = s % 2;
         return Halves(scenario, s);
       },
       {}},
      {"20 % missing",
       Kind::kEffects,
       40,
       [](W w, uint64_t s) {
         Scenario scenario = FullSet(w);
         scenario.missing_share = 0.2;
         return Halves(scenario, s);
       },
       {"missed_contact"}},
      {"2 % outliers",
       Kind::kEffects,
       40,
       [](W w, uint64_t s) {
         Scenario scenario = FullSet(w);
         scenario.outlier_share = 0.02;
         return Halves(scenario, s);
       },
       {"heavy_tail_noise"}},
      {"no poses",
       Kind::kNoPoses,
       40,
       [](W w, uint64_t s) {
         Scenario scenario = FullSet(w);
         scenario.with_poses = false;
         return Halves(scenario, s);
       },
       {}},
  };
  for (Arm& arm : OutsideArms()) arms.push_back(std::move(arm));
  // What repeats show among themselves, without any pose. Last, since the place of an arm is a part
  // of its seeds.
  for (const char* effect : {"thermal_drift", "return_hysteresis", "heavy_tail_noise", "poll_interval"})
    arms.push_back({std::string("no poses, ") + effect,
                    Kind::kNoPoses,
                    20,
                    [effect](W w, uint64_t s) {
                      Scenario scenario = FullSet(w);
                      scenario.with_poses = false;
                      scenario.hidden = {RealisticEffect(effect, scenario, s)};
                      return scenario;
                    },
                    {}});
  arms.push_back(
      {"five", Kind::kEffects, 40, [](W w, uint64_t s) { return Realistic(FullSet(w), s, 5); }, {}});
  arms.push_back({"five, two speeds",
                  Kind::kEffects,
                  40,
                  [](W w, uint64_t s) {
                    Scenario scenario = FullSet(w);
                    scenario.speeds_mm_s = {kSpeed, 50}, scenario.speed_by_round = true;
                    return Realistic(scenario, s, 5);
                  },
                  {}});
  return arms;
}

}  // namespace

const std::vector<Arm>& Arms() {
  static const auto* arms = new std::vector<Arm>(MakeArms());
  return *arms;
}

const Arm* FindArm(const std::string& name) {
  for (const Arm& arm : Arms())
    if (arm.name == name) return &arm;
  return nullptr;
}

uint64_t SeedOf(Seeds seeds, const Arm& arm, int k) {
  const uint64_t base = seeds == Seeds::kTuning ? 1'000'000'000 : 9'000'000'000;
  return base + 1'000'000 * static_cast<uint64_t>(&arm - Arms().data()) + k;
}

std::vector<std::string> EquivalentEffects(const Hidden& truth, const Scenario& scenario) {
  const std::string& name = truth.effect;
  std::vector<std::string> equivalents;
  const auto class_of = [&](std::vector<std::string> members) {
    for (const std::string& member : members)
      if (member != name) equivalents.push_back(member);
  };
  const auto is = [&](std::vector<std::string> members) {
    return std::count(members.begin(), members.end(), name) > 0;
  };
  if (is({"speed_error", "clock_skew", "contact_slowdown"}))
    class_of({"speed_error", "clock_skew", "contact_slowdown"});
  if (is({"channel_latency", "finger_length"}) && scenario.speeds_mm_s.size() == 1)
    class_of({"channel_latency", "finger_length"});
  if (is({"gravity_sag"})) class_of({"gravity_sag", "object_pose"});
  // Time can only be stretched by a brake, not shrunk.
  const bool shrunk =
      (name == "speed_error" && truth.values[0] > 0) || (name == "clock_skew" && truth.values[0] < 0);
  if (shrunk)
    equivalents.erase(std::remove(equivalents.begin(), equivalents.end(), "contact_slowdown"),
                      equivalents.end());
  return equivalents;
}

}  // namespace touchstone::hidden
