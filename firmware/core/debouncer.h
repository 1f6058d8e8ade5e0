// Separates presses of a microswitch from the bounce of its contacts and from spikes on its wire.
//
// The switch has a settled state. While the pin says the other one, a bucket fills with the time that passes;
// while the pin says the settled one, it empties, to 0 at least. When the bucket holds `hold` ticks the state
// changes; the time of the change is that of the earliest edge towards the new state in the 2 * hold before.
// Hence:
// - a spike shorter than `hold` is nothing, however often, if the pin is back for longer than it was away;
// - a press that bounces for `hold` at most, or has short drop-outs later, has exactly the time of its first
//   edge;
// - a spike that came more than 2 * hold before the state settled does not lend its time to a later press.
#pragma once

#include <cstddef>
#include <cstdint>

namespace touchstone::firmware {

class Debouncer {
 public:
  struct Change {
    bool changed = false;
    uint64_t ticks = 0;
  };

  // The state is settled as it is.
  void Reset(bool active, uint64_t hold_ticks, uint64_t now);
  // The pin's level changed; what settled before this edge is reported. An edge older than Advance's last time counts
  // from its own if the switch was at rest, else from there on; it keeps its own time in either case.
  Change OnEdge(bool active, uint64_t ticks);
  // Time has passed without an edge.
  Change Advance(uint64_t now);

  bool settled() const { return settled_; }
  bool level() const { return level_; }

 private:
  static constexpr size_t kEdges = 16;

  Change Settle(uint64_t now);

  bool settled_ = false;
  bool level_ = false;
  uint64_t hold_ = 0;
  uint64_t bucket_ = 0;
  uint64_t updated_ = 0;
  // Edges away from the settled state, oldest first. When there is no room the newest gives way: the
  // first one counts.
  uint64_t edges_[kEdges] = {};
  size_t edge_count_ = 0;
};

}  // namespace touchstone::firmware
