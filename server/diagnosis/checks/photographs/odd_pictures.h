// Single pictures that the model does not explain, where it explains all others: of the view of the row before, exchanged with
// one another, turned, of a camera that was held the other way round, or of something that images.csv does not know.
#pragma once

#include <vector>

#include "server/diagnosis/checks/photographs/photo_mistake_list.h"
#include "server/diagnosis/checks/photographs/photo_trial.h"

namespace touchstone::diagnosis::checks {

struct OddPictures {
  CandidateMistake mistake;  // its fix takes the pictures out where no other is found
  double before = 1,
         after = 1;  // TrialPicture::left of these pictures, mean; after: that of the others where they go
};

// At most a tenth of the pictures, and of the view before at most two fifths; empty: all are alike, or too few are explained.
std::vector<OddPictures> FindOddPictures(const PhotoTrial& trial, const session::ImageSet& set);

}  // namespace touchstone::diagnosis::checks
