#include "server/diagnosis/selection/session/session_parts.h"

#include <algorithm>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "server/diagnosis/selection/session/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// "round 2", "rounds 0 and 1".
std::string WordsOfRounds(const std::vector<int>& rounds) {
  if (rounds.size() == 1) return absl::StrCat("in round ", rounds[0]);
  return absl::StrCat("in rounds ", absl::StrJoin(rounds.begin(), rounds.end() - 1, ", "), " and ",
                      rounds.back());
}

// Bit i of each: whether the i-th round is in the set. No set stands beside its complement.
std::vector<uint64_t> SetsOfRounds(size_t rounds) {
  std::vector<uint64_t> sets;
  const uint64_t all = (uint64_t{1} << rounds) - 1;
  const auto add = [&](uint64_t set) {
    if (set == 0 || set == all) return;
    for (const uint64_t other : sets)
      if (other == set || other == (all & ~set)) return;
    sets.push_back(set);
  };
  for (size_t i = 0; i < rounds; ++i) add(uint64_t{1} << i);
  for (size_t i = 1; i < rounds; ++i) add((uint64_t{1} << i) - 1);
  add(all & 0x5555555555555555u);
  if (rounds <= kSessionRules.max_rounds_in_every_set)
    for (uint64_t set = 1; set < all; ++set) add(set);
  return sets;
}

class PartList {
 public:
  explicit PartList(const touches::Observations& o) : o_(o) {
    for (int k = 0; k < o.size(); ++k)
      if (o.used[k]) used_.push_back(k);
  }

  void AddRounds() {
    const std::vector<int> round_of = touches::RoundsOfTouches(o_);
    std::set<int> numbers;
    for (const int k : used_) numbers.insert(round_of[k]);
    const std::vector<int> rounds(numbers.begin(), numbers.end());
    if (rounds.size() < 2 || static_cast<int>(rounds.size()) > kSessionRules.max_rounds) return;
    for (uint64_t set : SetsOfRounds(rounds.size())) {
      std::vector<char> has(o_.size(), 0);
      const auto contains = [&](int k) {
        const auto at = std::lower_bound(rounds.begin(), rounds.end(), round_of[k]) - rounds.begin();
        return (set >> at & 1) != 0;
      };
      size_t count = 0;
      for (const int k : used_) count += contains(k);
      if (2 * count > used_.size()) set ^= (uint64_t{1} << rounds.size()) - 1;
      for (const int k : used_) has[k] = contains(k);
      std::vector<int> members;
      for (size_t i = 0; i < rounds.size(); ++i)
        if (set >> i & 1) members.push_back(rounds[i]);
      parts_.push_back({WordsOfRounds(members), std::move(has), true});
    }
  }

  void AddStretches() {
    for (int from = 0; from < kSessionRules.stretches; ++from)
      for (int to = from + 1; to <= kSessionRules.stretches; ++to) {
        const size_t begin = used_.size() * from / kSessionRules.stretches,
                     end = used_.size() * to / kSessionRules.stretches;
        if (begin == end || 2 * (end - begin) > used_.size()) continue;
        std::vector<char> has(o_.size(), 0);
        for (size_t i = begin; i < end; ++i) has[used_[i]] = 1;
        parts_.push_back({StretchInWords(begin, end), std::move(has), false});
      }
  }

  std::vector<SessionPart> Take() { return std::move(parts_); }

 private:
  std::string StretchInWords(size_t begin, size_t end) const {
    const auto number = [this](size_t i) { return absl::StrCat("touch ", o_.set->touch[o_.row[used_[i]]]); };
    if (begin == 0) return absl::StrCat("up to ", number(end - 1));
    if (end == used_.size()) return absl::StrCat("from ", number(begin), " on");
    return absl::StrCat("from ", number(begin), " to ", number(end - 1));
  }

  const touches::Observations& o_;
  std::vector<int> used_;
  std::vector<SessionPart> parts_;
};

}  // namespace

std::vector<SessionPart> ListSessionParts(const touches::Observations& observations) {
  PartList list(observations);
  list.AddRounds();
  list.AddStretches();
  return list.Take();
}

}  // namespace touchstone::diagnosis::selection
