#include "server/effects/contact/surface_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/effects/all_effects.h"
#include "server/effects/effect_test_batch.h"
#include "server/geometry/surface/surface.h"
#include "server/model/model.h"
#include "server/model/surface_map_file.h"

namespace touchstone::effects {
namespace {

model::SurfaceMapObject TwoPoints() {
  return {20, 0.3, {{{10, 0, 50}, 0.2, 0.02}, {{-30, 5, 50}, -0.1, 0.03}}};
}

std::shared_ptr<const model::Effect> MapOf(const std::string& object) {
  return *MakeSurfaceMapEffect({"map.csv", {{object, TwoPoints()}}});
}

TEST(SurfaceMap, IsItsPointsAtThemAndTheMeshFarAway) {
  const SurfaceDeparture departure(TwoPoints());
  EXPECT_NEAR(departure.At({0.01, 0, 0.05}), 0.2e-3, 1e-9);
  EXPECT_NEAR(departure.At({-0.03, 0.005, 0.05}), -0.1e-3, 1e-9);
  EXPECT_NEAR(departure.At({0, 0, -1}), 0, 1e-12);
  EXPECT_NEAR(departure.StdDevAt({0.01, 0, 0.05}), 0.02e-3, 1e-6);
  EXPECT_NEAR(departure.StdDevAt({0, 0, -1}), 0.3e-3, 1e-9);
  EXPECT_NEAR(departure.NearnessAt({0.01, 0, 0.05}), 1, 1e-12);
}

TEST(SurfaceMap, IsAsOpenAtTwoPlacesAsTheyAreAlike) {
  const SurfaceDeparture departure(TwoPoints());
  const std::vector<Eigen::Vector3d> places = {{0.005, 0, 0.05}, {0, 0, -1}, {0, 0.01, -1}};
  const Eigen::MatrixXd covariance = departure.CovarianceAt(places);
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(std::sqrt(covariance(a, a)), departure.StdDevAt(places[a]), 1e-12);
  // Half a length apart, where the map says nothing: as any such surface. Far apart: not at all.
  const double v = std::sqrt(5.0) * 0.5;
  EXPECT_NEAR(covariance(1, 2), 0.09e-6 * (1 + v + v * v / 3) * std::exp(-v), 1e-12);
  EXPECT_NEAR(covariance(0, 1), 0, 1e-15);
}

TEST(SurfaceMap, FallsOffFromASinglePointAsTheFormatSays) {
  const SurfaceDeparture departure({20, 0.3, {{{0, 0, 0}, 0.2, 0}}});
  const double v = std::sqrt(5.0) * 0.5;  // half a length away
  EXPECT_NEAR(departure.At({0.01, 0, 0}), 0.2e-3 * (1 + v + v * v / 3) * std::exp(-v), 1e-9);
}

TEST(SurfaceMap, ShortensTravelByDepartureOverCosine) {
  TouchBatch before = TestBatch(2, 3);
  before.surface_translation_m = {0.001, 0, 0};
  before.contact_m[before.At(0, 0)] = {0.011, 0, 0.05};  // the first point, on the object that was moved
  before.cos_incidence[before.At(0, 0)] = 0.5;
  TouchBatch after = before;
  MapOf("cube")->apply({}, after);
  const int entry = before.At(0, 0);
  EXPECT_NEAR(before.travel_m[entry] - after.travel_m[entry], 0.4e-3, 1e-9);
  EXPECT_THAT(ChangedFields(before, after), testing::UnorderedElementsAre("travel_m", "contact_m"));
}

TEST(SurfaceMap, LeavesFingersWithoutContactAndOtherObjectsAlone) {
  const TouchBatch before = TestBatch(20, 3, 7, /*all_hit=*/false);
  TouchBatch after = before;
  MapOf("another")->apply({}, after);
  EXPECT_THAT(ChangedFields(before, after), testing::IsEmpty());
  MapOf("cube")->apply({}, after);
  for (size_t e = 0; e < before.travel_m.size(); ++e)
    EXPECT_EQ(std::isnan(before.travel_m[e]), std::isnan(after.travel_m[e]));
}

TEST(SurfaceMap, RefusesWhatIsNoNumberAndWhatHasNoPoint) {
  model::SurfaceMapObject object = TwoPoints();
  object.points[1].departure_mm = NAN;
  EXPECT_FALSE(MakeSurfaceMapEffect({"map.csv", {{"cube", object}}}).ok());
  object.points.clear();
  EXPECT_FALSE(MakeSurfaceMapEffect({"map.csv", {{"cube", object}}}).ok());
  EXPECT_FALSE(MakeSurfaceMapEffect({"map.csv", {}}).ok());
}

TEST(SurfaceMap, TravelsWithinTheModelFile) {
  const model::ModelFileReader files = [](const std::string& name) -> absl::StatusOr<std::string> {
    EXPECT_EQ(name, "map.csv");
    return model::FormatSurfaceMap({{"cube", TwoPoints()}});
  };
  const std::string yaml = "touchstone: model/1\nname: m\neffects:\n  - surface_map: {file: map.csv}\n";
  const auto model = model::ParseModel(yaml, "m.yaml", Catalogue(), files);
  ASSERT_TRUE(model.ok()) << model.status();
  // Without files to read: the content goes along.
  const auto sent = model::ParseModel(model::FormatModel(*model), "sent.yaml", Catalogue());
  ASSERT_TRUE(sent.ok()) << sent.status() << model::FormatModel(*model);
  EXPECT_EQ(sent->Hash(), model->Hash());
  EXPECT_EQ(model::FormatModel(*sent), model::FormatModel(*model));
  EXPECT_THAT(model::FormatModel(*sent, model::FileContent::kBeside),
              testing::HasSubstr("- surface_map: {file: map.csv}\n"));
  TouchBatch here = TestBatch(20, 3), there = here;
  model->effects[0].effect->apply({}, here);
  sent->effects[0].effect->apply({}, there);
  EXPECT_THAT(ChangedFields(here, there), testing::IsEmpty());
}

TEST(SurfaceMap, EntersTheHashByItsContentAndNotByItsName) {
  const auto hash = [](const std::string& file, double departure_mm) {
    model::SurfaceMapObject object = TwoPoints();
    object.points[1].departure_mm = departure_mm;
    model::Model model = model::NominalModel();
    model.effects.push_back({*MakeSurfaceMapEffect({file, {{"cube", object}}}), false, {}, {}});
    return model.Hash();
  };
  EXPECT_EQ(hash("a.csv", -0.1), hash("b.csv", -0.1));
  EXPECT_NE(hash("a.csv", -0.1), hash("a.csv", -0.10001));
  EXPECT_NE(hash("a.csv", -0.1), model::NominalModel().Hash());
}

TEST(SurfaceMap, FilesAreReadForTheUsersOwnModelsOnly) {
  const auto error = [](const std::string& body, const model::ModelFileReader& files) {
    return std::string(
        model::ParseModel("touchstone: model/1\nname: m\neffects:\n  - surface_map: {" + body + "}\n",
                          "m.yaml", Catalogue(), files)
            .status()
            .message());
  };
  EXPECT_THAT(
      error("file: /etc/passwd", nullptr),
      testing::AllOf(testing::HasSubstr("m.yaml:4:"), testing::HasSubstr("'/etc/passwd' is missing")));
  const model::ModelFileReader wrong = [](const std::string&) { return std::string("object,x_mm\n"); };
  EXPECT_THAT(error("file: map.csv", wrong), testing::HasSubstr("map.csv:1:"));
  EXPECT_THAT(error("fil: map.csv", wrong), testing::HasSubstr("did you mean 'file'"));
  const model::ModelFileReader none = [](const std::string& name) -> absl::StatusOr<std::string> {
    return absl::NotFoundError("no " + name);
  };
  EXPECT_THAT(error("file: map.csv", none), testing::HasSubstr("m.yaml:4:"));
}

}  // namespace
}  // namespace touchstone::effects
