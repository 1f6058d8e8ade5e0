// Red and blue exchanged in a part of the pictures. Which part is wrong nothing can tell: the smaller is named.
#pragma once

#include <optional>

#include "server/diagnosis/checks/photographs/photo_mistake_list.h"
#include "server/session/images/image_set.h"

namespace touchstone::diagnosis::checks {

// None where the pictures are grey, hardly coloured, or all of one order.
std::optional<CandidateMistake> MixedChannelOrder(const session::ImageSet& set);

}  // namespace touchstone::diagnosis::checks
