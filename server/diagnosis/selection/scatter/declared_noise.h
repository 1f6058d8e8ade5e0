// What a model says of the noise, in the terms of the engine.
#pragma once

#include "server/diagnosis/touches/noise/noise_kinds.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::selection {

// Effects whose values differ from object to object are left out: no one value stands for them.
touches::DeclaredNoise DeclaredNoiseOf(const model::Model& model);

// Standard deviation of one reading of a finger, s, if the model gives one for all readings; 0: it does not.
double DeclaredSigma(const model::Model& model);

// The correlated noise that the model gives all objects; nullptr: none.
const model::EffectInstance* DeclaredMemoryOf(const model::Model& model);

}  // namespace touchstone::diagnosis::selection
