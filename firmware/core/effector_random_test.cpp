// Random touches of 1 to 8 interrupters and switches over a line that loses, against a simple oracle: what
// was pressed when.
#include <algorithm>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "firmware/core/test_device.h"

namespace touchstone::firmware {
namespace {

constexpr uint32_t kDebounceUs = 4000;

struct PinEdge {
  uint64_t ticks;
  int finger;
  bool level;
  bool operator<(const PinEdge& other) const { return ticks < other.ticks; }
};

// A press or a release at `at` (ticks of 1 us): one edge, or a bounce shorter than the debounce time.
void AddChange(std::mt19937* random, Sensor sensor, int finger, bool pressed, uint64_t at,
               std::vector<PinEdge>* edges) {
  edges->push_back({at, finger, pressed});
  if (sensor != Sensor::kMicroswitch) return;
  const uint64_t end = at + kDebounceUs - 100;
  bool level = pressed;
  for (uint64_t bounce = at + 1 + (*random)() % 900; bounce < end; bounce += 1 + (*random)() % 900) {
    if ((*random)() % 4 == 0) break;
    level = !level;
    edges->push_back({bounce, finger, level});
    at = bounce;
  }
  if (level != pressed) edges->push_back({at + 1, finger, pressed});
}

class RandomTouches : public testing::TestWithParam<int> {};

TEST_P(RandomTouches, AreReportedOnceEachAsTheyWere) {
  const int fingers = GetParam();
  std::mt19937 random(static_cast<unsigned>(fingers));
  const uint8_t bits = fingers % 2 ? 24 : 32;
  // The counter wraps in the middle of it.
  auto device = std::make_unique<TestDevice>(1000000, bits, (uint64_t{1} << bits) - 3000000);
  Configure configure;
  configure.fingers = static_cast<uint8_t>(fingers);
  for (int i = 0; i < fingers; ++i) {
    FingerConfig& finger = configure.finger[i];
    finger.sensor = static_cast<Sensor>(random() % 2);
    finger.debounce_us = kDebounceUs;
    finger.active_level = static_cast<uint8_t>(random() % 2);
    device->Edge(i, finger.active_level == 0);
  }
  Configured configured;
  ASSERT_TRUE(device->Ask(configure, &configured));

  std::map<std::pair<uint32_t, uint32_t>, Event> heard;  // by touch and number
  uint64_t repeats = 0;
  for (uint32_t touch = 1; touch <= 60; ++touch) {
    Armed armed;
    ASSERT_TRUE(device->DoArm(touch, &armed));
    std::vector<PinEdge> edges;
    std::vector<std::pair<uint64_t, uint64_t>> truth(
        static_cast<size_t>(fingers));  // contact, release; 0: none
    for (int i = 0; i < fingers; ++i) {
      if (random() % 8 == 0) continue;  // misses
      auto& [contact, release] = truth[static_cast<size_t>(i)];
      contact = armed.ticks + 1 + random() % 50000;
      release = contact + 20000 + random() % 50000;
      AddChange(&random, configure.finger[i].sensor, i, true, contact, &edges);
      AddChange(&random, configure.finger[i].sensor, i, false, release, &edges);
    }
    std::stable_sort(edges.begin(), edges.end());

    const auto listen = [&] {
      for (Event event; device->Take(&event);) {
        if (random() % 2) continue;  // lost on the way
        const auto [place, is_new] = heard.insert({{event.touch, event.number}, event});
        repeats += !is_new;
        EXPECT_EQ(place->second.ticks, event.ticks);
        EXPECT_EQ(place->second.finger, event.finger);
        if (random() % 2) device->DoAcknowledge(event.number);  // the others are lost
      }
      device->Drop();
    };
    for (const PinEdge& edge : edges) {
      // Handled up to half a millisecond after it was captured.
      device->RunTo(std::max(device->now(), edge.ticks + random() % 500));
      device->EdgeAt(edge.finger, edge.level == (configure.finger[edge.finger].active_level != 0),
                     edge.ticks);
      listen();
    }
    for (int i = 0; i < 60; ++i) {
      device->RunMs(20);
      listen();
    }

    // Every change once, at its time, and no other.
    std::vector<std::pair<uint64_t, uint64_t>> reported(static_cast<size_t>(fingers));
    for (const auto& [name, event] : heard) {
      if (name.first != touch) continue;
      auto& finger = reported[event.finger];
      uint64_t& ticks = event.kind == EventKind::kContact ? finger.first : finger.second;
      EXPECT_EQ(ticks, 0u) << "twice under two numbers";
      ticks = event.ticks;
    }
    EXPECT_EQ(reported, truth) << "touch " << touch;
    Recalled record;
    ASSERT_TRUE(device->Ask(Recall{touch}, &record));
    for (int i = 0; i < fingers; ++i) EXPECT_EQ(record.ticks[i], truth[static_cast<size_t>(i)].first);
  }
  EXPECT_GT(repeats, 0u);
  Status status;
  ASSERT_TRUE(device->Ask(StatusRequest{}, &status));
  EXPECT_EQ(status.lost_events, 0u);
}

INSTANTIATE_TEST_SUITE_P(Fingers, RandomTouches, testing::Range(1, kMaxFingers + 1));

// Any edges at all: a plain reading of the rule on a grid of microseconds, without buckets of unequal steps
// or memory of few edges.
TEST(Debouncer, DoesAsTheRuleSaysOnRandomEdges) {
  constexpr uint64_t kHold = 400;
  for (unsigned seed = 1; seed <= 300; ++seed) {
    std::mt19937 random(seed);
    std::vector<bool> level(20000, false);
    bool now = false;
    for (size_t t = 1; t < level.size();) {
      const size_t run = 1 + random() % (random() % 4 == 0 ? 900 : 120);
      now = !now;
      for (size_t i = 0; i < run && t < level.size(); ++i) level[t++] = now;
    }

    // The oracle.
    std::vector<std::pair<bool, uint64_t>> expected, found;
    bool settled = false;
    uint64_t bucket = 0;
    std::vector<uint64_t> away;
    for (uint64_t t = 1; t < level.size(); ++t) {
      // What passed in [t - 1, t) has the level of t - 1.
      if (level[t - 1] != settled) {
        if (++bucket == kHold) {
          uint64_t first = 0;
          for (uint64_t edge : away) {
            if (edge + 2 * kHold >= t) {
              first = edge;
              break;
            }
          }
          settled = !settled;
          expected.push_back({settled, first});
          bucket = 0;
          away.clear();
        }
      } else if (bucket > 0) {
        --bucket;
      }
      if (level[t] != level[t - 1] && level[t] != settled) away.push_back(t);
    }

    Debouncer debouncer;
    debouncer.Reset(false, kHold, 0);
    const auto note = [&](const Debouncer::Change& change) {
      if (change.changed) found.push_back({debouncer.settled(), change.ticks});
    };
    for (uint64_t t = 1; t < level.size(); ++t) {
      if (level[t] != level[t - 1]) note(debouncer.OnEdge(level[t], t));
      if (random() % 50 == 0) note(debouncer.Advance(t));
    }
    note(debouncer.Advance(level.size() - 1));
    ASSERT_EQ(found, expected) << "seed " << seed;
  }
}

}  // namespace
}  // namespace touchstone::firmware
