// How much of the pictures a model explains, under a mistake that is tried: on pictures made smaller, a few of each
// object, so that a hundred trials take seconds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/checks/photographs/photo_mistakes.h"

namespace touchstone::diagnosis::checks {

// Of one picture that was compared.
struct TrialPicture {
  int row = 0;     // of the small set
  int object = 0;  // of the small set as it is, before any fix
  // 1 - r^2 of measured against expected grey levels; 1 where nothing is expected in the picture, or the opposite.
  double left = 1;
  double outline_iou = 0;  // of the expected object and of what stands out of the measured picture
};

class PhotoTrial {
 public:
  PhotoTrial(const DiagnosisInput& input, ThreadPool* pool);  // `input` must outlive it

  // Of the chosen pictures, those that the fix leaves; `model` null: the given one. `only_object` >= 0: of that object
  // alone. Empty where the fixed set cannot be simulated: that mistake is out then.
  std::vector<TrialPicture> Run(const session::ImageSetFix& fix, const model::Model* model,
                                int only_object) const;

  // The same of these rows of the small set, all that the fix leaves.
  std::vector<TrialPicture> RunOn(const std::vector<int>& rows, const session::ImageSetFix& fix,
                                  const model::Model* model) const;
  int size() const {
    return static_cast<int>(small_.size());
  }  // pictures of the small set, the first of the whole

  // Rows of small_set() that are compared.
  const std::vector<int>& rows() const { return rows_; }

 private:
  const DiagnosisInput& input_;
  ThreadPool* pool_;
  session::ImageSet small_;
  int shrink_ = 1;  // pixels of a side that became one
  std::vector<int> rows_;
};

// Mean of the best 70 % of the pictures: a few may be corrupted by something else.
double RobustLeft(std::vector<TrialPicture> pictures);

// The model for pictures whose sides are `shrink` times shorter: values in pixels shrink with them.
model::Model ForSmallPictures(const model::Model& model, int shrink);

}  // namespace touchstone::diagnosis::checks
