// The contacts of one touch as the device reports them, and which of its messages are accepted. Not thread-safe.
//
// A contact counts at once, because the arm has to stop, but is final only after the device's record of the touch
// was read twice with the same result: checksums make a damaged message rare, this makes it harmless.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/core/messages.h"
#include "server/gateway/effector/effector.h"

namespace touchstone::gateway::effector {

class ContactRecord {
 public:
  enum class Verdict {
    kNew,       // accepted
    kRepeated,  // known already; acknowledge again
    kStale,     // of an earlier touch
    kRejected   // implausible; not acknowledged, so that the device sends it again if it is true
  };

  // Forgets everything and waits for the device's Armed.
  void Begin(uint32_t touch, uint32_t boot_id, int fingers);
  // Whether `armed` may be the answer: this touch, and ticks between these two.
  bool OnArmed(const firmware::Armed& armed, uint64_t min_ticks, uint64_t max_ticks);
  // `max_ticks`: no contact can be later.
  Verdict OnEvent(const firmware::Event& event, uint64_t max_ticks);
  // One reading of the device's record. Once two in succession agree it replaces the events; returns whether.
  bool OnReading(const firmware::Recalled& recalled, uint64_t max_ticks);
  // No more events will come. What was read of the record before says nothing of a finger that had no contact yet: its
  // event may have been lost.
  void EndCapture();
  void MarkLost(std::string why);
  void SetPressed(uint32_t mask) { touch_.pressed_mask = mask; }

  // Of a finger that had contact and is not pressed any more it is not known yet when it let go.
  bool AwaitsRelease() const;

  const EffectorTouch& touch() const { return touch_; }
  bool armed() const { return armed_; }
  bool Complete() const { return touch_.Contacts() == static_cast<int>(touch_.contact_ticks.size()); }
  // Everything that can be known of the touch is known, and was read twice alike.
  bool Final() const { return touch_.touch != 0 && reconciled_ && (Complete() || !armed_) && lost_.empty(); }
  // The device's record should be read: every finger reported, or something contradicted itself.
  bool NeedsReconciliation() const {
    return touch_.touch != 0 && lost_.empty() && !reconciled_ && (doubtful_ || Complete());
  }
  const std::string& lost() const { return lost_; }

 private:
  EffectorTouch touch_;
  bool waiting_ = false;  // for Armed
  bool armed_ = false;
  bool doubtful_ = false;
  bool reconciled_ = false;
  std::string lost_;
  bool has_reading_ = false;
  firmware::Recalled reading_;
};

// The contacts of a record as the device sends it.
std::vector<std::optional<uint64_t>> ContactsOf(const firmware::Recalled& recalled);
// Whether both say the same, apart from contacts that were made between them.
bool Agree(const firmware::Recalled& earlier, const firmware::Recalled& later);

}  // namespace touchstone::gateway::effector
