// What each of several sessions still asks for under a model of its own, once the effects of all sessions are in place.
#pragma once

#include <vector>

#include "server/diagnosis/report/diagnosis.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/model/model.h"

namespace touchstone::diagnosis {

// Whether all that a diagnosis adds to its model, or fits anew, is noise.
bool AsksForNoiseAlone(const report::Diagnosis& one);

// Noise belongs to one session and becomes part of its model. Any other effect is a rest: the sessions do not agree on it.
class SessionRests {
 public:
  // one: the diagnosis of the session under `own`, which gets the noise that it asks for. The verdict on what is left.
  engine::Verdict Add(const report::Diagnosis& one, int session, model::Model* own);

  const std::vector<int>& unexplained() const { return unexplained_; }  // sessions
  const std::vector<report::AskedByOne>& asked_by_one() const { return asked_by_one_; }
  // Kinds of noise that sessions lack; of one that several lack, as the last of these found it.
  const std::vector<report::Step>& noise_steps() const { return noise_steps_; }
  bool changed_noise() const { return changed_noise_; }  // a session has another noise than the given model

 private:
  void TakeNoise(const report::Diagnosis& one, model::Model* own);

  std::vector<int> unexplained_;
  std::vector<report::AskedByOne> asked_by_one_;
  std::vector<report::Step> noise_steps_;
  bool changed_noise_ = false;
};

}  // namespace touchstone::diagnosis
