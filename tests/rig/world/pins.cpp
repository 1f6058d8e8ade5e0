#include "tests/rig/world/pins.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace touchstone::rig {
namespace {

// A resistor's voltage, ADC counts: it passes the middle at the edge, and is read every millisecond. Samples
// come so late that an edge which noise put before its contact is known by then.
constexpr double kFreeCounts = 60, kPressedCounts = 964, kMiddleCounts = 512, kCountsPerS = 40'000;
constexpr double kSampleS = 1e-3, kSampleLagS = 0.1, kQuietS = 0.05;

// A switch that bounces: pairs of edges, over well before the usual 5 ms.
constexpr int kMaxBounces = 5;
constexpr double kMinBounceS = 5e-5, kMaxBounceS = 3.5e-4;

}  // namespace

Pins::Pins(const std::string& sensor, int fingers, uint64_t seed, Sink sink)
    : bounces_(sensor == "microswitch"),
      analogue_(sensor == "resistor"),
      random_(seed),
      sink_(std::move(sink)),
      fingers_(fingers) {
  if (sensor != "optical" && !bounces_ && !analogue_)
    throw std::invalid_argument("no sensor is called '" + sensor +
                                "'; there are optical, microswitch, resistor");
}

void Pins::Add(const Edge& edge, bool bounce) {
  auto& coming = fingers_.at(edge.finger).coming;
  coming.push_back({edge.at_s, edge.known_s, edge.pressed});
  if (bounce && bounces_) {
    std::uniform_real_distribution<double> pause(kMinBounceS, kMaxBounceS);
    double at_s = edge.at_s;
    for (int k = 1 + static_cast<int>(random_() % kMaxBounces); k > 0; --k)
      for (const bool level : {!edge.pressed, edge.pressed})
        coming.push_back({at_s += pause(random_), edge.known_s, level});
  }
  std::stable_sort(coming.begin(), coming.end(),
                   [](const Level& a, const Level& b) { return a.at_s < b.at_s; });
}

double Pins::NextDueS() const {
  double due_s = std::numeric_limits<double>::infinity();
  for (const Finger& finger : fingers_)
    if (!finger.coming.empty())
      due_s = std::min(due_s, std::max(finger.coming.front().at_s, finger.coming.front().known_s));
  return due_s;
}

void Pins::Run(double now_s, int stuck) {
  if (analogue_) {
    for (size_t i = 0; i < fingers_.size(); ++i) RunSamples(i, now_s, stuck == static_cast<int>(i));
    return;
  }
  // Over all fingers in the order of time.
  for (;;) {
    int next = -1;
    for (size_t i = 0; i < fingers_.size(); ++i) {
      const auto& coming = fingers_[i].coming;
      if (coming.empty() || std::max(coming[0].at_s, coming[0].known_s) > now_s) continue;
      if (next < 0 || coming[0].at_s < fingers_[next].coming[0].at_s) next = i;
    }
    if (next < 0) break;
    Finger& finger = fingers_[next];
    const Level level = finger.coming.front();
    finger.coming.erase(finger.coming.begin());
    finger.level = level.level;
    if (stuck == next || finger.shown == level.level) continue;
    finger.shown = level.level;
    sink_.edge(next, level.level, level.at_s);
  }
  for (size_t i = 0; i < fingers_.size(); ++i) {
    const bool shown = fingers_[i].level || stuck == static_cast<int>(i);
    if (shown == fingers_[i].shown) continue;
    fingers_[i].shown = shown;
    sink_.edge(i, shown, now_s);
  }
}

double Pins::ValueAt(const Finger& finger, double at_s) const {
  double value = kFreeCounts;
  for (const auto* levels : {&finger.past, &finger.coming})
    for (const Level& level : *levels) {
      const double rise = (at_s - level.at_s) * kCountsPerS;
      const double shown =
          std::clamp(kMiddleCounts + (level.level ? rise : -rise), kFreeCounts, kPressedCounts);
      // A press only ever raises what was there, a release only lowers it.
      value = level.level ? std::max(value, shown) : std::min(value, shown);
    }
  return value;
}

void Pins::RunSamples(int i, double now_s, bool stuck) {
  Finger& finger = fingers_[i];
  const double until_s = now_s - kSampleLagS;
  if (finger.sampled_s == 0) finger.sampled_s = std::floor(until_s / kSampleS) * kSampleS;
  for (; finger.sampled_s + kSampleS <= until_s; finger.sampled_s += kSampleS) {
    const double at_s = finger.sampled_s + kSampleS;
    while (!finger.coming.empty() && finger.coming.front().at_s < at_s) {
      finger.level = finger.coming.front().level;
      finger.past.push_back(finger.coming.front());
      finger.coming.erase(finger.coming.begin());
    }
    if (finger.past.size() > 2) finger.past.erase(finger.past.begin(), finger.past.end() - 2);
    const int value = static_cast<int>(std::lround(stuck ? kPressedCounts : ValueAt(finger, at_s)));
    if (value == finger.last_value && at_s < finger.told_s + kQuietS) continue;
    // The sample before a change belongs to it: the device interpolates between neighbours.
    if (finger.last_value >= 0 && value != finger.last_value && finger.told_s < at_s - 1.5 * kSampleS)
      sink_.sample(i, static_cast<uint16_t>(finger.last_value), at_s - kSampleS);
    sink_.sample(i, static_cast<uint16_t>(value), at_s);
    finger.last_value = value, finger.told_s = at_s;
  }
}

void Pins::Repeat(double now_s) {
  for (size_t i = 0; i < fingers_.size(); ++i) {
    fingers_[i].last_value = -1;
    if (!analogue_) sink_.edge(i, fingers_[i].shown, now_s);
  }
}

}  // namespace touchstone::rig
