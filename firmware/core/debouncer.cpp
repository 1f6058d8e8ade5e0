#include "firmware/core/debouncer.h"

namespace touchstone::firmware {

void Debouncer::Reset(bool active, uint64_t hold_ticks, uint64_t now) {
  settled_ = level_ = active;
  hold_ = hold_ticks;
  bucket_ = 0;
  updated_ = now;
  edge_count_ = 0;
}

Debouncer::Change Debouncer::OnEdge(bool active, uint64_t ticks) {
  Change change = Advance(ticks);
  if (active == level_) return change;
  level_ = active;
  if (level_ == settled_) return change;

  // Edges that no change can be dated by any more make room.
  size_t kept = 0;
  for (size_t i = 0; i < edge_count_; ++i) {
    if (edges_[i] + 2 * hold_ >= ticks) edges_[kept++] = edges_[i];
  }
  edge_count_ = kept < kEdges ? kept : kEdges - 1;
  edges_[edge_count_++] = ticks;
  if (bucket_ == 0 && ticks > updated_) updated_ = ticks;
  if (hold_ == 0) change = Settle(ticks);
  return change;
}

Debouncer::Change Debouncer::Advance(uint64_t now) {
  if (now <= updated_) return {};
  const uint64_t passed = now - updated_;
  if (level_ == settled_) {
    // Once it is empty nothing depends on the time: an edge that is handled late counts from its own.
    const uint64_t drained = bucket_ < passed ? bucket_ : passed;
    bucket_ -= drained;
    updated_ += drained;
    return {};
  }
  if (bucket_ + passed < hold_) {
    bucket_ += passed;
    updated_ = now;
    return {};
  }

  // It settled at the moment at which the bucket was full.
  const uint64_t full = updated_ + (hold_ - bucket_);
  updated_ = now;
  return Settle(full);
}

Debouncer::Change Debouncer::Settle(uint64_t now) {
  size_t first = 0;
  while (first + 1 < edge_count_ && edges_[first] + 2 * hold_ < now) ++first;
  Change change;
  change.changed = true;
  change.ticks = edge_count_ > 0 ? edges_[first] : now;
  settled_ = level_;
  bucket_ = 0;
  edge_count_ = 0;
  return change;
}

}  // namespace touchstone::firmware
