#include "server/diagnosis/engine/ladder/where_in_words.h"

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

Fit FitOf(Parameterization model, const Eigen::VectorXd& point) {
  Fit fit;
  model.MoveTo(point);
  fit.covariance = 1e-12 * Eigen::MatrixXd::Identity(model.size(), model.size());  // 1 um
  fit.model = std::move(model);
  fit.point = point;
  return fit;
}

Fit LengthsMm(double l, double m, double r) {
  model::Model base =
      *model::AddEffect(model::NominalModel(), "finger_length",
                        {absl::StrCat("offset_mm=", l, ",", m, ",", r)}, effects::Catalogue());
  Parameterization model(base, {"a", "b"});
  model.Free(0, false);
  const Eigen::VectorXd start = model.Start();
  return FitOf(std::move(model), start);
}

TEST(WhereInWords, NamesTheOneObject) {
  Parameterization model(model::NominalModel(), {"a", "b"});
  model.AddOn(effects::Catalogue().Find("object_push"), "b");
  EXPECT_EQ(WhereInWords(FitOf(model, Eigen::VectorXd::Constant(1, 1e-3)), SelectedStep()),
            "Acts on b only.");
}

TEST(WhereInWords, SaysWhatCannotBeTold) {
  Parameterization model(model::NominalModel(), {"a", "b"});
  model.AddOn(effects::Catalogue().Find("object_push"), "b");
  SelectedStep step;
  CompetingEffect everywhere;
  everywhere.name = "object_push";
  everywhere.equivalent = true;
  step.competing = {everywhere};
  EXPECT_EQ(WhereInWords(FitOf(model, Eigen::VectorXd::Constant(1, 1e-3)), step),
            "Acts on b only, or on all objects alike: these data cannot tell.");
}

TEST(WhereInWords, SaysNothingOfAnEffectOfTheRig) {
  Parameterization model(model::NominalModel(), {"a", "b"});
  model.Add(effects::Catalogue().Find("object_push"), false);
  EXPECT_EQ(WhereInWords(FitOf(model, Eigen::VectorXd::Constant(1, 1e-3)), SelectedStep()), "");
}

TEST(WhereInWords, NamesTheOneFingerThatDiffers) {
  EXPECT_EQ(WhereInWords(LengthsMm(-0.1, 0.2, -0.1), SelectedStep()),
            "Acts on finger m only: the others agree within their errors.");
  EXPECT_EQ(WhereInWords(LengthsMm(-0.3, 0.2, 0.1), SelectedStep()), "");
  // Two that may differ do not agree, though their errors allow it.
  EXPECT_EQ(WhereInWords(LengthsMm(0.005, -0.00125, -0.00375), SelectedStep()), "");
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
