#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis {
namespace {

using testing::Contains;
using testing::HasSubstr;

report::Diagnosis Compared(const DiagnosisInput& input) {
  const absl::StatusOr<report::Diagnosis> compared = Compare(input, DiagnosisContext());
  EXPECT_TRUE(compared.ok()) << compared.status();
  return compared.ok() ? *compared : report::Diagnosis();
}

// As repeats of their poses, copies would show no noise there.
TEST(PhotographReports, CountAPictureUnderTwoNumbersOnce) {
  images::HiddenCamera rig;
  rig.objects = {"lat10"};
  rig.side_px = 64;
  const DiagnosisInput input = images::MakePhotoInput(rig);
  auto copied = std::make_shared<session::ImageSet>(*input.images);
  for (const int row : {1, 4}) {
    copied->photographs.push_back(copied->photographs[row]);
    copied->photographs.back().image = copied->size() - 1;
    copied->photographs.back().file = "copy" + std::to_string(row) + ".png";
    copied->photographs.back().session_time_s += 1000;
  }
  DiagnosisInput with_copies = input;
  with_copies.images = copied;
  const report::Diagnosis once = Compared(input), twice = Compared(with_copies);
  const report::DataReport &data = twice.data[0], &without = once.data[0];
  EXPECT_EQ(data.rows, 10);
  EXPECT_EQ(data.count, 8);
  EXPECT_EQ(data.repeats, 0);
  EXPECT_EQ(data.set_aside.count(), 2);
  EXPECT_THAT(twice.warnings,
              Contains(HasSubstr("the same picture as another, counted once: copy1.png, copy4.png")));
  EXPECT_EQ(data.noise_floor->sigma, without.noise_floor->sigma);
  EXPECT_EQ(data.initial->rmse, without.initial->rmse);
  EXPECT_EQ(without.set_aside.count(), 0);
}

TEST(PhotographReports, GiveTheErrorOfTheGivenModelWhereAPictureIsOfTheViewBefore) {
  images::HiddenCamera rig;
  rig.objects = {"lat10"};
  rig.side_px = 64;
  rig.photographs = 9;
  DiagnosisInput input = images::MakePhotoInput(rig);
  auto stale = std::make_shared<session::ImageSet>(*input.images);
  stale->photographs[4].pixels = stale->photographs[3].pixels;
  stale->photographs[4].pixels[0] += 1;  // no copy
  input.images = stale;
  const absl::StatusOr<report::Diagnosis> found = Diagnose(input, DiagnosisContext());
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(found->verdict, engine::Verdict::kCheckData);
  ASSERT_EQ(found->data_problems.size(), 1u);
  EXPECT_EQ(found->data_problems[0].detail, "image 4");
  ASSERT_TRUE(found->data[0].final);
  EXPECT_EQ(found->data[0].final->rmse, found->data[0].initial->rmse);
}

}  // namespace
}  // namespace touchstone::diagnosis
