// Arms outside the catalogue: causes that it does not describe as they stand, mistakes in files, and few data.
#include <utility>

#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/score/arms/arms.h"
#include "tests/hidden_effects/score/arms/outside_strengths.h"
#include "tests/hidden_effects/score/arms/strengths.h"

namespace touchstone::hidden {
namespace {

constexpr int kSets = 20, kDataErrorSets = 10;

using Draw = std::function<Scenario(const TestObjects&, uint64_t seed, Strength strength)>;

Scenario WholeSet(const TestObjects& objects) {
  Scenario scenario;
  scenario.objects = objects.solids;
  return scenario;
}

double Drawn(double low, double high, uint64_t seed) {
  auto random = Stream(seed, "number");
  return std::uniform_real_distribution<double>(low, high)(random);
}

// One of three by the strength.
double ByStrength(Strength strength, double weak, double realistic, double strong) {
  return strength == Strength::kWeak ? weak : strength == Strength::kRealistic ? realistic : strong;
}

Draw WithCause(CauseKind kind) {
  return [kind](const TestObjects& objects, uint64_t seed, Strength strength) {
    Scenario scenario = WholeSet(objects);
    scenario.causes = {DrawnCause(kind, scenario, seed, strength)};
    return scenario;
  };
}

// 160 touches (weak), the whole set with a realistic effect of the catalogue beside (realistic), the whole set alone.
Draw WithDataErrorOf(DataErrorKind kind) {
  return [kind](const TestObjects& objects, uint64_t seed, Strength strength) {
    Scenario scenario = WholeSet(objects);
    if (strength == Strength::kWeak) scenario.poses = 8;
    if (strength == Strength::kRealistic) {
      auto random = Stream(seed, "kind");
      const auto& effects = EffectsOfExpectation();
      scenario.hidden = {RealisticEffect(effects[random() % effects.size()], scenario, seed)};
    }
    scenario.data_errors = {DrawnDataError(kind, scenario, seed, strength)};
    return scenario;
  };
}

Scenario BeyondItsBound(const TestObjects& objects, uint64_t seed, Strength strength) {
  Scenario scenario = WholeSet(objects);
  scenario.hidden = {BeyondBound(scenario, seed, strength)};
  return scenario;
}

// 0.1 mm, the 0.25 mm that printing does at worst, or 0.5 mm RMS.
Scenario BadPrint(const TestObjects& objects, uint64_t seed, Strength strength) {
  Scenario scenario = WholeSet(objects);
  const double rms_mm = ByStrength(strength, 0.1, 0.25, 0.5) * Drawn(0.8, 1.2, seed);
  scenario.hidden = {{"surface_error", {rms_mm, Drawn(12, 40, seed + 1)}}};
  return scenario;
}

// Lengths of the outer fingers, in the model already, against each other: a tilt would fit as well.
Scenario OldLengths(const TestObjects& objects, uint64_t seed, Strength strength) {
  Scenario scenario = WholeSet(objects);
  const double old_mm = Drawn(0.2, 0.4, seed);
  const double off_mm = ByStrength(strength, 0.03, 0.15, 0.6) * Drawn(0.8, 1.2, seed + 1);
  const double real_mm = old_mm + (seed % 2 ? off_mm : -off_mm);
  scenario.in_model = {{"finger_length", {old_mm, 0, -old_mm}}};
  scenario.hidden = {{"finger_length", {real_mm, 0, -real_mm}}};
  return scenario;
}

Scenario PollingThatIsNotThere(const TestObjects& objects, uint64_t seed, Strength strength) {
  Scenario scenario = WholeSet(objects);
  const double interval_us = ByStrength(strength, 2, 5, 15) * Drawn(0.8, 1.2, seed) * scenario.sigma_us;
  scenario.in_model = {{"poll_interval", {interval_us}}};
  return scenario;
}

Scenario TailsThatAreNotThere(const TestObjects& objects, uint64_t seed, Strength strength) {
  Scenario scenario = WholeSet(objects);
  scenario.in_model = {{"heavy_tail_noise", {ByStrength(strength, 8, 4, 2.5) * Drawn(0.9, 1.1, seed)}}};
  return scenario;
}

// Nothing hidden but the noise the model has (weak), an effect that would show (realistic), or six times the noise that
// the model claims (strong).
Draw Few(int touches) {
  return [touches](const TestObjects& objects, uint64_t seed, Strength strength) {
    Scenario scenario = WholeSet(objects);
    scenario.objects = {objects.solids[seed % objects.solids.size()]};
    scenario.poses = touches, scenario.rounds = 1;
    if (strength == Strength::kRealistic) scenario.hidden = {{"finger_length", {0.4, -0.2, -0.2}}};
    if (strength == Strength::kStrong)
      scenario.model_sigma_us = scenario.sigma_us, scenario.sigma_us = 6 * scenario.sigma_us;
    return scenario;
  };
}

struct Outside {
  const char* name;
  Kind kind;
  Draw draw;
  bool depends_on_time = false;
};

std::vector<Outside> Causes() {
  return {
      {"session wave", Kind::kCause, WithCause(CauseKind::kSessionWave), true},
      {"warm-up", Kind::kCause, WithCause(CauseKind::kWarmUp), true},
      {"mid-session offset", Kind::kCause, WithCause(CauseKind::kMidSession), true},
      {"random walk", Kind::kCause, WithCause(CauseKind::kRandomWalk), true},
      {"noise with memory", Kind::kCause, WithCause(CauseKind::kNoiseWithMemory)},
      {"incidence wave", Kind::kCause, WithCause(CauseKind::kIncidenceWave)},
      {"finger coupling", Kind::kCause, WithCause(CauseKind::kFingerCoupling)},
      {"slip on one object", Kind::kCause, WithCause(CauseKind::kSlipOnOneObject)},
      {"push on one object", Kind::kCause, WithCause(CauseKind::kPushOnOneObject)},
      {"slip in one round", Kind::kCause, WithCause(CauseKind::kSlipInOneRound)},
      {"push in one round", Kind::kCause, WithCause(CauseKind::kPushInOneRound)},
      {"remounted each round", Kind::kCause, WithCause(CauseKind::kRemounted)},
      {"error of each pose", Kind::kCause, WithCause(CauseKind::kPoseError)},
      {"beyond its bound", Kind::kBeyondBound, BeyondItsBound},
      {"bad print", Kind::kBadPrint, BadPrint},
      {"old value wrong", Kind::kOldValue, OldLengths},
      {"polling that is not there", Kind::kWrongNoise, PollingThatIsNotThere},
      {"tails that are not there", Kind::kWrongNoise, TailsThatAreNotThere},
  };
}

std::vector<Outside> Mistakes() {
  const auto data_error = [](const char* name, DataErrorKind kind) {
    return Outside{name, Kind::kDataError, WithDataErrorOf(kind)};
  };
  return {
      data_error("lateral reversed", DataErrorKind::kLateralReversed),
      data_error("approach reversed", DataErrorKind::kApproachReversed),
      data_error("fingers permuted", DataErrorKind::kFingersPermuted),
      data_error("column sorted", DataErrorKind::kColumnSorted),
      data_error("objects swapped", DataErrorKind::kObjectsSwapped),
      data_error("wrong object", DataErrorKind::kWrongObject),
      data_error("time units", DataErrorKind::kTimeUnits),
      data_error("length units", DataErrorKind::kLengthUnits),
      data_error("speed factor", DataErrorKind::kSpeedFactor),
      data_error("object lower", DataErrorKind::kObjectLower),
      data_error("frame turned", DataErrorKind::kFrameTurned),
      data_error("rows shifted", DataErrorKind::kRowsShifted),
      data_error("copies", DataErrorKind::kCopies),
      {"1 touch", Kind::kTooFew, Few(1)},
      {"6 touches", Kind::kTooFew, Few(6)},
  };
}

}  // namespace

std::vector<Arm> OutsideArms() {
  std::vector<Outside> all = Causes();
  for (Outside& mistake : Mistakes()) all.push_back(std::move(mistake));
  std::vector<Arm> arms;
  for (const Outside& outside : all)
    for (const auto& [word, strength] :
         {std::pair{"weak", Strength::kWeak}, std::pair{"realistic", Strength::kRealistic},
          std::pair{"strong", Strength::kStrong}}) {
      Arm arm;
      arm.name = std::string(outside.name) + ", " + word;
      arm.kind = outside.kind;
      arm.sets = outside.kind == Kind::kDataError ? kDataErrorSets : kSets;
      arm.draw = [draw = outside.draw, strength = strength](const TestObjects& objects, uint64_t seed) {
        return draw(objects, seed, strength);
      };
      arm.strength = strength;
      arm.depends_on_time = outside.depends_on_time;
      arms.push_back(std::move(arm));
    }
  return arms;
}

}  // namespace touchstone::hidden
