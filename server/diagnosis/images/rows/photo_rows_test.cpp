#include "server/diagnosis/images/rows/photo_rows.h"

#include <gtest/gtest.h>

#include <vector>

#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::images {
namespace {

class PhotoRowsTest : public ::testing::Test {
 protected:
  PhotoRowsTest() {
    HiddenCamera rig;
    rig.photographs = 3;
    rig.side_px = 64;
    const DiagnosisInput input = MakePhotoInput(rig);
    photographs = *MakePhotographs(input, nullptr);
    anchor = *input.model;
    rows = *PhotoRows::Make(photographs, anchor, {}, PhotoRowsOptions(), nullptr);
  }
  // Those of every other photograph, and the first of all.
  std::vector<int> Unread() const {
    std::vector<int> unread;
    for (int row = 0; row < rows->rows(); ++row)
      if (rows->PhotographOfRow(row) % 2 == 1 || row == 0) unread.push_back(row);
    return unread;
  }
  Photographs photographs;
  model::Model anchor;
  std::unique_ptr<PhotoRows> rows;
};

TEST_F(PhotoRowsTest, SimulateOnlyPhotographsWithARowThatIsRead) {
  const model::Model model = WithPhotoEffects(anchor, {{"exposure", {"stops=0.2"}}});
  const std::vector<double> some = *rows->PredictOthers(model, Unread());
  // What was not simulated is not taken for known later.
  const std::vector<double> all = *rows->Predict(model);
  const model::Model at = WithPhotoEffects(anchor, {{"gamma", {"exponent=1"}}}),
                     moved = WithPhotoEffects(anchor, {{"gamma", {"exponent=1.1"}}});
  const std::vector<double> there = *rows->Predict(at), near = *rows->PredictNear(moved, at, there),
                            some_near = *rows->PredictOthersNear(moved, at, there, Unread());
  for (int row = 0; row < rows->rows(); ++row) {
    const bool read = rows->PhotographOfRow(row) % 2 == 0;
    EXPECT_EQ(some[row], read ? all[row] : 0) << row;
    if (read) {
      EXPECT_EQ(some_near[row], near[row]) << row;
    }
    EXPECT_NE(all[row], 0) << row;
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::images
