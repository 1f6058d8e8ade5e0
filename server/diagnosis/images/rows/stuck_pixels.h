// Pixels of the camera that show the same whatever lies before them: hot ones, dead ones.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

struct StuckPixels {
  std::vector<std::pair<int, int>> places;  // column, row; by rows
  double excess = 0;  // squares of grey levels beyond the noise that they leave, over all pictures
};

// Pixels whose grey level stays within the noise through all pictures, and that stand out of the pixels around them in
// five pictures or more of those where something else is expected there. `expected`: of the model.
StuckPixels FindStuckPixels(const Photographs& photographs, const std::vector<image::Photo>& expected);

// The first of them: "column 12 row 40, column 80 row 3, ...".
std::string PlacesInWords(const StuckPixels& stuck);

}  // namespace touchstone::diagnosis::images
