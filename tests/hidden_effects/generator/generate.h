// The oracle: a second, independent simulation of the rig, written from the definitions of the effects alone.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tests/hidden_effects/generator/scenario.h"

namespace touchstone::hidden {

struct Command {
  int object = 0, face = 0;
  int pose = -1;  // equal numbers, equal commands; -1: alone
  int round = 0;
  Eigen::Vector3d target_mm, approach, lateral;
  double standoff_mm = 0, speed_mm_s = 0;  // 0: the scenario's
};

struct Set {
  std::string csv;         // a measurement file (proto/README.md)
  std::string model_yaml;  // the nominal model, as the lab has it
  Scenario truth;          // what was asked for
  int touches = 0;
  std::vector<Command> commands;                                // one per touch
  std::vector<double> speed_mm_s, session_time_s, temperature;  // one per touch
  std::vector<double> exact_time_us;  // [touch * fingers + finger]: with every hidden effect, without noise
  std::vector<double> reported_us;    // the same with noise, polling, outliers; NaN: nothing reported
};

// A pure function. Draws of poses, session times, noise, bumps and losses come from separate streams of the
// seed, so that two scenarios that differ in one thing differ in that thing only.
Set Generate(const Scenario& scenario, uint64_t seed);

// `count` touches, the six faces in turn, object by object in turn. A larger count begins with the same touches.
std::vector<Command> DrawCommands(const Scenario& scenario, int count, uint64_t seed);

// A session of these touches, once each. The times of a longer list begin with those of its first touches.
Set GenerateFor(const Scenario& scenario, const std::vector<Command>& commands, uint64_t seed);

// Only exact_time_us, for poses that Generate has drawn: the effects without noise.
std::vector<double> ExactTimesUs(const Scenario& scenario, const Set& like, uint64_t seed);

// sqrt(sum ||P (a - b)||^2) / sigma over all touches: the size of an effect in standard errors.
double SignalInStandardErrors(const std::vector<double>& a_us, const std::vector<double>& b_us, int fingers,
                              double sigma_us);

}  // namespace touchstone::hidden
