// What the sensors of the fingers put on the pins of the device: clean edges (optical), edges that bounce
// (microswitch), or a voltage that passes the threshold at the right moment (resistor). Used by one thread.
#pragma once

#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/rig/world/fingers.h"

namespace touchstone::rig {

class Pins {
 public:
  // Sinks for what the hardware captures; `at_s` is the simulated time of the capture, in order
  // for each finger.
  struct Sink {
    std::function<void(int finger, bool level, double at_s)> edge;
    std::function<void(int finger, uint16_t value, double at_s)> sample;
  };
  // sensor: "optical", "microswitch" or "resistor"; throws std::invalid_argument for another.
  Pins(const std::string& sensor, int fingers, uint64_t seed, Sink sink);

  void Add(const Edge& edge, bool bounce);
  // Hands over everything that is known by now; `stuck` reads pressed whatever it does (-1: none).
  void Run(double now_s, int stuck);
  // When an edge is due next; infinite if none is.
  double NextDueS() const;
  // After a reset: tells how every pin stands, as hardware that is read at the start.
  void Repeat(double now_s);

 private:
  struct Level {
    double at_s, known_s;
    bool level;
  };
  struct Finger {
    std::vector<Level> coming;  // by time
    std::vector<Level> past;    // resistor: what its voltage still shows
    bool level = false;         // of the sensor
    bool shown = false;         // of the pin: otherwise only when stuck
    double sampled_s = 0;       // resistor: until when
    int last_value = -1;
    double told_s = 0;
  };
  void RunEdges(int finger, double now_s, bool stuck);
  void RunSamples(int finger, double now_s, bool stuck);
  double ValueAt(const Finger& finger, double at_s) const;

  bool bounces_, analogue_;
  std::mt19937_64 random_;
  Sink sink_;
  std::vector<Finger> fingers_;
};

}  // namespace touchstone::rig
