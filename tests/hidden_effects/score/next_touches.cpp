#include "tests/hidden_effects/score/next_touches.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <iterator>
#include <mutex>
#include <thread>

#include "server/base/status.h"
#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/score/arms/strengths.h"

namespace touchstone::hidden {
namespace {

constexpr int kBegin = 48;
// 6 nats: 400 to 1.
constexpr double kSure = 0.9975;
// Geometric effects that few touches cannot distinguish, although none are exactly equivalent.
constexpr const char* kEffects[] = {"tip_radius", "oblique_slip", "finger_spacing", "object_scale",
                                    "tool_yaw"};

bool RightAndSure(const diagnosis::report::Diagnosis& diagnosis, const std::string& effect) {
  return diagnosis.steps.size() == 1 && diagnosis.steps[0].effect == effect &&
         diagnosis.steps[0].equivalent.empty() && diagnosis.steps[0].probability >= kSure;
}

absl::StatusOr<std::vector<Command>> Proposed(const diagnosis::DiagnosisInput& input,
                                              const Scenario& scenario) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::report::Diagnosis diagnosis,
                              diagnosis::Propose(input, kAddedAtOnce, {}));
  std::vector<Command> commands;
  for (const diagnosis::report::NextMeasurement& next : diagnosis.next) {
    const auto& proposed = std::get<diagnosis::design::ProposedTouch>(next);
    const touch::CommandedTouch& touch = proposed.touch;
    Command command;
    while (command.object < static_cast<int>(scenario.objects.size()) &&
           scenario.objects[command.object]->name() != proposed.object)
      ++command.object;
    if (command.object == static_cast<int>(scenario.objects.size()))
      return absl::InternalError("a touch of an unknown object was proposed: " + proposed.object);
    command.target_mm = 1000 * touch.target_m;
    command.approach = touch.approach;
    command.lateral = touch.lateral;
    command.standoff_mm = 1000 * touch.standoff_m;
    command.speed_mm_s = 1000 * touch.speed_m_s;
    commands.push_back(command);
  }
  return commands;
}

// Touches that were added until the verdict; `*arrived` false if it was never right and sure.
absl::StatusOr<int> Added(const TestObjects& objects, const Scenario& scenario, bool designed, uint64_t seed,
                          bool* arrived, int* proposed_touches) {
  const std::vector<Command> random = DrawCommands(scenario, kBegin + kMaxAdded, seed);
  std::vector<Command> commands(random.begin(), random.begin() + kBegin);
  for (;;) {
    const Set set = GenerateFor(scenario, commands, seed);
    TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::DiagnosisInput input, InputFor(set, objects));
    TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::report::Diagnosis diagnosis, diagnosis::Diagnose(input, {}));
    const int added = static_cast<int>(commands.size()) - kBegin;
    *arrived = RightAndSure(diagnosis, scenario.hidden.front().effect);
    if (*arrived || added >= kMaxAdded) return added;
    std::vector<Command> next(random.begin() + commands.size(),
                              random.begin() + commands.size() + kAddedAtOnce);
    if (designed) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Command> proposed, Proposed(input, scenario));
      // What is not proposed is random.
      *proposed_touches += std::min<size_t>(proposed.size(), kAddedAtOnce);
      std::copy_n(proposed.begin(), std::min<size_t>(proposed.size(), kAddedAtOnce), next.begin());
    }
    commands.insert(commands.end(), next.begin(), next.end());
  }
}

}  // namespace

Race RunRace(const TestObjects& objects, uint64_t seed) {
  auto random = Stream(seed, "kind");
  Scenario scenario;
  scenario.objects = {objects.solids[0], objects.solids[4]};
  scenario.poses = kBegin / 2, scenario.rounds = 1;
  const std::string effect = kEffects[random() % std::size(kEffects)];
  scenario.hidden = {WeakEffect(effect, scenario, seed, 6)};
  Race race;
  race.truth = scenario;
  const auto designed = Added(objects, scenario, true, seed, &race.designed_arrived, &race.proposed);
  const auto others = Added(objects, scenario, false, seed, &race.random_arrived, nullptr);
  for (const auto* added : {&designed, &others})
    if (!added->ok()) race.error = added->status().ToString();
  if (race.error.empty()) race.designed = *designed, race.random = *others;
  return race;
}

Races RunRaces(const TestObjects& objects, Seeds seeds, int count, int threads,
               const std::function<void(const Race&)>& each) {
  Races sum;
  std::mutex mutex;
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int k = next++; k < count; k = next++) {
      // Seeds beyond those of the arms.
      const Race race = RunRace(objects, SeedOf(seeds, Arms().back(), 500'000 + k));
      const std::lock_guard<std::mutex> lock(mutex);
      ++sum.races;
      sum.errors += !race.error.empty();
      sum.designed += race.designed, sum.random += race.random;
      sum.designed_gave_up += !race.designed_arrived, sum.random_gave_up += !race.random_arrived;
      each(race);
    }
  };
  std::vector<std::thread> workers;
  for (int k = 0; k < threads; ++k) workers.emplace_back(work);
  for (std::thread& worker : workers) worker.join();
  return sum;
}

std::string RacesInWords(const Races& races) {
  if (races.races == 0) return "";
  const double share = races.random == 0 ? 0 : static_cast<double>(races.designed) / races.random;
  char text[400];
  snprintf(
      text, sizeof text,
      "Next touches: %d faint effects, verdicts of 6 nats. Touches that had to be added: %.1f designed, %.1f "
      "random; %.0f %% (target <= 50 %%, %s). No verdict within %d: %d designed, %d random. %d errors.\n",
      races.races, static_cast<double>(races.designed) / races.races,
      static_cast<double>(races.random) / races.races, 100 * share, share <= 0.5 ? "pass" : "**miss**",
      kMaxAdded, races.designed_gave_up, races.random_gave_up, races.errors);
  return text;
}

}  // namespace touchstone::hidden
