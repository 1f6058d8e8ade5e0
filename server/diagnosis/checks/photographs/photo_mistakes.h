// Data errors of image sets first: before any physics is fitted, a list of discrete mistakes is tried, each with the model
// as it is (data_problems.h does the same for touches).
//
// What a trial measures is the part of a picture's variation that the expected picture does not explain, whatever the
// gain and offset between the two: 1 - r^2, r the correlation of their grey levels. Light, exposure and the sensor change
// r little; a picture that is mirrored, or of another object, has no correlation with what is expected. A mistake is
// claimed only where it must be one (numbers: rules.h):
// - its fix leaves at most max_ratio of that part, and little of it (max_left); physics that is missing would have to equal
//   the mistake in every picture at once;
// - most of the pictures agree (min_agreement), and the outlines fit better than before;
// - no other kind of mistake does nearly as well; those that make the same set (turned by 180 deg; up reversed) are all
//   named.
// Grey pictures cannot show exchanged channels, and a model of white objects says nothing of colour: channels are only
// reported where a part of the pictures has them the other way round than the others.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/input.h"
#include "server/session/images/image_set_fix.h"

namespace touchstone::diagnosis::checks {

// A mistake that explains the misfit. Errors in grey levels are left 0: who compares knows which pixels take part.
struct PhotoMistake {
  engine::DataProblem problem;                // kind, detail and words; fix: of the model's values alone
  session::ImageSetFix fix;                   // of the set; empty: the model is what is wrong
  std::shared_ptr<const model::Model> model;  // the fixed one; null: the set is what is wrong
  double left_before = 0, left_after = 0;     // the part that is not explained, 0 to 1
};

// Most telling first; empty: none does, or there are too few pictures to say. `input` has images; surfaces beyond the
// set's objects are tried as what was photographed. Never fails because of the pictures.
std::vector<PhotoMistake> FindPhotoMistakes(const DiagnosisInput& input, const DiagnosisContext& context);

// "touchstone session fix FOLDER ... -o fixed"; the folder's name is the set's origin where a shell takes it plainly.
std::string FixCommand(const session::ImageSetFix& fix, const session::ImageSet& set);

}  // namespace touchstone::diagnosis::checks
