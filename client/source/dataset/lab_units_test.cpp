#include "client/source/dataset/lab_units.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

namespace touchstone::client {
namespace {

using Json = nlohmann::ordered_json;

TEST(LabUnits, NamesGetTheUnitOfFiles) {
  EXPECT_EQ(LabNameOf("descriptor_s").name, "descriptor_us");
  EXPECT_EQ(LabNameOf("target_m").name, "target_mm");
  EXPECT_EQ(LabNameOf("speed_m_s").name, "speed_mm_s");
  EXPECT_EQ(LabNameOf("step_angle_rad").name, "step_angle_deg");
  EXPECT_EQ(LabNameOf("session_time_s").name, "session_time_s");
  EXPECT_EQ(LabNameOf("approach").name, "approach");
  EXPECT_EQ(LabNameOf("samples").unit, Unit::kNone);
}

TEST(LabUnits, ANumberThatALabWroteComesBackAsItWasWritten) {
  for (int i = 1; i < 20000; ++i) {
    const double written = i / 100.0;
    for (const Unit unit : {Unit::kMillimetre, Unit::kDegree, Unit::kMicrosecond, Unit::kMillimetrePerSecond})
      ASSERT_EQ(LabNumber(unit, ToSi(unit, written)), written) << UnitSymbol(unit);
  }
}

TEST(LabUnits, JsonGoesThereAndBack) {
  const Json si = Json::parse(
      R"({"plan":{"sphere":{"step_angle_rad":0.017453292519943295},"speed_m_s":0.02,"touch_interval_s":1.5},
          "list":[{"target_m":{"x":0.01,"y":0,"z":-0.15},"covariates":{"cov_length_m":3}}],"samples":"7"})");
  const Json lab = ToLabUnits(si);
  EXPECT_EQ(lab["plan"]["sphere"]["step_angle_deg"], 1.0);
  EXPECT_EQ(lab["plan"]["speed_mm_s"], 20.0);
  EXPECT_EQ(lab["plan"]["touch_interval_s"], 1.5);
  EXPECT_EQ(lab["list"][0]["target_mm"]["z"], -150.0);
  EXPECT_EQ(lab["list"][0]["covariates"]["cov_length_m"], 3) << "the user's own names are left alone";
  EXPECT_EQ(ToSiUnits(lab), si);
}

TEST(LabUnits, ColumnsAreConvertedInTheirOwnType) {
  v1::Column wire;
  wire.set_name("descriptor_s");
  wire.set_type(v1::DATA_TYPE_FLOAT32);
  wire.add_shape(3);
  const float seconds[6] = {0, 0.001f, 0.0025f, 0.5f, 0, 1};
  wire.set_data(seconds, sizeof seconds);
  const FileColumn column = FileColumnOf(wire);
  EXPECT_EQ(column.name, "descriptor_us");
  EXPECT_EQ(UnitSymbol(column.unit), "us");
  std::string bytes;
  AppendLabValues(column, wire, 1, 1, &bytes);
  ASSERT_EQ(bytes.size(), 3 * sizeof(float));
  float values[3];
  std::memcpy(values, bytes.data(), bytes.size());
  EXPECT_EQ(values[0], 500000.0f);
  EXPECT_EQ(values[1], 0.0f);
  EXPECT_EQ(values[2], 1000000.0f);
  EXPECT_EQ(LabText(column, wire, 1), "1000") << "the shortest text of a float, not the digits of a double";
  EXPECT_EQ(LabText(column, wire, 2), "2500");
}

}  // namespace
}  // namespace touchstone::client
