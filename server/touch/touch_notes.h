// What is odd about commanded touches of an object, in words for people: they are carried out all the same.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/types/span.h>

#include "server/geometry/surface/surface.h"
#include "server/model/model.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::touch {

// Sentences, each once, with the value that is odd and the one that would be right: an object of implausible size for
// the hand (geometry/files/plausible_size.h), and touches whose start is inside of the object, by the model's nominal fingers.
// `first_number` is the number of touches[0] in those sentences.
std::vector<std::string> NotesOnTouches(const geometry::Surface& surface, const model::Model& model,
                                        absl::Span<const CommandedTouch> touches, uint64_t first_number);

// How far the fingers reach across, metres; of a single finger its nominal spacing.
double HandSpanM(const model::Model& model);

}  // namespace touchstone::touch
