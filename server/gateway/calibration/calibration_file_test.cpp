#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/gateway/calibration/calibration.h"

namespace touchstone::gateway::calibration {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using ::testing::Not;

const char kFile[] =
    "touchstone: calibration/1\n"
    "flange_from_tip: {translation_mm: [0, 0, 120], rotation_deg: [0, 0, 90]}\n"
    "flange_from_camera: {translation_mm: [0, 60, 40], rotation_deg: [0, 0, 0]}\n"
    "base_from_object:\n"
    "  lat20: {translation_mm: [300, 0, 100.5], rotation_deg: [0.3, -0.2, 30]}\n"
    "  \"cup: blue\": {translation_mm: [-300, 5, 100], rotation_deg: [0, 0, 0]}\n"
    "made: {date: 2026-01-31, how: \"by hand\", rms_mm: {lat20: 0.02}}\n";

std::string ErrorOf(const std::string& text) {
  return std::string(ParseCalibration(text, "rig.yaml").status().message());
}

TEST(CalibrationFile, MillimetresAndDegreesBecomePoses) {
  const auto calibration = ParseCalibration(kFile, "rig.yaml");
  ASSERT_TRUE(calibration.ok()) << calibration.status();
  EXPECT_TRUE(calibration->flange_from_tip.translation().isApprox(Vector3d(0, 0, 0.12)));
  EXPECT_TRUE((calibration->flange_from_tip.linear() * Vector3d::UnitX()).isApprox(Vector3d::UnitY(), 1e-12));
  EXPECT_TRUE(calibration->has_camera);
  EXPECT_TRUE(calibration->flange_from_camera.translation().isApprox(Vector3d(0, 0.06, 0.04)));
  ASSERT_EQ(calibration->base_from_object.size(), 2u);
  EXPECT_TRUE(
      calibration->base_from_object.at("cup: blue").translation().isApprox(Vector3d(-0.3, 0.005, 0.1)));
  EXPECT_EQ(calibration->notes.at("date"), "2026-01-31");
  EXPECT_EQ(calibration->notes.at("rms_mm lat20"), "0.02");
}

TEST(CalibrationFile, WhatIsWrittenIsReadBack) {
  const auto calibration = ParseCalibration(kFile, "rig.yaml");
  ASSERT_TRUE(calibration.ok()) << calibration.status();
  const std::string text = FormatCalibration(*calibration);
  // A person's numbers stay a person's numbers.
  EXPECT_THAT(text, HasSubstr("\"lat20\": {translation_mm: [300, 0, 100.5], rotation_deg: [0.3, -0.2, 30]}"));
  const auto again = ParseCalibration(text, "again.yaml");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(FormatCalibration(*again), text);
  EXPECT_EQ(again->notes, calibration->notes);
  for (const auto& [name, pose] : calibration->base_from_object)
    EXPECT_TRUE(again->base_from_object.at(name).isApprox(pose, 1e-10)) << name;
}

TEST(CalibrationFile, CameraObjectsAndNotesMayBeMissing) {
  const auto calibration = ParseCalibration(
      "touchstone: calibration/1\nflange_from_tip: {translation_mm: [0, 0, 0], rotation_deg: [0, 0, 0]}\n",
      "a");
  ASSERT_TRUE(calibration.ok()) << calibration.status();
  EXPECT_FALSE(calibration->has_camera);
  EXPECT_TRUE(calibration->base_from_object.empty());
  EXPECT_THAT(FormatCalibration(*calibration), Not(HasSubstr("camera")));
}

TEST(CalibrationFile, TextThatYamlWouldTakeApartSurvives) {
  Calibration calibration;
  calibration.base_from_object["a \"b\"\\: #\t{"] = Eigen::Isometry3d::Identity();
  calibration.notes["how"] = "line one\nline two: {";
  const auto again = ParseCalibration(FormatCalibration(calibration), "again.yaml");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->base_from_object.count("a \"b\"\\: #\t{"), 1u);
  EXPECT_EQ(again->notes, calibration.notes);
}

TEST(CalibrationFile, HalfTurnsAreKept) {
  Calibration calibration;
  calibration.flange_from_tip.linear() =
      Eigen::AngleAxisd(kPi, Vector3d(1, 2, -2).normalized()).toRotationMatrix();
  const auto again = ParseCalibration(FormatCalibration(calibration), "again.yaml");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(again->flange_from_tip.isApprox(calibration.flange_from_tip, 1e-10));
}

TEST(CalibrationFile, ErrorsNameThePlaceAndWhatWouldBeRight) {
  const std::string head = "touchstone: calibration/1\n";
  const std::string tip = "flange_from_tip: {translation_mm: [0, 0, 0], rotation_deg: [0, 0, 0]}\n";
  EXPECT_THAT(ErrorOf("touchstone: model/1\n" + tip), HasSubstr("rig.yaml:1:13: touchstone is 'model/1'"));
  EXPECT_THAT(ErrorOf(tip), HasSubstr("'touchstone: calibration/1' is missing"));
  EXPECT_THAT(ErrorOf(head), HasSubstr("'flange_from_tip' is missing; write for example"));
  EXPECT_THAT(ErrorOf(head + tip + "base_from_objects: {}\n"), HasSubstr("did you mean 'base_from_object'?"));
  EXPECT_THAT(ErrorOf(head + "flange_from_tip: {translation_mm: [0, 0], rotation_deg: [0, 0, 0]}\n"),
              HasSubstr("rig.yaml:2:35: flange_from_tip.translation_mm has 2 numbers; x, y and z are 3"));
  EXPECT_THAT(ErrorOf(head + "flange_from_tip: {translation_m: [0, 0, 0], rotation_deg: [0, 0, 0]}\n"),
              HasSubstr("did you mean 'translation_mm'?"));
  EXPECT_THAT(ErrorOf(head + "flange_from_tip: {translation_mm: [0, 0, far], rotation_deg: [0, 0, 0]}\n"),
              HasSubstr("'far'"));
  EXPECT_THAT(ErrorOf(head + "flange_from_tip: {translation_mm: [0, 0, .nan], rotation_deg: [0, 0, 0]}\n"),
              HasSubstr("nan"));
  EXPECT_THAT(ErrorOf(head + "flange_from_tip: {translation_mm: [0, 0, 1e9], rotation_deg: [0, 0, 0]}\n"),
              HasSubstr("-10000 to 10000 is possible"));
  EXPECT_THAT(ErrorOf(head + tip + "base_from_object: {cup: [1, 2, 3]}\n"),
              HasSubstr("base_from_object.cup is a list; it must be a map"));
  EXPECT_THAT(ErrorOf(head + tip + "made: {date: [1]}\n"), HasSubstr("made.date is a list"));
  const std::string pose = ": {translation_mm: [0, 0, 0], rotation_deg: [0, 0, 0]}}\n";
  EXPECT_THAT(ErrorOf(head + tip + "base_from_object: {\"\"" + pose), HasSubstr("'' has 0 bytes"));
  EXPECT_THAT(ErrorOf(head + tip + "base_from_object: {? " + std::string(257, 'x') + pose),
              HasSubstr("has 257 bytes; a name has 1 to 256"));
  EXPECT_THAT(ErrorOf(head + tip + "made: {rms_mm: {? " + std::string(1100, 'x') + " : 0.02}}\n"),
              HasSubstr("made.rms_mm: 'xxx"));
  EXPECT_THAT(std::string(ReadCalibration("no/such/rig.yaml").status().message()),
              HasSubstr("no/such/rig.yaml"));
}

}  // namespace
}  // namespace touchstone::gateway::calibration
