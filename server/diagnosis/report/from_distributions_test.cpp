#include "server/diagnosis/report/kinds/from_distributions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/report/message/write_report.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::report {
namespace {

using testing::Contains;
using testing::HasSubstr;

std::shared_ptr<const model::Model> NoisyModel() {
  auto model = model::ParseModel(
      "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\n"
      "effects:\n  - gaussian_noise: {sigma_us: 5000}\n",
      "test", effects::Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  return std::make_shared<const model::Model>(*std::move(model));
}

DiagnosisInput Input() {
  auto set = std::make_shared<session::MeasurementSet>();
  set->origin = "test.csv";
  set->fingers = 3;
  set->objects = {"wedge"};
  set->object.assign(72, 0);
  set->time_s.assign(72 * 3, 0);
  DiagnosisInput input;
  input.set = set;
  input.model = NoisyModel();
  return input;
}

// A model that the rounds show to be right.
distributions::PoseFreeComparison Adequate() {
  distributions::PoseFreeComparison comparison;
  comparison.rows.compared = 72;
  comparison.noise_is_known = true;
  comparison.noise = distributions::RoundNoise{0.005, 0.0001, 0.0048, 0.0052, 96};
  comparison.model = NoisyModel();
  comparison.model_has_noise = true;
  comparison.p_value = 0.4;
  comparison.energy_distance_s = 0.002;
  comparison.plan = "faces of the bounding box";
  comparison.diagnosed = true;
  return comparison;
}

v1::Report ReportOf(distributions::PoseFreeComparison comparison) {
  return ToReport(FromDistributions(Input(), std::move(comparison)));
}

TEST(FromDistributions, SaysWhatCannotBeKnown) {
  const v1::Report report = ReportOf(Adequate());
  EXPECT_EQ(report.verdict(), v1::Report::ADEQUATE);
  EXPECT_THAT(report.warnings(), Contains(HasSubstr("cannot be known")));
  EXPECT_THAT(report.warnings(), Contains(HasSubstr("faces of the bounding box")));
  ASSERT_EQ(report.data_size(), 1);
  const v1::DataReport& data = report.data(0);
  EXPECT_EQ(data.kind(), v1::DataReport::DISTRIBUTIONS);
  EXPECT_EQ(data.unit(), "us");
  EXPECT_EQ(data.count(), 72u);
  EXPECT_DOUBLE_EQ(data.noise_floor(), 5000);
  EXPECT_DOUBLE_EQ(data.initial().lack_of_fit_p(), 0.4);
  EXPECT_DOUBLE_EQ(data.distributions().energy_distance(), 2000);
}

TEST(FromDistributions, NamesCompatibleEffectsAndNoCulprit) {
  distributions::PoseFreeComparison comparison = Adequate();
  comparison.compatible = false;
  comparison.compatible_effects = {{"finger_length", "offset_mm = [1, -0.5, -0.5]", 0.6},
                                   {"channel_latency", "latency_us = [5e+04, 0, 0]", 0.4}};
  const v1::Report report = ReportOf(comparison);
  EXPECT_EQ(report.verdict(), v1::Report::UNEXPLAINED);
  EXPECT_EQ(report.steps_size(), 0);
  EXPECT_EQ(report.data(0).distributions().compatible_effects_size(), 2);
  EXPECT_THAT(report.summary(), HasSubstr("finger_length (offset_mm = [1, -0.5, -0.5])"));
  EXPECT_THAT(report.summary(), HasSubstr("write down the poses"));
}

TEST(FromDistributions, MakesNewNoiseAStepAndChangedNoiseARefit) {
  distributions::PoseFreeComparison comparison = Adequate();
  comparison.noise_change = distributions::NoiseChange::kNewEffect;
  v1::Report report = ReportOf(comparison);
  EXPECT_EQ(report.verdict(), v1::Report::MISSING_EFFECTS);
  ASSERT_EQ(report.steps_size(), 1);
  EXPECT_EQ(report.steps(0).effect(), "gaussian_noise");
  EXPECT_EQ(report.data(0).after_step_size(), 1);
  EXPECT_DOUBLE_EQ(report.steps(0).parameters(0).value(), 5000);
  EXPECT_THAT(report.improved_model_yaml(), HasSubstr("gaussian_noise"));

  comparison.noise_change = distributions::NoiseChange::kNewValue;
  report = ReportOf(comparison);
  EXPECT_EQ(report.verdict(), v1::Report::ADEQUATE);
  ASSERT_EQ(report.refitted_size(), 1);
  EXPECT_DOUBLE_EQ(report.refitted(0).parameters(0).std_error(), 100);
}

TEST(FromDistributions, AsksForTheUnitOfTimesOfAnAbsurdSize) {
  distributions::PoseFreeComparison comparison = Adequate();
  comparison.size_ratio = 1000;
  EXPECT_THAT(ReportOf(comparison).warnings(), Contains(HasSubstr("is their unit us")));
}

TEST(FromDistributions, WithoutADiagnosisHasNoVerdict) {
  distributions::PoseFreeComparison comparison = Adequate();
  comparison.diagnosed = false;
  const v1::Report report = ReportOf(comparison);
  EXPECT_EQ(report.verdict(), v1::Report::VERDICT_UNSPECIFIED);
  EXPECT_EQ(report.summary(),
            "As distributions, the measured times do not differ from the model's (p = 0.4).");
}

}  // namespace
}  // namespace touchstone::diagnosis::report
