// What is known of one touch, and which messages of the device are believed about it. Not thread-safe.
//
// A contact counts at once, because the arm has to stop, but is settled only after the device's record of the
// touch was read twice and agreed: checksums make a damaged message rare, this makes it harmless.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/core/messages.h"
#include "server/gateway/effector/effector.h"

namespace touchstone {

class ContactRecord {
 public:
  enum class Verdict {
    kNews,         // believed and new
    kRepeated,     // known already; acknowledge again
    kStale,        // of an earlier touch
    kUnbelievable  // acknowledge not: if the device means it, it comes again
  };

  // Forgets everything and waits for the device's Armed.
  void Begin(uint32_t touch, uint32_t boot_id, int fingers);
  // Whether `armed` may be the answer: this touch, and ticks between these two.
  bool Arm(const firmware::Armed& armed, uint64_t min_ticks, uint64_t max_ticks);
  // `max_ticks`: no contact can be later.
  Verdict Take(const firmware::Event& event, uint64_t max_ticks);
  // One reading of the device's record. Once two in succession agree it replaces what was heard; returns
  // whether.
  bool Settle(const firmware::Recalled& recalled, uint64_t max_ticks);
  // Nothing more will be heard.
  void Disarm() { armed_ = false; }
  void Lose(std::string why);

  const EffectorTouch& touch() const { return touch_; }
  bool armed() const { return armed_; }
  bool Complete() const { return touch_.Contacts() == static_cast<int>(touch_.contact_ticks.size()); }
  // All that will ever be known is known and agreed.
  bool Final() const { return touch_.touch != 0 && settled_ && (Complete() || !armed_) && lost_.empty(); }
  // The device's record should be read: every finger reported, or something contradicted itself.
  bool WantsSettling() const {
    return touch_.touch != 0 && lost_.empty() && !settled_ && (doubtful_ || Complete());
  }
  const std::string& lost() const { return lost_; }

 private:
  EffectorTouch touch_;
  bool waiting_ = false;  // for Armed
  bool armed_ = false;
  bool doubtful_ = false;
  bool settled_ = false;
  std::string lost_;
  bool has_reading_ = false;
  firmware::Recalled reading_;
};

// The contacts of a record as the device tells it.
std::vector<std::optional<uint64_t>> ContactsOf(const firmware::Recalled& recalled);
// Whether both tell the same, apart from what came to pass between them.
bool Agree(const firmware::Recalled& earlier, const firmware::Recalled& later);

}  // namespace touchstone
