#include "server/uncertainty/posterior.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/effects/all_effects.h"
#include "server/uncertainty/posterior_message.h"

namespace touchstone::uncertainty {
namespace {

using testing::HasSubstr;

// A tip radius of 2 mm and offsets of fingers that sum to zero, of which the covariance is singular.
Posterior TipAndFingers() {
  Posterior posterior;
  posterior.model = *model::ParseModel(
      "touchstone: model/1\nname: fitted\neffects:\n  - gaussian_noise: {sigma_us: 1000}\n"
      "  - tip_radius: {radius_mm: 2}\n  - finger_length: {offset_mm: [0.1, 0.1, -0.2]}\n",
      "test", effects::Catalogue());
  posterior.values = {{1, 0, 0, "", {}}, {2, 0, 0, "", {}}, {2, 0, 1, "", {}}, {2, 0, 2, "", {}}};
  Eigen::MatrixXd span(4, 3);  // of the values by three independent ones
  span << 1e-4, 0, 0, 2e-5, 3e-5, 0, -1e-5, 1e-5, 2e-5, -1e-5, -4e-5, -2e-5;
  posterior.covariance = span * span.transpose();
  posterior.repeatability_s = 1e-3;
  return posterior;
}

TEST(ModelDraws, HaveThePosteriorsMeansAndCovariance) {
  const auto posterior = std::make_shared<const Posterior>(TipAndFingers());
  const ModelDraws draws(posterior, 7);
  constexpr int kDraws = 20000;
  Eigen::MatrixXd values(kDraws, 4);
  for (int k = 0; k < kDraws; ++k) {
    const auto draw = draws.Of(static_cast<uint64_t>(k));
    ASSERT_TRUE(draw.ok()) << draw.status();
    for (size_t i = 0; i < 4; ++i) {
      values(k, static_cast<int>(i)) = posterior->ValueOf(*draw->model, i);
      EXPECT_NEAR(draw->values[i], values(k, static_cast<int>(i)) * 1e3, 1e-12);
    }
  }
  const Eigen::RowVectorXd mean = values.colwise().mean();
  const Eigen::MatrixXd centred = values.rowwise() - mean;
  const Eigen::MatrixXd covariance = centred.transpose() * centred / (kDraws - 1);
  for (int i = 0; i < 4; ++i) {
    const double error = posterior->StdError(static_cast<size_t>(i));
    EXPECT_NEAR(mean[i], posterior->ValueOf(posterior->model, static_cast<size_t>(i)),
                4 * error / std::sqrt(kDraws));
    for (int j = 0; j < 4; ++j)
      EXPECT_NEAR(covariance(i, j), posterior->covariance(i, j),
                  5 * error * posterior->StdError(static_cast<size_t>(j)) / std::sqrt(kDraws));
  }
}

TEST(ModelDraws, KeepSumsThatAreZero) {
  const ModelDraws draws(std::make_shared<const Posterior>(TipAndFingers()), 3);
  for (uint64_t index = 0; index < 50; ++index) {
    const std::vector<double> values = draws.Of(index)->values;
    EXPECT_NEAR(values[1] + values[2] + values[3], 0, 1e-9);
  }
}

TEST(ModelDraws, DependOnSeedAndIndexAlone) {
  const auto posterior = std::make_shared<const Posterior>(TipAndFingers());
  const ModelDraws one(posterior, 3), same(posterior, 3), other(posterior, 4);
  ASSERT_TRUE(one.Of(11).ok());
  EXPECT_EQ(one.Of(5)->values, same.Of(5)->values);
  EXPECT_NE(one.Of(5)->values, one.Of(6)->values);
  EXPECT_NE(one.Of(5)->values, other.Of(5)->values);
}

TEST(ModelDraws, StayWithinBounds) {
  Posterior posterior = TipAndFingers();
  posterior.SetValue(0, 1e-5, &posterior.model);  // a tenth of its standard error from no radius at all
  const ModelDraws draws(std::make_shared<const Posterior>(posterior), 1);
  double largest = 0;
  for (uint64_t index = 0; index < 500; ++index) {
    const auto draw = draws.Of(index);
    ASSERT_TRUE(draw.ok()) << draw.status();
    EXPECT_GE(draw->values[0], 0);
    largest = std::max(largest, draw->values[0]);
  }
  EXPECT_GT(largest, 0.2);
}

TEST(ModelDraws, SayWhichValueNoDrawKeepsWithinItsBounds) {
  Posterior posterior = TipAndFingers();
  posterior.SetValue(0, -1e-3, &posterior.model);  // ten standard errors beyond
  const auto draw = ModelDraws(std::make_shared<const Posterior>(posterior), 1).Of(0);
  EXPECT_THAT(std::string(draw.status().message()), HasSubstr("tip_radius.radius_mm"));
}

TEST(PosteriorMessage, ReadsBackToTheSamePosterior) {
  Posterior posterior = TipAndFingers();
  posterior.values[0].between_sessions = 3e-5;
  posterior.measured["lat20"] = {{{0.01, 0.02, 0.03}}, {{0, 0, 1}}};
  posterior.surface_rms_m = 1e-5, posterior.surface_length_m = 0.01;
  const auto read = FromMessage(ToMessage(posterior));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->model.Hash(), posterior.model.Hash());
  EXPECT_TRUE(read->covariance.isApprox(posterior.covariance, 1e-12));
  EXPECT_DOUBLE_EQ(*read->values[0].between_sessions, 3e-5);
  EXPECT_FALSE(read->values[1].between_sessions.has_value());
  EXPECT_TRUE(read->measured.at("lat20").contact_m[0].isApprox(Eigen::Vector3d(0.01, 0.02, 0.03), 1e-6));
  EXPECT_EQ(ToMessage(*read).values(3).SerializeAsString(),
            ToMessage(posterior).values(3).SerializeAsString());
}

TEST(PosteriorMessage, NamesWhatDoesNotFitTogether) {
  const v1::ModelPosterior whole = ToMessage(TipAndFingers());
  const auto error_after = [&](const std::function<void(v1::ModelPosterior*)>& change) {
    v1::ModelPosterior message = whole;
    change(&message);
    return std::string(FromMessage(message).status().message());
  };
  EXPECT_THAT(error_after([](auto* m) { m->set_model_hash("00"); }), HasSubstr("posterior.model_hash"));
  EXPECT_THAT(error_after([](auto* m) { m->clear_model_yaml(); }),
              HasSubstr("posterior.model_yaml is empty"));
  EXPECT_THAT(error_after([](auto* m) { m->mutable_values(0)->set_value(3); }),
              HasSubstr("but the model has 2"));
  EXPECT_THAT(error_after([](auto* m) { m->mutable_values(0)->set_effect_index(9); }),
              HasSubstr("the model has 3 effects"));
  EXPECT_THAT(error_after([](auto* m) { m->mutable_values(0)->set_effect("tool_yaw"); }),
              HasSubstr("is 'tip_radius'"));
  EXPECT_THAT(error_after([](auto* m) { m->mutable_values(1)->set_finger("q"); }), HasSubstr("no entry 'q'"));
  EXPECT_THAT(error_after([](auto* m) { m->mutable_covariance()->RemoveLast(); }),
              HasSubstr("4 values have 10"));
  EXPECT_THAT(error_after([](auto* m) { m->set_covariance(1, 1); }), HasSubstr("correlation lies beyond 1"));
  EXPECT_THAT(error_after([](auto* m) { m->set_covariance(0, -1); }), HasSubstr("variance is negative"));
  EXPECT_THAT(error_after([](auto* m) { m->set_covariance(0, NAN); }), HasSubstr("is no number"));
  EXPECT_THAT(error_after([](auto* m) { m->set_unit("grey"); }), HasSubstr("only touches have a posterior"));
}

}  // namespace
}  // namespace touchstone::uncertainty
