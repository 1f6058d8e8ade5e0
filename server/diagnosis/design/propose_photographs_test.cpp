#include "server/diagnosis/design/propose_photographs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/design/view_candidates.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::design {
namespace {

using images::NamedValues;
using testing::HasSubstr;

constexpr double kDistanceM = 0.6, kFovRad = 0.25, kSigmaGrey = 2;
constexpr int kSidePx = 96;

struct PlacedView {
  std::string object;
  session::CameraPlacement camera;
};

// Photographs of a camera that the model does not know: `hidden`.
DiagnosisInput PhotographedFrom(const std::vector<PlacedView>& views, const NamedValues& hidden) {
  DiagnosisInput input;
  auto set = std::make_shared<session::ImageSet>();
  set->origin = "photographs";
  set->camera.width_px = set->camera.height_px = kSidePx;
  set->camera.fx_px = set->camera.fy_px = 0.5 * kSidePx / std::tan(0.5 * kFovRad);
  set->camera.cx_px = set->camera.cy_px = 0.5 * kSidePx;
  model::Model nominal;
  nominal.name = "nominal";
  nominal = images::WithPhotoEffects(nominal, {{"image_noise", {absl::StrCat("sigma_grey=", kSigmaGrey)}}});
  const image::PhotoSimulator simulator(
      std::make_shared<const model::Model>(images::WithPhotoEffects(nominal, hidden)));
  RandomStream random(5, RandomDomain::kTest);
  for (const PlacedView& view : views) {
    session::PhotographRow row;
    row.image = set->photographs.size();
    row.file = absl::StrCat(row.image, ".png");
    const auto found = std::find(set->objects.begin(), set->objects.end(), view.object);
    row.object = static_cast<int>(found - set->objects.begin());
    if (found == set->objects.end()) set->objects.push_back(view.object);
    row.commanded = view.camera;
    image::PhotoRequest request;
    request.surface = input.surfaces[view.object] = images::PhotoTestSurface(view.object);
    request.object = view.object;
    request.camera.eye_m = view.camera.eye_m;
    request.camera.at_m = view.camera.at_m;
    request.camera.up = view.camera.up;
    request.lens.width = request.lens.height = kSidePx;
    request.lens.fx_px = request.lens.fy_px = set->camera.fx_px;
    request.lens.cx_px = request.lens.cy_px = set->camera.cx_px;
    const absl::StatusOr<image::Photo> photo = simulator.Run(request, image::PhotoOutputs(), nullptr);
    EXPECT_TRUE(photo.ok()) << photo.status();
    for (const float grey : photo->grey)
      row.pixels.push_back(static_cast<uint8_t>(
          std::clamp(std::lround(std::clamp(grey, 0.0f, 255.0f) + kSigmaGrey * random.Normal()), 0L, 255L)));
    set->photographs.push_back(std::move(row));
  }
  input.images = set;
  input.model = std::make_shared<const model::Model>(nominal);
  return input;
}

// All round each object, from one distance, through a long lens.
std::vector<PlacedView> FromOneDistance(int views) {
  std::vector<PlacedView> placed;
  for (const char* object : {"lat10", "lat20"}) {
    const Eigen::Vector3d centre = images::PhotoTestSurface(object)->bounds().Centre();
    for (int n = 0; n < views; ++n) {
      const double azimuth = 2.4 * n, height = 0.2 + 0.6 * n / views;
      placed.push_back(
          {object,
           {centre + kDistanceM * Eigen::Vector3d(std::cos(azimuth) * std::cos(height),
                                                  std::sin(azimuth) * std::cos(height), std::sin(height)),
            centre, Eigen::Vector3d::UnitZ()}});
    }
  }
  return placed;
}

struct Answer {
  images::PhotographDiagnosis diagnosis;
  images::Expectation expectation;
  std::vector<images::ProposedPhotograph> next;
};

Answer Ask(const DiagnosisInput& input, int photographs) {
  Answer answer;
  auto diagnosis = images::DiagnosePhotographs(input, {}, &answer.expectation);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  answer.diagnosis = *std::move(diagnosis);
  auto next =
      ProposePhotographs(answer.expectation.photographs, answer.expectation.left, photographs, 1, nullptr);
  EXPECT_TRUE(next.ok()) << next.status();
  answer.next = *std::move(next);
  return answer;
}

// Whether the diagnosis names this effect alone and is sure of it.
bool IsSureOf(const images::PhotographDiagnosis& diagnosis, const std::string& effect) {
  for (const engine::LadderStep& step : diagnosis.steps)
    if (step.effect == effect && step.equivalent.empty() && step.probability > 0.95) return true;
  return false;
}

TEST(ProposePhotographs, FromAnotherDistanceTellFocalLengthFromCameraTranslation) {
  TOUCHSTONE_SECOND_TIER("long: a proposal over many camera poses");
  if (kUnderSanitizers) GTEST_SKIP() << "two whole diagnoses";
  // The camera stands nearer than commanded: from one distance that looks like a longer lens, which takes fewer values.
  const NamedValues hidden = {{"camera_translation", {"offset_mm=0,0,6"}}};
  std::vector<PlacedView> views = FromOneDistance(4);
  const Answer before = Ask(PhotographedFrom(views, hidden), 8);
  ASSERT_FALSE(before.diagnosis.steps.empty());
  EXPECT_FALSE(IsSureOf(before.diagnosis, "camera_translation"));
  ASSERT_GE(before.next.size(), 4u);
  std::set<std::string> of_pair;
  for (const engine::ExplanationsLeft::NamedModel& left : before.expectation.left.models)
    of_pair.insert(left.name);
  EXPECT_EQ(of_pair.count("focal_error") + of_pair.count("camera_translation"), 2u);
  bool elsewhere = false;
  for (const images::ProposedPhotograph& next : before.next) {
    EXPECT_THAT(next.purpose, HasSubstr("tells "));
    EXPECT_GT(next.separation, 0);
    const double distance_m =
        (next.camera.eye_m - images::PhotoTestSurface(next.object)->bounds().Centre()).norm();
    elsewhere |= std::abs(distance_m / kDistanceM - 1) > 0.2;
    views.push_back({next.object, next.camera});
  }
  EXPECT_TRUE(elsewhere);
  EXPECT_GT(before.next[0].photographs_to_verdict, 0);

  const Answer after = Ask(PhotographedFrom(views, hidden), 0);
  EXPECT_TRUE(IsSureOf(after.diagnosis, "camera_translation"))
      << after.diagnosis.steps.size() << " steps, the first " << after.diagnosis.steps[0].effect << " with p "
      << after.diagnosis.steps[0].probability;
}

images::ExplanationsLeft Between(const std::vector<NamedValues>& effects) {
  images::ExplanationsLeft left;
  for (const NamedValues& values : effects) {
    model::Model model;
    left.models.push_back(
        {values.back().first, std::make_shared<const model::Model>(images::WithPhotoEffects(model, values))});
  }
  left.noise.sigma_grey = kSigmaGrey;
  return left;
}

images::Photographs FewPhotographs() {
  auto photographs = images::MakePhotographs(PhotographedFrom(FromOneDistance(3), {}), nullptr);
  EXPECT_TRUE(photographs.ok()) << photographs.status();
  return *std::move(photographs);
}

TEST(ProposePhotographs, WhatNoPictureCanTellGivesNone) {
  // The same change of every picture: half of it twice.
  const auto left = Between({{{"exposure", {"stops=0.2"}}}, {{"exposure", {"stops=0.2"}}}});
  const auto proposed = ProposePhotographs(FewPhotographs(), left, 6, 1, nullptr);
  ASSERT_TRUE(proposed.ok()) << proposed.status();
  EXPECT_THAT(*proposed, testing::IsEmpty());
}

TEST(ProposePhotographs, ForOneExplanationLearnItsValues) {
  const auto proposed =
      ProposePhotographs(FewPhotographs(), Between({{{"focal_error", {"relative=0.01"}}}}), 4, 1, nullptr);
  ASSERT_TRUE(proposed.ok()) << proposed.status();
  ASSERT_EQ(proposed->size(), 4u);
  for (const images::ProposedPhotograph& next : *proposed) {
    EXPECT_EQ(next.purpose, "learns the values of focal_error");
    EXPECT_EQ(next.photographs_to_verdict, 0);
  }
}

TEST(ProposePhotographs, AreTheSameWhateverTheNumberOfThreads) {
  const images::Photographs photographs = FewPhotographs();
  const auto left =
      Between({{{"focal_error", {"relative=0.01"}}}, {{"camera_translation", {"offset_mm=0,0,6"}}}});
  ThreadPool pool(3);
  const auto one = ProposePhotographs(photographs, left, 4, 1, nullptr),
             many = ProposePhotographs(photographs, left, 4, 1, &pool);
  ASSERT_EQ(one->size(), many->size());
  ASSERT_FALSE(one->empty());
  for (size_t n = 0; n < one->size(); ++n) {
    EXPECT_EQ((*one)[n].camera.eye_m, (*many)[n].camera.eye_m);
    EXPECT_EQ((*one)[n].separation, (*many)[n].separation);
  }
}

TEST(PhotographsToBegin, AreAsManyAsAVerdictNeeds) {
  const auto next = PhotographsToBegin(FewPhotographs(), 5, 1);
  ASSERT_EQ(next.size(), 5u);
  EXPECT_EQ(next[0].separation, 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::design
