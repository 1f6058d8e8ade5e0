// The shape of the report that others rely on, whatever was measured.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "server/diagnosis/report/join.h"
#include "server/diagnosis/report/kinds/example_diagnosis.h"
#include "server/diagnosis/report/kinds/from_boards.h"
#include "server/diagnosis/report/kinds/from_photographs.h"
#include "server/diagnosis/report/message/write_report.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using testing::ElementsAre;

// A message and all that it holds.
void Collect(const Descriptor* message, std::set<const Descriptor*>* all) {
  if (!all->insert(message).second) return;
  for (int i = 0; i < message->field_count(); ++i)
    if (const Descriptor* part = message->field(i)->message_type()) Collect(part, all);
}

std::set<const Descriptor*> MessagesOfReport() {
  std::set<const Descriptor*> all;
  Collect(v1::Report::descriptor(), &all);
  return all;
}

TEST(ReportMessage, HasNoFieldTwiceInTwoUnits) {
  for (const Descriptor* message : MessagesOfReport()) {
    std::map<std::string, std::string> stems;
    for (int i = 0; i < message->field_count(); ++i) {
      std::string stem = message->field(i)->name();
      for (const std::string unit : {"_us", "_grey", "_px"})
        if (stem.size() > unit.size() && stem.compare(stem.size() - unit.size(), unit.size(), unit) == 0)
          stem.resize(stem.size() - unit.size());
      const auto [other, is_new] = stems.emplace(stem, message->field(i)->name());
      EXPECT_TRUE(is_new) << message->name() << ": " << other->second << ", " << message->field(i)->name();
    }
  }
}

TEST(ReportMessage, NamesNoUnitOfAKindOfMeasurement) {
  for (const Descriptor* message : MessagesOfReport())
    for (int i = 0; i < message->field_count(); ++i)
      for (const char* unit : {"_us", "_grey"})
        EXPECT_FALSE(message->field(i)->name().find(unit) != std::string::npos)
            << message->name() << "." << message->field(i)->name();
}

TEST(ReportMessage, HasTheFieldsThatOthersRelyOn) {
  const std::map<const Descriptor*, std::vector<const char*>> fields = {
      {v1::Report::descriptor(),
       {"verdict", "data_problems", "superfluous", "refitted", "steps", "data", "next", "summary",
        "warnings"}},
      {v1::DataProblem::descriptor(), {"kind", "detail", "words", "fix", "error_after"}},
      {v1::Step::descriptor(), {"effect", "equivalent", "probability", "scope", "words", "parameters"}},
      {v1::ParameterValue::descriptor(), {"name", "value", "std_error", "unit"}},
      {v1::DataReport::descriptor(),
       {"kind", "unit", "session", "emulated", "count", "set_aside", "noise_floor", "initial", "after_step",
        "final", "where", "unexplained"}},
      {v1::SetAside::descriptor(), {"count", "words"}},
      {v1::Quality::descriptor(), {"rmse", "heldout_rmse", "lack_of_fit_p"}},
      {v1::Slice::descriptor(), {"slice", "count", "mean_residual", "share_of_excess_error"}},
      {v1::Unexplained::descriptor(), {"covariates", "formula", "lookup_yaml", "heldout_gain"}},
      {v1::CovariateTest::descriptor(), {"name", "p"}}};
  for (const auto& [message, names] : fields)
    for (const char* name : names)
      EXPECT_NE(message->FindFieldByName(name), nullptr) << message->name() << "." << name;
}

images::PhotographDiagnosis FoundInPhotographs() {
  images::PhotographDiagnosis found;
  found.verdict = engine::Verdict::kMissingEffects;
  found.images = 36;
  found.objects = {"lat00"};
  found.noise_floor.sigma = 2;
  found.noise_floor.from_repeats = true;
  found.initial = engine::Quality{12, 12.5, 1e-9};
  found.final = engine::Quality{2.1, 2.2, 0.3};
  engine::LadderStep step;
  step.effect = "exposure";
  step.probability = 0.99;
  step.quality = *found.final;
  found.steps = {step};
  found.where = {{"radius > 0.7", 30, -3, 9, 0.6, "darker"}};
  return found;
}

session::ImageSet Photographs() {
  session::ImageSet set;
  set.origin = "photos";
  set.objects = {"lat00"};
  set.photographs.resize(36);
  for (session::PhotographRow& row : set.photographs) row.covariates["cov_emulated"] = 1;
  return set;
}

TEST(FromPhotographs, GivesGreyLevels) {
  const v1::Report report = ToReport(FromPhotographs(FoundInPhotographs(), Photographs()));
  ASSERT_EQ(report.data_size(), 1);
  const v1::DataReport& data = report.data(0);
  EXPECT_EQ(data.kind(), v1::DataReport::PHOTOGRAPHS);
  EXPECT_EQ(data.unit(), "grey");
  EXPECT_EQ(data.session(), "photos");
  EXPECT_TRUE(data.emulated());
  EXPECT_EQ(data.count(), 36u);
  EXPECT_DOUBLE_EQ(data.noise_floor(), 2);
  EXPECT_DOUBLE_EQ(data.initial().rmse(), 12);
  ASSERT_EQ(data.after_step_size(), report.steps_size());
  EXPECT_DOUBLE_EQ(data.after_step(0).heldout_rmse(), 2.2);
  EXPECT_DOUBLE_EQ(data.where(0).mean_residual(), -3);
  EXPECT_EQ(data.where(0).count(), 30u);
  EXPECT_TRUE(data.has_photographs());
  EXPECT_FALSE(data.has_distributions());
}

TEST(FromBoards, GivesPixelsAndWhatIsLeftWithItsError) {
  boards::BoardDiagnosis found;
  found.verdict = engine::Verdict::kUnexplained;
  found.pictures = 20;
  found.initial = engine::Quality{1.2, 1.3, 1e-9};
  found.final = engine::Quality{0.4, 0.5, 0.01};
  found.noise.sigma = 0.1;
  engine::LadderStep step;
  step.effect = "radial_distortion";
  step.quality = *found.final;
  found.steps = {step};
  boards::BoardRest rest;
  rest.name = "tangential distortion";
  rest.quality = {0.15, 0.16, 0.5};
  found.rest = {rest};
  boards::BoardSet set;
  set.origin = "boards";
  set.pictures.resize(20);
  set.without_board = {"blurred.png"};
  const v1::Report report = ToReport(FromBoards(found, set));
  ASSERT_EQ(report.data_size(), 1);
  const v1::DataReport& data = report.data(0);
  EXPECT_EQ(data.kind(), v1::DataReport::BOARDS);
  EXPECT_EQ(data.unit(), "px");
  EXPECT_EQ(data.set_aside().count(), 1u);
  EXPECT_EQ(data.set_aside().words(), "1: the whole board is not in the picture");
  EXPECT_DOUBLE_EQ(data.noise_floor(), std::sqrt(2.0) * 0.1);  // of a corner: two coordinates
  EXPECT_DOUBLE_EQ(data.reducible_share(), 1 - 0.02 / 1.44);
  EXPECT_FALSE(data.noise().from_repeats());
  ASSERT_EQ(data.after_step_size(), 1);
  EXPECT_DOUBLE_EQ(data.after_step(0).rmse(), 0.4);
  EXPECT_DOUBLE_EQ(data.unexplained().rmse(), 0.15);
  EXPECT_THAT(data.unexplained().words(), testing::HasSubstr("tangential distortion"));
}

// Touches with a radius, photographs with an exposure, and a pose that both show.
JointParts PartsOfBoth() {
  JointParts parts;
  parts.model_name = "nominal";
  parts.touches = ExampleDiagnosis(engine::Verdict::kMissingEffects);
  parts.touches.steps = {ExampleStep("tip_radius")};
  parts.touches.data[0].after_step = {{5000, 5030, 0.4}};
  parts.photographs = FromPhotographs(FoundInPhotographs(), Photographs());
  parts.initial = {{41000, 41100, 0}, {15, 15.5, 0}};
  parts.shared_quality = {{{20000, 20000, 0}, {12, 12.5, 0}}};
  joint::SharedStep pose;
  pose.effect = "object_pose";
  pose.shown_by = "both";
  engine::ParameterEstimate x = RadiusMm();
  x.std_error_alone = {{"touches", 0.1}};
  pose.parameters = {x};
  parts.shared.steps = {pose};
  parts.shared.heldout = {{1.1, 0}, {1, 0}};
  return parts;
}

TEST(Join, HasAnErrorOfEachKindAfterEveryStep) {
  const v1::Report report = ToReport(Join(PartsOfBoth()));
  ASSERT_EQ(report.steps_size(), 3);
  ASSERT_EQ(report.data_size(), 2);
  for (const v1::DataReport& data : report.data()) EXPECT_EQ(data.after_step_size(), 3);
  const v1::DataReport &touches = report.data(0), &photographs = report.data(1);
  EXPECT_EQ(touches.kind(), v1::DataReport::TOUCHES);
  EXPECT_EQ(photographs.kind(), v1::DataReport::PHOTOGRAPHS);
  EXPECT_DOUBLE_EQ(touches.initial().rmse(), 41000);
  EXPECT_DOUBLE_EQ(photographs.initial().rmse(), 15);
  const auto rmse = [](const v1::DataReport& data) {
    std::vector<double> errors;
    for (const v1::Quality& quality : data.after_step()) errors.push_back(quality.rmse());
    return errors;
  };
  EXPECT_THAT(rmse(touches), ElementsAre(20000, 5000, 5000));
  EXPECT_THAT(rmse(photographs), ElementsAre(12, 12, 2.1));
  EXPECT_DOUBLE_EQ(touches.after_step(0).heldout_rmse(), 22000);
  EXPECT_DOUBLE_EQ(touches.final().heldout_rmse(), 1.1 * 5030);
}

TEST(Join, SaysWhichKindShowsAStepAndWhatEachAloneWouldGive) {
  const v1::Report report = ToReport(Join(PartsOfBoth()));
  EXPECT_THAT(report.steps(0).shown_by(), ElementsAre(v1::DataReport::TOUCHES, v1::DataReport::PHOTOGRAPHS));
  EXPECT_THAT(report.steps(1).shown_by(), ElementsAre(v1::DataReport::TOUCHES));
  EXPECT_THAT(report.steps(2).shown_by(), ElementsAre(v1::DataReport::PHOTOGRAPHS));
  const v1::ParameterValue& value = report.steps(0).parameters(0);
  ASSERT_EQ(value.alone_size(), 1);
  EXPECT_EQ(value.alone(0).kind(), v1::DataReport::TOUCHES);
  EXPECT_DOUBLE_EQ(value.alone(0).std_error(), 0.1);
}

TEST(Join, TellsOfAContradictionInBothEntries) {
  JointParts parts = PartsOfBoth();
  parts.shared.steps.clear();
  parts.shared.conflicts.resize(1);
  parts.shared.conflicts[0].effect = "object_pose";
  const v1::Report report = ToReport(Join(parts));
  EXPECT_EQ(report.verdict(), v1::Report::UNEXPLAINED);
  for (const v1::DataReport& data : report.data())
    EXPECT_THAT(data.unexplained().words(), testing::HasSubstr("contradict each other about object_pose"));
}

TEST(SideBySide, KeepsEachKindsProblemsWithItsEntry) {
  Diagnosis photographs = FromPhotographs(FoundInPhotographs(), Photographs());
  photographs.verdict = engine::Verdict::kCheckData;
  photographs.data_problems.resize(1);
  photographs.data_problems[0].kind = engine::ProblemKind::kMirrored;
  const v1::Report report =
      ToReport(SideBySide(ExampleDiagnosis(engine::Verdict::kNone), std::move(photographs)));
  EXPECT_EQ(report.verdict(), v1::Report::CHECK_DATA);
  ASSERT_EQ(report.data_problems_size(), 1);
  EXPECT_EQ(report.data_problems(0).kind(), v1::DataProblem::MIRRORED);
  EXPECT_EQ(report.data(report.data_problems(0).data_index()).kind(), v1::DataReport::PHOTOGRAPHS);
}

}  // namespace
}  // namespace touchstone::diagnosis::report
