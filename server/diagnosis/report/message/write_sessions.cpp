#include "server/diagnosis/report/message/write_sessions.h"

#include "server/base/units.h"

namespace touchstone::diagnosis::report {
namespace {

v1::ComparedEffect::Change ToMessage(joint::ValueChange change) {
  switch (change) {
    case joint::ValueChange::kUnchanged:
      return v1::ComparedEffect::UNCHANGED;
    case joint::ValueChange::kChanged:
      return v1::ComparedEffect::CHANGED;
    case joint::ValueChange::kCannotSay:
      return v1::ComparedEffect::CANNOT_SAY;
  }
  return v1::ComparedEffect::CHANGE_UNSPECIFIED;
}

// One that changed, else one that may have.
joint::ValueChange ChangeOf(const joint::ComparedEffect& effect) {
  joint::ValueChange change = joint::ValueChange::kUnchanged;
  for (const joint::ComparedValue& value : effect.entries) {
    if (value.change == joint::ValueChange::kChanged) return value.change;
    if (value.change == joint::ValueChange::kCannotSay) change = value.change;
  }
  return change;
}

void WriteBySession(const joint::ComparedValue& value, const std::vector<int>& taking_part,
                    v1::ComparedValue* message) {
  for (size_t session = 0; session < value.by_session.size(); ++session) {
    if (!value.by_session[session]) continue;
    const engine::ParameterEstimate& estimate = *value.by_session[session];
    v1::SessionValue* to = message->add_sessions();
    to->set_session(static_cast<uint32_t>(taking_part[session]));
    to->set_value(estimate.value);
    to->set_std_error(estimate.std_error);
    if (!value.limits[session]) continue;
    to->set_limit_lower(value.limits[session]->lower);
    to->set_limit_upper(value.limits[session]->upper);
    to->set_outside(value.limits[session]->outside);
  }
  message->set_between_sessions(value.scatter);
}

void WriteEffect(const joint::ComparedEffect& effect, const std::vector<int>& taking_part,
                 v1::ComparedEffect* message) {
  message->set_effect(effect.effect);
  message->set_object(effect.object);
  message->set_change(ToMessage(ChangeOf(effect)));
  message->set_p(effect.p);
  message->set_gain_nats(effect.gain_nats);
  *message->mutable_equivalent() = {effect.equivalent.begin(), effect.equivalent.end()};
  for (const joint::ComparedValue& value : effect.entries) {
    v1::ComparedValue* to = message->add_values();
    for (const auto& estimate : value.by_session) {
      if (!estimate) continue;
      to->set_name(estimate->name);
      to->set_unit(estimate->unit);
      to->set_finger(estimate->entry);
    }
    to->set_change(ToMessage(value.change));
    WriteBySession(value, taking_part, to);
    to->set_from_session(static_cast<uint32_t>(taking_part[value.from]));
    to->set_to_session(static_cast<uint32_t>(taking_part[value.to]));
    to->set_difference(value.difference);
    to->set_std_error(value.std_error);
    to->set_lower(value.lower);
    to->set_upper(value.upper);
  }
}

}  // namespace

void WriteSessions(const Sessions& sessions, v1::SessionComparison* message) {
  if (sessions.changes) {
    for (const joint::ComparedEffect& effect : sessions.changes->effects)
      WriteEffect(effect, sessions.taking_part, message->add_effects());
  }
  for (const Sessions::Pair& pair : sessions.same_poses) {
    v1::SamePoses* to = message->add_same_poses();
    to->set_from_session(static_cast<uint32_t>(pair.from));
    to->set_to_session(static_cast<uint32_t>(pair.to));
    to->set_poses(static_cast<uint32_t>(pair.measured.poses));
    to->set_rms(Microseconds(pair.measured.rms_s));
    to->set_expected(Microseconds(pair.measured.expected_s));
    to->set_p(pair.measured.p);
    to->set_rms_after(Microseconds(pair.left.rms_s));
    to->set_p_after(pair.left.p);
  }
  message->set_words(sessions.words);
}

}  // namespace touchstone::diagnosis::report
