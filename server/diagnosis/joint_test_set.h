// For tests: touches and photographs of the same objects, each with what is hidden from it.
#pragma once

#include "server/diagnosis/images/photo_test_set.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::joint {

struct HiddenSession {
  touches::HiddenRig rig;
  images::HiddenCamera camera;
};

// What both kinds have hidden alike.
inline HiddenSession WithHidden(const images::NamedValues& hidden) {
  HiddenSession session;
  session.rig.hidden = session.camera.hidden = hidden;
  session.camera.side_px = 64;
  return session;
}

struct JointInputs {
  DiagnosisInput touches, photographs;
};

inline JointInputs MakeInputs(const HiddenSession& session) {
  return {touches::MakeTestInput(session.rig), images::MakePhotoInput(session.camera)};
}

// As one folder holds them.
inline DiagnosisInput MakeJointInput(const HiddenSession& session) {
  const JointInputs parts = MakeInputs(session);
  DiagnosisInput input = parts.photographs;
  input.set = parts.touches.set;
  model::Model both = *parts.touches.model;
  for (const model::EffectInstance& instance : parts.photographs.model->effects)
    if (instance.effect->of_photos()) both.effects.push_back(instance);
  input.model = std::make_shared<const model::Model>(std::move(both));
  return input;
}

}  // namespace touchstone::diagnosis::joint
