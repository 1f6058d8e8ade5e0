#include "server/dataset/specification.h"

#include <gmock/gmock.h>

#include "server/dataset/test_support.h"

namespace touchstone::dataset {
namespace {

using testing::HasSubstr;

std::string Refusal(DatasetSpecification specification) {
  return std::string(ValidateDataset(&specification).message());
}

TEST(DatasetSpecification, RefusesWhatCannotBeDrawnByName) {
  DatasetSpecification endless = SmallDataset(0), empty = SmallDataset(10), blind = SmallDataset(10),
                       many = SmallDataset(10);
  EXPECT_THAT(Refusal(endless), HasSubstr("samples = 0: a sphere plan has no end"));
  empty.objects.clear();
  EXPECT_THAT(Refusal(empty), HasSubstr("objects is empty"));
  blind.columns.image = true;
  EXPECT_THAT(Refusal(blind), HasSubstr("no renderer"));
  blind.image.options.width = 20000;
  EXPECT_THAT(Refusal(blind), HasSubstr("20000"));
  many.plan.kind = touch::Plan::Kind::kFaces;
  many.samples = 577;
  EXPECT_THAT(Refusal(many), HasSubstr("at most 576"));
}

TEST(DatasetSpecification, APlanThatEndsTakesAllOfItsTouchesForEveryObject) {
  DatasetSpecification specification = SmallDataset(0);
  specification.plan.kind = touch::Plan::Kind::kFaces;
  ASSERT_TRUE(ValidateDataset(&specification).ok());
  EXPECT_EQ(specification.samples, 3u * 192u);
}

TEST(ColumnChoice, UnknownNamesAreRefusedWithANearOne) {
  EXPECT_THAT(std::string(ColumnChoice::FromNames({"descripter"}).status().message()),
              HasSubstr("did you mean 'descriptor'?"));
}

TEST(ColumnsOf, EveryNumberColumnTellsItsUnitAndShape) {
  const std::vector<ColumnInfo> columns = ColumnsOf(SmallDataset(1));
  ASSERT_EQ(columns[2].name, "descriptor_s");
  EXPECT_EQ(columns[2].BytesPerSample(), 12u);
  EXPECT_EQ(columns.back().name, "normal");
  EXPECT_EQ(columns.back().BytesPerSample(), 36u);
}

}  // namespace
}  // namespace touchstone::dataset
