// A surface that a diagnosis has found: the map in its model predicts touches that it has not seen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/test_tier.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/touches/simulated_test_set.h"
#include "server/effects/contact/surface_map.h"

namespace touchstone::diagnosis {
namespace {

touches::HiddenRig BumpyRig() {
  touches::HiddenRig rig;
  rig.samples_per_face = 16;
  rig.rounds = 2;
  rig.hidden = {{"surface_error", {"rms_mm=0.3", "length_mm=40"}}};
  return rig;
}

report::Diagnosis DiagnoseWithMap(DiagnosisInput input) {
  input.with_surface_map = true;
  const absl::StatusOr<report::Diagnosis> diagnosis = Diagnose(input, {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *diagnosis : report::Diagnosis();
}

std::string YamlOf(const report::Diagnosis& diagnosis) {
  return diagnosis.improved_model ? model::FormatModel(*diagnosis.improved_model) : "";
}

// What a comparison of the rig's touches with this model finds, us.
double ComparedRmse(const touches::HiddenRig& rig, const std::string& model_yaml) {
  DiagnosisInput input = touches::MakeTestInput(rig);
  const auto model = model::ParseModel(model_yaml, "improved.yaml", effects::Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  if (!model.ok()) return NAN;
  input.model = std::make_shared<const model::Model>(*model);
  const absl::StatusOr<report::Diagnosis> report = Compare(input, {});
  EXPECT_TRUE(report.ok()) << report.status();
  return report.ok() ? report->data[0].initial->rmse : NAN;
}

TEST(SurfaceMapOfADiagnosis, LeavesOnUnseenTouchesWhatTheReportSays) {
  const touches::HiddenRig rig = BumpyRig();
  const report::Diagnosis report = DiagnoseWithMap(touches::MakeTestInput(rig));
  ASSERT_EQ(report.steps.size(), 1u) << report.summary;
  EXPECT_EQ(report.steps[0].effect, "surface_map");
  EXPECT_EQ(report.verdict, engine::Verdict::kMissingEffects) << report.summary;
  // On the same touches: what the report gives as the error.
  EXPECT_NEAR(ComparedRmse(rig, YamlOf(report)), report.data[0].final->rmse,
              0.01 * report.data[0].final->rmse);
  // On other touches of the same objects: what it gives as the error on unseen ones, and not what the same touches have.
  touches::HiddenRig others = rig;
  others.pose_seed = 77;
  const double unseen_us = ComparedRmse(others, YamlOf(report));
  // Steep touches, of which each set has others, weigh most.
  EXPECT_LT(unseen_us, 1.5 * report.data[0].final->heldout_rmse);
  EXPECT_GT(unseen_us, report.data[0].final->heldout_rmse / 1.5);
  EXPECT_GT(unseen_us, 1.2 * report.data[0].final->rmse);
  EXPECT_LT(unseen_us, 0.6 * ComparedRmse(others, model::FormatModel(*touches::MakeTestInput(rig).model)));
}

TEST(SurfaceMapOfADiagnosis, IsClaimedOnlyWhereItIsAskedFor) {
  const absl::StatusOr<report::Diagnosis> report = Diagnose(touches::MakeTestInput(BumpyRig()), {});
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_EQ(report->steps.size(), 1u) << report->summary;
  EXPECT_EQ(report->steps[0].effect, "surface_error");
  EXPECT_EQ(report->data[0].final->rmse, report->data[0].initial->rmse);
}

TEST(SurfaceMapOfADiagnosis, KnowsTheSurfaceWithinItsStandardDeviation) {
  const DiagnosisInput input = touches::MakeTestInput(BumpyRig());
  const report::Diagnosis report = DiagnoseWithMap(input);
  const auto model = model::ParseModel(YamlOf(report), "improved.yaml", effects::Catalogue());
  ASSERT_TRUE(model.ok()) << model.status();
  const auto& spec = model->effects.back().effect->surface_map;
  ASSERT_NE(spec, nullptr) << YamlOf(report);
  // The truth at the map's points, from the effect that hid it.
  const auto hidden = effects::Catalogue().Find("surface_error");
  double squares = 0, count = 0;
  for (const auto& [name, object] : spec->objects) {
    effects::TouchBatch batch;
    batch.Reset(static_cast<int>(object.points.size()), 1);
    batch.surface = input.surfaces.at(name);
    batch.seed = BumpyRig().seed;
    for (int i = 0; i < batch.size(); ++i) {
      const auto& mm = object.points[i].position_mm;
      batch.contact_m[i] = Eigen::Vector3d(mm[0], mm[1], mm[2]) * 1e-3;
      batch.cos_incidence[i] = 1;
      batch.travel_m[i] = 0;
      batch.approach[i] = Eigen::Vector3d::UnitZ();
    }
    hidden->apply({0.3e-3, 40e-3}, batch);
    for (int i = 0; i < batch.size(); ++i) {
      const double z =
          (object.points[i].departure_mm + 1e3 * batch.travel_m[i]) / object.points[i].std_dev_mm;
      squares += z * z, ++count;
    }
  }
  ASSERT_GT(count, 100);
  EXPECT_GT(std::sqrt(squares / count), 0.5);
  EXPECT_LT(std::sqrt(squares / count), 1.5);
}

TEST(SurfaceMapOfADiagnosis, LeavesNothingToFindOnItsOwnTouches) {
  TOUCHSTONE_SECOND_TIER("long: two whole diagnoses");
  DiagnosisInput input = touches::MakeTestInput(BumpyRig());
  const report::Diagnosis report = DiagnoseWithMap(input);
  input.model = std::make_shared<const model::Model>(
      *model::ParseModel(YamlOf(report), "improved.yaml", effects::Catalogue()));
  const report::Diagnosis again = DiagnoseWithMap(input);
  EXPECT_EQ(again.verdict, engine::Verdict::kAdequate) << again.summary;
}

}  // namespace
}  // namespace touchstone::diagnosis
