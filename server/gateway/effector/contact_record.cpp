#include "server/gateway/effector/contact_record.h"

#include <algorithm>
#include <utility>

namespace touchstone::gateway::effector {

int EffectorTouch::Contacts() const {
  return static_cast<int>(
      std::count_if(contact_ticks.begin(), contact_ticks.end(),
                    [](const std::optional<uint64_t>& ticks) { return ticks.has_value(); }));
}

std::vector<std::optional<uint64_t>> ContactsOf(const firmware::Recalled& recalled) {
  std::vector<std::optional<uint64_t>> contacts(recalled.fingers);
  for (int i = 0; i < recalled.fingers && i < firmware::kMaxFingers; ++i)
    if ((recalled.contact_mask >> i & 1) != 0) contacts[i] = recalled.ticks[i];
  return contacts;
}

bool Agree(const firmware::Recalled& earlier, const firmware::Recalled& later) {
  if (earlier.touch != later.touch || earlier.fingers != later.fingers) return false;
  if ((earlier.contact_mask & ~later.contact_mask) != 0) return false;
  for (int i = 0; i < firmware::kMaxFingers; ++i)
    if ((earlier.contact_mask >> i & 1) != 0 && earlier.ticks[i] != later.ticks[i]) return false;
  return true;
}

void ContactRecord::Begin(uint32_t touch, uint32_t boot_id, int fingers) {
  *this = ContactRecord();
  touch_.touch = touch;
  touch_.boot_id = boot_id;
  touch_.contact_ticks.resize(fingers);
  touch_.release_ticks.resize(fingers);
  waiting_ = true;
}

bool ContactRecord::OnArmed(const firmware::Armed& armed, uint64_t min_ticks, uint64_t max_ticks) {
  if (!waiting_ || armed.touch != touch_.touch) return false;
  if (armed.ticks < min_ticks || armed.ticks > max_ticks) return false;
  touch_.armed_ticks = armed.ticks;
  waiting_ = false;
  armed_ = true;
  return true;
}

void ContactRecord::EndCapture() {
  if (armed_ && !Complete()) reconciled_ = has_reading_ = false;
  armed_ = false;
}

bool ContactRecord::AwaitsRelease() const {
  for (size_t i = 0; i < touch_.contact_ticks.size(); ++i) {
    const bool pressed = (touch_.pressed_mask >> i & 1) != 0;
    if (touch_.contact_ticks[i].has_value() && !pressed && !touch_.release_ticks[i].has_value()) return true;
  }
  return false;
}

void ContactRecord::MarkLost(std::string why) {
  if (Final()) return;
  armed_ = false;
  lost_ = std::move(why);
}

ContactRecord::Verdict ContactRecord::OnEvent(const firmware::Event& event, uint64_t max_ticks) {
  if (event.touch != touch_.touch) return Verdict::kStale;
  // Before Armed came it is not known what is too early; the event will come again.
  if (waiting_ || event.finger >= touch_.contact_ticks.size()) return Verdict::kRejected;
  if (event.ticks < touch_.armed_ticks || event.ticks > max_ticks) return Verdict::kRejected;
  if (event.kind == firmware::EventKind::kRelease) {
    // The device tells the first release alone, and may tell it before the contact, whose event was lost.
    std::optional<uint64_t>& release = touch_.release_ticks[event.finger];
    if (release.has_value()) return *release == event.ticks ? Verdict::kRepeated : Verdict::kRejected;
    release = event.ticks;
    return Verdict::kNew;
  }
  std::optional<uint64_t>& contact = touch_.contact_ticks[event.finger];
  if (contact.has_value()) {
    if (*contact == event.ticks) return Verdict::kRepeated;
    if (!reconciled_) doubtful_ = true;
    return Verdict::kRejected;
  }
  if (reconciled_ || !armed_) {
    // The device kept no such contact when its record was read, or is not armed: read it again.
    reconciled_ = false;
    doubtful_ = true;
  }
  contact = event.ticks;
  return Verdict::kNew;
}

bool ContactRecord::OnReading(const firmware::Recalled& recalled, uint64_t max_ticks) {
  if (recalled.touch != touch_.touch || recalled.fingers != touch_.contact_ticks.size()) return false;
  for (int i = 0; i < recalled.fingers; ++i) {
    if ((recalled.contact_mask >> i & 1) == 0) continue;
    if (recalled.ticks[i] < touch_.armed_ticks || recalled.ticks[i] > max_ticks) return false;
  }
  const bool agreed = has_reading_ && Agree(reading_, recalled);
  reading_ = recalled;
  has_reading_ = !agreed;
  if (!agreed) return false;
  touch_.contact_ticks = ContactsOf(recalled);
  reconciled_ = true;
  doubtful_ = false;
  return true;
}

}  // namespace touchstone::gateway::effector
